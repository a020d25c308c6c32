//! Rotations: SO(3) by unit quaternions, rotation vectors and Euler angles.
//!
//! Convention  `q_nb` and its matrix `C_nb` map body to navigation axes: `x_n = C_nb x_b`.
//!             Hamilton product; in arrays the scalar comes first, `[q0, q1, q2, q3]`.
//! Exp, Log    rotation vector φ \[rad\] ↔ quaternion `[cos(θ/2), sin(θ/2) φ/θ]`, θ = |φ|
//! Jacobian    `Exp(φ + δ) = Exp(φ) Exp(Jr(φ) δ)` to first order in δ
//! Euler       `C_nb = Rz(yaw) Ry(pitch) Rx(roll)`, body forward-right-down to north-east-down
//! Valid       every function is finite for finite input, except `right_jacobian_inverse`
//!             at |φ| = 2πk, k ≥ 1, where the inverse does not exist
//! Source      Sola, Deray, Atchuthan 2018 (arXiv 1812.01537), eqs. 132-145 for Exp, Log, Jr;
//!             Titterton and Weston 2004, §3.6 for Euler angles and quaternion kinematics
//!
//! Below |φ| = 0.2 rad, the range of every strapdown step, Taylor polynomials that are exact
//! to rounding replace the library's trigonometric functions: faster, free of 0/0, and the
//! same bits on every platform.

use crate::math;
use core::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

/// |C31| above which [`to_rpy`] and [`euler_rate_of_body`] treat the attitude as gimbal
/// locked: |pitch| > 89.19°.
pub const GIMBAL_LOCK_C31: f64 = 0.9999;

/// θ² below which the Taylor polynomials hold to rounding (θ < 0.2 rad).
const SMALL_ANGLE_SQUARED: f64 = 0.04;

/// The cross-product matrix: `skew(a) b = a × b` (3×3, same unit as `v`).
#[inline]
#[must_use]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// `m [v×]`, 3×3, without the products by the zeros of [`skew`].
#[inline]
#[must_use]
pub fn times_skew(m: &Matrix3<f64>, v: &Vector3<f64>) -> Matrix3<f64> {
    let row = |x: f64, y: f64, z: f64| [y * v.z - z * v.y, z * v.x - x * v.z, x * v.y - y * v.x];
    let [a, b, c] = [row(m.m11, m.m12, m.m13), row(m.m21, m.m22, m.m23), row(m.m31, m.m32, m.m33)];
    Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
}

/// `cᵀ v`: a vector back through a rotation.
#[inline]
#[must_use]
pub fn turn_back(c: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        c.m11 * v.x + c.m21 * v.y + c.m31 * v.z,
        c.m12 * v.x + c.m22 * v.y + c.m32 * v.z,
        c.m13 * v.x + c.m23 * v.y + c.m33 * v.z,
    )
}

/// Wraps an angle \[rad\] to (−π, π]. An angle already there is returned bit for bit;
/// NaN and infinity give NaN.
#[inline]
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = angle - TAU * math::ceil((angle - PI) / TAU);
    // Rounding may leave the result an ulp outside.
    if wrapped <= -PI || wrapped > PI { PI } else { wrapped }
}

/// Exp: rotation vector φ \[rad\] to unit quaternion. Any length is allowed.
#[inline]
#[must_use]
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let theta2 = phi.norm_squared();
    let (w, k) = if theta2 < SMALL_ANGLE_SQUARED {
        let x = 0.25 * theta2; // (θ/2)² < 0.01: the first term left out is below 3e-17
        let x2 = x * x;
        let cos = 1.0 - x * ((0.5 - x * (1.0 / 24.0)) + x2 * (1.0 / 720.0 - x * (1.0 / 40_320.0)));
        let sinc = 1.0 - x * ((1.0 / 6.0 - x * (1.0 / 120.0)) + x2 * (1.0 / 5040.0 - x * (1.0 / 362_880.0)));
        (cos, 0.5 * sinc)
    } else {
        let theta = math::sqrt(theta2);
        let (sin, cos) = math::sin_cos(0.5 * theta);
        (cos, sin / theta)
    };
    UnitQuaternion::new_unchecked(Quaternion::from_parts(w, k * phi))
}

