//! `fusion run`.

use super::progress::Progress;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::config::Diagnostics;
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::present::{Section, Table};
use fusion::report;
use fusion::run::{Options, Summary, run as run_design};
use std::path::PathBuf;

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
    /// Exit code 3 unless every filter was in good health from its alignment to the end.
    #[arg(long)]
    strict: bool,
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
    let summary = match args.out {
        Some(_) => reported(&design, &options, &mut at),
        None => run_design(&design, &options, &mut at),
    };
    progress.finish();
    let summary = summary?;
    let mut page = summary.page();
    page.sections.push(match &args.out {
        Some(out) => written(["estimates.csv", "updates.csv", "summary.json", "report.html"].map(|f| out.join(f))),
        None => Section::new("", []).note("Nothing written; `--out DIR` keeps estimates, updates, summary and report."),
    });
    args.output.print(&page)?;
    let is_ill = summary.health.iter().any(|h| !h.is_good());
    if args.strict && is_ill { Err(Failure::Health) } else { Ok(()) }
}

/// Files that were written.
pub(super) fn written(files: impl IntoIterator<Item = PathBuf>) -> Section {
    let mut list = Table::list();
    files.into_iter().for_each(|f| list.row([f.display().to_string()]));
    Section::new("Written", [list])
}

/// Runs a design and writes its files, report.html among them.
fn reported(design: &Design, options: &Options, progress: &mut dyn FnMut(Time)) -> Result<Summary, Diagnostics> {
    let (mut finished, recording) = report::record(design, options, progress)?;
    if let Some(files) = &mut finished.files {
        let run = report::Run {
            name: "estimate",
            recording: &recording,
            summary: &finished.summary,
        };
        report::write(files, &design.run.description, &[run])?;
    }
    Ok(finished.keep()?)
}
