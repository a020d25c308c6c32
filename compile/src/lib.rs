//! From a checked design to a Rust program without a parser, a registry and a file system.
//!
//! ```text
//! Design ─ plan ─▶ blocks, built and connected ─ literals ─▶ Program: Cargo.toml, src/lib.rs
//!                                                  and for C: src/interface.rs, fusion.h
//! ```
//!
//! The program has one function, `assemble`, which calls the constructors of the blocks with their numbers, bit by bit.
//! It depends on `fusion-vehicle` and the crates below it, and needs no `std`. With the same rows, its estimates are
//! those of the design with the kernel `portable`, to the bit, if both use the same mathematics: `std` or `libm`.
//!
//! Not here   banks of hypotheses, filters inside stages, going back for late rows, blocks without a literal: a design
//!            with one of them is refused, and the error names it

mod assemble;
mod interface;
mod memory;
mod program;
mod record;

pub use fusion_abi::Meter;
pub use memory::{Needs, measure};
pub use program::{Program, Target, compile};
pub use record::record;
