//! Tasks: what a controlled vehicle does, one after the other.
//!
//! A task sees what the controller sees: the estimate. So it ends where the vehicle takes itself to have
//! arrived.

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
    /// What it is, in a few words.
    fn name(&self) -> String;

    /// Whether it only lets time pass and will still do so `now`: nobody needs to know where the vehicle is.
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

    /// The path that it asks for where it begins at `from`, north and east of the origin \[m\]: its two ends. None where
    /// it moves nothing, or where only the run shows how far.
    fn path(&self, from: &Vector2<f64>) -> Option<[Vector2<f64>; 2]> {
        let _ = from;
        None
    }

    /// Whether it leaves the vehicle where it is.
    fn is_on_the_spot(&self) -> bool {
        false
    }

    /// What it wants now; none once it is done.
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
