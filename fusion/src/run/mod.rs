//! Running a design over its data.

mod advice;
pub mod examine;
mod files;
mod recorded;
mod reference;
mod saving;
mod smoothing;
mod summary;

pub use crate::observe::FinalState;
pub use crate::rows::{KeptRows, SourceStatistics};
pub use advice::{Advisor, Finding, Ignored, Rule};
pub use files::Finished;
pub use recorded::open_one;
pub use saving::Checkpoints;
pub use summary::{Current, Detector, FaultWindow, InsideScore, Smoothed, Summary};

use crate::assembly::{Assembly, assemble, declared_streams, stream_of};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Fault, Named, ReferenceSpec, SourceDesign};
use crate::health::HealthRecord;
use crate::observe::{
    Consumers, Counters, Excesses, FilterScore, Filters, Finals, Heard, Hub, Hypotheses, RunObserver, Smoother, Statistics, Timing,
    sections,
};
use crate::provenance::Provenance;
use crate::rows::{Carried, Feed, outages as silences};
use crate::score::{Comparison, Outage};
use crate::solution::SolutionReader;
use crate::source::Supply;
use crate::world::{SimulatedRows, drawn_start};
use files::Files;
use fusion_core::runner::Runner;
use fusion_core::time::Time;
use fusion_models::fault::Window;
use fusion_models::sim::SharedCourse;
use reference::Reference;
use saving::Saving;
use smoothing::Planned;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// Whether estimates are smoothed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// As the design says: with a lag, or not.
    #[default]
    Declared,
    /// Never smoothed, even if the design asks for it.
    Never,
    /// By all data of the log; the data for smoothing are kept until the end.
    Whole(Keep),
}

/// Where the data for smoothing are kept until the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// In memory, some kilobytes per estimate.
    Memory,
    /// In a file next to the results, which is removed at the end. Memory does not grow with the log, except
    /// for the reference, which is always held in memory.
    Disk,
}

/// How a design is run.
#[derive(Debug, Default)]
pub struct Options {
    /// Relative source paths start here, instead of at the design's `data_dir`.
    pub data: Option<PathBuf>,
    /// Rows that a program supplies instead of the files of sources, by source name.
    pub rows: BTreeMap<String, Supply>,
    /// Decoded rows that several runs over the same sources share.
    pub kept: Option<KeptRows>,
    /// Where the design's own relative paths start: the folder of its file.
    pub base: PathBuf,
    /// Where estimates.csv, updates.csv and summary.json go; nothing is written without it.
    pub out: Option<PathBuf>,
    /// The seed of simulated data and random faults, instead of the design's.
    pub seed: Option<u64>,
    /// Whether estimates are smoothed.
    pub smooth: Smoothing,
    /// For a design that goes back for late rows: estimates.csv holds the estimates at the time, and revised.csv
    /// the estimates revised by later rows. Other designs have nothing to revise.
    pub causal: bool,
    /// Saves the run at intervals.
    pub checkpoint: Option<Checkpoints>,
    /// Resumes the run that was saved there.
    pub resume: Option<PathBuf>,
    /// The rules of advice that are not applied.
    pub ignored: Ignored,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The time of the last row.
    pub time: Time,
    /// The share of the recorded data that has been read; `None` if simulated or unknown.
    pub share: Option<f64>,
}

/// Runs `design`; `progress` is called from time to time.
///
/// # Errors
/// Mistakes of the design or of the data.
pub fn run(design: &Design, options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<Summary, Diagnostics> {
    Ok(Run::open(design, options)?.go(&mut [], progress)?.keep()?)
}

/// Runs `design` as [`run`] does, with the observers `further`, and shares with other runs all data that do not depend
/// on the seed. Consumers and parameters of filters inside stages are not observed and are empty in the summary,
/// because a campaign does not report them.
///
/// # Errors
/// Those of [`run`].
pub fn run_sharing(
    design: &Design,
    options: &Options,
    course: &SharedCourse,
    further: &mut [&mut dyn RunObserver],
) -> Result<Summary, Diagnostics> {
    Ok(Run::open_sharing(design, options, Some(course))?.go(further, &mut |_| {})?.keep()?)
}

/// A run whose data are open.
#[derive(Debug)]
pub struct Run<'a> {
    design: &'a Design,
    options: &'a Options,
    assembly: Assembly,
    data: RunData,
    /// Whether it is one of several runs of the design.
    is_one_of_many: bool,
    begun: Instant,
}

