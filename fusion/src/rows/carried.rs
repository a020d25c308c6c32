//! The filter of a run, as seen by the simulated world that it steers.

use super::{Aboard, Pose};
use crate::solution::{Solution, SolutionReader};
use fusion_core::health::Health;
use fusion_core::runner::Runner;
use fusion_core::time::Time;

/// A runner between two of its rows.
#[derive(Debug)]
pub(crate) struct Carried<'a> {
    pub(crate) runner: &'a mut Runner,
    pub(crate) reader: &'a mut SolutionReader,
    /// The poses given to the world so far, for a run that is saved.
    pub(crate) said: Option<&'a mut Vec<Option<Pose>>>,
}

impl Carried<'_> {
    fn now(&mut self, now: Time) -> Option<&Solution> {
        if !self.runner.started() {
            return None;
        }
        // Without a lag no rows are held back, so the belief is up to date.
        if self.runner.lag() <= 0.0 && self.runner.belief().time >= now {
            return Some(self.reader.read(self.runner.belief()));
        }
        Some(self.reader.read(&self.runner.predicted(now)?))
    }
}

impl Aboard for Carried<'_> {
    fn pose(&mut self, now: Time) -> Option<Pose> {
        let pose = self.now(now).and_then(Pose::of);
        if let Some(said) = &mut self.said {
            said.push(pose);
        }
        pose
    }

    fn solution(&mut self, now: Time) -> Option<Solution> {
        self.now(now).copied()
    }

    fn waits_for(&self) -> Vec<String> {
        if self.runner.started() {
            return Vec::new();
        }
        let waiting = self.runner.waits_for().into_iter();
        waiting.map(|(initialiser, why)| format!("{initialiser}: {why}")).collect()
    }

    fn health(&self) -> Option<&Health> {
        Some(self.runner.health())
    }
}

/// Repeats the recorded poses of a filter.
#[derive(Debug)]
pub(crate) struct Again<'a>(pub(crate) core::slice::Iter<'a, Option<Pose>>);

impl Aboard for Again<'_> {
    fn pose(&mut self, _: Time) -> Option<Pose> {
        self.0.next().copied().flatten()
    }
}
