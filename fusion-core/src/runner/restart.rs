//! Starting anew after the filter has been lost for long.
//!
//! A wrong belief with a small σ rejects the measurements that would correct it, and gates that re-acquire correct
//! only the motion. So after a declared time the filter gives up. Its initialisers begin anew. The calibration comes
//! from the last belief but one in good health; these beliefs are noted ten seconds apart.
//!
//! The filter does not give up if an initialiser reads no stream: the declared values hold for the
//! beginning of a run, not later.

use super::ordering::Runner;
use super::{Event, Halt, Observer};
use crate::belief::Belief;
use crate::health::State;
use crate::memory::{Memory, Tape};
use crate::time::{Time, nanos};

/// The interval between two noted beliefs \[ns\]: a contradiction is reported sooner.
const SPACING: i64 = 10_000_000_000;

/// Follows the health of the filter.
#[derive(Clone, Debug, Default)]
pub(super) struct Restart {
    /// How long the filter may be lost \[ns\]; `None`: for ever.
    after: Option<i64>,
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

    /// The belief from which the calibration is kept; `None` if too few beliefs were noted.
    fn take(&mut self) -> Option<Belief> {
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

impl Runner {
    /// If the filter has been lost for `seconds`, it starts anew by its initialisers, provided that all of them read
    /// streams.
    pub fn restart_lost(&mut self, seconds: f64) {
        self.restart.after = Some(nanos(seconds));
    }

    /// Gives up a filter that has been lost for too long.
    pub(super) fn follow_health(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(after) = self.restart.after.filter(|_| self.started) else {
            return Ok(());
        };
        let Some(state) = observer.health() else { return Ok(()) };
        let now = self.estimator.belief().time;
        if state != State::Lost {
            self.restart.since = None;
            if state == State::Good {
                self.restart.note(self.estimator.belief());
            }
            return Ok(());
        }
        let since = *self.restart.since.get_or_insert(now);
        let can_start = !self.initialisers.is_empty() && self.initialisers.iter().all(|u| !u.inputs.is_empty());
        if !can_start || now.nanos().saturating_sub(since.nanos()) < after {
            return Ok(());
        }
        self.tell_epoch(observer)?;
        while let Some(waiting) = self.waiting.pop_front() {
            self.discard_early(waiting, observer)?;
        }
        self.begin_again();
        self.last = self.restart.take();
        self.restart.since = None;
        observer.on(&Event::GaveUp { since, time: now })
    }
}
