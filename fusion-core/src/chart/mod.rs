//! Charts: the error coordinates to which the covariance belongs.
//!
//! Every model gives its Jacobians in one canonical chart (body-frame right perturbation,
//! position and velocity errors in NED). A chart is the linear map T(x) from its own error
//! coordinates ξ to the canonical ones, together with the retraction x ⊞ ξ its errors are applied by.
//!
//! A filter in chart c would use H_c = H·T(x) and Φ_c = T(x⁺)⁻¹·Φ·T(x). Prediction and gain are
//! then the same numbers as in canonical coordinates, P = T P_c Tᵀ, so the estimator keeps P
//! canonical and a chart acts where it differs: *at a correction*. There the state moves by the
//! chart's own retraction, and P follows: see [`Reset`].
//!
//! | chart | error | T |
//! |---|---|---|
//! | `body` | q = q̂ ⊗ Exp(δφ_b) | I |
//! | `navigation` | q = Exp(φ_n) ⊗ q̂ | C_nbᵀ |
//! | `additive`, Euler angles | rpy = rpy̭ + δ | E(roll, pitch), δφ_b = E·δ |
//! | `additive`, quaternion | q = (q̂ + δq)/|·| | 2Ξ(q̂)ᵀ on δq, Ξᵀδq̂ the tangent |
//! | `right_invariant` | χ = Exp(ξ) χ̂, χ = (C_nb, v, p) in SE₂(3) or SE(2) | see [`Invariant`] |
//! | `left_invariant` | χ = χ̂ Exp(ξ) | see [`Invariant`] |

mod attitude;
mod invariant;

pub use attitude::{AdditiveEuler, AdditiveQuaternion, Body, Navigation};
pub use invariant::{Biases, Invariant, Side};

use crate::Printed;
use crate::linear::BlockMatrix;
use crate::printed::role;
use crate::state::{Block, Kind, Layout, Space};
use alloc::sync::Arc;
use core::fmt::Debug;

/// How P changes when a correction moves the state. ξ is the correction in the chart's own
/// coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reset {
    /// P in the chart's own coordinates stays as it is: P ← T(x⁺)T(x⁻)⁻¹ P (·)ᵀ, the usual filter.
    #[default]
    Plain,
    /// The same points, expressed as errors at x⁺: P ← T(x⁺)J(ξ)T(x⁻)⁻¹ P (·)ᵀ. J(ξ) is the Jacobian of the
    /// retraction, (x ⊞ ξ) ⊞ J(ξ)dξ = x ⊞ (ξ + dξ). The change is of second order in ξ. With it the left- and the
    /// right-invariant chart give the same filter (arXiv 2506.01514).
    Full,
}

/// A chart: error coordinates on the state space.
pub trait Chart: Printed + Send + Sync {
    /// Writes T(x), canonical = T · chart, for the blocks where it is not the identity.
    fn to_canonical(&self, layout: &Layout, x: &[f64], t: &mut BlockMatrix);

    /// x ← x ⊞ T(x)⁻¹`delta`: moves `x` by the canonical correction `delta` through the chart's
    /// retraction. Where the covariance must follow, writes the matrix of [`Reset`] into `by` and
    /// returns true.
    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool;

    /// `delta` ← T(b)(a ⊟ b): the canonical correction that moves `b` to `a`, so that
    /// [`Chart::correct`] of `b` by it gives `a`.
    fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]);

    /// The chart of a filter that starts at `x`, where that depends on the start.
    fn anchored(&self, layout: &Layout, x: &[f64]) -> Option<Arc<dyn Chart>> {
        let _ = (layout, x);
        None
    }
}

role!(Chart);

