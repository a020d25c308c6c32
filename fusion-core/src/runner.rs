//! The runner: owns time order.
//!
//! Rows of any number of streams come in; consumers (the process input, sensors, stages,
//! initialisers) see them in order of *validity*. A consumer may declare that its rows are valid
//! earlier than stamped; rows are held back just long enough that every order of arrival within
//! the buffer gives bit for bit the result of time order.
//!
//! An input sample is valid over the interval that ends at its stamp. A measurement inside that
//! interval waits for the sample and then splits it.

mod parts;

pub use parts::{Emitter, Event, Initialiser, InitialiserUnit, Noise, Observer, Port, Sensor, Stage, StageUnit, StreamId};

use crate::filter::{Estimator, Observed, Verdict};
use crate::gate::{Closed, Gate, Mode};
use crate::model::{Input, Process};
use crate::state::Belief;
use crate::time::Time;
use std::collections::VecDeque;
use std::sync::Arc;
use thiserror::Error;

/// A row does not have the width its stream was declared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a row of {wanted} numbers is expected here, this one has {found}")]
pub struct WrongWidth {
    /// Numbers declared.
    pub wanted: usize,
    /// Numbers given.
    pub found: usize,
}

#[derive(Debug)]
struct Stream {
    name: String,
    width: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Consumer {
    Input,
    Initialiser(usize, usize),
    Stage(usize, usize),
    /// Its rank, its number.
    Sensor(usize, usize),
}

/// An entry of the reorder queue.
#[derive(Clone, Copy, Debug)]
struct Entry {
    time: Time,
    consumer: Consumer,
    row: usize,
}

/// Entries by time of validity, then consumer, then arrival.
///
/// Sorted, not a heap: rows come nearly in order, and one in order is put at the end at once.
#[derive(Debug)]
struct Queue(VecDeque<Entry>);

impl Queue {
    fn put(&mut self, entry: Entry) {
        let precedes = |other: &Entry| (other.time, other.consumer) <= (entry.time, entry.consumer);
        if self.0.back().is_none_or(precedes) {
            self.0.push_back(entry);
        } else {
            self.0.insert(self.0.partition_point(precedes), entry);
        }
    }

    /// Takes the first entry, unless it is later than `until`.
    fn take(&mut self, until: Time) -> Option<Entry> {
        self.0.front().is_some_and(|e| e.time <= until).then(|| self.0.pop_front())?
    }
}

/// Rows in flight, reused: a row is freed when its last consumer has seen it.
#[derive(Debug, Default)]
struct Rows {
    rows: Vec<Vec<f64>>,
    uses: Vec<u32>,
    free: Vec<usize>,
}

impl Rows {
    fn put(&mut self, row: &[f64]) -> usize {
        let at = self.free.pop().unwrap_or_else(|| {
            self.rows.push(Vec::new());
            self.uses.push(0);
            self.rows.len() - 1
        });
        self.rows[at].clear();
        self.rows[at].extend_from_slice(row);
        self.uses[at] = 0;
        at
    }

