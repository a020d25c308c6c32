//! The simulator: from a world to rows in order of their stamps.
//!
//! At each instant at which a stream has a row the world is advanced to exactly that instant, the
//! true state is written into the layout of the filter, and the sensor's own h(x) is evaluated
//! there. A row stamped later than it is valid waits in a queue, so memory is bounded by the
//! longest delay, not by the length of the run.
//!
//! Streams  `imu`, one per sensor, `reference`. All but the reference carry errors
//! x_true   blocks named `position` (geodetic or local), `local_position`, `velocity`,
//!          `attitude`, `heading`, `speed`, `yaw_rate` from the world, `gyro_bias` and
//!          `accel_bias` from the simulated unit; every other block at its declared initial
//!          value, or drawn about it and moved by its own dynamics (`draw_parameters`)
//! Signals  from the process's own `signals` at x_true, its input being the true rates plus the
//!          true biases where those are states
//! Not here inputs other than an inertial unit; faults and dropouts (they act on rows)

use super::imu_error::ImuError;
use super::inverse::{self, Correction, Sample, before_correction, pair_before_correction};
use super::noise::SensorError;
use super::random::Random;
use super::spec::SimulationSpec;
use super::world::{OpenLoop, Truth, World};
use crate::block::{BuildError, Channel, Shape};
use crate::earth::{Gravity, LocalEarth, LocalFrame};
use crate::process::strapdown::mechanisation::Nav;
use crate::units::{Dimension, Dimensional, dim};
use core::cmp::Reverse;
use fusion_core::Time;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Input, Measurement, Process, SignalBuffer};
use fusion_core::state::{Angle, Attitude, Block, Dynamics, Kind, Layout, Manifold, Position, Scalar, Slot, Vector, Velocity};
use fusion_core::time::nanos;
use std::borrow::Cow;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// A sensor to simulate.
#[derive(Clone, Debug)]
pub struct SimulatedSensor {
    /// Its name, which is that of its stream.
    pub name: String,
    /// Its model.
    pub model: Arc<dyn Measurement>,
    /// The channel its value is.
    pub channel: Channel,
    /// The dimension of each residual row.
    pub rows: Vec<Dimension>,
    /// Seconds by which its rows are valid before their stamp.
    pub delay: f64,
}

/// What a run is simulated for.
#[derive(Debug)]
pub struct Setup<'a> {
    /// The state of the filter.
    pub layout: &'a Layout,
    /// Its process, for the signals.
    pub process: Arc<dyn Process>,
    /// What an input sample of the process consists of.
    pub input: &'a [Channel],
    /// Origin of the local coordinates.
    pub origin: Geodetic,
    /// The gravity model.
    pub gravity: Gravity,
    /// The sensors; those that read a constant are not simulated and do not belong here.
    pub sensors: Vec<SimulatedSensor>,
}

/// A stream of simulated rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimulatedStream {
    /// `imu`, `reference`, or the name of a sensor.
    pub name: String,
    /// What its rows consist of.
    pub channels: Vec<Channel>,
}

/// Numbers in a row of the reference stream.
const REFERENCE: usize = 10;

/// Produces the rows of a run, one after the other.
#[derive(Debug)]
pub struct Simulator {
    streams: Vec<SimulatedStream>,
    clocks: Vec<Clock>,
    world: Box<dyn World>,
    end: Time,
    truth: TrueState,
    imu: Option<Imu>,
    sensors: Vec<Sensor>,
    queue: BinaryHeap<Reverse<Row>>,
    spare: Vec<Vec<f64>>,
    sequence: u64,
    /// By how much a row may be stamped before it is valid \[ns\], 0 or negative.
    least_delay: i64,
    reference_state: Vec<f64>,
}

/// Who has a row next, and when.
#[derive(Clone, Debug)]
struct Clock {
    source: Source,
    rate: f64,
    start: i64,
    count: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Imu,
    Sensor(usize),
    Reference,
}

impl Clock {
    fn new(source: Source, rate: f64) -> Self {
        Self { source, rate, start: 0, count: 0 }
    }

    /// Counted, not added up: the millionth instant is as exact as the first.
    fn next(&self) -> Time {
        Time::from_nanos(self.start).shifted(nanos(self.count as f64 / self.rate))
    }
}

/// A row that waits for its turn: by stamp, then stream, then order of making.
#[derive(Debug, PartialEq)]
struct Row {
    stamp: Time,
    stream: usize,
    sequence: u64,
    data: Vec<f64>,
}

