//! Starting anew after the filter has been lost for long.
//!
//! A wrong belief with a small σ rejects the measurements that would correct it, and gates that re-acquire correct
//! only the motion. So after a declared time the filter gives up. Its initialisers begin anew. The calibration comes
//! from the last belief but one in good health; these beliefs are noted ten seconds apart.
//!
//! The filter does not give up if an initialiser reads no stream: the declared values hold for the
//! beginning of a run, not later.

use crate::belief::Belief;
use crate::health::State;
use crate::memory::{Memory, Tape};
use crate::time::Time;

/// The interval between two noted beliefs \[ns\]: a contradiction is reported sooner.
const SPACING: i64 = 10_000_000_000;

/// Follows the health of the filter.
#[derive(Clone, Debug, Default)]
pub(super) struct Restart {
    /// How long the filter may be lost \[ns\]; `None`: for ever.
    pub(super) after: Option<i64>,
    since: Option<Time>,
    /// Beliefs in good health, the older belief first; meaningful once noted.
    good: Option<[Belief; 2]>,
    noted: usize,
}

impl Restart {
    /// Notes a belief in good health.
    fn note(&mut self, belief: &Belief) {
        match &mut self.good {
            Some([older, newer]) if self.noted > 0 => {
                if belief.time.nanos().saturating_sub(newer.time.nanos()) >= SPACING {
                    core::mem::swap(older, newer);
                    copy(belief, newer);
                    self.noted = 2;
                }
            }
            Some([_, newer]) => {
                copy(belief, newer);
                self.noted = 1;
            }
            none => {
                *none = Some([belief.clone(), belief.clone()]);
                self.noted = 1;
            }
        }
    }

    /// Follows the health of a filter with this belief. Returns since when it has been lost, if that is too long.
    pub(super) fn follow(&mut self, state: State, belief: &Belief) -> Option<Time> {
        if state != State::Lost {
            self.since = None;
            if state == State::Good {
                self.note(belief);
            }
            return None;
        }
        let since = *self.since.get_or_insert(belief.time);
        let lost = belief.time.nanos().saturating_sub(since.nanos());
        self.after.filter(|after| lost >= *after).map(|_| since)
    }

    /// The belief from which the calibration is kept; `None` if too few beliefs were noted. The filter is not lost any
    /// more.
    pub(super) fn take(&mut self) -> Option<Belief> {
        self.since = None;
        let noted = core::mem::take(&mut self.noted);
        let [older, _] = self.good.as_ref().filter(|_| noted > 1)?;
        Some(older.clone())
    }

    /// Its memory; its beliefs have the size of `belief`.
    pub(super) fn remember(&mut self, belief: &Belief, tape: &mut Tape<'_>) {
        self.since.remember(tape);
        self.noted.remember(tape);
        let mut is_some = self.good.is_some();
        is_some.remember(tape);
        if is_some {
            let good = self.good.get_or_insert_with(|| [belief.clone(), belief.clone()]);
            good.iter_mut().for_each(|belief| belief.remember(tape));
        } else {
            self.good = None;
        }
    }
}

/// Copies a belief from which the calibration is kept, without a new allocation; the input is not part of it.
pub(super) fn copy(from: &Belief, to: &mut Belief) {
    to.time = from.time;
    to.x.copy_from_slice(&from.x);
    to.covariance.copy_from(&from.covariance);
}
