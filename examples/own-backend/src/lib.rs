//! A backend of one's own: a second way to store P and a second way to use a measurement, written
//! outside fusion-core against its public traits.
//!
//! Both are plain rather than fast. `tests/laws.rs` holds them to the laws of every form and rule,
//! and lets them run a strapdown filter beside the built-in ones.

mod packed;
mod twice;

pub use packed::Packed;
pub use twice::Twice;
