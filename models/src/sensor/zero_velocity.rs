//! Zero velocity: the vehicle stands still, as whatever times this measurement has found.
//!
//! Measured   z = 0, three rows \[m/s\]
//! Predicted  h(x) = v_eb_n
//! Jacobian   ∂h/∂δv = I₃
//! Valid      at the body origin, at rest; feed it by a detector of rest
//! Source     Groves 2013, §15.3

use super::NED;
use crate::block::{Build, BuildError, Reading, SensorSpec};
use crate::units::{Dimension, Dimensional, dim};
use crate::vocabulary::state;
use fusion_core::linear::Jacobian;
use fusion_core::model::{Measurement, Size, Undefined};
use fusion_core::state::{Quantity, Velocity, View};
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::Deserialize;

/// Pseudo-measurement at rest: the velocity is zero.
#[derive(Debug, Deserialize, JsonSchema)]
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
        NED
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        Ok(Box::new(ZeroVelocity {
            velocity: b.quantity(state::VELOCITY)?,
        }))
    }
}

/// The runtime model.
#[derive(Debug)]
struct ZeroVelocity {
    velocity: Quantity<Velocity>,
}

impl Measurement for ZeroVelocity {
    fn size(&self) -> Size {
        Size::same(3)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value.copy_from_slice(at.get(&self.velocity).as_slice());
        Ok(())
    }

    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.velocity, &Matrix3::identity());
        Ok(())
    }
}
