//! The command `fusion`, with the backends and the manifold of this crate.

use std::process::ExitCode;

fn main() -> ExitCode {
    own_backend::link();
    fusion_cli::main()
}
