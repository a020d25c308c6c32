//! Rows come in, and are served to their consumers in order of their time of validity.

use super::Runner;
use crate::runner::consumer::{Consumer, PROCESS};
use crate::runner::input::{Judged, Reading, Taken};
use crate::runner::queue::{Admission, Entry};
use crate::runner::scheduler::{Emission, Waiting};
use crate::runner::watching::Watch;
use crate::runner::{Discard, Event, Halt, Observer, Row, RunError};
use crate::time::Time;
use alloc::boxed::Box;

impl Runner {
    /// Takes a row and processes everything it completes.
    ///
    /// # Errors
    /// A row of the wrong width, which changes nothing; an observer that cannot continue.
    pub fn feed(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        let from = self.queue.released();
        self.watched(observer, |runner, watch| {
            if !runner.queue.doubts(row) {
                watch.beat(row.stream, row.time);
            }
            runner.take_row(row, watch)
        })?;
        let settled = self.queue.released();
        match &mut self.rewind {
            Some(rewind) => Ok(rewind.feed(row, from, settled, observer)?),
            None => Ok(()),
        }
    }

    /// Processes everything that has been held back: the end of the log.
    ///
    /// # Errors
    /// An observer that cannot continue.
    pub fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.take_end(observer)?;
        match &mut self.rewind {
            Some(rewind) => rewind.finish(observer),
            None => Ok(()),
        }
    }

    /// Does `work` while the monitor hears. Meanwhile the runner has no monitor, because it may look ahead.
    fn watched<T>(&mut self, observer: &mut dyn Observer, work: impl FnOnce(&mut Self, &mut Watch<'_, '_>) -> T) -> T {
        let mut monitor = self.monitor.take().unwrap_or_else(|| Box::new(self.new_monitor()));
        let done = work(self, &mut Watch::new(&mut monitor, observer));
        self.monitor = Some(monitor);
        done
    }

    fn take_row(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        let admission = self.queue.admit(row)?;
        self.scheduler.listen(observer);
        match admission {
            Admission::Use | Admission::Replaces => self.settle_jump(false, observer)?,
            Admission::Confirms => self.settle_jump(true, observer)?,
            Admission::Wait => {}
        }
        if matches!(admission, Admission::Wait | Admission::Replaces) {
            self.queue.suspend(row);
            return Ok(());
        }
        Ok(self.admit(row, observer)?)
    }

    /// Uses the rows that wait for others to confirm their stamps, or discards them.
    fn settle_jump(&mut self, are_used: bool, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(suspended) = self.queue.suspended() {
            if are_used {
                self.admit(&suspended.row(), observer)?;
            } else {
                let Self { queue, scheduler, .. } = self;
                queue.refuse(&suspended.row(), |missed| scheduler.tell_missed(&missed, observer))?;
            }
            self.queue.give_back(suspended);
        }
        Ok(())
    }

    fn admit(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.queue.note(row.time);
        self.put(row, self.queue.watermark(), Time::MIN, observer)?;
        let (due, was_ahead) = self.queue.due(row, self.intake.longest());
        if let Some((stream, by)) = was_ahead {
            let time = row.time;
            observer.on(&Event::Ahead { stream, by, time })?;
        }
        self.drain(due, observer)
    }

    /// Puts a row that came at `arrival` into the queue. It is late if it is valid before the last served time, or
    /// before `from`.
    fn put(&mut self, row: &Row<'_>, arrival: Time, from: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Self { queue, scheduler, .. } = self;
        queue.put(row, arrival, from, |missed| scheduler.tell_missed(&missed, observer))
    }

    /// Takes a row that a rewinding runner gives: it has been admitted, and came at `arrival`.
    pub(in crate::runner) fn give(&mut self, row: &Row<'_>, arrival: Time, from: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.watched(observer, |runner, watch| {
            watch.beat(row.stream, row.time);
            runner.put(row, arrival, from, watch)
        })
    }

    /// Serves the rows that are valid up to `until`.
    pub(in crate::runner) fn serve(&mut self, until: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.watched(observer, |runner, watch| runner.drain(until, watch))
    }

    /// Serves everything that has been held back: the end of the log.
    pub(in crate::runner) fn take_end(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.watched(observer, |runner, watch| {
            runner.scheduler.listen(watch);
            runner.settle_jump(false, watch)?;
            runner.drain(Time::MAX, watch)?;
            runner.settle_suspects(false, watch)?;
            runner.finish_stages(watch)?;
            runner.serve_waiting(watch)?;
            runner.scheduler.tell_epoch(watch)
        })
    }

    /// Serves the queue up to `until`.
    pub(super) fn drain(&mut self, until: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        loop {
            let next = self.queue.next(until);
            let horizon = next.unwrap_or(until.min(self.queue.watermark()));
            if self.coast_before(horizon, observer)? {
                // Stages may have emitted earlier rows.
                continue;
            }
            let Some(entry) = next.and_then(|_| self.queue.take()) else {
                return Ok(());
            };
            self.scheduler.begin_recording(entry.time, observer)?;
            self.scheduler.end_epoch_before(entry.time, observer)?;
            self.serve_entry(entry, observer)?;
            self.follow_health(observer)?;
        }
    }

    fn serve_entry(&mut self, entry: Entry, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Entry { time, consumer, row } = entry;
        match consumer {
            Consumer::Input => self.input_row(time, row, observer)?,
            Consumer::Initialiser(unit, input) => {
                let (row, latest) = (self.queue.row(row), self.intake.latest());
                self.scheduler.initialiser_row((unit, input), time, row, latest, observer)?;
            }
            Consumer::Stage(unit, input) => {
                let emission = self.scheduler.stage_row((unit, input), time, self.queue.row(row), observer)?;
                self.take_emission(emission, observer)?;
            }
            Consumer::Switch(sensor) => self.scheduler.switch(sensor, time, self.queue.row(row), observer)?,
            Consumer::Aim(sensor) => {
                if let Some((aimed, consumer)) = self.scheduler.aim(sensor, self.queue.row(row).stamp()) {
                    let time = aimed.max(time);
                    self.queue.put_again(Entry { time, consumer, row });
                }
                return Ok(());
            }
            Consumer::Sensor(_, sensor) => return self.sensor_row((time, sensor, row), observer),
        }
        self.queue.release(row);
        Ok(())
    }

    fn input_row(&mut self, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.intake.is_after_gap(time) {
            self.settle_suspects(false, observer)?;
        }
        let reading = self.intake.read(time, self.queue.row(row));
        if let Err(why) = self.intake.admit(&reading) {
            return self.discard_input(reading, why, observer);
        }
        loop {
            match self.intake.judge(&reading) {
                Judged::Passes => break,
                Judged::Waits => {
                    self.intake.wait(reading);
                    return Ok(());
                }
                Judged::Confirms => self.settle_suspects(true, observer)?,
                Judged::Refutes => self.settle_suspects(false, observer)?,
            }
        }
        self.use_input(reading, observer)?;
        self.scheduler.start_if_ready(time, self.intake.latest(), observer)
    }

    /// Uses the waiting rows of the input, or discards them as spikes.
    pub(super) fn settle_suspects(&mut self, are_used: bool, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some((suspect, why)) = self.intake.settle() {
            if are_used {
                self.use_input(suspect, observer)?;
            } else {
                self.intake.refuse(&suspect);
                self.discard_input(suspect, why, observer)?;
            }
        }
        Ok(())
    }

    /// Uses a row of the input.
    fn use_input(&mut self, reading: Reading, observer: &mut dyn Observer) -> Result<(), Halt> {
        match self.intake.take(&reading) {
            Taken::First => {}
            Taken::Sample => self.run_ready(observer)?,
            Taken::Resumes { since, start } => self.resume(since, start, &reading, observer)?,
        }
        self.intake.give_back(reading);
        Ok(())
    }

    fn discard_input(&mut self, reading: Reading, why: Discard, observer: &mut dyn Observer) -> Result<(), Halt> {
        let (time, row) = (reading.time, reading.id);
        self.intake.give_back(reading);
        observer.on(&Event::Discarded {
            consumer: PROCESS,
            input: 0,
            time,
            row,
            why,
        })
    }

    fn sensor_row(&mut self, (time, sensor, row): (Time, usize, usize), observer: &mut dyn Observer) -> Result<(), Halt> {
        let latest = self.intake.latest();
        if !self.scheduler.is_driven() {
            self.scheduler.start_if_ready(time, latest, observer)?;
        }
        if !self.scheduler.has_started_before(time) {
            return self.discard((time, sensor, row), Discard::BeforeStart, observer);
        }
        let Some(noise) = self.scheduler.factor(sensor) else {
            return self.discard((time, sensor, row), Discard::SwitchedOff, observer);
        };
        let measurement = Waiting { time, sensor, row, noise };
        if !self.scheduler.is_driven() {
            self.scheduler.hold(time, latest, observer)?;
            self.scheduler.begin_epoch(time);
        } else if self.scheduler.is_running_before(time) {
            self.scheduler.wait(measurement);
            return Ok(());
        }
        self.offer(measurement, None, observer)
    }

    /// Queues the rows that a stage has emitted.
    fn take_emission(&mut self, emission: Emission, observer: &mut dyn Observer) -> Result<(), Halt> {
        let everything = 0..self.queue.width(emission.stream);
        for (number, time, values) in emission.rows() {
            let row = Row {
                stream: emission.stream,
                time,
                values,
                number,
                disturbed: if emission.is_disturbed {
                    core::slice::from_ref(&everything)
                } else {
                    &[]
                },
                arrival: None,
            };
            self.put(&row, self.queue.watermark(), Time::MIN, observer)?;
        }
        self.scheduler.give_back(emission);
        Ok(())
    }

    /// Notifies the stages on the input's stream that it is silent up to `time`.
    pub(super) fn tell_silence(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(stream) = self.intake.port().map(|port| port.stream) else {
            return Ok(());
        };
        for unit in 0..self.scheduler.stages().len() {
            if self.scheduler.hears(unit, stream) {
                let emission = self.scheduler.silence(unit, time, observer)?;
                self.take_emission(emission, observer)?;
            }
        }
        Ok(())
    }

    /// Notifies the stages that no row follows, and uses the rows that they still emit.
    fn finish_stages(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        for unit in 0..self.scheduler.stages().len() {
            let emission = self.scheduler.finish_stage(unit, observer)?;
            self.take_emission(emission, observer)?;
            self.drain(Time::MAX, observer)?;
        }
        Ok(())
    }
}