impl<'a> Run<'a> {
    /// Assembles a design and opens its data.
    ///
    /// # Errors
    /// Mistakes of the design or of the data.
    pub fn open(design: &'a Design, options: &'a Options) -> Result<Self, Diagnostics> {
        Self::open_sharing(design, options, None)
    }

    /// Opens one of several runs of the design, which differ by their seeds.
    fn open_sharing(design: &'a Design, options: &'a Options, course: Option<&SharedCourse>) -> Result<Self, Diagnostics> {
        let begun = Instant::now();
        let streams = declared_streams(design)?;
        let mut assembly = assemble(design, streams)?;
        if let Some(simulation) = &design.simulation {
            let drawn = || drawn_start(design, simulation, &assembly, options.seed);
            let (own, live) = (drawn()?, drawn()?);
            own.into_iter().for_each(|unit| assembly.runner.add_initialiser(unit));
            if let Some(runner) = assembly.runner.live_mut() {
                live.into_iter().for_each(|unit| runner.add_initialiser(unit));
            }
        }
        let data = RunData::open(design, &assembly, options, course)?;
        Ok(Self {
            design,
            options,
            assembly,
            data,
            is_one_of_many: course.is_some(),
            begun,
        })
    }

    /// The assembly that is run.
    #[must_use]
    pub const fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// Runs to the end of the data. The observers `further` observe it in addition to those that make the
    /// result and its files. The files have no names before [`Finished::keep`].
    ///
    /// # Errors
    /// Invalid data, a file that cannot be written, or the first error of an observer.
    pub fn go(self, further: &mut [&mut dyn RunObserver], progress: &mut dyn FnMut(Progress)) -> Result<Finished, Diagnostics> {
        self.go_and_smooth(further, &mut [], progress)
    }

