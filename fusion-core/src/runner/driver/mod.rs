//! The runner itself: it passes values between a queue, an input and a scheduler.
//!
//! ```text
//!         rows ──▶ queue ── row, time, consumer ──┬──▶ input ── sample, gap ──┐
//!                    ▲                            │                           ▼
//!                    │                            └────────────────────▶ scheduler ──▶ estimator, events
//!                    └────────────── rows that stages emit ───────────────────┘
//! ```

mod carrying;
mod feeding;
mod memory;
mod rewind;
mod runner;

pub use rewind::{RewindNeeds, Rewinds};
pub use runner::Runner;
