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
    /// q moved by the chart's own error coordinates; `None` where that leads out of the chart.
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> Option<UnitQuaternion<f64>>;
}

/// The least cos(pitch) of the Euler chart: it ends 2.9° short of where roll and yaw become one
/// rotation. Nearer to it a correction by 1° turns roll and yaw by more than 20°: the addition of
/// angles is no longer that of small rotations, and P is carried to an attitude it is not of.
const EULER_EDGE: f64 = 0.05;

impl AttitudeChart for Navigation {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(q.to_rotation_matrix().into_inner().transpose())
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        Some(so3::exp(delta) * q)
    }
}

impl AttitudeChart for AdditiveEuler {
    fn matrix(q: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        let rpy = so3::to_rpy(q);
        (rpy.y.cos() > EULER_EDGE).then(|| so3::body_rate_of_euler(rpy.x, rpy.y))
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        let rpy = so3::to_rpy(q) + delta;
        // Beyond ±90° the angles of the same attitude are others.
        (rpy.y.cos() > EULER_EDGE).then(|| so3::from_rpy(rpy.x, rpy.y, rpy.z))
    }
}

impl AttitudeChart for AdditiveQuaternion {
    // In the coordinates 2Ξᵀδq the map at one point is the identity; what the chart changes is
    // the retraction and the projection of the tangent at q̂ onto the tangent at q̂⁺.
    fn matrix(_: &UnitQuaternion<f64>) -> Option<Matrix3<f64>> {
        Some(Matrix3::identity())
    }
    fn retract(q: &UnitQuaternion<f64>, delta: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
        // q + ½ Ξ(q) δ = q ⊗ (1 + ½ δ)
        Some(q * UnitQuaternion::new_normalize(Quaternion::new(1.0, 0.5 * delta.x, 0.5 * delta.y, 0.5 * delta.z)))
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
        let Some(mut after) = own.and_then(|own| C::retract(&before, &own)) else {
            // From outside the chart or out of it: the canonical correction, defined everywhere.
            b.kind.plus(s, d);
            continue;
        };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Declaration, Dynamics, Geodetic, LayoutBuilder, Scalar, StateRole};
    use crate::testing::{Lcg, check_chart, check_reset};

    fn layout(q: UnitQuaternion<f64>) -> Layout {
        fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) {
            let (name, owner, sigma) = (name.to_owned(), String::new(), vec![1.0; M::KIND.dim()]);
            b.declare::<M>(Declaration {
                name,
                owner,
                unit: "",
                initial,
                sigma,
                role: StateRole::Kinematic,
                dynamics: Dynamics::Process,
            })
            .unwrap();
        }
        let mut b = LayoutBuilder::new();
        declare::<Geodetic>(&mut b, "position", Geodetic::new(0.6, 2.2, 10.0));
        declare::<Attitude>(&mut b, "attitude", q);
        declare::<Scalar>(&mut b, "bias", 0.0);
        b.finish()
    }

    /// Random attitudes short of gimbal lock and corrections of up to half a radian.
    fn cases() -> impl Iterator<Item = (Layout, Vec<f64>)> {
        let mut r = Lcg::new(3);
        (0..50).map(move |_| {
            let layout = layout(so3::from_rpy(3.0 * r.signed(), 1.0 * r.signed(), 3.0 * r.signed()));
            let delta = (0..7).map(|i| if i < 3 { 20.0 } else { 0.3 } * r.signed()).collect();
            (layout, delta)
        })
    }

    #[test]
    fn every_chart_with_a_square_map_obeys_the_laws_of_charts() {
        let charts: [&dyn Chart; 3] = [&Body, &Navigation, &AdditiveEuler];
        for (layout, delta) in cases() {
            charts
                .iter()
                .for_each(|c| check_chart(&layout, *c, layout.initial(), &delta).unwrap());
        }
    }

    #[test]
    fn in_additive_charts_a_correction_is_a_shift_of_coordinates() {
        for (layout, delta) in cases() {
            check_reset(&layout, &AdditiveEuler, layout.initial(), &delta, 1.0).unwrap();
            // |q̂ + δq| = √(1 + |δ|²/4) is divided out by the normalisation.
            let length = (1.0 + 0.25 * delta[3..6].iter().map(|d| d * d).sum::<f64>()).sqrt();
            check_reset(&layout, &AdditiveQuaternion, layout.initial(), &delta, 1.0 / length).unwrap();
        }
    }

    #[test]
    fn a_correction_in_the_navigation_chart_turns_about_navigation_axes() {
        let q = so3::from_rpy(0.4, -0.2, 1.0);
        let layout = layout(q);
        let phi_n = Vector3::new(0.0, 0.0, 0.3);
        let phi_b = q.inverse() * phi_n;
        let (mut x, mut unused) = (layout.initial().to_vec(), BlockMatrix::identity(7));
        Navigation.correct(&layout, &mut x, &[0.0, 0.0, 0.0, phi_b.x, phi_b.y, phi_b.z, 0.0], &mut unused);
        let rpy = so3::to_rpy(&Attitude::read(&x[3..7]));
        assert!((rpy - Vector3::new(0.4, -0.2, 1.3)).amax() < 1e-15); // 4 ε
    }

    #[test]
    fn outside_the_euler_chart_the_canonical_correction_is_applied() {
        let layout = layout(so3::from_rpy(0.0, core::f64::consts::FRAC_PI_2, 0.0));
        let delta = [0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.0];
        let (mut x, mut body, mut reset) = (layout.initial().to_vec(), layout.initial().to_vec(), BlockMatrix::identity(7));
        assert!(!AdditiveEuler.correct(&layout, &mut x, &delta, &mut reset));
        layout.plus(&mut body, &delta);
        assert_eq!(x, body);
    }

    #[test]
    fn a_correction_that_leads_out_of_the_euler_chart_or_across_the_vertical_is_canonical() {
        // To 88° of pitch, and to 100°, whose angles are those of 80° and half a turn of roll and yaw.
        for rise in [0.06, 0.27] {
            let layout = layout(so3::from_rpy(0.0, 85_f64.to_radians(), 0.0));
            let delta = [0.0, 0.0, 0.0, 0.0, rise, 0.0, 0.0];
            let (mut x, mut body, mut reset) = (layout.initial().to_vec(), layout.initial().to_vec(), BlockMatrix::identity(7));
            assert!(!AdditiveEuler.correct(&layout, &mut x, &delta, &mut reset), "{rise}");
            layout.plus(&mut body, &delta);
            assert_eq!(x, body);
        }
    }

    #[test]
    fn the_laws_see_a_wrong_map_and_a_wrong_reset() {
        #[derive(Debug)]
        struct Wrong;
        impl Chart for Wrong {
            fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}
            fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: &mut BlockMatrix) -> bool {
                Navigation.correct(layout, x, delta, reset)
            }
        }
        let (layout, delta) = cases().next().unwrap();
        assert!(
            check_chart(&layout, &Wrong, layout.initial(), &delta)
                .unwrap_err()
                .contains("`attitude`")
        );
        assert!(
            check_reset(&layout, &Wrong, layout.initial(), &delta, 1.0)
                .unwrap_err()
                .contains("`attitude`")
        );
    }
}
