//! Hears a run: writes its files, follows its sensors, scores it.

use crate::assembly::Assembly;
use crate::config::{Diagnostic, Diagnostics};
use crate::design::Design;
use crate::output::{EstimateWriter, UpdateWriter};
use crate::report::Recording;
use crate::run::{FinalState, Options, Summary, unwritable};
use crate::score::{ReferenceEpoch, Scorer};
use crate::solution::SolutionReader;
use crate::tally::Follower;
use core::ops::Range;
use fusion_core::runner::{Event, Halt, Observer, StreamId};
use fusion_core::state::{Belief, StateRole};
use fusion_core::time::{Time, nanos};
use fusion_models::earth::LocalFrame;
use std::fs::File;
use std::io::BufWriter;
use std::time::{Duration, Instant};

/// Hears the runner's events, and of the rows beside it.
#[derive(Debug)]
pub(crate) struct Recorder {
    reader: SolutionReader,
    scorer: Option<Scorer>,
    estimates: Option<EstimateWriter<BufWriter<File>>>,
    updates: Option<UpdateWriter<BufWriter<File>>>,
    pub(crate) recording: Option<Recording>,
    followers: Vec<Follower>,
    unused: Vec<(String, u64)>,
    failures: Vec<String>,
    started: Option<f64>,
    epochs: u64,
    output_period: i64,
    next_output: Time,
    broken: Option<std::io::Error>,
    /// Whether the row that is being fed is timed, and what this took of the time.
    pub(crate) timed: bool,
    pub(crate) spent: Duration,
}

impl Recorder {
    /// Of a run of `assembly` that is scored by `scorer`; faults may change the numbers
    /// `disturbable` of its streams.
    pub(crate) fn new(
        design: &Design,
        assembly: &Assembly,
        scorer: Option<Scorer>,
        disturbable: &[(StreamId, Range<usize>)],
        options: &Options,
    ) -> Result<Self, Diagnostics> {
        let mut estimates = None;
        let mut updates = None;
        if let Some(out) = &options.out {
            let create = |name: &str| {
                let path = out.join(name);
                File::create(&path).map(BufWriter::new).map_err(|e| unwritable(&path, &e))
            };
            std::fs::create_dir_all(out).map_err(|e| unwritable(out, &e))?;
            let origin = design.run.origin.map(|o| LocalFrame::new(o.into()));
            let file = create("estimates.csv")?;
            estimates = Some(EstimateWriter::new(file, &assembly.layout, origin).map_err(|e| unwritable(out, &e))?);
            let rows = assembly.sensors.iter().map(|s| s.model.size().residual).max().unwrap_or(0);
            updates = Some(UpdateWriter::new(create("updates.csv")?, rows).map_err(|e| unwritable(out, &e))?);
        }
        let from = design.reference.as_ref().and_then(|r| r.block.from);
        let from = from.map(|t| Time::from_seconds(t.si()));
        let sensors = assembly.runner.sensors().iter().zip(&assembly.sensors);
        let followers = sensors.map(|(sensor, info)| Follower::new(sensor, info, from, disturbable));
        Ok(Self {
            reader: SolutionReader::new(&assembly.layout, assembly.process.clone()),
            scorer,
            estimates,
            updates,
            recording: None,
            followers: followers.collect(),
            unused: Vec::new(),
            failures: Vec::new(),
            started: None,
            epochs: 0,
            output_period: design.run.output_rate.map_or(0, |r| nanos(1.0 / r.si())),
            next_output: Time::MIN,
            broken: None,
            timed: false,
            spent: Duration::ZERO,
        })
    }

    /// An epoch of a reference that comes along with the data.
    pub(crate) fn reference(&mut self, epoch: ReferenceEpoch) {
        if let Some(recording) = &mut self.recording {
            recording.reference(&epoch);
        }
        if let Some(scorer) = &mut self.scorer {
            scorer.push(epoch);
        }
    }

    /// A row in which faults changed the numbers `columns`.
    pub(crate) fn disturbed(&mut self, stream: StreamId, time: Time, columns: &[Range<usize>]) {
        if !columns.is_empty() {
            self.followers.iter_mut().for_each(|f| f.row(stream, time, columns));
        }
    }

    fn not_used(&mut self, consumer: &str) {
        match self.unused.iter_mut().find(|(name, _)| name == consumer) {
            Some((_, count)) => *count += 1,
            None => self.unused.push((consumer.to_owned(), 1)),
        }
    }

    /// What came of the run, but for what only its caller knows; `last` is the belief at its end.
    pub(crate) fn finish(mut self, design: &Design, last: &Belief) -> Result<Summary, Diagnostics> {
        if let Some(w) = self.estimates.take() {
            self.broken = self.broken.or(w.finish().err());
        }
        if let Some(w) = self.updates.take() {
            self.broken = self.broken.or(w.finish().err());
        }
        if let Some(error) = self.broken {
            return Err(Diagnostic::error(format!("cannot write the results: {error}")).into());
        }
        let layout = self.reader.layout();
        let parameters = layout
            .blocks()
            .iter()
            .filter(|b| b.role != StateRole::Kinematic)
            .map(|b| FinalState {
                name: b.name.clone(),
                kind: b.kind,
                value: last.x[b.storage_range()].to_vec(),
                sigma: last.covariance.sigmas(b).collect(),
                covariance: last.covariance.block(b),
                unit: b.unit,
            });
        Ok(Summary {
            description: design.run.description.clone(),
            backend: design.filter.backend_name(),
            started: self.started,
            waiting: Vec::new(),
            epochs: self.epochs,
            parameters: if self.started.is_some() { parameters.collect() } else { Vec::new() },
            score: self.scorer.map(Scorer::finish),
            sensors: self.followers.into_iter().map(|f| f.finish(last.time)).collect(),
            sources: Vec::new(),
            unused_rows: self.unused,
            failures: self.failures,
            wall_seconds: 0.0,
            filter_ns_per_epoch: 0.0,
        })
    }
}

impl Observer for Recorder {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        let clock = self.timed.then(Instant::now);
        match event {
            Event::Started { belief } => self.started = Some(belief.time.seconds()),
            Event::Estimate { belief } => {
                self.epochs += 1;
                let write = self.estimates.is_some() && belief.time >= self.next_output;
                if write || self.scorer.is_some() || self.recording.is_some() {
                    let solution = self.reader.read(belief);
                    if let Some(recording) = &mut self.recording {
                        recording.estimate(&solution);
                    }
                    if let Some(scorer) = &mut self.scorer {
                        scorer.observe(&solution);
                    }
                    if let (true, Some(out)) = (write, &mut self.estimates) {
                        if self.output_period > 0 {
                            let slot = belief.time.nanos().div_euclid(self.output_period) + 1;
                            self.next_output = Time::from_nanos(slot.saturating_mul(self.output_period));
                        }
                        self.broken = self.broken.take().or(out.write(&solution, belief).err());
                    }
                }
            }
            Event::Updated { sensor, update, time, .. } => {
                self.followers[*sensor].judged(*time, update);
                if let Some(recording) = &mut self.recording {
                    recording.updated(*sensor, *time, update);
                }
                if let Some(out) = &mut self.updates {
                    let name = self.followers[*sensor].name();
                    self.broken = self.broken.take().or(out.write(*time, name, update).err());
                }
            }
            Event::Late { consumer, .. } | Event::NotFinite { consumer, .. } => self.not_used(consumer),
            Event::Failed { error } if self.failures.len() < 10 => self.failures.push(error.to_string()),
            _ => {}
        }
        if let Some(clock) = clock {
            self.spent += clock.elapsed();
        }
        Ok(())
    }
}
