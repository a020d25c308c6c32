//! Starting anew after the filter has been lost for long.
//!
//! A wrong belief with a small σ rejects the measurements that would correct it, and gates that re-acquire correct
//! only the motion. So after a declared time the filter gives up. Its initialisers begin anew. It keeps an
//! earlier calibration: in good health, calibrations are noted ten seconds apart, and the last but one is used.
//!
//! The filter does not give up if an initialiser reads no stream: the declared values hold for the
//! beginning of a run, not later.

use super::calibration::Calibration;
use crate::belief::Belief;
use crate::health::State;
use crate::state::Layout;
use crate::time::{Time, nanos};

/// The interval between two noted beliefs \[ns\]: a contradiction is reported sooner.
const SPACING: i64 = 10_000_000_000;

/// Follows the health of the filter.
#[derive(Clone, Debug, Default)]
pub(super) struct Restart {
    /// How long the filter may be lost \[ns\]; `None`: for ever.
    after: Option<i64>,
    since: Option<Time>,
    /// The calibrations in good health, the older first; meaningful once noted.
    good: [Calibration; 2],
    noted: usize,
}
crate::memory!(Restart { since, noted, good; after });

impl Restart {
    /// The filter may be lost for `seconds`.
    pub(super) fn declare(&mut self, seconds: f64, layout: &Layout) {
        self.after = Some(nanos(seconds));
        self.good = [Calibration::of(layout), Calibration::of(layout)];
    }

    /// Whether a time is declared.
    pub(super) const fn is_declared(&self) -> bool {
        self.after.is_some()
    }

    /// Notes a belief in good health.
    fn note(&mut self, layout: &Layout, belief: &Belief) {
        let [older, newer] = &mut self.good;
        if self.noted == 0 {
            newer.take(layout, belief);
            self.noted = 1;
        } else if belief.time.nanos().saturating_sub(newer.time.nanos()) >= SPACING {
            core::mem::swap(older, newer);
            newer.take(layout, belief);
            self.noted = 2;
        }
    }

    /// Follows the health of a filter with this belief. Returns since when it has been lost, if that is too long.
    pub(super) fn follow(&mut self, state: State, layout: &Layout, belief: &Belief) -> Option<Time> {
        if state != State::Lost {
            self.since = None;
            if state == State::Good {
                self.note(layout, belief);
            }
            return None;
        }
        let since = *self.since.get_or_insert(belief.time);
        let lost = belief.time.nanos().saturating_sub(since.nanos());
        self.after.filter(|after| lost >= *after).map(|_| since)
    }

    /// The calibration that is kept; `None` if too few beliefs were noted. The filter is not lost any more.
    pub(super) fn take(&mut self) -> Option<Calibration> {
        self.since = None;
        let noted = core::mem::take(&mut self.noted);
        (noted > 1).then(|| self.good[0].clone())
    }
}
