//! A gyro as a measurement, for processes that estimate their rate of turn.
//!
//! Measured   z = rate of turn, clockwise seen from above \[rad/s\]
//! Predicted  h(x) = r + b
//! Jacobian   ∂h/∂r = 1,  ∂h/∂b = 1
//! Valid      planar motion: the gyro's axis points down; the Earth's rotation is part of b

use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Param, Quantity, Scalar, View};
use nalgebra::Matrix1;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct YawRate {
    rate: Quantity<Scalar>,
    bias: Param<Scalar>,
}

impl Measurement for YawRate {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.get(&self.rate) + at.get(&self.bias);
        Ok(())
    }

    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.rate, &Matrix1::new(1.0));
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
    use crate::block::{Build, BuildError, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::ScalarParam;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Rate of turn, clockwise seen from above.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct YawRateSpec {
        /// Bias of the gyro.
        #[serde(default)]
        bias: ScalarParam<dim::AngularRate>,
    }

    crate::register!(
        Sensor,
        "yaw_rate",
        YawRateSpec,
        r#"
bias = { estimate = true, initial = 0, sigma = "1 deg/s", random_walk = "0.01 deg/s/sqrt(s)" }
"#
    );

    #[typetag::deserialize(name = "yaw_rate")]
    impl SensorSpec for YawRateSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::YAW_RATE)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::AngularRate::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(YawRate {
                rate: b.quantity(state::YAW_RATE)?,
                bias: b.param("bias", &self.bias)?,
            }))
        }
    }
}
