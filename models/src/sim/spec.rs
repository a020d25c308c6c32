//! The table `[simulation]` of a design.

use super::closed_loop::{ClosedLoop, Crew, Script};
use super::constellation::ConstellationSpec;
use super::control::ControlSpec;
use super::imu_error::ImuErrorSpec;
use super::noise::SensorErrorSpec;
use super::odometry::OdometryErrorSpec;
use super::sea::SeaSpec;
use super::segment::{Junction, SegmentSpec};
use super::ship::ShipSpec;
use super::task::TaskSpec;
use super::tracks::TrackSpeedsSpec;
use super::trajectory::Trajectory;
use super::vehicle::VehicleSpec;
use super::world::{OpenLoop, Plane, World};
use crate::block::{BuildError, Channel, NestedBlock};
use crate::earth::Gravity;
use crate::registry::{self, Role};
use crate::units::{NonNegative, Positive, Quantity, Vec3Of, dim};
use crate::vocabulary::{channel, parameter};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::state::{Block, Kind};
use nalgebra::Vector3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A simulated run: a trajectory or a controlled vehicle, an inertial measurement unit, and the errors of
/// each sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulationSpec {
    /// Seed of all randomness; another seed is another run.
    #[serde(default)]
    pub seed: u64,
    /// The inertial measurement unit; needed by a process that is driven by one.
    pub imu: Option<ImuErrorSpec>,
    /// The odometry of a vehicle on level ground; needed by a process that is driven by one.
    pub odometry: Option<OdometryErrorSpec>,
    /// The instrument that measures how fast the tracks of the vehicle run: the stream `track_speeds`.
    pub track_speeds: Option<TrackSpeedsSpec>,
    /// A ship near the vehicle. A sensor `vessel_pose` measures its pose. Its instruments have the streams `ship_gps`,
    /// `ship_attitude` and `transceiver`.
    pub ship: Option<ShipSpec>,
    /// Further ships, platforms or vehicles, by name: a sensor `vessel_pose` of the same name measures them. Their
    /// instruments have the streams `NAME_gps`, `NAME_attitude` and `NAME_transceiver`.
    #[serde(default)]
    pub platform: BTreeMap<String, ShipSpec>,
    /// The navigation satellites, for sensors `pseudorange` and `pseudorange_rate`.
    pub constellation: Option<ConstellationSpec>,
    /// Position of the inertial unit from the vehicle's reference point, in body axes. The reference point moves along
    /// the path; without `unit`, the inertial unit does. A lever arm from the unit to this point, such as for
    /// `nonholonomic`, is the opposite vector.
    #[serde(default)]
    pub unit: Vec3Of<dim::Length>,
    /// Rows per second of the `reference` stream: the truth; at most 1e9 rows in a run.
    #[serde(default = "reference_rate")]
    pub reference_rate: Positive<dim::Frequency>,
    /// Whether the true values of estimated parameters differ from their initial values, by a draw from their
    /// declared sigma, and move by their declared dynamics.
    #[serde(default)]
    pub draw_parameters: bool,
    /// Whether the filter starts at a draw about the truth, from the 1σ declared for each block of its
    /// start; every seed gives another draw. Blocks that initialisers find from data stay unchanged.
    /// Otherwise the filter starts at the declared values.
    #[serde(default)]
    pub draw_start: bool,
    /// Where the trajectory or the vehicle starts.
    #[serde(default)]
    pub start: StartSpec,
    /// The segments of the trajectory, in order; a world without a vehicle needs one.
    #[schemars(schema_with = "segments_schema")]
    #[serde(default, deserialize_with = "crate::block::nested")]
    pub trajectory: Vec<Box<dyn SegmentSpec>>,
    /// The sea that carries a boat: the trajectory is then its way through the water.
    pub sea: Option<SeaSpec>,
    /// A vehicle that is controlled by the filter's own estimate, in place of a trajectory.
    #[schemars(schema_with = "vehicle_schema")]
    #[serde(default)]
    pub vehicle: Option<NestedBlock<dyn VehicleSpec>>,
    /// Its controller.
    #[schemars(schema_with = "control_schema")]
    #[serde(default)]
    pub control: Option<NestedBlock<dyn ControlSpec>>,
    /// The vehicle's tasks, in order; the run ends with the last task.
    #[schemars(schema_with = "mission_schema")]
    #[serde(default, deserialize_with = "crate::block::nested")]
    pub mission: Vec<Box<dyn TaskSpec>>,
    /// The variant of the design that steers the vehicle, `"base"` for the design itself. Without it, the run's own
    /// filter steers. With it, filters are compared on the same path: the path of this variant, which runs first.
    pub steered_by: Option<String>,
    /// When a run with a mission ends at the latest, done or not.
    pub longest: Option<Positive<dim::Duration>>,
    /// How each sensor is simulated, by its name; a sensor without an entry is not simulated.
    #[serde(default)]
    pub sensor: BTreeMap<String, SensorErrorSpec>,
}

