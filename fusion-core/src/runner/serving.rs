//! Serving the consumers: rows to initialisers, stages, the process and the sensors.

use super::guard::Judged;
use super::intake::{Intake, Sample, Suspect, Taken};
use super::ordering::{PROCESS, Runner, Waiting};
use super::rows::{Consumer, Entry};
use super::{Discard, Event, Halt, Observer, RowId};
use crate::belief::Belief;
use crate::filter::{FilterError, Observed, Verdict};
use crate::gate::Outcome;
use crate::model::Input;
use crate::state::{Layout, StateRole};
use crate::time::Time;

impl Runner {
    pub(super) fn dispatch(&mut self, entry: Entry, observer: &mut dyn Observer) -> Result<(), Halt> {
        match entry.consumer {
            Consumer::Input => self.input_row(entry.time, entry.row, observer)?,
            Consumer::Initialiser(unit, input) => self.initialiser_row(unit, input, entry.time, entry.row, observer)?,
            Consumer::Stage(unit, input) => self.stage_row(unit, input, entry.time, entry.row, observer)?,
            Consumer::Aim(sensor) => {
                self.aim(sensor, entry);
                return Ok(());
            }
            Consumer::Sensor(_, sensor) => return self.sensor_row(sensor, entry.time, entry.row, observer),
        }
        self.rows.release(entry.row);
        Ok(())
    }

    /// Reports the estimate of an epoch that no row can change any more.
    pub(super) fn tell_epoch(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.epoch.take().is_none() {
            return Ok(());
        }
        observer.on(&Event::Estimate {
            belief: self.estimator.belief(),
        })
    }

    pub(super) fn tell_steps(&self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.estimator.steps().iter().try_for_each(|step| observer.on(&Event::Step(step)))
    }

