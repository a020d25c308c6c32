//! Advice on the next step, which follows from the statistics of a run.
//!
//! ```text
//! design ──▶ instruments: their measurements, and whether a bias can be a state ──────────┐
//! summary ─▶ faults, gates, NIS, NEES, gaps ──────────────────────────────────────────────┴──▶ facts
//!
//! facts ──▶ table of rules, causes first ──▶ findings, the first to look at first
//! ```
//!
//! Each finding names its evidence in figures and the setting to change. Causes come before effects: a sensor that
//! disagrees is reported before the errors against the reference, which follow from it. If several causes are possible,
//! a recorded log is first compared with itself (`fusion check --data`). Errors against the reference outrank
//! innovations: innovations are small, too, if the estimate follows a slow error of a sensor. A constraint has no
//! instrument: its bias is not reported, and neither is a constraint that holds better than declared.
//!
//! Advice names only settings that the block has. If the wrong sensor is not clear, the advice is a run that decides
//! it: a run without the first sensor that disagreed, or without the sensor that has no gate.
//!
//! Source   Bar-Shalom, Li, Kirubarajan 2001, §5.4: the meaning of a mean NEES or NIS outside its band
//! Not here proof of correctness: a run without findings proves nothing if its data do not excite the vehicle enough

mod common;
mod errors;
mod facts;
mod found;
mod input;
mod instrument;
pub(crate) mod level;
mod moved;
mod noise;
mod parameters;
mod sensors;
mod stamps;
mod start;
mod table;
#[cfg(test)]
mod tests;

use self::facts::Facts;
use fusion::design::Design;
use fusion::run::{Finding, Ignored, Summary};
use fusion::score::{Consistency, ConsistencyVerdict};

fusion::inventory::submit! {
    fusion::run::Advisor {
        name: "fusion",
        rules: crate::rules::ALL,
        advise: findings,
    }
}

/// The command that compares a log with itself.
const CHECK: &str = "`fusion check DESIGN --data DIR`";
/// A mean statistic over its degrees of freedom above this is worth a change: errors are then √1.5 = 1.22 times their
/// 1σ.
const LARGE: f64 = 1.5;
/// No noise explains a larger mean: all innovations are √50 = 7 times their 1σ.
const FAR: f64 = 50.0;

/// The findings of a run of `design` by all rules but the `ignored` ones; empty if the run is consistent.
#[must_use]
pub fn findings(design: &Design, summary: &Summary, ignored: &Ignored) -> Vec<Finding> {
    table::apply(&Facts::of(design, summary), ignored)
}

/// Returns true if errors are larger than expected by enough to need a change.
fn is_large(c: &Consistency) -> bool {
    c.verdict() == Some(ConsistencyVerdict::Overconfident) && ratio(c) > LARGE
}

/// The mean over its expected value.
fn ratio(c: &Consistency) -> f64 {
    c.mean / c.dof as f64
}