/// Log: unit quaternion to the shortest rotation vector \[rad\], |φ| ≤ π.
///
/// `q` and `−q` give the same answer. At half a turn, the axis has the sign of `q`.
#[inline]
#[must_use]
pub fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let w = sign * q.w;
    let v = sign * q.imag();
    let n = v.norm();
    if n < 1e-7 {
        // 2 atan(n/w)/n = (2/w)(1 − n²/3w² + …); the omitted terms are below 1e-28.
        let t2 = (n / w) * (n / w);
        v * (2.0 / w * (1.0 - t2 / 3.0))
    } else {
        v * (2.0 * math::atan2(n, w) / n)
    }
}

/// `(1 − cos θ)/θ²` and `(θ − sin θ)/θ³` from θ².
#[inline]
fn jacobian_coefficients(theta2: f64) -> (f64, f64) {
    let y = theta2;
    if y < SMALL_ANGLE_SQUARED {
        let y2 = y * y;
        let a = 0.5 - y * ((1.0 / 24.0 - y * (1.0 / 720.0)) + y2 * (1.0 / 40_320.0 - y * (1.0 / 3_628_800.0)));
        let b = 1.0 / 6.0 - y * ((1.0 / 120.0 - y * (1.0 / 5040.0)) + y2 * (1.0 / 362_880.0 - y * (1.0 / 39_916_800.0)));
        (a, b)
    } else {
        let theta = math::sqrt(y);
        let half = math::sin(0.5 * theta);
        (2.0 * half * half / y, (theta - math::sin(theta)) / (theta * y))
    }
}

/// Right Jacobian Jr(φ) of SO(3), 3×3: `Exp(φ + δ) = Exp(φ) Exp(Jr δ)` to first order.
///
/// `Jr = I − (1 − cos θ)/θ² [φ×] + (θ − sin θ)/θ³ [φ×]²`; the left Jacobian is `Jr(−φ)`.
#[inline]
#[must_use]
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (a, b) = jacobian_coefficients(phi.norm_squared());
    let s = skew(phi);
    Matrix3::identity() - a * s + b * (s * s)
}

/// Inverse of [`right_jacobian`], 3×3: `Log(Exp(φ) Exp(δ)) = φ + Jr⁻¹ δ` to first order.
///
/// `Jr⁻¹ = I + ½[φ×] + (1 − (θ/2) cot(θ/2))/θ² [φ×]²`. Singular at |φ| = 2π; every
/// vector that [`log`] returns is safe.
#[inline]
#[must_use]
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let y = phi.norm_squared();
    let c = if y < SMALL_ANGLE_SQUARED {
        // Bernoulli series 1/12 + y/720 + y²/30240 + …; the next term is below 2e-16.
        1.0 / 12.0 + y * (1.0 / 720.0 + y * (1.0 / 30_240.0 + y * (1.0 / 1_209_600.0 + y / 47_900_160.0)))
    } else {
        let half = 0.5 * math::sqrt(y);
        (1.0 - half / math::tan(half)) / y
    };
    let s = skew(phi);
    Matrix3::identity() + 0.5 * s + c * (s * s)
}

/// ∂(J_l(φ) v)/∂φ, 3×3, J_l(φ) = Jr(−φ): how the mean of [`mean_rotated`] changes with φ.
///
/// J_l v = v + a φ×v + b φ×(φ×v) with a = (1 − cos θ)/θ², b = (θ − sin θ)/θ³, differentiated by φ.
#[must_use]
pub fn left_jacobian_slope(phi: &Vector3<f64>, v: &Vector3<f64>) -> Matrix3<f64> {
    let y = phi.norm_squared();
    let (a, b) = jacobian_coefficients(y);
    let (da, db) = jacobian_slopes(y);
    let (once, along) = (phi.cross(v), phi.dot(v));
    let twice = phi.cross(&once);
    -a * skew(v)
        + b * (phi * v.transpose() - 2.0 * (v * phi.transpose()) + Matrix3::identity() * along)
        + (da * once + db * twice) * phi.transpose()
}

