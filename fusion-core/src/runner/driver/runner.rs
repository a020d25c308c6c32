//! The parts of a runner, their declaration, and questions about them.

use super::memory::Detour;
use super::rewind::Rewind;
use crate::belief::Belief;
use crate::filter::Estimator;
use crate::health::{Health, Limits, Monitor, Watched};
use crate::model::Process;
use crate::runner::consumer::{Consumer, Delays, PROCESS, Route};
use crate::runner::input::Intake;
use crate::runner::queue::Queue;
use crate::runner::scheduler::Scheduler;
use crate::runner::{InitialiserUnit, InputLimits, Port, RewindNeeds, Rewinds, Sensor, StageUnit, StreamId, Tested};
use crate::time::nanos;
use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Merges streams in time and drives an estimator.
///
/// Its memory can be saved. Restored into a runner with the same parts, it continues bit for bit.
#[derive(Debug)]
pub struct Runner {
    pub(super) queue: Queue,
    pub(super) intake: Intake,
    pub(super) scheduler: Scheduler,
    pub(super) rewind: Option<Box<Rewind>>,
    /// `None` before the first row, and while a row is processed.
    pub(super) monitor: Option<Box<Monitor>>,
    pub(super) detour: Detour,
    limits: Limits,
    process: Arc<dyn Process>,
}

/// Declarations, before the first row.
impl Runner {
    /// A runner of `estimator`, whose process is `process`; rows may arrive up to `buffer`
    /// seconds out of order.
    #[must_use]
    pub fn new(estimator: Box<dyn Estimator>, process: Arc<dyn Process>, buffer: f64) -> Self {
        Self {
            queue: Queue::new(nanos(buffer.max(0.0))),
            intake: Intake::none(),
            scheduler: Scheduler::new(estimator, process.input_dim()),
            rewind: None,
            monitor: None,
            detour: Detour::default(),
            limits: Limits::DEFAULT,
            process,
        }
    }

    /// Adds a stream of rows of `width` numbers and returns its number.
    pub fn add_stream(&mut self, name: &str, width: usize) -> StreamId {
        self.queue.add_stream(name, width)
    }

    /// Sets the stream that drives the process.
    pub fn set_input(&mut self, port: Port) {
        self.intake = Intake::new(port, self.process.as_ref());
        self.connect();
    }

    /// Sets the limits of the input; call it after [`Runner::set_input`].
    pub fn limit_input(&mut self, limits: InputLimits) {
        self.intake.limit(limits);
    }

    /// If all rows are silent for more than `seconds`, a filter without input starts anew by its initialisers and
    /// keeps its calibration.
    pub fn restart_after(&mut self, seconds: f64) {
        self.scheduler.restart_after(seconds);
    }

    /// If the filter has been lost for `seconds`, it starts anew by its initialisers, provided that all of them read
    /// streams.
    pub fn restart_lost(&mut self, seconds: f64) {
        self.scheduler.restart_lost(seconds);
    }

    /// Rows whose stamps are more than `seconds` ahead of all others wait until twenty more confirm them. The limit
    /// is infinite at first. Rows that the next rows do not confirm are discarded.
    pub fn limit_jumps(&mut self, seconds: f64) {
        self.queue.limit_jumps(seconds);
    }

    /// Sets the limits by which the health is judged; to be called before the first row.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Adds a sensor.
    pub fn add_sensor(&mut self, sensor: Sensor) {
        self.scheduler.add_sensor(sensor);
        self.connect();
    }

    /// Adds a stage.
    pub fn add_stage(&mut self, stage: StageUnit) {
        let width = self.queue.width(stage.output);
        self.scheduler.add_stage(stage, width);
        self.connect();
    }

    /// Adds an initialiser; without any, the filter starts at its first row.
    pub fn add_initialiser(&mut self, unit: InitialiserUnit) {
        self.scheduler.add_initialiser(unit);
        self.connect();
    }

    /// Makes this runner use rows as they arrive from now on. It holds them back by `horizon` seconds more and
    /// reports the final events. `live` uses them at once, and returns to a snapshot for a row that is valid earlier;
    /// there is a snapshot every `spacing` seconds. `live` needs the same parts as this runner, and both must have
    /// seen no row.
    pub fn rewind(&mut self, mut live: Self, horizon: f64, spacing: f64) {
        live.queue.use_at_once();
        self.queue.hold_longer(horizon);
        self.rewind = Some(Box::new(Rewind::new(live, spacing, self.queue.quarantine())));
    }

    /// Passes the consumers and their delays on to the queue.
    fn connect(&mut self) {
        let input = self.intake.port().map(|port| Route {
            consumer: Consumer::Input,
            port: port.clone(),
            takes_late: false,
        });
        let routes: Vec<Route> = input.into_iter().chain(self.scheduler.routes()).collect();
        let mut delays = Delays {
            longest: routes.iter().map(|route| route.port.delay).max().unwrap_or(0).max(0),
            input: self.intake.port().map_or(0, |port| port.delay),
            ..Delays::default()
        };
        self.scheduler.follow(&mut delays);
        self.intake.keep_window(delays.are_estimated);
        self.queue.connect(routes, delays);
    }

    /// The monitor of its health.
    pub(super) fn new_monitor(&self) -> Monitor {
        let (sensors, stages) = (self.sensors(), self.scheduler.stages());
        let is_outside = |stream| stages.iter().all(|s| s.output != stream);
        let watched = sensors.iter().map(|s| Watched {
            rows: s.model.size().residual,
            is_outside: is_outside(s.port.stream),
        });
        let is_read = |stream: &usize| stages.iter().flat_map(|s| &s.inputs).any(|port| port.stream == *stream);
        let is_heard = |stream: &usize| sensors.iter().any(|s| s.port.stream == *stream);
        let is_input = |stream: &usize| self.intake.port().is_some_and(|port| port.stream == *stream);
        let streams = 0..self.streams().count();
        let silent = streams.filter(|s| is_outside(*s) && is_read(s) && !is_heard(s) && !is_input(s));
        let limits = if self.estimator().keeps_covariance() {
            self.limits
        } else {
            self.limits.without_sigma()
        };
        Monitor::new(limits, self.estimator().layout(), watched, silent)
    }
}

