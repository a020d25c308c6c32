//! Messages of ROS 1 and ROS 2: their definitions as text, and their two encodings.
//!
//! ```text
//! text ── Definitions ──┐              ┌── selected columns
//!                       ├──▶ Plan ──▶ Program ── reads each message ──▶ cells
//! first message ────────┘
//! ```

mod cursor;
mod definition;
#[cfg(feature = "mcap")]
pub mod messages;
mod plan;
mod program;
mod schema;
#[cfg(test)]
mod tests;
mod usual;

pub(crate) use cursor::Encoding;
pub(crate) use definition::{Definitions, short_name};
use plan::{Elements, Plan};
pub(crate) use schema::schema;
pub use usual::{completed, definition, known_types};
