//! `fusion bisect`.

use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::BASE;
use fusion::config::Diagnostic;
use fusion::run::{Options, Run, Smoothing};
use fusion_judge::bisect::{Difference, Entry, Ledger, LedgerWriter, bisect};
use fusion_tables::{Column, Page, Section, Table};
use std::fs::File;
use std::io::{self, BufReader, BufWriter};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct BisectArgs {
    /// Two of: a design, or a ledger that `fusion run --ledger` has written. One design is enough with two variants or
    /// backends.
    #[arg(required = true, num_args = 1..=2, value_name = "DESIGN|LEDGER")]
    runs: Vec<PathBuf>,
    /// The variants of the first and of the second design, with a comma between them. `base` is the design without a
    /// variant.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    variant: Vec<String>,
    /// The backends of the first and of the second design, with a comma between them.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    backend: Vec<String>,
    /// Replaces one value in both designs, after the variant.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Where relative source paths start, instead of at the design's `data_dir`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Seed of simulated data and random faults.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Runs both designs on the record of a live run.
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// A file that is removed in the end.
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // It may never have been created.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn unreadable(path: &Path, error: &io::Error) -> Failure {
    Diagnostic::error(format!("{}: {error}", path.display())).into()
}

impl BisectArgs {
    /// The ledger of one of the two runs: as it is, or by running its design.
    fn ledger(&self, number: usize) -> Result<(Ledger<BufReader<File>>, Option<Temporary>), Failure> {
        let path = self.runs.get(number).unwrap_or(&self.runs[0]);
        if path.extension().is_none_or(|ending| ending != "toml") {
            let file = File::open(path).map_err(|error| unreadable(path, &error))?;
            let ledger = Ledger::read(BufReader::new(file)).map_err(|error| unreadable(path, &error))?;
            return Ok((ledger, None));
        }
        let pick = |list: &[String]| list.get(number).or_else(|| list.first()).cloned();
        let design = DesignArgs {
            config: Some(path.clone()),
            variant: vec![pick(&self.variant).unwrap_or_else(|| BASE.to_owned())],
            backend: pick(&self.backend),
            set: self.set.clone(),
            data: self.data.clone(),
        };
        let base = design.base();
        let design = design.read()?;
        let feed = self
            .replay
            .as_deref()
            .map(|record| super::live::replay(&design, record))
            .transpose()?;
        let options = Options {
            data: self.data.clone(),
            base,
            seed: self.seed,
            smooth: Smoothing::Never,
            feed,
            ..Options::default()
        };
        let temporary = std::env::temp_dir().join(format!("fusion-{}-{number}.ledger", std::process::id()));
        let temporary = Temporary(temporary);
        let wrong = |error: io::Error| unreadable(&temporary.0, &error);
        let mut writer = LedgerWriter::new(BufWriter::new(File::create(&temporary.0).map_err(wrong)?)).map_err(wrong)?;
        Run::open(&design, &options)?.go(&mut [&mut writer], &mut |_| {})?.keep()?;
        writer.finish().map_err(wrong)?;
        let file = File::open(&temporary.0).map_err(wrong)?;
        let ledger = Ledger::read(BufReader::new(file)).map_err(wrong)?;
        Ok((ledger, Some(temporary)))
    }
}

pub(super) fn run(args: &BisectArgs) -> Result<(), Failure> {
    let ((mut first, _kept), (mut second, _also_kept)) = (args.ledger(0)?, args.ledger(1)?);
    let found = bisect(&mut first, &mut second).map_err(|error| unreadable(&args.runs[0], &error))?;
    let sections = match &found {
        Ok(difference) => told(difference),
        Err(count) => vec![Section::new("", []).note(format!("All {count} measurements are equal, to the last bit."))],
    };
    let page = Page {
        title: "the first measurement that differs".to_owned(),
        sections,
        ..Page::default()
    };
    args.output.print(&page)?;
    if found.is_ok() { Err(Failure::Difference) } else { Ok(()) }
}

fn told(difference: &Difference) -> Vec<Section> {
    let place = |entry: &Entry| {
        format!(
            "`{}` at {:.6} s, row {}",
            entry.sensor(),
            entry.time_ns() as f64 * 1e-9,
            entry.row()
        )
    };
    let mut head = vec![format!("{} measurements before it are equal, to the last bit.", difference.equal)];
    if let Some(before) = &difference.before {
        head.push(format!("The last of them is {}.", place(before)));
    }
    let both = [("first", &difference.first), ("second", &difference.second)];
    for (run, entry) in both {
        head.push(match entry {
            Some(entry) => format!("In the {run} run follows {}.", place(entry)),
            None => format!("The {run} run has no further one."),
        });
    }
    let mut sections = vec![Section::new("", []).note(head.join(" "))];
    let fields = difference.fields();
    if !fields.is_empty() {
        let mut table = Table::new([
            Column::text("field"),
            Column::text("first"),
            Column::text("second"),
            Column::text("difference"),
        ]);
        for (name, a, b) in fields {
            let numbers = a
                .split(',')
                .zip(b.split(','))
                .map(|(a, b)| Some(b.parse::<f64>().ok()? - a.parse::<f64>().ok()?));
            let apart = numbers.map(|apart| apart.map_or_else(String::new, |apart| format!("{apart:.2e}")));
            let lines = |list: &str| list.replace(',', "\n");
            table.row([name.to_owned(), lines(a), lines(b), apart.collect::<Vec<_>>().join("\n")]);
        }
        sections.push(Section::new("What differs", [table]));
    }
    sections
}
