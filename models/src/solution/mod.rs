//! The navigation solution: position, velocity and attitude of any process, with their 1σ.
//!
//! A process may carry them as states or derive them as signals; either way they are read here
//! by name.

mod reader;

pub use reader::SolutionReader;

use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Position, velocity and attitude at one instant. A quantity that the process does not have is `None`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solution {
    /// The instant.
    pub time: Time,
    /// Geodetic position of the body origin and its covariance in metres NED.
    pub position: Option<(Geodetic, Matrix3<f64>)>,
    /// Velocity v_eb_n \[m/s\] and its covariance.
    pub velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Attitude q_nb and the covariance of its body-frame error \[rad²\].
    pub attitude: Option<(UnitQuaternion<f64>, Matrix3<f64>)>,
    /// Covariance of the errors of position and of velocity (rows) with the error of attitude; zero if one
    /// of them is constant.
    pub with_attitude: [Matrix3<f64>; 2],
}

fusion_core::memory!(Solution {
    time,
    position,
    velocity,
    attitude,
    with_attitude
});

impl Solution {
    /// The solution at `time` between those at `a` and `b`.
    ///
    /// The position is that of `a` carried on by its velocity, so that nothing after `time` can
    /// flatter it; velocity and attitude, which a measurement moves little, are interpolated.
    #[must_use]
    pub fn between(a: &Self, b: &Self, time: Time) -> Self {
        let (dt, whole) = (time.seconds_since(a.time), b.time.seconds_since(a.time));
        if time == b.time || whole <= 0.0 {
            return *b;
        }
        let fraction = dt / whole;
        let v = a.velocity.map_or_else(Vector3::zeros, |(v, _)| v);
        Self {
            time,
            position: a.position.map(|(place, p)| (place.offset(&(v * dt)), p)),
            velocity: a.velocity.zip(b.velocity).map(|((va, p), (vb, _))| (va + (vb - va) * fraction, p)),
            attitude: a.attitude.zip(b.attitude).map(|((qa, p), (qb, _))| {
                let turn = so3::log(&(qa.inverse() * qb));
                (qa * so3::exp(&(turn * fraction)), p)
            }),
            with_attitude: a.with_attitude,
        }
    }

    /// The velocity v_eb_b in body axes \[m/s\] and its covariance; `None` without velocity and attitude.
    ///
    /// With v_b = C_bn v_n, δv_b = C_bn δv_n + v_b × δθ: δθ is the error of the attitude in body axes.
    #[must_use]
    pub fn body_velocity(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let ((v_n, of_velocity), (q, of_attitude)) = (self.velocity.as_ref()?, self.attitude.as_ref()?);
        let c_bn = q.inverse().to_rotation_matrix().into_inner();
        let v_b = c_bn * v_n;
        let by_attitude = v_b.cross_matrix();
        let across = c_bn * self.with_attitude[1] * by_attitude.transpose();
        let own = c_bn * of_velocity * c_bn.transpose() + by_attitude * of_attitude * by_attitude.transpose();
        Some((v_b, own + across + across.transpose()))
    }

    /// Roll, pitch, yaw \[rad\] and their 1σ.
    #[must_use]
    pub fn rpy(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let (q, p) = self.attitude?;
        Some(rpy_of(&q, &p))
    }
}

/// Roll, pitch, yaw \[rad\] of `q` and their 1σ, `p` being the covariance of its body-frame error
/// \[rad²\].
#[must_use]
pub fn rpy_of(q: &UnitQuaternion<f64>, p: &Matrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let rpy = so3::to_rpy(q);
    let e = so3::euler_rate_of_body(rpy.x, rpy.y);
    let turned = e * p * e.transpose();
    // If there is an error about one axis only, usually down, the other variances are rounding errors of either sign.
    let rounding = 1e-12 * turned.trace();
    (
        rpy,
        turned.diagonal().map(|v| if v.abs() <= rounding { 0.0 } else { math::sqrt(v) }),
    )
}

/// Square roots of the diagonal; not a number where a variance is negative.
#[must_use]
pub fn sigmas(p: &Matrix3<f64>) -> Vector3<f64> {
    p.diagonal().map(math::sqrt)
}
