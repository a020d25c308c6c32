//! The rows of a simulated world.

use super::pilot;
use crate::assembly::{Assembly, SensorInfo, assemble, declared_streams, stream_of};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign, Truth};
use crate::load::{faults, no_origin};
use crate::rows::{Aboard, FaultChain, Feed, Pose, Row, SourceReport, SourceStatistics, Stamp};
use core::ops::Range;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::{InitialiserUnit, StreamId};
use fusion_core::state::Layout;
use fusion_core::time::Time;
use fusion_models::earth::LocalFrame;
use fusion_models::sim::{
    DrawnStart, Next, Record, Script, Seen, Setup, SharedCourse, SimulatedSensor, SimulatedStream, SimulationSpec, Simulator,
};
use fusion_models::vocabulary::state;
use nalgebra::{Vector2, Vector3};

/// Rows of a simulated world.
#[derive(Debug)]
pub struct SimulatedRows {
    simulator: Simulator,
    /// Of each stream of the simulator.
    outlets: Vec<Outlet>,
    values: Vec<f64>,
    frame: LocalFrame,
    /// From the vehicle's reference point to the inertial unit, in body axes \[m\].
    unit: Vector3<f64>,
    /// The instant at which the world is steered next, once it has come as far.
    steers: Option<Time>,
}

/// The destination of the rows of a simulated stream, and the faults on the way.
#[derive(Debug)]
struct Outlet {
    /// The stream of the assembly; `None` if no block reads it.
    stream: Option<StreamId>,
    faults: FaultChain,
    /// Rows simulated so far.
    rows: u64,
}

impl SimulatedRows {
    /// Simulates `design`'s world for the filter assembled from it.
    ///
    /// # Errors
    /// Mistakes of the declared world.
    pub fn new(
        design: &Design,
        simulation: &Named<SimulationDesign>,
        assembly: &Assembly,
        given: Option<u64>,
    ) -> Result<Self, Diagnostics> {
        let SimulationDesign { world, .. } = &simulation.block;
        let seed = seed_of(design, world, given);
        let Some(origin) = design.run.origin else {
            return Err(no_origin(simulation).into());
        };
        let script = pilot::script(design, simulation, given)?;
        if world.vehicle.is_some() && script.is_none() {
            check_estimate(simulation, assembly)?;
        }
        let simulator = simulator(design, simulation, assembly, (seed, script))?;
        let (mut d, mut outlets) = (Diagnostics::new(), Vec::new());
        for SimulatedStream { name, channels } in simulator.streams() {
            let read_as = stream_of(design, name);
            match faults(simulation, name, channels, seed) {
                Ok(faults) => outlets.push(Outlet {
                    stream: assembly.streams.iter().position(|s| s.name == read_as),
                    faults,
                    rows: 0,
                }),
                Err(mistakes) => d.extend(mistakes),
            }
        }
        d.unless_errors(Self {
            simulator,
            outlets,
            values: Vec::new(),
            frame: LocalFrame::new(origin.into()),
            unit: Vector3::from(world.unit.si()),
            steers: None,
        })
    }

    /// Uses the data that runs of the same design with other seeds have in common. Call it before the first row.
    #[must_use]
    pub fn share(self, course: &SharedCourse) -> Self {
        Self {
            simulator: self.simulator.share(course),
            ..self
        }
    }