impl Eq for Row {}

impl Ord for Row {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        (self.stamp, self.stream, self.sequence).cmp(&(other.stamp, other.stream, other.sequence))
    }
}

impl PartialOrd for Row {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

#[derive(Debug)]
struct Sensor {
    model: Arc<dyn Measurement>,
    error: SensorError,
    delay: i64,
    stream: usize,
}

/// The inertial unit between two of its samples.
#[derive(Debug)]
struct Imu {
    error: ImuError,
    correction: Correction,
    gravity: Gravity,
    period: f64,
    last: Option<(Time, Nav)>,
    /// The sample before, free of errors, and the length of its interval \[s\].
    previous: (Sample, f64),
    /// The first of a pair: stamp, wanted sample, length.
    held: Option<(Time, Sample, f64)>,
}

impl Simulator {
    /// A run in open loop along the trajectory of `spec`; `seed` is usually that of `spec`.
    ///
    /// # Errors
    /// [`BuildError`] whose field is within `[simulation]`.
    pub fn new(spec: &SimulationSpec, setup: Setup<'_>, seed: u64) -> Result<Self, BuildError> {
        let world = Box::new(OpenLoop::new(spec.trajectory()?, setup.origin, setup.gravity));
        Self::in_world(world, spec, setup, seed)
    }

    /// A run in a world of its own kind; the trajectory of `spec` is not looked at.
    ///
    /// # Errors
    /// [`BuildError`] whose field is within `[simulation]`.
    pub fn in_world(world: Box<dyn World>, spec: &SimulationSpec, setup: Setup<'_>, seed: u64) -> Result<Self, BuildError> {
        let unknown = spec.sensor.keys().find(|name| setup.sensors.iter().all(|s| s.name != **name));
        if let Some(name) = unknown {
            let known = setup.sensors.iter().map(|s| format!("`{}`", s.name)).collect::<Vec<_>>().join(", ");
            let help = format!("sensors to simulate: {known}");
            return Err(BuildError::at(format!("sensor.{name}"), "no sensor of this name takes data").help(help));
        }
        if spec.imu.is_none() && !setup.input.is_empty() {
            let help = "add `imu = { rate = \"100 Hz\", preset = \"hg1700\" }`";
            return Err(BuildError::at("imu", "the process is driven by an inertial unit").help(help));
        }
        let truth = TrueState::new(&setup, spec, seed)?;
        let (mut streams, mut clocks, mut sensors) = (Vec::new(), Vec::new(), Vec::new());
        let mut imu = None;
        if let Some(unit) = &spec.imu {
            let rate = unit.rate.si();
            clocks.push(Clock::new(Source::Imu, rate));
            streams.push(SimulatedStream { name: "imu".to_owned(), channels: imu_channels() });
            imu = Some(Imu {
                error: ImuError::new(unit, seed),
                correction: Correction::of(setup.process.as_ref(), setup.layout.initial()),
                gravity: setup.gravity,
                period: 1.0 / rate,
                last: None,
                previous: (Sample::default(), 0.0),
                held: None,
            });
        }
        for sensor in setup.sensors {
            let Some(simulated) = spec.sensor.get(&sensor.name) else { continue };
            let error = SensorError::new(simulated, &sensor.name, &sensor.rows, seed).map_err(|mut e| {
                e.field = format!("sensor.{}.{}", sensor.name, e.field);
                e
            })?;
            clocks.push(Clock { start: nanos(simulated.start.si()), ..Clock::new(Source::Sensor(sensors.len()), simulated.rate.si()) });
            sensors.push(Sensor { model: sensor.model, error, delay: nanos(sensor.delay), stream: streams.len() });
            streams.push(SimulatedStream { name: sensor.name, channels: vec![sensor.channel] });
        }
        clocks.push(Clock::new(Source::Reference, spec.reference_rate.si()));
        streams.push(SimulatedStream { name: "reference".to_owned(), channels: reference_channels() });
        let mut simulator = Self {
            streams,
            clocks,
            end: world.end(),
            world,
            truth,
            imu,
            least_delay: sensors.iter().map(|s| s.delay).min().unwrap_or(0).min(0),
            sensors,
            queue: BinaryHeap::new(),
            spare: Vec::new(),
            sequence: 0,
            reference_state: setup.layout.initial().to_vec(),
        };
        simulator.refresh();
        Ok(simulator)
    }

