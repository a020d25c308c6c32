//! Positions and attitudes in the axes of ROS: the world east, north, up, the body forward, left, up (REP 103).

use fusion::output::Origin;
use fusion::solution::Solution;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A position and an attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Metres east, north, up from the origin.
    pub(crate) p: Vector3<f64>,
    /// From forward, left, up to east, north, up; one without an attitude.
    pub(crate) q: UnitQuaternion<f64>,
}

impl Pose {
    /// The pose of a solution; `None` without a position.
    pub(crate) fn of(solution: &Solution, origin: &Origin) -> Option<Self> {
        let (place, _) = &solution.position?;
        let q = solution
            .attitude
            .map_or_else(UnitQuaternion::identity, |(q, _)| enu_from_ned() * q * frd_from_flu());
        Some(Self {
            p: to_enu(&origin.to_ned(place)),
            q,
        })
    }
}

/// A vector north, east, down as east, north, up.
pub(crate) fn to_enu(ned: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(ned.y, ned.x, -ned.z)
}

/// A half turn about the axis between north and east.
fn enu_from_ned() -> UnitQuaternion<f64> {
    let half = core::f64::consts::FRAC_1_SQRT_2;
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, half, half, 0.0))
}

/// A half turn about the forward axis.
pub(crate) fn frd_from_flu() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}
