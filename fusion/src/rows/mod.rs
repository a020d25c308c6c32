//! Rows on their way to the filter, wherever they come from.
//!
//! ```text
//! a recorded source ──▶ Faulted ──▶ Merged ──▶ rows of all sources by time
//!      RowStream        RowStream
//! a simulated world  ── the same faults ─────▶ rows of all sensors by time
//! ```
//!
//! A stream holds one row, not the file. It counts the rows that it leaves out, with the reason and the
//! first examples; no row is lost silently.

mod carried;
mod error;
mod fault;
mod feed;
mod kept;
mod merge;
mod report;
mod stream;

pub(crate) use carried::{Again, Carried};
pub use error::{DataError, LINE, SourceError};
pub(crate) use fault::Faulted;
pub(crate) use fault::{FaultChain, outages};
pub use feed::{Aboard, Feed, Nobody, Pose, SourceStatistics};
pub use fusion_core::runner::Row;
pub use fusion_models::fault::ProvidedChannel;
pub use kept::KeptRows;
pub use merge::{Failed, Merged};
pub(crate) use report::{DAMAGED, RowCounts};
pub use report::{Example, Skipped, SourceReport};
pub use stream::{RowStream, Stamp, provided, width};
