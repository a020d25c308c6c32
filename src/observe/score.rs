//! The score of a filter, made of the errors that are told.

use super::{Heard, RunEvent, RunObserver};
use crate::score::{BlockScorer, Rules, Score, Scorer};
use fusion_core::filter::Verdict;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};

/// Scores one filter.
#[derive(Debug)]
pub struct FilterScore {
    /// The filter's number.
    filter: usize,
    scorer: Scorer,
    blocks: BlockScorer,
}

impl FilterScore {
    /// Without an error yet; the truth of the blocks that `is_drawn` will be told.
    #[must_use]
    pub fn new(filter: &Heard, rules: Rules, is_drawn: impl Fn(&str) -> bool) -> Self {
        Self {
            filter: filter.number,
            blocks: BlockScorer::new(&filter.layout, rules.from, is_drawn),
            scorer: Scorer::new(rules),
        }
    }

    /// The score.
    #[must_use]
    pub fn finish(self) -> Score {
        Score {
            blocks: self.blocks.finish(),
            ..self.scorer.finish()
        }
    }
}

fusion_core::memory!(FilterScore { scorer, blocks; filter });

impl RunObserver for FilterScore {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Reference {
                filter,
                error: Some(error),
                ..
            } if filter.number == self.filter => self.scorer.add(error),
            RunEvent::Truth { filter, belief, truth } if filter.number == self.filter => self.blocks.add(belief, truth),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, row },
            } if filter.number == self.filter => {
                if matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired) {
                    self.scorer.used(*sensor, row.stamp, *time);
                }
            }
            _ => {}
        }
        Ok(())
    }
}