    /// The same; the observers `smoothed` receive the smoothed estimates, if there are any.
    ///
    /// # Errors
    /// As [`go`](Self::go).
    pub fn go_and_smooth(
        mut self,
        further: &mut [&mut dyn RunObserver],
        smoothed: &mut [&mut dyn RunObserver],
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Finished, Diagnostics> {
        let mut saving = Saving::begin(self.design, self.options)?;
        let filters = Filters::of(&self.assembly);
        let reference = &mut self.data.reference;
        let from = self.design.reference.as_ref().and_then(|r| r.block.from);
        let from = from.map(|t| Time::from_seconds(t.si()));
        let mut counters = Counters::default();
        let mut consumers = Consumers::new(&self.assembly.runner);
        let mut statistics = Statistics::new(&filters, from, &self.data.rows.disturbable());
        let mut finals = Finals::new(&filters);
        let mut hypotheses = Hypotheses::default();
        let mut excesses = Excesses::new(&filters);
        let scored = filters.iter().filter(|_| !reference.is_empty());
        let (outages, many) = (outages(self.design, &self.assembly), self.is_one_of_many);
        let mut health = HealthRecord::new(&filters, &self.assembly, &outages);
        let rules = |filter: &Heard| {
            reference.rules(
                self.design,
                &filter.layout,
                if filter.is_outermost() { &outages } else { &[] },
                many,
            )
        };
        let rows = &self.data.rows;
        let score = |f: &Heard| FilterScore::new(f, rules(f), |block| f.is_outermost() && rows.is_drawn(block));
        let mut scores: Vec<FilterScore> = scored.map(score).collect();
        let planned = Planned::of(self.design, self.options);
        let mut smoothed_score = filters
            .outermost()
            .filter(|_| planned.is_some() && !reference.is_empty())
            .map(score);
        let rewinds = self.assembly.runner.rewinds().is_some();
        let outermost = filters.outermost().filter(|_| rewinds && !reference.is_empty());
        let mut current_score =
            outermost.map(|f| FilterScore::new(f, reference.rules(self.design, &f.layout, &[], many), |block| rows.is_drawn(block)));
        let mut files = Files::create(self.design, self.options, &filters, planned.is_some())?;
        let comparison = reference.comparison();
        let mut smoother = match planned {
            None => None,
            Some(planned) => {
                let mut hub = Hub::new(&filters, comparison.as_ref().map(Comparison::emptied).as_ref());
                smoothed.iter_mut().for_each(|observer| hub.add(*observer));
                let by = planned.by(self.design, &self.assembly, &files)?;
                Some(smoothing::smoother(
                    self.design,
                    by,
                    self.assembly.runner.belief().clone(),
                    hub,
                    files.smoothed.as_mut(),
                    smoothed_score.as_mut(),
                ))
            }
        };
        let mut further_sections = if self.is_one_of_many {
            Vec::new()
        } else {
            sections(self.design, &filters)
        };
        let mut hub = Hub::new(&filters, comparison.as_ref());
        hub.add(&mut counters);
        hub.add(&mut statistics);
        if !self.is_one_of_many {
            hub.add(&mut consumers);
            hub.add(&mut finals);
            hub.add(&mut excesses);
        }
        hub.add(&mut health);
        if self.design.filter.bank.is_some() {
            hub.add(&mut hypotheses);
        }
        scores.iter_mut().for_each(|score| hub.add(score));
        files.estimates.iter_mut().for_each(|file| hub.add(file));
        files.updates.iter_mut().for_each(|file| hub.add(file));
        smoother.iter_mut().for_each(|smoother| hub.add(smoother));
        further_sections.iter_mut().for_each(|section| hub.add(section.as_mut()));
        further.iter_mut().for_each(|observer| hub.add(*observer));
        if rewinds {
            let mut current = Hub::new(&filters, comparison.as_ref());
            current_score.iter_mut().for_each(|score| current.add(score));
            files.current.iter_mut().for_each(|file| current.add(file));
            hub.add_current(current);
        }
        let mut reader = SolutionReader::new(&self.assembly.layout, self.assembly.process.clone());
        let mut timing = Timing::default();
        saving.resume((&mut self.assembly.runner, &mut hub, &mut timing), &mut self.data)?;
        feed(
            self.design,
            (&mut self.assembly.runner, &mut reader),
            &mut self.data,
            (&mut hub, &mut timing),
            &mut saving,
            progress,
        )?;
        let waited = hub.waited();
        let smoothed = smoother.map(Smoother::finish).transpose().map_err(stopped)?;
        let files = files.finish()?;
        let runner = &self.assembly.runner;
        let (last, has_started) = (runner.belief(), runner.started());
        let mut parameters = finals.finish();
        if has_started {
            parameters.splice(..0, FinalState::of(&self.assembly.layout, last));
        }
        let health = health.finish();
        // Both are by the numbers of the filters, the outermost first.
        let each: Vec<Option<f64>> = health.iter().map(|own| own.aligned).collect();
        let aligned = each.first().copied().flatten();
        let mut scores = scores.into_iter().zip(each).map(|(score, aligned)| score.finish(aligned));
        let score = scores.next();
        let inside = filters.iter().filter(|f| !f.is_outermost()).zip(scores);
        let judge = crate::design::of_a_sensor(self.design);
        let coasted = counters.coasted();
        let mut summary = Summary {
            description: self.design.run.description.clone(),
            provenance: Provenance::of(self.design, self.options.seed),
            findings: Vec::new(),
            backend: self.design.filter.backend_name(),
            kernel: self.design.filter.kernel.unwrap_or_default().name(),
            health,
            started: counters.started,
            waited,
            start_angle: counters.start_angle,
            waiting: if has_started { Vec::new() } else { runner.waits_for() },
            detectors: runner.tested().into_iter().map(Detector::from).collect(),
            held_back: if rewinds { 0.0 } else { runner.lag() },
            epochs: counters.epochs,
            refused_samples: counters.refused,
            coasted,
            hypotheses: self.design.filter.bank.map(|_| hypotheses),
            judged_by: judge.map(|(source, _)| source.to_owned()),
            judged_by_used_rows: judge.is_some_and(|(_, is_used)| is_used),
            score,
            smoothed: planned.zip(smoothed).map(|(planned, estimates)| Smoothed {
                lag: planned.lag(),
                estimates,
                score: smoothed_score.map(|score| score.finish(aligned)),
            }),
            current: runner.rewinds().map(|rewinds| Current {
                score: current_score.map(|score| score.finish(aligned)),
                rewinds: rewinds.count,
                rows_again: rewinds.rows,
                most_rows_again: rewinds.most,
                longest_seconds: timing.longest(),
                memory: rewinds.bytes,
            }),
            inside: inside
                .map(|(f, score)| InsideScore {
                    filter: f.stages.join("."),
                    score,
                })
                .collect(),
            sensors: statistics.finish(last.time),
            excesses: excesses.finish(),
            control: self.data.rows.record(),
            faults: (counters.started).map_or_else(Vec::new, |from| fault_windows(self.design, from, last.time.seconds())),
            sources: self.data.rows.statistics(),
            parameters,
            consumers: if self.is_one_of_many { Vec::new() } else { consumers.finish() },
            unused_rows: counters.unused_rows,
            spikes: counters.spikes,
            sections: further_sections.into_iter().map(|section| section.finish()).collect(),
            failures: counters.failures,
            further_failures: counters.further_failures,
            wall_seconds: self.begun.elapsed().as_secs_f64(),
            filter_ns_per_epoch: timing.ns_per_epoch(counters.epochs),
        };
        summary.findings = advice::findings(self.design, &summary, &self.options.ignored);
        let checkpoints = self.options.checkpoint.iter().map(|c| &c.file).chain(&self.options.resume);
        Ok(Finished {
            summary,
            files,
            checkpoints: checkpoints.cloned().collect(),
        })
    }
}

/// Feeds the rows within the time of the run and reports them to the hub; `reader` reads the pose that steers a world.
fn feed(
    design: &Design,
    (runner, reader): (&mut Runner, &mut SolutionReader),
    data: &mut RunData,
    (hub, timing): (&mut Hub<'_>, &mut Timing),
    saving: &mut Saving<'_>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), Diagnostics> {
    let start = design.run.start.map_or(Time::MIN, |t| Time::from_seconds(t.si()));
    let stop = design.run.stop.map_or(Time::MAX, |t| Time::from_seconds(t.si()));
    let mut count = 0_u32;
    loop {
        saving.save_in_time(runner, hub, timing)?;
        let said = saving.said();
        count = count.wrapping_add(1);
        let told = count.is_multiple_of(4096).then(|| data.rows.share());
        let Some(row) = data.rows.next(&mut Carried { runner, reader, said })? else {
            break;
        };
        saving.used((row.stream, row.time));
        if let Some(share) = told {
            progress(Progress { time: row.time, share });
        }
        if row.time < start || row.time > stop {
            hub.outside(&row, row.time > stop).map_err(stopped)?;
            continue;
        }
        if let Some(epochs) = data.reference.epochs(&row) {
            let time = row.time;
            epochs.into_iter().for_each(|epoch| hub.reference(epoch));
            data.rows.truth().into_iter().for_each(|state| hub.truth(time, state));
            continue;
        }
        // Once a runner has started, its initialisers are not asked and not saved.
        let has_started = runner.newest().started();
        hub.row(&row, || if has_started { Vec::new() } else { runner.waits_for() })
            .map_err(stopped)?;
        timing.feed(runner, &row, hub).map_err(stopped)?;
    }
    runner.finish(hub).map_err(stopped)?;
    hub.finish().map_err(stopped)
}

/// The reference names a source that does not exist.
pub(crate) fn unknown_reference(sources: &[Named<SourceDesign>], reference: &Named<ReferenceSpec>, name: &str) -> Diagnostic {
    let names: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
    let place = if reference.block.source.is_one() {
        reference.node.place_of("source")
    } else {
        let table = reference.node.at("source").and_then(|table| table.get(name));
        table.map_or_else(|| reference.node.place(), Node::name_place)
    };
    let unknown = Diagnostic::error(format!("no source is called `{name}`")).at(place);
    unknown.suggest(name, &names, "there are")
}

fn stopped(why: impl core::fmt::Display) -> Diagnostics {
    Diagnostic::error(why.to_string()).into()
}

/// The rows of a run and its reference.
#[derive(Debug)]
struct RunData {
    /// Its rows.
    rows: Box<dyn Feed>,
    reference: Reference,
}

impl RunData {
    /// Opens the recorded sources of a design, or makes its simulated world.
    fn open(design: &Design, assembly: &Assembly, options: &Options, course: Option<&SharedCourse>) -> Result<Self, Diagnostics> {
        let Some(simulation) = &design.simulation else {
            return recorded::open(design, assembly, options);
        };
        let mut rows = SimulatedRows::new(design, simulation, assembly, options.seed)?;
        if let Some(course) = course {
            rows = rows.share(course);
        }
        Ok(Self {
            reference: Reference::simulated(assembly),
            rows: Box::new(rows),
        })
    }
}

/// The declared faults of each stream.
fn declared_faults(design: &Design) -> Vec<(&str, &[Fault])> {
    let recorded = design
        .sources
        .iter()
        .map(|named| (named.name.as_str(), named.block.faults.as_slice()));
    let simulated = design.simulation.iter().flat_map(|s| &s.block.faults);
    let simulated = simulated.map(|(stream, faults)| (stream_of(design, stream), faults.as_slice()));
    if design.simulation.is_some() {
        simulated.collect()
    } else {
        recorded.collect()
    }
}

/// The greatest number of windows kept of a fault.
const FAULT_WINDOWS: usize = 1000;

/// The windows of all faults between two times \[s\], by their beginnings.
fn fault_windows(design: &Design, from: f64, to: f64) -> Vec<FaultWindow> {
    let [from, to] = [from, to].map(Time::from_seconds);
    let streams = declared_faults(design).into_iter();
    let all = streams.flat_map(|(stream, faults)| faults.iter().map(move |fault| (stream, fault)));
    let windows = all.flat_map(|(stream, (name, fault))| {
        let windows: Vec<Window> = fault.windows().within(Window { from, to }).take(FAULT_WINDOWS).collect();
        windows.into_iter().map(move |w| FaultWindow {
            stream: stream.to_owned(),
            fault: name.clone(),
            from: w.from.max(from).seconds(),
            to: w.to.min(to).seconds(),
        })
    });
    let mut windows: Vec<FaultWindow> = windows.collect();
    windows.sort_by(|a, b| a.from.total_cmp(&b.from));
    windows
}

/// The declared outages, each with the sensors of the outermost filter that read the silent stream.
fn outages(design: &Design, assembly: &Assembly) -> Vec<Outage> {
    let streams = declared_faults(design);
    let reads = |name: &str| {
        let stream = assembly.streams.iter().position(|s| s.name == name);
        let sensors = assembly.runner.sensors().iter().enumerate();
        let readers = sensors.filter(move |(_, sensor)| Some(sensor.port.stream) == stream);
        readers.map(|(number, _)| number).collect()
    };
    let silent = streams
        .into_iter()
        .flat_map(|(name, faults)| silences(faults).map(move |w| (name, w)));
    silent
        .map(|(name, windows)| Outage {
            windows: windows.clone(),
            sensors: reads(name),
        })
        .collect()
}

/// Where relative source paths start.
#[must_use]
pub fn data_dir<P>(design: &Design<P>, options: &Options) -> PathBuf {
    // Also works if another field of [run] has a mistake and the table was not read.
    let written = || {
        design
            .document
            .root()
            .at("run.data_dir")
            .and_then(|node| node.as_str())
            .map(PathBuf::from)
    };
    let declared = || options.base.join(design.run.data_dir.clone().or_else(written).unwrap_or_default());
    options.data.clone().unwrap_or_else(declared)
}
