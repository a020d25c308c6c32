//! The scheduler itself.

use super::sensors::{Circumstances, Sensors, Waiting};
use super::stages::{Emission, Stages};
use super::starter::{Alignment, Starter};
use crate::belief::Belief;
use crate::filter::{Estimator, FilterError};
use crate::gate::Outcome;
use crate::memory::{Memory, Tape};
use crate::model::Input;
use crate::runner::consumer::{Consumer, Delays, PROCESS, Refused, Route};
use crate::runner::rows::Stored;
use crate::runner::{Event, Halt, InitialiserUnit, Observer, Sensor, StageUnit, StreamId};
use crate::time::{Time, nanos};
use alloc::boxed::Box;
use alloc::collections::VecDeque;

/// Serves sensors, stages and initialisers, and drives the estimator.
#[derive(Debug)]
pub(crate) struct Scheduler {
    estimator: Box<dyn Estimator>,
    /// The numbers of the input that the process reads.
    input_dim: usize,
    sensors: Sensors,
    stages: Stages,
    starter: Starter,
    /// Measurements that wait for the input sample that covers them, in order.
    waiting: VecDeque<Waiting>,
    /// The epoch whose estimate has not been reported yet.
    epoch: Option<Time>,
    keeps_steps: bool,
    /// The longest silence that a process without input predicts through \[ns\].
    longest_silence: Option<i64>,
}

impl Memory for Scheduler {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.estimator.remember(tape);
        self.sensors.remember(tape);
        self.stages.remember(tape);
        self.starter.remember(self.estimator.layout(), tape);
        self.waiting.remember(tape);
        self.epoch.remember(tape);
    }
}

/// Declarations, before the first row.
impl Scheduler {
    /// A scheduler of `estimator`, whose process reads `input_dim` numbers.
    pub(crate) fn new(estimator: Box<dyn Estimator>, input_dim: usize) -> Self {
        Self {
            estimator,
            input_dim,
            sensors: Sensors::default(),
            stages: Stages::default(),
            starter: Starter::default(),
            waiting: VecDeque::with_capacity(16),
            epoch: None,
            keeps_steps: false,
            longest_silence: None,
        }
    }

    /// Adds a sensor.
    pub(crate) fn add_sensor(&mut self, sensor: Sensor) {
        self.sensors.add(sensor);
    }

    /// Adds a stage that emits rows of `width` numbers.
    pub(crate) fn add_stage(&mut self, stage: StageUnit, width: usize) {
        self.stages.add(stage, width);
    }

    /// Adds an initialiser.
    pub(crate) fn add_initialiser(&mut self, unit: InitialiserUnit) {
        self.starter.add(unit);
    }

    /// If all rows are silent for more than `seconds`, a filter without input starts anew.
    pub(crate) fn restart_after(&mut self, seconds: f64) {
        self.longest_silence = Some(nanos(seconds));
    }

    /// A filter that has been lost for `seconds` starts anew.
    pub(crate) fn restart_lost(&mut self, seconds: f64) {
        self.starter.restart_lost(seconds, self.estimator.layout());
    }

    /// The sensors, in order of their numbers.
    pub(crate) fn sensors(&self) -> &[Sensor] {
        self.sensors.units()
    }

    /// The stages, in order of their numbers.
    pub(crate) fn stages(&self) -> &[StageUnit] {
        self.stages.units()
    }

    /// The initialisers, in order of their numbers.
    pub(crate) fn initialisers(&self) -> &[InitialiserUnit] {
        self.starter.units()
    }

    /// The streams that it reads: those of initialisers first, then those of stages and sensors.
    ///
    /// The initialisers of a running filter do not use rows, but may have to start it again by the time that the rows
    /// are served.
    pub(crate) fn routes(&self) -> impl Iterator<Item = Route> {
        let route = |consumer, port: &_| Route {
            consumer,
            port: Clone::clone(port),
            takes_late: false,
        };
        let initialisers = self.initialisers().iter().enumerate().flat_map(move |(u, unit)| {
            let inputs = unit.inputs.iter().enumerate();
            inputs.map(move |(i, port)| route(Consumer::Initialiser(u, i), port))
        });
        let stages = self.stages().iter().enumerate().flat_map(move |(u, unit)| {
            let inputs = unit.inputs.iter().enumerate();
            inputs.map(move |(i, port)| route(Consumer::Stage(u, i), port))
        });
        let is_emitted = |stream| self.stages().iter().any(|stage| stage.output == stream);
        let sensors = self.sensors().iter().enumerate().map(move |(s, sensor)| match sensor.offset {
            Some(_) => Route {
                takes_late: is_emitted(sensor.port.stream),
                ..route(Consumer::Aim(s), &sensor.port)
            },
            None => route(Consumer::Sensor(self.sensors.rank(s).unwrap_or(0), s), &sensor.port),
        });
        let switches = self.sensors().iter().enumerate().filter_map(move |(s, sensor)| {
            Some(Route {
                takes_late: true,
                ..route(Consumer::Switch(s), &sensor.switch.as_ref()?.port)
            })
        });
        initialisers.chain(stages).chain(switches).chain(sensors)
    }

