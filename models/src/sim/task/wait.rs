//! Standing still.

use super::{Goal, Seen, Task, TaskSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, dim};
use fusion_core::Time;
use schemars::JsonSchema;

/// How long something takes: a duration, or until a time of the run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ends {
    After(f64),
    At(Time),
}

impl Ends {
    pub(super) fn new(duration: Option<NonNegative<dim::Duration>>, until: Option<NonNegative<dim::Duration>>) -> Option<Self> {
        match (duration, until) {
            (Some(duration), None) => Some(Self::After(duration.si())),
            (None, Some(until)) => Some(Self::At(Time::from_seconds(until.si()))),
            _ => None,
        }
    }

    /// Whether a wait that began at `begun` is over.
    pub(super) fn has_come(&self, begun: Time, now: Time) -> bool {
        match self {
            Self::After(duration) => now.seconds_since(begun) >= *duration,
            Self::At(time) => now >= *time,
        }
    }
}

/// Stands still.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaitSpec {
    /// How long; this or `until`.
    duration: Option<NonNegative<dim::Duration>>,
    /// Until this time of the run; no wait if it has passed. This or `duration`.
    until: Option<NonNegative<dim::Duration>>,
}

crate::register!(
    Task,
    "wait",
    WaitSpec,
    r#"
duration = "10 s"
"#
);

#[typetag::deserialize(name = "wait")]
impl TaskSpec for WaitSpec {
    fn build(&self) -> Result<Box<dyn Task>, BuildError> {
        let ends = Ends::new(self.duration, self.until);
        let ends = ends.ok_or_else(|| BuildError::at("duration", "state either `duration` or `until`"))?;
        Ok(Box::new(Wait {
            ends,
            begun: Time::default(),
        }))
    }
}

#[derive(Clone, Debug)]
struct Wait {
    ends: Ends,
    begun: Time,
}

impl Task for Wait {
    fn name(&self) -> String {
        "wait".to_owned()
    }

    fn is_idle(&self, now: Time) -> bool {
        !self.ends.has_come(self.begun, now)
    }

    fn is_on_the_spot(&self) -> bool {
        true
    }

    fn begin(&mut self, seen: &Seen) {
        self.begun = seen.time;
    }

    fn goal(&mut self, seen: &Seen) -> Option<Goal> {
        (!self.ends.has_come(self.begun, seen.time)).then_some(Goal::Stand)
    }
}
