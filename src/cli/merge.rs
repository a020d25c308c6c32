//! `fusion merge`.

use super::part::{open, refused};
use super::{Failure, OutputArgs, compare, montecarlo, stress, tune};
use clap::Args;
use fusion::config::Diagnostic;
use fusion::output::FileSet;
use fusion_judge::campaign::{Campaign, read};
use fusion_judge::part::{Kind, Part, Parts};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    /// Parts that `--part` of `fusion montecarlo`, `compare`, `stress` or `tune` has written, in any order.
    #[arg(required = true, value_name = "FILE")]
    parts: Vec<PathBuf>,
    /// Writes the files of the whole here; creates the folder if necessary: runs.csv and montecarlo.html, stress.csv, or
    /// draw.csv. Only the reports of the worst runs need the design: the page has their commands.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn merge(args: &MergeArgs) -> Result<(), Failure> {
    let parts: Result<Vec<Part>, Failure> = args.parts.iter().map(|path| open(path)).collect();
    let parts = Parts::whole(parts?).map_err(refused)?;
    let out = args.out.as_deref();
    let files = out.map(FileSet::begin).transpose()?;
    match parts.head().kind {
        Kind::Montecarlo => {
            let campaign = montecarlo::only(&parts)?;
            has_results(core::slice::from_ref(&campaign))?;
            args.output.print(&montecarlo::results((&parts, &campaign), out, files, None)?)
        }
        Kind::Compare if out.is_some() => {
            Err(Diagnostic::error("`fusion compare` with several runs writes no files: leave `--out` out").into())
        }
        Kind::Compare => {
            let campaigns = read(&parts).map_err(refused)?;
            has_results(&campaigns)?;
            args.output.print(&compare::together(&parts, &campaigns)?)
        }
        Kind::Tune if out.is_some() => Err(Diagnostic::error("`fusion tune` writes no folder: leave `--out` out").into()),
        Kind::Tune => tune::merged(&parts, &args.output),
        Kind::Stress | Kind::Draw => stress::results(&parts, out, files, &args.output, None),
    }
}

/// Refuses a campaign of which all runs have failed.
fn has_results(campaigns: &[Campaign]) -> Result<(), Failure> {
    let without = campaigns.iter().find(|campaign| campaign.first().is_none());
    match without.and_then(|campaign| campaign.failures().first()) {
        Some(run) => Err(Diagnostic::error(format!("all runs have failed, the first one for this reason: {}", run.reason)).into()),
        None => Ok(()),
    }
}
