//! Zero velocity: the vehicle is at rest, at the times that a detector gives.
//!
//! Measured   z = 0, three rows \[m/s\]
//! Predicted  h(x) = C_nbᵀ v_eb_n, in body axes; v_eb_n if the process has no attitude
//! Jacobian   ∂h/∂δv = C_nbᵀ, ∂h/∂δφ_b = [h ×]; I₃ without an attitude
//! Heading    rest gives no information on it. In body axes, the linearised filter also has this property if its chart
//!            is `right_invariant` and Φ is `exact`. Turning heading, velocity and path together then changes neither
//!            h nor its Jacobian. In other charts, noise of the estimate makes an unobserved heading seem observed
//! Valid      at the body origin, at rest; needs a detector of rest
//! Source     Groves 2013, §15.3; body axes: Hartley et al. 2020, §III (contacts of a foot)

use fusion_core::geometry::so3::{rotation, skew};
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Quantity, Velocity, View};
use nalgebra::Matrix3;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct ZeroVelocity {
    velocity: Quantity<Velocity>,
    attitude: Option<Quantity<Attitude>>,
}

impl Measurement for ZeroVelocity {
    fn size(&self) -> Size {
        Size::same(3)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let v_n = at.get(&self.velocity);
        let v = match &self.attitude {
            Some(attitude) => at.get(attitude).inverse_transform_vector(&v_n),
            None => v_n,
        };
        value.copy_from_slice(v.as_slice());
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let Some(attitude) = &self.attitude else {
            h.add(0, &self.velocity, &Matrix3::identity());
            return Ok(());
        };
        let c_bn = rotation(&at.get(attitude)).transpose();
        h.add(0, &self.velocity, &c_bn);
        h.add(0, attitude, &skew(&(c_bn * at.get(&self.velocity))));
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec, XYZ};
    use crate::de::DeserializeSpec;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::state;
    use schemars::JsonSchema;

    /// Pseudo-measurement at rest: the velocity is zero.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ZeroVelocitySpec {}

    crate::register!(Sensor, "zero_velocity", ZeroVelocitySpec, "");

    #[typetag::deserialize(name = "zero_velocity")]
    impl SensorSpec for ZeroVelocitySpec {
        fn reading(&self) -> Reading {
            Reading::Constant(vec![0.0; 3])
        }

        fn timing(&self) -> Option<&'static str> {
            Some("stationarity")
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; 3]
        }

        fn axes(&self) -> &'static [&'static str] {
            XYZ
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(ZeroVelocity {
                velocity: b.quantity(state::VELOCITY)?,
                attitude: b.quantity(state::ATTITUDE).ok(),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;
    use nalgebra::Vector3;

    #[test]
    fn a_turn_of_heading_and_velocity_together_is_not_seen() {
        let (v, q) = (Vector3::new(0.3, -0.2, 0.1), from_rpy(0.2, -0.4, 1.1));
        let model = |turn: f64| {
            let about_down = from_rpy(0.0, 0.0, turn);
            ZeroVelocity {
                velocity: Quantity::Fixed(about_down * v),
                attitude: Some(Quantity::Fixed(about_down * q)),
            }
        };
        let predict = |turn: f64| {
            let mut z = [0.0; 3];
            model(turn).predict(&View::new(&[], &[]), &mut z).unwrap();
            Vector3::from(z)
        };
        // Rounding.
        assert!((predict(2.0) - predict(0.0)).amax() < 1e-15);
        assert!(predict(0.0).norm() > 0.3);
    }
}