    /// The streams; rows name them by their place here.
    #[must_use]
    pub fn streams(&self) -> &[SimulatedStream] {
        &self.streams
    }

    /// What is true at the last instant simulated, which may lie after the last row returned.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        self.world.truth()
    }

    /// The true state, in the layout of the filter, that belongs to the last `reference` row
    /// returned: what a filter's consistency is judged by.
    #[must_use]
    pub fn reference_state(&self) -> &[f64] {
        &self.reference_state
    }

    /// The next row in order of stamps: its stream and its stamp. `None` at the end of the run.
    pub fn next_row(&mut self, out: &mut Vec<f64>) -> Option<(usize, Time)> {
        loop {
            let due = self.clocks.iter().enumerate().min_by_key(|(i, c)| (c.next(), *i)).map(|(i, c)| (i, c.next()));
            let due = due.filter(|(_, time)| *time <= self.end);
            if due.is_none() {
                self.release_held();
            }
            // No row still to be made can be stamped before this.
            let mut safe = due.map_or(Time::MAX, |(_, time)| time.shifted(self.least_delay));
            if let Some((stamp, ..)) = self.imu.as_ref().and_then(|imu| imu.held) {
                safe = safe.min(stamp);
            }
            if self.queue.peek().is_some_and(|Reverse(row)| row.stamp < safe) {
                let Reverse(mut row) = self.queue.pop()?;
                if row.stream + 1 == self.streams.len() {
                    self.reference_state.copy_from_slice(&row.data[REFERENCE..]);
                    row.data.truncate(REFERENCE);
                }
                core::mem::swap(out, &mut row.data);
                self.spare.push(row.data);
                return Some((row.stream, row.stamp));
            }
            let (clock, time) = due?;
            self.clocks[clock].count += 1;
            self.make(self.clocks[clock].source, time);
        }
    }

    /// Makes the row of `source` that is valid at `time`.
    fn make(&mut self, source: Source, time: Time) {
        self.world.advance(time);
        match source {
            Source::Imu => self.make_imu(time),
            Source::Sensor(i) => {
                self.refresh();
                let sensor = &mut self.sensors[i];
                let mut z = self.spare.pop().unwrap_or_default();
                z.clear();
                z.resize(sensor.model.size().value, 0.0);
                let view = self.truth.signals.view(&self.truth.x);
                // Where h is undefined the sensor is silent.
                if sensor.model.predict(&view, &mut z).is_err() {
                    self.spare.push(z);
                    return;
                }
                sensor.error.spoil(sensor.model.as_ref(), time, &mut z);
                let (stamp, stream) = (time.shifted(sensor.delay), sensor.stream);
                self.put(stamp, stream, z);
            }
            Source::Reference => {
                self.refresh();
                let mut data = self.spare.pop().unwrap_or_default();
                let nav = &self.world.truth().nav;
                let (p, v, q) = (nav.position, nav.v_eb_n, so3::canonical(&nav.q_nb));
                data.clear();
                data.extend_from_slice(&[p.lat, p.lon, p.height, v.x, v.y, v.z, q.w, q.i, q.j, q.k]);
                data.extend_from_slice(&self.truth.x);
                if self.imu.is_none() {
                    self.truth.move_parameters(time);
                }
                self.put(time, self.streams.len() - 1, data);
            }
        }
    }

    fn put(&mut self, stamp: Time, stream: usize, data: Vec<f64>) {
        self.sequence += 1;
        self.queue.push(Reverse(Row { stamp, stream, sequence: self.sequence, data }));
    }

    /// Brings the true state up to the world.
    fn refresh(&mut self) {
        let biases = self.imu.as_ref().map_or_else(Sample::default, |imu| imu.error.bias());
        self.truth.fill(self.world.truth(), &biases);
    }