    /// Adds the delays that followers need.
    pub(crate) fn follow(&self, delays: &mut Delays) {
        self.sensors.follow(delays);
    }

    /// The name of a consumer of rows.
    fn name(&self, consumer: Consumer) -> &str {
        match consumer {
            Consumer::Input => PROCESS,
            Consumer::Initialiser(unit, _) => &self.initialisers()[unit].name,
            Consumer::Stage(unit, _) => &self.stages()[unit].name,
            Consumer::Switch(sensor) | Consumer::Aim(sensor) | Consumer::Sensor(_, sensor) => &self.sensors()[sensor].name,
        }
    }

    /// Whether it can serve a consumer.
    pub(crate) fn serves(&self, consumer: Consumer) -> bool {
        match consumer {
            Consumer::Input => false,
            Consumer::Initialiser(unit, input) => self.initialisers().get(unit).is_some_and(|u| input < u.inputs.len()),
            Consumer::Stage(unit, input) => self.stages().get(unit).is_some_and(|u| input < u.inputs.len()),
            Consumer::Switch(sensor) => self.sensors().get(sensor).is_some_and(|s| s.switch.is_some()),
            Consumer::Aim(sensor) => sensor < self.sensors().len(),
            Consumer::Sensor(rank, sensor) => self.sensors.rank(sensor) == Some(rank),
        }
    }

    /// Its memory of the health, apart from the rest: the monitor is detached while a row is processed.
    pub(crate) fn remember_health(&mut self, tape: &mut Tape<'_>) {
        self.starter.remember_health(tape);
    }
}

/// The estimator.
impl Scheduler {
    pub(crate) fn estimator(&self) -> &dyn Estimator {
        self.estimator.as_ref()
    }

    pub(crate) fn estimator_mut(&mut self) -> &mut dyn Estimator {
        self.estimator.as_mut()
    }

    pub(crate) fn belief(&self) -> &Belief {
        self.estimator.belief()
    }

    /// Whether the process reads an input.
    pub(crate) const fn is_driven(&self) -> bool {
        self.input_dim > 0
    }

    /// Whether the filter runs, and is not yet at `time`.
    pub(crate) fn is_running_before(&self, time: Time) -> bool {
        self.is_running() && self.belief().time < time
    }

    /// Keeps steps if the observer wants them.
    pub(crate) fn listen(&mut self, observer: &dyn Observer) {
        let wanted = observer.wants_steps();
        if wanted != self.keeps_steps {
            self.keeps_steps = wanted;
            self.estimator.keep_steps(wanted);
        }
    }

    /// Moves the estimate to `to`; the epoch that it leaves is reported first.
    pub(crate) fn predict(&mut self, to: Time, input: &Input<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        if to > self.belief().time {
            self.tell_epoch(observer)?;
        }
        if let Err(error) = self.estimator.predict(to, input) {
            observer.on(&Event::Failed { error })?;
        }
        self.tell_steps(observer)
    }

    /// Moves the estimate to `to` by holding the latest row of the input, or by time alone.
    pub(crate) fn hold(&mut self, to: Time, latest: Option<&[f64]>, observer: &mut dyn Observer) -> Result<(), Halt> {
        let latest = latest.unwrap_or_default();
        if to <= self.belief().time || latest.len() < self.input_dim {
            return Ok(());
        }
        self.predict(to, &Input::held(latest), observer)
    }

    /// Moves the estimate of a running filter to a later time without input, which has been missing since `since`. At
    /// the beginning of the gap the vehicle moved by the input `expected`.
    pub(crate) fn coast(
        &mut self,
        to: Time,
        since: Option<Time>,
        expected: Option<&Input<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        self.tell_epoch(observer)?;
        let since = since.unwrap_or(self.belief().time);
        if let Err(error) = self.estimator.coast(to, to.seconds_since(since), expected) {
            observer.on(&Event::Failed { error })?;
        }
        if self.estimator.keeps_covariance() {
            self.starter.watch_attitude(self.estimator.layout(), self.estimator.belief());
        }
        self.tell_steps(observer)
    }
}

