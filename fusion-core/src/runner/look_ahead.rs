//! Looking ahead: the outcome of a leader that is valid after its follower.
//!
//! Of one row the follower may be valid first, as a velocity that a receiver reports later than the
//! position. Whether the position will be used is then found by going on, without the follower, up to
//! the position, and back again. Rows are held back long enough that everything that is
//! valid by then is there, so that the answer does not depend on the order of arrival.

use super::Runner;
use super::event::Event;
use super::intake::Sample;
use super::rows::Consumer;
use crate::gate::Outcome;
use crate::time::Time;

impl Runner {
    /// What will become of the measurement of sensor `leader` that is made of row number `row`, if it
    /// is still to come; `during` is the sample that is being run over.
    pub(super) fn foresee(&mut self, leader: usize, row: usize, during: Option<&Sample>) -> Option<Outcome> {
        if self.is_ahead {
            return None;
        }
        let until = self.coming(leader, row)?;
        self.is_ahead = true;
        let (outcome, seen) = self.ahead(|ahead| (ahead.outcome_at(leader, row, until, during), ahead.seen.max(ahead.released)));
        self.seen = self.seen.max(seen).max(until);
        self.is_ahead = false;
        outcome
    }

    /// Goes on to where `leader`, which is valid at `until` or nearby, has been served.
    fn outcome_at(&mut self, leader: usize, row: usize, mut until: Time, during: Option<&Sample>) -> Option<Outcome> {
        let mut nobody = |_: &Event<'_>| {};
        if let Some(sample) = during {
            self.advance(sample, &mut nobody).ok()?;
        }
        self.run_ready(&mut nobody).ok()?;
        self.drain(until, &mut nobody).ok()?;
        // With an estimated offset, only now is it known when the leader is valid.
        if let Some(time) = self.coming(leader, row) {
            until = time;
            self.drain(until, &mut nobody).ok()?;
        }
        self.serve_waiting(&mut nobody).ok()?;
        self.outcomes[leader].filter(|outcome| outcome.time == until)
    }

    /// When the measurement of `sensor` made of row number `row` is valid, if it has not been served.
    fn coming(&self, sensor: usize, row: usize) -> Option<Time> {
        let waiting = self.waiting.iter().find(|w| w.sensor == sensor && w.row == row).map(|w| w.time);
        let is_it = |consumer| matches!(consumer, Consumer::Sensor(_, s) | Consumer::Aim(s) if s == sensor);
        let queued = || self.queue.iter().find(|e| is_it(e.consumer) && e.row == row);
        waiting.or_else(|| queued().map(|e| e.time))
    }
}
