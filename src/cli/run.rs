//! `fusion run`.

use super::progress::Progress;
use super::{DesignArgs, Failure, print, report as tell};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::report;
use fusion::run::{Options, run as run_design, run_recorded};
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Writes estimates.csv, updates.csv, summary.json and report.html here; the folder is made if
    /// need be.
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
    let mut at = |time| progress.at(time);
    let result = match args.out {
        Some(_) => run_recorded(&design, &options, &mut at).map(|(summary, recording)| (summary, Some(recording))),
        None => run_design(&design, &options, &mut at).map(|summary| (summary, None)),
    };
    progress.finish();
    let (summary, recording) = result?;
    if let (Some(out), Some(recording)) = (&args.out, &recording) {
        write_report(
            out,
            &design.run.description,
            &[report::Run {
                name: "estimate",
                recording,
                summary: &summary,
            }],
        )?;
    }
    let mut text = summary.to_string();
    // Writing to a String cannot fail.
    let _ = match &args.out {
        Some(out) => {
            let files = ["estimates.csv", "updates.csv", "summary.json", "report.html"].map(|f| out.join(f).display().to_string());
            write!(text, "\nWritten\n  {}\n", files.join("\n  "))
        }
        None => write!(text, "\nNothing written; `--out DIR` keeps estimates, updates and this summary.\n"),
    };
    print(&text)?;
    let mut warnings = Diagnostics::new();
    warnings.extend(summary.warnings().into_iter().map(Diagnostic::warning));
    tell(&warnings);
    Ok(())
}

/// Writes report.html into the folder `out`.
pub(super) fn write_report(out: &Path, title: &str, runs: &[report::Run<'_>]) -> Result<(), Diagnostics> {
    let path = out.join("report.html");
    let title = if title.is_empty() { "fusion" } else { title };
    report::write(&path, title, runs).map_err(|e| Diagnostic::error(format!("cannot write {}: {e}", path.display())).into())
}
