//! A simulated world as a feed of rows: the simulator, its sensors' rows through their declared
//! faults, and the truth as the reference.

mod simulated;
#[cfg(test)]
mod tests;

pub use fusion_models::sim::{IMU, REFERENCE};
pub use simulated::SimulatedRows;
