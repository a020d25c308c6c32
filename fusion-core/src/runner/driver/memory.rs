//! The memory of a runner between two rows, and detours: work after which the runner returns to the state before it.
//!
//! A detour finds the outcome of a leader that is valid after its follower. For example, a receiver may report a
//! velocity later than the position of the same row. To find whether the position will be used, the runner continues
//! without the follower up to the position, and returns. Rows are held back for so long that everything valid by then
//! is present. The answer thus does not depend on the order of arrival.

use super::Runner;
use crate::belief::Belief;
use crate::gate::Outcome;
use crate::memory::{Memory, Tape, recall, save};
use crate::runner::Event;
use crate::runner::consumer::Consumer;
use crate::runner::input::Sample;
use crate::time::Time;
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Whether the runner is on a detour, and its memory before that.
#[derive(Clone, Debug, Default)]
pub(super) struct Detour {
    looks_ahead: bool,
    before: Vec<u8>,
}

impl Memory for Runner {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.remember_work(tape);
        let monitor = self.monitor.take();
        let mut monitor = monitor.unwrap_or_else(|| Box::new(self.new_monitor()));
        monitor.remember(tape);
        self.monitor = Some(monitor);
        self.scheduler.remember_health(tape);
        if let Some(rewind) = &mut self.rewind {
            rewind.remember(tape);
        }
    }
}

/// The memory of a runner without its monitor's.
struct Work<'a>(&'a mut Runner);

impl Memory for Work<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember_work(tape);
    }
}

impl Runner {
    /// Everything except the monitor and its dependents: the monitor is detached while a row is processed.
    fn remember_work(&mut self, tape: &mut Tape<'_>) {
        self.queue.remember(tape);
        self.intake.remember(tape);
        self.scheduler.remember(tape);
        if tape.is_reading() && !self.is_consistent() {
            tape.refuse("a row or its consumer does not exist");
        }
    }

    /// Whether every waiting row exists, and also every consumer that waits for it.
    fn is_consistent(&self) -> bool {
        let exists = |consumer| match consumer {
            Consumer::Input => self.intake.port().is_some(),
            other => self.scheduler.serves(other),
        };
        let sensors = self.sensors().len();
        self.queue.is_consistent(exists) && self.scheduler.waiting().all(|w| self.queue.holds(w.row) && w.sensor < sensors)
    }

    /// Does `work`, and returns to the state before it. The caller has to hide the events of `work` from others.
    fn detour<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        let mut before = core::mem::take(&mut self.detour.before);
        before.clear();
        save(&mut Work(self), &mut before);
        let done = work(self);
        // The tape was just written, so it can be read.
        let _ = recall(&mut Work(self), &before);
        self.detour.before = before;
        done
    }

    /// The belief at `to` if no row comes: rows that are held back are used, and the rest of the time is predicted or
    /// coasted through. `None` if the filter has not started, or would have stopped by then. The runner itself does
    /// not change. A belief that is later than `to` is returned as it is.
    pub fn predicted(&mut self, to: Time) -> Option<Belief> {
        let newest = match self.rewind {
            Some(ref mut rewind) => rewind.live_mut(),
            None => self,
        };
        newest.detour(|ahead| ahead.go_to(to))
    }

    /// The future outcome of the measurement of sensor `leader` from row number `row`, if it is still to come;
    /// `during` is the current sample.
    pub(super) fn foresee(&mut self, leader: usize, row: usize, during: Option<&Sample>) -> Option<Outcome> {
        if self.detour.looks_ahead {
            return None;
        }
        let until = self.coming(leader, row)?;
        self.detour.looks_ahead = true;
        let (outcome, reached) = self.detour(|ahead| (ahead.outcome_at(leader, row, until, during), ahead.queue.reached()));
        self.queue.see(reached.max(until));
        self.detour.looks_ahead = false;
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
        self.scheduler.outcome(leader).filter(|outcome| outcome.time == until)
    }

    /// The time at which the measurement of `sensor` from row number `row` is valid, if it has not been served.
    fn coming(&self, sensor: usize, row: usize) -> Option<Time> {
        let mut waiting = self.scheduler.waiting();
        let waiting = waiting.find(|w| w.sensor == sensor && w.row == row).map(|w| w.time);
        waiting.or_else(|| self.queue.waits_for(sensor, row))
    }
}
