//! From a design to a runner: the layout is laid out, streams are connected, numbers are resolved.
//!
//! ```text
//! Design ── declared_streams ──▶ StreamLayouts ─┐
//!        └───────────────────────────── assemble ┴──▶ Assembly: runner, layout, models, streams
//! ```

mod assemble;
mod nested;
mod plan;
mod ports;
mod sensors;
mod simulated;
mod streams;

pub(crate) use assemble::check;
pub use assemble::{Assembly, assemble, plan};
pub use nested::Inside;
pub use plan::Plan;
pub use sensors::SensorInfo;
pub use simulated::stream_of;
pub use streams::{StreamChannel, StreamLayout, declared_streams};
