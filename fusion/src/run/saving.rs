//! Saves a run at intervals, so that another process can resume it.
//!
//! ```text
//! every so often   files ─▶ disk;   rows so far, runner, observers, timing ─▶ FILE, whole or not at all
//! going on         FILE ─▶ runner, observers;   files cut to what they had;   as many rows passed over
//! ```
//!
//! A feed with a memory resumes by it. Other sources are read again from their beginning, so that their random numbers repeat. A world whose vehicle
//! is steered by the filter receives the recorded poses of the filter again.

use super::{Options, RunData, Smoothing, stopped};
use crate::checkpoint::{self, fingerprint_of_run};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::Design;
use crate::observe::{Hub, Timing};
use crate::output::Unwritable;
use crate::rows::{Again, Feed, Pose};
use fusion_core::checkpoint::{CheckpointError, Of, opened, sealed};
use fusion_core::covariance::Kernel;
use fusion_core::memory::{self, Memory, Tape};
use fusion_core::runner::{Runner, StreamId};
use fusion_core::time::Time;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where and how often a run is saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoints {
    /// The file, which is replaced each time and removed at the end of the run.
    pub file: PathBuf,
    /// Wall time between two checkpoints.
    pub every: Duration,
}

/// Rows between two looks at the clock.
const LOOK: u64 = 64;

/// Saves a run.
#[derive(Debug)]
pub(super) struct Saving<'o> {
    to: Option<&'o Checkpoints>,
    from: Option<&'o Path>,
    fingerprint: u64,
    progress: Progress,
    /// Its rows come from outside, at any rate.
    is_live: bool,
    /// The time of the last save.
    last: Instant,
    /// The content of the file.
    bytes: Vec<u8>,
}

/// How far a run has come in its rows.
#[derive(Debug, Default)]
struct Progress {
    rows: u64,
    /// The stream and the stamp of the last row.
    last: Option<(StreamId, Time)>,
    /// The poses that the filter gave to a world that it steers.
    said: Vec<Option<Pose>>,
}

fusion_core::memory!(Progress { rows, last, said });

/// Everything that is saved.
struct Whole<'a, 'h> {
    progress: &'a mut Progress,
    /// A feed that resumes by its memory.
    feed: Option<&'a mut dyn Memory>,
    runner: &'a mut Runner,
    hub: &'a mut Hub<'h>,
    timing: &'a mut Timing,
}

impl Memory for Whole<'_, '_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.progress.remember(tape);
        if let Some(feed) = &mut self.feed {
            feed.remember(tape);
        }
        self.runner.remember(tape);
        self.hub.remember(tape);
        self.timing.remember(tape);
    }
}

impl<'o> Saving<'o> {
    /// Saving as the options declare. Nothing has been written yet.
    ///
    /// # Errors
    /// The run cannot be saved, a stopped run would be overwritten, or the checkpoint to resume belongs to
    /// another run.
    pub(super) fn begin(design: &Design, options: &'o Options) -> Result<Self, Diagnostics> {
        let mut saving = Self {
            to: options.checkpoint.as_ref(),
            from: options.resume.as_deref(),
            fingerprint: fingerprint_of_run(&design.document, &told(design, options)),
            progress: Progress::default(),
            is_live: options.feed.is_some(),
            last: Instant::now(),
            bytes: Vec::new(),
        };
        if saving.is_idle() {
            return Ok(saving);
        }
        if matches!(options.smooth, Smoothing::Whole(_) | Smoothing::Iterated(_) | Smoothing::Batch) {
            let help = "smooth with a lag, `smooth` under `[run]`, or run without checkpoints";
            let error = Diagnostic::error("a run that is smoothed by all of its log cannot be saved: its steps are as long as the log");
            return Err(error.help(help).into());
        }
        if let Some(Checkpoints { file, .. }) = saving.to
            && saving.from != Some(file)
            && file.exists()
        {
            let file = file.display();
            let error = Diagnostic::error(format!("{file} is there already, of a run that was stopped"));
            return Err(error.help(format!("continue it with `--resume {file}`, or remove it")).into());
        }
        if let Some(from) = saving.from {
            saving.bytes = saving.read(from)?;
        }
        Ok(saving)
    }

    const fn is_idle(&self) -> bool {
        self.to.is_none() && self.from.is_none()
    }

    /// The saved content of the file `from`.
    fn read(&self, from: &Path) -> Result<Vec<u8>, Diagnostics> {
        let bytes = checkpoint::read(from).map_err(|error| failed(from, error))?;
        let memory = opened(Of::Run, self.fingerprint, &bytes).map_err(|error| match error {
            CheckpointError::Design => {
                let help = "continue with the same design, variants, assignments, seed and outputs as it was begun with";
                Diagnostics::from(Diagnostic::error(format!("{} is of another run", from.display())).help(help))
            }
            error => failed(from, error),
        })?;
        Ok(memory.to_vec())
    }

