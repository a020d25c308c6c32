//! Running a design over its data.

mod advice;
mod also;
pub mod examine;
mod faults;
mod feeding;
mod files;
mod observers;
mod recorded;
mod reference;
mod saving;
mod schema;
mod sections;
mod smoothing;

pub use crate::observe::{Counts, Failures, FinalState, InsideScore, Smoothed, Start, Summary, UnusedRows};
pub use crate::rows::{KeptRows, SourceStatistics};
pub use advice::{Advisor, Finding, Ignored, Rule};
pub use faults::FaultWindow;
pub use feeding::FeedMaker;
pub use files::{Finished, thinning};
pub use recorded::open_one;
pub use saving::Checkpoints;
pub use schema::summary_schema;
pub use sections::{Computation, Current, Detector, Effort, Identity, JudgedBy};

use crate::assembly::{Assembly, assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Named, ReferenceSpec, SourceDesign};
use crate::observe::{Filters, Hub, RunEnd, RunObserver, Timing};
use crate::output::EstimateFormat;
use crate::rows::{Carried, Feed};
use crate::solution::SolutionReader;
use crate::source::Supply;
use crate::world::{SimulatedRows, drawn_start};
use files::Files;
use fusion_core::runner::Runner;
use fusion_core::time::Time;
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
    /// By all data of the log, with the models linearised again at the smoothed states until these do not change: the
    /// maximum a posteriori.
    Iterated(Keep),
    /// The same maximum by sparse Cholesky factorisation of the normal equations of the whole log, in memory. It needs the
    /// feature `faer`.
    Batch,
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
    /// The feed of the run, instead of the design's sources or simulated world.
    pub feed: Option<FeedMaker>,
    /// Decoded rows that several runs over the same sources share.
    pub kept: Option<KeptRows>,
    /// Where the design's own relative paths start: the folder of its file.
    pub base: PathBuf,
    /// Where estimates.csv, updates.csv and summary.json go; nothing is written without it.
    pub out: Option<PathBuf>,
    /// Further formats of the estimates in that folder.
    pub also: Vec<&'static EstimateFormat>,
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
        let planned = Planned::of(self.design, self.options);
        let mut files = Files::create((self.design, &self.assembly), self.options, &filters, planned.is_some())?;
        let mut hub = self.hub(&filters, (planned, &mut files), smoothed)?;
        further.iter_mut().for_each(|observer| hub.add(*observer));
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
        let (design, seed) = (self.design, self.options.seed);
        let end = RunEnd::new((design, seed), &self.assembly, (&*self.data.rows, &timing));
        let mut summary = hub.result(end).map_err(stopped)?;
        let files = files.finish()?;
        summary.put(Effort {
            wall_seconds: self.begun.elapsed().as_secs_f64(),
            filter_ns_per_epoch: timing.ns_per_epoch(summary.counts().epochs),
        });
        summary.put(advice::findings(design, &summary, &self.options.ignored));
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
        saving.save_in_time((runner, hub, timing), &mut *data.rows)?;
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
        if let Some(feed) = &options.feed {
            let reference = if feed.is_scored() && design.simulation.is_none() {
                recorded::reference(design, options)?
            } else {
                Reference::None
            };
            return Ok(Self {
                reference,
                rows: feed.make(design, assembly)?,
            });
        }
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
