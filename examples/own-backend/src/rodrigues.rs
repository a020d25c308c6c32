//! A chart: the attitude error as modified Rodrigues parameters, δ = 4 tan(φ/4) along the axis of the turn.
//!
//! ⊞          q ⊗ (1 − |s|², 2s)/(1 + |s|²), s = δ/4: without a trigonometric function
//! T          I: δ = φ to second order
//! J          ((1 − |s|²) I − 2 [s ×] + 2 s sᵀ) / (1 + |s|²)²
//! Valid      for errors below a full turn
//! Source     Markley, Crassidis 2014, Fundamentals of Spacecraft Attitude Determination and Control, §2.9.3, §3.1

use fusion::core::chart::{Chart, Reset, correct_block};
use fusion::core::linear::BlockMatrix;
use fusion::core::state::{Attitude, Kind, Layout, Manifold};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Attitude errors as modified Rodrigues parameters in body axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rodrigues;

fn jacobian(s: &Vector3<f64>) -> Matrix3<f64> {
    let n = s.norm_squared();
    // By elements: rustc 1.95 with optimisation computes `s * s.transpose()` wrongly here, once it is inlined.
    let outer = Matrix3::from_fn(|i, j| s[i] * s[j]);
    let sum = Matrix3::identity() * (1.0 - n) - s.cross_matrix() * 2.0 + outer * 2.0;
    sum / ((1.0 + n) * (1.0 + n))
}

impl Chart for Rodrigues {
    fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}

    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
        let mut moved = false;
        for b in layout.blocks() {
            if b.kind != Kind::Attitude {
                moved |= correct_block(b, x, delta, reset, by);
                continue;
            }
            let q = Attitude::read(&x[b.storage_range()]);
            let s = Vector3::from_column_slice(&delta[b.tangent_range()]) / 4.0;
            let n = s.norm_squared();
            let turn = Quaternion::from_parts(1.0 - n, s * 2.0) / (1.0 + n);
            Attitude::write(&(q * UnitQuaternion::new_normalize(turn)), &mut x[b.storage_range()]);
            if let (Reset::Full, Ok(slot)) = (reset, layout.slot::<Attitude>(&b.name)) {
                by.set(slot, slot, &jacobian(&s));
                moved = true;
            }
        }
        moved
    }

    fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
        layout.minus(a, b, delta);
        for block in layout.blocks().iter().filter(|b| b.kind == Kind::Attitude) {
            let storage = block.storage_range();
            let d = Attitude::read(&b[storage.clone()]).inverse() * Attitude::read(&a[storage]);
            // The shorter of the two turns.
            let sign = if d.w < 0.0 { -1.0 } else { 1.0 };
            delta[block.tangent_range()].copy_from_slice((d.imag() * (4.0 * sign / (1.0 + d.w.abs()))).as_slice());
        }
    }
}