    /// The next row, of a stream of the assembly; a vehicle is steered by the filter `aboard`.
    pub fn next(&mut self, aboard: &mut dyn Aboard) -> Option<Row<'_>> {
        loop {
            let (from, stamp) = self.advance(aboard)?;
            if let Some(stream) = self.outlets[from].stream {
                return Some(Row {
                    stream,
                    time: stamp.time,
                    number: stamp.number,
                    values: &self.values,
                    disturbed: self.outlets[from].faults.disturbed(),
                    arrival: None,
                });
            }
        }
    }

    /// The outlet and the stamp of the next row that arrives; its numbers are in `values`.
    fn advance(&mut self, aboard: &mut dyn Aboard) -> Option<(usize, Stamp)> {
        loop {
            let outlets = self.outlets.iter().enumerate();
            let due = outlets.filter_map(|(i, outlet)| Some((outlet.faults.due()?, i))).min();
            if let Some((_, from)) = due {
                let stamp = self.outlets[from].faults.deliver(&mut self.values)?;
                return Some((from, stamp));
            }
            if let Some(now) = self.steers.take().filter(|now| self.simulator.listens(*now)) {
                let seen = aboard.pose(now).map(|pose| self.seen(now, &pose));
                self.simulator.steer(now, seen.as_ref());
            }
            let (from, time) = match self.simulator.next_row(&mut self.values) {
                Some(Next::Row(from, time)) => (from, time),
                Some(Next::Control(now)) => {
                    // Rows that arrive by then come first.
                    self.outlets.iter_mut().for_each(|outlet| outlet.faults.reach(now));
                    self.steers = Some(now);
                    continue;
                }
                // After the end of the log, the delayed rows arrive.
                None if self.outlets.iter().all(|outlet| outlet.faults.is_idle()) => return None,
                None => {
                    self.outlets.iter_mut().for_each(|outlet| outlet.faults.reach(Time::MAX));
                    continue;
                }
            };
            self.outlets.iter_mut().for_each(|outlet| outlet.faults.reach(time));
            let queues = self.outlets.iter().any(|outlet| outlet.faults.due().is_some());
            let outlet = &mut self.outlets[from];
            outlet.rows += 1;
            let stamp = Stamp::new(time, outlet.rows);
            if let Some(stamp) = outlet.faults.pass(stamp, &mut self.values, queues) {
                return Some((from, stamp));
            }
        }
    }

    /// The commands that the vehicle has received, if it is steered.
    pub(super) fn script(&self) -> Option<Script> {
        self.simulator.script()
    }

    /// The part of a pose that is used for steering: the estimated position of the vehicle's reference point.
    fn seen(&self, now: Time, pose: &Pose) -> Seen {
        let position = self.frame.to_ned(&pose.position) - pose.attitude * self.unit;
        Seen {
            time: now,
            position: Vector2::new(position.x, position.y),
            heading: so3::to_rpy(&pose.attitude).z,
        }
    }
}

/// Checks that the estimate has a position and a heading, which steering needs.
fn check_estimate(simulation: &Named<SimulationDesign>, assembly: &Assembly) -> Result<(), Diagnostics> {
    let layout = &assembly.layout;
    let missing = if layout.quantity(state::POSITION).is_err() {
        state::POSITION.as_str()
    } else if layout.quantity(state::ATTITUDE).is_err() {
        state::ATTITUDE.as_str()
    } else {
        return Ok(());
    };
    let message = format!("the vehicle is steered by the filter's own estimate, which has no `{missing}`");
    let help = "choose a process with position and attitude, or replace the vehicle by a `trajectory`";
    let place = simulation.node.place_of("vehicle");
    Err(Diagnostic::error(message).at(place).help(help).into())
}

impl Feed for SimulatedRows {
    fn next(&mut self, aboard: &mut dyn Aboard) -> Result<Option<Row<'_>>, Diagnostics> {
        Ok(Self::next(self, aboard))
    }

    fn record(&self) -> Option<Record> {
        self.simulator.record()
    }

    fn truth(&self) -> Option<&[f64]> {
        Some(self.simulator.reference_state())
    }

    fn is_drawn(&self, block: &str) -> bool {
        self.simulator.is_drawn(block)
    }

    fn disturbable(&self) -> Vec<(StreamId, Range<usize>)> {
        let read = self.outlets.iter().filter_map(|outlet| Some((outlet.stream?, outlet)));
        let columns = read.flat_map(|(stream, outlet)| outlet.faults.disturbable().map(move |columns| (stream, columns)));
        columns.collect()
    }

    fn statistics(&self) -> Vec<SourceStatistics> {
        let streams = self.simulator.streams().iter().zip(&self.outlets);
        let counts = |(stream, outlet): (&SimulatedStream, &Outlet)| {
            let simulated = SourceReport {
                rows: outlet.rows,
                ..SourceReport::default()
            };
            SourceStatistics::new(&stream.name, &outlet.faults.report(simulated))
        };
        streams.map(counts).collect()
    }
}