/// Declared parts.
impl Runner {
    /// The number of the stream `name`.
    #[must_use]
    pub fn stream(&self, name: &str) -> Option<StreamId> {
        self.streams().position(|(stream, _)| stream == name)
    }

    /// Name and width of the streams, in order of their numbers.
    pub fn streams(&self) -> impl Iterator<Item = (&str, usize)> {
        self.queue.streams()
    }

    /// The consumers whose rows cause no event, the process, the stages and the switches of sensors: name of the
    /// consumer, number and stream of each input. A switch is input 1 of its sensor.
    pub fn takers(&self) -> impl Iterator<Item = (&str, usize, StreamId)> {
        let process = self.intake.port().into_iter().map(|port| (PROCESS, 0, port.stream));
        let stages = self.scheduler.stages().iter().flat_map(|unit| ports(&unit.name, &unit.inputs));
        let switches = self.sensors().iter().filter_map(|sensor| {
            let switch = sensor.switch.as_ref()?;
            Some((sensor.name.as_str(), 1, switch.port.stream))
        });
        process.chain(stages).chain(switches)
    }

    /// The inputs of the initialisers: name of the initialiser, number and stream of each input.
    pub fn starters(&self) -> impl Iterator<Item = (&str, usize, StreamId)> {
        self.scheduler
            .initialisers()
            .iter()
            .flat_map(|unit| ports(&unit.name, &unit.inputs))
    }

    /// The sensors, in order of their numbers.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        self.scheduler.sensors()
    }

    /// The estimator.
    #[must_use]
    pub fn estimator(&self) -> &dyn Estimator {
        self.scheduler.estimator()
    }

    /// The limits by which the health is judged.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// How long rows are held back \[s\]: the buffer plus the longest declared delay, and the additional time that
    /// followers need.
    #[must_use]
    pub fn lag(&self) -> f64 {
        self.queue.lag() as f64 * 1e-9
    }

    /// The most resources that going back needs, if rows are used as they arrive.
    pub fn rewind_needs(&mut self) -> Option<RewindNeeds> {
        let deepest = self.lag();
        self.rewind.as_mut().map(|rewind| rewind.needs(deepest))
    }
}

/// How far it is.
impl Runner {
    /// The runner with the newest belief: the live runner if rows are used as they arrive.
    #[must_use]
    pub fn newest(&self) -> &Self {
        self.rewind.as_ref().map_or(self, |rewind| rewind.live())
    }

    /// The live runner, which needs the same parts as this runner.
    pub fn live_mut(&mut self) -> Option<&mut Self> {
        self.rewind.as_mut().map(|rewind| rewind.live_mut())
    }

    /// The newest belief; meaningful once [`Runner::started`].
    #[must_use]
    pub fn belief(&self) -> &Belief {
        self.newest().scheduler.belief()
    }

    /// Whether the filter has started.
    #[must_use]
    pub fn started(&self) -> bool {
        self.newest().scheduler.is_running()
    }

    /// The data that the filter, and the filters inside its stages, still wait for before they can start.
    #[must_use]
    pub fn waits_for(&self) -> Vec<(String, String)> {
        let newest = &self.newest().scheduler;
        let pending = newest.initialisers().iter();
        let pending = pending.filter_map(|u| u.initialiser.waits_for().map(|why| (u.name.clone(), why)));
        let inside = newest.stages().iter().flat_map(|unit| {
            let waiting = unit.stage.waits_for().into_iter();
            waiting.map(|(name, why)| (format!("{}.{name}", unit.name), why))
        });
        pending.chain(inside).collect()
    }

    /// The outcome of the tests of its stages, by name.
    #[must_use]
    pub fn tested(&self) -> Vec<(String, Tested)> {
        let stages = self.newest().scheduler.stages().iter();
        stages.filter_map(|unit| Some((unit.name.clone(), unit.stage.tested()?))).collect()
    }

    /// The health of the filter, by the newest belief.
    #[must_use]
    pub fn health(&self) -> &Health {
        static UNKNOWN: Health = Health::UNKNOWN;
        self.newest().monitor.as_ref().map_or(&UNKNOWN, |monitor| monitor.health())
    }

    /// How often it went back, if rows are used as they arrive.
    #[must_use]
    pub fn rewinds(&self) -> Option<Rewinds> {
        self.rewind.as_ref().map(|rewind| rewind.count())
    }

    /// The queue of its rows.
    pub(in crate::runner) const fn queue(&self) -> &Queue {
        &self.queue
    }

    /// Notes the newest stamp of all streams.
    pub(in crate::runner) fn note(&mut self, stamp: crate::time::Time) {
        self.queue.note(stamp);
    }

    /// The scheduler of its filter.
    pub(in crate::runner) const fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// The estimator, whose view needs memory.
    pub(in crate::runner) fn estimator_mut(&mut self) -> &mut dyn Estimator {
        self.scheduler.estimator_mut()
    }
}

fn ports<'a>(name: &'a str, inputs: &'a [Port]) -> impl Iterator<Item = (&'a str, usize, StreamId)> {
    let inputs = inputs.iter().enumerate();
    inputs.map(move |(input, port)| (name, input, port.stream))
}
