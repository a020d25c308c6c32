//! The health of a run: what its filters said of themselves, with names, over time.
//!
//! The judgement is made in [`fusion_core::health`], by the runner itself; `[health]` in the design
//! declares the limits. Here its reasons get the names of the design, and a run keeps the changes.

mod reason;
mod record;

pub use fusion_core::health::{Health, State};
pub use reason::word;
pub use reason::{NamedReason, Names};
pub use record::{FilterHealth, HealthRecord, Spell, Spent, Transition};
