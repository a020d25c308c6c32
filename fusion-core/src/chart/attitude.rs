//! Charts that differ from the canonical one in attitudes only.

use super::{Chart, Reset, correct_block};
use crate::geometry::so3;
use crate::linear::BlockMatrix;
use crate::math;
use crate::state::{Attitude, Kind, Layout, Manifold};
use core::fmt::Debug;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// The canonical chart itself: body-frame attitude error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Body;

/// Navigation-frame attitude error, the ε of the classical INS error model (with ε = −φ_n for
/// the papers' estimate − truth sign).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Navigation;

/// Additive error of the three Euler angles roll, pitch, yaw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AdditiveEuler;

/// Additive error of the four quaternion components, normalised after each correction.
///
/// The component along q̂ is removed by the normalisation, so the 4×4 covariance of the classical
/// filter has rank three and is carried here by its three canonical coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AdditiveQuaternion;

/// A chart that differs from the canonical one in each attitude block by a 3×3 matrix.
trait AttitudeChart: Debug + Send + Sync {
    /// T(q) of one attitude block; `None` where the chart is singular.
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>>;

    /// q moved by the chart's own error coordinates; `None` where that leads out of the chart.
    fn retract(q: &UnitQuaternion<f64>, own: &Vector3<f64>) -> Option<UnitQuaternion<f64>>;

    /// The own coordinates of `a` seen from `b`; `None` outside the chart.
    fn lift(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Option<Vector3<f64>>;

    /// J(ξ): the error at q ⊞ ξ of a small change of ξ.
    fn jacobian(own: &Vector3<f64>) -> Matrix3<f64> {
        let _ = own;
        Matrix3::identity()
    }

    /// The reset from `before` to `after`, which lies `own` from it; `None` where it is the identity.
    fn carry(before: &UnitQuaternion<f64>, after: &UnitQuaternion<f64>, own: &Vector3<f64>, reset: Reset) -> Option<Matrix3<f64>> {
        let back = Self::matrix(before)?.try_inverse()?;
        let there = Self::matrix(after)?;
        Some(match reset {
            Reset::Plain => there * back,
            Reset::Full => there * Self::jacobian(own) * back,
        })
    }
}

impl AttitudeChart for Body {
    fn matrix(_: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(Matrix3::identity())
    }
    fn retract(q: &UnitQuaternion<f64>, own: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        Some(q * so3::exp(own))
    }
    fn lift(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
        Some(so3::log(&(b.inverse() * a)))
    }
    fn carry(_: &UnitQuaternion<f64>, _: &UnitQuaternion<f64>, own: &Vector3<f64>, reset: Reset) -> Option<Matrix3<f64>> {
        (reset == Reset::Full).then(|| so3::right_jacobian(own))
    }
}

impl AttitudeChart for Navigation {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(so3::rotation(q).transpose())
    }
    fn retract(q: &UnitQuaternion<f64>, own: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        Some(so3::exp(own) * q)
    }
    fn lift(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
        Some(so3::log(&(a * b.inverse())))
    }
    fn jacobian(own: &Vector3<f64>) -> Matrix3<f64> {
        so3::right_jacobian(&-own)
    }
}

/// The least cos(pitch) of the Euler chart: the chart ends 2.9° before roll and yaw become the same
/// rotation. Nearer to that point, a correction by 1° turns roll and yaw by more than 20°. Adding
/// angles no longer adds small rotations, and P would be moved to a wrong attitude.
const EULER_EDGE: f64 = 0.05;

impl AttitudeChart for AdditiveEuler {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        let rpy = so3::to_rpy(q);
        (math::cos(rpy.y) > EULER_EDGE).then(|| so3::body_rate_of_euler(rpy.x, rpy.y))
    }
    fn retract(q: &UnitQuaternion<f64>, own: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        let rpy = so3::to_rpy(q) + own;
        // Beyond ±90° the angles of the same attitude are others.
        (math::cos(rpy.y) > EULER_EDGE).then(|| so3::from_rpy(rpy.x, rpy.y, rpy.z))
    }
    fn lift(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
        let (a, b) = (so3::to_rpy(a), so3::to_rpy(b));
        (math::cos(a.y).min(math::cos(b.y)) > EULER_EDGE).then(|| (a - b).map(so3::wrap_angle))
    }
}

