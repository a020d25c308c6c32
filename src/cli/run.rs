//! `fusion run`.

use super::progress::Progress;
use super::{DesignArgs, Failure, OutputArgs, report as tell};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::present::{Section, Table};
use fusion::report;
use fusion::run::{Options, run as run_design};
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
    #[command(flatten)]
    output: OutputArgs,
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
        Some(_) => report::record(&design, &options, &mut at).map(|(summary, recording)| (summary, Some(recording))),
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
    let mut page = summary.page();
    page.sections.push(match &args.out {
        Some(out) => written(["estimates.csv", "updates.csv", "summary.json", "report.html"].map(|f| out.join(f))),
        None => Section::new("", []).note("Nothing written; `--out DIR` keeps estimates, updates, summary and report."),
    });
    args.output.print(&page)?;
    let mut warnings = Diagnostics::new();
    warnings.extend(page.warnings.iter().map(Diagnostic::warning));
    tell(&warnings);
    Ok(())
}

/// Files that were written.
pub(super) fn written(files: impl IntoIterator<Item = PathBuf>) -> Section {
    let mut list = Table::list();
    files.into_iter().for_each(|f| list.row([f.display().to_string()]));
    Section::new("Written", [list])
}

/// Writes report.html into the folder `out`.
pub(super) fn write_report(out: &Path, title: &str, runs: &[report::Run<'_>]) -> Result<(), Diagnostics> {
    let path = out.join("report.html");
    let title = if title.is_empty() { "fusion" } else { title };
    report::write(&path, title, runs).map_err(|e| Diagnostic::error(format!("cannot write {}: {e}", path.display())).into())
}
