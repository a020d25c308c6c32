//! Streams of rows by their numbers.

/// A stream of rows: its number in the order of declaration.
pub type StreamId = usize;
