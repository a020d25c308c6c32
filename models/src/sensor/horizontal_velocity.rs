//! A velocity without its vertical part: speed and course over ground, as many receivers give them.
//!
//! Measured   z = velocity of the antenna north and east \[m/s\]
//! Predicted  the first two rows of `gnss_velocity`
//! Jacobian   likewise
//! Not here   the vertical velocity, of which nothing is said
//! Source     Groves 2013, §14.3.1

#![cfg(feature = "declare")]

use super::gnss_velocity::GnssVelocity;
use crate::block::{Build, BuildError, NED, Reading, SensorSpec};
use crate::de::DeserializeSpec;
use crate::param::VectorParam;
use crate::units::{Dimension, Dimensional, dim};
use crate::vocabulary::channel;
use fusion_core::model::{Measurement, Size};
use schemars::JsonSchema;

/// Velocity north and east of a receiver that says nothing of the vertical.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HorizontalVelocitySpec {
    /// Antenna position in body axes, from the body origin (the IMU).
    #[serde(default)]
    lever_arm: VectorParam<dim::Length>,
}

crate::register!(
    Sensor,
    "horizontal_velocity",
    HorizontalVelocitySpec,
    r#"
lever_arm = [0.1, -0.2, "-1 m"]
"#
);

#[typetag::deserialize(name = "horizontal_velocity")]
impl SensorSpec for HorizontalVelocitySpec {
    fn reading(&self) -> Reading {
        Reading::Channel(channel::HORIZONTAL_VELOCITY)
    }

    fn noise(&self) -> Vec<Dimension> {
        vec![dim::Speed::KIND.dimension; 2]
    }

    fn axes(&self) -> &'static [&'static str] {
        &NED[..2]
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        let size = Size { value: 2, residual: 2 };
        Ok(Box::new(GnssVelocity::new(b, &self.lever_arm, size)?))
    }
}
