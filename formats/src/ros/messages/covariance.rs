//! The covariance of a pose in the axes of ROS.

use super::twist::enu_from_frd;
use fusion::output::pose::{Pose, enu_covariance};
use fusion::solution::Solution;
use nalgebra::{Matrix3, Matrix6};

/// The covariance of position and attitude, in the axes of the world: rows x, y, z, then turns about these axes.
pub(super) fn pose_covariance(solution: &Solution, pose: &Pose) -> Matrix6<f64> {
    let mut all = Matrix6::zeros();
    if let Some((_, covariance)) = &solution.position {
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&enu_covariance(covariance));
    }
    if let Some((_, covariance)) = &solution.attitude {
        let turn = enu_from_frd(pose);
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn * covariance * turn.transpose()));
        let to_enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let across = to_enu * solution.with_attitude[0] * turn.transpose();
        all.fixed_view_mut::<3, 3>(0, 3).copy_from(&across);
        all.fixed_view_mut::<3, 3>(3, 0).copy_from(&across.transpose());
    }
    all
}
