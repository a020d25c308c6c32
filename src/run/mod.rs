//! Running a design over its data.

mod recorded;
mod reference;

pub use crate::rows::SourceTally;
pub use recorded::open_one;

use crate::assembly::{Assembly, assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, ReferenceSpec};
use crate::recorder::Recorder;
use crate::report::Recording;
use crate::rows::{Feed, Row};
use crate::score::Score;
use crate::tally::SensorTally;
use crate::world::SimulatedRows;
use fusion_core::runner::RunError;
use fusion_core::state::Kind;
use fusion_core::time::Time;
use reference::Reference;
use serde::Serialize;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Repeated outages are listed up to here: longer than any log.
pub(crate) const HORIZON: Time = Time::from_nanos(10_000_000 * 1_000_000_000);

/// How a design is run.
#[derive(Debug, Default)]
pub struct Options {
    /// Relative source paths start here, instead of at the design's `data_dir`.
    pub data: Option<PathBuf>,
    /// Where the design's own relative paths start: the folder of its file.
    pub base: PathBuf,
    /// Where estimates.csv, updates.csv and summary.json go; nothing is written without it.
    pub out: Option<PathBuf>,
    /// The seed of simulated data and random faults, instead of the design's.
    pub seed: Option<u64>,
}

/// The state of one parameter at the end of a run.
#[derive(Clone, Debug, Serialize)]
pub struct FinalState {
    /// The block.
    pub name: String,
    /// What it is: how its values are read.
    #[serde(skip)]
    pub kind: Kind,
    /// Its values, in storage order and SI.
    pub value: Vec<f64>,
    /// Its 1σ per tangent axis.
    pub sigma: Vec<f64>,
    /// Its covariance in tangent coordinates, row by row.
    #[serde(skip)]
    pub covariance: Vec<f64>,
    /// Unit of a tangent coordinate.
    pub unit: &'static str,
}

/// The result of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// The design's own line about itself.
    pub description: String,
    /// The backend: chart, update, form.
    pub backend: String,
    /// When the filter started \[s\]; none if it never did.
    pub started: Option<f64>,
    /// What it was still waiting for at the end.
    pub waiting: Vec<(String, String)>,
    /// Estimates made.
    pub epochs: u64,
    /// Score against the reference.
    pub score: Option<Score>,
    /// Per sensor.
    pub sensors: Vec<SensorTally>,
    /// Per source.
    pub sources: Vec<SourceTally>,
    /// Estimated parameters at the end.
    pub parameters: Vec<FinalState>,
    /// Rows that came too late or held no number, by consumer.
    pub unused_rows: Vec<(String, u64)>,
    /// What the estimator could not do, with the first few reasons.
    pub failures: Vec<String>,
    /// Wall time of the whole run \[s\].
    pub wall_seconds: f64,
    /// Time in the filter alone, per estimate \[ns\].
    pub filter_ns_per_epoch: f64,
}

/// Runs `design`; `progress` hears the share of the data that is done, from time to time.
///
/// # Errors
/// Mistakes of the design, or what is wrong with the data.
pub fn run(design: &Design, options: &Options, progress: &mut dyn FnMut(Time)) -> Result<Summary, Diagnostics> {
    Ok(run_with(design, options, progress, false)?.0)
}

/// As [`run`], with what a report draws.
///
/// # Errors
/// As [`run`].
pub fn run_recorded(design: &Design, options: &Options, progress: &mut dyn FnMut(Time)) -> Result<(Summary, Recording), Diagnostics> {
    let (summary, recording) = run_with(design, options, progress, true)?;
    Ok((summary, recording.unwrap_or_else(|| Recording::new(Default::default()))))
}

