//! Blocks of a project's own, in a crate of its own.
//!
//! A block registers itself where it is written. A program that uses this crate calls [`link`], and
//! the blocks are there beside those of the framework: in designs, in messages and in the laws.

pub mod range_rate;

/// Links the blocks of this crate into a program; call it once, so that the linker keeps them.
pub fn link() {}
