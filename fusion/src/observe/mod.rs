//! Observing a run: a list of independent observers.
//!
//! ```text
//!             ┌─▶ EstimateFile, UpdateFile
//! runner ─▶ Hub ─▶ Statistics, FilterScore, Counters    each makes its own section of the summary
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
mod failures;
mod files;
mod filters;
mod finals;
mod hub;
mod maker;
mod moved;
mod page;
mod score;
mod section;
mod smoothing;
mod starts;
mod statistics;
mod summary;
mod timing;
mod wait;

pub use bank::{Change, Hypotheses};
pub use consumers::ConsumerCounts;
pub(crate) use consumers::Consumers;
pub(crate) use counters::Counters;
pub use counters::{Counts, UnusedRows};
pub use event::{RunEvent, RunObserver};
pub use failures::Failures;
pub use files::Thinning;
pub(crate) use files::{EstimateFile, UpdateFile};
pub use filters::{Filters, Heard, HeardSensor};
pub use finals::FinalState;
pub(crate) use finals::Finals;
pub use hub::Hub;
pub use maker::{RunEnd, RunStart, SectionMaker, SectionObserver, Shared};
pub(crate) use maker::{at_end, linked, made_or};
pub(crate) use moved::Excesses;
pub use moved::{Excess, Moved};
pub use score::InsideScore;
pub(crate) use score::{FilterScore, InsideScores};
pub use section::{Figure, RunSection, SectionColumn};
pub use smoothing::Smoothed;
pub(crate) use smoothing::{By, Smoother};
pub use starts::Start;
pub(crate) use starts::Starts;
pub(crate) use statistics::Statistics;
pub use statistics::{Disturbed, Innovations, RejectionStreak, SensorStatistics};
pub use summary::{Entry, Keyed, Listed, Section, Summary};
pub(crate) use timing::Timing;
pub use wait::Wait;
