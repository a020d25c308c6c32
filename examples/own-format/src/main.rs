//! The command `fusion`, which reads logs of JSON lines too.

use std::process::ExitCode;

fn main() -> ExitCode {
    own_format::link();
    fusion_cli::main()
}
