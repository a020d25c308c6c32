//! The `fusion` command: runs, checks and documents designs.

use std::process::ExitCode;

fn main() -> ExitCode {
    fusion_cli::main()
}
