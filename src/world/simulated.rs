//! The rows of a simulated world.

use super::IMU;
use crate::assembly::{Assembly, imu_stream};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign};
use crate::rows::{FaultChain, Feed, Row, SourceReport, SourceTally, outage_windows, provided};
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::StreamId;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use fusion_models::fault::{FaultSpec, derive_seed};
use fusion_models::sim::{Setup, SimulatedSensor, SimulatedStream, Simulator};

/// Rows of a simulated world.
#[derive(Debug)]
pub struct SimulatedRows {
    simulator: Simulator,
    /// Of each stream of the simulator.
    outlets: Vec<Outlet>,
    outages: Vec<(Time, Time)>,
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
        let seed = seed.unwrap_or(if world.seed == 0 { design.run.seed } else { world.seed });
        let simulator = simulator(design, simulation, assembly, seed)?;
        let (mut d, mut outlets) = (Diagnostics::new(), Vec::new());
        for stream in simulator.streams() {
            let is_imu = stream.name == IMU;
            let read_as = if is_imu { imu_stream(design) } else { &stream.name };
            match faults(simulation, stream, seed) {
                Ok(faults) => outlets.push(Outlet {
                    stream: assembly.streams.iter().position(|s| s.name == read_as),
                    faults,
                    rows: 0,
                }),
                Err(errors) => {
                    let table = if is_imu {
                        IMU.to_owned()
                    } else {
                        format!("sensor.{}", stream.name)
                    };
                    d.extend(errors.into_iter().map(|e| simulation.node.locate(&e.within(table.as_str()))));
                }
            }
        }
        let streams = simulator.streams().iter();
        let outages = outage_windows(streams.map(|stream| declared(simulation, stream)), simulator.end());
        d.unless_errors(Self {
            simulator,
            outlets,
            outages,
            values: Vec::new(),
        })
    }

    /// The declared outages.
    #[must_use]
    pub fn outages(&self) -> Vec<(Time, Time)> {
        self.outages.clone()
    }

    /// The next row, of a stream of the assembly.
    #[expect(clippy::should_implement_trait, reason = "a row is lent, which an iterator cannot do")]
    pub fn next(&mut self) -> Option<Row<'_>> {
        loop {
            let (from, time) = self.simulator.next_row(&mut self.values)?;
            let outlet = &mut self.outlets[from];
            outlet.rows += 1;
            let arrives = outlet.faults.pass(time, &mut self.values);
            if let Some(stream) = outlet.stream.filter(|_| arrives) {
                return Some(Row {
                    stream,
                    time,
                    number: self.outlets[from].rows,
                    values: &self.values,
                    disturbed: self.outlets[from].faults.disturbed(),
                });
            }
        }
    }
}

impl Feed for SimulatedRows {
    fn next(&mut self) -> Result<Option<Row<'_>>, Diagnostics> {
        Ok(Self::next(self))
    }

    fn disturbable(&self) -> Vec<(StreamId, Range<usize>)> {
        let read = self.outlets.iter().filter_map(|outlet| Some((outlet.stream?, outlet)));
        let columns = read.flat_map(|(stream, outlet)| outlet.faults.disturbable().map(move |columns| (stream, columns)));
        columns.collect()
    }

    fn tallies(&self) -> Vec<SourceTally> {
        let streams = self.simulator.streams().iter().zip(&self.outlets);
        let tally = |(stream, outlet): (&SimulatedStream, &Outlet)| {
            let simulated = SourceReport {
                rows: outlet.rows,
                ..SourceReport::default()
            };
            SourceTally::new(&stream.name, &outlet.faults.report(simulated))
        };
        streams.map(tally).collect()
    }
}

/// The simulator of the declared world, with the sensors of the assembly that it simulates.
fn simulator(design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly, seed: u64) -> Result<Simulator, Diagnostics> {
    let world = &simulation.block.world;
    let Some(origin) = design.run.origin else {
        let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
        return Err(Diagnostic::error("a simulated world needs an origin")
            .at(simulation.node.name_place())
            .help(help)
            .into());
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

/// The faults declared for a simulated stream.
fn declared<'a>(simulation: &'a Named<SimulationDesign>, stream: &SimulatedStream) -> &'a [(String, Box<dyn FaultSpec>)] {
    let mut all = simulation.block.faults.iter();
    all.find(|(of, _)| *of == stream.name).map_or(&[][..], |(_, faults)| faults)
}

fn faults(simulation: &Named<SimulationDesign>, stream: &SimulatedStream, seed: u64) -> Result<FaultChain, Vec<BuildError>> {
    let channels = provided(stream.channels.iter().map(|channel| (channel.clone(), 0)));
    let seed_of = |fault: &str| derive_seed(seed, &[&stream.name, fault]);
    FaultChain::new(declared(simulation, stream), &channels, seed_of)
}
