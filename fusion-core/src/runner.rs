//! The runner: owns time order.
//!
//! Rows of any number of streams come in; consumers (the process input, sensors, stages,
//! initialisers) see them in order of *validity*. A consumer may declare that its rows are valid
//! earlier than stamped; rows are held back just long enough that every order of arrival within
//! the buffer gives bit for bit the result of time order.
//!
//! An input sample is valid over the interval that ends at its stamp. A measurement inside that
//! interval waits for the sample and then splits it.

mod event;
mod parts;
mod rows;

pub use event::{Event, Halt, Observer, Observers, RowId};
pub use parts::{Emitter, Initialiser, InitialiserUnit, Noise, Port, Sensor, Stage, StageUnit};
pub use rows::Row;

use crate::filter::{Estimator, Observed, Verdict};
use crate::gate::{Closed, Gate, Mode};
use crate::model::{Input, Process};
use crate::state::Belief;
use crate::time::Time;
use parts::Emitted;
use rows::{Consumer, Entry, Queue, Rows};
use std::collections::VecDeque;
use std::sync::Arc;
use thiserror::Error;

/// The number of a stream, as given by [`Runner::add_stream`].
pub type StreamId = usize;

/// A row does not have the width its stream was declared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a row of {wanted} numbers is expected here, this one has {found}")]
pub struct WrongWidth {
    /// Numbers declared.
    pub wanted: usize,
    /// Numbers given.
    pub found: usize,
}

#[derive(Clone, Debug)]
struct Stream {
    name: String,
    width: usize,
}

/// Why a row could not be fed, or the run not go on.
#[derive(Debug, Error)]
pub enum RunError {
    /// The row has another width than its stream. It is not used, and nothing has changed.
    #[error(transparent)]
    Width(#[from] WrongWidth),
    /// An observer could not go on.
    #[error("{0}")]
    Observer(Halt),
}

impl From<Halt> for RunError {
    fn from(halt: Halt) -> Self {
        Self::Observer(halt)
    }
}

/// A process-input sample and the interval that it covers.
#[derive(Clone, Debug, Default)]
struct Sample {
    start: Time,
    end: Time,
    rates: Vec<f64>,
}

impl Sample {
    fn dt(&self) -> f64 {
        self.end.seconds_since(self.start)
    }
}

/// How long the refusal of a sensor that has fallen silent \[s\] holds for those that go with it:
/// the pause after which gates believe a sensor anew.
const SILENCE: f64 = 10.0;

/// Merges streams in time and drives an estimator.
///
/// Cloned, it continues bit for bit as the original would.
#[derive(Clone, Debug)]
pub struct Runner {
    streams: Vec<Stream>,
    input: Option<Port>,
    sensors: Vec<Sensor>,
    /// By sensor: how many it takes to reach one that goes with no other, itself included. Of one
    /// time, lower ranks are served first.
    ranks: Vec<usize>,
    /// By sensor: when its latest measurement was not used, and the mode of its gate then.
    unused: Vec<Option<(Time, Mode)>>,
    stages: Vec<StageUnit>,
    initialisers: Vec<InitialiserUnit>,
    pairs: bool,
    buffer: i64,
    lag: i64,
    queue: Queue,
    rows: Rows,
    watermark: Time,
    released: Time,
    started: bool,
    start_after: Time,
    previous: Option<Sample>,
    held: Option<Sample>,
    spare: Vec<Vec<f64>>,
    /// Measurements that wait for the input sample which covers them, in order.
    waiting: VecDeque<(Time, usize, usize)>,
    emitted: Emitted,
    /// Rows that each stage has emitted so far.
    emissions: Vec<u64>,
    /// The epoch whose estimate has not been told yet.
    epoch: Option<Time>,
    keeps_steps: bool,
    value: Vec<f64>,
    noise: Vec<f64>,
    process: Arc<dyn Process>,
    estimator: Box<dyn Estimator>,
}

impl Runner {
    /// A runner of `estimator`, whose process is `process`; rows may arrive up to `buffer`
    /// seconds out of order.
    #[must_use]
    pub fn new(estimator: Box<dyn Estimator>, process: Arc<dyn Process>, buffer: f64) -> Self {
        Self {
            streams: Vec::new(),
            input: None,
            sensors: Vec::new(),
            ranks: Vec::new(),
            unused: Vec::new(),
            stages: Vec::new(),
            initialisers: Vec::new(),
            pairs: process.pairs_samples(),
            buffer: crate::time::nanos(buffer.max(0.0)),
            lag: crate::time::nanos(buffer.max(0.0)),
            queue: Queue::new(),
            rows: Rows::default(),
            watermark: Time::MIN,
            released: Time::MIN,
            started: false,
            start_after: Time::MIN,
            previous: None,
            held: None,
            spare: Vec::new(),
            waiting: VecDeque::with_capacity(64),
            emitted: Emitted::default(),
            emissions: Vec::new(),
            epoch: None,
            keeps_steps: false,
            value: Vec::new(),
            noise: Vec::new(),
            process,
            estimator,
        }
    }

