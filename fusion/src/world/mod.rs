//! A simulated world as a feed of rows: the simulator, its sensors' rows through their declared
//! faults, and the truth as the reference.

mod pilot;
mod record;
mod simulated;
#[cfg(test)]
mod tests;

pub use fusion_models::sim::REFERENCE;
pub use record::{LOG_DESIGN, LoggedStream, record};
pub use simulated::SimulatedRows;
pub(crate) use simulated::drawn_start;