/// The seed of a simulated world: the one given, its own, or that of the run.
fn seed_of(design: &Design, world: &SimulationSpec, given: Option<u64>) -> u64 {
    given.unwrap_or(if world.seed == 0 { design.run.seed } else { world.seed })
}

/// The initialiser that draws the start of the filter about the truth, if the world declares it.
///
/// # Errors
/// Mistakes of the declared world.
pub(crate) fn drawn_start(
    design: &Design,
    simulation: &Named<SimulationDesign>,
    assembly: &Assembly,
    seed: Option<u64>,
) -> Result<Option<InitialiserUnit>, Diagnostics> {
    let world = &simulation.block.world;
    let Some(origin) = design.run.origin.filter(|_| world.draw_start) else {
        return Ok(None);
    };
    let from_data = design.initialisers.iter().filter(|i| !i.block.inputs().is_empty());
    let found: Vec<&str> = from_data.flat_map(|i| i.block.writes()).collect();
    let place = (Geodetic::from(origin), assembly.gravity);
    let drawn = DrawnStart::new(world, &assembly.layout, place, &found, seed_of(design, world, seed));
    let drawn = drawn.map_err(|e| Diagnostics::from(simulation.node.locate(&e)))?;
    Ok(Some(InitialiserUnit {
        name: "draw_start".to_owned(),
        initialiser: Box::new(drawn),
        inputs: Vec::new(),
    }))
}

/// The simulator of the declared world, with the simulated sensors of the assembly. If the design declares true
/// values, it has the sensors of the true design.
fn simulator(
    design: &Design,
    simulation: &Named<SimulationDesign>,
    assembly: &Assembly,
    run: (u64, Option<Script>),
) -> Result<Simulator, Diagnostics> {
    let Some(truth) = &simulation.block.truth else {
        return simulator_of(design, simulation, assembly, None, run);
    };
    let world = assemble(&truth.design, declared_streams(&truth.design)?)?;
    simulator_of(&truth.design, simulation, &world, Some((truth, &assembly.layout)), run)
}

fn simulator_of(
    design: &Design,
    simulation: &Named<SimulationDesign>,
    assembly: &Assembly,
    truth: Option<(&Truth, &Layout)>,
    (seed, script): (u64, Option<Script>),
) -> Result<Simulator, Diagnostics> {
    let world = &simulation.block.world;
    let Some(origin) = design.run.origin else {
        return Err(no_origin(simulation).into());
    };
    // If the rows of a sensor are separate sensors, the first of them.
    let first = |number: usize| assembly.sensors.iter().find(|info| info.design == number);
    let sensors = design
        .sensors
        .iter()
        .enumerate()
        .filter_map(|(number, named)| Some((named, first(number)?)));
    let is_simulated = |named: &str, info: &SensorInfo| world.sensor.contains_key(named) && !info.channels.is_empty();
    let simulated = sensors.filter(|(named, info)| is_simulated(&named.name, info));
    let sensors = simulated.map(|(named, info)| SimulatedSensor {
        name: named.name.clone(),
        model: info.whole.clone(),
        channels: named.block.model.reading().channels().to_vec(),
        rows: named.block.model.noise(),
        delay: info.delay,
        offset: info.offset,
    });
    let others = design.sensors.iter().zip(&assembly.sensors);
    let others = others.filter(|(named, info)| !info.channels.is_empty() && !world.sensor.contains_key(&named.name));
    let setup = Setup {
        layout: &assembly.layout,
        process: assembly.process.clone(),
        input: &design.process.block.model.input(),
        origin: Geodetic::from(origin),
        gravity: assembly.gravity,
        sensors: sensors.collect(),
        others: others.map(|(named, _)| named.name.clone()).collect(),
        given: truth.map_or_else(Vec::new, |(truth, _)| truth.given.clone()),
        told: truth.map(|(_, layout)| layout),
    };
    Simulator::new(world, setup, seed, script).map_err(|e| simulation.node.locate(&e).into())
}
