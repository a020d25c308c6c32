//! `fusion run`.

use super::progress::Progress;
use super::{DesignArgs, Failure, print, report};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::run::{Options, run as run_design};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Debug, Default, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Writes estimates.csv, updates.csv and summary.json here; the folder is made if need be.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of simulated data and random faults, instead of the design's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        out: args.out.clone(),
        seed: args.seed,
    };
    let mut progress = Progress::new(&design);
    let result = run_design(&design, &options, &mut |time| progress.at(time));
    progress.finish();
    let summary = result?;
    let mut text = summary.to_string();
    // Writing to a String cannot fail.
    let _ = match &args.out {
        Some(out) => {
            let files = ["estimates.csv", "updates.csv", "summary.json"].map(|f| out.join(f).display().to_string());
            write!(text, "\nWritten\n  {}\n", files.join("\n  "))
        }
        None => write!(text, "\nNothing written; `--out DIR` keeps estimates, updates and this summary.\n"),
    };
    print(&text)?;
    let mut warnings = Diagnostics::new();
    warnings.extend(summary.warnings().into_iter().map(Diagnostic::warning));
    report(&warnings);
    Ok(())
}
