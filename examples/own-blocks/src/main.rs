//! A program with a block of its own: runs `design.toml`, which uses `range_rate`.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a command prints")]

use fusion::config::{Diagnostics, Document};
use fusion::design::Design;
use fusion::run::{Options, Summary, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    own_blocks::link();
    match summary() {
        Ok(summary) => {
            print!("{summary}");
            ExitCode::SUCCESS
        }
        Err(mistakes) => {
            eprintln!("{mistakes}");
            ExitCode::from(2)
        }
    }
}

fn summary() -> Result<Summary, Diagnostics> {
    let (document, mut mistakes) = (Document::parse("design.toml", include_str!("../design.toml")), Diagnostics::new());
    mistakes.extend(document.1);
    let document = mistakes.unless_errors(document.0)?;
    run(&Design::read(document)?, &Options::default(), &mut |_| {})
}
