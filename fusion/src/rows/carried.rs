//! The filter of a run, as the world sees it that it steers.

use super::{Aboard, Pose};
use crate::solution::SolutionReader;
use fusion_core::runner::Runner;
use fusion_core::time::Time;

/// A runner between two of its rows.
#[derive(Debug)]
pub(crate) struct Carried<'a> {
    pub(crate) runner: &'a mut Runner,
    pub(crate) reader: &'a mut SolutionReader,
    /// What it has said, for a run that is saved.
    pub(crate) said: Option<&'a mut Vec<Option<Pose>>>,
}

impl Carried<'_> {
    fn now(&mut self, now: Time) -> Option<Pose> {
        if !self.runner.started() {
            return None;
        }
        // Where nothing is held back, the belief is what is known.
        if self.runner.lag() <= 0.0 && self.runner.belief().time >= now {
            return Pose::of(self.reader.read(self.runner.belief()));
        }
        Pose::of(self.reader.read(&self.runner.predicted(now)?))
    }
}

impl Aboard for Carried<'_> {
    fn pose(&mut self, now: Time) -> Option<Pose> {
        let pose = self.now(now);
        if let Some(said) = &mut self.said {
            said.push(pose);
        }
        pose
    }
}

/// Says again what a filter has said.
#[derive(Debug)]
pub(crate) struct Again<'a>(pub(crate) core::slice::Iter<'a, Option<Pose>>);

impl Aboard for Again<'_> {
    fn pose(&mut self, _: Time) -> Option<Pose> {
        self.0.next().copied().flatten()
    }
}
