//! The simulator: from a world to rows in order of their stamps.
//!
//! At each instant at which a stream has a row the world is advanced to exactly that instant, the
//! true state is written into the layout of the filter, and the sensor's own h(x) is evaluated
//! there. A row stamped later than it is valid waits in a queue, so memory is bounded by the
//! longest delay, not by the length of the run.
//!
//! Streams  `imu`, `odometry`, `track_speeds`, ship streams, one per sensor, `reference`. All but the reference have
//!          errors
//! x_true   blocks named `position` (geodetic or local), `local_position`, `velocity`,
//!          `attitude`, `heading`, `speed`, `yaw_rate` from the world; `gyro_bias`, `accel_bias`,
//!          `gyro_scale`, `accel_scale` from the simulated unit; a log's `current` from the sea, if it has one; a
//!          vessel's pose from the platform with the name of its sensor, or else from the ship;
//!          every other block at its declared
//!          initial value, or drawn about it if this value is not [given](Setup::given) as the true one; moved by its
//!          own dynamics (`draw_parameters`)
//! Shared   the truth of a trajectory, and the samples of the inertial unit before their errors, are the same for
//!          every seed: runs that [share](Simulator::share) them make them once
//! Signals  from the process's own `signals` at x_true, its input being the true rates plus the
//!          true biases where those are states
//! Not here inputs other than an inertial unit or odometry; faults and dropouts (they act on rows)

mod clock;
mod course;
mod delay;
mod true_state;
mod unit;

use super::closed_loop::Script;
use super::constellation::{Constellation, Satellite};
use super::control::Seen;
use super::imu_error::ImuError;
use super::inverse::Sample;
use super::noise::SensorError;
use super::odometry::Odometry;
use super::record::Record;
use super::ship::{ACOUSTIC, SHIP_STREAMS, Ship, ship_channels, ship_instruments};
use super::spec::SimulationSpec;
use super::tracks::TrackSpeeds;
use super::world::{Truth, World};
use crate::block::{BuildError, Channel, imu_channels};
use crate::earth::Gravity;
use crate::units::Dimension;
use crate::vocabulary::{channel, parameter};
use clock::{Clocks, Source};
use core::cmp::Reverse;
use core::ops::Range;
use course::ErrorFree;
pub use course::SharedCourse;
use delay::Delay;
use fusion_core::Time;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Measurement, Process};
use fusion_core::state::{Block, Layout, Scalar, Slot};
use fusion_core::time::nanos;
use std::collections::BinaryHeap;
use std::sync::Arc;
pub(super) use true_state::Known;
use true_state::TrueState;
use unit::{IdealUnit, Reading};

/// A sensor to simulate.
#[derive(Clone, Debug)]
pub struct SimulatedSensor {
    /// Its name, which is also the name of its stream.
    pub name: String,
    /// Its model.
    pub model: Arc<dyn Measurement>,
    /// The channels of its value.
    pub channels: Vec<Channel>,
    /// The dimension of each residual row.
    pub rows: Vec<Dimension>,
    /// Seconds by which its rows are valid before their stamp.
    pub delay: f64,
    /// Its time offset, if it is a state: `delay` is right for its declared value.
    pub offset: Option<Slot<Scalar>>,
}

/// The filter and the sensors for which a run is simulated.
#[derive(Debug)]
pub struct Setup<'a> {
    /// The state of the filter.
    pub layout: &'a Layout,
    /// Its process, for the signals.
    pub process: Arc<dyn Process>,
    /// The channels of an input sample of the process.
    pub input: &'a [Channel],
    /// Origin of the local coordinates.
    pub origin: Geodetic,
    /// The gravity model.
    pub gravity: Gravity,
    /// The sensors, except sensors that read a constant: they are not simulated.
    pub sensors: Vec<SimulatedSensor>,
    /// Names of sensors that read the output of an instrument or a stage: no truth of their parameters is known.
    pub others: Vec<String>,
    /// States whose initial value is the true value: they are not drawn.
    pub given: Vec<String>,
    /// The layout in which the truth is reported, if it is another: all its blocks are in `layout` too.
    pub told: Option<&'a Layout>,
}

/// A stream of simulated rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimulatedStream {
    /// `imu`, `reference`, or the name of a sensor.
    pub name: String,
    /// The channels of its rows.
    pub channels: Vec<Channel>,
}