    /// Adds a stream of rows of `width` numbers and returns its number.
    pub fn add_stream(&mut self, name: &str, width: usize) -> StreamId {
        self.streams.push(Stream {
            name: name.to_owned(),
            width,
        });
        self.streams.len() - 1
    }

    /// The number of the stream `name`.
    #[must_use]
    pub fn stream(&self, name: &str) -> Option<StreamId> {
        self.streams.iter().position(|s| s.name == name)
    }

    /// Name and width of the streams, in order of their numbers.
    pub fn streams(&self) -> impl Iterator<Item = (&str, usize)> {
        self.streams.iter().map(|s| (s.name.as_str(), s.width))
    }

    /// Says which stream drives the process.
    pub fn set_input(&mut self, port: Port) {
        self.reach(&port);
        self.input = Some(port);
    }

    /// Adds a sensor.
    pub fn add_sensor(&mut self, sensor: Sensor) {
        self.reach(&sensor.port);
        let m = sensor.model.size().residual;
        if self.noise.len() < m * m {
            self.noise.resize(m * m, 0.0);
        }
        self.sensors.push(sensor);
        self.unused.push(None);
        self.rank_sensors();
        self.hold_equal_stamps();
    }

    /// Followers after those they go with.
    fn rank_sensors(&mut self) {
        let all = self.sensors.len();
        let leader = |&s: &usize| self.sensors[s].only_with.filter(|&leader| leader < all);
        // A circle ends, too.
        let rank = |s| core::iter::successors(Some(s), leader).take(all).count();
        self.ranks = (0..all).map(rank).collect();
    }

    /// Of a follower and a leader on two streams, all rows of one stamp must be there before the
    /// first is used: rows are held back until a later one comes.
    fn hold_equal_stamps(&mut self) {
        let stream = |s: usize| self.sensors.get(s).map(|s| s.port.stream);
        let apart = |s: &Sensor| s.only_with.is_some_and(|leader| stream(leader).is_some_and(|l| l != s.port.stream));
        if self.buffer == 0 && self.sensors.iter().any(apart) {
            self.buffer = 1;
            self.lag += 1;
        }
    }

    /// Holds rows back long enough for the delay of `port`.
    fn reach(&mut self, port: &Port) {
        self.lag = self.lag.max(self.buffer + port.delay.max(0));
    }

    /// Adds a stage.
    pub fn add_stage(&mut self, stage: StageUnit) {
        stage.inputs.iter().for_each(|p| self.reach(p));
        self.stages.push(stage);
        self.emissions.push(0);
    }

    /// Adds an initialiser; without any, the filter starts at its first row.
    pub fn add_initialiser(&mut self, unit: InitialiserUnit) {
        unit.inputs.iter().for_each(|p| self.reach(p));
        self.initialisers.push(unit);
    }

    /// The sensors, in order of their numbers.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// The estimator.
    #[must_use]
    pub fn estimator(&self) -> &dyn Estimator {
        self.estimator.as_ref()
    }

    /// The belief; meaningful once [`Runner::started`].
    #[must_use]
    pub fn belief(&self) -> &Belief {
        self.estimator.belief()
    }

    /// Whether the filter has started.
    #[must_use]
    pub const fn started(&self) -> bool {
        self.started
    }

