//! Controllers: from a goal and the vehicle's estimate to a command.
//!
//! A controller sees the estimate of the filter that the vehicle carries, never the truth.

mod autopilot;

use super::vehicle::Command;
use crate::block::BuildError;
use core::fmt::Debug;
use fusion_core::Time;
use nalgebra::Vector2;

/// The vehicle's own estimate of its place and heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Now.
    pub time: Time,
    /// North, east of the origin of the run \[m\].
    pub position: Vector2<f64>,
    /// Heading \[rad\].
    pub heading: f64,
}

/// The present goal of a task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// To stand.
    Stand,
    /// To head there and run at that speed.
    Heading {
        /// Heading \[rad\].
        heading: f64,
        /// Speed \[m/s\]; 0 on the spot.
        speed: f64,
        /// How far it still is \[m\], where a distance is to be run.
        to_go: Option<f64>,
    },
    /// To run along a straight line.
    Line {
        /// A point of it: north, east \[m\].
        from: Vector2<f64>,
        /// Its direction \[rad\].
        course: f64,
        /// Speed \[m/s\].
        speed: f64,
        /// How far it still is along the line \[m\].
        to_go: f64,
    },
}

/// A controller as it runs.
pub trait Control: Debug + Send {
    /// Resets its integrators: another task begins.
    fn begin(&mut self);

    /// The command to the vehicle; called at the controller's rate.
    fn command(&mut self, goal: &Goal, seen: &Seen) -> Command;

    /// The heading that its last command leads to \[rad\]. `None` if the command is to stand, or if it steers by
    /// something else.
    fn heading(&self) -> Option<f64> {
        None
    }
}

/// A controller as declared.
#[typetag::deserialize]
pub trait ControlSpec: Debug + Send + Sync {
    /// How often it runs \[Hz\].
    fn rate(&self) -> f64;

    /// Whether it can follow a line; other controllers never get a [`Goal::Line`].
    fn follows_lines(&self) -> bool;

    /// Makes the controller.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self) -> Result<Box<dyn Control>, BuildError>;
}
