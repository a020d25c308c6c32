//! Running a design over its data.

use crate::assembly::{Assembly, StreamLayout, assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics, did_you_mean};
use crate::design::{Design, Named, ReferenceSpec};
use crate::recorder::Recorder;
use crate::report::Recording;
use crate::score::{ReferenceEpoch, Rules, Score, Scorer, differentiate};
use crate::source::{Faulted, Lent, Merged, OpenContext, Source, SourceReport, outages};
use crate::tally::SensorTally;
use crate::world::SimulatedRows;
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::{Row, RunError, StreamId};
use fusion_core::state::{Attitude, Manifold};
use fusion_core::time::Time;
use nalgebra::Vector3;
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
    /// Its values, in storage order and SI.
    pub value: Vec<f64>,
    /// Its 1σ per tangent axis.
    pub sigma: Vec<f64>,
    /// Unit of a tangent coordinate.
    pub unit: &'static str,
}

/// What a source delivered.
#[derive(Clone, Debug, Serialize)]
pub struct SourceTally {
    /// The source.
    pub name: String,
    /// Rows read.
    pub rows: u64,
    /// Rows delivered.
    pub used: u64,
    /// Rows left out, by reason.
    pub skipped: Vec<(String, u64)>,
    /// The report as printed.
    #[serde(skip)]
    pub report: String,
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
    let mut feed = Feed::open(design, &assembly, options)?;
    let mut recorder = Recorder::new(design, &assembly, feed.scorer(design), &feed.disturbable(), options)?;
    if record {
        let mut recording = Recording::of(design, &assembly);
        feed.epochs.iter().for_each(|epoch| recording.reference(epoch));
        recorder.recording = Some(recording);
    }
    let Assembly { mut runner, .. } = assembly;
    let start = design.run.start.map_or(Time::MIN, |t| Time::from_seconds(t.si()));
    let stop = design.run.stop.map_or(Time::MAX, |t| Time::from_seconds(t.si()));
    let mut in_feed = Duration::ZERO;
    let (mut count, mut fed, mut timed) = (0_u32, 0_u32, 0_u32);
    let (reference, reference_layout) = (feed.reference, feed.reference_layout.clone());
    while let Some(lent) = feed.next(design)? {
        let (stream, time, row) = (lent.from, lent.time, lent.row);
        if time < start || time > stop {
            continue;
        }
        count = count.wrapping_add(1);
        if count.is_multiple_of(4096) {
            progress(time);
        }
        if stream == reference {
            epochs(time, row, &reference_layout)
                .into_iter()
                .for_each(|epoch| recorder.reference(epoch));
            continue;
        }
        recorder.disturbed(stream, time, lent.disturbed);
        if let Some(recording) = &mut recorder.recording {
            recording.row(stream, time, row);
        }
        fed = fed.wrapping_add(1);
        // Looking at the clock costs a good part of what it measures: one row in 16 is timed,
        // picked so that no period of the streams can favour some of them.
        recorder.timed = fed.wrapping_mul(0x9E37_79B9) >> 28 == 0;
        let clock = recorder.timed.then(Instant::now);
        let row = Row {
            stream,
            time,
            values: row,
            number: 0,
            disturbed: lent.disturbed,
        };
        runner.feed(&row, &mut recorder).map_err(stopped)?;
        if let Some(clock) = clock {
            in_feed += clock.elapsed();
            timed += 1;
        }
    }
    recorder.timed = false;
    runner.finish(&mut recorder).map_err(|halt| stopped(halt.into()))?;
    let waiting = if runner.started() { Vec::new() } else { runner.waits_for() };
    let sources = feed.reports();
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
pub fn unknown_reference(design: &Design, reference: &Named<ReferenceSpec>) -> Diagnostic {
    let names: Vec<&str> = design.sources.iter().map(|s| s.name.as_str()).collect();
    let message = format!("no source is called `{}`", reference.block.source);
    let diagnostic = Diagnostic::error(message).at(reference.node.place_of("source"));
    let diagnostic = match did_you_mean(&reference.block.source, &names) {
        Some(meant) => diagnostic.label(format!("did you mean `{meant}`?")),
        None => diagnostic,
    };
    diagnostic.help(format!("there are: `{}`", names.join("`, `")))
}

pub(crate) fn unwritable(path: &Path, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error(format!("cannot write {}: {error}", path.display())).into()
}

fn stopped(error: RunError) -> Diagnostics {
    Diagnostic::error(error.to_string()).into()
}

/// Rows from recorded sources or from a simulated world.
#[derive(Debug)]
struct Feed {
    rows: Rows,
    /// The stream of each recorded source.
    ids: Vec<usize>,
    names: Vec<String>,
    reference: usize,
    reference_layout: StreamLayout,
    /// A recorded reference, read ahead.
    epochs: Vec<ReferenceEpoch>,
    windows: Vec<(Time, Time)>,
    /// What the recorded reference delivered.
    reference_tally: Option<SourceTally>,
}

#[derive(Debug)]
enum Rows {
    Recorded(Merged),
    Simulated(Box<SimulatedRows>),
}

impl Feed {
    fn open(design: &Design, assembly: &Assembly, options: &Options) -> Result<Self, Diagnostics> {
        let nothing = StreamLayout {
            name: String::new(),
            alias: None,
            channels: Vec::new(),
            declared: true,
        };
        let mut feed = Self {
            rows: Rows::Recorded(Merged::new(Vec::new())),
            ids: Vec::new(),
            names: Vec::new(),
            reference: usize::MAX,
            reference_layout: nothing,
            epochs: Vec::new(),
            windows: Vec::new(),
            reference_tally: None,
        };
        if let Some(simulation) = &design.simulation {
            let rows = SimulatedRows::new(design, simulation, assembly, options.seed)?;
            feed.windows = rows.outages();
            if let Some(at) = assembly.streams.iter().position(|s| s.name == crate::world::REFERENCE) {
                feed.reference = at;
                feed.reference_layout = assembly.streams[at].clone();
            }
            feed.rows = Rows::Simulated(Box::new(rows));
            return Ok(feed);
        }
        if design.sources.is_empty() {
            let place = design.document.root().place();
            let help = "add [source.NAME] tables for recorded data, or a [simulation]";
            return Err(Diagnostic::error("this design has no data to run on").at(place).help(help).into());
        }
        feed.open_recorded(design, assembly, options)?;
        Ok(feed)
    }

