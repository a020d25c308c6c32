//! Kernels of the attitude reference: rates, vertical, compass.
//!
//! Axes       n north-east-down, b forward-right-down, q = `q_nb` scalar first
//! Rate       w_nb_b = w_ib_b − C_nbᵀ (w_ie_n + w_en_n)
//! Gravity    at rest f_b/|f| = −g_b(q), g_b = C_nbᵀ e₃ = [2(q1q3 − q0q2), 2(q0q1 + q2q3), 1 − 2(q1² + q2²)]
//!            F(q) = g_b + f_b/|f|,  J = ∂F/∂q,  ∇ = JᵀF
//! Step       q_∇ = q − μ ∇/|∇|,  μ = α |q̇_ω| Δt + μ₀,  |q̇_ω| = ½|w|: turns the tilt by 2μ rad
//! Compass    m = A (m_raw − b);  with roll φ and pitch θ
//!            m_x' = m_x cθ + m_y sφ sθ + m_z cφ sθ,  m_y' = m_y cφ − m_z sφ,
//!            ψ = atan2(−m_y', m_x') + D, D the declination
//! Source     Madgwick 2010, eqs. 12-34, with gravity along down; Titterton and Weston 2004, §3.6

use fusion_core::geometry::so3;
use fusion_core::state::wrap;
use nalgebra::{Matrix3, Matrix3x4, Quaternion, UnitQuaternion, Vector3};

/// The gradient below which the step has no direction: tilt of 1e-9 rad.
const FLAT: f64 = 4e-9;

/// `w_nb_b` \[rad/s\]: `w_ib_b` \[rad/s\] less the turning `w_in_n` of the navigation frame.
#[inline]
#[must_use]
pub fn compensated_rate(w_ib_b: &Vector3<f64>, q: &UnitQuaternion<f64>, w_in_n: &Vector3<f64>) -> Vector3<f64> {
    w_ib_b - q.inverse_transform_vector(w_in_n)
}

/// F(q): how far the direction of `f_b` is from straight up.
#[inline]
#[must_use]
pub fn gravity_error(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>) -> Vector3<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    let g_b = Vector3::new(2.0 * (x * z - w * y), 2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
    g_b + f_b / f_b.norm()
}

/// J = ∂F/∂q, scalar first.
#[inline]
#[must_use]
pub fn gravity_jacobian(q: &UnitQuaternion<f64>) -> Matrix3x4<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    #[rustfmt::skip]
    let j = Matrix3x4::new(
        -2.0 * y, 2.0 * z, -2.0 * w, 2.0 * x,
        2.0 * x, 2.0 * w, 2.0 * z, 2.0 * y,
        0.0, -4.0 * x, -4.0 * y, 0.0,
    );
    j
}

/// μ: the length of a gradient step at the rate `w_nb_b` \[rad/s\] over `dt` \[s\].
#[inline]
#[must_use]
pub fn step_length(alpha: f64, floor: f64, w_nb_b: &Vector3<f64>, dt: f64) -> f64 {
    alpha * 0.5 * w_nb_b.norm() * dt + floor
}

/// One gradient step of length `mu` from `q` towards a vertical `f_b` (any length); `None` where
/// the gradient vanishes or there is no direction.
#[inline]
#[must_use]
pub fn gradient_step(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>, mu: f64) -> Option<UnitQuaternion<f64>> {
    let gradient = gravity_jacobian(q).transpose() * gravity_error(q, f_b);
    let length = gradient.norm();
    // Not a number fails, too.
    (length > FLAT).then(|| so3::from_scalar_first(&(so3::to_scalar_first(q) - gradient * (mu / length))))
}

/// `q` turned by the least angle that puts `f_b` (any length) straight up.
#[inline]
#[must_use]
pub fn levelled(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>) -> UnitQuaternion<f64> {
    let up = -q.inverse_transform_vector(&Vector3::z());
    let axis = up.cross(f_b);
    let (sin, cos) = (axis.norm(), up.dot(f_b));
    // Along the axis: Exp(−δφ) up ∥ f_b. Parallel vectors have no axis and need none.
    let turn = if sin > 0.0 {
        axis * (-sin.atan2(cos) / sin)
    } else {
        Vector3::zeros()
    };
    q * so3::exp(&turn)
}

/// The specific force low-passed over `time_constant` \[s\] in axes that do not turn: `filtered`
/// and `f_b` in body axes, before and after a turn of `w_nb_b` \[rad/s\] for `dt` \[s\].
#[inline]
#[must_use]
pub fn low_passed(filtered: &Vector3<f64>, f_b: &Vector3<f64>, w_nb_b: &Vector3<f64>, dt: f64, time_constant: f64) -> Vector3<f64> {
    let carried = so3::exp(&(w_nb_b * -dt)) * filtered;
    carried + (f_b - carried) * (1.0 - (-dt / time_constant).exp())
}

