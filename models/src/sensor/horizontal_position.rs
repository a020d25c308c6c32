//! A fix without a height: latitude and longitude, as logs of many receivers have them.
//!
//! Measured   z = latitude and longitude \[rad\] of the antenna a
//! Predicted  those of r_eb ⊕ (C_nb l_ba_b + b), ⊕ in metres NED at r_eb, as `gnss_position`
//! Jacobian   as `gnss_position`, times M/(M + h) north and N/(N + h) east: metres of the residual are those on the
//!            ellipsoid
//! Not here   the height, which something else has to know: `depth`, `barometer`, `height`
//! Source     Groves 2013, §14.3.1

#![cfg(feature = "declare")]

use super::gnss_position::Fix;
use crate::block::{Build, BuildError, Channel, NED, Reading, SensorSpec};
use crate::de::DeserializeSpec;
use crate::param::VectorParam;
use crate::units::{Dimension, Dimensional, dim};
use crate::vocabulary::channel;
use fusion_core::model::Measurement;
use schemars::JsonSchema;

/// Latitude and longitude of a receiver that says nothing of the height.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HorizontalPositionSpec {
    /// Antenna position in body axes, from the body origin (the IMU).
    #[serde(default)]
    lever_arm: VectorParam<dim::Length>,
    /// Correlated position error, north east down, of which down does not count; give it a `correlation_time`.
    #[serde(default)]
    bias: VectorParam<dim::Length>,
}

crate::register!(
    Sensor,
    "horizontal_position",
    HorizontalPositionSpec,
    r#"
lever_arm = [0.1, -0.2, "-1 m"]
bias = { estimate = true, initial = [0, 0, 0], sigma = ["1 m", "1 m", 0], correlation_time = "100 s" }
"#
);

#[typetag::deserialize(name = "horizontal_position")]
impl SensorSpec for HorizontalPositionSpec {
    fn reading(&self) -> Reading {
        Reading::Channel(channel::HORIZONTAL_POSITION)
    }

    fn noise(&self) -> Vec<Dimension> {
        vec![dim::Length::KIND.dimension; 2]
    }

    fn axes(&self) -> &'static [&'static str] {
        &NED[..2]
    }

    fn reported_sigma(&self) -> Option<Channel> {
        Some(Channel::vector("horizontal_position_sigma", 2, dim::Length::KIND.dimension))
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        Ok(Box::new(Fix::without_height(b, &self.lever_arm, &self.bias)?))
    }
}
