//! The velocity of a body, and turns of its covariance.

use fusion::output::pose::{Pose, frd_from_flu};
use fusion::solution::Solution;
use nalgebra::{Matrix3, Vector3};

/// The turn from forward, right, down to the east, north, up of a pose.
pub(super) fn enu_from_frd(pose: &Pose) -> Matrix3<f64> {
    (pose.q * frd_from_flu().inverse()).to_rotation_matrix().into_inner()
}

/// The velocity in the axes of the body: forward, left, up \[m/s\], and its covariance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Twist {
    pub(super) velocity: Vector3<f64>,
    pub(super) covariance: Matrix3<f64>,
}

impl Twist {
    /// The velocity of a solution; `None` without velocity and attitude.
    pub(super) fn of(solution: &Solution) -> Option<Self> {
        let (velocity, covariance) = solution.body_velocity()?;
        let left_up = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        Some(Self {
            velocity: left_up * velocity,
            covariance: left_up * covariance * left_up,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::core::geometry::wgs84::Geodetic;
    use fusion::core::time::Time;
    use nalgebra::{SMatrix, SVector, UnitQuaternion};

    #[test]
    fn the_covariance_of_a_velocity_is_that_of_its_errors_and_of_the_attitude() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.5, 2.0);
        let v = Vector3::new(4.0, -3.0, 1.0);
        // Any positive definite covariance of velocity and attitude.
        let root = SMatrix::<f64, 6, 6>::from_fn(|i, j| f64::from(u8::from(i == j)) + 0.1 * ((3 * i + 5 * j) as f64).sin());
        let all = root * root.transpose();
        let part = |i, j| all.fixed_view::<3, 3>(i, j).into_owned();
        let solution = Solution {
            time: Time::from_seconds(0.0),
            position: Some((
                Geodetic {
                    lat: 0.0,
                    lon: 0.0,
                    height: 0.0,
                },
                Matrix3::identity(),
            )),
            velocity: Some((v, part(0, 0))),
            attitude: Some((q, part(3, 3))),
            with_attitude: [Matrix3::zeros(), part(0, 3)],
        };
        let body = |e: SVector<f64, 6>| {
            let turned = q * UnitQuaternion::from_scaled_axis(Vector3::new(e[3], e[4], e[5]));
            let velocity = turned.inverse() * (v + Vector3::new(e[0], e[1], e[2]));
            Vector3::new(velocity.x, -velocity.y, -velocity.z)
        };
        let step = 1e-5;
        let jacobian = SMatrix::<f64, 3, 6>::from_columns(&core::array::from_fn::<_, 6, _>(|k| {
            let e = SVector::<f64, 6>::ith(k, step);
            (body(e) - body(-e)) / (2.0 * step)
        }));
        let found = Twist::of(&solution).unwrap();
        assert!((found.velocity - body(SVector::zeros())).norm() < 1e-12);
        // Central differences are exact to the square of the step, and to rounding over the step: 1e-10 of each element.
        let by_differences = jacobian * all * jacobian.transpose();
        let wrong = (found.covariance - by_differences).norm();
        assert!(wrong < 1e-7, "{} is not {by_differences}", found.covariance);
    }
}
