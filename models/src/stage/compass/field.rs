//! Kernels of a magnetic field seen from an attitude.
//!
//! Axes       n north-east-down, b forward-right-down, q = `q_nb`
//! Calibrated m = A (m_raw − b), A soft iron, b hard iron
//! Turn       η = D − atan2(m_E, m_N) of m_n = C_nb m: about down, D the declination
//! Source     Titterton and Weston 2004, §3.6

use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::state::wrap;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// m = A (m_raw − b): removes soft and hard iron.
#[inline]
#[must_use]
pub fn calibrated(raw: &Vector3<f64>, soft_iron: &Matrix3<f64>, hard_iron: &Vector3<f64>) -> Vector3<f64> {
    soft_iron * (raw - hard_iron)
}

/// A field compared with `q`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// The turn about down \[rad\] that brings the field to magnetic north: the heading's error.
    pub turn: f64,
    /// |m|, in the unit of m.
    pub magnitude: f64,
    /// The angle \[rad\] below the horizon.
    pub dip: f64,
}

/// The field `m_b` (any unit) seen from the attitude `q`, `declination` \[rad\]. It is valid at gimbal lock too;
/// elsewhere `turn` is the heading of a tilt-compensated compass minus the yaw of `q`.
#[inline]
#[must_use]
pub fn field(m_b: &Vector3<f64>, q: &UnitQuaternion<f64>, declination: f64) -> Field {
    let m = q * m_b;
    Field {
        turn: wrap(declination - math::atan2(m.y, m.x)),
        magnitude: m.norm(),
        dip: math::atan2(m.z, math::hypot(m.x, m.y)),
    }
}

/// `q` turned by the smallest angle that puts `f_b` (any length) straight up.
#[inline]
#[must_use]
pub fn levelled(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>) -> UnitQuaternion<f64> {
    let up = -q.inverse_transform_vector(&Vector3::z());
    let axis = up.cross(f_b);
    let (sin, cos) = (axis.norm(), up.dot(f_b));
    // Along the axis: Exp(−δφ) up ∥ f_b. Parallel vectors have no axis and need none.
    let turn = if sin > 0.0 {
        axis * (-math::atan2(sin, cos) / sin)
    } else {
        Vector3::zeros()
    };
    q * so3::exp(&turn)
}

/// `q` turned by `angle` \[rad\] about down.
#[inline]
#[must_use]
pub fn turned(q: &UnitQuaternion<f64>, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = math::sin_cos(0.5 * angle);
    UnitQuaternion::new_unchecked(Quaternion::new(cos, 0.0, 0.0, sin)) * q
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::testing::Lcg;

    fn random_attitude(random: &mut Lcg) -> UnitQuaternion<f64> {
        so3::from_rpy(3.0 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed())
    }

    /// The tilt-compensated compass as papers print it: m_x' = m_x cθ + m_y sφ sθ + m_z cφ sθ,
    /// m_y' = m_y cφ − m_z sφ, ψ = atan2(−m_y', m_x') + D.
    fn printed_heading(m_b: &Vector3<f64>, roll: f64, pitch: f64, declination: f64) -> f64 {
        let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
        let x = m_b.x * cp + m_b.y * sr * sp + m_b.z * cr * sp;
        let y = m_b.y * cr - m_b.z * sr;
        wrap((-y).atan2(x) + declination)
    }

    #[test]
    fn levelling_puts_the_force_straight_up_by_the_shortest_turn() {
        let mut random = Lcg::new(2);
        for _ in 0..50 {
            let (q, f) = (
                random_attitude(&mut random),
                random_attitude(&mut random).inverse() * Vector3::new(0.0, 0.0, -9.8),
            );
            let level = levelled(&q, &f);
            // 1e-14: a rotation by trigonometric functions.
            assert!((level * f / f.norm() + Vector3::z()).norm() < 1e-14);
            let turn = so3::log(&(q.inverse() * level));
            assert!((turn.norm() - (-(q * f).z / f.norm()).clamp(-1.0, 1.0).acos()).abs() < 1e-7); // acos near 1
        }
    }

    #[test]
    fn a_tilted_field_gives_the_true_heading_as_the_printed_formula_does() {
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
            assert!(wrap(printed_heading(&m, rpy.x, rpy.y, declination) - rpy.z).abs() < 1e-11);
            let seen = field(&m, &turned(&q, -0.3), declination);
            assert!((seen.turn - 0.3).abs() < 1e-12 && (seen.dip - dip).abs() < 1e-12 && (seen.magnitude - 45e-6).abs() < 1e-18);
        }
    }
}
