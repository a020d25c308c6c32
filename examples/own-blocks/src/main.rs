//! The command `fusion`, with the blocks of this crate beside those of the framework.

use std::process::ExitCode;

fn main() -> ExitCode {
    own_blocks::link();
    fusion_cli::main()
}