    /// What the filter still waits for before it can start.
    #[must_use]
    pub fn waits_for(&self) -> Vec<(String, String)> {
        let pending = self.initialisers.iter();
        pending
            .filter_map(|u| u.initialiser.waits_for().map(|why| (u.name.clone(), why)))
            .collect()
    }

    /// How long rows are held back \[s\]: the buffer plus the longest declared delay.
    #[must_use]
    pub fn lag(&self) -> f64 {
        self.lag as f64 * 1e-9
    }

    /// Takes a row and processes everything it completes.
    ///
    /// # Errors
    /// A row of the wrong width, which changes nothing; an observer that cannot go on.
    pub fn feed(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        let (wanted, found) = (self.streams.get(row.stream).map_or(0, |s| s.width), row.values.len());
        if found != wanted {
            return Err(WrongWidth { wanted, found }.into());
        }
        self.listen(observer);
        self.watermark = self.watermark.max(row.time);
        self.enqueue(row, observer)?;
        self.drain(self.watermark.shifted(-self.lag), observer)?;
        Ok(())
    }

    /// Processes everything that has been held back: the end of the log.
    ///
    /// # Errors
    /// An observer that cannot go on.
    pub fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.listen(observer);
        self.drain(Time::MAX, observer)?;
        if let Some(last) = self.held.take() {
            // A pair without its second sample.
            self.run_over(last, observer)?;
        }
        // What lies after the last input sample is carried there by that sample.
        while let Some((time, sensor, row)) = self.waiting.pop_front() {
            self.predict(time, observer)?;
            self.offer(sensor, time, row, observer)?;
            self.epoch = Some(time);
        }
        self.tell_epoch(observer)
    }

    /// Keeps steps where the observer wants them.
    fn listen(&mut self, observer: &dyn Observer) {
        let wanted = observer.wants_steps();
        if wanted != self.keeps_steps {
            self.keeps_steps = wanted;
            self.estimator.keep_steps(wanted);
        }
    }

    fn enqueue(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        let at = self.rows.put(row, self.watermark);
        let mut offer = |consumer: Consumer, port: &Port, name: &str| {
            if port.stream != row.stream {
                return Ok(());
            }
            let time = row.time.shifted(-port.delay);
            if time < self.released {
                let (consumer, now) = (name, self.released);
                return observer.on(&Event::Late { consumer, time, now });
            }
            self.rows.hold(at);
            self.queue.put(Entry { time, consumer, row: at });
            Ok(())
        };
        if let Some(port) = &self.input {
            offer(Consumer::Input, port, "process")?;
        }
        if !self.started {
            for (u, unit) in self.initialisers.iter().enumerate() {
                for (i, port) in unit.inputs.iter().enumerate() {
                    offer(Consumer::Initialiser(u, i), port, &unit.name)?;
                }
            }
        }
        for (u, unit) in self.stages.iter().enumerate() {
            for (i, port) in unit.inputs.iter().enumerate() {
                offer(Consumer::Stage(u, i), port, &unit.name)?;
            }
        }
        for (s, sensor) in self.sensors.iter().enumerate() {
            offer(Consumer::Sensor(self.ranks[s], s), &sensor.port, &sensor.name)?;
        }
        self.rows.free_unused(at);
        Ok(())
    }

    fn drain(&mut self, until: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(entry) = self.queue.take(until) {
            self.released = entry.time;
            if self.epoch.is_some_and(|epoch| epoch < entry.time) {
                self.tell_epoch(observer)?;
            }
            self.dispatch(entry, observer)?;
        }
        Ok(())
    }

    /// Tells the estimate of an epoch that nothing can change any more.
    fn tell_epoch(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.epoch.take().is_none() {
            return Ok(());
        }
        observer.on(&Event::Estimate {
            belief: self.estimator.belief(),
        })
    }

    fn dispatch(&mut self, entry: Entry, observer: &mut dyn Observer) -> Result<(), Halt> {
        match entry.consumer {
            Consumer::Input => self.input_row(entry.time, entry.row, observer)?,
            Consumer::Initialiser(unit, input) => self.initialiser_row(unit, input, entry.time, entry.row, observer)?,
            Consumer::Stage(unit, input) => self.stage_row(unit, input, entry.time, entry.row, observer)?,
            Consumer::Sensor(_, sensor) => return self.sensor_row(sensor, entry.time, entry.row, observer),
        }
        self.rows.release(entry.row);
        Ok(())
    }