/// The start of the trajectory: level, at rest unless a speed is given.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartSpec {
    /// Position relative to the origin of the run: north, east, down.
    #[serde(default)]
    position: Vec3Of<dim::Length>,
    /// Heading.
    #[serde(default)]
    heading: Quantity<dim::Angle>,
    /// Speed ahead.
    #[serde(default)]
    speed: NonNegative<dim::Speed>,
}

impl StartSpec {
    fn junction(&self) -> Junction {
        Junction {
            position: Vector3::from(self.position.si()),
            heading: self.heading.si(),
            speed: self.speed.si(),
        }
    }
}

impl SimulationSpec {
    /// The true value of a block that estimates the slip of the vehicle's tracks; `None` for any other block.
    #[must_use]
    pub fn true_slip(&self, block: &Block) -> Option<f64> {
        let name = block.name.rsplit_once('.').map(|(_, name)| name);
        let is_slip = name == Some(parameter::SLIP) && block.kind == Kind::Scalar;
        self.vehicle.as_ref().filter(|_| is_slip).and_then(|vehicle| vehicle.0.mean_slip())
    }

    /// The trajectory in local north-east-down.
    ///
    /// # Errors
    /// [`BuildError`] whose field is `trajectory.i.…`.
    pub fn trajectory(&self) -> Result<Trajectory, BuildError> {
        let trajectory = Trajectory::new(self.start.junction(), &self.trajectory)?;
        let Some(sea) = &self.sea else { return Ok(trajectory) };
        sea.check()?;
        if sea.has_waves() {
            self.check_afloat()?;
        }
        Ok(trajectory.at_sea(sea.clone()))
    }

    /// Refuses waves under a vehicle that does not float.
    fn check_afloat(&self) -> Result<(), BuildError> {
        let help = "remove `waves`; a `current` may carry whatever moves through water";
        if self.odometry.is_some() {
            let message = "odometry is measured on level ground, and waves lift and tilt the boat";
            return Err(BuildError::at("sea.waves", message).help(help));
        }
        match self.trajectory.iter().position(|segment| !segment.is_afloat()) {
            None => Ok(()),
            Some(i) => {
                let message = format!("segment {} leaves the surface of the water, where the waves are", i + 1);
                Err(BuildError::at(format!("trajectory.{i}"), message).help(help))
            }
        }
    }

