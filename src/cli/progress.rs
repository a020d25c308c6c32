//! How far a run is, or many runs are: a bar on a terminal, nothing in a pipe.

use fusion::core::time::Time;
use fusion::design::Design;
use fusion::run;
use fusion_advice::frames::Step;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

/// Parts of a bar by which the share that has been read is drawn.
const PARTS: u64 = 1000;

#[derive(Debug)]
pub(super) struct Progress {
    bar: ProgressBar,
    /// How long simulated data are; of recorded data the share is told.
    seconds: Option<f64>,
    first: Option<Time>,
}

impl Progress {
    /// A bar with the time that is left where the end is known, the time of the log where it is not.
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

    /// The run has come to there.
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

    /// The run is over, and the line is free.
    pub(super) fn finish(self) {
        self.bar.finish_and_clear();
    }
}

/// How far many runs are.
#[derive(Debug)]
pub(super) struct Runs(ProgressBar);

impl Runs {
    /// A bar with the time that is left.
    pub(super) fn new() -> Self {
        if !std::io::stderr().is_terminal() {
            return Self(ProgressBar::hidden());
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        Self(bar.with_style(style("{bar:40} {pos} of {len} runs, {eta} left")))
    }

    /// So many of all have been done.
    pub(super) fn at(&self, done: u64, all: u64) {
        self.0.set_length(all);
        self.0.set_position(done);
    }
}

/// The runs are over, and the line is free.
impl Drop for Runs {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// What is being tried, and how many runs of how many are done.
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

    /// It has come to there.
    pub(super) fn at(&self, step: Step<'_>) {
        self.0.set_message(step.what.to_owned());
        // At once: a step may have fewer runs than were done of the one before.
        self.0.update(|state| {
            state.set_len(step.all as u64);
            state.set_pos(step.done as u64);
        });
    }
}

/// All has been tried, and the line is free.
impl Drop for Trials {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