/// a'(θ)/θ and b'(θ)/θ of the coefficients of the Jacobian, from θ².
fn jacobian_slopes(theta2: f64) -> (f64, f64) {
    let y = theta2;
    if y < 1.0 {
        // a = Σ (−y)^k/(2k + 2)!, b = Σ (−y)^k/(2k + 3)!; the terms after k = 9 are below 1e-19.
        let (mut a, mut b, mut term) = (0.0, 0.0, 0.5);
        for k in 1..10 {
            let k = f64::from(k);
            term /= -(2.0 * k + 1.0) * (2.0 * k + 2.0);
            a += 2.0 * k * term;
            b += 2.0 * k * term / (2.0 * k + 3.0);
            term *= y;
        }
        (a, b)
    } else {
        let theta = math::sqrt(y);
        let (sin, cos) = math::sin_cos(theta);
        (
            (theta * sin - 2.0 * (1.0 - cos)) / (y * y),
            (3.0 * sin - 2.0 * theta - theta * cos) / (y * y * theta),
        )
    }
}

/// Mean of `Exp(s φ) v` over s ∈ \[0, 1\]: the mean of a body-fixed vector while
/// the body turns by φ at a constant rate. Equals `Jr(−φ) v`, without building the matrix.
#[inline]
#[must_use]
pub fn mean_rotated(phi: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let (a, b) = jacobian_coefficients(phi.norm_squared());
    let c = phi.cross(v);
    v + a * c + b * phi.cross(&c)
}

/// The direction cosine matrix of a quaternion: `C_nb` of `q_nb`, `x_n = C_nb x_b`.
#[inline]
#[must_use]
pub fn rotation(q: &UnitQuaternion<f64>) -> Matrix3<f64> {
    q.to_rotation_matrix().into_inner()
}

/// The same rotation as a quaternion with a non-negative scalar part.
#[inline]
#[must_use]
pub fn canonical(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    if q.w < 0.0 {
        UnitQuaternion::new_unchecked(-q.into_inner())
    } else {
        *q
    }
}

/// `[q0, q1, q2, q3]`, scalar first.
#[inline]
#[must_use]
pub fn to_scalar_first(q: &UnitQuaternion<f64>) -> Vector4<f64> {
    Vector4::new(q.w, q.i, q.j, q.k)
}

/// The unit quaternion of `[q0, q1, q2, q3]`, scalar first; the sign is kept. A vector too
/// short to be normalised, or not finite, gives the identity.
#[inline]
#[must_use]
pub fn from_scalar_first(v: &Vector4<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::try_new(Quaternion::new(v[0], v[1], v[2], v[3]), math::sqrt(f64::MIN_POSITIVE)).unwrap_or_else(UnitQuaternion::identity)
}

/// `q_nb` from roll, pitch, yaw \[rad\]: turn by yaw about down, then by pitch about the new
/// right axis, then by roll about the new forward axis.
#[inline]
#[must_use]
pub fn from_rpy(roll: f64, pitch: f64, yaw: f64) -> UnitQuaternion<f64> {
    let (sr, cr) = math::sin_cos(0.5 * roll);
    let (sp, cp) = math::sin_cos(0.5 * pitch);
    let (sy, cy) = math::sin_cos(0.5 * yaw);
    UnitQuaternion::new_unchecked(Quaternion::new(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ))
}

/// `[roll, pitch, yaw]` \[rad\] of `q_nb`; roll and yaw in (−π, π], pitch in \[−π/2, π/2\].
///
/// Above |C31| = [`GIMBAL_LOCK_C31`] roll and yaw can hardly be separated. Roll is then set to
/// 0, and yaw gets the whole turn about the vertical. An attitude rebuilt from such
/// angles is wrong by at most |roll| cos(pitch) < 0.0142 |roll|; pitch stays exact.
#[inline]
#[must_use]
pub fn to_rpy(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let c = rotation(q);
    let c31 = c[(2, 0)];
    // As −asin(c31), but accurate near ±90° too, and never NaN.
    let pitch = math::atan2(-c31, math::hypot(c[(2, 1)], c[(2, 2)]));
    if c31.abs() > GIMBAL_LOCK_C31 {
        return Vector3::new(0.0, pitch, wrap_angle(math::atan2(-c[(0, 1)], c[(1, 1)])));
    }
    Vector3::new(
        wrap_angle(math::atan2(c[(2, 1)], c[(2, 2)])),
        pitch,
        wrap_angle(math::atan2(c[(1, 0)], c[(0, 0)])),
    )
}