/// Reports.
impl Scheduler {
    /// A consumer does not get a row. The initialisers of a running filter do not miss it.
    pub(crate) fn tell_missed(&self, missed: &Refused, observer: &mut dyn Observer) -> Result<(), Halt> {
        if missed.consumer.is_initialiser() && self.is_running() {
            return Ok(());
        }
        self.tell_refused(missed, observer)
    }

    /// A consumer does not use a row.
    pub(crate) fn tell_refused(&self, refused: &Refused, observer: &mut dyn Observer) -> Result<(), Halt> {
        let &Refused { consumer, time, row, why } = refused;
        observer.on(&Event::Discarded {
            consumer: self.name(consumer),
            input: consumer.input(),
            time,
            row,
            why,
        })
    }

    /// The measurements of `time` may still change the estimate, and no later row.
    pub(crate) const fn begin_epoch(&mut self, time: Time) {
        self.epoch = Some(time);
    }

    /// Reports the estimate of an epoch before `time`, which no row can change any more.
    pub(crate) fn end_epoch_before(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.epoch.is_some_and(|epoch| epoch < time) {
            self.tell_epoch(observer)?;
        }
        Ok(())
    }

    /// Reports the estimate of an epoch that no row can change any more.
    pub(crate) fn tell_epoch(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.epoch.take().is_none() {
            return Ok(());
        }
        observer.on(&Event::Estimate { belief: self.belief() })
    }

    fn tell_steps(&self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.estimator.steps().iter().try_for_each(|step| observer.on(&Event::Step(step)))
    }
}

/// Start and stop.
impl Scheduler {
    /// Whether the filter has started.
    pub(crate) fn is_running(&self) -> bool {
        self.starter.is_running()
    }

    /// Whether the filter runs, and started before `time`. Rows that started it are not used a second time.
    pub(crate) fn has_started_before(&self, time: Time) -> bool {
        self.is_running() && time > self.starter.start_time()
    }

    /// Shows an initialiser a row of its `input`, which may start the filter. `latest` is the latest row of the process
    /// input.
    pub(crate) fn initialiser_row(
        &mut self,
        (unit, input): (usize, usize),
        time: Time,
        row: &Stored,
        latest: Option<&[f64]>,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        if !self.starter.takes_rows() {
            return Ok(());
        }
        if let Err(refused) = self.starter.row((unit, input), time, row) {
            return self.tell_refused(&refused, observer);
        }
        if self.is_running() {
            return self.align(time, observer);
        }
        observer.on(&Event::Taken {
            initialiser: &self.initialisers()[unit].name,
            input,
        })?;
        self.start_if_ready(time, latest, observer)
    }

    /// Starts at `time` once every initialiser can write; an input-driven process also needs the row that opens the
    /// first interval.
    pub(crate) fn start_if_ready(&mut self, time: Time, latest: Option<&[f64]>, observer: &mut dyn Observer) -> Result<(), Halt> {
        if (self.is_driven() && latest.is_none()) || !self.starter.is_ready() {
            return Ok(());
        }
        let form = self.belief().covariance.form().clone();
        let Some(belief) = self.starter.first_belief(self.estimator.layout(), &form, time, latest) else {
            return observer.on(&Event::Failed {
                error: FilterError::Diverged(time),
            });
        };
        self.starter.start(time);
        self.estimator.set_belief(belief);
        observer.on(&Event::Started {
            belief: self.belief(),
            rivals: self.estimator.rivals(),
        })
    }

    /// Takes the attitude of the initialisers, once they have found it.
    fn align(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        match self.starter.align(self.estimator.layout(), self.estimator.belief(), time) {
            Alignment::Sought => return Ok(()),
            Alignment::Agrees => {}
            Alignment::Replaces => {
                self.tell_epoch(observer)?;
                if let Some(found) = self.starter.trial() {
                    self.estimator.renew(found);
                }
            }
        }
        self.tell_steps(observer)
    }

    /// The filter stops, and its initialisers begin anew; the calibration is kept for them. No measurement waits.
    pub(crate) fn stop(&mut self) {
        self.starter.stop(self.estimator.layout(), self.estimator.belief());
        self.sensors.forget();
    }

    /// Begins another recording if the silence before `time` was longer than any within a recording.
    pub(crate) fn begin_recording(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let end = |silence| self.belief().time.shifted(silence);
        if self.is_running() && !self.is_driven() && self.longest_silence.is_some_and(|silence| time > end(silence)) {
            self.tell_epoch(observer)?;
            self.stop();
        }
        Ok(())
    }

    /// Since when the filter has been lost, if that is so long that it has to [give up](Scheduler::give_up).
    pub(crate) fn lost_since(&mut self, observer: &dyn Observer) -> Option<Time> {
        if !self.starter.follows_health() {
            return None;
        }
        self.starter
            .follow_health(observer.health()?, self.estimator.layout(), self.estimator.belief())
    }