/// Numbers in a row of the reference stream.
const REFERENCE_WIDTH: usize = 10;
/// The stream of the inertial unit.
pub const IMU: &str = "imu";
/// The stream of the odometry.
pub const ODOMETRY: &str = "odometry";
/// The stream of the speeds of a vehicle's tracks.
pub const TRACK_SPEEDS: &str = "track_speeds";
/// The streams of the units that may drive a process.
pub const UNITS: [&str; 2] = [IMU, ODOMETRY];
/// The streams of the simulator's own instruments, each with its table under `[simulation]`.
pub const INSTRUMENTS: [(&str, &str); 6] = [
    (IMU, IMU),
    (ODOMETRY, ODOMETRY),
    (TRACK_SPEEDS, TRACK_SPEEDS),
    (SHIP_STREAMS[0], "ship.gps"),
    (SHIP_STREAMS[1], "ship.attitude"),
    (SHIP_STREAMS[ACOUSTIC], "ship.usbl"),
];
/// The same, with the instruments of these platforms.
pub fn instruments<'a>(platforms: impl IntoIterator<Item = &'a str>) -> Vec<(String, String)> {
    let own = INSTRUMENTS.map(|(stream, table)| (stream.to_owned(), table.to_owned()));
    let of_platforms = platforms.into_iter().flat_map(|name| ship_instruments(Some(name)));
    own.into_iter().chain(of_platforms).collect()
}

/// The stream of the truth.
pub const REFERENCE: &str = "reference";

/// Produces the rows of a run, one after the other.
#[derive(Debug)]
pub struct Simulator {
    streams: Vec<SimulatedStream>,
    clocks: Clocks,
    free: ErrorFree,
    /// The readings of the inertial unit that have no errors added yet.
    readings: Vec<Reading>,
    truth: TrueState,
    /// The errors of the inertial unit.
    imu: Option<ImuError>,
    odometry: Option<(Odometry, usize)>,
    track_speeds: Option<(TrackSpeeds, usize)>,
    /// The ships with their streams; `None` if the ship lacks the instrument.
    ships: Vec<(Ship, [Option<usize>; SHIP_STREAMS.len()])>,
    sensors: Vec<Sensor>,
    constellation: Option<Constellation>,
    queue: BinaryHeap<Reverse<Row>>,
    spare: Vec<Vec<f64>>,
    sequence: u64,
    /// The smallest delay from validity to stamp \[ns\], 0 or negative: a row may be stamped before it is valid.
    least_delay: i64,
    /// The range of each block in the reported truth, and its range in the true state.
    told: Vec<[Range<usize>; 2]>,
    reference_state: Vec<f64>,
}

/// The next event in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A row of that stream, with its stamp.
    Row(usize, Time),
    /// The instant at which the world must be [steered](Simulator::steer): all rows stamped up to this instant
    /// have come.
    Control(Time),
}

/// In place of a stream: a row that only marks when the world is steered, after all other rows with its stamp.
const CONTROL: usize = usize::MAX;

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
    delay: Delay,
    stream: usize,
    /// The range of its bias in the true state; the bias is the sum of the instrument's lasting errors.
    bias: Option<Range<usize>>,
    /// If each row is a satellite: how it gives the satellite.
    satellite: Option<SatelliteRow>,
}

/// A row with the numbers of a satellite after the measured number.
#[derive(Clone, Debug)]
struct SatelliteRow {
    channels: Vec<Channel>,
    /// Whether it is a range, which the errors of the signal lengthen.
    is_range: bool,
}

impl SatelliteRow {
    /// `None` for a sensor without given numbers.
    fn of(sensor: &SimulatedSensor, spec: &SimulationSpec) -> Result<Option<Self>, BuildError> {
        if sensor.model.given().is_empty() {
            return Ok(None);
        }
        let is_known = |c: &Channel| *c == channel::SATELLITE_POSITION || *c == channel::SATELLITE_VELOCITY;
        let channels = sensor.channels.get(1..).unwrap_or_default().to_vec();
        if !channels.iter().all(is_known) {
            let message = "no simulated world has the numbers that this sensor takes from its rows";
            return Err(BuildError::at(format!("sensor.{}", sensor.name), message));
        }
        if spec.constellation.is_none() {
            let message = "the sensor measures ranges to satellites, and the simulated world has none";
            let help = "add `constellation = {}` under [simulation]: thirty satellites on circular orbits";
            return Err(BuildError::at(format!("sensor.{}", sensor.name), message).help(help));
        }
        let is_range = sensor.channels[0] == channel::PSEUDORANGE;
        Ok(Some(Self { channels, is_range }))
    }