/// E(roll, pitch), 3×3: `ω_nb_b = E · d(roll, pitch, yaw)/dt`, and equally
/// `δφ_b = E · δ(roll, pitch, yaw)` for a right perturbation `C_nb Exp(δφ_b)`.
#[inline]
#[must_use]
pub fn body_rate_of_euler(roll: f64, pitch: f64) -> Matrix3<f64> {
    let (sr, cr) = math::sin_cos(roll);
    let (sp, cp) = math::sin_cos(pitch);
    Matrix3::new(1.0, 0.0, -sp, 0.0, cr, sr * cp, 0.0, -sr, cr * cp)
}

/// E⁻¹(roll, pitch), 3×3: `d(roll, pitch, yaw)/dt = E⁻¹ ω_nb_b`.
///
/// |cos(pitch)| is held at or above 0.0141, its value at [`GIMBAL_LOCK_C31`], so the result
/// is finite; beyond that pitch it is no longer the exact inverse.
#[inline]
#[must_use]
pub fn euler_rate_of_body(roll: f64, pitch: f64) -> Matrix3<f64> {
    const COS_FLOOR: f64 = 0.014_141_782_065_920_829; // √(1 − 0.9999²)
    let (sr, cr) = math::sin_cos(roll);
    let (sp, cp) = math::sin_cos(pitch);
    let cp = cp.abs().max(COS_FLOOR).copysign(cp);
    let tp = sp / cp;
    Matrix3::new(1.0, sr * tp, cr * tp, 0.0, cr, -sr, 0.0, sr / cp, cr / cp)
}

/// Ω(ω), 4×4, on scalar-first quaternions: `dq/dt = ½ Ω(ω_nb_b) q`, i.e. `½ q ⊗ [0, ω]`.
#[inline]
#[must_use]
pub fn rate_matrix(w: &Vector3<f64>) -> Matrix4<f64> {
    Matrix4::new(
        0.0, -w.x, -w.y, -w.z, //
        w.x, 0.0, w.z, -w.y, //
        w.y, -w.z, 0.0, w.x, //
        w.z, w.y, -w.x, 0.0,
    )
}

/// One first-order quaternion step, `q + q̇ Δt`, then normalised: the textbook update, kept
/// for comparison. ω = `ω_nb_b` \[rad/s\]. Error per step: (|ω|Δt)³/12 rad.
#[inline]
#[must_use]
pub fn integrate_literal(q: &UnitQuaternion<f64>, w: &Vector3<f64>, dt: f64) -> UnitQuaternion<f64> {
    let q_dot = q.into_inner() * Quaternion::from_parts(0.0, 0.5 * w);
    UnitQuaternion::new_normalize(q.into_inner() + q_dot * dt)
}

