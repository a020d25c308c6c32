//! The types that the tables of blocks are read into: each block with its name, its place and its siblings.

use super::truth::Truth;
use super::{InputSpec, NoiseSpec, OnlyWithSpec, SwitchSpec};
use crate::config::Node;
use crate::source::SourceSpec;
use fusion_models::block::{GateSpec, LossSpec, ProcessSpec, SensorSpec};
use fusion_models::fault::FaultSpec;
use fusion_models::param::ScalarParam;
use fusion_models::sim::SimulationSpec;
use fusion_models::units::dim;
use schemars::JsonSchema;
use serde::Deserialize;

/// The fields of every sensor, in addition to those of its model.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorCommon {
    /// The source or stage that it reads or that times it.
    pub source: String,
    /// Its noise.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// A channel of its source with one number that says how good a row is, HDOP for one: for gates
    /// that judge by it.
    pub quality: Option<String>,
    /// How late its rows are stamped: valid at stamp − offset; at most 1 h, of either sign.
    #[serde(default)]
    pub time_offset: ScalarParam<dim::Duration>,
    /// The sensor that it goes with.
    pub only_with: Option<OnlyWithSpec>,
    /// The rows that switch it while the filter runs.
    pub switch: Option<SwitchSpec>,
    /// False leaves the sensor out.
    pub enabled: Option<bool>,
}

/// A block with its name and the place of its declaration.
#[derive(Debug)]
pub struct Named<T> {
    /// The name in the file.
    pub name: String,
    /// Its table, for messages.
    pub node: Node,
    /// The block itself.
    pub block: T,
}

/// A sensor with its siblings.
#[derive(Debug)]
pub struct SensorDesign {
    /// The measurement model.
    pub model: Box<dyn SensorSpec>,
    /// Source and noise.
    pub common: SensorCommon,
    /// The gate; without a gate, every measurement is accepted.
    pub gate: Option<Box<dyn GateSpec>>,
    /// The loss; without a loss, least squares.
    pub loss: Option<Box<dyn LossSpec>>,
}

/// A fault with its name.
pub type Fault = (String, Box<dyn FaultSpec>);

/// A source with its faults.
#[derive(Debug)]
pub struct SourceDesign {
    /// The source.
    pub source: Box<dyn SourceSpec>,
    /// The faults of its rows, in order.
    pub faults: Vec<Fault>,
}

/// A simulated world with the faults of its streams.
#[derive(Debug)]
pub struct SimulationDesign {
    /// The world and the errors of its sensors.
    pub world: SimulationSpec,
    /// By stream, `imu` or a sensor: the faults of its rows, in order.
    pub faults: Vec<(String, Vec<Fault>)>,
    /// The true values that differ from those of the filter.
    pub truth: Option<Truth>,
}

/// The process with its source.
#[derive(Debug)]
pub struct ProcessDesign {
    /// The process model.
    pub model: Box<dyn ProcessSpec>,
    /// The source of its input.
    pub source: Option<String>,
    /// The limits of its input.
    pub input: InputSpec,
}
