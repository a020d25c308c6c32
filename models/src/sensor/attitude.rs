//! A measured attitude: an attitude reference, a star tracker, a motion-capture system.
//!
//! Measured   z = q_ns, body to navigation, of the sensor's axes s
//! Predicted  h(x) = q_nb ⊗ q_bs, q_bs the mounting: x_b = C_bs x_s
//! Residual   r = Log(h⁻¹ z) \[rad\], about the sensor's axes
//! Jacobian   ∂r/∂δφ_b = C_bsᵀ,  ∂r/∂δμ = I₃ for the mounting C_bs Exp(δμ); exact at r = 0, beyond
//!            it to first order in r
//! Valid      errors of the source that are white; a filter's output is not: its sigma must hold
//!            the correlated part, and a second use of the same gyros
//! Source     Sola, Deray, Atchuthan 2018 (arXiv 1812.01537), eqs. 66-71

use super::XYZ;
use crate::block::{Build, BuildError, Reading, SensorSpec};
use crate::param::RotationParam;
use crate::units::{Dimension, Dimensional, dim};
use crate::vocabulary::{channel, state};
use fusion_core::geometry::so3;
use fusion_core::linear::Jacobian;
use fusion_core::model::{Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Manifold, Param, Quantity, View};
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector4};
use schemars::JsonSchema;
use serde::Deserialize;

/// Attitude as a quaternion, from an attitude reference or a motion-capture system.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AttitudeSpec {
    /// Roll, pitch, yaw of the sensor's axes in the body: x_body = C(mounting) x_sensor.
    #[serde(default)]
    mounting: RotationParam,
}

crate::register!(
    Sensor,
    "attitude",
    AttitudeSpec,
    r#"
mounting = { estimate = true, initial = [0, "1 deg", "30 deg"], sigma = "2 deg" }
"#
);

#[typetag::deserialize(name = "attitude")]
impl SensorSpec for AttitudeSpec {
    fn reading(&self) -> Reading {
        Reading::Channel(channel::ATTITUDE)
    }

    fn noise(&self) -> Vec<Dimension> {
        vec![dim::Angle::KIND.dimension; 3]
    }

    fn axes(&self) -> &'static [&'static str] {
        XYZ
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        Ok(Box::new(MeasuredAttitude {
            attitude: b.quantity(state::ATTITUDE)?,
            mounting: b.param("mounting", &self.mounting)?,
        }))
    }
}

/// The unit quaternion of four numbers, of any length.
fn unit(z: &[f64]) -> UnitQuaternion<f64> {
    so3::from_scalar_first(&Vector4::new(z[0], z[1], z[2], z[3]))
}

/// The runtime model.
#[derive(Debug)]
struct MeasuredAttitude {
    attitude: Quantity<Attitude>,
    mounting: Param<Attitude>,
}

impl Measurement for MeasuredAttitude {
    fn size(&self) -> Size {
        Size { value: 4, residual: 3 }
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        Attitude::write(&(at.get(&self.attitude) * at.get(&self.mounting)), value);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.attitude, &so3::rotation(&at.get(&self.mounting)).transpose());
        h.add(0, &self.mounting, &Matrix3::identity());
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        r[..3].copy_from_slice(so3::log(&(unit(predicted).inverse() * unit(z))).as_slice());
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        Attitude::write(&(unit(z) * so3::exp(&Vector3::new(e[0], e[1], e[2]))), z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;

    #[test]
    fn the_residual_is_the_turn_of_the_body_whatever_the_sign_of_the_quaternion() {
        let q = from_rpy(0.2, -0.4, 2.8);
        let model = MeasuredAttitude {
            attitude: Quantity::Fixed(q),
            mounting: Param::Fixed(from_rpy(0.0, 0.0, 1.0)),
        };
        let (mut h, mut z, mut r) = ([0.0; 4], [0.0; 4], [0.0; 3]);
        model.predict(&View::new(&[], &[]), &mut h).unwrap();
        let turn = Vector3::new(0.1, -0.3, 0.2);
        Attitude::write(&(q * so3::exp(&turn) * from_rpy(0.0, 0.0, 1.0)), &mut z);
        for sign in [1.0, -1.0] {
            model.residual(&z.map(|v| sign * v), &h, &mut r);
            // Seen from the sensor, whose axes are a yaw of 1 rad away; 1e-15: rounding.
            let seen = from_rpy(0.0, 0.0, 1.0).inverse() * turn;
            assert!((Vector3::from(r) - seen).norm() < 1e-15, "{r:?}");
        }
    }
}
