//! `fusion merge`.

use super::run::written;
use super::{Failure, OutputArgs};
use clap::Args;
use fusion::config::Diagnostic;
use fusion::output::FileSet;
use fusion_judge::campaign::{Campaign, Unreadable};
use fusion_present::Shown;
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    /// Parts that `fusion montecarlo --part` has written, in any order.
    #[arg(required = true, value_name = "FILE")]
    parts: Vec<PathBuf>,
    /// Writes runs.csv here; creates the folder if necessary.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn merge(args: &MergeArgs) -> Result<(), Failure> {
    let mistake = |number: usize, why: &Unreadable| {
        let file = args
            .parts
            .get(number)
            .map_or_else(String::new, |file| format!("`{}`: ", file.display()));
        Failure::Mistakes(Diagnostic::error(format!("{file}{why}")).into())
    };
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let mut parts = Vec::with_capacity(args.parts.len());
    for (number, path) in args.parts.iter().enumerate() {
        let file = File::open(path).map_err(|e| {
            let message = format!("`{}` cannot be read: {e}", path.display());
            Failure::Mistakes(Diagnostic::error(message).into())
        })?;
        parts.push(Campaign::read_part(BufReader::new(file)).map_err(|e| mistake(number, &e))?);
    }
    let campaign = Campaign::merge(parts).map_err(|(number, e)| match e {
        Unreadable::Missing { .. } => mistake(usize::MAX, &e),
        _ => mistake(number, &e),
    })?;
    let mut page = Shown(&campaign).page();
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("runs.csv", |file| campaign.write(file))?;
        files.commit()?;
        page.sections.push(written([out.join("runs.csv")]));
    }
    args.output.print(&page)
}
