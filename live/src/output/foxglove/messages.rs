//! The messages of the channels, in JSON, and their schemas.
//!
//! Source    Foxglove, the schemas `foxglove.LocationFix`, `PoseInFrame`, `FrameTransform` and `Log`

use super::protocol::Channel;
use crate::output::line::Line;
use crate::output::{Outgoing, SensorNow};
use fusion::core::health::State;
use fusion::output::pose::{Pose, enu_covariance, to_enu};
use fusion::solution::{Solution, rpy_of};
use nalgebra::Vector3;
use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{JsonSchema, Schema};
use serde::Serialize;
use serde_json::Value;

/// The frames: east, north, up from the origin of local coordinates, and forward, left, up.
const WORLD: &str = "map";
const BODY: &str = "base_link";

/// The channels in their order; then those of the sensors.
pub(super) const FIX: usize = 0;
pub(super) const POSE: usize = 1;
pub(super) const TRANSFORM: usize = 2;
pub(super) const ESTIMATE: usize = 3;
pub(super) const HEALTH: usize = 4;
pub(super) const SENSORS: usize = 5;

/// All channels of a run with these sensors.
pub(super) fn channels(sensors: &[String]) -> Vec<Channel> {
    let channel = |topic: String, schema_name, schema| Channel {
        topic,
        schema_name,
        schema,
    };
    let mut all = vec![
        channel("/fix".to_owned(), "foxglove.LocationFix", schema::<LocationFix>()),
        channel("/pose".to_owned(), "foxglove.PoseInFrame", schema::<PoseInFrame>()),
        channel("/tf".to_owned(), "foxglove.FrameTransform", schema::<FrameTransform>()),
        channel("/estimate".to_owned(), "fusion.Estimate", schema::<Line<'_>>()),
        channel("/health".to_owned(), "foxglove.Log", schema::<Log>()),
    ];
    let innovation = schema::<Innovation<'_>>();
    let of_sensor = |sensor| channel(format!("/innovations/{sensor}"), "fusion.Innovation", innovation.clone());
    all.extend(sensors.iter().map(of_sensor));
    all
}

/// The schema of a message. Foxglove reads no references and no types that may be null.
fn schema<T: JsonSchema>() -> String {
    let mut settings = SchemaSettings::draft2020_12().for_serialize();
    settings.inline_subschemas = true;
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    RecursiveTransform(|schema: &mut Schema| {
        if let Some(Value::Array(types)) = schema.get_mut("type")
            && let [one, Value::String(null)] = &types[..]
            && null == "null"
        {
            let one = one.clone();
            schema.insert("type".to_owned(), one);
        }
    })
    .transform(&mut schema);
    schema.to_value().to_string()
}

/// Seconds and nanoseconds since 1970-01-01.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
struct Stamp {
    sec: u64,
    nsec: u32,
}

impl Stamp {
    const fn of(nanos: u64) -> Self {
        Self {
            sec: nanos / 1_000_000_000,
            nsec: (nanos % 1_000_000_000) as u32,
        }
    }
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

impl From<Vector3<f64>> for Xyz {
    fn from(v: Vector3<f64>) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl Quaternion {
    fn of(Pose { q, .. }: &Pose) -> Self {
        Self {
            x: q.i,
            y: q.j,
            z: q.k,
            w: q.w,
        }
    }
}

/// The position of the body origin, for a map.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct LocationFix {
    timestamp: Stamp,
    frame_id: &'static str,
    /// Degrees.
    latitude: f64,
    /// Degrees.
    longitude: f64,
    /// Metres above the ellipsoid.
    altitude: f64,
    /// East, north, up, in square metres.
    position_covariance: [f64; 9],
    position_covariance_type: u8,
    /// Clockwise from north, in radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    heading: Option<f64>,
    /// East, north, up, in metres per second.
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity: Option<Xyz>,
}

impl LocationFix {
    /// All of the covariance is known.
    const KNOWN: u8 = 3;

    /// `None` without a finite position.
    pub(super) fn of(time: u64, solution: &Solution) -> Option<Self> {
        let (place, covariance) = solution.position?;
        let is_finite = [place.lat, place.lon, place.height].iter().all(|number| number.is_finite());
        let mut position_covariance = [0.0; 9];
        position_covariance.copy_from_slice(enu_covariance(&covariance).transpose().as_slice());
        is_finite.then(|| Self {
            timestamp: Stamp::of(time),
            frame_id: BODY,
            latitude: place.lat.to_degrees(),
            longitude: place.lon.to_degrees(),
            altitude: place.height,
            position_covariance,
            position_covariance_type: Self::KNOWN,
            heading: solution.attitude.map(|(q, p)| rpy_of(&q, &p).0.z),
            velocity: solution.velocity.map(|(v, _)| to_enu(&v).into()),
        })
    }
}

/// The pose of the body in the world.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct PoseInFrame {
    timestamp: Stamp,
    frame_id: &'static str,
    pose: PositionAndOrientation,
}

#[derive(Debug, Serialize, JsonSchema)]
struct PositionAndOrientation {
    position: Xyz,
    orientation: Quaternion,
}

impl PoseInFrame {
    pub(super) fn of(time: u64, pose: &Pose) -> Self {
        Self {
            timestamp: Stamp::of(time),
            frame_id: WORLD,
            pose: PositionAndOrientation {
                position: pose.p.into(),
                orientation: Quaternion::of(pose),
            },
        }
    }
}

/// The pose of the body in the world, as a frame for other messages.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct FrameTransform {
    timestamp: Stamp,
    parent_frame_id: &'static str,
    child_frame_id: &'static str,
    translation: Xyz,
    rotation: Quaternion,
}