    fn release(&mut self, at: usize) {
        self.uses[at] -= 1;
        if self.uses[at] == 0 {
            self.free.push(at);
        }
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
#[derive(Debug)]
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
    emitter: Emitter,
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
            queue: Queue(VecDeque::with_capacity(64)),
            rows: Rows::default(),
            watermark: Time::MIN,
            released: Time::MIN,
            started: false,
            start_after: Time::MIN,
            previous: None,
            held: None,
            spare: Vec::new(),
            waiting: VecDeque::with_capacity(64),
            emitter: Emitter::default(),
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

    /// Takes a row of `stream` stamped `time` and processes everything it completes.
    ///
    /// # Errors
    /// A row of the wrong width.
    pub fn feed(&mut self, stream: StreamId, time: Time, row: &[f64], observer: &mut dyn Observer) -> Result<(), WrongWidth> {
        let wanted = self.streams.get(stream).map_or(0, |s| s.width);
        if row.len() != wanted {
            return Err(WrongWidth { wanted, found: row.len() });
        }
        self.enqueue(stream, time, row, observer);
        self.watermark = self.watermark.max(time);
        self.drain(self.watermark.shifted(-self.lag), observer);
        Ok(())
    }

    /// Processes everything that has been held back: the end of the log.
    pub fn finish(&mut self, observer: &mut dyn Observer) {
        self.drain(Time::MAX, observer);
        if let Some(last) = self.held.take() {
            // A pair without its second sample.
            self.run_over(last, observer);
        }
        // What lies after the last input sample is carried there by that sample.
        while let Some((time, sensor, row)) = self.waiting.pop_front() {
            self.predict(time, observer);
            self.offer(sensor, time, row, observer);
            observer.on(&Event::Predicted {
                belief: self.estimator.belief(),
            });
        }
    }

    fn enqueue(&mut self, stream: StreamId, time: Time, row: &[f64], observer: &mut dyn Observer) {
        let at = self.rows.put(row);
        let mut offer = |consumer: Consumer, port: &Port, name: &str| {
            if port.stream != stream {
                return;
            }
            let time = time.shifted(-port.delay);
            if time < self.released {
                observer.on(&Event::Late {
                    consumer: name,
                    time,
                    now: self.released,
                });
                return;
            }
            self.rows.uses[at] += 1;
            self.queue.put(Entry { time, consumer, row: at });
        };
        if let Some(port) = &self.input {
            offer(Consumer::Input, port, "process");
        }
        if !self.started {
            for (u, unit) in self.initialisers.iter().enumerate() {
                for (i, port) in unit.inputs.iter().enumerate() {
                    offer(Consumer::Initialiser(u, i), port, &unit.name);
                }
            }
        }
        for (u, unit) in self.stages.iter().enumerate() {
            for (i, port) in unit.inputs.iter().enumerate() {
                offer(Consumer::Stage(u, i), port, &unit.name);
            }
        }
        for (s, sensor) in self.sensors.iter().enumerate() {
            offer(Consumer::Sensor(self.ranks[s], s), &sensor.port, &sensor.name);
        }
        if self.rows.uses[at] == 0 {
            self.rows.free.push(at);
        }
    }

    fn drain(&mut self, until: Time, observer: &mut dyn Observer) {
        while let Some(entry) = self.queue.take(until) {
            self.released = entry.time;
            self.dispatch(entry, observer);
        }
    }

    fn dispatch(&mut self, entry: Entry, observer: &mut dyn Observer) {
        match entry.consumer {
            Consumer::Input => self.input_row(entry.time, entry.row, observer),
            Consumer::Initialiser(unit, input) => self.initialiser_row(unit, input, entry.time, entry.row, observer),
            Consumer::Stage(unit, input) => self.stage_row(unit, input, entry.time, entry.row, observer),
            Consumer::Sensor(_, sensor) => {
                self.sensor_row(sensor, entry.time, entry.row, observer);
                return;
            }
        }
        self.rows.release(entry.row);
    }

    fn initialiser_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) {
        if self.started {
            return;
        }
        let u = &mut self.initialisers[unit];
        u.inputs[input].gather(&self.rows.rows[row], &mut self.value);
        if self.value.iter().all(|v| v.is_finite()) {
            u.initialiser.row(input, time, &self.value);
        }
        self.start_if_ready(time, observer);
    }

    /// Starts at `time` once every initialiser can write; an input-driven process also needs the
    /// sample that opens the first interval.
    fn start_if_ready(&mut self, time: Time, observer: &mut dyn Observer) {
        let driven = self.process.input_dim() == 0 || self.previous.is_some();
        if !self.started && driven && self.initialisers.iter().all(|u| u.initialiser.waits_for().is_none()) {
            self.start(time, observer);
        }
    }

    fn start(&mut self, time: Time, observer: &mut dyn Observer) {
        let mut belief = Belief::initial(self.estimator.layout(), time);
        for u in &self.initialisers {
            u.initialiser.write(time, self.estimator.layout(), &mut belief);
        }
        self.started = true;
        self.start_after = time;
        self.estimator.set_belief(belief);
        observer.on(&Event::Started {
            belief: self.estimator.belief(),
        });
    }

    fn input_row(&mut self, time: Time, row: usize, observer: &mut dyn Observer) {
        if let Some(port) = &self.input {
            port.gather(&self.rows.rows[row], &mut self.value);
        }
        if !self.value.iter().all(|v| v.is_finite()) {
            observer.on(&Event::NotFinite { consumer: "process", time });
            return;
        }
        let last_end = self.held.as_ref().or(self.previous.as_ref()).map(|s| s.end);
        let Some(start) = last_end else {
            // The first sample closes an interval of unknown length: it only opens the next one.
            self.previous = Some(Sample {
                start: time,
                end: time,
                rates: self.value.clone(),
            });
            self.start_if_ready(time, observer);
            return;
        };
        if time <= start {
            observer.on(&Event::Late {
                consumer: "process",
                time,
                now: start,
            });
            return;
        }
        let mut rates = self.spare.pop().unwrap_or_default();
        rates.clone_from(&self.value);
        let sample = Sample { start, end: time, rates };
        match (self.pairs, self.held.take()) {
            (true, None) => self.held = Some(sample),
            (true, Some(first)) => {
                self.advance(&first, &sample, false, observer);
                self.advance(&sample, &first, true, observer);
                self.spare.push(first.rates);
                self.succeed(sample);
            }
            (false, _) => self.run_over(sample, observer),
        }
        self.start_if_ready(time, observer);
    }