fn run_with(
    design: &Design,
    options: &Options,
    progress: &mut dyn FnMut(Time),
    record: bool,
) -> Result<(Summary, Option<Recording>), Diagnostics> {
    let begun = Instant::now();
    let streams = declared_streams(design)?;
    let assembly = assemble(design, streams)?;
    let RunData {
        mut rows,
        reference,
        outages,
    } = RunData::open(design, &assembly, options)?;
    let scorer = reference.scorer(design, &outages);
    let mut recorder = Recorder::new(design, &assembly, scorer, &rows.disturbable(), options)?;
    if record {
        let mut recording = Recording::of(design, &assembly);
        reference.ahead().iter().for_each(|epoch| recording.reference(epoch));
        recorder.recording = Some(recording);
    }
    let Assembly { mut runner, .. } = assembly;
    let start = design.run.start.map_or(Time::MIN, |t| Time::from_seconds(t.si()));
    let stop = design.run.stop.map_or(Time::MAX, |t| Time::from_seconds(t.si()));
    let mut in_feed = Duration::ZERO;
    let (mut count, mut fed, mut timed) = (0_u32, 0_u32, 0_u32);
    while let Some(row) = rows.next()? {
        let Row { stream, time, .. } = row;
        if time < start || time > stop {
            continue;
        }
        count = count.wrapping_add(1);
        if count.is_multiple_of(4096) {
            progress(time);
        }
        if let Some(epochs) = reference.epochs(&row) {
            epochs.into_iter().for_each(|epoch| recorder.reference(epoch));
            continue;
        }
        recorder.disturbed(stream, time, row.disturbed);
        if let Some(recording) = &mut recorder.recording {
            recording.row(stream, time, row.values);
        }
        fed = fed.wrapping_add(1);
        // Looking at the clock costs a good part of what it measures: one row in 16 is timed,
        // picked so that no period of the streams can favour some of them.
        recorder.timed = fed.wrapping_mul(0x9E37_79B9) >> 28 == 0;
        let clock = recorder.timed.then(Instant::now);
        runner.feed(&row, &mut recorder).map_err(stopped)?;
        if let Some(clock) = clock {
            in_feed += clock.elapsed();
            timed += 1;
        }
    }
    recorder.timed = false;
    runner.finish(&mut recorder).map_err(|halt| stopped(halt.into()))?;
    let waiting = if runner.started() { Vec::new() } else { runner.waits_for() };
    let sources = rows.tallies();
    let in_filter = in_feed.saturating_sub(recorder.spent);
    let recording = recorder.recording.take();
    let mut summary = recorder.finish(design, runner.belief())?;
    summary.waiting = waiting;
    summary.sources = sources;
    summary.wall_seconds = begun.elapsed().as_secs_f64();
    let share = f64::from(timed.max(1)) / f64::from(fed.max(1));
    summary.filter_ns_per_epoch = in_filter.as_nanos() as f64 / share / summary.epochs.max(1) as f64;
    if let Some(out) = &options.out {
        let path = out.join("summary.json");
        let file = File::create(&path).map_err(|e| unwritable(&path, &e))?;
        serde_json::to_writer_pretty(BufWriter::new(file), &summary).map_err(|e| unwritable(&path, &e.into()))?;
    }
    Ok((summary, recording))
}

/// The reference names a source that is not there.
pub(crate) fn unknown_reference<P>(design: &Design<P>, reference: &Named<ReferenceSpec>) -> Diagnostic {
    let names: Vec<&str> = design.sources.iter().map(|s| s.name.as_str()).collect();
    let name = &reference.block.source;
    let unknown = Diagnostic::error(format!("no source is called `{name}`")).at(reference.node.place_of("source"));
    unknown.suggest(name, &names, "there are")
}

pub(crate) fn unwritable(path: &Path, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error(format!("cannot write {}: {error}", path.display())).into()
}

fn stopped(error: RunError) -> Diagnostics {
    Diagnostic::error(error.to_string()).into()
}

/// What a run is fed with and scored against.
#[derive(Debug)]
struct RunData {
    /// Its rows.
    rows: Box<dyn Feed>,
    reference: Reference,
    /// The declared outages, for the drift over each.
    outages: Vec<(Time, Time)>,
}

impl RunData {
    /// Opens the recorded sources of a design, or makes its simulated world.
    fn open(design: &Design, assembly: &Assembly, options: &Options) -> Result<Self, Diagnostics> {
        let Some(simulation) = &design.simulation else {
            return recorded::open(design, assembly, options);
        };
        let rows = SimulatedRows::new(design, simulation, assembly, options.seed)?;
        Ok(Self {
            outages: rows.outages(),
            reference: Reference::simulated(assembly),
            rows: Box::new(rows),
        })
    }
}

/// Where relative source paths start.
#[must_use]
pub fn data_dir<P>(design: &Design<P>, options: &Options) -> PathBuf {
    let declared = || options.base.join(design.run.data_dir.clone().unwrap_or_default());
    options.data.clone().unwrap_or_else(declared)
}
