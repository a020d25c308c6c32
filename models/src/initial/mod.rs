//! Initialisers: how a filter starts by itself.
//!
//! Each writes part of the initial belief; they write in the order of the file, so that a course
//! may turn the attitude that levelling has found.

pub mod baseline;
pub mod compass;
pub mod course;
pub mod explicit;
pub mod first_fix;
pub mod levelling;
pub mod levelling_in_motion;

use crate::earth::LocalFrame;
use crate::vocabulary::state;
use fusion_core::belief::Belief;
use fusion_core::geometry::{so3, wgs84};
use fusion_core::math;
use fusion_core::state::{Angle, Attitude, Geodetic, Kind, Layout, Manifold, Position, Velocity};
use nalgebra::{UnitQuaternion, Vector3};

/// Writes a geodetic position to the block `position`, or `local_position` about `origin`.
fn write_position(layout: &Layout, belief: &mut Belief, origin: Option<wgs84::Geodetic>, place: &wgs84::Geodetic, sigma: &[f64]) {
    if let Some(b) = layout.block(state::POSITION).filter(|b| b.kind == Kind::Geodetic) {
        Geodetic::write(place, &mut belief.x[b.storage_range()]);
        belief.covariance.set_sigmas(b, sigma);
    } else if let (Some(b), Some(origin)) = (layout.block(state::LOCAL_POSITION), origin) {
        Position::write(&LocalFrame::new(origin).to_ned(place), &mut belief.x[b.storage_range()]);
        belief.covariance.set_sigmas(b, sigma);
    }
}

/// Writes a velocity to the block `velocity`, or its horizontal magnitude to `speed`.
fn write_velocity(layout: &Layout, belief: &mut Belief, v: &Vector3<f64>, sigma: &[f64]) {
    if let Some(b) = layout.block(state::VELOCITY) {
        Velocity::write(v, &mut belief.x[b.storage_range()]);
        belief.covariance.set_sigmas(b, sigma);
    } else if let Some(b) = layout.block(state::SPEED) {
        belief.x[b.storage] = math::hypot(v.x, v.y);
        belief.covariance.set_sigmas(b, &sigma[..1]);
    }
}

/// The attitude that an initialiser has written, with its covariance. `None` before that: the layout then holds the
/// identity without any variance.
fn known_attitude(layout: &Layout, belief: &Belief) -> Option<(UnitQuaternion<f64>, nalgebra::Matrix3<f64>)> {
    let b = layout.block(state::ATTITUDE).filter(|b| b.kind == Kind::Attitude)?;
    let (q, p) = (Attitude::read(&belief.x[b.storage_range()]), belief.covariance.marginal::<3>(b));
    (q != UnitQuaternion::identity() || p.diagonal().amax() > 0.0).then_some((q, p))
}

fn write_attitude(layout: &Layout, belief: &mut Belief, q: &UnitQuaternion<f64>, sigma: &[f64]) {
    if let Some(b) = layout.block(state::ATTITUDE) {
        Attitude::write(q, &mut belief.x[b.storage_range()]);
        belief.covariance.set_sigmas(b, sigma);
    }
}

/// Turns the attitude block to `yaw`, keeping roll and pitch, or writes the angle `heading`.
///
/// The yaw variance is about the vertical: P_b = Cᵀ diag(tilt², tilt², σ²) C.
fn write_yaw(layout: &Layout, belief: &mut Belief, yaw: f64, sigma: f64) {
    if let Some(b) = layout.block(state::ATTITUDE) {
        let range = b.storage_range();
        let rpy = so3::to_rpy(&Attitude::read(&belief.x[range.clone()]));
        let q = so3::from_rpy(rpy.x, rpy.y, yaw);
        Attitude::write(&q, &mut belief.x[range]);
        let c = q.to_rotation_matrix().into_inner();
        let before = belief.covariance.marginal::<2>(b);
        let tilt = 0.5 * (before[(0, 0)] + before[(1, 1)]);
        let p = c.transpose() * nalgebra::Matrix3::from_diagonal(&Vector3::new(tilt, tilt, sigma * sigma)) * c;
        // Row by row, from the lower triangle.
        let symmetric = nalgebra::Matrix3::from_fn(|i, j| p[(i.max(j), i.min(j))]);
        belief.covariance.set_block(b, symmetric.as_slice());
    } else if let Some(b) = layout.block(state::HEADING) {
        Angle::write(&yaw, &mut belief.x[b.storage_range()]);
        belief.covariance.set_sigmas(b, &[sigma]);
    }
}
