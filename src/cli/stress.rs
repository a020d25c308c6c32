//! `fusion stress`.

use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs, read_text};
use clap::Args;
use fusion::config::{Diagnostics, Document};
use fusion::output::FileSet;
use fusion::run::Options;
use fusion::stress::{Catalogue, stress as stress_design};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct StressArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Replaces the built-in catalogue; the design's table [stress] is laid over either.
    #[arg(long, value_name = "FILE")]
    catalogue: Option<PathBuf>,
    /// Applies the faults of this name only; may be given several times, or as `A,B`.
    #[arg(long, value_name = "FAULT", value_delimiter = ',')]
    only: Vec<String>,
    /// How many random pairs, instead of the catalogue's number.
    #[arg(long, value_name = "N")]
    pairs: Option<u32>,
    /// Seed of simulated data, of directions and of pairs; 1 without it.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Threads; as many as there are cores without it. The results do not depend on it.
    #[arg(long, value_name = "T", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// Writes stress.csv here, one row per case; the folder is made if need be.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn stress(args: &StressArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let catalogue = catalogue(args, &design.document)?;
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        seed: args.seed,
        ..Options::default()
    };
    // What cannot be written is told before the runs.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let bar = Runs::new();
    let result = stress_design(
        &design,
        &catalogue,
        &options,
        args.seed.unwrap_or(1),
        args.threads,
        &|done, total| {
            bar.at(done as u64, total as u64);
        },
    );
    drop(bar);
    let result = result?;
    let mut page = result.page();
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("stress.csv", |file| result.write(file))?;
        files.commit()?;
        page.sections.push(written([out.join("stress.csv")]));
    }
    args.output.print(&page)?;
    if result.failures() > 0 { Err(Failure::Stress) } else { Ok(()) }
}

/// The catalogue that is asked for.
fn catalogue(args: &StressArgs, design: &Document) -> Result<Catalogue, Diagnostics> {
    let file = match &args.catalogue {
        None => Catalogue::built_in(),
        Some(path) => read(path)?,
    };
    let mut catalogue = Catalogue::read(file, design)?;
    catalogue.only(&args.only)?;
    if let Some(pairs) = args.pairs {
        catalogue.set_pairs(pairs);
    }
    Ok(catalogue)
}

fn read(path: &Path) -> Result<Document, Diagnostics> {
    let (document, mistakes) = Document::parse(&path.display().to_string(), &read_text(path)?);
    let mut d = Diagnostics::new();
    d.extend(mistakes);
    d.unless_errors(document)
}
