//! A simulated world as a source of rows: the simulator with the declared faults of its streams.

use crate::assembly::{Assembly, StreamLayout};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign};
use crate::run::SourceTally;
use crate::source::{Chain, Lent, outages};
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
use fusion_models::block::{Channel, Reading, imu_channels};
use fusion_models::fault::{FaultContext, ProvidedChannel, derive_seed};
use fusion_models::sim::{Setup, SimulatedSensor, Simulator, reference_channels};

pub use fusion_models::sim::{IMU, REFERENCE};

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
        for stream in rows.simulator.streams() {
            let is_imu = stream.name == IMU;
            let name = if is_imu { imu_stream(design) } else { &stream.name };
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
            let declared = faults.iter().find(|(of, _)| *of == stream.name).map_or(&[][..], |(_, f)| f);
            let mut chain = Chain::default();
            for (_, windows) in outages(declared) {
                let within = windows.within(Time::default(), rows.simulator.end());
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
                        let table = if is_imu {
                            IMU.to_owned()
                        } else {
                            format!("sensor.{}", stream.name)
                        };
                        let path = format!("{table}.fault.{name}.{}", e.field);
                        let wrong = Diagnostic::error(e.message).at(simulation.node.place_of(path.trim_end_matches('.')));
                        d.push(if let Some(help) = e.help { wrong.help(help) } else { wrong });
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

/// The stream that carries the simulated inertial unit: what the process calls its source, or
/// `imu` where that is a stage.
fn imu_stream(design: &Design) -> &str {
    let read = design.process.block.source.as_deref();
    read.filter(|name| design.stages.iter().all(|stage| stage.name != *name))
        .unwrap_or(IMU)
}

/// The streams of a simulated world.
#[must_use]
pub fn streams(design: &Design, simulation: &SimulationDesign) -> Vec<StreamLayout> {
    let mut streams = Vec::new();
    // A process that has a source is driven by the unit: one that is missing is told by the simulator.
    if simulation.world.imu.is_some() || design.process.block.source.is_some() {
        streams.push(StreamLayout::of(imu_stream(design), None, &imu_channels()));
    }
    for (sensor, source, channel) in simulated(design, simulation) {
        streams.push(StreamLayout::of(sensor, Some(source), &[channel]));
    }
    streams.push(StreamLayout::of(REFERENCE, None, &reference_channels()));
    streams
}

/// The sensors of a design that are simulated: name, source, what they read.
fn simulated<'a>(design: &'a Design, simulation: &'a SimulationDesign) -> impl Iterator<Item = (&'a str, &'a str, Channel)> {
    design.sensors.iter().filter_map(|named| {
        let Reading::Channel(channel) = named.block.model.reading() else {
            return None;
        };
        let simulated = simulation.world.sensor.contains_key(&named.name);
        simulated.then_some((named.name.as_str(), named.block.common.source.as_str(), channel))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assembly::{assemble, declared_streams};
    use crate::config::Document;
    use fusion_models::fault::Outcome;

    /// Ten seconds of rest; `imu` stands beside the rate of the unit.
    fn design(process: &str, imu: &str) -> Design {
        let text = format!(
            "[run]
            origin = {{ latitude = '47 deg', longitude = '8 deg' }}
            seed = 3
            [process]
            source = 'unit'
            {process}
            [sensor.north]
            type = 'heading'
            source = 'compass'
            noise = {{ sigma = '1 deg' }}
            [initial.start]
            type = 'explicit'
            position_sigma = 1
            velocity = [0, 0, 0]
            velocity_sigma = 1
            attitude = [0, 0, 0]
            attitude_sigma = '1 deg'
            [simulation]
            trajectory = [{{ type = 'rest', duration = 10 }}]
            imu = {{ rate = '10 Hz', preset = 'hg1700', {imu} }}
            sensor.north = {{ rate = '1 Hz', white = '1 deg', fault.hum = {{ type = 'noise', sigma = '1 deg' }} }}"
        );
        Design::read(Document::parse("design.toml", &text).0).unwrap_or_else(|d| panic!("{d}"))
    }

    const STRAPDOWN: &str = "type = 'strapdown'\ngyro.noise = 1e-5\naccelerometer.noise = 1e-4";

    /// The rows of a stream, each as wide as the assembly expects.
    fn rows(design: &Design, stream: &str) -> Vec<(Time, Vec<f64>)> {
        let assembly = assemble(design, declared_streams(design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
        let simulation = design.simulation.as_ref().unwrap();
        let mut world = SimulatedRows::new(design, simulation, &assembly, None).unwrap_or_else(|d| panic!("{d}"));
        let mut found = Vec::new();
        while let Some(Lent { from: id, time, row, .. }) = world.next() {
            assert_eq!(row.len(), assembly.streams[id].width(), "{}", assembly.streams[id].name);
            if assembly.streams[id].name == stream {
                found.push((time, row.to_vec()));
            }
        }
        found
    }

    #[test]
    fn a_fault_of_the_unit_disturbs_its_window_of_the_unit_alone() {
        let jump =
            "fault.jump = { type = 'spike', channel = 'specific_force', value = ['0.5 m/s^2', 0, 0], window = { from = 4, to = 6 } }";
        let (sound, faulty) = (design(STRAPDOWN, ""), design(STRAPDOWN, jump));
        assert_eq!(rows(&sound, "north"), rows(&faulty, "north"));
        assert_eq!(rows(&sound, REFERENCE), rows(&faulty, REFERENCE));
        let (sound, faulty) = (rows(&sound, "unit"), rows(&faulty, "unit"));
        assert_eq!((sound.len(), faulty.len()), (101, 101));
        let mut disturbed = 0;
        for ((time, sound), (_, faulty)) in sound.iter().zip(&faulty) {
            let mut expected = sound.clone();
            if (4.0..6.0).contains(&time.seconds()) {
                expected[3] += 0.5;
                disturbed += 1;
            }
            assert_eq!(*faulty, expected, "{time}");
        }
        assert_eq!(disturbed, 20);
    }

    #[test]
    fn a_random_fault_of_the_unit_has_a_seed_of_its_own() {
        let hum = "fault.hum = { type = 'noise', channel = 'angular_rate', sigma = '1 deg/s' }";
        let (sound, faulty) = (design(STRAPDOWN, ""), design(STRAPDOWN, hum));
        let channels = [ProvidedChannel {
            channel: imu_channels()[0].clone(),
            offset: 0,
            delay_ns: 0,
        }];
        let context = FaultContext {
            channels: &channels,
            seed: derive_seed(3, &["imu", "hum"]),
        };
        let mut fault = faulty.simulation.as_ref().unwrap().block.faults[0].1[0].1.build(&context).unwrap();
        let mut expected = rows(&sound, "unit");
        for (time, row) in &mut expected {
            assert_eq!(fault.apply(*time, row), Outcome::Disturbed);
        }
        assert_eq!(rows(&faulty, "unit"), expected);
        assert_ne!(rows(&sound, "unit"), expected);
    }

    #[test]
    fn a_process_that_reads_only_the_gyros_is_simulated() {
        let design = design("type = 'attitude_only'\ngyro_noise = 1e-5", "");
        assert_eq!(rows(&design, "unit").len(), 101);
    }

    #[test]
    fn a_stage_between_unit_and_process_reads_the_unit_as_imu() {
        let process = "type = 'strapdown_external_attitude'\nattitude_noise = 1e-5\naccelerometer_noise = 1e-4
            [stage.unit]\ntype = 'attitude_reference'\nsource = 'imu'\ngyro_noise = 1e-5";
        assert_eq!(rows(&design(process, ""), "imu").len(), 101);
    }

    #[test]
    fn outages_that_repeat_are_listed_to_the_end_of_the_run() {
        let gap = "fault.gap = { type = 'outage', window = { from = 2, duration = '1 ms', every = '2 ms' } }";
        let design = design(STRAPDOWN, gap);
        let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
        let world = SimulatedRows::new(&design, design.simulation.as_ref().unwrap(), &assembly, None).unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(world.outages().len(), 4000);
    }
}
