//! Positions and attitudes in the axes of ROS: the world east, north, up, the body forward, left, up (REP 103).

use super::Origin;
use crate::solution::Solution;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A position and an attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres east, north, up from the origin.
    pub p: Vector3<f64>,
    /// From forward, left, up to east, north, up; one without an attitude.
    pub q: UnitQuaternion<f64>,
}

impl Pose {
    /// The pose of a solution; `None` without a position.
    #[must_use]
    pub fn of(solution: &Solution, origin: &Origin) -> Option<Self> {
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
#[must_use]
pub fn to_enu(ned: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(ned.y, ned.x, -ned.z)
}

/// The covariance of a position \[m²\] in north, east, down as that in east, north, up.
#[must_use]
pub fn enu_covariance(ned: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let of = |k: usize| to_enu(&Vector3::ith(k, 1.0));
        (of(i).transpose() * ned * of(j)).x
    })
}

/// A half turn about the axis between north and east.
fn enu_from_ned() -> UnitQuaternion<f64> {
    let half = core::f64::consts::FRAC_1_SQRT_2;
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, half, half, 0.0))
}

/// A half turn about the forward axis: from forward, left, up to forward, right, down.
#[must_use]
pub fn frd_from_flu() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::wgs84::Geodetic;
    use fusion_core::time::Time;

    fn place(north: f64) -> Geodetic {
        let mut place = Geodetic {
            lat: 0.8,
            lon: 0.2,
            height: 100.0,
        };
        place.lat += north / place.metres_per_radian().0;
        place
    }

    #[test]
    fn a_pose_is_turned_into_the_axes_of_ros() {
        let about = |yaw_deg: f64, pitch_deg: f64| Solution {
            time: Time::from_seconds(0.0),
            position: Some((place(5.0), Matrix3::identity())),
            velocity: None,
            attitude: Some((
                UnitQuaternion::from_euler_angles(0.0, pitch_deg.to_radians(), yaw_deg.to_radians()),
                Matrix3::identity(),
            )),
            with_attitude: [Matrix3::zeros(); 2],
        };
        let origin = Origin::default();
        // The first place is the origin.
        let first = Pose::of(
            &Solution {
                position: Some((place(0.0), Matrix3::identity())),
                ..about(0.0, 0.0)
            },
            &origin,
        );
        assert_eq!(first.map(|pose| pose.p), Some(Vector3::zeros()));
        // Forward to the east is the axis x of the world, forward to the north is y, nose up is z.
        for ((yaw, pitch), forward) in [((90.0, 0.0), Vector3::x()), ((0.0, 0.0), Vector3::y()), ((0.0, 90.0), Vector3::z())] {
            let pose = Pose::of(&about(yaw, pitch), &origin).unwrap();
            assert!((pose.q * Vector3::x() - forward).norm() < 1e-12, "{yaw} {pitch}: {}", pose.q);
            // Left of a vehicle with a level heading is 90° counter-clockwise, seen from above.
            if pitch == 0.0 {
                assert!((pose.q * Vector3::z() - Vector3::z()).norm() < 1e-12);
            }
            assert!((pose.p - Vector3::new(0.0, 5.0, 0.0)).norm() < 1e-4, "{}", pose.p);
        }
        assert_eq!(to_enu(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(2.0, 1.0, -3.0));
    }
}
