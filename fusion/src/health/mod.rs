//! The health of a run: the health states of its filters over time, with named reasons.
//!
//! The runner judges the health, in [`fusion_core::health`]; `[health]` in the design declares the limits.
//! This module gives the reasons the names of the design, and keeps the changes of a run.

mod reason;
mod record;

pub use fusion_core::health::{Health, State};
pub use reason::{NamedReason, Names};
pub use reason::{from_word, word};
pub(crate) use record::HealthRecord;
pub use record::{FilterHealth, Spell, Spent, Transition};
