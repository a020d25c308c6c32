//! Continuing without input.
//!
//! One sample covers a limited time. If the next sample is later, the process *coasts* through the gap in steps of
//! that length. It continues as the vehicle most likely does, and adds possible manoeuvres of the vehicle as process
//! noise. Measurements in the gap are used at their own times, and stages that listen to the input hear of every
//! step, so that constraints continue. A gap that is too long for coasting stops the filter; its initialisers start
//! it again.
//!
//! Steps are on a grid that begins at the latest sample. A step is taken as soon as a row that is valid later is
//! processed. So the steps in a gap do not depend on the order of arrival.

use super::ordering::Runner;
use super::parts::Emitter;
use super::rows::Consumer;
use super::{Event, Halt, Observer};
use crate::belief::Belief;
use crate::time::Time;

impl Runner {
    /// The belief at `to` if no row comes: rows that are held back are used, and the rest of the time is predicted or
    /// coasted through. `None` if the filter has not started, or would have stopped by then. The runner itself does
    /// not change. A belief that is later than `to` is returned as it is.
    pub fn predicted(&mut self, to: Time) -> Option<Belief> {
        self.newest_mut().ahead(|ahead| ahead.go_to(to))
    }

    fn go_to(&mut self, to: Time) -> Option<Belief> {
        let mut nobody = |_: &Event<'_>| {};
        self.watermark = self.watermark.max(to);
        self.drain(to, &mut nobody).ok()?;
        self.serve_waiting(&mut nobody).ok()?;
        if !self.started {
            return None;
        }
        if self.input.as_ref().is_some_and(|input| input.is_coasting()) {
            self.coast_estimate(to, &mut nobody).ok()?;
        } else {
            self.hold_to(to, &mut nobody).ok()?;
        }
        Some(self.belief().clone())
    }

    /// Takes the next step through a gap of the input, if it ends before `until`. Returns whether it did.
    pub(super) fn coast_before(&mut self, until: Time, observer: &mut dyn Observer) -> Result<bool, Halt> {
        let Some(input) = self.input.as_ref().filter(|_| self.started) else {
            return Ok(false);
        };
        let Some(to) = input.coasting_due().filter(|to| *to < until) else {
            return Ok(false);
        };
        if !input.suspects().is_empty() {
            self.settle_suspects(false, observer)?;
            return Ok(true);
        }
        let is_lost = input.is_lost(to);
        if self.released <= to {
            (self.released, self.serving) = (to, Consumer::LAST);
        }
        if is_lost {
            self.stop(to, observer)?;
        } else {
            self.coast_step(to, observer)?;
        }
        Ok(true)
    }

    /// One step through a gap, including the measurements in it.
    fn coast_step(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.coast_to(to, observer)?;
        let Some(since) = self.input.as_ref().and_then(|input| input.end()) else {
            return Ok(());
        };
        observer.on(&Event::Coasting { since, time: to })?;
        self.tell_stages(to, observer)
    }

    /// Moves the estimate to `to` without input and serves the measurements on the way.
    pub(super) fn coast_to(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        // A sample that the preparation held back for a neighbour will get none.
        if let Some(input) = &mut self.input {
            input.finish();
            input.coast(to);
        }
        self.run_ready(observer)?;
        while let Some(&waiting) = self.waiting.front() {
            if waiting.time > to {
                break;
            }
            self.waiting.pop_front();
            self.coast_estimate(waiting.time, observer)?;
            self.offer(waiting, None, observer)?;
        }
        if self.started {
            self.coast_estimate(to, observer)?;
            self.epoch = Some(to);
        }
        Ok(())
    }

    /// Moves the estimate to `to` without input.
    pub(super) fn coast_estimate(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let now = self.estimator.belief().time;
        if to <= now || !self.started {
            return Ok(());
        }
        self.tell_epoch(observer)?;
        let since = self.input.as_ref().and_then(|input| input.end()).unwrap_or(now);
        let expected = self.expectation.next(&self.process.rates());
        if let Err(error) = self.estimator.coast(to, to.seconds_since(since), expected.as_ref()) {
            observer.on(&Event::Failed { error })?;
        }
        self.watch_attitude();
        self.tell_steps(observer)
    }

    /// Notifies the stages on the input's stream that it is silent up to `time`.
    fn tell_stages(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(stream) = self.input.as_ref().map(|input| input.port.stream) else {
            return Ok(());
        };
        for unit in 0..self.stages.len() {
            let u = &mut self.stages[unit];
            if !u.inputs.iter().any(|port| port.stream == stream) {
                continue;
            }
            let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer);
            let view = self.estimator.view();
            u.stage.silence(time, &view, &mut emitter);
            let emitted = emitter.finish()?;
            self.enqueue_emitted(unit, emitted, false, observer)?;
        }
        Ok(())
    }

    /// Ends a gap that began at `since`: the present row covers `start` to `time`.
    pub(super) fn resume(&mut self, since: Time, start: Time, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let values = core::mem::take(&mut self.value);
        self.expectation.forget();
        let coasted = self.coast_to(start, observer);
        if let Some(input) = &mut self.input {
            input.resume(start, time, &values);
        }
        self.value = values;
        coasted?;
        if self.started {
            observer.on(&Event::Resumed { since, time: start })?;
        }
        self.run_ready(observer)
    }

    /// Begins another recording if the silence before `time` was longer than any within a recording.
    pub(super) fn begin_recording(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let end = |silence| self.estimator.belief().time.shifted(silence);
        if self.started && !self.is_driven() && self.longest_silence.is_some_and(|silence| time > end(silence)) {
            self.tell_epoch(observer)?;
            self.begin_again();
        }
        Ok(())
    }

    /// The initialisers begin anew; the known calibration is kept for them.
    pub(super) fn begin_again(&mut self) {
        self.started = false;
        self.realign.forget();
        self.last = Some(self.estimator.belief().clone());
        self.begin_anew();
        self.outcomes.fill(None);
    }

    /// Gives up: the filter waits for its initialisers, which begin anew.
    fn stop(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.tell_epoch(observer)?;
        let since = self.input.as_ref().and_then(|input| input.end()).unwrap_or(time);
        if let Some(input) = &mut self.input {
            input.close();
        }
        while let Some(waiting) = self.waiting.pop_front() {
            self.discard_early(waiting, observer)?;
        }
        self.begin_again();
        observer.on(&Event::Stopped { since, time })
    }
}