impl FrameTransform {
    pub(super) fn of(time: u64, pose: &Pose) -> Self {
        Self {
            timestamp: Stamp::of(time),
            parent_frame_id: WORLD,
            child_frame_id: BODY,
            translation: pose.p.into(),
            rotation: Quaternion::of(pose),
        }
    }
}

/// A change of the health of the filter.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Log<'a> {
    timestamp: Stamp,
    level: u8,
    message: &'a str,
    name: &'static str,
    file: &'static str,
    line: u32,
}

impl<'a> Log<'a> {
    const INFO: u8 = 2;
    const WARNING: u8 = 3;
    const ERROR: u8 = 4;

    pub(super) fn of(time: u64, state: State, message: &'a str) -> Self {
        Self {
            timestamp: Stamp::of(time),
            level: match state {
                State::Good => Self::INFO,
                State::Aligning | State::Coasting | State::Degraded => Self::WARNING,
                State::Lost => Self::ERROR,
            },
            message,
            name: "filter",
            file: "",
            line: 0,
        }
    }
}

/// The health with its reasons: `degraded: gnss rejected`.
pub(super) fn health(estimate: &Outgoing) -> String {
    let mut text = estimate.health.word().to_owned();
    let waits_for = match &estimate.waits_for[..] {
        [] => None,
        all => Some(format!("waits for {}", all.join(", "))),
    };
    let parts: Vec<&str> = estimate.reasons.iter().chain(&waits_for).map(String::as_str).collect();
    if !parts.is_empty() {
        text.push_str(": ");
        text.push_str(&parts.join("; "));
    }
    text
}

/// The latest measurement of a sensor.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Innovation<'a> {
    /// The time of the measurement: seconds of the filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
    /// Whether it was used; else the gate has rejected it.
    is_used: bool,
    /// The normalised innovation squared.
    #[serde(skip_serializing_if = "Option::is_none")]
    nis: Option<f64>,
    /// In the units of the rows of the sensor.
    residual: &'a [f64],
    /// The predicted 1σ of the residual.
    sigma: &'a [f64],
    /// Measurements used so far.
    used: u64,
    /// Measurements that the gate has rejected so far.
    rejected: u64,
}

impl<'a> Innovation<'a> {
    pub(super) fn of(sensor: &'a SensorNow) -> Self {
        Self {
            time: sensor.time.map(fusion::core::time::Time::seconds),
            is_used: sensor.is_used,
            nis: sensor.nis,
            residual: &sensor.residual,
            sigma: &sensor.sigma,
            used: sensor.used,
            rejected: sensor.rejected,
        }
    }
}
