//! Height above the ellipsoid, with a slowly varying error: an altimeter, a levelled map.
//!
//! Measured   z = height of the sensor a, up positive \[m\]
//! Predicted  h(x) = h_a + b,  h_a = h_b − e₃ᵀ C_nb l_ba_b
//! Jacobian   ∂h/∂δr = [0 0 −1],  ∂h/∂δφ_b = e₃ᵀ C_nb [l ×],  ∂h/∂l = −e₃ᵀ C_nb,  ∂h/∂b = 1
//! Valid      heights above the ellipsoid; a geoid undulation is part of b
//! Source     Groves 2013, §6.2.1

use super::vertical::Vertical;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Param, Scalar, View};
use nalgebra::Matrix1;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Height {
    point: Vertical,
    bias: Param<Scalar>,
}

impl Measurement for Height {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = self.point.height(at) + at.get(&self.bias);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        self.point.jacobian(at, 1.0, h);
        h.add(0, &self.bias, &Matrix1::new(1.0));
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::{ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, dim};
    use schemars::JsonSchema;

    /// Height above the ellipsoid, up positive, with a correlated error.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct HeightSpec {
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Height bias, up positive; give a barometric height a `correlation_time`.
        #[serde(default)]
        bias: ScalarParam<dim::Length>,
    }

    crate::register!(
        Sensor,
        "height",
        HeightSpec,
        r#"
lever_arm = [0.5, 0, "-20 cm"]
bias = { estimate = true, initial = 0, sigma = "5 m", correlation_time = "600 s" }
"#
    );

    #[typetag::deserialize(name = "height")]
    impl SensorSpec for HeightSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(Channel::vector("height", 1, dim::Length::KIND.dimension))
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Length::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(Height {
                point: Vertical::build(b, &self.lever_arm)?,
                bias: b.param("bias", &self.bias)?,
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
    fn a_sensor_at_the_nose_rises_with_the_pitch() {
        let pitch = 0.1_f64;
        let model = Height {
            point: Vertical::fixed(100.0, from_rpy(0.0, pitch, 1.0), Vector3::new(2.0, 0.0, 0.0)),
            bias: Param::Fixed(0.5),
        };
        let mut z = [0.0];
        model.predict(&View::new(&[], &[]), &mut z).unwrap();
        assert!((z[0] - (100.5 + 2.0 * pitch.sin())).abs() < 1e-13); // an ulp of 100 m
    }
}
