//! A simulated world as a source of rows: the simulator with the declared faults of its sensors.

use crate::assembly::Assembly;
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign};
use crate::run::{HORIZON, SourceTally};
use crate::source::{Chain, Lent, outages};
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
use fusion_models::block::Reading;
use fusion_models::fault::{FaultContext, ProvidedChannel, derive_seed};
use fusion_models::sim::{Setup, SimulatedSensor, Simulator};

/// The stream that carries the truth.
pub const REFERENCE: &str = "reference";
/// What the simulator calls the process input.
const INPUT: &str = "imu";

/// The name of the simulated inertial unit's stream: what the process reads, or `imu` where the
/// process reads a stage.
pub fn imu_stream(design: &Design) -> &str {
    let read = design.process.block.source.as_deref();
    read.filter(|name| design.stages.iter().all(|stage| stage.name != *name)).unwrap_or(INPUT)
}

/// Rows of a simulated world.
#[derive(Debug)]
pub struct SimulatedRows {
    simulator: Simulator,
    /// The assembly's stream of each of the simulator's.
    ids: Vec<usize>,
    faults: Vec<Chain>,
    outages: Vec<(Time, Time)>,
    counts: Vec<(u64, u64)>,
    row: Vec<f64>,
}

impl SimulatedRows {
    /// Simulates `design`'s world for the filter assembled from it.
    ///
    /// # Errors
    /// Mistakes of the declared world.
    pub fn new(design: &Design, simulation: &Named<SimulationDesign>, assembly: &Assembly, seed: Option<u64>) -> Result<Self, Diagnostics> {
        let SimulationDesign { world, faults } = &simulation.block;
        let Some(origin) = design.run.origin else {
            let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
            return Err(Diagnostic::error("a simulated world needs an origin")
                .at(simulation.node.name_place())
                .help(help)
                .into());
        };
        let seed = seed.unwrap_or(if world.seed == 0 { design.run.seed } else { world.seed });
        let sensors = design.sensors.iter().zip(&assembly.sensors).filter_map(|(named, info)| {
            let channel = info.channel.clone()?;
            let rows = named.block.model.noise();
            world.sensor.contains_key(&named.name).then(|| SimulatedSensor {
                name: named.name.clone(),
                model: info.model.clone(),
                channel,
                rows,
                delay: info.delay,
            })
        });
        let input = design.process.block.model.input();
        let setup = Setup {
            layout: &assembly.layout,
            process: assembly.process.clone(),
            input: &input,
            origin: Geodetic::from(origin),
            gravity: assembly.gravity,
            sensors: sensors.collect(),
        };
        let simulator = Simulator::new(world, setup, seed).map_err(|e| {
            let place = simulation.node.place_of(&e.field);
            let diagnostic = Diagnostic::error(e.message).at(place);
            Diagnostics::from(if let Some(help) = e.help {
                diagnostic.help(help)
            } else {
                diagnostic
            })
        })?;
        let mut rows = Self {
            ids: Vec::new(),
            faults: Vec::new(),
            outages: Vec::new(),
            counts: vec![(0, 0); simulator.streams().len()],
            row: Vec::new(),
            simulator,
        };
        let mut d = Diagnostics::new();
        let input_stream = imu_stream(design);
        for stream in rows.simulator.streams() {
            let name = if stream.name == INPUT { input_stream } else { &stream.name };
            rows.ids
                .push(assembly.streams.iter().position(|s| s.name == name).unwrap_or(usize::MAX));
            let mut offset = 0;
            let channels: Vec<ProvidedChannel> = stream
                .channels
                .iter()
                .map(|channel| {
                    offset += channel.width;
                    ProvidedChannel {
                        channel: channel.clone(),
                        offset: offset - channel.width,
                        delay_ns: 0,
                    }
                })
                .collect();
            let declared = faults.iter().find(|(sensor, _)| *sensor == stream.name).map_or(&[][..], |(_, f)| f);
            let mut chain = Chain::default();
            for (_, windows) in outages(declared) {
                let within = windows.within(Time::default(), HORIZON);
                rows.outages.extend(within.into_iter().map(|w| (w.from, w.to)));
            }
            for (name, fault) in declared {
                let context = FaultContext {
                    channels: &channels,
                    seed: derive_seed(seed, &[&stream.name, name]),
                };
                match fault.build(&context) {
                    Ok(fault) => chain.push(name, fault),
                    Err(e) => {
                        let path = format!("sensor.{}.fault.{name}.{}", stream.name, e.field);
                        d.push(Diagnostic::error(e.message).at(simulation.node.place_of(path.trim_end_matches('.'))));
                    }
                }
            }
            rows.faults.push(chain);
        }
        rows.outages.sort_unstable();
        rows.outages.dedup();
        d.unless_errors(rows)
    }

    /// The declared outages.
    #[must_use]
    pub fn outages(&self) -> Vec<(Time, Time)> {
        self.outages.clone()
    }

    /// Which numbers of the assembly's streams declared faults may change.
    pub fn disturbable(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let faults = self.ids.iter().zip(&self.faults);
        faults.flat_map(|(id, chain)| chain.disturbable().map(|columns| (*id, columns)))
    }

    /// The next row, of a stream of the assembly.
    #[expect(clippy::should_implement_trait, reason = "a row is lent, which an iterator cannot do")]
    pub fn next(&mut self) -> Option<Lent<'_>> {
        loop {
            let (stream, time) = self.simulator.next_row(&mut self.row)?;
            let id = self.ids[stream];
            self.counts[stream].0 += 1;
            let withheld = self.faults[stream].apply(time, &mut self.row, |_| {}).is_some();
            if !withheld && id != usize::MAX {
                self.counts[stream].1 += 1;
                return Some(Lent {
                    from: id,
                    time,
                    row: &self.row,
                    disturbed: self.faults[stream].disturbed(),
                });
            }
        }
    }

    /// What each stream delivered.
    #[must_use]
    pub fn reports(&self) -> Vec<SourceTally> {
        let streams = self.simulator.streams().iter().zip(&self.counts);
        streams
            .map(|(stream, &(rows, used))| SourceTally {
                name: stream.name.clone(),
                rows,
                used,
                skipped: if used < rows {
                    vec![("withheld by a fault".to_owned(), rows - used)]
                } else {
                    Vec::new()
                },
                report: format!("{used} of {rows} simulated rows"),
            })
            .collect()
    }
}

/// The sensors of a design that are simulated: name, source, what they read.
pub fn simulated<'a>(
    design: &'a Design,
    simulation: &'a SimulationDesign,
) -> impl Iterator<Item = (&'a str, &'a str, fusion_models::block::Channel)> {
    design.sensors.iter().filter_map(|named| {
        let Reading::Channel(channel) = named.block.model.reading() else {
            return None;
        };
        let simulated = simulation.world.sensor.contains_key(&named.name);
        simulated.then_some((named.name.as_str(), named.block.common.source.as_str(), channel))
    })
}
