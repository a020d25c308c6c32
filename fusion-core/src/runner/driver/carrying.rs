//! The estimate is carried through time: over the samples of the input, and through its gaps.
//!
//! A measurement inside the interval of a sample waits for the sample and then splits it. In a gap the process coasts:
//! it continues as the vehicle most likely does, and adds possible manoeuvres of the vehicle as process noise.
//! Measurements in the gap are used at their own times, and stages that listen to the input hear of every step, so that
//! constraints continue. A gap that is too long stops the filter; its initialisers start it again.

use super::Runner;
use crate::belief::Belief;
use crate::model::Input;
use crate::runner::consumer::{Consumer, Refused};
use crate::runner::input::{Reading, Sample, Silence};
use crate::runner::scheduler::{Circumstances, Waiting};
use crate::runner::{Discard, Event, Halt, Observer};
use crate::time::Time;

/// Over samples.
impl Runner {
    /// Runs over the samples that are ready.
    pub(super) fn run_ready(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(sample) = self.intake.next() {
            self.advance(&sample, observer)?;
            self.intake.take_back(sample);
        }
        Ok(())
    }

    /// Runs the estimator over `sample`, or the rest of it, and serves the measurements inside it.
    pub(super) fn advance(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), Halt> {
        if !self.scheduler.is_running_before(sample.end) {
            return Ok(());
        }
        self.intake.expect(sample);
        while let Some(measurement) = self.scheduler.next_waiting(sample.end) {
            self.scheduler.predict(measurement.time, &sample.input(), observer)?;
            self.offer(measurement, Some(sample), observer)?;
        }
        self.scheduler.predict(sample.end, &sample.input(), observer)?;
        self.scheduler.begin_epoch(sample.end);
        Ok(())
    }

    /// Serves the measurements that wait for an input sample that does not come: the latest sample is held.
    pub(super) fn serve_waiting(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.intake.finish();
        self.run_ready(observer)?;
        let is_coasting = self.intake.is_coasting();
        while let Some(measurement) = self.scheduler.next_waiting(Time::MAX) {
            let time = measurement.time;
            if is_coasting {
                self.coast_estimate(time, observer)?;
            } else {
                self.scheduler.hold(time, self.intake.latest(), observer)?;
            }
            self.offer(measurement, None, observer)?;
            self.scheduler.begin_epoch(time);
        }
        Ok(())
    }

    /// The belief at `to`, if no row comes.
    pub(super) fn go_to(&mut self, to: Time) -> Option<Belief> {
        let mut nobody = |_: &Event<'_>| {};
        self.queue.note(to);
        self.drain(to, &mut nobody).ok()?;
        self.serve_waiting(&mut nobody).ok()?;
        if !self.scheduler.is_running() {
            return None;
        }
        if self.intake.is_coasting() {
            self.coast_estimate(to, &mut nobody).ok()?;
        } else {
            self.scheduler.hold(to, self.intake.latest(), &mut nobody).ok()?;
        }
        Some(self.scheduler.belief().clone())
    }
}

/// Through gaps.
impl Runner {
    /// Takes the next step through a gap of the input, if it ends before `until`. Returns whether it did. So a step is
    /// taken as soon as a row that is valid later is processed, for any order of arrival.
    pub(super) fn coast_before(&mut self, until: Time, observer: &mut dyn Observer) -> Result<bool, Halt> {
        if !self.scheduler.is_running() {
            return Ok(false);
        }
        match self.intake.silence(until) {
            None => return Ok(false),
            Some(Silence::Settles) => self.settle_suspects(false, observer)?,
            Some(Silence::Coasts(to)) => {
                self.queue.pass(to);
                self.coast_step(to, observer)?;
            }
            Some(Silence::Stops(to)) => {
                self.queue.pass(to);
                self.stop(to, observer)?;
            }
        }
        Ok(true)
    }

    /// One step through a gap, including the measurements in it.
    fn coast_step(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.coast_to(to, observer)?;
        let Some(since) = self.intake.end() else { return Ok(()) };
        observer.on(&Event::Coasting { since, time: to })?;
        self.tell_silence(to, observer)
    }

