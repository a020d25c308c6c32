//! A direction that wanders, and a camera that measures it: a process and a sensor over the manifold of this crate.

use crate::direction::{Direction, basis};
use fusion::core::linear::{Jacobian, Transition};
use fusion::core::model::{Input, Measurement, Process, SignalsOut, Size, Undefined};
use fusion::core::state::{Dynamics, Quantity, QuantityName, View};
use fusion::models::{block::*, units::*};
use nalgebra::Vector3;

/// The state.
const DIRECTION: QuantityName<'_, Direction> = QuantityName::new("direction");

/// A direction that wanders by itself.
#[derive(Debug, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WanderingDirectionSpec {
    /// Where it points at first; it need not be of length one.
    initial: [f64; 3],
    /// Its initial 1σ.
    sigma: Angle,
    /// The random walk of each axis \[rad/√s\].
    walk: f64,
}
fusion::models::register! { Process, "wandering_direction", WanderingDirectionSpec, "initial = [1, 2, 3]\nsigma = \"10 deg\"\nwalk = 0.01" }

#[typetag::deserialize(name = "wandering_direction")]
impl ProcessSpec for WanderingDirectionSpec {
    fn input(&self) -> Vec<Channel> {
        Vec::new()
    }
    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
        let initial = Vector3::from(self.initial);
        if !(initial.norm() > 0.0 && initial.norm().is_finite()) {
            return Err(BuildError::at("initial", "a direction is a vector that is not zero"));
        }
        let walk = Dynamics::RandomWalk {
            psd: vec![self.walk * self.walk; 2],
        };
        b.declare(DIRECTION, "rad", initial.normalize(), vec![self.sigma.si(); 2], walk)?;
        Ok(Box::new(Wandering))
    }
}

/// The random walk is the block's own.
#[derive(Debug)]
struct Wandering;

impl Process for Wandering {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    fn signals(&self, _: &[f64], _: &Input<'_>, _: &mut SignalsOut<'_>) {}
}

/// A camera: z = u, ∂h/∂δ = B(u).
#[derive(Debug, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {}
fusion::models::register! { Sensor, "camera", CameraSpec, "" }

#[typetag::deserialize(name = "camera")]
impl SensorSpec for CameraSpec {
    fn reading(&self) -> Reading {
        Reading::Channel(Channel::vector("line_of_sight", 3, Dimension::NONE))
    }
    fn noise(&self) -> Vec<Dimension> {
        vec![Dimension::NONE; 3]
    }
    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        Ok(Box::new(Camera(b.quantity(DIRECTION)?)))
    }
}

/// The state that is read.
#[derive(Debug)]
struct Camera(Quantity<Direction>);

impl Measurement for Camera {
    fn size(&self) -> Size {
        Size::same(3)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value.copy_from_slice(at.get(&self.0).as_slice());
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.0, &basis(&at.get(&self.0)));
        Ok(())
    }
    fn reads_signals(&self) -> bool {
        false
    }
}