impl AttitudeChart for AdditiveQuaternion {
    // In the coordinates 2Ξᵀδq the map at one point is the identity. The chart changes only
    // the retraction and the projection of the tangent at q̂ onto the tangent at q̂⁺.
    fn matrix(_: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(Matrix3::identity())
    }
    fn retract(q: &UnitQuaternion<f64>, own: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        // q + ½ Ξ(q) δ = q ⊗ (1 + ½ δ)
        Some(q * UnitQuaternion::new_normalize(Quaternion::new(1.0, 0.5 * own.x, 0.5 * own.y, 0.5 * own.z)))
    }
    fn lift(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
        let d = b.inverse() * a;
        // Half a turn is infinitely far: the sum of two quaternions never points there.
        (d.w.abs() > 1e-9).then(|| d.imag() * (2.0 / d.w))
    }
    // δq stays the same vector of R⁴ while the tangent plane turns: Ξ(q⁺)ᵀ Ξ(q⁻) = C⁺ᵀ-like 3×3,
    // the vector part of the relative rotation, w I − [v×] for q⁻¹q⁺ = (w, v). The normalisation
    // divides by |q̂ + δq| = √(1 + |δ|²/4) besides.
    fn carry(before: &UnitQuaternion<f64>, after: &UnitQuaternion<f64>, own: &Vector3<f64>, reset: Reset) -> Option<Matrix3<f64>> {
        let d = before.inverse() * after;
        let turned = Matrix3::identity() * d.w - so3::skew(&d.imag());
        Some(match reset {
            Reset::Plain => turned,
            Reset::Full => turned / math::sqrt(1.0 + 0.25 * own.norm_squared()),
        })
    }
}

/// Corrects every block; the reset of an attitude block goes into `by`.
fn correct_blocks<C: AttitudeChart>(layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
    let mut moved = false;
    for b in layout.blocks() {
        if b.kind != Kind::Attitude {
            moved |= correct_block(b, x, delta, reset, by);
            continue;
        }
        let (s, d) = (&mut x[b.storage_range()], &delta[b.tangent_range()]);
        let before = Attitude::read(s);
        let canonical = Vector3::new(d[0], d[1], d[2]);
        let own = C::matrix(&before).and_then(|t| t.try_inverse()).map(|inverse| inverse * canonical);
        let retracted = own.and_then(|own| Some((own, C::retract(&before, &own)?)));
        let j = if let Some((own, mut after)) = retracted {
            after.renormalize();
            Attitude::write(&after, s);
            C::carry(&before, &after, &own, reset)
        } else {
            // From outside the chart or out of it: the canonical correction, defined everywhere.
            b.kind.plus(s, d);
            Body::carry(&before, &before, &canonical, reset)
        };
        if let Some(j) = j {
            by.set_at(b.tangent, b.tangent, &j);
            moved = true;
        }
    }
    moved
}

fn difference_of_blocks<C: AttitudeChart>(layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
    layout.minus(a, b, delta);
    for block in layout.blocks().iter().filter(|b| b.kind == Kind::Attitude) {
        let (a, b) = (Attitude::read(&a[block.storage_range()]), Attitude::read(&b[block.storage_range()]));
        if let (Some(t), Some(own)) = (C::matrix(&b), C::lift(&a, &b)) {
            delta[block.tangent_range()].copy_from_slice((t * own).as_slice());
        }
    }
}

macro_rules! attitude_chart {
    ($name:ident) => {
        impl Chart for $name {
            fn to_canonical(&self, layout: &Layout, x: &[f64], t: &mut BlockMatrix) {
                for b in layout.blocks().iter().filter(|b| b.kind == Kind::Attitude) {
                    if let Some(m) = <Self as AttitudeChart>::matrix(&Attitude::read(&x[b.storage_range()])) {
                        t.set_at(b.tangent, b.tangent, &m);
                    }
                }
            }
            fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
                correct_blocks::<Self>(layout, x, delta, reset, by)
            }
            fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
                difference_of_blocks::<Self>(layout, a, b, delta);
            }
        }
    };
}
attitude_chart!(Navigation);
attitude_chart!(AdditiveEuler);
attitude_chart!(AdditiveQuaternion);

impl Chart for Body {
    fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}

    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
        if reset == Reset::Plain {
            layout.plus(x, delta);
            return false;
        }
        correct_blocks::<Self>(layout, x, delta, reset, by)
    }

    fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
        layout.minus(a, b, delta);
    }
}