    /// Runs over `sample` with the one before it as its neighbour.
    fn run_over(&mut self, sample: Sample, observer: &mut dyn Observer) {
        let previous = self.previous.take().unwrap_or_else(|| sample.clone());
        self.advance(&sample, &previous, true, observer);
        self.previous = Some(previous);
        self.succeed(sample);
    }

    /// Makes `sample` the previous one.
    fn succeed(&mut self, sample: Sample) {
        if let Some(old) = self.previous.replace(sample) {
            self.spare.push(old.rates);
        }
    }

    /// Runs the estimator over `sample`, serving the measurements that lie inside it.
    fn advance(&mut self, sample: &Sample, neighbour: &Sample, neighbour_is_earlier: bool, observer: &mut dyn Observer) {
        if !self.started || sample.end <= self.estimator.belief().time {
            return;
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
            self.predict_under(time, &input, observer);
            self.offer(sensor, time, row, observer);
        }
        self.predict_under(sample.end, &input, observer);
        observer.on(&Event::Predicted {
            belief: self.estimator.belief(),
        });
    }

    fn predict_under(&mut self, to: Time, input: &Input<'_>, observer: &mut dyn Observer) {
        if let Err(error) = self.estimator.predict(to, input) {
            observer.on(&Event::Failed { error });
        }
    }

    /// Predicts beyond the input by holding its last sample, or by time alone.
    fn predict(&mut self, to: Time, observer: &mut dyn Observer) {
        if to <= self.estimator.belief().time {
            return;
        }
        let rates: &[f64] = self.previous.as_ref().map_or(&[], |s| &s.rates);
        if rates.len() < self.process.input_dim() {
            return;
        }
        if let Err(error) = self.estimator.predict(to, &Input::alone(rates)) {
            observer.on(&Event::Failed { error });
        }
    }

    fn stage_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) {
        let u = &mut self.stages[unit];
        u.inputs[input].gather(&self.rows.rows[row], &mut self.value);
        let mut emitter = core::mem::take(&mut self.emitter);
        emitter.clear();
        let view = if self.started { Some(self.estimator.view()) } else { None };
        u.stage.row(input, time, &self.value, view.as_ref(), &mut emitter);
        let output = u.output;
        for (t, row) in emitter.rows() {
            self.enqueue(output, t, row, observer);
        }
        self.emitter = emitter;
    }

    fn sensor_row(&mut self, sensor: usize, time: Time, row: usize, observer: &mut dyn Observer) {
        if self.process.input_dim() == 0 {
            self.start_if_ready(time, observer);
        }
        // What started the filter is not used a second time.
        if !self.started || time <= self.start_after {
            self.rows.release(row);
            return;
        }
        if self.process.input_dim() == 0 {
            self.predict(time, observer);
            self.offer(sensor, time, row, observer);
            observer.on(&Event::Predicted {
                belief: self.estimator.belief(),
            });
        } else if time <= self.estimator.belief().time {
            self.offer(sensor, time, row, observer);
        } else {
            self.waiting.push_back((time, sensor, row));
        }
    }

    /// Offers a row to the estimator, which stands at its time, and releases the row.
    fn offer(&mut self, sensor: usize, time: Time, row: usize, observer: &mut dyn Observer) {
        let s = &mut self.sensors[sensor];
        let m = s.model.size().residual;
        let data = &self.rows.rows[row];
        if s.port.columns.is_empty() {
            self.value.clone_from(&s.constant);
        } else {
            s.port.gather(data, &mut self.value);
        }
        let noise = &mut self.noise[..m * m];
        s.noise.fill(data, noise);
        if time < self.estimator.belief().time {
            observer.on(&Event::Late {
                consumer: &s.name,
                time,
                now: self.estimator.belief().time,
            });
        } else if !self.value.iter().chain(noise.iter()).all(|v| v.is_finite()) {
            observer.on(&Event::NotFinite { consumer: &s.name, time });
        } else {
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
            observer.on(&Event::Updated { sensor, update, time });
        }
        self.rows.release(row);
    }
}

#[cfg(test)]
mod tests;
