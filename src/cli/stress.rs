//! `fusion stress`.

use super::part::{self, range, refused};
use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs, read_text};
use clap::Args;
use core::ops::Range;
use fusion::config::{Diagnostics, Document};
use fusion::output::{FileSet, OutputFile};
use fusion::run::Options;
use fusion_judge::part::{Kind, Parts};
use fusion_judge::stress::draw::{Drawn, draw};
use fusion_judge::stress::{Catalogue, Stress, Work, stress as stress_design};
use fusion_present::Shown;
use fusion_tables::{Page, Section};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct StressArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Replaces the built-in catalogue; the design's table [stress] is applied to either.
    #[arg(long, value_name = "FILE")]
    catalogue: Option<PathBuf>,
    /// Applies only the faults with this name, draws only faults of this kind; may be given several times, or as `A,B`.
    #[arg(long, value_name = "FAULT", value_delimiter = ',')]
    only: Vec<String>,
    /// Draws this number of cases instead, with one to three faults at once, and counts their outcomes.
    #[arg(long, value_name = "N", conflicts_with_all = ["pairs"], value_parser = clap::value_parser!(u64).range(1..))]
    draw: Option<u64>,
    /// Runs only these drawn cases; may be given several times, or as `3,17`.
    #[arg(long, value_name = "N", value_delimiter = ',', requires = "draw", value_parser = clap::value_parser!(u64).range(1..))]
    case: Vec<u64>,
    /// The number of random pairs, instead of the catalogue's number.
    #[arg(long, value_name = "N")]
    pairs: Option<u32>,
    /// Seed of simulated data, of directions, of pairs and of drawn cases; 1 by default.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The number of threads; by default the number of cores. The results do not depend on it.
    #[arg(long, value_name = "T", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// Writes stress.csv here, or draw.csv with `--draw`, one row per case; creates the folder if necessary.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Runs the cases with these numbers only, such as 1..50; they count from 1, the last number is not included.
    #[arg(long, value_name = "A..B", conflicts_with = "case", value_parser = range)]
    runs: Option<Range<u64>>,
    /// Writes the cases to this file, for `fusion merge`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "case"])]
    part: Option<PathBuf>,
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
    // Reports files that cannot be written before the runs.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let bar = Runs::new();
    let seed = args.seed.unwrap_or(1);
    let told = |done, total| bar.at(done as u64, total as u64);
    let work = Work {
        seed,
        numbers: args.runs.clone(),
        threads: args.threads,
        again: args.again(seed),
        progress: &told,
    };
    let part = part::work(args.part.as_deref(), |file| match args.draw {
        Some(count) => draw(&design, &catalogue, &options, (count, &args.case), &work, file),
        None => stress_design(&design, &catalogue, &options, &work, file),
    })?;
    drop(bar);
    let written_part = args.part.clone().map(|path| written([path]));
    results(&part.into(), args.out.as_deref(), files, &args.output, written_part)
}

/// Writes and prints the result, and judges it.
pub(super) fn results(
    parts: &Parts,
    out: Option<&Path>,
    files: Option<FileSet>,
    output: &OutputArgs,
    more: Option<Section>,
) -> Result<(), Failure> {
    type Written<'a> = &'a dyn Fn(&mut OutputFile) -> std::io::Result<()>;
    let finish = |mut page: Page, name: &str, write: Written<'_>, fails: bool| {
        if let (Some(out), Some(mut files)) = (out, files) {
            files.write(name, write)?;
            files.commit()?;
            page.sections.push(written([out.join(name)]));
        }
        page.sections.extend(more);
        output.print(&page)?;
        if fails { Err(Failure::Stress) } else { Ok(()) }
    };
    if parts.head().kind == Kind::Draw {
        let result = Drawn::read(parts).map_err(refused)?;
        let page = Shown(&result).page(&parts.head().again);
        return finish(page, "draw.csv", &|file| result.write(file), result.fails());
    }
    let result = Stress::read(parts).map_err(refused)?;
    finish(
        Shown(&result).page(),
        "stress.csv",
        &|file| result.write(file),
        result.failures() > 0,
    )
}

impl StressArgs {
    /// The command of the same cases.
    fn again(&self, seed: u64) -> String {
        let mut words = vec!["fusion stress".to_owned()];
        words.extend(self.design.config.as_ref().map(|path| path.display().to_string()));
        words.extend(self.design.words());
        words.extend(self.catalogue.as_ref().map(|path| format!("--catalogue {}", path.display())));
        words.extend((!self.only.is_empty()).then(|| format!("--only {}", self.only.join(","))));
        words.extend(self.pairs.map(|pairs| format!("--pairs {pairs}")));
        words.extend(self.draw.map(|count| format!("--draw {count}")));
        words.push(format!("--seed {seed}"));
        words.join(" ")
    }
}

/// The selected catalogue.
fn catalogue(args: &StressArgs, design: &Document) -> Result<Catalogue, Diagnostics> {
    let file = match &args.catalogue {
        None => Catalogue::built_in(),
        Some(path) => read(path)?,
    };
    let mut catalogue = Catalogue::read(file, design)?;
    if args.draw.is_some() {
        catalogue.draw_only(&args.only)?;
    } else {
        catalogue.only(&args.only)?;
    }
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