    /// The vehicle and its mission; `seed` is the seed of the run.
    pub(super) fn crew(&self, vehicle: &dyn VehicleSpec, seed: u64) -> Result<Crew, BuildError> {
        if !self.trajectory.is_empty() {
            let help = "remove `trajectory`; `mission` says what the vehicle does";
            return Err(BuildError::at("trajectory", "a vehicle follows no trajectory").help(help));
        }
        if self.sea.is_some() {
            return Err(BuildError::at("sea", "a vehicle drives on the ground, and there is no sea")
                .help("remove `sea`, or replace the vehicle by a `trajectory`"));
        }
        if self.start.speed.si() > 0.0 {
            return Err(BuildError::at("start.speed", "a vehicle starts at rest"));
        }
        let missing = |what: &str, help: &str| BuildError::new(format!("a vehicle needs `{what}`")).help(help);
        let control = self
            .control
            .as_ref()
            .ok_or_else(|| missing("control", "add `[simulation.control]`: `fusion blocks autopilot` shows one"))?;
        let longest = self
            .longest
            .ok_or_else(|| missing("longest", "add `longest = \"10 min\"`: when the run ends at the latest"))?;
        if self.mission.is_empty() {
            return Err(missing(
                "mission",
                "add tasks, such as { type = \"drive\", heading = 0, speed = \"0.3 m/s\", distance = \"10 m\" }",
            ));
        }
        let mut tasks = Vec::new();
        for (i, task) in self.mission.iter().enumerate() {
            let built = if task.follows_line() && !control.0.follows_lines() {
                Err(BuildError::new("this task follows a line, and the controller cannot").help("add `line` to `control`"))
            } else {
                task.build()
            };
            tasks.push(built.map_err(|mut e| {
                e.message = format!("task {}: {}", i + 1, e.message);
                e.within(format!("mission.{i}"))
            })?);
        }
        Ok(Crew {
            vehicle: vehicle.build(&self.start.junction(), seed).map_err(|e| e.within("vehicle"))?,
            control: control.0.build().map_err(|e| e.within("control"))?,
            rate: control.0.rate(),
            tasks,
            longest: longest.si(),
        })
    }

    /// Seconds from the start to the end of the run, at the latest.
    ///
    /// # Errors
    /// [`BuildError`] of the trajectory, or of the vehicle and its mission.
    pub fn duration(&self) -> Result<f64, BuildError> {
        match &self.vehicle {
            Some(vehicle) => Ok(self.crew(vehicle.0.as_ref(), self.seed)?.longest),
            None => Ok(self.trajectory()?.duration()),
        }
    }

    /// The world that it declares, in the local axes at `origin`; `seed` is the seed of the run. A vehicle follows
    /// `script` if it is given.
    ///
    /// # Errors
    /// [`BuildError`] of the trajectory, or of the vehicle and its mission.
    pub fn world(&self, origin: Geodetic, gravity: Gravity, seed: u64, script: Option<Script>) -> Result<Box<dyn World>, BuildError> {
        let Some(vehicle) = &self.vehicle else {
            return Ok(Box::new(OpenLoop::new(self.trajectory()?, self.plane(origin, gravity))));
        };
        let crew = self.crew(vehicle.0.as_ref(), seed)?;
        let plane = self.plane(origin, gravity);
        Ok(Box::new(match script {
            Some(script) => ClosedLoop::replayed(crew, plane, script),
            None => ClosedLoop::new(crew, plane),
        }))
    }

    /// The ship, which has no name, and the platforms.
    pub fn ships(&self) -> impl Iterator<Item = (Option<&str>, &ShipSpec)> {
        let ship = self.ship.iter().map(|ship| (None, ship));
        ship.chain(self.platform.iter().map(|(name, platform)| (Some(name.as_str()), platform)))
    }

    /// The streams of its instruments, whether it has them or not, each with its table under `[simulation]`.
    #[must_use]
    pub fn instruments(&self) -> Vec<(String, String)> {
        super::instruments(self.platform.keys().map(String::as_str))
    }

    /// The plane that the world lies on, for an inertial unit at its place.
    pub(super) fn plane(&self, origin: Geodetic, gravity: Gravity) -> Plane {
        Plane::new(origin, gravity).carrying(Vector3::from(self.unit.si()))
    }

    /// Refuses an instrument that is read where the vehicle is, and moves the body as if it were at the unit.
    fn check_place(&self) -> Result<(), BuildError> {
        if self.odometry.is_none() || self.unit.si() == [0.0; 3] {
            return Ok(());
        }
        let help = "remove `unit`: the position of the filter is then that of the vehicle";
        Err(BuildError::at(
            "unit",
            "odometry measures at the vehicle's reference point, and moves the filter there",
        )
        .help(help))
    }