    /// Writes the numbers of `satellite` after the first of `z`.
    fn write(&self, satellite: &Satellite, z: &mut [f64]) {
        for (channel, numbers) in self.channels.iter().zip(z[1..].chunks_exact_mut(3)) {
            let is_place = *channel == channel::SATELLITE_POSITION;
            let of = if is_place { satellite.position } else { satellite.velocity };
            numbers.copy_from_slice(of.as_slice());
        }
    }
}

impl Simulator {
    /// A run in the world of `spec`; `seed` is usually the seed in `spec`. With a `script`, a vehicle is not
    /// steered but receives these commands.
    ///
    /// # Errors
    /// [`BuildError`] whose field is within `[simulation]`.
    pub fn new(spec: &SimulationSpec, setup: Setup<'_>, seed: u64, script: Option<Script>) -> Result<Self, BuildError> {
        let world = spec.world(setup.origin, setup.gravity, seed, script)?;
        spec.check_rates(world.end().seconds())?;
        Self::in_world(world, spec, setup, seed)
    }

    /// A run in a custom world; trajectory and vehicle of `spec` are ignored.
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
        let own = spec.instruments();
        let is_own = |name: &str| name == REFERENCE || own.iter().any(|(stream, _)| stream == name);
        if let Some(sensor) = setup.sensors.iter().find(|s| is_own(&s.name)) {
            let taken = format!("`{}` is the name of a stream of the simulator's own", sensor.name);
            return Err(BuildError::at("sensor", taken).help("give the sensor another name"));
        }
        spec.check_unit(setup.input)?;
        let truth = TrueState::new(&setup, spec, seed)?;
        let (mut streams, mut clocks, mut sensors) = (Vec::new(), Clocks::default(), Vec::new());
        let (mut imu, mut ideal) = (None, None);
        if let Some(unit) = &spec.imu {
            let rate = unit.rate.si();
            clocks.add(Source::Imu, rate, 0);
            streams.push(SimulatedStream {
                name: IMU.to_owned(),
                channels: imu_channels(),
            });
            imu = Some(ImuError::new(unit, seed));
            ideal = Some(IdealUnit::new(setup.process.as_ref(), setup.gravity, rate));
        }
        let odometry = spec.odometry.as_ref().map(|unit| {
            clocks.add(Source::Odometry, unit.rate.si(), 0);
            streams.push(SimulatedStream {
                name: ODOMETRY.to_owned(),
                channels: odometry_channels(),
            });
            (Odometry::new(unit, setup.origin, seed), streams.len() - 1)
        });
        if spec.track_speeds.is_some() && world.tracks().is_none() {
            let help = "remove the table, or declare `[simulation.vehicle]` with `type = \"skid_steer\"`";
            return Err(BuildError::at("track_speeds", "nothing in this world runs on tracks").help(help));
        }
        let track_speeds = spec.track_speeds.as_ref().map(|unit| {
            clocks.add(Source::TrackSpeeds, unit.rate.si(), 0);
            streams.push(SimulatedStream {
                name: TRACK_SPEEDS.to_owned(),
                channels: track_channels(),
            });
            (TrackSpeeds::new(unit, seed), streams.len() - 1)
        });
        let mut ships = Vec::new();
        for (platform, ship) in spec.ships() {
            let rates = [ship.gps.map(|gps| gps.rate.si()), ship.attitude.map(|attitude| attitude.rate.si())];
            let mut places = [None; SHIP_STREAMS.len()];
            for (i, name) in ship.streams(platform) {
                // An acoustic system asks for ranges at drawn instants.
                let rate = rates.get(i).copied().flatten().unwrap_or(f64::INFINITY);
                clocks.add(Source::Ship(ships.len(), i), rate, 0);
                places[i] = Some(streams.len());
                streams.push(SimulatedStream {
                    name,
                    channels: ship_channels(i),
                });
            }
            ships.push((Ship::new(ship, platform, setup.origin, seed), places));
        }
        let duration = world.end().seconds();
        for sensor in setup.sensors {
            let Some(simulated) = spec.sensor.get(&sensor.name) else { continue };
            let error =
                SensorError::new(simulated, &sensor.name, &sensor.rows, seed).map_err(|e| e.within(format!("sensor.{}", sensor.name)))?;
            clocks.add(Source::Sensor(sensors.len()), simulated.rate.si(), nanos(simulated.start.si()));
            sensors.push(Sensor {
                delay: Delay::new(&sensor, setup.layout, duration),
                bias: own_bias(setup.layout, &sensor),
                satellite: SatelliteRow::of(&sensor, spec)?,
                model: sensor.model,
                error,
                stream: streams.len(),
            });
            streams.push(SimulatedStream {
                name: sensor.name,
                channels: sensor.channels,
            });
        }
        clocks.add(Source::Reference, spec.reference_rate.si(), 0);
        streams.push(SimulatedStream {
            name: REFERENCE.to_owned(),
            channels: reference_channels(),
        });
        world
            .control_rate()
            .into_iter()
            .for_each(|rate| clocks.add(Source::Control, rate, 0));
        let mut simulator = Self {
            streams,
            clocks,
            free: ErrorFree::new(world, ideal),
            readings: Vec::new(),
            imu,
            odometry,
            track_speeds,
            ships,
            least_delay: sensors.iter().map(|s| s.delay.least(truth.state())).min().unwrap_or(0).min(0),
            truth,
            sensors,
            constellation: spec.constellation.as_ref().map(|c| Constellation::new(c, &setup.origin, seed)),
            queue: BinaryHeap::new(),
            spare: Vec::new(),
            sequence: 0,
            told: told(setup.told.unwrap_or(setup.layout), setup.layout)?,
            reference_state: setup.told.unwrap_or(setup.layout).initial().to_vec(),
        };
        simulator.refresh();
        Ok(simulator)
    }

    /// Goes by what runs of the same design with other seeds have in common, or makes it for them; no row has
    /// been made yet.
    #[must_use]
    pub fn share(mut self, shared: &SharedCourse) -> Self {
        // An acoustic system asks for ranges at drawn instants.
        if self.ships.iter().all(|(_, streams)| streams[ACOUSTIC].is_none()) {
            self.free.share(shared, &self.clocks);
        }
        self
    }

    /// The streams; rows name them by their place here.
    #[must_use]
    pub fn streams(&self) -> &[SimulatedStream] {
        &self.streams
    }

    /// When the run ends.
    #[must_use]
    pub fn end(&self) -> Time {
        self.free.world.end()
    }

    /// Whether the world needs to be steered `now`.
    #[must_use]
    pub fn listens(&self, now: Time) -> bool {
        self.free.world.listens(now)
    }

    /// Passes the vehicle's own estimate to the world, at the instant of a [`Next::Control`].
    /// `seen` is `None` before its filter has started.
    pub fn steer(&mut self, now: Time, seen: Option<&Seen>) {
        self.free.world.steer(now, seen);
    }

    /// The commands that the vehicle has received, if there is a vehicle.
    #[must_use]
    pub fn script(&self) -> Option<Script> {
        self.free.world.script()
    }

    /// How well the world was steered, if it is steered.
    #[must_use]
    pub fn record(&self) -> Option<Record> {
        self.free.world.record()
    }

    /// The truth at the last simulated instant, which may be after the last returned row. In a
    /// [shared](Self::share) course, the last instant at which another source than the inertial unit was read.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        self.free.truth()
    }

    /// The true state, in the layout of the filter, that belongs to the last returned `reference` row.
    /// A filter's consistency is judged by it.
    #[must_use]
    pub fn reference_state(&self) -> &[f64] {
        &self.reference_state
    }

    /// Whether the true value of a block in the filter's state comes from the world or a draw. Any
    /// other block has its declared initial value as the truth, which proves nothing about its covariance.
    #[must_use]
    pub fn is_drawn(&self, block: &str) -> bool {
        self.truth.is_drawn(block)
    }

    /// The next row in order of stamps, its numbers in `out`. `None` at the end of the run.
    pub fn next_row(&mut self, out: &mut Vec<f64>) -> Option<Next> {
        loop {
            let due = self.clocks.due().filter(|(_, time)| *time <= self.free.world.end());
            if due.is_none() {
                self.free.release(&mut self.readings);
                self.spoil_readings();
            }
            // No row still to be made can be stamped before this.
            let mut safe = due.map_or(Time::MAX, |(_, time)| time.shifted(self.least_delay));
            if let Some(stamp) = self.free.held() {
                safe = safe.min(stamp);
            }
            if self.queue.peek().is_some_and(|Reverse(row)| row.stamp < safe) {
                let Reverse(mut row) = self.queue.pop()?;
                if row.stream == self.streams.len() - 1 {
                    let state = &row.data[REFERENCE_WIDTH..];
                    for [to, from] in &self.told {
                        self.reference_state[to.clone()].copy_from_slice(&state[from.clone()]);
                    }
                    row.data.truncate(REFERENCE_WIDTH);
                }
                core::mem::swap(out, &mut row.data);
                self.spare.push(row.data);
                return Some(match row.stream {
                    CONTROL => Next::Control(row.stamp),
                    stream => Next::Row(stream, row.stamp),
                });
            }
            let (source, time) = due?;
            self.clocks.tick(source);
            self.make(source, time);
        }
    }

    /// Makes the row of `source` that is valid at `time`.
    fn make(&mut self, source: Source, time: Time) {
        self.free.advance(time);
        match source {
            Source::Imu => {
                self.truth.move_parameters(time);
                self.free.read(time, &mut self.readings);
                self.spoil_readings();
            }
            Source::Control => self.put(time, CONTROL, Vec::new()),
            Source::Odometry => {
                let Some((odometry, stream)) = &mut self.odometry else { return };
                let (measured, stream) = (odometry.measure(time, &self.free.truth().nav), *stream);
                let mut data = self.spare.pop().unwrap_or_default();
                data.clear();
                data.extend_from_slice(&measured);
                self.put(time, stream, data);
            }
            Source::TrackSpeeds => {
                let (Some((unit, stream)), Some(tracks)) = (&mut self.track_speeds, self.free.world.tracks()) else {
                    return;
                };
                let (measured, stream) = (unit.measure(tracks), *stream);
                let mut data = self.spare.pop().unwrap_or_default();
                data.clear();
                data.extend_from_slice(&measured);
                self.put(time, stream, data);
            }
            Source::Ship(number, i) => {
                let Some((ship, streams)) = self.ships.get_mut(number) else {
                    return;
                };
                let measured = ship.measure(i, time, &self.free.truth().nav);
                let (Some((stamp, data)), Some(stream)) = (measured, streams[i]) else {
                    return;
                };
                if let Some(interval) = (i == ACOUSTIC).then(|| ship.interval(time)).flatten() {
                    // Its clock has no rate: each interval begins where the one before has ended.
                    self.clocks.restart(Source::Ship(number, ACOUSTIC), time.shifted(interval).nanos());
                }
                self.put(stamp, stream, data);
            }
            Source::Sensor(i) => {
                self.refresh();
                if self.sensors[i].satellite.is_some() {
                    self.make_satellites(i, time);
                    return;
                }
                let sensor = &mut self.sensors[i];
                let mut z = self.spare.pop().unwrap_or_default();
                z.clear();
                z.resize(sensor.model.size().value, 0.0);
                let view = self.truth.view();
                // Where h is undefined the sensor is silent.
                if sensor.model.predict(&view, &mut z).is_err() {
                    self.spare.push(z);
                    return;
                }
                sensor.error.spoil(sensor.model.as_ref(), time, &mut z);
                let (stamp, stream) = (time.shifted(sensor.delay.at(self.truth.state())), sensor.stream);
                self.put(stamp, stream, z);
            }
            Source::Reference => {
                self.refresh();
                let mut data = self.spare.pop().unwrap_or_default();
                let nav = &self.free.truth().nav;
                let (p, v, q) = (nav.position, nav.v_eb_n, so3::canonical(&nav.q_nb));
                data.clear();
                data.extend_from_slice(&[p.lat, p.lon, p.height, v.x, v.y, v.z, q.w, q.i, q.j, q.k]);
                let from = data.len();
                data.extend_from_slice(self.truth.state());
                for sensor in &self.sensors {
                    let own = sensor.bias.iter().cloned().flatten().enumerate();
                    own.for_each(|(row, at)| data[from + at] += sensor.error.lasting(row));
                }
                if self.imu.is_none() {
                    self.truth.move_parameters(time);
                }
                self.put(time, self.streams.len() - 1, data);
            }
        }
    }

    /// Makes a row of sensor `i` per satellite that is seen.
    fn make_satellites(&mut self, i: usize, time: Time) {
        let place = self.free.truth().nav.position;
        let seen = self.constellation.as_ref().map_or_else(Vec::new, |c| c.seen(time, &place));
        for satellite in seen {
            let sensor = &mut self.sensors[i];
            let Some(row) = &sensor.satellite else { return };
            let (mut given, mut z) = (vec![0.0; sensor.model.size().value], self.spare.pop().unwrap_or_default());
            row.write(&satellite, &mut given);
            z.clear();
            z.resize(given.len(), 0.0);
            let view = self.truth.view().with_given(&given[1..]);
            // If h is undefined, the sensor is silent.
            if sensor.model.predict(&view, &mut z).is_err() {
                self.spare.push(z);
                continue;
            }
            if row.is_range {
                sensor.model.perturb(&mut z, &[satellite.error]);
            }
            sensor.error.spoil(sensor.model.as_ref(), time, &mut z);
            let (stamp, stream) = (time.shifted(sensor.delay.at(self.truth.state())), sensor.stream);
            self.put(stamp, stream, z);
        }
    }

    fn put(&mut self, stamp: Time, stream: usize, data: Vec<f64>) {
        self.sequence += 1;
        self.queue.push(Reverse(Row {
            stamp,
            stream,
            sequence: self.sequence,
            data,
        }));
    }

    /// Brings the true state up to the world.
    fn refresh(&mut self) {
        let none = (Sample::default(), Sample::default());
        let (bias, scale) = self.imu.as_ref().map_or(none, |imu| (imu.bias(), imu.scale()));
        self.truth.fill(self.free.truth(), &bias, &scale);
    }

    /// Adds the errors of the inertial unit to its readings.
    fn spoil_readings(&mut self) {
        let mut readings = core::mem::take(&mut self.readings);
        for reading in readings.drain(..) {
            let Some(imu) = &mut self.imu else { break };
            let measured = imu.measure(&reading.sample, reading.interval);
            let mut data = self.spare.pop().unwrap_or_default();
            data.clear();
            data.extend_from_slice(measured.rate.as_slice());
            data.extend_from_slice(measured.force.as_slice());
            self.put(reading.stamp, 0, data);
        }
        self.readings = readings;
    }
}