    fn make_imu(&mut self, time: Time) {
        self.truth.move_parameters(time);
        let Some(imu) = &mut self.imu else { return };
        let truth = self.world.truth();
        // The first sample opens the first interval; no step led to it.
        let (wanted, dt) = match imu.last.replace((time, truth.nav)) {
            Some((before, nav)) => {
                let dt = time.seconds_since(before);
                (inverse::sample(&nav, &truth.nav, dt, imu.gravity), dt)
            }
            None => (truth.imu, 0.0),
        };
        match imu.correction {
            Correction::Pairs if dt > 0.0 => match imu.held.take() {
                None => imu.held = Some((time, wanted, dt)),
                Some((stamp, first, first_dt)) => {
                    let [one, two] = pair_before_correction([&first, &wanted], [first_dt, dt]);
                    self.put_imu(stamp, &one, first_dt);
                    self.put_imu(time, &two, dt);
                }
            },
            Correction::Previous if dt > 0.0 => {
                let raw = before_correction(&imu.previous.0, &wanted, imu.previous.1);
                imu.previous = (raw, dt);
                self.put_imu(time, &raw, dt);
            }
            _ => {
                imu.previous = (wanted, 0.0);
                let period = imu.period;
                self.put_imu(time, &wanted, if dt > 0.0 { dt } else { period });
            }
        }
    }

    /// A pair that the end of the run leaves without its second.
    fn release_held(&mut self) {
        if let Some((stamp, wanted, dt)) = self.imu.as_mut().and_then(|imu| imu.held.take()) {
            self.put_imu(stamp, &wanted, dt);
        }
    }

    fn put_imu(&mut self, stamp: Time, raw: &Sample, dt: f64) {
        let Some(imu) = &mut self.imu else { return };
        let measured = imu.error.measure(raw, dt);
        let mut data = self.spare.pop().unwrap_or_default();
        data.clear();
        data.extend_from_slice(measured.rate.as_slice());
        data.extend_from_slice(measured.force.as_slice());
        self.put(stamp, 0, data);
    }
}

fn imu_channels() -> Vec<Channel> {
    vec![
        Channel::vector("angular_rate", 3, dim::AngularRate::KIND.dimension),
        Channel::vector("specific_force", 3, dim::Acceleration::KIND.dimension),
    ]
}

fn reference_channels() -> Vec<Channel> {
    let attitude = Channel { name: Cow::Borrowed("attitude"), width: 4, dimension: Dimension::NONE, shape: Shape::Quaternion };
    vec![Channel::geodetic("position"), Channel::vector("velocity", 3, dim::Speed::KIND.dimension), attitude]
}

/// The true state in the layout of the filter, and the signals there.
#[derive(Debug)]
struct TrueState {
    x: Vec<f64>,
    signals: SignalBuffer,
    process: Arc<dyn Process>,
    input: Vec<InputPart>,
    sample: Vec<f64>,
    frame: LocalFrame,
    known: Vec<Known>,
    parameters: Vec<Parameter>,
    moved: Time,
}

/// A part of the process's input sample.
#[derive(Clone, Copy, Debug)]
enum InputPart {
    Rate,
    Force,
}

/// A block that the world knows the value of.
#[derive(Clone, Copy, Debug)]
enum Known {
    Geodetic(Slot<Geodetic>),
    Local(Slot<Position>),
    Velocity(Slot<Velocity>),
    Attitude(Slot<Attitude>),
    Heading(Slot<Angle>),
    Speed(Slot<Scalar>),
    YawRate(Slot<Scalar>),
    GyroBias(Slot<Vector<3>>),
    AccelBias(Slot<Vector<3>>),
}

impl Known {
    fn of(layout: &Layout, block: &Block) -> Result<Option<Self>, BuildError> {
        fn slot<M: Manifold>(layout: &Layout, name: &str) -> Result<Slot<M>, BuildError> {
            layout.slot(name).map_err(|e| BuildError::new(e.to_string()).help("the simulator does not know this state"))
        }
        let name = block.name.as_str();
        Ok(Some(match (name, block.kind) {
            ("position", Kind::Geodetic) => Self::Geodetic(slot(layout, name)?),
            ("position" | "local_position", _) => Self::Local(slot(layout, name)?),
            ("velocity", _) => Self::Velocity(slot(layout, name)?),
            ("attitude", _) => Self::Attitude(slot(layout, name)?),
            ("heading", _) => Self::Heading(slot(layout, name)?),
            ("speed", _) => Self::Speed(slot(layout, name)?),
            ("yaw_rate", _) => Self::YawRate(slot(layout, name)?),
            ("gyro_bias", _) => Self::GyroBias(slot(layout, name)?),
            ("accel_bias", _) => Self::AccelBias(slot(layout, name)?),
            _ => return Ok(None),
        }))
    }
}

/// A block that its declaration alone tells the value of, moving by itself.
#[derive(Debug)]
struct Parameter {
    kind: Kind,
    storage: core::ops::Range<usize>,
    dynamics: Dynamics,
    random: Random,
}

