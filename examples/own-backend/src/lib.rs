//! A custom backend: a second way to store P and a second way to use a measurement, written
//! outside fusion-core against its public traits.
//!
//! Both are plain rather than fast. `tests/laws.rs` checks them against the laws of every form and rule,
//! and compares them with the built-in ones in a strapdown filter.

mod packed;
mod twice;

pub use packed::Packed;
pub use twice::Twice;
