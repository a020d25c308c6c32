//! The rows of a simulated world.

use super::check::{faults, no_origin};
use crate::assembly::{Assembly, stream_of};
use crate::config::Diagnostics;
use crate::design::{Design, Named, SimulationDesign};
use crate::rows::{FaultChain, Feed, Row, SourceReport, SourceStatistics, Stamp};
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::{InitialiserUnit, StreamId};
use fusion_core::time::Time;
use fusion_models::sim::{DrawnStart, Setup, SimulatedSensor, SimulatedStream, SimulationSpec, Simulator};

/// Rows of a simulated world.
#[derive(Debug)]
pub struct SimulatedRows {
    simulator: Simulator,
    /// Of each stream of the simulator.
    outlets: Vec<Outlet>,
    values: Vec<f64>,
}

/// Where the rows of a simulated stream go, and through what.
#[derive(Debug)]
struct Outlet {
    /// The stream of the assembly; `None` where nothing reads it.
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
    pub fn new(design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly, seed: Option<u64>) -> Result<Self, Diagnostics> {
        let SimulationDesign { world, .. } = &simulation.block;
        let seed = seed_of(design, world, seed);
        let simulator = simulator(design, simulation, assembly, seed)?;
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
        })
    }

    /// The next row, of a stream of the assembly.
    #[expect(clippy::should_implement_trait, reason = "a row is lent, which an iterator cannot do")]
    pub fn next(&mut self) -> Option<Row<'_>> {
        loop {
            let (from, stamp) = self.advance()?;
            if let Some(stream) = self.outlets[from].stream {
                return Some(Row {
                    stream,
                    time: stamp.time,
                    number: stamp.number,
                    values: &self.values,
                    disturbed: self.outlets[from].faults.disturbed(),
                });
            }
        }
    }

    /// The outlet and the stamp of the next row that arrives; its numbers are in `values`.
    fn advance(&mut self) -> Option<(usize, Stamp)> {
        loop {
            let outlets = self.outlets.iter().enumerate();
            let due = outlets.filter_map(|(i, outlet)| Some((outlet.faults.due()?, i))).min();
            if let Some((_, from)) = due {
                let stamp = self.outlets[from].faults.deliver(&mut self.values)?;
                return Some((from, stamp));
            }
            let Some((from, time)) = self.simulator.next_row(&mut self.values) else {
                // After the end of the log what is still on its way arrives.
                if self.outlets.iter().all(|outlet| outlet.faults.is_idle()) {
                    return None;
                }
                self.outlets.iter_mut().for_each(|outlet| outlet.faults.reach(Time::MAX));
                continue;
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
}

impl Feed for SimulatedRows {
    fn next(&mut self) -> Result<Option<Row<'_>>, Diagnostics> {
        Ok(Self::next(self))
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

/// What draws the start of the filter about the truth, where the world is declared to.
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

/// The simulator of the declared world, with the sensors of the assembly that it simulates.
fn simulator(design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly, seed: u64) -> Result<Simulator, Diagnostics> {
    let world = &simulation.block.world;
    let Some(origin) = design.run.origin else {
        return Err(no_origin(simulation).into());
    };
    let sensors = design.sensors.iter().zip(&assembly.sensors);
    let simulated = sensors.filter(|(named, _)| world.sensor.contains_key(&named.name));
    let sensors = simulated.filter_map(|(named, info)| {
        Some(SimulatedSensor {
            name: named.name.clone(),
            model: info.model.clone(),
            channel: info.channel.clone()?,
            rows: named.block.model.noise(),
            delay: info.delay,
            offset: info.offset,
        })
    });
    let setup = Setup {
        layout: &assembly.layout,
        process: assembly.process.clone(),
        input: &design.process.block.model.input(),
        origin: Geodetic::from(origin),
        gravity: assembly.gravity,
        sensors: sensors.collect(),
    };
    Simulator::new(world, setup, seed).map_err(|e| simulation.node.locate(&e).into())
}