    /// Moves the estimate to `to` without input and serves the measurements on the way.
    fn coast_to(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.intake.coast(to);
        self.run_ready(observer)?;
        while let Some(measurement) = self.scheduler.next_waiting(to) {
            self.coast_estimate(measurement.time, observer)?;
            self.offer(measurement, None, observer)?;
        }
        if self.scheduler.is_running() {
            self.coast_estimate(to, observer)?;
            self.scheduler.begin_epoch(to);
        }
        Ok(())
    }

    /// Moves the estimate to `to` without input.
    fn coast_estimate(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        if !self.scheduler.is_running_before(to) {
            return Ok(());
        }
        let since = self.intake.end();
        let expected = self.intake.expected_next();
        self.scheduler.coast(to, since, expected.as_ref(), observer)
    }

    /// Ends a gap that began at `since`: the sample of `reading` begins at `start`.
    pub(super) fn resume(&mut self, since: Time, start: Time, reading: &Reading, observer: &mut dyn Observer) -> Result<(), Halt> {
        let coasted = self.coast_to(start, observer);
        self.intake.resume(start, reading);
        coasted?;
        if self.scheduler.is_running() {
            observer.on(&Event::Resumed { since, time: start })?;
        }
        self.run_ready(observer)
    }

    /// Stops the filter: it waits for its initialisers, which begin anew.
    fn stop(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.scheduler.tell_epoch(observer)?;
        let since = self.intake.end().unwrap_or(time);
        self.intake.close();
        self.discard_waiting(observer)?;
        self.scheduler.stop();
        observer.on(&Event::Stopped { since, time })
    }

    /// Gives up a filter that has been lost for too long.
    pub(super) fn follow_health(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(since) = self.scheduler.lost_since(observer) else {
            return Ok(());
        };
        self.scheduler.tell_epoch(observer)?;
        self.discard_waiting(observer)?;
        self.scheduler.give_up();
        let time = self.scheduler.belief().time;
        observer.on(&Event::GaveUp { since, time })
    }
}

/// Measurements.
impl Runner {
    /// Offers a measurement to the estimator, whose belief has the same time, and releases its row; `during` is the
    /// current sample.
    pub(super) fn offer(&mut self, measurement: Waiting, during: Option<&Sample>, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Waiting { sensor, row, .. } = measurement;
        let leader = self.scheduler.leader(sensor);
        let foreseen = leader.and_then(|leader| self.foresee(leader, row, during));
        let assumed = self.assumed_offset(&measurement, during.map(Sample::input));
        let circumstances = Circumstances {
            expected: self.intake.expected(),
            shift: assumed.map(|assumed| (assumed, self.intake.mean())),
            foreseen,
        };
        let offered = self.scheduler.offer(&measurement, self.queue.row(row), &circumstances, observer);
        self.queue.release(row);
        offered
    }

    /// The offset by which a measurement is valid at its time. `None` for a sensor without an offset, and in a gap of
    /// the input, where the rate is unknown. Averages the input about that time; `held` is the current sample.
    fn assumed_offset(&mut self, measurement: &Waiting, held: Option<Input<'_>>) -> Option<f64> {
        let &Waiting { time, sensor, row, .. } = measurement;
        let assumed = self.scheduler.sensors()[sensor].assumed(self.queue.row(row).stamp(), time)?;
        let certain = self.queue.certain(time);
        let mean = self.intake.average(time, held, certain, self.queue.coming(certain));
        self.queue.see(mean.looked);
        mean.is_known.then_some(assumed)
    }

    /// Discards the measurement of a sensor that is valid at a time, and releases its row.
    pub(super) fn discard(
        &mut self,
        (time, sensor, row): (Time, usize, usize),
        why: Discard,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        let columns = &self.scheduler.sensors()[sensor].port.columns;
        let refused = Refused {
            consumer: Consumer::Sensor(0, sensor),
            time,
            row: self.queue.row(row).id(columns),
            why,
        };
        self.queue.release(row);
        self.scheduler.tell_refused(&refused, observer)
    }

    /// Discards the measurements that wait: the filter stops.
    fn discard_waiting(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(Waiting { time, sensor, row, .. }) = self.scheduler.next_waiting(Time::MAX) {
            self.discard((time, sensor, row), Discard::BeforeStart, observer)?;
        }
        Ok(())
    }
}
