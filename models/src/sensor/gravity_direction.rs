//! The accelerometers as a level: specific force of a body that does not accelerate.
//!
//! Measured   z = f_ib_b \[m/s²\]
//! Predicted  h(x) = −g C_nbᵀ e₃ + b
//! Jacobian   ∂h/∂δφ_b = −g [C_nbᵀ e₃ ×],  ∂h/∂b = I₃
//! Valid      at rest or in steady motion; where the body accelerates, the sigma holds the
//!            acceleration, or the stream is a force averaged in axes that do not turn (the stage
//!            `steady_force`)
//! Not here   heading, which no vertical tells
//! Source     the derivative of C_nbᵀ e₃ with C_nb ← C_nb Exp(δφ_b)

use fusion_core::geometry::so3::skew;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Vector, View};
use nalgebra::{Matrix3, Vector3};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct GravityDirection {
    attitude: Quantity<Attitude>,
    bias: Param<Vector<3>>,
    gravity: f64,
}

impl GravityDirection {
    /// g C_nbᵀ e₃.
    fn gravity_b(&self, at: &View<'_>) -> Vector3<f64> {
        at.get(&self.attitude)
            .inverse_transform_vector(&Vector3::new(0.0, 0.0, self.gravity))
    }
}

impl Measurement for GravityDirection {
    fn size(&self) -> Size {
        Size::same(3)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[..3].copy_from_slice((at.get(&self.bias) - self.gravity_b(at)).as_slice());
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.attitude, &-skew(&self.gravity_b(at)));
        h.add(0, &self.bias, &Matrix3::identity());
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
    use crate::earth::LocalEarth;
    use crate::param::VectorParam;
    use crate::units::{Dimension, Dimensional, Positive, STANDARD_GRAVITY, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Direction of gravity from the accelerometers, for a body that does not accelerate.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct GravityDirectionSpec {
        /// Bias of the accelerometers.
        #[serde(default)]
        bias: VectorParam<dim::Acceleration>,
        /// g; by default that of the origin, or standard gravity.
        gravity: Option<Positive<dim::Acceleration>>,
    }

    crate::register!(
        Sensor,
        "gravity_direction",
        GravityDirectionSpec,
        r#"
bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg" }
gravity = "9.81 m/s^2"
"#
    );

    #[typetag::deserialize(name = "gravity_direction")]
    impl SensorSpec for GravityDirectionSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::SPECIFIC_FORCE)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Acceleration::KIND.dimension; 3]
        }

        fn axes(&self) -> &'static [&'static str] {
            XYZ
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let at_origin = b.origin.map_or(STANDARD_GRAVITY, |o| LocalEarth::at(&o).gravity(b.gravity));
            Ok(Box::new(GravityDirection {
                attitude: b.quantity(state::ATTITUDE)?,
                bias: b.param("bias", &self.bias)?,
                gravity: self.gravity.map_or(at_origin, |g| g.si()),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;

    #[test]
    fn a_nose_raised_by_thirty_degrees_feels_half_of_g_ahead() {
        let attitude = Quantity::Fixed(from_rpy(0.0, 30_f64.to_radians(), 2.0));
        let model = GravityDirection {
            attitude,
            bias: Param::Fixed(Vector3::new(0.0, 0.1, 0.0)),
            gravity: 10.0,
        };
        let mut z = [0.0; 3];
        model.predict(&View::new(&[], &[]), &mut z).unwrap();
        // 4 ε of 10.
        assert!((Vector3::from(z) - Vector3::new(5.0, 0.1, -75_f64.sqrt())).amax() < 1e-14, "{z:?}");
    }
}
