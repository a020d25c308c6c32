//! Charts: what the covariance is the covariance *of*.
//!
//! Every model gives its Jacobians in one canonical chart (body-frame right perturbation,
//! position and velocity errors in NED). A chart is the linear map T(x) from its own error
//! coordinates to the canonical ones, together with the retraction its errors are applied by.
//!
//! A filter in chart c would use H_c = H·T(x) and Φ_c = T(x⁺)⁻¹·Φ·T(x). Prediction and gain are
//! then the same numbers as in canonical coordinates, P = T P_c Tᵀ, so the estimator keeps P
//! canonical and a chart acts where it differs: *at a correction*. There the state moves by the
//! chart's own retraction, and P_c, which does not change, becomes T(x⁺)T(x⁻)⁻¹ P (·)ᵀ.
//!
//! | chart | attitude error | T |
//! |---|---|---|
//! | `body` | q = q̂ ⊗ Exp(δφ_b) | I |
//! | `navigation` | q = Exp(φ_n) ⊗ q̂ | C_nbᵀ |
//! | `additive`, Euler angles | rpy = rpy̭ + δ | E(roll, pitch), δφ_b = E·δ |
//! | `additive`, quaternion | q = (q̂ + δq)/|·| | 2Ξ(q̂)ᵀ on δq, Ξᵀδq̂ the tangent |

use crate::geometry::so3;
use crate::linear::BlockMatrix;
use crate::state::{Attitude, Kind, Layout, Manifold};
use core::fmt::Debug;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A chart: error coordinates on the state space.
pub trait Chart: Debug + Send + Sync {
    /// Writes T(x), canonical = T · chart, for the blocks where it is not the identity.
    fn to_canonical(&self, layout: &Layout, x: &[f64], t: &mut BlockMatrix);

    /// Moves `x` by the canonical correction `delta` through the chart's retraction. Where the
    /// covariance must follow, writes T(x⁺)T(x⁻)⁻¹ into `reset` and returns true.
    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: &mut BlockMatrix) -> bool;
}

/// The canonical chart itself: body-frame attitude error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Body;

impl Chart for Body {
    fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}

    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], _: &mut BlockMatrix) -> bool {
        layout.plus(x, delta);
        false
    }
}

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
    /// q moved by the chart's own error coordinates.
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> UnitQuaternion<f64>;
}

impl AttitudeChart for Navigation {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(q.to_rotation_matrix().into_inner().transpose())
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> UnitQuaternion<f64> {
        so3::exp(delta) * q
    }
}

impl AttitudeChart for AdditiveEuler {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        let rpy = so3::to_rpy(q);
        // The chart ends where roll and yaw become one rotation.
        (rpy.y.cos() > 1e-3).then(|| so3::body_rate_of_euler(rpy.x, rpy.y))
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> UnitQuaternion<f64> {
        let rpy = so3::to_rpy(q) + delta;
        so3::from_rpy(rpy.x, rpy.y, rpy.z)
    }
}

impl AttitudeChart for AdditiveQuaternion {
    // In the coordinates 2Ξᵀδq the map at one point is the identity; what the chart changes is
    // the retraction and the projection of the tangent at q̂ onto the tangent at q̂⁺.
    fn matrix(_: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(Matrix3::identity())
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> UnitQuaternion<f64> {
        // q + ½ Ξ(q) δ = q ⊗ (1 + ½ δ)
        q * UnitQuaternion::new_normalize(Quaternion::new(1.0, 0.5 * delta.x, 0.5 * delta.y, 0.5 * delta.z))
    }
}

fn blocks_to_canonical<C: AttitudeChart>(layout: &Layout, x: &[f64], t: &mut BlockMatrix) {
    for b in layout.blocks().iter().filter(|b| b.kind == Kind::Attitude) {
        if let Some(m) = C::matrix(&Attitude::read(&x[b.storage_range()])) {
            t.set_at(b.tangent, b.tangent, &m);
        }
    }
}

/// Corrects every block; `carry(before, after, T⁻, T⁺)` gives the reset of an attitude block.
fn correct_blocks<C: AttitudeChart>(
    layout: &Layout,
    x: &mut [f64],
    delta: &[f64],
    reset: &mut BlockMatrix,
    carry: impl Fn(&UnitQuaternion<f64>, &UnitQuaternion<f64>) -> Option<Matrix3<f64>>,
) -> bool {
    let mut moved = false;
    for b in layout.blocks() {
        let (s, d) = (&mut x[b.storage_range()], &delta[b.tangent_range()]);
        if b.kind != Kind::Attitude {
            b.kind.plus(s, d);
            continue;
        }
        let before = Attitude::read(s);
        let canonical = Vector3::new(d[0], d[1], d[2]);
        let own = C::matrix(&before).and_then(|t| t.try_inverse()).map(|inverse| inverse * canonical);
        let Some(own) = own else {
            // Outside the chart: the canonical correction, which is defined everywhere.
            b.kind.plus(s, d);
            continue;
        };
        let mut after = C::retract(&before, &own);
        after.renormalize();
        Attitude::write(&after, s);
        if let Some(j) = carry(&before, &after) {
            reset.set_at(b.tangent, b.tangent, &j);
            moved = true;
        }
    }
    moved
}

/// T(x⁺) T(x⁻)⁻¹.
fn carried<C: AttitudeChart>(before: &UnitQuaternion<f64>, after: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
    Some(C::matrix(after)? * C::matrix(before)?.try_inverse()?)
}

macro_rules! attitude_chart {
    ($name:ident, $carry:expr) => {
        impl Chart for $name {
            fn to_canonical(&self, layout: &Layout, x: &[f64], t: &mut BlockMatrix) {
                blocks_to_canonical::<Self>(layout, x, t);
            }
            fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: &mut BlockMatrix) -> bool {
                correct_blocks::<Self>(layout, x, delta, reset, $carry)
            }
        }
    };
}
attitude_chart!(Navigation, carried::<Navigation>);
attitude_chart!(AdditiveEuler, carried::<AdditiveEuler>);
// δq stays the same vector of R⁴ while the tangent plane turns: Ξ(q⁺)ᵀ Ξ(q⁻) = C⁺ᵀ-like 3×3,
// the vector part of the relative rotation, w I − [v×] for q⁻¹q⁺ = (w, v).
attitude_chart!(AdditiveQuaternion, |before, after| {
    let d = before.inverse() * after;
    Some(Matrix3::identity() * d.w - so3::skew(&d.imag()))
});
