//! The hypotheses of a bank during a run.

use super::{Entry, RunEnd, RunEvent, RunObserver, Section, SectionObserver, Summary};
use fusion_core::filter::Rivals;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Serialize;

/// The maximum number of changes that are kept.
const CHANGES: usize = 20;

/// The hypotheses of the outermost filter through a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Hypotheses {
    /// The number of hypotheses at the end, including the displayed one.
    pub count: u64,
    /// The largest number of hypotheses during the run.
    pub most: u64,
    /// The probability of the displayed hypothesis at the end.
    pub probability: f64,
    /// The first twenty times at which the displayed hypothesis changed.
    pub changes: Vec<Change>,
    /// The number of further changes.
    pub further_changes: u64,
}

/// A change of the displayed hypothesis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Time \[s\].
    pub time: f64,
    /// The largest change of an attitude or angle \[rad\]. `None` if the bank no longer followed the former hypothesis.
    pub angle: Option<f64>,
}

fusion_core::memory!(Hypotheses {
    count,
    most,
    probability,
    changes,
    further_changes
});
fusion_core::memory!(Change { time, angle });

impl Hypotheses {
    fn hear(&mut self, time: Time, rivals: &Rivals) {
        self.count = rivals.count as u64;
        self.most = self.most.max(self.count);
        self.probability = rivals.probability;
        let Some(angle) = rivals.changed else { return };
        if self.changes.len() >= CHANGES {
            self.further_changes += 1;
            return;
        }
        self.changes.push(Change {
            time: time.seconds(),
            angle: Some(angle).filter(|angle| angle.is_finite()),
        });
    }
}

impl RunObserver for Hypotheses {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else { return Ok(()) };
        match event {
            Event::Started { belief, rivals } if filter.is_outermost() => self.hear(belief.time, rivals),
            Event::Updated { update, time, .. } if filter.is_outermost() => self.hear(*time, &update.rivals),
            _ => {}
        }
        Ok(())
    }
}

impl Section for Hypotheses {
    const NAME: &'static str = "hypotheses";
}

impl SectionObserver for Hypotheses {
    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok((*self).into())
    }
}

impl Summary {
    /// The statistics of the hypotheses of a bank; `None` without a bank.
    #[must_use]
    pub fn hypotheses(&self) -> Option<&Hypotheses> {
        self.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_changes_are_kept_and_the_others_counted() {
        let mut found = Hypotheses::default();
        for k in 0..30_u32 {
            let rivals = Rivals {
                count: if k == 3 { 5 } else { 2 },
                probability: 0.75,
                changed: (k >= 5).then_some(if k == 5 { f64::NAN } else { 0.5 }),
                ..Rivals::NONE
            };
            found.hear(Time::from_seconds(f64::from(k)), &rivals);
        }
        assert_eq!((found.count, found.most, found.probability), (2, 5, 0.75));
        assert_eq!((found.changes.len(), found.further_changes), (20, 5));
        let change = |time, angle| Change { time, angle };
        assert_eq!(found.changes[..2], [change(5.0, None), change(6.0, Some(0.5))]);
    }
}
