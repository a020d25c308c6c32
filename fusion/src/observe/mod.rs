//! Observing a run: a list of independent observers.
//!
//! ```text
//!             ┌─▶ EstimateFile, UpdateFile
//! runner ─▶ Hub ─▶ Statistics, FilterScore, Counters    each makes its own part of the summary
//!             ├─▶ Smoother ─▶ Hub ─▶ EstimateFile, FilterScore    the same of smoothed estimates
//!             └─▶ what the caller adds
//! ```
//!
//! The runner reports [`Event`](fusion_core::runner::Event)s. The [`Hub`] finds the filter of an event and passes a
//! [`RunEvent`] to every observer. The solution of an estimate is computed once, if an observer uses it. Its error is
//! computed once, if there is a reference. The first observer that cannot continue stops the run.

mod bank;
mod consumers;
mod counters;
mod event;
mod files;
mod filters;
mod finals;
mod hub;
mod moved;
mod page;
mod score;
mod smoothing;
mod statistics;
mod timing;
mod wait;

pub use bank::{Change, Hypotheses};
pub use consumers::{ConsumerCounts, Consumers};
pub use counters::Counters;
pub use event::{RunEvent, RunObserver};
pub use files::{EstimateFile, Thinning, UpdateFile};
pub use filters::{Filters, Heard, HeardSensor};
pub use finals::{FinalState, Finals};
pub use hub::Hub;
pub use moved::{Excess, Excesses, Moved};
pub use score::FilterScore;
pub use smoothing::{By, Smoother};
pub use statistics::{Disturbed, Innovations, RejectionStreak, SensorStatistics, Statistics};
pub use timing::Timing;
pub use wait::Wait;
