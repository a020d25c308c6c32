//! A design: the declaration of a filter, read and checked but not yet built.
//!
//! ```toml
//! [run]                 # origin, time span, output
//! [filter]              # backend
//! [health]              # what the health of the filter is judged by
//! [process]             # the process model and its source
//! [sensor.NAME]         # measurement models with source, noise, gate, loss
//! [stage.NAME]          # streams into streams; `type = "filter"`: a design of its own
//! [initial.NAME]        # how the filter starts
//! [source.NAME]         # recorded data, with faults
//! [simulation]          # or a simulated world
//! [reference]           # what the run is scored against
//! [link.NAME]           # connections to instruments and programs, for `fusion live`
//! [output.NAME]         # what leaves by them
//! [stress]              # what `fusion stress` does to it
//! [variant.NAME]        # overrides by path
//! ```

mod blocks;
mod choice;
mod explain;
mod filter;
mod further;
mod health;
mod input;
mod leaders;
mod left_out;
mod links;
mod names;
mod nested;
mod noise;
mod read;
mod reference;
mod run;
pub mod schema;
mod switch;
pub(crate) mod truth;

pub use blocks::{Fault, Named, ProcessDesign, SensorCommon, SensorDesign, SimulationDesign, SourceDesign};
pub use choice::{BackendPart, ChartSpec, Choice, FormSpec, UpdateSpec};
pub(crate) use explain::explain;
pub use filter::{BiasesSpec, FilterSpec, PresetSpec, ResetSpec, SpreadSpec};
pub use further::FurtherTable;
pub use health::{FloorSpec, HealthSpec, InnovationsSpec, RejectedSpec, SilentSpec};
pub use input::InputSpec;
pub use leaders::OnlyWithSpec;
pub use links::{LinkClock, LinkCommon, OutputCommon};
pub(crate) use nested::TABLES as FILTER_TABLES;
pub use noise::NoiseSpec;
pub use read::Design;
pub(crate) use read::Draft;
pub use reference::{
    ConvergedSpec, DifferentiateSpec, ReferenceChannel, ReferencePart, ReferenceSources, ReferenceSpec, SigmaOf, SigmaSpec, TrajectorySpec,
    differences, of_a_sensor,
};
pub use run::{MapDetailSpec, OrderSpec, RewindSpec, RunSpec, SmoothSpec};
pub use switch::SwitchSpec;
pub use truth::Truth;
pub use truth::parameters;
