//! How far a run is, or many runs are: a bar on a terminal, nothing in a pipe.

use fusion::core::time::Time;
use fusion::design::Design;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

#[derive(Debug)]
pub(super) struct Progress {
    bar: ProgressBar,
    first: Option<Time>,
}

impl Progress {
    /// A bar where the end is known, the time of the log where it is not.
    pub(super) fn new(design: &Design) -> Self {
        let simulated = design.simulation.as_ref().and_then(|s| s.block.world.duration().ok());
        let stop = design.run.stop.map(|t| t.si()).or(simulated);
        let bar = match stop {
            _ if !std::io::stderr().is_terminal() => ProgressBar::hidden(),
            Some(stop) => {
                let seconds = stop - design.run.start.map_or(0.0, |t| t.si());
                let bar = ProgressBar::with_draw_target(Some(seconds.max(0.0) as u64), ProgressDrawTarget::stderr());
                bar.with_style(style("{bar:40} {pos} of {len} s of data, {eta} left"))
            }
            None => {
                let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
                bar.with_style(style("{spinner} {pos} s of data, {elapsed} elapsed"))
            }
        };
        Self { bar, first: None }
    }

    /// The run has come to `time`.
    pub(super) fn at(&mut self, time: Time) {
        let first = *self.first.get_or_insert(time);
        self.bar.set_position(time.seconds_since(first).max(0.0) as u64);
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

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