    /// The errors of the run, for a process whose samples consist of `input`, that the declaration
    /// alone shows: the trajectory and the rates, and a missing inertial unit.
    #[must_use]
    pub fn mistakes(&self, input: &[Channel]) -> Vec<BuildError> {
        let rates = self.duration().and_then(|duration| self.check_rates(duration));
        let ships = self.ships().map(|(platform, ship)| match platform {
            None => ship.check("ship"),
            Some(name) => ship.check(&format!("platform.{name}")),
        });
        let all = [
            rates,
            self.check_unit(input),
            self.check_mission(),
            self.check_place(),
            self.check_platforms(),
            self.constellation.as_ref().map_or(Ok(()), ConstellationSpec::check),
        ];
        all.into_iter().chain(ships).filter_map(Result::err).collect()
    }

    /// Refuses a platform whose streams would have the names of the ship's streams.
    fn check_platforms(&self) -> Result<(), BuildError> {
        if self.platform.contains_key("ship") {
            let help = "rename the platform, or declare it as `[simulation.ship]`";
            return Err(BuildError::at("platform.ship", "`ship` is already the name of `[simulation.ship]`").help(help));
        }
        Ok(())
    }

    /// Refuses tasks without a vehicle.
    fn check_mission(&self) -> Result<(), BuildError> {
        if self.mission.is_empty() || self.vehicle.is_some() {
            return Ok(());
        }
        let help = "declare `vehicle` and `control`, which carry it out, or the way itself as a `trajectory`";
        Err(BuildError::at("mission", "a mission needs a vehicle").help(help))
    }

    /// Refuses a process that is driven by a missing unit.
    pub(super) fn check_unit(&self, input: &[Channel]) -> Result<(), BuildError> {
        if input.contains(&channel::FORWARD_SPEED) {
            if self.odometry.is_some() {
                return Ok(());
            }
            let help = "add `odometry = { rate = \"100 Hz\" }` with its noise";
            return Err(BuildError::at("odometry", "the process is driven by odometry").help(help));
        }
        if self.imu.is_some() || input.is_empty() {
            return Ok(());
        }
        let help = "add `imu = { rate = \"100 Hz\", preset = \"hg1700\" }`";
        Err(BuildError::at("imu", "the process is driven by an inertial unit").help(help))
    }

    /// Refuses rates at which a stream has more than [`MOST_ROWS`] in a run of `duration` seconds.
    pub(super) fn check_rates(&self, duration: f64) -> Result<(), BuildError> {
        let imu = self.imu.iter().map(|imu| ("imu.rate".to_owned(), imu.rate));
        let odometry = self.odometry.iter().map(|odometry| ("odometry.rate".to_owned(), odometry.rate));
        let tracks = self.track_speeds.iter().map(|tracks| ("track_speeds.rate".to_owned(), tracks.rate));
        let sensors = self.sensor.iter().map(|(name, s)| (format!("sensor.{name}.rate"), s.rate));
        let ship = self.ships().flat_map(|(platform, ship)| {
            let [gps, attitude, _] = super::ship_instruments(platform).map(|(_, table)| format!("{table}.rate"));
            let gps = ship.gps.map(|unit| (gps, unit.rate));
            gps.into_iter().chain(ship.attitude.map(|unit| (attitude, unit.rate)))
        });
        let reference = ("reference_rate".to_owned(), self.reference_rate);
        let most = MOST_ROWS / duration.max(1.0);
        match imu
            .chain(odometry)
            .chain(tracks)
            .chain(sensors)
            .chain(ship)
            .chain([reference])
            .find(|(_, rate)| rate.si() > most)
        {
            None => Ok(()),
            Some((field, rate)) => {
                let message = format!("{} Hz for {duration} s are more than {MOST_ROWS:e} rows", rate.si());
                let help = format!("write a rate of at most {most:.3e} Hz, or let the run be shorter; are the units right?");
                Err(BuildError::at(field, message).help(help))
            }
        }
    }
}

/// The most rows that a stream has in a run, and in a second of one: more do not come to an end in
/// a day's work, and closer ones share a stamp, which is a whole number of nanoseconds.
const MOST_ROWS: f64 = 1e9;

