//! The runner itself: its parts, and the order of rows in time.

use super::ahead::Ahead;
use super::expectation::Expectation;
use super::intake::Intake;
use super::offset::Window;
use super::parts::Emitted;
use super::quarantine::{Admission, Held, Quarantine};
use super::realign::Realign;
use super::restart::Restart;
use super::rewind::Rewind;
use super::rows::{Consumer, Entry, Queue, Row, Rows};
use super::{
    Discard, Event, Halt, InitialiserUnit, InputLimits, Observer, Port, RowId, RunError, Sensor, StageUnit, StreamId, Tested, WrongWidth,
};
use crate::belief::Belief;
use crate::filter::Estimator;
use crate::gate::Outcome;
use crate::health::{Limits, Monitor};
use crate::memory::save;
use crate::model::Process;
use crate::time::{Time, nanos};
use std::collections::VecDeque;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub(super) struct Stream {
    name: String,
    pub(super) width: usize,
}

/// The name of the process as a consumer of rows.
pub(super) const PROCESS: &str = "process";

/// A measurement that waits for the input sample that covers it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Waiting {
    pub(super) time: Time,
    pub(super) sensor: usize,
    pub(super) row: usize,
}
crate::memory!(Waiting { time, sensor, row });

/// Merges streams in time and drives an estimator.
///
/// Its memory can be saved. Restored into a runner with the same parts, it continues bit for bit.
#[derive(Debug)]
pub struct Runner {
    pub(super) streams: Vec<Stream>,
    pub(super) input: Option<Intake>,
    pub(super) sensors: Vec<Sensor>,
    /// By sensor: the length of its chain of leaders, including itself. At the same time, lower ranks are served
    /// first.
    pub(super) ranks: Vec<usize>,
    /// By sensor: the outcome of its latest measurement.
    pub(super) outcomes: Vec<Option<Outcome>>,
    pub(super) stages: Vec<StageUnit>,
    pub(super) initialisers: Vec<InitialiserUnit>,
    /// The memory of the initialisers when they were added, for another start.
    pub(super) pristine: Vec<u8>,
    /// The belief before the filter stopped.
    pub(super) last: Option<Belief>,
    /// The restart of a filter that is lost.
    pub(super) restart: Restart,
    /// Whether the attitude is to be found again.
    pub(super) realign: Realign,
    pub(super) quarantine: Quarantine,
    /// How far the input is, compared with the other rows.
    pub(super) ahead_of_input: Ahead,
    pub(super) buffer: i64,
    pub(super) lag: i64,
    /// How far beyond the served time all rows of the process input are present, for any order of arrival \[ns\].
    pub(super) foreknown: i64,
    /// How far ahead of the served time rows may be looked at \[ns\].
    pub(super) foresight: i64,
    /// Whether rows are used as they arrive.
    pub(super) is_live: bool,
    pub(super) rewind: Option<Box<Rewind>>,
    pub(super) queue: Queue,
    pub(super) rows: Rows,
    pub(super) watermark: Time,
    pub(super) released: Time,
    /// The consumer that was served last, at that time.
    pub(super) serving: Consumer,
    /// The time up to which rows have been looked at.
    pub(super) seen: Time,
    pub(super) started: bool,
    pub(super) start_after: Time,
    /// In order.
    pub(super) waiting: VecDeque<Waiting>,
    /// The latest input, for sensors whose time offset is estimated.
    pub(super) window: Window,
    /// The input as it was expected, for gaps and for sensors that read its signals.
    pub(super) expectation: Expectation,
    pub(super) emitted: Emitted,
    /// Rows that each stage has emitted so far.
    pub(super) emissions: Vec<u64>,
    /// The epoch whose estimate has not been reported yet.
    pub(super) epoch: Option<Time>,
    keeps_steps: bool,
    /// Whether it looks ahead, and its memory before that.
    pub(super) is_ahead: bool,
    pub(super) before: Vec<u8>,
    pub(super) value: Vec<f64>,
    pub(super) noise: Vec<f64>,
    pub(super) process: Arc<dyn Process>,
    pub(super) estimator: Box<dyn Estimator>,
    pub(super) limits: Limits,
    /// The longest silence that a process without input predicts through \[ns\].
    pub(super) longest_silence: Option<i64>,
    /// `None` before the first row, and while a row is processed.
    pub(super) monitor: Option<Box<Monitor>>,
}

