//! The memory of a runner between two rows.

use super::rows::Consumer;
use super::{InitialiserUnit, Runner};
use crate::memory::{Memory, Tape, recall, save};

impl Memory for Runner {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.remember_work(tape);
        let monitor = self.monitor.take();
        let mut monitor = monitor.unwrap_or_else(|| Box::new(self.new_monitor()));
        monitor.remember(tape);
        self.monitor = Some(monitor);
        self.restart.remember(self.estimator.belief(), tape);
        if let Some(rewind) = &mut self.rewind {
            rewind.remember(tape);
        }
    }
}

impl Runner {
    /// Everything except the monitor and its dependents: the monitor is detached while a row is processed.
    fn remember_work(&mut self, tape: &mut Tape<'_>) {
        self.remember_progress(tape);
        self.estimator.remember(tape);
        if let Some(input) = &mut self.input {
            input.remember(tape);
        }
        self.sensors.iter_mut().for_each(|sensor| sensor.gate.remember(tape));
        self.outcomes.as_mut_slice().remember(tape);
        self.stages.iter_mut().for_each(|unit| unit.stage.remember(tape));
        self.emissions.as_mut_slice().remember(tape);
        // A running filter does not need the initialisers; before another start they begin anew.
        if !self.started || self.realign.is_due() {
            self.initialisers.iter_mut().for_each(|unit| unit.initialiser.remember(tape));
        }
        self.remember_last(tape);
        self.quarantine.remember(tape);
        self.ahead_of_input.remember(tape);
        self.window.remember(tape);
        self.expectation.remember(tape);
        self.rows.remember(tape);
        self.queue.remember(tape);
        self.waiting.remember(tape);
        if tape.is_reading() && !self.is_consistent() {
            tape.refuse("a row is in nobody's hands");
        }
    }

    fn remember_progress(&mut self, tape: &mut Tape<'_>) {
        self.started.remember(tape);
        self.realign.remember(tape);
        self.start_after.remember(tape);
        self.watermark.remember(tape);
        self.released.remember(tape);
        self.serving.remember(tape);
        self.seen.remember(tape);
        self.epoch.remember(tape);
    }

    /// The belief before the filter stopped.
    fn remember_last(&mut self, tape: &mut Tape<'_>) {
        let mut is_some = self.last.is_some();
        is_some.remember(tape);
        if is_some {
            let belief = self.estimator.belief();
            self.last.get_or_insert_with(|| belief.clone()).remember(tape);
        } else {
            self.last = None;
        }
    }

    /// Whether every waiting row exists, and also every consumer that waits for it.
    fn is_consistent(&self) -> bool {
        let is_there = |row| self.rows.holds(row, |stream| self.streams.get(stream).map(|s| s.width));
        let has_input = |inputs: Option<usize>, input| inputs.is_some_and(|inputs| input < inputs);
        let exists = |consumer| match consumer {
            Consumer::Input => self.input.is_some(),
            Consumer::Initialiser(unit, input) => has_input(self.initialisers.get(unit).map(|u| u.inputs.len()), input),
            Consumer::Stage(unit, input) => has_input(self.stages.get(unit).map(|u| u.inputs.len()), input),
            Consumer::Aim(sensor) => sensor < self.sensors.len(),
            Consumer::Sensor(rank, sensor) => self.ranks.get(sensor) == Some(&rank),
        };
        let mut suspects = self.input.iter().flat_map(|input| input.suspects());
        suspects.all(|suspect| is_there(suspect.row))
            && self.queue.iter().all(|entry| is_there(entry.row) && exists(entry.consumer))
            && self.waiting.iter().all(|w| is_there(w.row) && w.sensor < self.sensors.len())
    }

    /// Does `work`, and returns to the state before it. The caller has to hide the events of `work` from others.
    pub(super) fn ahead<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        let mut before = core::mem::take(&mut self.before);
        before.clear();
        save(&mut Work(self), &mut before);
        let done = work(self);
        // The tape was just written, so it can be read.
        let _ = recall(&mut Work(self), &before);
        self.before = before;
        done
    }

    /// The initialisers forget everything.
    pub(super) fn begin_anew(&mut self) {
        let mut all = Initialisers(&mut self.initialisers);
        // The initialisers wrote these bytes when they were added.
        let _ = recall(&mut all, &self.pristine);
    }
}

/// The memory of a runner without its monitor's.
struct Work<'a>(&'a mut Runner);

impl Memory for Work<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember_work(tape);
    }
}

/// The memory of several initialisers.
struct Initialisers<'a>(&'a mut [InitialiserUnit]);

impl Memory for Initialisers<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.iter_mut().for_each(|unit| unit.initialiser.remember(tape));
    }
}
