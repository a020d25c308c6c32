//! The queue: which row is next, when it is valid, and for which consumer.
//!
//! It keeps every row until the last of its consumers has used it. It knows the streams, the consumers as names with
//! the streams that they read, and how long rows have to be held back. It knows no sensor and no estimator.

mod ahead;
mod inbox;
mod order;
mod pool;
mod quarantine;
mod release;
#[cfg(test)]
mod tests;

pub(super) use inbox::Queue;
pub(super) use order::Entry;
pub(super) use quarantine::{Admission, Quarantine};
