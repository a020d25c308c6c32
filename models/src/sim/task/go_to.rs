//! Running to a waypoint.

use super::{Goal, Seen, Task, TaskSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Axes, NonNegative, Positive, dim, range};
use fusion_core::math;
use nalgebra::Vector2;
use schemars::JsonSchema;

/// Runs to a waypoint, along the straight line from where the task begins, or from `from`.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoToSpec {
    /// The waypoint: north, east of the origin of the run.
    to: Axes<dim::Length, range::Finite, 2>,
    /// Where the line begins: north, east of the origin of the run; where the vehicle takes itself to be
    /// without it.
    from: Option<Axes<dim::Length, range::Finite, 2>>,
    /// Speed ahead; slower before the end.
    speed: Positive<dim::Speed>,
    /// How near is enough; without it the line is run to its end.
    #[serde(default)]
    radius: NonNegative<dim::Length>,
}

crate::register!(
    Task,
    "go_to",
    GoToSpec,
    r#"
to = ["28 m", "-3 m"]
speed = "0.3 m/s"
radius = "1 m"
"#
);

#[typetag::deserialize(name = "go_to")]
impl TaskSpec for GoToSpec {
    fn follows_line(&self) -> bool {
        true
    }

    fn build(&self) -> Result<Box<dyn Task>, BuildError> {
        Ok(Box::new(GoTo {
            to: self.to.si().into(),
            from: self.from.map(|from| from.si().into()),
            speed: self.speed.si(),
            radius: self.radius.si(),
            begun: Vector2::zeros(),
        }))
    }
}

#[derive(Clone, Debug)]
struct GoTo {
    to: Vector2<f64>,
    from: Option<Vector2<f64>>,
    speed: f64,
    radius: f64,
    begun: Vector2<f64>,
}

impl Task for GoTo {
    fn name(&self) -> String {
        format!("go to {:.1} N, {:.1} E", self.to.x, self.to.y)
    }

    fn target(&self) -> Option<Vector2<f64>> {
        Some(self.to)
    }

    fn path(&self, from: &Vector2<f64>) -> Option<[Vector2<f64>; 2]> {
        Some([self.from.unwrap_or(*from), self.to])
    }

    fn begin(&mut self, seen: &Seen) {
        self.begun = self.from.unwrap_or(seen.position);
    }

    fn goal(&mut self, seen: &Seen) -> Option<Goal> {
        let along = (self.to - self.begun).try_normalize(0.0)?;
        let left = self.to - seen.position;
        let to_go = left.dot(&along);
        if to_go <= 0.0 || left.norm() <= self.radius {
            return None;
        }
        Some(Goal::Line {
            from: self.begun,
            course: math::atan2(along.y, along.x),
            speed: self.speed,
            to_go,
        })
    }
}