    fn initialiser_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.started && !self.realign.is_due() {
            return Ok(());
        }
        let u = &mut self.initialisers[unit];
        let origin = self.rows.get(row);
        u.inputs[input].gather(&origin.values, &mut self.value);
        if !self.value.iter().all(|v| v.is_finite()) {
            return observer.on(&Event::Discarded {
                consumer: &u.name,
                input,
                time,
                row: origin.id(&u.inputs[input].columns),
                why: Discard::NotFinite,
            });
        }
        u.initialiser.row(input, time, &self.value);
        if self.started {
            return self.realign(time, observer);
        }
        observer.on(&Event::Taken {
            initialiser: &u.name,
            input,
        })?;
        self.start_if_ready(time, observer)
    }

    pub(super) fn is_driven(&self) -> bool {
        self.process.input_dim() > 0
    }

    /// Starts at `time` once every initialiser can write; an input-driven process also needs the
    /// sample that opens the first interval.
    fn start_if_ready(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let can_run = !self.is_driven() || self.input.as_ref().is_some_and(|input| input.is_open());
        if self.started || !can_run || self.initialisers.iter().any(|u| u.initialiser.waits_for().is_some()) {
            return Ok(());
        }
        let form = self.estimator.belief().covariance.form().clone();
        let mut belief = Belief::initial(self.estimator.layout(), &form, time);
        if let Some(last) = self.last.take() {
            keep_calibration(self.estimator.layout(), &last, &mut belief);
        }
        if let Some(latest) = self.input.as_ref().and_then(|input| input.latest()) {
            belief.input.take(&Input::held(latest));
        }
        for u in &self.initialisers {
            u.initialiser.write(time, self.estimator.layout(), &mut belief);
        }
        if !(self.estimator.layout().is_sane(&belief.x) && belief.is_sound()) {
            return observer.on(&Event::Failed {
                error: FilterError::Diverged(time),
            });
        }
        self.started = true;
        self.start_after = time;
        self.estimator.set_belief(belief);
        observer.on(&Event::Started {
            belief: self.estimator.belief(),
            rivals: self.estimator.rivals(),
        })
    }

    fn input_row(&mut self, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.input.as_ref().is_some_and(|input| input.is_after_gap(time)) {
            self.settle_suspects(false, observer)?;
        }
        self.gather_input(row);
        let Some(input) = &mut self.input else { return Ok(()) };
        if !self.value.iter().all(|v| v.is_finite()) {
            return self.discard_input(time, row, Discard::NotFinite, observer);
        }
        if let Err(why) = input.admit(time, &self.value) {
            return self.discard_input(time, row, why, observer);
        }
        while let Some(input) = &mut self.input {
            match input.judge(&self.value, self.process.as_ref()) {
                Judged::Passes => break,
                Judged::Waits => {
                    input.wait(Suspect { time, row });
                    self.rows.hold(row);
                    return Ok(());
                }
                judged => self.settle_suspects(judged == Judged::Confirms, observer)?,
            }
            self.gather_input(row);
        }
        self.use_input(time, observer)?;
        self.start_if_ready(time, observer)
    }

    /// Uses the waiting rows of the input, or discards them as spikes.
    pub(super) fn settle_suspects(&mut self, are_used: bool, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some((Suspect { time, row }, why)) = self.input.as_mut().and_then(Intake::settle) {
            self.gather_input(row);
            if are_used {
                self.use_input(time, observer)?;
            } else {
                if let Some(input) = &mut self.input {
                    input.refuse(&self.value, self.process.as_ref());
                }
                self.discard_input(time, row, why, observer)?;
            }
            self.rows.release(row);
        }
        Ok(())
    }

    fn gather_input(&mut self, row: usize) {
        if let Some(input) = &self.input {
            input.port.gather(&self.rows.get(row).values, &mut self.value);
        }
    }

    /// Uses the present row of the input, which ends at `time`.
    fn use_input(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(input) = &mut self.input else { return Ok(()) };
        let taken = input.take(time, &self.value, self.process.as_ref());
        self.keep_input(&taken, time);
        match taken {
            Taken::First => Ok(()),
            Taken::Sample => self.run_ready(observer),
            Taken::Resumes { since, start } => self.resume(since, start, time, observer),
        }
    }

    fn discard_input(&self, time: Time, row: usize, why: Discard, observer: &mut dyn Observer) -> Result<(), Halt> {
        let columns = self.input.as_ref().map_or(&[][..], |input| &input.port.columns);
        observer.on(&Event::Discarded {
            consumer: PROCESS,
            input: 0,
            time,
            row: self.rows.get(row).id(columns),
            why,
        })
    }

    /// Runs over the samples that are ready.
    pub(super) fn run_ready(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(sample) = self.input.as_mut().and_then(|input| input.next()) {
            self.advance(&sample, observer)?;
            if let Some(input) = &mut self.input {
                input.give_back(sample);
            }
        }
        Ok(())
    }

    /// Runs the estimator over `sample`, or the rest of it, and serves the measurements inside it.
    pub(super) fn advance(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), Halt> {
        if !self.started || sample.end <= self.estimator.belief().time {
            return Ok(());
        }
        self.expect(sample);
        while let Some(&waiting) = self.waiting.front() {
            if waiting.time > sample.end {
                break;
            }
            self.waiting.pop_front();
            self.move_to(waiting.time, &sample.input(), observer)?;
            self.offer(waiting, Some(sample), observer)?;
        }
        self.move_to(sample.end, &sample.input(), observer)?;
        self.epoch = Some(sample.end);
        Ok(())
    }

    /// Moves the estimate to `to`; the epoch that it leaves is reported first.
    fn move_to(&mut self, to: Time, input: &Input<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        if to > self.estimator.belief().time {
            self.tell_epoch(observer)?;
        }
        if let Err(error) = self.estimator.predict(to, input) {
            observer.on(&Event::Failed { error })?;
        }
        self.tell_steps(observer)
    }

    /// Moves the estimate to `to` by holding the latest input, or by time alone.
    pub(super) fn hold_to(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        if to <= self.estimator.belief().time {
            return Ok(());
        }
        let latest = self.input.as_ref().and_then(|input| input.latest()).unwrap_or_default();
        if latest.len() < self.process.input_dim() {
            return Ok(());
        }
        self.value.clear();
        self.value.extend_from_slice(latest);
        let held = core::mem::take(&mut self.value);
        let moved = self.move_to(to, &Input::held(&held), observer);
        self.value = held;
        moved
    }

    /// Serves the measurements that wait for an input sample that does not come: the latest sample is held.
    pub(super) fn serve_waiting(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        if let Some(input) = &mut self.input {
            input.finish();
        }
        self.run_ready(observer)?;
        let is_coasting = self.input.as_ref().is_some_and(|input| input.is_coasting());
        while let Some(waiting) = self.waiting.pop_front() {
            if is_coasting {
                self.coast_estimate(waiting.time, observer)?;
            } else {
                self.hold_to(waiting.time, observer)?;
            }
            self.offer(waiting, None, observer)?;
            self.epoch = Some(waiting.time);
        }
        Ok(())
    }

    fn sensor_row(&mut self, sensor: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if !self.is_driven() {
            self.start_if_ready(time, observer)?;
        }
        let waiting = Waiting { time, sensor, row };
        // Rows that started the filter are not used a second time.
        if !self.started || time <= self.start_after {
            return self.discard_early(waiting, observer);
        }
        if !self.is_driven() {
            self.hold_to(time, observer)?;
            self.epoch = Some(time);
        } else if time > self.estimator.belief().time {
            self.waiting.push_back(waiting);
            return Ok(());
        }
        self.offer(waiting, None, observer)
    }

    /// Discards a measurement for which the filter has not started, and releases its row.
    pub(super) fn discard_early(&mut self, measurement: Waiting, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Waiting { time, sensor, row } = measurement;
        let s = &self.sensors[sensor];
        let (id, why) = (self.rows.get(row).id(&s.port.columns), Discard::BeforeStart);
        self.rows.release(row);
        observer.on(&Event::Discarded {
            consumer: &s.name,
            input: 0,
            time,
            row: id,
            why,
        })
    }

    /// Offers a measurement to the estimator, whose belief has the same time, and releases its row; `during` is the
    /// current sample.
    pub(super) fn offer(&mut self, measurement: Waiting, during: Option<&Sample>, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Waiting { time, sensor, row } = measurement;
        let leader = self.sensors[sensor].gate.leader();
        let foreseen = leader.and_then(|leader| self.foresee(leader, row, during));
        let id = self.gather(sensor, row);
        let quality = self.sensors[sensor].quality.map(|column| self.rows.get(row).values[column]);
        let assumed = self.assumed_offset(sensor, row, time, during.map(Sample::input));
        self.rows.release(row);
        let is_coasting = self.input.as_ref().is_some_and(|input| input.is_coasting());
        let (s, now) = (&mut self.sensors[sensor], self.estimator.belief().time);
        let m = s.model.size().residual;
        let noise = &self.noise[..m * m];
        let why = if time < now {
            Some(Discard::Late { now })
        } else {
            let is_finite = self.value.iter().chain(noise).all(|v| v.is_finite());
            (!is_finite).then_some(Discard::NotFinite)
        };
        if let Some(why) = why {
            return observer.on(&Event::Discarded {
                consumer: &s.name,
                input: 0,
                time,
                row: id,
                why,
            });
        }
        let observed = Observed {
            sensor,
            model: s.model.as_ref(),
            value: &self.value,
            noise,
            quality,
            derivative_input: if is_coasting { None } else { self.expectation.input() },
            lateness: s
                .offset
                .as_ref()
                .zip(assumed)
                .map(|(offset, assumed)| self.window.lateness(offset, assumed)),
        };
        let told = leader.filter(|_| foreseen.is_some());
        let latest = told.and_then(|leader| core::mem::replace(&mut self.outcomes[leader], foreseen));
        let update = self.estimator.update(&observed, s.gate.as_mut(), &self.outcomes, s.loss.as_ref());
        if let Some(leader) = told {
            self.outcomes[leader] = latest;
        }
        self.outcomes[sensor] = Some(Outcome {
            time,
            is_used: matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired),
            mode: update.mode,
        });
        observer.on(&Event::Updated {
            sensor,
            update,
            time,
            row: id,
        })?;
        self.tell_steps(observer)
    }

    /// Puts the value and R of a sensor's measurement into their buffers. Returns the row's identity.
    fn gather(&mut self, sensor: usize, row: usize) -> RowId {
        let (s, data) = (&self.sensors[sensor], self.rows.get(row));
        if s.port.columns.is_empty() {
            self.value.clone_from(&s.constant);
        } else {
            s.port.gather(&data.values, &mut self.value);
        }
        let m = s.model.size().residual;
        s.noise.fill(&data.values, &mut self.noise[..m * m]);
        data.id(&s.port.columns)
    }
}

/// Writes the calibration of `last` to `belief`: a filter that starts again does not lose it.
fn keep_calibration(layout: &Layout, last: &Belief, belief: &mut Belief) {
    for block in layout.blocks().iter().filter(|b| b.role == StateRole::Calibration) {
        let storage = block.storage_range();
        belief.x[storage.clone()].copy_from_slice(&last.x[storage]);
        belief.covariance.set_block(block, &last.covariance.block(block));
    }
}
