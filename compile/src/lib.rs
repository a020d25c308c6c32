//! From a checked design to a Rust program without a parser, a registry and a file system.
//!
//! ```text
//! Design ─ plan ─▶ blocks, built and connected ─ literals ─▶ Program: Cargo.toml, src/lib.rs
//! ```
//!
//! The program has one function, `assemble`, which calls the constructors of the blocks with their numbers, bit by bit.
//! It needs `fusion-vehicle` alone, and no `std`. With the same rows, its estimates are those of the design with the
//! kernel `portable`, to the bit, if both use the same mathematics: the feature `libm`.
//!
//! Not here   banks of hypotheses, filters inside stages, going back for late rows, blocks without a literal: such a
//!            design is refused by the name of what it has

mod assemble;
mod program;

pub use program::{Program, compile};
