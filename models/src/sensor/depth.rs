//! Depth below the water's surface, from a pressure cell already scaled to metres.
//!
//! Measured   z = depth of the sensor a, down positive \[m\]
//! Predicted  h(x) = s − h_a + b,  h_a = h_b − e₃ᵀ C_nb l_ba_b, s height of the surface
//! Jacobian   ∂h/∂δr = \[0 0 1\],  ∂h/∂δφ_b = −e₃ᵀ C_nb [l ×],  ∂h/∂l = e₃ᵀ C_nb,
//!            ∂h/∂s = 1,  ∂h/∂b = 1
//! Valid      s and b can only be separated if another sensor or an initial σ determines one of them
//! Not here   waves (noise, or a Gauss-Markov `surface`), water density

use super::vertical::Vertical;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Param, Scalar, View};
use nalgebra::Matrix1;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Depth {
    point: Vertical,
    surface: Param<Scalar>,
    bias: Param<Scalar>,
}

impl Measurement for Depth {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.get(&self.surface) - self.point.height(at) + at.get(&self.bias);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        self.point.jacobian(at, -1.0, h);
        h.add(0, &self.surface, &Matrix1::new(1.0));
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

    /// Depth below the water's surface, down positive.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct DepthSpec {
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Height of the water's surface above the ellipsoid: geoid and tide.
        #[serde(default)]
        surface: ScalarParam<dim::Length>,
        /// Depth bias, down positive.
        #[serde(default)]
        bias: ScalarParam<dim::Length>,
    }

    crate::register!(
        Sensor,
        "depth",
        DepthSpec,
        r#"
lever_arm = [0, 0, "30 cm"]
surface = { estimate = true, initial = "28 m", sigma = "1 m", random_walk = "5 mm/sqrt(s)" }
bias = { estimate = true, initial = 0, sigma = "10 cm" }
"#
    );

    #[typetag::deserialize(name = "depth")]
    impl SensorSpec for DepthSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(Channel::vector("depth", 1, dim::Length::KIND.dimension))
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Length::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(Depth {
                point: Vertical::build(b, &self.lever_arm)?,
                surface: b.param("surface", &self.surface)?,
                bias: b.param("bias", &self.bias)?,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn a_sensor_under_the_keel_is_deeper_than_the_body() {
        let model = Depth {
            point: Vertical::fixed(5.0, UnitQuaternion::identity(), Vector3::new(3.0, 0.0, 0.5)),
            surface: Param::Fixed(28.0),
            bias: Param::Fixed(-0.1),
        };
        let mut z = [0.0];
        model.predict(&View::new(&[], &[]), &mut z).unwrap();
        assert!((z[0] - 23.4).abs() < 1e-14); // rounding
    }
}
