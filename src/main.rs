//! The `fusion` command: runs, checks and documents designs.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
