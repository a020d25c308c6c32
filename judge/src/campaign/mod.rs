//! Many runs: Monte Carlo over seeds, also of several designs and in [parts](crate::part).
//!
//! ```text
//! designs ──▶ run: blocks of runs in parallel ──▶ Writer: a row per number ──▶ file
//!                                                                               │
//!             runs.csv ◀── Table ◀── rows, one by one, in order ◀── Parts ◀─────┘
//!             pages ◀── Campaign: statistics ◀──┘
//! ```

mod figures;
mod history;
mod row;
mod run;
mod runs;
mod statistics;
#[cfg(test)]
mod tests;
mod worst;

pub use figures::{CONTROL, Ends, Figure, OutageTally, RunSpread, SensorTally, Statistic};
pub use history::{FANS, History, Together, together};
pub use row::{FailedRun, Outcome, RunHealth, RunRow};
pub use run::{Runner, Runs, monte_carlo, read, seed_of};
pub use runs::{Table, write};
pub use statistics::{Campaign, Compared, Duel, Independence, Pace, Pooled, Undeclared};
