//! Messages of MAVLink 2.
//!
//! | message | has |
//! |---|---|
//! | `ODOMETRY` | position and attitude in local axes, velocity in body axes, both covariances, health |
//! | `VISION_POSITION_ESTIMATE` | position, roll, pitch and yaw in local axes, with covariance |
//! | `GPS_INPUT` | place, velocity, 1σ, GPS week, heading: in place of a receiver |
//! | `GLOBAL_POSITION_INT` | place, velocity and heading, for a ground station |
//!
//! Local axes are north, east, down from the origin of local coordinates (`MAV_FRAME_LOCAL_NED`), body axes forward,
//! right, down (`MAV_FRAME_BODY_FRD`). A covariance of a pose is that of north, east, down, roll, pitch, yaw: with the error
//! δθ of the attitude in body axes, the angles err by E δθ, E being the rates of the angles by those of the body.
//!
//! Unknown   angular rates and their covariance are NaN; the dilution of precision is 65535, the satellites are 255
//! Not here  heights above mean sea level: `alt` is the height of the filter, which has the datum of its sources
//! Source    <https://mavlink.io/en/messages/common.html>

#[cfg(test)]
mod tests;

use super::{About, Outgoing, Output, OutputSpec};
use crate::link::Sender;
use fusion::core::geometry::so3;
use fusion::core::health::State;
use fusion::core::math;
use fusion::models::register;
use fusion::output::Origin;
use fusion::solution::{Solution, sigmas};
use fusion::source::decode::OneOrMany;
use fusion::source::table::unix_of_gps;
use fusion_formats::mavlink::{self, Message};
use nalgebra::{Matrix6, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind};

/// Messages of MAVLink 2 for an autopilot or a ground station, with each estimate. Nothing is sent before the filter has
/// started, but `GPS_INPUT` without a fix.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MavlinkSpec {
    /// The link by which it is sent.
    link: String,
    /// The message, or several.
    message: OneOrMany<Kind>,
    /// The number of the system, which is that of the vehicle.
    #[serde(default = "first_system")]
    system_id: u8,
    /// The number of the component.
    #[serde(default = "odometry_component")]
    component_id: u8,
}

register! { Output, "mavlink", MavlinkSpec, "link = \"autopilot\"\nmessage = [\"odometry\", \"gps_input\"]" }

const fn first_system() -> u8 {
    1
}

/// `MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY`
const fn odometry_component() -> u8 {
    197
}

/// A message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Kind {
    /// Pose in local axes, velocity in body axes.
    Odometry,
    /// Pose in local axes.
    VisionPositionEstimate,
    /// The fix of a receiver.
    GpsInput,
    /// The place, for a ground station.
    GlobalPositionInt,
}

#[typetag::deserialize(name = "mavlink")]
impl OutputSpec for MavlinkSpec {
    fn link(&self) -> Option<&str> {
        Some(&self.link)
    }

    fn open(&self, about: &About) -> io::Result<Box<dyn Output>> {
        let of = |kind: &Kind| {
            let name = kind.name();
            let none = || {
                io::Error::new(
                    ErrorKind::InvalidInput,
                    format!("no definition of the message `{name}` can be read"),
                )
            };
            Ok((*kind, Message::named(name).ok_or_else(none)?))
        };
        let messages = self.message.iter().map(of).collect::<io::Result<Vec<_>>>()?;
        if messages.is_empty() {
            return Err(io::Error::new(
                ErrorKind::InvalidInput,
                "an output of the type `mavlink` has a `message`",
            ));
        }
        Ok(Box::new(Messages {
            messages,
            origin: about.origin.clone(),
            from: mavlink::Sender {
                system: self.system_id,
                component: self.component_id,
                sequence: 0,
            },
            is_lost: false,
            resets: 0,
        }))
    }
}

