//! The `fusion` command: runs, checks and documents designs.

use fusion_cli::Meter;
use std::process::ExitCode;

/// Measures the memory of a compiled design.
#[global_allocator]
static METER: Meter = Meter;

fn main() -> ExitCode {
    fusion_cli::main()
}