    /// The filter stops. The calibration of its last good health is kept. No measurement waits.
    pub(crate) fn give_up(&mut self) {
        self.starter.give_up();
        self.sensors.forget();
    }
}

/// Measurements.
impl Scheduler {
    /// When a row of this stamp is valid for a sensor, by the current estimate of the offset: the consumer for which it
    /// is queued again. `None` for a sensor without an offset.
    pub(crate) fn aim(&self, sensor: usize, stamp: Time) -> Option<(Time, Consumer)> {
        let time = self.sensors()[sensor].aim(stamp, &self.belief().x)?;
        Some((time, Consumer::Sensor(self.sensors.rank(sensor)?, sensor)))
    }

    /// The leader of a sensor.
    pub(crate) fn leader(&self, sensor: usize) -> Option<usize> {
        self.sensors.leader(sensor)
    }

    /// The outcome of the latest measurement of a sensor.
    pub(crate) fn outcome(&self, sensor: usize) -> Option<Outcome> {
        self.sensors.outcome(sensor)
    }

    /// Sets a sensor by a row of its switch that is valid at `time`.
    pub(crate) fn switch(&mut self, sensor: usize, time: Time, row: &Stored, observer: &mut dyn Observer) -> Result<(), Halt> {
        let Some(why) = self.sensors.set(sensor, row.values()) else {
            return Ok(());
        };
        let columns = self.sensors()[sensor]
            .switch
            .as_ref()
            .map_or(&[][..], |switch| &switch.port.columns);
        let (consumer, row) = (Consumer::Switch(sensor), row.id(columns));
        self.tell_refused(&Refused { consumer, time, row, why }, observer)
    }

    /// The factor on the 1σ of a sensor's noise now; `None` while it is switched off.
    pub(crate) fn factor(&self, sensor: usize) -> Option<f64> {
        self.sensors.factor(sensor)
    }

    /// A measurement waits for the input sample that covers it. It is later than all that wait.
    pub(crate) fn wait(&mut self, measurement: Waiting) {
        self.waiting.push_back(measurement);
    }

    /// Removes and returns the first waiting measurement, if it is valid at `until` or earlier.
    pub(crate) fn next_waiting(&mut self, until: Time) -> Option<Waiting> {
        self.waiting.pop_front_if(|waiting| waiting.time <= until)
    }

    /// The measurements that wait.
    pub(crate) fn waiting(&self) -> impl Iterator<Item = &Waiting> {
        self.waiting.iter()
    }

    /// Offers a measurement to the estimator, whose belief has the same time.
    pub(crate) fn offer(
        &mut self,
        measurement: &Waiting,
        row: &Stored,
        circumstances: &Circumstances<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        let &Waiting { time, sensor, .. } = measurement;
        let (id, why) = self.sensors.gather(measurement, row, self.estimator.belief().time);
        if let Some(why) = why {
            let consumer = Consumer::Sensor(0, sensor);
            return self.tell_refused(
                &Refused {
                    consumer,
                    time,
                    row: id,
                    why,
                },
                observer,
            );
        }
        let estimator = self.estimator.as_mut();
        self.sensors.offer(estimator, measurement, (row, id), circumstances, observer)?;
        self.tell_steps(observer)
    }
}

/// Stages.
impl Scheduler {
    /// Whether a stage listens to a stream.
    pub(crate) fn hears(&self, unit: usize, stream: StreamId) -> bool {
        self.stages()[unit].inputs.iter().any(|port| port.stream == stream)
    }

    /// Shows a stage a row of its `input`.
    pub(crate) fn stage_row(
        &mut self,
        (unit, input): (usize, usize),
        time: Time,
        row: &Stored,
        observer: &mut dyn Observer,
    ) -> Result<Emission, Halt> {
        let view = if self.starter.is_running() {
            Some(self.estimator.view())
        } else {
            None
        };
        self.stages.row((unit, input), time, row, view.as_ref(), observer)
    }

    /// Notifies a stage that the process input is silent up to `time`.
    pub(crate) fn silence(&mut self, unit: usize, time: Time, observer: &mut dyn Observer) -> Result<Emission, Halt> {
        let view = self.estimator.view();
        self.stages.silence(unit, time, &view, observer)
    }

    /// Notifies a stage that no row follows.
    pub(crate) fn finish_stage(&mut self, unit: usize, observer: &mut dyn Observer) -> Result<Emission, Halt> {
        self.stages.finish(unit, observer)
    }

    /// Takes the memory of rows that are queued.
    pub(crate) fn give_back(&mut self, emission: Emission) {
        self.stages.give_back(emission);
    }
}
