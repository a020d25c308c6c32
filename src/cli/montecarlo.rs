//! `fusion montecarlo`.

use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::campaign::monte_carlo;
use fusion::output::FileSet;
use fusion::run::Options;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct MonteCarloArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// How many runs; 100 without it.
    #[arg(short, long, value_name = "N", default_value_t = 100, hide_default_value = true, value_parser = clap::value_parser!(u64).range(1..))]
    n: u64,
    /// Seed of the campaign, 1 without it; each run draws its own from it and from its number.
    #[arg(long, value_name = "S", default_value_t = 1, hide_default_value = true)]
    seed: u64,
    /// Threads; as many as there are cores without it. The results do not depend on it.
    #[arg(long, value_name = "T", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// Writes runs.csv here, one row per run; the folder is made if need be.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn montecarlo(args: &MonteCarloArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        ..Options::default()
    };
    // What cannot be written is told before the runs.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let bar = Runs::new();
    let campaign = monte_carlo(&design, &options, args.n, args.seed, args.threads, &|done| {
        bar.at(done as u64, args.n);
    });
    drop(bar);
    let campaign = campaign?;
    let mut page = campaign.page();
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("runs.csv", |file| campaign.write(file))?;
        files.commit()?;
        page.sections.push(written([out.join("runs.csv")]));
    }
    args.output.print(&page)
}