/// Writes messages.
#[derive(Debug)]
struct Messages {
    messages: Vec<(Kind, &'static Message)>,
    origin: Origin,
    from: mavlink::Sender,
    is_lost: bool,
    /// How often the filter has started, or has found its place again.
    resets: u8,
}

/// The fields of a message.
type Fields = Vec<(&'static str, Vec<f64>)>;

impl Output for Messages {
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()> {
        let is_lost = estimate.health == State::Lost || estimate.solution.is_none();
        if core::mem::replace(&mut self.is_lost, is_lost) && !is_lost {
            self.resets = self.resets.wrapping_add(1);
        }
        let mut bytes = Vec::new();
        for (kind, message) in &self.messages {
            let Some(fields) = self.fields(*kind, estimate) else { continue };
            let fields: Vec<(&str, &[f64])> = fields.iter().map(|(name, values)| (*name, values.as_slice())).collect();
            bytes.extend(message.frame(&self.from, &fields).map_err(io::Error::other)?);
            self.from.sequence = self.from.sequence.wrapping_add(1);
        }
        if bytes.is_empty() {
            return Ok(());
        }
        let to = to.ok_or_else(|| io::Error::new(ErrorKind::NotConnected, "the link is not open"))?;
        to.send(&bytes)
    }
}

impl Messages {
    /// The fields of a message; `None` if the estimate does not have them.
    fn fields(&self, kind: Kind, estimate: &Outgoing) -> Option<Fields> {
        match (kind, &estimate.solution) {
            (Kind::GpsInput, solution) => Some(gps_input(solution.as_ref(), estimate)),
            (_, None) => None,
            (Kind::Odometry, Some(solution)) => self.odometry(solution, estimate),
            (Kind::VisionPositionEstimate, Some(solution)) => self.vision(solution, estimate),
            (Kind::GlobalPositionInt, Some(solution)) => self.global(solution, estimate),
        }
    }

    fn odometry(&self, solution: &Solution, estimate: &Outgoing) -> Option<Fields> {
        /// `MAV_FRAME_LOCAL_NED` and `MAV_FRAME_BODY_FRD`.
        const FRAMES: [f64; 2] = [1.0, 12.0];
        let (place, _) = solution.position.as_ref()?;
        let (q, _) = solution.attitude.as_ref()?;
        let unknown = Vector3::repeat(f64::NAN);
        let mut of_velocity = Matrix6::repeat(f64::NAN);
        let velocity = solution.body_velocity().map_or(unknown, |(velocity, covariance)| {
            of_velocity.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance);
            velocity
        });
        let mut fields = vec![
            ("time_usec", vec![microseconds(estimate)]),
            ("frame_id", vec![FRAMES[0]]),
            ("child_frame_id", vec![FRAMES[1]]),
            ("q", vec![q.w, q.i, q.j, q.k]),
            ("pose_covariance", upper(&pose_covariance(solution)?)),
            ("velocity_covariance", upper(&of_velocity)),
            ("reset_counter", vec![self.resets.into()]),
            ("quality", vec![quality(estimate.health)]),
        ];
        along(&mut fields, ["x", "y", "z"], self.origin.to_ned(place));
        along(&mut fields, ["vx", "vy", "vz"], velocity);
        along(&mut fields, ["rollspeed", "pitchspeed", "yawspeed"], unknown);
        Some(fields)
    }

    fn vision(&self, solution: &Solution, estimate: &Outgoing) -> Option<Fields> {
        let (place, _) = solution.position.as_ref()?;
        let (rpy, _) = solution.rpy()?;
        let mut fields = vec![
            ("usec", vec![microseconds(estimate)]),
            ("covariance", upper(&pose_covariance(solution)?)),
            ("reset_counter", vec![self.resets.into()]),
        ];
        along(&mut fields, ["x", "y", "z"], self.origin.to_ned(place));
        along(&mut fields, ["roll", "pitch", "yaw"], rpy);
        Some(fields)
    }

    fn global(&self, solution: &Solution, estimate: &Outgoing) -> Option<Fields> {
        /// The heading if it is not known.
        const UNKNOWN: f64 = 65_535.0;
        let (place, _) = solution.position.as_ref()?;
        let (velocity, _) = solution.velocity?;
        // The time turns after 49.7 days.
        let milliseconds = estimate.time.nanos().div_euclid(1_000_000).rem_euclid(1 << 32);
        let mut fields = vec![
            ("time_boot_ms", vec![milliseconds as f64]),
            ("lat", vec![place.lat.to_degrees() * 1e7]),
            ("lon", vec![place.lon.to_degrees() * 1e7]),
            ("alt", vec![place.height * 1e3]),
            ("relative_alt", vec![-self.origin.to_ned(place).z * 1e3]),
            ("hdg", vec![heading(solution).unwrap_or(UNKNOWN)]),
        ];
        along(&mut fields, ["vx", "vy", "vz"], velocity * 100.0);
        Some(fields)
    }
}

/// A fix. Without a place, its type is "no fix".
fn gps_input(solution: Option<&Solution>, estimate: &Outgoing) -> Fields {
    const WEEK: i64 = 7 * 86_400 * 1_000_000_000;
    /// `GPS_INPUT_IGNORE_FLAGS`: the dilution of precision; velocity and its accuracy; all.
    const OF_DILUTION: u8 = 2 | 4;
    const OF_VELOCITY: u8 = 8 | 16 | 32;
    const OF_ALL: u8 = 255;
    const UNKNOWN: [f64; 2] = [65_535.0, 255.0];
    const FIX_3D: f64 = 3.0;
    let date = estimate.gps_nanos.unwrap_or(0);
    let mut fields = vec![
        ("time_usec", vec![microseconds(estimate)]),
        ("time_week", vec![date.div_euclid(WEEK) as f64]),
        ("time_week_ms", vec![(date.rem_euclid(WEEK) / 1_000_000) as f64]),
        ("hdop", vec![UNKNOWN[0]]),
        ("vdop", vec![UNKNOWN[0]]),
    ];
    let is_known = estimate.health != State::Lost;
    let fix = solution
        .filter(|_| is_known)
        .and_then(|solution| Some((solution, solution.position?)));
    let Some((solution, (place, covariance))) = fix else {
        fields.push(("ignore_flags", vec![OF_ALL.into()]));
        return fields;
    };
    let sigma = sigmas(&covariance);
    fields.extend([
        ("fix_type", vec![FIX_3D]),
        ("lat", vec![place.lat.to_degrees() * 1e7]),
        ("lon", vec![place.lon.to_degrees() * 1e7]),
        ("alt", vec![place.height]),
        ("horiz_accuracy", vec![sigma.x.max(sigma.y)]),
        ("vert_accuracy", vec![sigma.z]),
        ("satellites_visible", vec![UNKNOWN[1]]),
    ]);
    let mut ignored = OF_DILUTION;
    match &solution.velocity {
        Some((velocity, covariance)) => {
            along(&mut fields, ["vn", "ve", "vd"], *velocity);
            fields.push(("speed_accuracy", vec![sigmas(covariance).max()]));
        }
        None => ignored |= OF_VELOCITY,
    }
    fields.push(("ignore_flags", vec![ignored.into()]));
    // Zero is an unknown heading: north is 360°.
    if let (Some(heading), false) = (heading(solution), estimate.health == State::Aligning) {
        fields.push(("yaw", vec![if heading == 0.0 { 36_000.0 } else { heading }]));
    }
    fields
}

impl Kind {
    /// The name of the message.
    const fn name(self) -> &'static str {
        match self {
            Self::Odometry => "ODOMETRY",
            Self::VisionPositionEstimate => "VISION_POSITION_ESTIMATE",
            Self::GpsInput => "GPS_INPUT",
            Self::GlobalPositionInt => "GLOBAL_POSITION_INT",
        }
    }
}