/// One exact quaternion step for a constant rate ω = `ω_nb_b` \[rad/s\]:
/// `[cos(θ/2) I + sin(θ/2)/θ Ω(ωΔt)] q = q ⊗ Exp(ωΔt)`, θ = |ω|Δt.
#[inline]
#[must_use]
pub fn integrate_exact(q: &UnitQuaternion<f64>, w: &Vector3<f64>, dt: f64) -> UnitQuaternion<f64> {
    q * exp(&(w * dt))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPS: f64 = f64::EPSILON;

    #[test]
    fn a_product_with_a_cross_product_matrix_leaves_out_zeros_only() {
        let (m, v) = (Matrix3::from_fn(|i, j| (3 * i + j) as f64 - 2.5), Vector3::new(0.3, -2.0, 7.0));
        assert_eq!(times_skew(&m, &v), m * skew(&v));
    }

    /// Rotation vectors from nothing to beyond half a turn, on both sides of the switch
    /// between polynomial and closed form.
    fn vectors() -> impl Iterator<Item = Vector3<f64>> {
        let axes = [
            Vector3::new(1.0, 0.0, 0.0),
            Vector3::new(0.0, -0.6, 0.8),
            Vector3::new(2.0, -3.0, 6.0) / 7.0,
        ];
        let lengths = [0.0, 1e-170, 1e-12, 1e-7, 1e-3, 0.1999, 0.2001, 1.0, 3.0, PI - 1e-6, 4.5];
        axes.into_iter().flat_map(move |a| lengths.into_iter().map(move |l| a * l))
    }

    #[test]
    fn exp_matches_the_closed_form_of_nalgebra() {
        for phi in vectors() {
            let error = to_scalar_first(&exp(&phi)) - to_scalar_first(&UnitQuaternion::new(phi));
            assert!(error.amax() < 2.0 * EPS, "{phi}"); // 2 ε: rounding of two formulas
            assert!((exp(&phi).norm() - 1.0).abs() < 4.0 * EPS, "{phi}"); // rounding
        }
    }

    #[test]
    fn log_inverts_exp_and_is_the_shortest() {
        for phi in vectors().filter(|p| p.norm() < PI) {
            let back = log(&exp(&phi));
            // 8 ε relative: rounding of the two maps.
            assert!((back - phi).norm() <= 8.0 * EPS * phi.norm(), "{phi} {back}");
            let negated = UnitQuaternion::new_unchecked(-exp(&phi).into_inner());
            assert_eq!(log(&negated), back);
        }
        let long = Vector3::new(0.0, 0.0, 4.5); // beyond half a turn: the other way round
        assert!((log(&exp(&long)).z - (4.5 - TAU)).abs() < 8.0 * EPS);
    }

    #[test]
    fn right_jacobian_matches_central_differences_of_exp() {
        let h = 1e-5;
        for phi in vectors().filter(|p| p.norm() < PI) {
            let mut numeric = Matrix3::zeros();
            for i in 0..3 {
                let mut d = Vector3::zeros();
                d[i] = h;
                let rel = exp(&(phi - d)).inverse() * exp(&(phi + d));
                numeric.set_column(i, &(log(&rel) / (2.0 * h)));
            }
            // 1e-10: ε/h = 2e-11 of rounding, h²/6 = 2e-11 of truncation.
            assert!((right_jacobian(&phi) - numeric).amax() < 1e-10, "{phi}");
        }
    }

    #[test]
    fn right_jacobian_inverse_times_right_jacobian_is_the_identity() {
        for phi in vectors() {
            let product = right_jacobian_inverse(&phi) * right_jacobian(&phi);
            // 100 ε: rounding of (θ − sin θ)/θ³ just above the switch.
            assert!((product - Matrix3::identity()).amax() < 100.0 * EPS, "{phi}");
        }
    }

    #[test]
    fn mean_rotated_equals_simpson_quadrature_of_the_turning_vector() {
        let v = Vector3::new(0.3, -9.8, 1.1);
        for phi in vectors() {
            let n = 200;
            let mut sum = Vector3::zeros();
            for k in 0..=n {
                let weight = if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
                sum += exp(&(phi * f64::from(k) / f64::from(n))) * v * weight;
            }
            let mean = sum / f64::from(3 * n);
            // Simpson error θ⁴|v|/(180 n⁴) = 1.4e-8 at θ = 4.5.
            assert!((mean_rotated(&phi, &v) - mean).norm() < 2e-8, "{phi}");
            let by_matrix = right_jacobian(&-phi) * v;
            assert!((mean_rotated(&phi, &v) - by_matrix).norm() < 100.0 * EPS * v.norm());
        }
    }

    #[test]
    fn from_rpy_of_10_minus_5_and_30_deg_matches_the_tabulated_quaternion_and_the_product_of_axis_turns() {
        let q = from_rpy(10_f64.to_radians(), -5_f64.to_radians(), 30_f64.to_radians());
        let expected = Vector4::new(0.96035, 0.095352, -0.019437, 0.261261);
        assert!((to_scalar_first(&q) - expected).amax() < 5e-6); // digits of the table
        let product = exp(&Vector3::new(0.0, 0.0, 30_f64.to_radians()))
            * exp(&Vector3::new(0.0, -5_f64.to_radians(), 0.0))
            * exp(&Vector3::new(10_f64.to_radians(), 0.0, 0.0));
        assert!((q.into_inner() - product.into_inner()).norm() < 4.0 * EPS); // rounding
    }

    #[test]
    fn to_rpy_inverts_from_rpy_outside_gimbal_lock() {
        for roll in [-3.1, -0.4, 0.0, 2.0, PI] {
            for pitch in [-1.55, -0.3, 0.0, 1.0, 1.55] {
                for yaw in [-3.0, 0.0, 1.7, PI] {
                    let rpy = to_rpy(&from_rpy(roll, pitch, yaw));
                    let error = rpy - Vector3::new(roll, pitch, yaw);
                    // 1e-13: rounding divided by cos(1.55) = 0.02. Half a turn has two signs.
                    assert!(error.map(wrap_angle).amax() < 1e-13, "{roll} {pitch} {yaw}");
                }
            }
        }
    }

    #[test]
    fn gimbal_lock_gives_finite_angles_that_rebuild_the_attitude_as_documented() {
        for (roll, pitch, yaw) in [(0.7, PI / 2.0, 1.0), (-2.0, -PI / 2.0, 0.3), (1.0, 1.569, -2.0)] {
            let q = from_rpy(roll, pitch, yaw);
            let rpy = to_rpy(&q);
            assert_eq!(rpy.x, 0.0);
            assert!((rpy.y - pitch).abs() < 1e-8); // √ε: C31 is flat at its maximum
            let rebuilt = from_rpy(rpy.x, rpy.y, rpy.z);
            let allowed = pitch.cos().abs() * f64::abs(roll) + 1e-8;
            assert!(log(&(q.inverse() * rebuilt)).norm() <= allowed, "{roll} {pitch} {yaw}");
        }
        assert!(euler_rate_of_body(0.3, PI / 2.0).iter().all(|x| x.is_finite() && x.abs() < 71.0));
    }

    #[test]
    fn euler_rate_matrices_are_inverse_and_match_central_differences() {
        let (roll, pitch, yaw, h) = (0.4, -1.1, 2.0, 1e-5);
        let e = body_rate_of_euler(roll, pitch);
        let identity = e * euler_rate_of_body(roll, pitch);
        assert!((identity - Matrix3::identity()).amax() < 10.0 * EPS); // exact up to rounding
        for i in 0..3 {
            let mut d = Vector3::zeros();
            d[i] = h;
            let plus = from_rpy(roll + d.x, pitch + d.y, yaw + d.z);
            let minus = from_rpy(roll - d.x, pitch - d.y, yaw - d.z);
            let numeric = log(&(minus.inverse() * plus)) / (2.0 * h);
            assert!((e.column(i) - numeric).amax() < 1e-10); // ε/h and h²/6, each 2e-11
        }
    }

    #[test]
    fn quaternion_steps_agree_with_the_rate_matrix_form() {
        let q = from_rpy(0.3, -0.2, 1.9);
        let (w, dt) = (Vector3::new(0.5, -1.0, 0.7), 0.01);
        let literal = to_scalar_first(&q) + 0.5 * dt * rate_matrix(&w) * to_scalar_first(&q);
        let error = to_scalar_first(&integrate_literal(&q, &w, dt)) - literal.normalize();
        assert!(error.amax() < 4.0 * EPS); // rounding
        let theta = w.norm() * dt;
        let exact =
            (Matrix4::identity() * (theta / 2.0).cos() + rate_matrix(&(w * dt)) * ((theta / 2.0).sin() / theta)) * to_scalar_first(&q);
        assert!((to_scalar_first(&integrate_exact(&q, &w, dt)) - exact).amax() < 4.0 * EPS);
        let gap = log(&(integrate_exact(&q, &w, dt).inverse() * integrate_literal(&q, &w, dt)));
        // 1 %: the next term of atan is of relative order θ² = 2e-4, far below.
        assert!((gap.norm() / (theta.powi(3) / 12.0) - 1.0).abs() < 0.01, "{}", gap.norm());
    }

    #[test]
    fn wrap_angle_maps_to_the_half_open_interval() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert_eq!(wrap_angle(0.1), 0.1);
        assert!(wrap_angle(f64::NAN).is_nan() && wrap_angle(f64::INFINITY).is_nan());
        for k in [-1000.0, -3.0, -1.0, 1.0, 2.0, 1000.0] {
            let w = wrap_angle(1.25 + k * TAU);
            assert!((w - 1.25).abs() < 1e-12, "{k}"); // ulp of 1000 turns: 9e-13
            assert!(wrap_angle(PI + k * TAU) > -PI && wrap_angle(PI + k * TAU) <= PI);
        }
    }

    #[test]
    fn canonical_keeps_the_rotation_and_makes_the_scalar_non_negative() {
        let q = exp(&Vector3::new(0.0, 4.0, 0.0));
        assert!(q.w < 0.0 && canonical(&q).w > 0.0);
        assert_eq!(rotation(&q), rotation(&canonical(&q)));
        assert_eq!(from_scalar_first(&Vector4::zeros()), UnitQuaternion::identity());
        assert_eq!(from_scalar_first(&(2.0 * to_scalar_first(&q))).w, q.w);
    }
}
