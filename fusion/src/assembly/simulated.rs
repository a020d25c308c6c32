//! The streams of a simulated world, from the design alone.

use super::StreamLayout;
use crate::design::{Design, SimulationDesign};
use fusion_models::block::{Channel, imu_channels};
use fusion_models::sim::{IMU, ODOMETRY, REFERENCE, TRACK_SPEEDS, odometry_channels, reference_channels, ship_channels, track_channels};

/// The source that the process names, even if the process itself has mistakes.
fn process_source<P>(design: &Design<P>) -> Option<&str> {
    design.document.root().at("process.source")?.as_str()
}

/// The stream of the simulated instrument `name`. The instrument that drives the process is the odometry if
/// it is simulated, otherwise the IMU. Its stream is the source that the process names, unless that is a stage.
pub fn stream_of<'a, P>(design: &'a Design<P>, name: &'a str) -> &'a str {
    let has_odometry = design.simulation.as_ref().is_some_and(|s| s.block.world.odometry.is_some());
    let driving = if has_odometry { ODOMETRY } else { IMU };
    process_source(design)
        .filter(|_| name == driving)
        .filter(|source| design.stages.iter().all(|stage| stage.name != *source))
        .filter(|source| design.filters.iter().all(|filter| filter.name != *source))
        .unwrap_or(name)
}

/// The streams of a simulated world.
pub(super) fn simulated_streams<P>(design: &Design<P>, simulation: &SimulationDesign) -> Vec<StreamLayout> {
    let mut streams = Vec::new();
    // A process with a source is driven by the IMU; the simulator reports a missing IMU.
    let has_odometry = simulation.world.odometry.is_some();
    if simulation.world.imu.is_some() || (process_source(design).is_some() && !has_odometry) {
        streams.push(StreamLayout::of(stream_of(design, IMU), None, &imu_channels()));
    }
    if has_odometry {
        streams.push(StreamLayout::of(stream_of(design, ODOMETRY), None, &odometry_channels()));
    }
    if simulation.world.track_speeds.is_some() {
        streams.push(StreamLayout::of(TRACK_SPEEDS, None, &track_channels()));
    }
    for (platform, ship) in simulation.world.ships() {
        let own = ship.streams(platform);
        streams.extend(own.map(|(i, name)| StreamLayout::of(&name, None, &ship_channels(i))));
    }
    for (sensor, source, channels) in simulated(design, simulation) {
        // A sensor that reads the output of a stage leaves the stream of that name to the stage.
        let is_stage = design.stages.iter().any(|stage| stage.name == source);
        streams.push(StreamLayout::of(sensor, Some(source).filter(|_| !is_stage), &channels));
    }
    streams.push(StreamLayout::of(REFERENCE, None, &reference_channels()));
    streams
}

/// The simulated sensors of a design, including those that the filter leaves out: name, source, channels.
fn simulated<'a, P>(design: &'a Design<P>, simulation: &'a SimulationDesign) -> impl Iterator<Item = (&'a str, &'a str, Vec<Channel>)> {
    design.sensors.iter().chain(&design.left_out).filter_map(|named| {
        let channels = named.block.model.reading().channels().to_vec();
        let simulated = !channels.is_empty() && simulation.world.sensor.contains_key(&named.name);
        simulated.then_some((named.name.as_str(), named.block.common.source.as_str(), channels))
    })
}
