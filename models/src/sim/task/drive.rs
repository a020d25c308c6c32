//! Running on a heading.

use super::wait::Ends;
use super::{Goal, Seen, Task, TaskSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, Quantity, dim};
use fusion_core::Time;
use fusion_core::math;
use nalgebra::Vector2;
use schemars::JsonSchema;

/// Runs on a heading, which alone is controlled: an error across is not corrected.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveSpec {
    /// The heading.
    heading: Quantity<dim::Angle>,
    /// Speed ahead; slower before the end of a distance.
    speed: Positive<dim::Speed>,
    /// So far along the heading; this, `duration` or `until`.
    distance: Option<Positive<dim::Length>>,
    /// For so long; this, `distance` or `until`.
    duration: Option<NonNegative<dim::Duration>>,
    /// Up to this time of the run; not at all where that is over. This, `distance` or `duration`.
    until: Option<NonNegative<dim::Duration>>,
}

crate::register!(
    Task,
    "drive",
    DriveSpec,
    r#"
heading = "90 deg"
speed = "0.3 m/s"
distance = "10 m"
"#
);

#[typetag::deserialize(name = "drive")]
impl TaskSpec for DriveSpec {
    fn build(&self) -> Result<Box<dyn Task>, BuildError> {
        let either = || BuildError::at("distance", "state one of `distance`, `duration` and `until`");
        let timed = self.duration.or(self.until).is_some();
        let end = match self.distance {
            Some(_) if timed => return Err(either()),
            Some(distance) => End::Far(distance.si()),
            None => End::Timed(Ends::new(self.duration, self.until).ok_or_else(either)?),
        };
        let (sin, cos) = math::sin_cos(self.heading.si());
        Ok(Box::new(Drive {
            heading: self.heading.si(),
            ahead: Vector2::new(cos, sin),
            speed: self.speed.si(),
            end,
            begun: (Time::default(), Vector2::zeros()),
        }))
    }
}

#[derive(Clone, Debug)]
enum End {
    /// Metres along the heading.
    Far(f64),
    Timed(Ends),
}

#[derive(Clone, Debug)]
struct Drive {
    heading: f64,
    ahead: Vector2<f64>,
    speed: f64,
    end: End,
    begun: (Time, Vector2<f64>),
}

impl Task for Drive {
    fn name(&self) -> String {
        format!("drive at {:.0}°", self.heading.to_degrees())
    }

    fn begin(&mut self, seen: &Seen) {
        self.begun = (seen.time, seen.position);
    }

    fn path(&self, from: &Vector2<f64>) -> Option<[Vector2<f64>; 2]> {
        match &self.end {
            End::Far(distance) => Some([*from, from + self.ahead * *distance]),
            End::Timed(_) => None,
        }
    }

    fn goal(&mut self, seen: &Seen) -> Option<Goal> {
        let (time, place) = self.begun;
        let to_go = match &self.end {
            End::Far(distance) => Some(distance - (seen.position - place).dot(&self.ahead)),
            End::Timed(_) => None,
        };
        let is_over = match &self.end {
            End::Far(_) => to_go.is_some_and(|left| left <= 0.0),
            End::Timed(ends) => ends.has_come(time, seen.time),
        };
        (!is_over).then_some(Goal::Heading {
            heading: self.heading,
            speed: self.speed,
            to_go,
        })
    }
}
