//! Integrals of a rotation at a constant rate, and their derivatives.
//!
//! While a body turns by φ in a step, what is fixed in it (a specific force, say) adds
//!
//! ```text
//! Γ₀(φ) = Exp(φ)                        the rotation itself
//! Γ₁(φ) = ∫₀¹ Exp(sφ) ds                to a velocity
//! Γ₂(φ) = ∫₀¹ ∫₀ˢ Exp(rφ) dr ds         to a position
//! Γ_m   = Σ_k [φ×]ᵏ/(k + m)!  =  I/m! + e_{m+1} [φ×] + e_{m+2} [φ×]²
//! e_k   = Σ_j (−θ²)ʲ/(2j + k)!,   θ = |φ|
//! ```
//!
//! so that a step with constant angular rate w and specific force f is exact:
//! C⁺ = C Γ₀(wT), v⁺ = v + gT + C Γ₁(wT) f T, p⁺ = p + vT + ½gT² + C Γ₂(wT) f T².
//!
//! Source     Bloesch et al. 2013, State Estimation for Legged Robots; Hartley et al. 2020,
//!            Contact-Aided Invariant EKF, appendix

use super::so3::skew;
use crate::math;
use nalgebra::{Matrix3, Vector3};

/// Below this θ² the series are summed: the next term, θ¹⁸/19!, is below 1e-17.
const SERIES: f64 = 1.0;
/// Terms of the series.
const TERMS: u32 = 9;

/// e_k and its derivative with respect to θ², k ≥ 1, `y` = θ².
fn coefficient(k: u32, y: f64) -> (f64, f64) {
    if y < SERIES {
        let (mut value, mut slope) = (0.0, 0.0);
        // From the smallest term on: Horner's scheme of the series, and of its derivative.
        for j in (0..TERMS).rev() {
            let term = inverse_factorial(2 * j + k) * if j % 2 == 0 { 1.0 } else { -1.0 };
            slope = slope * y + value;
            value = value * y + term;
        }
        return (value, slope);
    }
    // e₀ = cos θ, e₁ = sin θ/θ, and e_{k−2} = 1/(k−2)! − θ² e_k; 2θ² e_k' = e_{k−1} − k e_k.
    let theta = math::sqrt(y);
    let mut e = [math::cos(theta), math::sin(theta) / theta];
    for i in 2..=k {
        e = [e[1], (inverse_factorial(i - 2) - e[0]) / y];
    }
    (e[1], (e[0] - f64::from(k) * e[1]) / (2.0 * y))
}

/// 1/n!
const fn inverse_factorial(n: u32) -> f64 {
    INVERSE_FACTORIAL[n as usize]
}

const INVERSE_FACTORIAL: [f64; 24] = {
    let mut table = [1.0; 24];
    let (mut n, mut factorial) = (1, 1.0);
    while n < table.len() {
        factorial *= n as f64;
        table[n] = 1.0 / factorial;
        n += 1;
    }
    table
};

/// Γ_m(φ), 3×3, φ \[rad\].
#[must_use]
pub fn gamma(m: u32, phi: &Vector3<f64>) -> Matrix3<f64> {
    let y = phi.norm_squared();
    let (a, b) = (coefficient(m + 1, y).0, coefficient(m + 2, y).0);
    let s = skew(phi);
    Matrix3::identity() * inverse_factorial(m) + s * a + s * s * b
}

/// ∂(Γ_m(φ) v)/∂φ, 3×3, φ \[rad\].
#[must_use]
pub fn gamma_derivative(m: u32, phi: &Vector3<f64>, v: &Vector3<f64>) -> Matrix3<f64> {
    let y = phi.norm_squared();
    let ((a, a_slope), (b, b_slope)) = (coefficient(m + 1, y), coefficient(m + 2, y));
    let once = phi.cross(v);
    let twice = phi.cross(&once);
    // φ × (φ × v) = φ (φ·v) − θ² v.
    let by_twice = phi * v.transpose() + Matrix3::identity() * phi.dot(v) - v * phi.transpose() * 2.0;
    (once * a_slope + twice * b_slope) * (phi.transpose() * 2.0) - skew(v) * a + by_twice * b
}

#[cfg(test)]
mod tests {
    use super::super::so3;
    use super::*;

    type V = Vector3<f64>;

    fn cases() -> [V; 5] {
        let axis = V::new(0.36, -0.48, 0.8);
        [V::zeros(), axis * 1e-5, axis * 0.3, axis * 0.999_999, axis * 2.5]
    }

    #[test]
    fn the_first_two_are_the_rotation_and_its_left_jacobian() {
        for phi in cases() {
            let rotation = so3::rotation(&so3::exp(&phi));
            // 8 ε: sums of three products, quaternions on the other side.
            let rounding = 8.0 * f64::EPSILON;
            assert!((gamma(0, &phi) - rotation).amax() < rounding, "{phi}");
            assert!((gamma(1, &phi) - so3::right_jacobian(&-phi)).amax() < rounding, "{phi}");
        }
    }

    #[test]
    fn each_is_the_integral_of_the_one_before() {
        // ∫₀¹ Γ_m(sφ) sᵐ ds = Γ_{m+1}(φ), by Simpson's rule with 200 intervals.
        for phi in cases() {
            for m in 0..2 {
                let mut sum = Matrix3::zeros();
                for i in 0..=200_u32 {
                    let s = f64::from(i) / 200.0;
                    let weight = if i == 0 || i == 200 { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                    sum += gamma(m, &(phi * s)) * (s.powi(m as i32) * weight / 600.0);
                }
                // 2e-10: h⁴/180 of the fourth derivative, which is at most 2.5⁴.
                assert!((sum - gamma(m + 1, &phi)).amax() < 2e-10, "{m} {phi}");
            }
        }
    }

    #[test]
    fn both_branches_agree_where_they_meet() {
        for k in 1..6 {
            let (below, above) = (coefficient(k, 1.0 - 1e-15), coefficient(k, 1.0));
            // e_k loses digits by k/2 divisions of differences; 1e-14 of 1/k! is 50 ε.
            assert!(
                (below.0 - above.0).abs() < 1e-14 && (below.1 - above.1).abs() < 1e-13,
                "{k}: {below:?} {above:?}"
            );
        }
    }

    #[test]
    fn derivatives_match_central_differences() {
        let (v, h) = (V::new(1.0, -2.0, 0.5), 1e-5);
        for phi in cases() {
            for m in 0..3 {
                let d = gamma_derivative(m, &phi, &v);
                for k in 0..3 {
                    let mut step = V::zeros();
                    step[k] = h;
                    let numeric = (gamma(m, &(phi + step)) * v - gamma(m, &(phi - step)) * v) / (2.0 * h);
                    // 1e-9: h²/6 of the third derivative, rounding 1e-16/h.
                    assert!((d.column(k) - numeric).amax() < 1e-9, "{m} {phi} {k}");
                }
            }
        }
    }
}