    fn open_recorded(&mut self, design: &Design, assembly: &Assembly, options: &Options) -> Result<(), Diagnostics> {
        let mut d = Diagnostics::new();
        let mut open = Vec::new();
        let data_dir = data_dir(design, options);
        let seed = options.seed.unwrap_or(design.run.seed);
        for named in &design.sources {
            let context = OpenContext {
                data_dir: data_dir.clone(),
                name: named.name.clone(),
                origin: design.run.origin.map(Into::into),
                seed,
            };
            let faults = &named.block.faults;
            for (_, windows) in outages(faults) {
                let within = windows.within(Time::default(), HORIZON);
                self.windows.extend(within.into_iter().map(|w| (w.from, w.to)));
            }
            let opened = named
                .block
                .source
                .open(&context)
                .and_then(|s| Ok(Faulted::new(s, faults, &context)?));
            match opened {
                Ok(source) => open.push((named, Box::new(source) as Box<dyn Source>)),
                Err(error) => d.extend(error.diagnostics(&named.node)),
            }
        }
        if d.has_errors() {
            return Err(d);
        }
        let reference = design.reference.as_ref();
        let mut sources = Vec::new();
        for (named, source) in open {
            if reference.is_some_and(|r| r.block.source == named.name) {
                self.read_reference(named, source, reference)?;
            } else if let Some(id) = assembly.streams.iter().position(|s| s.name == named.name) {
                self.ids.push(id);
                self.names.push(named.name.clone());
                sources.push(source);
            }
        }
        if let Some(r) = reference.filter(|r| !design.sources.iter().any(|s| s.name == r.block.source)) {
            return Err(unknown_reference(design, r).into());
        }
        self.windows.sort_unstable();
        self.windows.dedup();
        self.rows = Rows::Recorded(Merged::new(sources));
        Ok(())
    }

    fn read_reference<T>(
        &mut self,
        named: &Named<T>,
        mut source: Box<dyn Source>,
        spec: Option<&Named<ReferenceSpec>>,
    ) -> Result<(), Diagnostics> {
        let layout = StreamLayout::provided(&named.name, source.channels());
        if !layout
            .channels
            .iter()
            .any(|c| ["position", "velocity", "attitude"].contains(&c.name.as_str()))
        {
            let message = format!("the reference `{}` has no channel to be scored against", named.name);
            let help = "give it a `position`, a `velocity` or an `attitude`";
            return Err(Diagnostic::error(message).at(named.node.name_place()).help(help).into());
        }
        let mut row = Vec::new();
        loop {
            match source.next(&mut row) {
                Ok(Some(time)) => self.epochs.extend(epochs(time, &row, &layout)),
                Ok(None) => break self.epochs.sort_by_key(|e| e.time),
                Err(error) => {
                    let mut d = Diagnostics::new();
                    d.extend(error.diagnostics(&named.node));
                    return Err(d);
                }
            }
        }
        self.reference_tally = Some(tally(&named.name, &source.report()));
        if let Some(slope) = spec.and_then(|s| s.block.velocity_from_position) {
            differentiate(&mut self.epochs, slope.half_window as usize, slope.max_span.si());
        }
        Ok(())
    }

