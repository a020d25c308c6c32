//! The command `fusion` as a library: a program with its own blocks gets the whole command for them.

mod cli;

pub use cli::main;
pub use fusion_compile::Meter;
