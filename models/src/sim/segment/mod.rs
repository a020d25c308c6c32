//! Pieces of a trajectory: how each moves the body.
//!
//! A segment starts where the one before ended, level, at rest or moving straight ahead. Every
//! segment but the `circle` starts and ends with no acceleration and no turn rate, and in between both
//! are continuous, so the whole has finite jerk.
//!
//! Axes    local north-east-down, fixed to the Earth at the origin of the run

mod circle;
mod climb;
mod fly;
mod run;
mod turn;
mod walk;

use crate::block::BuildError;
use core::fmt::Debug;
use fusion_core::geometry::so3;
use fusion_core::math;
use nalgebra::{UnitQuaternion, Vector3};

/// Where one segment ends and the next starts: level, moving straight ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Junction {
    /// Position in local north-east-down \[m\].
    pub position: Vector3<f64>,
    /// Heading \[rad\], not wrapped.
    pub heading: f64,
    /// Speed ahead \[m/s\].
    pub speed: f64,
}

impl Junction {
    /// Unit vectors ahead and to the right, level.
    #[must_use]
    pub fn axes(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (s, c) = math::sin_cos(self.heading);
        (Vector3::new(c, s, 0.0), Vector3::new(-s, c, 0.0))
    }

    /// The present speed, which must not be 0.
    ///
    /// # Errors
    /// At rest.
    pub fn moving(&self) -> Result<f64, BuildError> {
        if self.speed > 0.0 {
            return Ok(self.speed);
        }
        let help = "put a `straight` with a `speed` before it";
        Err(BuildError::new("this segment needs a moving body, and here it is at rest").help(help))
    }

    /// Checks that the body is at rest.
    ///
    /// # Errors
    /// Where it moves.
    pub fn at_rest(&self) -> Result<(), BuildError> {
        if self.speed.abs() < 1e-12 {
            return Ok(());
        }
        let moves = format!("this segment needs a body at rest, and here it moves at {:.3} m/s", self.speed);
        Err(BuildError::new(moves).help("give the segment before it `end_speed = 0`"))
    }
}

/// The motion at one instant, in local north-east-down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Velocity \[m/s\].
    pub velocity: Vector3<f64>,
    /// Acceleration \[m/s²\].
    pub acceleration: Vector3<f64>,
    /// Roll, pitch, heading \[rad\]; the heading is not wrapped.
    pub rpy: Vector3<f64>,
    /// Their derivatives \[rad/s\].
    pub rpy_rate: Vector3<f64>,
}

impl Motion {
    /// Attitude, body to local.
    #[must_use]
    pub fn attitude(&self) -> UnitQuaternion<f64> {
        so3::from_rpy(self.rpy.x, self.rpy.y, self.rpy.z)
    }

    /// Angular rate of the body relative to the Earth, in body axes \[rad/s\].
    #[must_use]
    pub fn angular_rate(&self) -> Vector3<f64> {
        so3::body_rate_of_euler(self.rpy.x, self.rpy.y) * self.rpy_rate
    }

    /// Position, velocity and attitude of a unit at this place of the body \[m\]. The acceleration is still the body's.
    #[must_use]
    pub fn carried_at(&self, place: &Vector3<f64>) -> Self {
        if *place == Vector3::zeros() {
            return *self;
        }
        let q = self.attitude();
        Self {
            position: self.position + q * place,
            velocity: self.velocity + q * self.angular_rate().cross(place),
            ..*self
        }
    }
}

/// A segment as it runs.
pub trait Segment: Debug + Send + Sync {
    /// Seconds it takes.
    fn duration(&self) -> f64;

    /// Whether it starts and ends without acceleration and turn rate.
    fn is_smooth(&self) -> bool {
        true
    }

    /// The motion `t` seconds after its start, 0 ≤ t ≤ duration.
    fn at(&self, t: f64) -> Motion;

    /// Where it ends.
    fn end(&self) -> Junction {
        let end = self.at(self.duration());
        let (s, c) = math::sin_cos(end.rpy.z);
        Junction {
            position: end.position,
            heading: end.rpy.z,
            speed: end.velocity.x * c + end.velocity.y * s,
        }
    }
}

/// A segment as declared.
#[typetag::deserialize]
pub trait SegmentSpec: Debug + Send + Sync {
    /// The segment that starts at `from`.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError>;

    /// Whether a boat can do it, which stays on the surface of the water.
    fn is_afloat(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// That velocity, acceleration and the rates of the angles are the derivatives of what they belong to.
    pub(super) fn assert_derivatives(segment: &dyn Segment) {
        const H: f64 = 1e-5;
        let n = 997; // no instant at a seam
        for k in 1..n {
            let t = segment.duration() * f64::from(k) / f64::from(n);
            let (before, here, after) = (segment.at(t - H), segment.at(t), segment.at(t + H));
            let compare = |a: Vector3<f64>, b: Vector3<f64>, exact: Vector3<f64>| {
                let difference = (b - a) / (2.0 * H);
                // 1e-6 of the size: truncation H²/6 times some thousand, rounding ε/H.
                assert!(
                    (difference - exact).norm() < 1e-6 * (1.0 + exact.norm()),
                    "{t}: {difference} {exact}"
                );
            };
            compare(before.position, after.position, here.velocity);
            compare(before.velocity, after.velocity, here.acceleration);
            compare(before.rpy, after.rpy, here.rpy_rate);
        }
    }
}
