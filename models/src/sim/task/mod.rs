//! Tasks of a controlled vehicle, one after the other.
//!
//! A task sees the same as the controller: the estimate. So it ends when the vehicle has arrived by its own
//! estimate.

mod drive;
mod go_to;
mod turn_to;
mod wait;

use super::control::{Goal, Seen};
use crate::block::BuildError;
use core::fmt::Debug;
use fusion_core::Time;
use nalgebra::Vector2;

/// A task as it runs.
pub trait Task: Debug + Send {
    /// A short description of the task.
    fn name(&self) -> String;

    /// Whether it only lets time pass and will still do so `now`: the vehicle's position is not needed.
    fn is_idle(&self, now: Time) -> bool {
        let _ = now;
        false
    }

    /// It begins here.
    fn begin(&mut self, seen: &Seen);

    /// Where it leads to, north and east of the origin \[m\], if that is known before.
    fn target(&self) -> Option<Vector2<f64>> {
        None
    }

    /// The two ends of the path that it asks for if it begins at `from`, north and east of the origin \[m\]. `None` if
    /// it moves nothing, or if only the run shows how far.
    fn path(&self, from: &Vector2<f64>) -> Option<[Vector2<f64>; 2]> {
        let _ = from;
        None
    }

    /// Whether it leaves the vehicle where it is.
    fn is_on_the_spot(&self) -> bool {
        false
    }

    /// Its goal now; `None` once it is done.
    fn goal(&mut self, seen: &Seen) -> Option<Goal>;
}

/// A task as declared.
#[typetag::deserialize]
pub trait TaskSpec: Debug + Send + Sync {
    /// Whether it asks for a line to be followed.
    fn follows_line(&self) -> bool {
        false
    }

    /// Makes the task.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self) -> Result<Box<dyn Task>, BuildError>;
}
