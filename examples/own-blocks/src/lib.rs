//! A project's own blocks, and its own section of the result, in a separate crate.
//!
//! A block registers itself where it is written. A program that uses this crate calls [`link`]. The blocks are
//! then available like those of the framework: in designs, in messages and in the laws.

pub mod range_rate;
pub mod speeds;

/// Links the parts of this crate into a program; call it once, so that the linker keeps them.
pub fn link() {}
