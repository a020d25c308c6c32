//! The score of a filter, made of the errors that are told.

use super::{Heard, RunEvent, RunObserver};
use crate::score::{Rules, Score, Scorer};
use fusion_core::runner::Halt;

/// Scores one filter.
#[derive(Debug)]
pub struct FilterScore {
    /// The filter's number.
    filter: usize,
    scorer: Scorer,
}

impl FilterScore {
    /// Without an error yet.
    #[must_use]
    pub fn new(filter: &Heard, rules: Rules) -> Self {
        Self {
            filter: filter.number,
            scorer: Scorer::new(rules),
        }
    }

    /// The score.
    #[must_use]
    pub fn finish(self) -> Score {
        self.scorer.finish()
    }
}

impl RunObserver for FilterScore {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Reference {
            filter,
            error: Some(error),
            ..
        } = event
            && filter.number == self.filter
        {
            self.scorer.add(error);
        }
        Ok(())
    }
}
