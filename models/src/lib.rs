//! The blocks of the fusion framework: earth, process models, measurement models, stages,
//! initialisers, gates and losses as they are declared in TOML.
//!
//! A block is one file: a kernel (free functions), a runtime model (reads quantities, writes
//! Jacobian blocks), a spec (what TOML says) and its tests. What is absent here: no block knows
//! an estimator, a covariance or a state index, and none reads a file.

pub mod block;
pub mod earth;
pub mod fault;
pub mod gate;
pub mod initial;
pub mod loss;
pub mod param;
pub mod plausible;
pub mod process;
pub mod registry;
mod seed;
pub mod sensor;
pub mod sim;
pub mod spelling;
pub mod stage;
pub mod testing;
pub mod units;
pub mod vocabulary;

pub use fusion_core;
pub use inventory;
pub use schemars;

/// Links the blocks of this crate into a program; call it once, so that the linker keeps them.
pub fn link() {}
