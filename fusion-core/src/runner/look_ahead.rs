//! Looking ahead: the outcome of a leader that is valid after its follower.
//!
//! Of one row the follower may be valid first, for example a velocity that a receiver reports later than the
//! position. To find whether the position will be used, the runner continues without the follower up to the position,
//! and returns. Rows are held back for so long that everything valid by then is present. The answer thus does not
//! depend on the order of arrival.

use super::Runner;
use super::event::Event;
use super::intake::Sample;
use super::rows::Consumer;
use crate::gate::Outcome;
use crate::time::Time;

impl Runner {
    /// The future outcome of the measurement of sensor `leader` from row number `row`, if it is still to come;
    /// `during` is the current sample.
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

    /// Continues until `leader`, which is valid near `until`, has been served.
    fn outcome_at(&mut self, leader: usize, row: usize, mut until: Time, during: Option<&Sample>) -> Option<Outcome> {
        let mut nobody = |_: &Event<'_>| {};
        if let Some(sample) = during {
            self.advance(sample, &mut nobody).ok()?;
        }
        self.run_ready(&mut nobody).ok()?;
        self.drain(until, &mut nobody).ok()?;
        // With an estimated offset, the time of validity of the leader is only known now.
        if let Some(time) = self.coming(leader, row) {
            until = time;
            self.drain(until, &mut nobody).ok()?;
        }
        self.serve_waiting(&mut nobody).ok()?;
        self.outcomes[leader].filter(|outcome| outcome.time == until)
    }

    /// The time at which the measurement of `sensor` from row number `row` is valid, if it has not been served.
    fn coming(&self, sensor: usize, row: usize) -> Option<Time> {
        let waiting = self.waiting.iter().find(|w| w.sensor == sensor && w.row == row).map(|w| w.time);
        let is_it = |consumer| matches!(consumer, Consumer::Sensor(_, s) | Consumer::Aim(s) if s == sensor);
        let queued = || self.queue.iter().find(|e| is_it(e.consumer) && e.row == row);
        waiting.or_else(|| queued().map(|e| e.time))
    }
}
