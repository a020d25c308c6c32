//! `fusion budget`.

use super::run::{period, written};
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::output::FileSet;
use fusion_judge::budget::{Settings, budget as budget_of, svg};
use fusion_present::Shown;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct BudgetArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Shows the shares at these times of the run too, such as `'60 s,90 s'`.
    #[arg(long, value_name = "TIME,TIME", value_delimiter = ',', value_parser = period)]
    at: Vec<Duration>,
    /// Seed of the run that gives the gains, instead of the design's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Writes budget.toml, with all shares, and budget.svg, the shares over time, here; creates the folder if necessary.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn budget(args: &BudgetArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    // Reports a folder that cannot be written before the run.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let settings = Settings {
        seed: args.seed,
        at: args.at.iter().map(Duration::as_secs_f64).collect(),
    };
    let found = budget_of(&design, &settings)?;
    let mut page = Shown(&found).page();
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("budget.toml", |file| file.write_all(found.toml().as_bytes()))?;
        files.write("budget.svg", |file| file.write_all(svg(&found).as_bytes()))?;
        files.commit()?;
        page.sections
            .push(written(["budget.toml", "budget.svg"].map(|name| out.join(name))));
    }
    args.output.print(&page)
}