/// Ten per second.
fn reference_rate() -> Positive<dim::Frequency> {
    const TEN_HERTZ: &str = "10 Hz";
    #[expect(clippy::expect_used, reason = "a constant, and a test reads it")]
    Positive::from_text(TEN_HERTZ).expect("a frequency")
}

/// An array of any of the registered segments, each with its `type`.
fn segments_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "minItems": 1, "items": any_of(Role::Segment) })
}

/// Any of the registered vehicles.
fn vehicle_schema(_: &mut SchemaGenerator) -> Schema {
    any_of(Role::Vehicle)
}

/// Any of the registered controllers.
fn control_schema(_: &mut SchemaGenerator) -> Schema {
    any_of(Role::Control)
}

/// An array of any of the registered tasks.
fn mission_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": any_of(Role::Task) })
}

/// Any of the registered blocks of a role, with its `type`.
fn any_of(role: Role) -> Schema {
    let block = |r: &&registry::Registration| {
        let mut schema = (r.schema)();
        schema.remove("$schema");
        if let Some(properties) = schema
            .ensure_object()
            .entry("properties")
            .or_insert_with(|| json_schema!({}).into())
            .as_object_mut()
        {
            properties.insert("type".to_owned(), json_schema!({ "const": r.name }).into());
        }
        schema
    };
    let any: Vec<Schema> = registry::all().iter().filter(|r| r.role == role).map(block).collect();
    json_schema!({ "anyOf": any })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_read() {
        let spec: SimulationSpec = toml::from_str("trajectory = [{ rest = { duration = '1 s' } }]").unwrap();
        assert_eq!(spec.reference_rate.si(), 10.0);
        assert!(spec.imu.is_none() && !spec.draw_parameters && !spec.draw_start && spec.sensor.is_empty());
        assert_eq!(spec.trajectory().unwrap().duration(), 1.0);
    }

    #[test]
    fn rates_that_would_never_come_to_an_end_are_refused() {
        let said = |rates: &str, duration: f64| {
            let spec: SimulationSpec = toml::from_str(&format!("{rates}\ntrajectory = []")).unwrap();
            spec.check_rates(duration).map_err(|e| e.field).err()
        };
        let rates = "imu = { rate = '10 MHz' }\nreference_rate = '10 MHz'\nsensor.gnss = { rate = '10 MHz' }";
        assert_eq!(said(rates, 100.0), None);
        assert_eq!(said(&rates.replacen("10 MHz", "10.1 MHz", 1), 100.0).unwrap(), "imu.rate");
        assert_eq!(said("sensor.gnss = { rate = '1e12 Hz' }", 60.0).unwrap(), "sensor.gnss.rate");
        // However short the run: two rows would share a stamp.
        assert_eq!(said("sensor.gnss = { rate = '1.1e9 Hz' }", 1e-3).unwrap(), "sensor.gnss.rate");
        // Ten times a second, for three years and two months.
        assert_eq!(said("", 1.0e8), None);
        assert_eq!(said("", 1.1e8).unwrap(), "reference_rate");
    }

    #[test]
    fn the_start_is_relative_to_the_origin_of_the_run() {
        let text = "start = { position = [1, 2, 3], heading = '90 deg' }\ntrajectory = [{ rest = { duration = 1 } }]";
        let start = toml::from_str::<SimulationSpec>(text).unwrap().trajectory().unwrap().at(0.0);
        assert_eq!(start.position, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(start.rpy.z, core::f64::consts::FRAC_PI_2);
    }

    #[test]
    fn the_schema_lists_every_segment_with_its_type() {
        let schema = serde_json::to_value(schemars::schema_for!(SimulationSpec)).unwrap();
        let segments = schema["properties"]["trajectory"]["items"]["anyOf"].as_array().unwrap();
        let names: Vec<_> = segments
            .iter()
            .map(|s| s["properties"]["type"]["const"].as_str().unwrap())
            .collect();
        assert_eq!(names, registry::names(Role::Segment));
        assert!(names.contains(&"turn"));
    }
}
