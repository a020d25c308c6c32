//! The filter of a run, as the world sees it that it steers.

use crate::rows::Aboard;
use crate::solution::{Solution, SolutionReader};
use fusion_core::runner::Runner;
use fusion_core::time::Time;

/// A runner between two of its rows.
#[derive(Debug)]
pub(super) struct Carried<'a> {
    pub(super) runner: &'a mut Runner,
    pub(super) reader: &'a mut SolutionReader,
}

impl Aboard for Carried<'_> {
    fn solution(&mut self, now: Time) -> Option<Solution> {
        if !self.runner.started() {
            return None;
        }
        // Where nothing is held back, the belief is what is known.
        if self.runner.lag() <= 0.0 && self.runner.belief().time >= now {
            return Some(self.reader.read(self.runner.belief()));
        }
        Some(self.reader.read(&self.runner.predicted(now)?))
    }
}