/// Adds a field for each axis.
fn along(fields: &mut Fields, names: [&'static str; 3], values: Vector3<f64>) {
    fields.extend(names.into_iter().zip(&values).map(|(name, value)| (name, vec![*value])));
}

/// Microseconds since 1970, or since time zero of the filter if the date is not known.
fn microseconds(estimate: &Outgoing) -> f64 {
    let nanos = estimate.gps_nanos.map_or(estimate.time.nanos(), unix_of_gps);
    nanos.div_euclid(1000).max(0) as f64
}

/// The heading in hundredths of a degree, from 0 to 35999.
fn heading(solution: &Solution) -> Option<f64> {
    let (rpy, _) = solution.rpy()?;
    let hundredths = math::round(rpy.z.to_degrees() * 100.0) as i64;
    Some(hundredths.rem_euclid(36_000) as f64)
}

/// The health in percent: equal steps in the order of [`State::ALL`], and −1 for a filter that has failed.
const fn quality(health: State) -> f64 {
    match health {
        State::Good => 100.0,
        State::Aligning => 75.0,
        State::Coasting => 50.0,
        State::Degraded => 25.0,
        State::Lost => -1.0,
    }
}

/// The covariance of north, east, down \[m\], roll, pitch, yaw \[rad\]; NaN beyond the range of a message, as at the
/// vertical, where these angles are not defined.
fn pose_covariance(solution: &Solution) -> Option<Matrix6<f64>> {
    let (_, of_position) = solution.position.as_ref()?;
    let (q, of_attitude) = solution.attitude.as_ref()?;
    let rpy = so3::to_rpy(q);
    let e = so3::euler_rate_of_body(rpy.x, rpy.y);
    let across = solution.with_attitude[0] * e.transpose();
    let mut all = Matrix6::zeros();
    all.fixed_view_mut::<3, 3>(0, 0).copy_from(of_position);
    all.fixed_view_mut::<3, 3>(0, 3).copy_from(&across);
    all.fixed_view_mut::<3, 3>(3, 3).copy_from(&(e * of_attitude * e.transpose()));
    let is_finite = all.iter().all(|x| (*x as f32).is_finite());
    Some(if is_finite { all } else { Matrix6::repeat(f64::NAN) })
}

/// The upper triangle, row by row.
fn upper(all: &Matrix6<f64>) -> Vec<f64> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j))).map(|at| all[at]).collect()
}
