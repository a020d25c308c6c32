//! The command `fusion` as a library: a program with blocks of its own has the whole command over them.

mod cli;

pub use cli::main;
