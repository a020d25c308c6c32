//! Departures from the level: a climb, a bump.

use super::super::profile::{pulse, step7};
use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Positive, Quantity, Vec3Of, dim};
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;

/// Climbs or dives straight ahead, the nose along the path, and ends level. The horizontal speed
/// stays.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClimbSpec {
    /// Height gained; negative: lost.
    height: Quantity<dim::Length>,
    /// Horizontal distance; this or `duration`.
    distance: Option<Positive<dim::Length>>,
    /// Duration; this or `distance`.
    duration: Option<Positive<dim::Duration>>,
}

crate::register!(
    Segment,
    "climb",
    ClimbSpec,
    r#"
height = "-3 m"
distance = "20 m"
"#
);

#[typetag::deserialize(name = "climb")]
impl SegmentSpec for ClimbSpec {
    fn is_afloat(&self) -> bool {
        false
    }

    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        let speed = from.moving()?;
        let duration = match (self.distance, self.duration) {
            (Some(distance), None) => distance.si() / speed,
            (None, Some(duration)) => duration.si(),
            _ => return Err(BuildError::at("distance", "state either `distance` or `duration`")),
        };
        Ok(Box::new(Climb {
            from: *from,
            height: self.height.si(),
            duration,
        }))
    }
}

#[derive(Debug)]
struct Climb {
    from: Junction,
    height: f64,
    duration: f64,
}

impl Segment for Climb {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        let (ahead, _) = self.from.axes();
        let speed = self.from.speed;
        let up = step7(t / self.duration).stretched(self.height, self.duration);
        let slope = up.first / speed;
        Motion {
            position: self.from.position + ahead * (speed * t) - Vector3::z() * up.value,
            velocity: ahead * speed - Vector3::z() * up.first,
            acceleration: -Vector3::z() * up.second,
            rpy: Vector3::new(0.0, math::atan(slope), self.from.heading),
            rpy_rate: Vector3::new(0.0, up.second / speed / (1.0 + slope * slope), 0.0),
        }
    }
}

/// A bump: heading, pitch and velocity deviate to one side and then to the other, and the height
/// changes permanently. Otherwise the body keeps its course and speed.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BumpSpec {
    /// How long.
    duration: Positive<dim::Duration>,
    /// Change of height.
    #[serde(default)]
    height: Quantity<dim::Length>,
    /// Greatest pitch, first up where positive.
    #[serde(default)]
    pitch: Quantity<dim::Angle>,
    /// Greatest departure from the heading, first to the right where positive.
    #[serde(default)]
    heading: Quantity<dim::Angle>,
    /// Greatest additional velocity, north east down; its integral is 0.
    #[serde(default)]
    velocity: Vec3Of<dim::Speed>,
}

crate::register!(
    Segment,
    "bump",
    BumpSpec,
    r#"
duration = "0.8 s"
height = "-5 cm"
pitch = "8 deg"
heading = "5 deg"
velocity = ["0.6 m/s", 0, 0]
"#
);

#[typetag::deserialize(name = "bump")]
impl SegmentSpec for BumpSpec {
    fn is_afloat(&self) -> bool {
        false
    }

    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        Ok(Box::new(Bump {
            from: *from,
            duration: self.duration.si(),
            height: self.height.si(),
            angles: Vector3::new(0.0, self.pitch.si(), self.heading.si()),
            velocity: Vector3::from(self.velocity.si()),
        }))
    }
}

#[derive(Debug)]
struct Bump {
    from: Junction,
    duration: f64,
    height: f64,
    /// Roll, pitch, heading \[rad\].
    angles: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl Segment for Bump {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        let (ahead, _) = self.from.axes();
        let u = t / self.duration;
        let up = step7(u).stretched(self.height, self.duration);
        let (moved, swing) = pulse(u);
        let swing = swing.stretched(1.0, self.duration);
        Motion {
            position: self.from.position + ahead * (self.from.speed * t) - Vector3::z() * up.value
                + self.velocity * (moved * self.duration),
            velocity: ahead * self.from.speed - Vector3::z() * up.first + self.velocity * swing.value,
            acceleration: -Vector3::z() * up.second + self.velocity * swing.first,
            rpy: self.angles * swing.value + Vector3::new(0.0, 0.0, self.from.heading),
            rpy_rate: self.angles * swing.first,
        }
    }
}
