//! The mistakes of a simulated world that its declaration alone tells, before anything is assembled.

use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Draft, Named, SensorDesign, SimulationDesign};
use crate::rows::{FaultChain, provided};
use fusion_core::math;
use fusion_models::block::{Channel, imu_channels};
use fusion_models::fault::{FaultSpec, derive_seed};
use fusion_models::sim::{
    IMU, ODOMETRY, SensorError, SimulationSpec, TRACK_SPEEDS, odometry_channels, ship_channels, ship_instruments, track_channels,
};
use fusion_models::units::{Vec3Of, dim};

/// Tells `d` every mistake of the trajectory, the rates, the errors of simulated sensors and the
/// faults of simulated streams.
pub(crate) fn check(draft: &Draft, d: &mut Diagnostics) {
    let Some(simulation) = &draft.simulation else { return };
    let SimulationDesign { world, .. } = &simulation.block;
    if draft.run.origin.is_none() && !draft.unread.run {
        d.push(no_origin(simulation));
    }
    let input = draft.process.as_ref().map_or_else(Vec::new, |p| p.block.model.input());
    d.extend(world.mistakes(&input).iter().map(|e| simulation.node.locate(e)));
    // No seed makes a mistake or unmakes it.
    let mistakes = |stream: &str, channels: &[Channel]| faults(simulation, stream, channels, 0).err().unwrap_or_default();
    d.extend(mistakes(IMU, &imu_channels()));
    d.extend(mistakes(ODOMETRY, &odometry_channels()));
    d.extend(mistakes(TRACK_SPEEDS, &track_channels()));
    for (platform, _) in world.ships() {
        for (i, (stream, _)) in ship_instruments(platform).into_iter().enumerate() {
            d.extend(mistakes(&stream, &ship_channels(i)));
        }
    }
    d.extend(draft.sensors.iter().filter_map(|sensor| astray(sensor, world)));
    for sensor in draft.sensors.iter().chain(&draft.left_out) {
        let (Some(errors), reading) = (world.sensor.get(&sensor.name), sensor.block.model.reading()) else {
            continue;
        };
        if reading.channels().is_empty() {
            continue;
        }
        d.extend(mistakes(&sensor.name, reading.channels()));
        if let Err(e) = SensorError::new(errors, &sensor.name, &sensor.block.model.noise(), 0) {
            d.push(simulation.node.locate(&e.within(table(world, &sensor.name))));
        }
    }
}

/// How far a lever arm may be from where the unit is said to be \[m\]: as it is written, rounded.
const SAME_PLACE: f64 = 1e-3;

/// Refuses a constraint of motion, or speeds of tracks, at a point that does not move along the path.
fn astray(sensor: &Named<SensorDesign>, world: &SimulationSpec) -> Option<Diagnostic> {
    let is_of_vehicle = sensor.block.model.reading().channels().is_empty() || sensor.block.common.source == TRACK_SPEEDS;
    let declared = sensor.node.get("lever_arm").filter(|_| is_of_vehicle)?;
    // One that is estimated may truly be another.
    let arm: Vec3Of<dim::Length> = declared.read(&mut Diagnostics::new())?;
    let ([x, y, z], [ux, uy, uz]) = (arm.si(), world.unit.si());
    if math::hypot(math::hypot(x + ux, y + uy), z + uz) < SAME_PLACE {
        return None;
    }
    let message = "in this world the point at `lever_arm` does not move along the path, and slides sideways in a turn";
    let help = format!(
        "say where the inertial unit is from that point: `unit = [{}, {}, {}]` under [simulation]; or leave out the lever arm",
        0.0 - x,
        0.0 - y,
        0.0 - z
    );
    Some(Diagnostic::error(message).at(declared.place()).help(help))
}

pub(crate) fn no_origin(simulation: &Named<SimulationDesign>) -> Diagnostic {
    let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
    Diagnostic::error("a simulated world needs an origin")
        .at(simulation.node.name_place())
        .help(help)
}

/// The table within `[simulation]` that declares a simulated stream.
fn table(world: &SimulationSpec, stream: &str) -> String {
    let own = world.instruments().into_iter().find(|(own, _)| own == stream);
    own.map_or_else(|| format!("sensor.{stream}"), |(_, table)| table)
}

/// The faults declared for a simulated stream.
pub(super) fn declared<'a>(simulation: &'a Named<SimulationDesign>, stream: &str) -> &'a [(String, Box<dyn FaultSpec>)] {
    let mut all = simulation.block.faults.iter();
    all.find(|(of, _)| of == stream).map_or(&[][..], |(_, faults)| faults)
}

/// The same at work on rows of `channels`, or all their mistakes, each at its place.
pub(crate) fn faults(
    simulation: &Named<SimulationDesign>,
    stream: &str,
    channels: &[Channel],
    seed: u64,
) -> Result<FaultChain, Vec<Diagnostic>> {
    let channels = provided(channels.iter().map(|channel| (channel.clone(), 0)));
    let seed_of = |fault: &str| derive_seed(seed, &[stream, fault]);
    let locate = |e: fusion_models::block::BuildError| simulation.node.locate(&e.within(table(&simulation.block.world, stream)));
    FaultChain::new(declared(simulation, stream), &channels, seed_of).map_err(|errors| errors.into_iter().map(locate).collect())
}