    fn initialiser_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.started {
            return Ok(());
        }
        let u = &mut self.initialisers[unit];
        u.inputs[input].gather(&self.rows.get(row).values, &mut self.value);
        if self.value.iter().all(|v| v.is_finite()) {
            u.initialiser.row(input, time, &self.value);
        }
        self.start_if_ready(time, observer)
    }

    /// Starts at `time` once every initialiser can write; an input-driven process also needs the
    /// sample that opens the first interval.
    fn start_if_ready(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let driven = self.process.input_dim() == 0 || self.previous.is_some();
        if self.started || !driven || self.initialisers.iter().any(|u| u.initialiser.waits_for().is_some()) {
            return Ok(());
        }
        let mut belief = Belief::initial(self.estimator.layout(), time);
        for u in &self.initialisers {
            u.initialiser.write(time, self.estimator.layout(), &mut belief);
        }
        self.started = true;
        self.start_after = time;
        self.estimator.set_belief(belief);
        observer.on(&Event::Started {
            belief: self.estimator.belief(),
        })
    }

    fn input_row(&mut self, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if let Some(port) = &self.input {
            port.gather(&self.rows.get(row).values, &mut self.value);
        }
        if !self.value.iter().all(|v| v.is_finite()) {
            return observer.on(&Event::NotFinite { consumer: "process", time });
        }
        let last_end = self.held.as_ref().or(self.previous.as_ref()).map(|s| s.end);
        let Some(start) = last_end else {
            // The first sample closes an interval of unknown length: it only opens the next one.
            self.previous = Some(Sample {
                start: time,
                end: time,
                rates: self.value.clone(),
            });
            return self.start_if_ready(time, observer);
        };
        if time <= start {
            return observer.on(&Event::Late {
                consumer: "process",
                time,
                now: start,
            });
        }
        let mut rates = self.spare.pop().unwrap_or_default();
        rates.clone_from(&self.value);
        let sample = Sample { start, end: time, rates };
        match (self.pairs, self.held.take()) {
            (true, None) => self.held = Some(sample),
            (true, Some(first)) => {
                self.advance(&first, &sample, false, observer)?;
                self.advance(&sample, &first, true, observer)?;
                self.spare.push(first.rates);
                self.succeed(sample);
            }
            (false, _) => self.run_over(sample, observer)?,
        }
        self.start_if_ready(time, observer)
    }

    /// Runs over `sample` with the one before it as its neighbour.
    fn run_over(&mut self, sample: Sample, observer: &mut dyn Observer) -> Result<(), Halt> {
        let previous = self.previous.take().unwrap_or_else(|| sample.clone());
        self.advance(&sample, &previous, true, observer)?;
        self.previous = Some(previous);
        self.succeed(sample);
        Ok(())
    }

    /// Makes `sample` the previous one.
    fn succeed(&mut self, sample: Sample) {
        if let Some(old) = self.previous.replace(sample) {
            self.spare.push(old.rates);
        }
    }

    /// Runs the estimator over `sample`, serving the measurements that lie inside it.
    fn advance(
        &mut self,
        sample: &Sample,
        neighbour: &Sample,
        neighbour_is_earlier: bool,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        if !self.started || sample.end <= self.estimator.belief().time {
            return Ok(());
        }
        let input = Input {
            sample: &sample.rates,
            neighbour: &neighbour.rates,
            interval: sample.dt(),
            neighbour_interval: neighbour.dt(),
            neighbour_is_earlier,
        };
        while let Some(&(time, sensor, row)) = self.waiting.front() {
            if time > sample.end {
                break;
            }
            self.waiting.pop_front();
            self.move_to(time, &input, observer)?;
            self.offer(sensor, time, row, observer)?;
        }
        self.move_to(sample.end, &input, observer)?;
        self.epoch = Some(sample.end);
        Ok(())
    }

    /// Moves the estimate to `to`; the epoch that it leaves is told first.
    fn move_to(&mut self, to: Time, input: &Input<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        if to > self.estimator.belief().time {
            self.tell_epoch(observer)?;
        }
        if let Err(error) = self.estimator.predict(to, input) {
            observer.on(&Event::Failed { error })?;
        }
        self.tell_steps(observer)
    }

    fn tell_steps(&self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.estimator.steps().iter().try_for_each(|step| observer.on(&Event::Step(step)))
    }

    /// Predicts beyond the input by holding its last sample, or by time alone.
    fn predict(&mut self, to: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        if to <= self.estimator.belief().time {
            return Ok(());
        }
        let rates: Vec<f64> = self.previous.as_ref().map(|s| s.rates.clone()).unwrap_or_default();
        if rates.len() < self.process.input_dim() {
            return Ok(());
        }
        self.move_to(to, &Input::alone(&rates), observer)
    }

    fn stage_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        let u = &mut self.stages[unit];
        let origin = self.rows.get(row);
        u.inputs[input].gather(&origin.values, &mut self.value);
        let is_disturbed = origin.id(&u.inputs[input].columns).disturbed;
        let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer);
        let view = if self.started { Some(self.estimator.view()) } else { None };
        u.stage.row(input, time, &self.value, view.as_ref(), &mut emitter);
        let (output, emitted) = (u.output, emitter.finish()?);
        let everything = 0..self.streams[output].width;
        for (time, values) in emitted.rows() {
            let row = Row {
                stream: output,
                time,
                values,
                number: self.emissions[unit],
                disturbed: if is_disturbed { core::slice::from_ref(&everything) } else { &[] },
            };
            self.emissions[unit] += 1;
            self.enqueue(&row, observer)?;
        }
        self.emitted = emitted;
        Ok(())
    }

    fn sensor_row(&mut self, sensor: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        if self.process.input_dim() == 0 {
            self.start_if_ready(time, observer)?;
        }
        // What started the filter is not used a second time.
        if !self.started || time <= self.start_after {
            self.rows.release(row);
            return Ok(());
        }
        if self.process.input_dim() == 0 {
            self.predict(time, observer)?;
            self.epoch = Some(time);
            self.offer(sensor, time, row, observer)
        } else if time <= self.estimator.belief().time {
            self.offer(sensor, time, row, observer)
        } else {
            self.waiting.push_back((time, sensor, row));
            Ok(())
        }
    }

    /// Offers a row to the estimator, which stands at its time, and releases the row.
    fn offer(&mut self, sensor: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        let s = &mut self.sensors[sensor];
        let m = s.model.size().residual;
        let data = self.rows.get(row);
        if s.port.columns.is_empty() {
            self.value.clone_from(&s.constant);
        } else {
            s.port.gather(&data.values, &mut self.value);
        }
        let noise = &mut self.noise[..m * m];
        s.noise.fill(&data.values, noise);
        let (id, now) = (data.id(&s.port.columns), self.estimator.belief().time);
        self.rows.release(row);
        if time < now {
            let consumer = &s.name;
            return observer.on(&Event::Late { consumer, time, now });
        }
        if !self.value.iter().chain(noise.iter()).all(|v| v.is_finite()) {
            return observer.on(&Event::NotFinite { consumer: &s.name, time });
        }
        let observed = Observed {
            model: s.model.as_ref(),
            value: &self.value,
            noise,
        };
        let refusal = s.only_with.and_then(|leader| *self.unused.get(leader)?);
        let recent = refusal.filter(|(since, _)| time.seconds_since(*since) < SILENCE);
        let mut closed = recent.map(|(_, mode)| Closed(mode));
        let gate: &mut dyn Gate = match &mut closed {
            Some(closed) => closed,
            None => s.gate.as_mut(),
        };
        let update = self.estimator.update(&observed, gate, s.loss.as_ref());
        let is_used = matches!(update.verdict, Verdict::Accepted | Verdict::Readopted);
        self.unused[sensor] = (!is_used).then_some((time, update.mode));
        observer.on(&Event::Updated {
            sensor,
            update,
            time,
            row: id,
        })?;
        self.tell_steps(observer)
    }
}

#[cfg(test)]
mod tests;