/// x ← x ⊞ δ for a block that a chart does not treat specially: the canonical correction, with `x` and `delta` of the
/// whole layout. The full reset of a custom manifold goes into `by`; returns true if the covariance must follow it.
pub fn correct_block(block: &Block, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
    let (storage, delta) = (&mut x[block.storage_range()], &delta[block.tangent_range()]);
    let is_carried = match block.kind {
        Kind::Custom(space) if reset == Reset::Full => {
            let n = space.axes.len();
            let mut jacobian = [0.0; Space::MOST_AXES * Space::MOST_AXES];
            (space.jacobian)(storage, delta, &mut jacobian[..n * n]);
            for (k, value) in jacobian[..n * n].iter().enumerate() {
                by.set_element(block.tangent + k / n, block.tangent + k % n, *value);
            }
            true
        }
        _ => false,
    };
    block.kind.plus(storage, delta);
    is_carried
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;
    use crate::geometry::wgs84::Geodetic;
    use crate::state::{Angle, Attitude, Dynamics, Kind, LayoutBuilder, Manifold, Position, Scalar, Slot, Vector, Velocity};
    use crate::testing::{Lcg, check_chart, check_reset};
    use nalgebra::{UnitQuaternion, Vector3};

    fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Slot<M> {
        crate::filter::tests::declare(b, name, initial, &vec![1.0; M::KIND.dim()], Dynamics::Process)
    }

    fn layout(q: UnitQuaternion<f64>) -> Layout {
        let mut b = LayoutBuilder::new();
        declare::<Geodetic>(&mut b, "position", Geodetic::new(0.6, 2.2, 10.0));
        declare::<Attitude>(&mut b, "attitude", q);
        declare::<Scalar>(&mut b, "bias", 0.0);
        b.finish()
    }

    /// An inertial layout, in a Cartesian or in a geodetic frame, with a bias in body axes.
    fn inertial(r: &mut Lcg, is_local: bool) -> Layout {
        let mut b = LayoutBuilder::new();
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * r.signed());
        let (v, p, bias, rpy) = (vector(20.0), vector(100.0), vector(0.3), vector(3.0));
        declare::<Velocity>(&mut b, "velocity", v);
        if is_local {
            declare::<Position>(&mut b, "position", p);
        } else {
            declare::<Geodetic>(&mut b, "position", Geodetic::new(0.6, 2.2, 10.0).offset(&p));
        }
        declare::<Attitude>(&mut b, "attitude", so3::from_rpy(rpy.x, 0.3 * rpy.y, rpy.z));
        let bias = declare::<Vector<3>>(&mut b, "bias", bias);
        b.resolve_in_body(bias);
        declare::<Scalar>(&mut b, "scale", 0.0);
        b.finish()
    }

    /// A planar layout.
    fn planar(r: &mut Lcg) -> Layout {
        let mut b = LayoutBuilder::new();
        declare::<Angle>(&mut b, "heading", 3.0 * r.signed());
        declare::<Position>(&mut b, "position", Vector3::from_fn(|_, _| 30.0 * r.signed()));
        declare::<Scalar>(&mut b, "speed", 0.0);
        b.finish()
    }

    /// A correction of up to 0.6 rad per axis, and of metres.
    fn correction(layout: &Layout, r: &mut Lcg) -> Vec<f64> {
        let scale = |kind: Kind| match kind {
            Kind::Attitude | Kind::Angle => 0.6,
            Kind::Position | Kind::Geodetic => 20.0,
            _ => 2.0,
        };
        let blocks = layout.blocks().iter().flat_map(|b| vec![scale(b.kind); b.kind.dim()]);
        blocks.map(|s| s * r.signed()).collect()
    }

    /// Random attitudes short of gimbal lock and corrections of up to a third of a radian.
    fn cases() -> impl Iterator<Item = (Layout, Vec<f64>)> {
        let mut r = Lcg::new(3);
        (0..50).map(move |_| {
            let layout = layout(so3::from_rpy(3.0 * r.signed(), 1.0 * r.signed(), 3.0 * r.signed()));
            let delta = (0..7).map(|i| if i < 3 { 20.0 } else { 0.3 } * r.signed()).collect();
            (layout, delta)
        })
    }

    fn invariant() -> impl Iterator<Item = Invariant> {
        let origin = Some(Geodetic::new(0.6, 2.2, 10.0));
        let sides = [Side::Right, Side::Left].into_iter();
        sides.flat_map(move |side| [Biases::Imperfect, Biases::TwoFrames].map(|biases| Invariant { side, biases, origin }))
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
    fn invariant_charts_obey_the_laws_on_extended_poses_and_in_the_plane() {
        let mut r = Lcg::new(5);
        for chart in invariant() {
            for k in 0..30 {
                let layout = match k % 3 {
                    0 => inertial(&mut r, true),
                    1 => inertial(&mut r, false),
                    _ => planar(&mut r),
                };
                let delta = correction(&layout, &mut r);
                check_chart(&layout, &chart, layout.initial(), &delta).unwrap();
            }
        }
    }

    #[test]
    fn in_additive_charts_a_correction_is_a_shift_of_coordinates() {
        for (layout, delta) in cases() {
            check_reset(&layout, &AdditiveQuaternion, layout.initial(), &delta).unwrap();
        }
    }

    #[test]
    fn left_and_right_errors_lead_to_one_state_and_with_the_full_reset_to_one_covariance() {
        let mut r = Lcg::new(8);
        for biases in [Biases::Imperfect, Biases::TwoFrames] {
            let layout = inertial(&mut r, true);
            let delta = correction(&layout, &mut r);
            let n = layout.dim();
            let moved = |side: Side, reset: Reset| {
                let (mut x, mut by) = (layout.initial().to_vec(), BlockMatrix::identity(n));
                let origin = None;
                Invariant { side, biases, origin }.correct(&layout, &mut x, &delta, reset, &mut by);
                (x, by)
            };
            let apart = |reset: Reset| {
                let ((x, by), (y, of)) = (moved(Side::Right, reset), moved(Side::Left, reset));
                // 1e-12 of metres: rounding.
                assert!(
                    x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-12 * (1.0 + x.abs())),
                    "{x:?} {y:?}"
                );
                let pairs = (0..n * n).map(|k| (by.get(k / n, k % n) - of.get(k / n, k % n)).abs());
                pairs.fold(0.0, f64::max)
            };
            // 1e-10: rounding of positions of 100 m per radian.
            assert!(apart(Reset::Full) < 1e-10, "{}", apart(Reset::Full));
            assert!(apart(Reset::Plain) > 0.1, "{}", apart(Reset::Plain));
        }
    }

    #[test]
    fn a_correction_in_the_navigation_chart_turns_about_navigation_axes() {
        let q = so3::from_rpy(0.4, -0.2, 1.0);
        let layout = layout(q);
        let phi_n = Vector3::new(0.0, 0.0, 0.3);
        let phi_b = q.inverse() * phi_n;
        let (mut x, mut unused) = (layout.initial().to_vec(), BlockMatrix::identity(7));
        let delta = [0.0, 0.0, 0.0, phi_b.x, phi_b.y, phi_b.z, 0.0];
        Navigation.correct(&layout, &mut x, &delta, Reset::Plain, &mut unused);
        let rpy = so3::to_rpy(&Attitude::read(&x[3..7]));
        assert!((rpy - Vector3::new(0.4, -0.2, 1.3)).amax() < 1e-15); // 4 ε
    }

    #[test]
    fn outside_the_euler_chart_the_canonical_correction_is_applied() {
        let layout = layout(so3::from_rpy(0.0, core::f64::consts::FRAC_PI_2, 0.0));
        let delta = [0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.0];
        let (mut x, mut body, mut reset) = (layout.initial().to_vec(), layout.initial().to_vec(), BlockMatrix::identity(7));
        assert!(!AdditiveEuler.correct(&layout, &mut x, &delta, Reset::Plain, &mut reset));
        layout.plus(&mut body, &delta);
        assert_eq!(x, body);
    }

    #[test]
    fn a_correction_that_leads_out_of_the_euler_chart_or_across_the_vertical_is_canonical() {
        // To a pitch of 88°, and of 100°, which is written as 80° with half a turn of roll and yaw.
        for rise in [0.06, 0.27] {
            let layout = layout(so3::from_rpy(0.0, 85_f64.to_radians(), 0.0));
            let delta = [0.0, 0.0, 0.0, 0.0, rise, 0.0, 0.0];
            let (mut x, mut body, mut reset) = (layout.initial().to_vec(), layout.initial().to_vec(), BlockMatrix::identity(7));
            assert!(!AdditiveEuler.correct(&layout, &mut x, &delta, Reset::Plain, &mut reset), "{rise}");
            layout.plus(&mut body, &delta);
            assert_eq!(x, body);
        }
    }

    #[test]
    fn a_right_invariant_chart_counts_geodetic_positions_from_where_the_filter_starts() {
        let layout = layout(UnitQuaternion::identity());
        let start = Geodetic::new(0.6, 2.2, 10.0);
        let mut x = layout.initial().to_vec();
        Geodetic::write(&start.offset(&Vector3::new(100.0, 0.0, 0.0)), &mut x[..3]);
        let chart = Invariant::right().anchored(&layout, layout.initial()).unwrap();
        assert!(chart.anchored(&layout, &x).is_none(), "a start from elsewhere leaves the origin");
        let mut t = BlockMatrix::identity(7);
        chart.to_canonical(&layout, &x, &mut t);
        // ρ − p̂ × φ with p̂ = 100 m north: a turn about down moves it 100 m/rad east. 1e-2: metres at both ends.
        assert!((t.get(1, 5) - 100.0).abs() < 1e-2, "{}", t.get(1, 5));
        assert!(Invariant::left().anchored(&layout, &x).is_none());
    }

    #[test]
    fn the_laws_see_a_wrong_map_and_a_wrong_reset() {
        #[derive(Debug)]
        struct Wrong;
        impl Chart for Wrong {
            fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}
            fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
                // Plain in place of full, and the other way round.
                let other = if reset == Reset::Plain { Reset::Full } else { Reset::Plain };
                Navigation.correct(layout, x, delta, other, by)
            }
            fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
                Navigation.difference(layout, a, b, delta);
            }
        }
        let (layout, delta) = cases().next().unwrap();
        let wrong = |told: Result<(), String>| assert!(told.unwrap_err().contains("`attitude`"));
        wrong(check_chart(&layout, &Wrong, layout.initial(), &delta));
        wrong(check_reset(&layout, &Wrong, layout.initial(), &delta));
    }
}