/// m = A (m_raw − b): soft and hard iron taken out.
#[inline]
#[must_use]
pub fn calibrated(raw: &Vector3<f64>, soft_iron: &Matrix3<f64>, hard_iron: &Vector3<f64>) -> Vector3<f64> {
    soft_iron * (raw - hard_iron)
}

/// The heading ψ \[rad\] by a field `m_b` (any unit), given roll, pitch and declination \[rad\].
#[inline]
#[must_use]
pub fn compass_heading(m_b: &Vector3<f64>, roll: f64, pitch: f64, declination: f64) -> f64 {
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    let x = m_b.x * cp + m_b.y * sr * sp + m_b.z * cr * sp;
    let y = m_b.y * cr - m_b.z * sr;
    wrap((-y).atan2(x) + declination)
}

/// What a field says against `q`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// The turn about down \[rad\] that brings the field to magnetic north: the heading's error.
    pub turn: f64,
    /// |m|, in the unit of m.
    pub magnitude: f64,
    /// The angle \[rad\] below the horizon.
    pub dip: f64,
}

/// The field `m_b` seen from the attitude `q`. Unlike [`compass_heading`] it knows no gimbal
/// lock; elsewhere `turn` is [`compass_heading`] less the yaw of `q`.
#[inline]
#[must_use]
pub fn field(m_b: &Vector3<f64>, q: &UnitQuaternion<f64>, declination: f64) -> Field {
    let m = q * m_b;
    Field {
        turn: wrap(declination - m.y.atan2(m.x)),
        magnitude: m.norm(),
        dip: m.z.atan2(m.x.hypot(m.y)),
    }
}

/// ∂α/∂ε of the azimuth α of a direction `v_n` (any length) that is turned by ε \[rad\]:
/// [−v_N v_D, −v_E v_D, v_N² + v_E²]/(v_N² + v_E²).
#[inline]
#[must_use]
pub fn heading_slope(v_n: &Vector3<f64>) -> Vector3<f64> {
    let level = v_n.x * v_n.x + v_n.y * v_n.y;
    Vector3::new(-v_n.x * v_n.z / level, -v_n.y * v_n.z / level, 1.0)
}