impl TrueState {
    fn new(setup: &Setup<'_>, spec: &SimulationSpec, seed: u64) -> Result<Self, BuildError> {
        let layout = setup.layout;
        let mut x = layout.initial().to_vec();
        let (mut known, mut parameters) = (Vec::new(), Vec::new());
        for block in layout.blocks() {
            if let Some(k) = Known::of(layout, block)? {
                known.push(k);
            } else if spec.draw_parameters {
                let mut random = Random::new(seed, &format!("state/{}", block.name));
                let delta: Vec<f64> = block.sigma.iter().map(|sigma| sigma * random.normal()).collect();
                block.kind.plus(&mut x[block.storage_range()], &delta);
                let (kind, storage, dynamics) = (block.kind, block.storage_range(), block.dynamics.clone());
                parameters.push(Parameter { kind, storage, dynamics, random });
            }
        }
        let part = |channel: &Channel| match channel.name.as_ref() {
            "angular_rate" => Ok(InputPart::Rate),
            "specific_force" => Ok(InputPart::Force),
            other => Err(BuildError::at("imu", format!("the process is driven by `{other}`, which no simulated unit measures"))),
        };
        Ok(Self {
            x,
            signals: SignalBuffer::new(layout),
            process: setup.process.clone(),
            input: setup.input.iter().map(part).collect::<Result<_, _>>()?,
            sample: Vec::new(),
            frame: LocalFrame::new(setup.origin),
            known,
            parameters,
            moved: Time::default(),
        })
    }

    fn fill(&mut self, truth: &Truth, biases: &Sample) {
        let (nav, x) = (&truth.nav, &mut self.x);
        let rpy = so3::to_rpy(&nav.q_nb);
        let mut offset = Sample::default();
        for known in &self.known {
            match known {
                Known::Geodetic(slot) => slot.write(&nav.position, x),
                Known::Local(slot) => slot.write(&self.frame.to_ned(&nav.position), x),
                Known::Velocity(slot) => slot.write(&nav.v_eb_n, x),
                Known::Attitude(slot) => slot.write(&nav.q_nb, x),
                Known::Heading(slot) => slot.write(&rpy.z, x),
                Known::Speed(slot) => slot.write(&(nav.v_eb_n.x * rpy.z.cos() + nav.v_eb_n.y * rpy.z.sin()), x),
                Known::YawRate(slot) => {
                    let earth = LocalEarth::at(&nav.position);
                    let w_in = earth.earth_rate_n() + earth.transport_rate_n(&nav.v_eb_n);
                    let w_nb_b = truth.imu.rate - nav.q_nb.inverse_transform_vector(&w_in);
                    slot.write(&(so3::euler_rate_of_body(rpy.x, rpy.y) * w_nb_b).z, x);
                }
                Known::GyroBias(slot) => {
                    offset.rate = biases.rate;
                    slot.write(&biases.rate, x);
                }
                Known::AccelBias(slot) => {
                    offset.force = biases.force;
                    slot.write(&biases.force, x);
                }
            }
        }
        self.sample.clear();
        for part in &self.input {
            let true_part = match part {
                InputPart::Rate => truth.imu.rate + offset.rate,
                InputPart::Force => truth.imu.force + offset.force,
            };
            self.sample.extend_from_slice(true_part.as_slice());
        }
        self.signals.evaluate(self.process.as_ref(), &self.x, &Input::alone(&self.sample), false);
    }

    /// Moves the parameters by their own dynamics; at the instants of one stream, so that other
    /// streams do not change them.
    fn move_parameters(&mut self, to: Time) {
        let dt = to.seconds_since(self.moved);
        if dt <= 0.0 {
            return;
        }
        self.moved = to;
        for Parameter { kind, storage, dynamics, random } in &mut self.parameters {
            let x = &mut self.x[storage.clone()];
            match dynamics {
                Dynamics::GaussMarkov { sigma, tau } => {
                    let decay = (-dt / *tau).exp();
                    for (x, sigma) in x.iter_mut().zip(sigma) {
                        *x = decay * *x + *sigma * (1.0 - decay * decay).sqrt() * random.normal();
                    }
                }
                Dynamics::RandomWalk { psd } => {
                    let delta: Vec<f64> = psd.iter().map(|psd| (psd * dt).sqrt() * random.normal()).collect();
                    kind.plus(x, &delta);
                }
                Dynamics::Process | Dynamics::Constant => {}
            }
        }
    }
}