/// The block of a sensor's own bias, where it is added to the rows of its residual.
fn own_bias(layout: &Layout, sensor: &SimulatedSensor) -> Option<Range<usize>> {
    let name = format!("{}.{}", sensor.name, parameter::BIAS);
    let block = layout.blocks().iter().find(|b| b.name == name)?;
    let is_of_rows = block.kind.storage() == sensor.rows.len() && sensor.rows.iter().all(|row| row.to_string() == block.unit);
    is_of_rows.then(|| block.storage_range())
}

/// For each block of a state: its range there, and its range in the true state.
fn told(layout: &Layout, truth: &Layout) -> Result<Vec<[Range<usize>; 2]>, BuildError> {
    let place = |block: &Block| {
        let of_truth = truth.blocks().iter().find(|b| b.name == block.name && b.kind == block.kind);
        let unknown = || BuildError::at("sensor", format!("with what is true there is no state `{}`", block.name));
        Ok([block.storage_range(), of_truth.ok_or_else(unknown)?.storage_range()])
    };
    layout.blocks().iter().map(place).collect()
}

/// The channels of the `odometry` stream.
#[must_use]
pub fn odometry_channels() -> Vec<Channel> {
    vec![channel::FORWARD_SPEED, channel::SIDEWAYS_SPEED, channel::YAW_RATE]
}

/// The channels of the `track_speeds` stream.
#[must_use]
pub fn track_channels() -> Vec<Channel> {
    vec![channel::LEFT_TRACK, channel::RIGHT_TRACK]
}

/// The channels of the `reference` stream.
#[must_use]
pub fn reference_channels() -> Vec<Channel> {
    let attitude = channel::ATTITUDE;
    vec![channel::POSITION, channel::VELOCITY, attitude]
}

#[cfg(test)]
mod tests;
