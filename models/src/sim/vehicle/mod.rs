//! Vehicles of a closed-loop world: how a body moves under commands.
//!
//! Axes    local north-east-down, fixed to the Earth at the origin of the run
//! Steps   a world moves its vehicle in short steps of equal length; within a step, velocity
//!         and roll, pitch, heading change linearly with time

mod skid_steer;

use super::segment::{Junction, Motion};
use crate::block::BuildError;
use core::fmt::Debug;

/// A controller's command to a vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Speed ahead \[m/s\].
    pub speed: f64,
    /// Rate of turn, right positive \[rad/s\].
    pub turn: f64,
}

/// A vehicle as it moves: stateful, seeded.
pub trait Vehicle: Debug + Send {
    /// How it moves now.
    fn motion(&self) -> Motion;

    /// Moves on by `dt` seconds, a hundredth of a second or so, while `command` holds.
    fn step(&mut self, command: &Command, dt: f64);

    /// The present speeds of its left and its right track \[m/s\], if it runs on tracks.
    fn tracks(&self) -> Option<[f64; 2]> {
        None
    }
}

/// A vehicle as declared.
#[typetag::deserialize]
pub trait VehicleSpec: Debug + Send + Sync {
    /// The vehicle at rest at `start`; `seed` is the seed of the run.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, start: &Junction, seed: u64) -> Result<Box<dyn Vehicle>, BuildError>;

    /// The mean share of their speed that its tracks lose, if it runs on tracks. A filter estimates it as `slip`.
    fn mean_slip(&self) -> Option<f64> {
        None
    }
}