    /// Scores against the reference, if there is one.
    fn scorer(&self, design: &Design) -> Option<Scorer> {
        let has_reference = self.reference != usize::MAX || !self.epochs.is_empty();
        has_reference.then(|| {
            let spec = design.reference.as_ref().map(|r| &r.block);
            let rules = Rules {
                from: spec.and_then(|s| s.from).map(|t| Time::from_seconds(t.si())),
                lever_arm: spec.map_or_else(Vector3::zeros, |s| s.lever_arm.si().into()),
                remove_mean_mounting: spec.is_some_and(|s| s.remove_mean_mounting),
                windows: self.windows.clone(),
            };
            Scorer::new(rules, self.epochs.clone())
        })
    }

    /// Which numbers of which streams declared faults may change.
    fn disturbable(&self) -> Vec<(StreamId, Range<usize>)> {
        match &self.rows {
            Rows::Simulated(rows) => rows.disturbable().collect(),
            Rows::Recorded(merged) => {
                let sources = self.ids.iter().zip(merged.sources());
                let columns = sources.flat_map(|(id, source)| source.disturbable().into_iter().map(|c| (*id, c)));
                columns.collect()
            }
        }
    }

    /// The next row, of a stream of the assembly.
    fn next(&mut self, design: &Design) -> Result<Option<Lent<'_>>, Diagnostics> {
        match &mut self.rows {
            Rows::Simulated(rows) => Ok(rows.next()),
            Rows::Recorded(merged) => match merged.next() {
                Ok(next) => Ok(next.map(|lent| Lent {
                    from: self.ids[lent.from],
                    ..lent
                })),
                Err(failed) => {
                    let node = design.sources.iter().find(|s| s.name == self.names[failed.index]).map(|s| &s.node);
                    let mut d = Diagnostics::new();
                    d.extend(failed.error.diagnostics(node.unwrap_or(design.document.root())));
                    Err(d)
                }
            },
        }
    }

    fn reports(&self) -> Vec<SourceTally> {
        match &self.rows {
            Rows::Simulated(rows) => rows.reports(),
            Rows::Recorded(merged) => {
                let named = self.names.iter().zip(merged.sources());
                let fused = named.map(|(name, source)| tally(name, &source.report()));
                fused.chain(self.reference_tally.clone()).collect()
            }
        }
    }
}

/// A source's report, for the summary.
pub(crate) fn tally(name: &str, report: &SourceReport) -> SourceTally {
    SourceTally {
        name: name.to_owned(),
        rows: report.rows,
        used: report.used,
        skipped: report.skipped.iter().map(|s| (s.reason.clone(), s.count)).collect(),
        report: report.to_string(),
    }
}

/// Where relative source paths start.
#[must_use]
pub fn data_dir(design: &Design, options: &Options) -> PathBuf {
    let declared = || options.base.join(design.run.data_dir.clone().unwrap_or_default());
    options.data.clone().unwrap_or_else(declared)
}

/// The reference epochs of a row: one for each time at which some of its channels are valid.
fn epochs(time: Time, row: &[f64], layout: &StreamLayout) -> Vec<ReferenceEpoch> {
    let mut epochs: Vec<ReferenceEpoch> = Vec::with_capacity(1);
    for channel in &layout.channels {
        let values = &row[channel.offset..channel.offset + channel.width];
        if !values.iter().all(|v| v.is_finite()) {
            continue;
        }
        let valid = time.shifted(-channel.delay);
        let at = epochs.iter().position(|e| e.time == valid).unwrap_or_else(|| {
            epochs.push(ReferenceEpoch {
                time: valid,
                position: None,
                velocity: None,
                attitude: None,
            });
            epochs.len() - 1
        });
        match channel.name.as_str() {
            "position" => epochs[at].position = Some(Geodetic::read(values)),
            "velocity" => epochs[at].velocity = Some(Vector3::new(values[0], values[1], values[2])),
            "attitude" => epochs[at].attitude = Some(Attitude::read(values)),
            _ => {}
        }
    }
    epochs.retain(|e| e.position.is_some() || e.velocity.is_some() || e.attitude.is_some());
    epochs
}