impl Runner {
    /// A runner of `estimator`, whose process is `process`; rows may arrive up to `buffer`
    /// seconds out of order.
    #[must_use]
    pub fn new(estimator: Box<dyn Estimator>, process: Arc<dyn Process>, buffer: f64) -> Self {
        let buffer = nanos(buffer.max(0.0));
        Self {
            streams: Vec::new(),
            input: None,
            sensors: Vec::new(),
            ranks: Vec::new(),
            outcomes: Vec::new(),
            stages: Vec::new(),
            initialisers: Vec::new(),
            pristine: Vec::new(),
            last: None,
            restart: Restart::default(),
            realign: Realign::default(),
            quarantine: Quarantine::new(f64::INFINITY),
            ahead_of_input: Ahead::default(),
            buffer,
            lag: buffer,
            foreknown: 0,
            foresight: 0,
            is_live: false,
            rewind: None,
            queue: Queue::new(),
            rows: Rows::default(),
            watermark: Time::MIN,
            released: Time::MIN,
            serving: Consumer::Input,
            seen: Time::MIN,
            started: false,
            start_after: Time::MIN,
            waiting: VecDeque::with_capacity(64),
            window: Window::default(),
            expectation: Expectation::default(),
            emitted: Emitted::default(),
            emissions: Vec::new(),
            epoch: None,
            keeps_steps: false,
            is_ahead: false,
            before: Vec::new(),
            value: Vec::new(),
            noise: Vec::new(),
            process,
            estimator,
            limits: Limits::DEFAULT,
            longest_silence: None,
            monitor: None,
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

    /// Sets the stream that drives the process.
    pub fn set_input(&mut self, port: Port) {
        self.input = Some(Intake::new(port, self.process.preparation()));
        self.hold_back();
    }

    /// Sets the limits of the input; call it after [`Runner::set_input`].
    pub fn limit_input(&mut self, limits: InputLimits) {
        if let Some(input) = &mut self.input {
            input.limit(limits);
        }
    }

    /// If all rows are silent for more than `seconds`, a filter without input starts anew by its initialisers and
    /// keeps its calibration.
    pub fn restart_after(&mut self, seconds: f64) {
        self.longest_silence = Some(nanos(seconds));
    }

    /// Rows whose stamps are more than `seconds` ahead of all others wait until twenty more confirm them. The limit
    /// is infinite at first. Rows that the next rows do not confirm are discarded.
    pub fn limit_jumps(&mut self, seconds: f64) {
        self.quarantine = Quarantine::new(seconds);
    }

    /// Adds a sensor.
    pub fn add_sensor(&mut self, sensor: Sensor) {
        let m = sensor.model.size().residual;
        if self.noise.len() < m * m {
            self.noise.resize(m * m, 0.0);
        }
        self.sensors.push(sensor);
        self.outcomes.push(None);
        self.rank_sensors();
        self.hold_back();
    }

    /// Adds a stage.
    pub fn add_stage(&mut self, stage: StageUnit) {
        self.stages.push(stage);
        self.emissions.push(0);
        self.hold_back();
    }

    /// Adds an initialiser; without any, the filter starts at its first row.
    pub fn add_initialiser(&mut self, unit: InitialiserUnit) {
        let mut unit = unit;
        save(&mut unit.initialiser, &mut self.pristine);
        self.initialisers.push(unit);
        self.hold_back();
    }

    /// The leader of sensor number `s`.
    fn leader(&self, s: usize) -> Option<usize> {
        self.sensors[s].gate.leader().filter(|&leader| leader < self.sensors.len())
    }

    /// Ranks followers after their leaders.
    fn rank_sensors(&mut self) {
        let all = self.sensors.len();
        // `take` ends a cycle.
        let rank = |s| core::iter::successors(Some(s), |&s| self.leader(s)).take(all).count();
        self.ranks = (0..all).map(rank).collect();
    }

    /// How long rows are held back: the buffer, the longest delay, and the time that followers need.
    ///
    /// If a follower is on another stream than its leader, all rows of one stamp must be present before the first is
    /// used. So rows are held back until a later row comes. If a follower on the same stream is valid before its
    /// leader, all rows up to the leader's validity must be present, to look ahead.
    pub(super) fn hold_back(&mut self) {
        let input = self.input.iter().map(|input| &input.port);
        let sensors = self.sensors.iter().map(|s| &s.port);
        let others = self.stages.iter().flat_map(|s| &s.inputs);
        let others = others.chain(self.initialisers.iter().flat_map(|u| &u.inputs));
        let delay = input.chain(sensors).chain(others).map(|port| port.delay).max().unwrap_or(0).max(0);
        let (mut apart, mut ahead) = (0, 0);
        for (s, sensor) in self.sensors.iter().enumerate() {
            let Some(leader) = self.leader(s).map(|leader| &self.sensors[leader]) else {
                continue;
            };
            if leader.port.stream == sensor.port.stream {
                ahead = ahead.max(sensor.port.delay - leader.least_delay());
            } else {
                apart = 1;
            }
        }
        let input = self.input.as_ref().map_or(0, |input| input.port.delay);
        self.foreknown = (delay + ahead - input - 1).max(0);
        let looks = ahead > 0 || self.sensors.iter().any(|s| s.offset.is_some());
        self.foresight = if looks { delay + 2 * ahead } else { 0 };
        self.lag = if self.is_live {
            self.buffer + input
        } else {
            self.buffer.max(apart) + delay + ahead
        };
    }

    /// The consumers whose rows cause no event, the process and the stages: name of the consumer, number and stream
    /// of each input.
    pub fn takers(&self) -> impl Iterator<Item = (&str, usize, StreamId)> {
        let process = self.input.iter().map(|input| (PROCESS, 0, input.port.stream));
        process.chain(self.stages.iter().flat_map(|unit| ports(&unit.name, &unit.inputs)))
    }

    /// The inputs of the initialisers: name of the initialiser, number and stream of each input.
    pub fn starters(&self) -> impl Iterator<Item = (&str, usize, StreamId)> {
        self.initialisers.iter().flat_map(|unit| ports(&unit.name, &unit.inputs))
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

    /// The newest belief; meaningful once [`Runner::started`].
    #[must_use]
    pub fn belief(&self) -> &Belief {
        self.newest().estimator.belief()
    }

    /// Whether the filter has started.
    #[must_use]
    pub fn started(&self) -> bool {
        self.newest().started
    }

    /// The data that the filter, and the filters inside its stages, still wait for before they can start.
    #[must_use]
    pub fn waits_for(&self) -> Vec<(String, String)> {
        let newest = self.newest();
        let pending = newest.initialisers.iter();
        let pending = pending.filter_map(|u| u.initialiser.waits_for().map(|why| (u.name.clone(), why)));
        let inside = newest.stages.iter().flat_map(|unit| {
            let waiting = unit.stage.waits_for().into_iter();
            waiting.map(|(name, why)| (format!("{}.{name}", unit.name), why))
        });
        pending.chain(inside).collect()
    }

    /// The outcome of the tests of its stages, by name.
    #[must_use]
    pub fn tested(&self) -> Vec<(String, Tested)> {
        let stages = self.newest().stages.iter();
        stages.filter_map(|unit| Some((unit.name.clone(), unit.stage.tested()?))).collect()
    }

    /// How long rows are held back \[s\]: the buffer plus the longest declared delay, and the additional time that
    /// followers need.
    #[must_use]
    pub fn lag(&self) -> f64 {
        self.lag as f64 * 1e-9
    }

    /// Takes a row and processes everything it completes.
    pub(super) fn take_row(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        let (wanted, found) = (self.streams.get(row.stream).map_or(0, |s| s.width), row.values.len());
        if found != wanted {
            return Err(WrongWidth { wanted, found }.into());
        }
        self.listen(observer);
        let admission = self.quarantine.admit(row, self.watermark);
        match admission {
            Admission::Use | Admission::Replaces => self.settle_jump(false, observer)?,
            Admission::Confirms => self.settle_jump(true, observer)?,
            Admission::Wait => {}
        }
        if matches!(admission, Admission::Wait | Admission::Replaces) {
            self.quarantine.hold(row);
            return Ok(());
        }
        Ok(self.admit(row, observer)?)
    }

    /// Uses the rows that wait for others to confirm their stamps, or discards them.
    fn settle_jump(&mut self, are_used: bool, observer: &mut dyn Observer) -> Result<(), Halt> {
        while let Some(held) = self.quarantine.release() {
            if are_used {
                self.admit(&held.row(), observer)?;
            } else {
                self.refuse(&held, observer)?;
            }
            self.quarantine.give_back(held);
        }
        Ok(())
    }

    fn admit(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.watermark = self.watermark.max(row.time);
        self.enqueue(row, self.watermark, Time::MIN, observer)?;
        let reach = self.reach(row, observer)?;
        self.drain(reach.shifted(-self.lag), observer)
    }

    /// The stamp up to which rows are processed, `row` being the newest: rows ahead of the input wait.
    fn reach(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<Time, Halt> {
        let Some(input) = &self.input else {
            return Ok(self.watermark);
        };
        let longest = input.longest();
        if row.stream != input.port.stream {
            self.ahead_of_input.other(row);
        } else if let Some((stream, by)) = self.ahead_of_input.input(row, longest) {
            observer.on(&Event::Ahead {
                stream,
                by,
                time: row.time,
            })?;
        }
        Ok(self.watermark.min(self.ahead_of_input.reach(longest)))
    }

    /// Discards a row whose stamp no other has confirmed, for all its consumers.
    fn refuse(&mut self, held: &Held, observer: &mut dyn Observer) -> Result<(), Halt> {
        let row = held.row();
        let (now, arrival) = (self.watermark, self.watermark);
        let is_running = self.started;
        self.consumers().each(row.stream, |taker, port, consumer| {
            if is_running && taker.is_initialiser() {
                return Ok(());
            }
            observer.on(&Event::Discarded {
                consumer,
                input: taker.input(),
                time: row.time.shifted(-port.delay),
                row: RowId::of(&row, arrival, &port.columns),
                why: Discard::TimeJump { now },
            })
        })
    }

    /// Processes everything that has been held back: the end of the log.
    pub(super) fn take_end(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.listen(observer);
        self.settle_jump(false, observer)?;
        self.drain(Time::MAX, observer)?;
        self.settle_suspects(false, observer)?;
        self.finish_stages(observer)?;
        self.serve_waiting(observer)?;
        self.tell_epoch(observer)
    }

    /// Keeps steps if the observer wants them.
    fn listen(&mut self, observer: &dyn Observer) {
        let wanted = observer.wants_steps();
        if wanted != self.keeps_steps {
            self.keeps_steps = wanted;
            self.estimator.keep_steps(wanted);
        }
    }

    /// Puts a row that came at `arrival` into the queue, once for each consumer. It is late if it is valid before the
    /// last served time, or before `from`.
    pub(super) fn enqueue(&mut self, row: &Row<'_>, arrival: Time, from: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let at = self.rows.put(row, arrival);
        let released = self.released.max(from);
        let is_emitted = self.stages.iter().any(|stage| stage.output == row.stream);
        let (rows, queue, is_running) = (&mut self.rows, &mut self.queue, self.started);
        let consumers = Consumers {
            input: self.input.as_ref(),
            initialisers: &self.initialisers,
            stages: &self.stages,
            sensors: &self.sensors,
            ranks: &self.ranks,
        };
        let offered = consumers.each(row.stream, |consumer, port, name| {
            let mut time = row.time.shifted(-port.delay);
            if is_emitted && matches!(consumer, Consumer::Aim(_)) {
                time = time.max(released);
            }
            if time < released {
                // Initialisers of a running filter do not miss a row.
                if is_running && consumer.is_initialiser() {
                    return Ok(());
                }
                let (row, why) = (rows.get(at).id(&port.columns), Discard::Late { now: released });
                return observer.on(&Event::Discarded {
                    consumer: name,
                    input: consumer.input(),
                    time,
                    row,
                    why,
                });
            }
            rows.hold(at);
            queue.put(Entry { time, consumer, row: at });
            Ok(())
        });
        self.rows.free_unused(at);
        offered
    }

    /// The time at which `row` is valid, for each of its consumers.
    pub(super) fn each_validity(&self, row: &Row<'_>, mut each: impl FnMut(Time, Consumer)) {
        let told = self.consumers().each(row.stream, |consumer, port, _| {
            each(row.time.shifted(-port.delay), consumer);
            Ok(())
        });
        // Nothing here can stop the run.
        told.unwrap_or_default();
    }

    /// The consumers of rows. The initialisers of a running filter do not use rows, but may have to start it again by
    /// the time that the rows are served.
    fn consumers(&self) -> Consumers<'_> {
        Consumers {
            input: self.input.as_ref(),
            initialisers: &self.initialisers,
            stages: &self.stages,
            sensors: &self.sensors,
            ranks: &self.ranks,
        }
    }

    /// Serves the queue up to `until`.
    pub(super) fn drain(&mut self, until: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        loop {
            let next = self.queue.first().map(|e| e.time).filter(|time| *time <= until);
            let horizon = next.unwrap_or(until.min(self.watermark));
            if self.coast_before(horizon, observer)? {
                // Stages may have emitted earlier rows.
                continue;
            }
            let Some(entry) = next.and_then(|_| self.queue.take()) else {
                return Ok(());
            };
            (self.released, self.serving) = (entry.time, entry.consumer);
            self.begin_recording(entry.time, observer)?;
            if self.epoch.is_some_and(|epoch| epoch < entry.time) {
                self.tell_epoch(observer)?;
            }
            self.dispatch(entry, observer)?;
            self.follow_health(observer)?;
        }
    }
}

fn ports<'a>(name: &'a str, inputs: &'a [Port]) -> impl Iterator<Item = (&'a str, usize, StreamId)> {
    let inputs = inputs.iter().enumerate();
    inputs.map(move |(input, port)| (name, input, port.stream))
}

/// The consumers of rows.
struct Consumers<'a> {
    input: Option<&'a Intake>,
    initialisers: &'a [InitialiserUnit],
    stages: &'a [StageUnit],
    sensors: &'a [Sensor],
    ranks: &'a [usize],
}

impl Consumers<'_> {
    /// Calls `offer` for every consumer that listens to `stream`, with port and name.
    fn each(&self, stream: StreamId, mut offer: impl FnMut(Consumer, &Port, &str) -> Result<(), Halt>) -> Result<(), Halt> {
        let mut offer = |consumer, port: &Port, name: &str| {
            if port.stream == stream {
                offer(consumer, port, name)
            } else {
                Ok(())
            }
        };
        if let Some(input) = self.input {
            offer(Consumer::Input, &input.port, PROCESS)?;
        }
        for (u, unit) in self.initialisers.iter().enumerate() {
            for (i, port) in unit.inputs.iter().enumerate() {
                offer(Consumer::Initialiser(u, i), port, &unit.name)?;
            }
        }
        for (u, unit) in self.stages.iter().enumerate() {
            for (i, port) in unit.inputs.iter().enumerate() {
                offer(Consumer::Stage(u, i), port, &unit.name)?;
            }
        }
        for (s, sensor) in self.sensors.iter().enumerate() {
            let consumer = match sensor.offset {
                Some(_) => Consumer::Aim(s),
                None => Consumer::Sensor(self.ranks[s], s),
            };
            offer(consumer, &sensor.port, &sensor.name)?;
        }
        Ok(())
    }
}