/// `q` turned by `angle` \[rad\] about down.
#[inline]
#[must_use]
pub fn turned(q: &UnitQuaternion<f64>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = (0.5 * angle).sin_cos();
    UnitQuaternion::new_unchecked(Quaternion::new(cos, 0.0, 0.0, sin)) * q
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::wgs84::EARTH_RATE;
    use fusion_core::testing::Lcg;

    fn random_attitude(random: &mut Lcg) -> UnitQuaternion<f64> {
        so3::from_rpy(3.0 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed())
    }

    fn at_rest(q: &UnitQuaternion<f64>) -> Vector3<f64> {
        q.inverse() * Vector3::new(0.0, 0.0, -9.8)
    }

    #[test]
    fn a_body_at_rest_does_not_turn_against_the_level_frame() {
        let q = so3::from_rpy(0.3, -0.2, 2.0);
        let w_ie = Vector3::new(0.8, 0.0, -0.6) * EARTH_RATE;
        let w = compensated_rate(&(q.inverse() * w_ie), &q, &w_ie);
        assert!(w.norm() < 1e-19); // 4 ε of 7e-5 rad/s
    }

    #[test]
    fn the_gravity_error_vanishes_at_rest_and_its_jacobian_is_its_derivative() {
        let mut random = Lcg::new(1);
        for _ in 0..50 {
            let q = random_attitude(&mut random);
            let f = at_rest(&random_attitude(&mut random));
            assert!(gravity_error(&q, &at_rest(&q)).norm() < 1e-15); // a few ε of 1
            let (j, step) = (gravity_jacobian(&q), 1e-6);
            for k in 0..4 {
                // F is quadratic, so central differences are exact but for rounding; off the
                // sphere the formula holds as it is written.
                let at = |sign: f64| {
                    let mut v = so3::to_scalar_first(&q);
                    v[k] += sign * step;
                    let off = UnitQuaternion::new_unchecked(Quaternion::new(v[0], v[1], v[2], v[3]));
                    gravity_error(&off, &f)
                };
                let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                assert!((slope - j.column(k)).norm() < 1e-9); // ε/step
            }
        }
    }

    #[test]
    fn gradient_step_takes_10_deg_of_tilt_to_9_887_and_ten_steps_to_8_869() {
        let f = Vector3::new(0.0, 0.0, -9.8);
        let tilt = |q: &UnitQuaternion<f64>| (q * Vector3::z()).z.clamp(-1.0, 1.0).acos().to_degrees();
        for start in [
            so3::from_rpy(10_f64.to_radians(), 0.0, 0.0),
            so3::from_rpy(0.0, 10_f64.to_radians(), 1.0),
        ] {
            let mut q = start;
            let yaw = so3::to_rpy(&q).z;
            for k in 1..=200 {
                q = gradient_step(&q, &f, 1e-3).unwrap_or(q);
                match k {
                    // 5e-4: half of the last digit printed.
                    1 => assert!((tilt(&q) - 9.887).abs() < 5e-4, "{}", tilt(&q)),
                    10 => assert!((tilt(&q) - 8.869).abs() < 5e-4, "{}", tilt(&q)),
                    // The limit cycle: 2μ = 0.1146°.
                    87.. => assert!(tilt(&q) <= 0.115, "step {k}: {}", tilt(&q)),
                    _ => {}
                }
            }
            // The vertical does not see the heading; 1e-6: second order in the tilt about a skew axis.
            assert!(wrap(so3::to_rpy(&q).z - yaw).abs() < 1e-6);
        }
    }

    #[test]
    fn a_vertical_that_is_met_or_missing_gives_no_step() {
        let q = so3::from_rpy(0.1, 0.2, 0.3);
        assert_eq!(gradient_step(&q, &Vector3::zeros(), 1e-3), None);
        assert_eq!(
            gradient_step(&UnitQuaternion::identity(), &Vector3::new(0.0, 0.0, -1.0), 1e-3),
            None
        );
        assert!((step_length(1.5, 1e-5, &Vector3::new(0.0, 0.2, 0.0), 0.01) - 1.51e-3).abs() < 1e-17); // rounding
    }

    #[test]
    fn levelling_puts_the_force_straight_up_by_the_shortest_turn() {
        let mut random = Lcg::new(2);
        for _ in 0..50 {
            let (q, f) = (random_attitude(&mut random), at_rest(&random_attitude(&mut random)));
            let level = levelled(&q, &f);
            // 1e-14: a rotation by trigonometric functions.
            assert!((level * f / f.norm() + Vector3::z()).norm() < 1e-14);
            let turn = so3::log(&(q.inverse() * level));
            assert!((turn.norm() - (-(q * f).z / f.norm()).clamp(-1.0, 1.0).acos()).abs() < 1e-7); // acos near 1
        }
    }

    #[test]
    fn the_low_pass_follows_a_turning_body_without_lag() {
        let (w, dt) = (Vector3::new(0.5, -1.0, 0.3), 0.01);
        let mut q = so3::from_rpy(0.1, 0.2, 0.3);
        let mut filtered = at_rest(&q);
        for _ in 0..500 {
            q *= so3::exp(&(w * dt));
            filtered = low_passed(&filtered, &at_rest(&q), &w, dt, 1.5);
        }
        assert!((filtered - at_rest(&q)).norm() < 1e-11); // 500 roundings of 10
        // A step of force is followed to 1 − 1/e after one time constant.
        let mut still = Vector3::zeros();
        for _ in 0..150 {
            still = low_passed(&still, &Vector3::x(), &Vector3::zeros(), dt, 1.5);
        }
        assert!((still.x - (1.0 - (-1.0_f64).exp())).abs() < 1e-14); // rounding of 150 steps
    }

    #[test]
    fn the_tilted_compass_reads_the_true_heading() {
        let mut random = Lcg::new(3);
        let (declination, dip) = (-0.14_f64, 1.1_f64);
        let m_n = Vector3::new(dip.cos() * declination.cos(), dip.cos() * declination.sin(), dip.sin()) * 45e-6;
        let soft = Matrix3::new(1.1, 0.02, 0.0, 0.02, 0.9, -0.01, 0.0, -0.01, 1.0);
        let hard = Vector3::new(3e-6, -8e-6, 1e-6);
        for _ in 0..50 {
            let q = random_attitude(&mut random);
            let rpy = so3::to_rpy(&q);
            let raw = soft.try_inverse().unwrap() * (q.inverse() * m_n) + hard;
            let m = calibrated(&raw, &soft, &hard);
            // 1e-11: near gimbal lock the horizontal part is small.
            assert!(wrap(compass_heading(&m, rpy.x, rpy.y, declination) - rpy.z).abs() < 1e-11);
            let seen = field(&m, &turned(&q, -0.3), declination);
            assert!((seen.turn - 0.3).abs() < 1e-12 && (seen.dip - dip).abs() < 1e-12 && (seen.magnitude - 45e-6).abs() < 1e-18);
        }
    }
}
