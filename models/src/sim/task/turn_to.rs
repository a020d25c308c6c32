//! A turn on the spot.

use super::{Goal, Seen, Task, TaskSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, Quantity, dim};
use fusion_core::Time;
use fusion_core::geometry::so3::wrap_angle;
use schemars::JsonSchema;

/// Turns on the spot to a heading, the shorter way.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurnToSpec {
    /// The heading.
    heading: Quantity<dim::Angle>,
    /// How near the heading must come.
    within: Positive<dim::Angle>,
    /// How long it must stay so near.
    #[serde(default, rename = "for")]
    settled: NonNegative<dim::Duration>,
}

crate::register!(
    Task,
    "turn_to",
    TurnToSpec,
    r#"
heading = "90 deg"
within = "1 deg"
for = "1 s"
"#
);

#[typetag::deserialize(name = "turn_to")]
impl TaskSpec for TurnToSpec {
    fn build(&self) -> Result<Box<dyn Task>, BuildError> {
        Ok(Box::new(TurnTo {
            heading: self.heading.si(),
            within: self.within.si(),
            settled: self.settled.si(),
            near_since: None,
        }))
    }
}

#[derive(Clone, Debug)]
struct TurnTo {
    heading: f64,
    within: f64,
    settled: f64,
    near_since: Option<Time>,
}

impl Task for TurnTo {
    fn name(&self) -> String {
        format!("turn to {:.0}°", self.heading.to_degrees())
    }

    fn is_on_the_spot(&self) -> bool {
        true
    }

    fn begin(&mut self, _: &Seen) {
        self.near_since = None;
    }

    fn goal(&mut self, seen: &Seen) -> Option<Goal> {
        if wrap_angle(self.heading - seen.heading).abs() > self.within {
            self.near_since = None;
        } else {
            let since = *self.near_since.get_or_insert(seen.time);
            if seen.time.seconds_since(since) >= self.settled {
                return None;
            }
        }
        Some(Goal::Heading {
            heading: self.heading,
            speed: 0.0,
            to_go: None,
        })
    }
}
