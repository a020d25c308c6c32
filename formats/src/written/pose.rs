//! Positions and attitudes in the axes of ROS: the world east, north, up, the body forward, left, up (REP 103).

use fusion::output::Origin;
use fusion::solution::Solution;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

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

    /// From forward, right, down to east, north, up.
    #[cfg(feature = "mcap")]
    pub(crate) fn enu_from_frd(&self) -> Matrix3<f64> {
        (self.q * frd_from_flu().inverse()).to_rotation_matrix().into_inner()
    }
}

/// The velocity in the axes of the body: forward, left, up \[m/s\], and its covariance.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Twist {
    pub(crate) velocity: Vector3<f64>,
    pub(crate) covariance: Matrix3<f64>,
}

impl Twist {
    /// The velocity of a solution; `None` without velocity and attitude.
    ///
    /// With v = C v_n and C the turn to the body, δv = C δv_n + v × δθ: δθ is the error of the attitude in body axes.
    pub(crate) fn of(solution: &Solution) -> Option<Self> {
        let ((velocity, of_velocity), (q, of_attitude)) = (solution.velocity.as_ref()?, solution.attitude.as_ref()?);
        let to_body = q.inverse().to_rotation_matrix().into_inner();
        let v = to_body * velocity;
        let by_attitude = v.cross_matrix();
        let across = to_body * solution.with_attitude[1] * by_attitude.transpose();
        let of_body =
            to_body * of_velocity * to_body.transpose() + by_attitude * of_attitude * by_attitude.transpose() + across + across.transpose();
        let left_up = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        Some(Self {
            velocity: left_up * v,
            covariance: left_up * of_body * left_up,
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
fn frd_from_flu() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}