    /// Resumes the saved run, if the options ask for it; `hub` has all its observers.
    ///
    /// # Errors
    /// An observer cannot be saved, the file holds other observers, or the data have changed.
    pub(super) fn resume(
        &mut self,
        (runner, hub, timing): (&mut Runner, &mut Hub<'_>, &mut Timing),
        data: &mut RunData,
    ) -> Result<(), Diagnostics> {
        if !self.is_idle() && !hub.has_memory() {
            return Err(Diagnostic::error("this run is heard by an observer without a memory: it cannot be saved").into());
        }
        let Some(from) = self.from else { return Ok(()) };
        let progress = &mut self.progress;
        let mut whole = Whole {
            progress,
            feed: data.rows.memory(),
            runner,
            hub,
            timing,
        };
        memory::restore(&mut whole, &self.bytes).map_err(|error| failed(from, error))?;
        hub.resume().map_err(stopped)?;
        if data.rows.memory().is_some() {
            return Ok(());
        }
        self.pass(data).map_err(|why| match why {
            Passed::Failed(d) => d,
            Passed::Other(row) => {
                let help = "the log or its declared faults are not those that it was begun with";
                let error = Diagnostic::error(format!(
                    "cannot continue with {}: row {row} of its data has changed",
                    from.display()
                ));
                error.help(help).into()
            }
        })
    }

    /// Passes over the rows that were used before.
    fn pass(&self, data: &mut RunData) -> Result<(), Passed> {
        let Progress { rows, last, said } = &self.progress;
        let mut again = Again(said.iter());
        for number in 1..=*rows {
            let row = data.rows.next(&mut again).map_err(Passed::Failed)?;
            let stamp = row.map(|row| (row.stream, row.time));
            if stamp.is_none() || number == *rows && stamp != *last {
                return Err(Passed::Other(number));
            }
        }
        Ok(())
    }

    /// The store for the poses that the filter gives to its world, if the run is saved.
    pub(super) fn said(&mut self) -> Option<&mut Vec<Option<Pose>>> {
        self.to.is_some().then_some(&mut self.progress.said)
    }

    /// Counts a used row; does nothing if the run is not saved.
    pub(super) fn used(&mut self, (stream, time): (StreamId, Time)) {
        if self.to.is_none() {
            return;
        }
        self.progress.rows += 1;
        self.progress.last = Some((stream, time));
    }

    /// Saves the run between two rows, if it is time.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn save_in_time(
        &mut self,
        (runner, hub, timing): (&mut Runner, &mut Hub<'_>, &mut Timing),
        rows: &mut dyn Feed,
    ) -> Result<(), Diagnostics> {
        let Some(Checkpoints { file, every }) = self.to else {
            return Ok(());
        };
        if !self.progress.rows.is_multiple_of(LOOK) && !self.is_live || self.last.elapsed() < *every {
            return Ok(());
        }
        hub.flush().map_err(stopped)?;
        self.bytes.clear();
        let progress = &mut self.progress;
        let mut whole = Whole {
            progress,
            feed: rows.memory(),
            runner,
            hub,
            timing,
        };
        memory::save(&mut whole, &mut self.bytes);
        replace(file, &sealed(Of::Run, self.fingerprint, &self.bytes)).map_err(|error| Unwritable::new(file, error))?;
        self.last = Instant::now();
        Ok(())
    }
}

/// Why rows could not be passed over.
enum Passed {
    Failed(Diagnostics),
    /// The row differs from the earlier one, or there is no such row.
    Other(u64),
}

fn failed(from: &Path, why: impl core::fmt::Display) -> Diagnostics {
    Diagnostic::error(format!("cannot continue with {}: {why}", from.display())).into()
}

/// The options that a run depends on. All kernels except the portable one give bit-identical results.
fn told(design: &Design, options: &Options) -> String {
    let Options {
        seed,
        smooth,
        out,
        also: _,
        data,
        causal,
        base: _,
        checkpoint: _,
        resume: _,
        rows: _,
        feed: _,
        ignored: _,
        kept: _,
    } = options;
    let is_portable = design.filter.kernel.unwrap_or_default() == Kernel::PORTABLE;
    format!("{seed:?} {smooth:?} {} {data:?} {causal} {is_portable}", out.is_some())
}

/// Writes `file` atomically: at any moment it has either its old or its new content.
fn replace(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name = file.as_os_str().to_owned();
    name.push(".partial");
    let partial = PathBuf::from(name);
    let mut written = File::create(&partial)?;
    written.write_all(bytes)?;
    written.sync_all()?;
    fs::rename(&partial, file)
}
