//! Progress of one run or of many runs: a bar on a terminal, nothing in a pipe.

use fusion::core::time::Time;
use fusion::design::Design;
use fusion::run;
use fusion_advice::frames::Step;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// The resolution of a bar.
const PARTS: u64 = 1000;

#[derive(Debug)]
pub(super) struct Progress {
    bar: ProgressBar,
    /// The length of simulated data; for recorded data the reader reports the share.
    seconds: Option<f64>,
    first: Option<Time>,
}

impl Progress {
    /// A bar with the remaining time if the end is known, otherwise with the time of the log.
    pub(super) fn new(design: &Design) -> Self {
        let simulated = design.simulation.as_ref().and_then(|s| s.block.world.duration().ok());
        let bar = if std::io::stderr().is_terminal() {
            ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr())
                .with_style(style("{spinner} {msg} s of data, {elapsed} elapsed"))
        } else {
            ProgressBar::hidden()
        };
        Self {
            bar,
            seconds: simulated.filter(|seconds| *seconds > 0.0),
            first: None,
        }
    }

    /// The run has reached this point.
    pub(super) fn at(&mut self, to: run::Progress) {
        let first = *self.first.get_or_insert(to.time);
        let seconds = to.time.seconds_since(first).max(0.0);
        self.bar.set_message(format!("{seconds:.0}"));
        match to.share.or_else(|| Some(seconds / self.seconds?)) {
            None => self.bar.inc(1),
            Some(share) => {
                if self.bar.length().is_none() {
                    self.bar.set_length(PARTS);
                    self.bar.set_style(style("{bar:40} {msg} s of data, {eta} left"));
                }
                self.bar.set_position((share.clamp(0.0, 1.0) * PARTS as f64) as u64);
            }
        }
    }

    /// The run has ended: clears the line.
    pub(super) fn finish(self) {
        self.bar.finish_and_clear();
    }
}

/// Progress of many runs.
#[derive(Debug)]
pub(super) struct Runs(ProgressBar);

impl Runs {
    /// A bar with the remaining time.
    pub(super) fn new() -> Self {
        if !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        Self(bar.with_style(style("{bar:40} {pos} of {len} runs, {eta} left")))
    }

    /// The number of finished runs, of all runs.
    pub(super) fn at(&self, done: u64, all: u64) {
        self.0.set_length(all);
        self.0.set_position(done);
    }
}

/// The runs have ended: clears the line.
impl Drop for Runs {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// The current trial, and its number of finished runs.
#[derive(Debug)]
pub(super) struct Trials(ProgressBar);

impl Trials {
    pub(super) fn new() -> Self {
        if !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        Self(bar.with_style(style("{bar:20} {pos} of {len} runs, {elapsed} elapsed: {msg}")))
    }

    /// The trials have reached this step.
    pub(super) fn at(&self, step: Step<'_>) {
        self.0.set_message(step.what.to_owned());
        // Together: a step may have fewer runs than the previous step had finished.
        self.0.update(|state| {
            state.set_len(step.all as u64);
            state.set_pos(step.done as u64);
        });
    }
}

/// The trials have ended: clears the line.
impl Drop for Trials {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
