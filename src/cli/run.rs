//! `fusion run`.

use super::fix::AdviceArgs;
use super::progress::Progress;
use super::{DesignArgs, Failure, Format, OutputArgs};
use clap::{Args, ValueEnum};
use fusion::config::{Diagnostics, Edit};
use fusion::core::covariance::Kernel;
use fusion::design::Design;
use fusion::models::units::{self, Dimensional, dim};
use fusion::observe::RunObserver;
use fusion::output::{EstimateFormat, Unwritable};
use fusion::run::{self, Checkpoints, Keep, Options, Run, Smoothing, Summary};
use fusion_judge::bisect::LedgerWriter;
use fusion_present::Shown;
use fusion_present::report;
use fusion_tables::{Page, Section, Table};
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Default, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Writes estimates.csv, updates.csv, summary.json and report.html here; creates the folder if necessary.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Writes the estimates of estimates.csv in these formats too, with commas between them: `geojson`, `gpx`, `kml`,
    /// `mcap`, `parquet`, `sbet`, `tum`. With `--smooth` also the smoothed ones.
    #[arg(long, value_name = "FORMAT,…", requires = "out", value_delimiter = ',', value_parser = estimate_format, conflicts_with_all = ["checkpoint", "resume"])]
    also: Vec<&'static EstimateFormat>,
    /// Seed of simulated data and random faults, instead of the design's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The arithmetic kernel, instead of the best that the processor has. `portable` gives the same figures on every
    /// machine, to the last digit of sin and exp.
    #[arg(long, value_name = "NAME", value_parser = kernel)]
    kernel: Option<Kernel>,
    /// Smooths the estimates by all data of the log, and scores them too. With `--out` it writes smoothed.csv, with the
    /// columns and epochs of estimates.csv. Until the end of the log the filter's steps are kept in `memory`, or on
    /// `disk` in the folder of `--out`. The default is `disk` with `--out`, otherwise `memory`. `iterate` linearises the
    /// models again at the smoothed states until these do not change: the maximum a posteriori.
    #[arg(
        long,
        value_enum,
        value_name = "disk|memory|iterate",
        require_equals = true,
        hide_possible_values = true
    )]
    smooth: Option<Option<SmoothArg>>,
    /// As `--smooth=iterate`, by sparse Cholesky factorisation of the normal equations of the whole log, in memory: an
    /// independent check. The program has to be built with the feature `faer`.
    #[arg(long, conflicts_with = "smooth")]
    batch: bool,
    /// With `order = "rewind"`: estimates.csv holds the current estimates, before later rows changed them, and
    /// revised.csv the revised estimates. Without it, current.csv and estimates.csv hold them.
    #[arg(long, requires = "out")]
    causal: bool,
    /// Saves the run in FILE regularly, so that `--resume` can continue it after a crash or a kill. With `--out`,
    /// unfinished files are then kept too. FILE is removed at the end of the run.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Time between two checkpoints, by the clock: 10 s by default.
    #[arg(long, value_name = "TIME", default_value = "10 s", hide_default_value = true, value_parser = period, requires = "checkpoint")]
    every: Duration,
    /// Continues the run that was saved in FILE; all other options must be the same as at its start. The results are
    /// the same, to the last bit, as without a stop. Give `--checkpoint FILE` too to continue saving.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Runs on the record of a live run, which `fusion live --record` has written, instead of the design's data: the
    /// estimates are those of the live run, to the last bit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["data", "resume", "checkpoint"])]
    replay: Option<PathBuf>,
    /// Writes a line for each measurement, with all digits of what the filter computes of it, for `fusion bisect`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["checkpoint", "resume"])]
    ledger: Option<PathBuf>,
    /// Prints all tables: sources, innovations, errors per axis, consistency, outages, estimated parameters.
    #[arg(short, long)]
    verbose: bool,
    /// Exit code 3 unless every filter was in good health from its alignment to the end.
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    advice: AdviceArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// The format of estimates with this name.
fn estimate_format(name: &str) -> Result<&'static EstimateFormat, String> {
    let known = || {
        let each = EstimateFormat::all()
            .into_iter()
            .map(|format| format!("{}: {}", format.name, format.about));
        format!("the formats are\n  {}", each.collect::<Vec<_>>().join("\n  "))
    };
    EstimateFormat::all()
        .into_iter()
        .find(|format| format.name == name)
        .ok_or_else(known)
}

/// A time in the format of a design.
pub(super) fn period(text: &str) -> Result<Duration, String> {
    let (seconds, dimension) = units::parse(text).map_err(|error| error.to_string())?;
    if dimension != dim::Duration::KIND.dimension {
        return Err("a time is wanted, such as `10 s`".to_owned());
    }
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

/// Where steps are kept for smoothing, or how often the models are linearised.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum SmoothArg {
    Disk,
    Memory,
    Iterate,
}

impl RunArgs {
    fn smoothing(&self) -> Smoothing {
        match (self.smooth, &self.out) {
            (None, _) if self.batch => Smoothing::Batch,
            (None, _) => Smoothing::Declared,
            (Some(Some(SmoothArg::Iterate)), None) => Smoothing::Iterated(Keep::Memory),
            (Some(Some(SmoothArg::Iterate)), Some(_)) => Smoothing::Iterated(Keep::Disk),
            (Some(Some(SmoothArg::Memory)), _) | (Some(None), None) => Smoothing::Whole(Keep::Memory),
            (Some(Some(SmoothArg::Disk)), _) | (Some(None), Some(_)) => Smoothing::Whole(Keep::Disk),
        }
    }
}

/// The kernel with this name.
fn kernel(name: &str) -> Result<Kernel, String> {
    let here = || Kernel::here().map(Kernel::name).collect::<Vec<_>>().join(", ");
    Kernel::named(name).ok_or_else(|| format!("this processor has {}", here()))
}

pub(super) fn run(args: &RunArgs) -> Result<(), Failure> {
    args.advice.fix.check(&args.design)?;
    let ignored = args.advice.ignored()?;
    let mut design = args.design.read()?;
    if let Some(kernel) = args.kernel {
        design.set_kernel(kernel);
    }
    let feed = args
        .replay
        .as_deref()
        .map(|record| super::live::replay(&design, record))
        .transpose()?;
    let is_asked = |format: &&EstimateFormat| args.also.iter().any(|also| also.name == format.name);
    let also: Vec<&EstimateFormat> = EstimateFormat::all().into_iter().filter(is_asked).collect();
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        out: args.out.clone(),
        also,
        seed: args.seed,
        smooth: args.smoothing(),
        checkpoint: args.checkpoint.clone().map(|file| Checkpoints { file, every: args.every }),
        resume: args.resume.clone(),
        causal: args.causal,
        ignored,
        feed,
        ..Options::default()
    };
    let mut progress = Progress::new(&design);
    let unwritable = |path: &PathBuf, error| Failure::from(Unwritable::new(path, error));
    let begin = |path: &PathBuf| {
        let begun = File::create(path).and_then(|file| LedgerWriter::new(BufWriter::new(file)));
        begun.map_err(|error| unwritable(path, error))
    };
    let mut ledger = args.ledger.as_ref().map(begin).transpose()?;
    let mut further: Vec<&mut dyn RunObserver> = ledger.iter_mut().map(|ledger| ledger as _).collect();
    let summary = results(&design, &options, &mut further, &mut |to| progress.at(to));
    progress.finish();
    let summary = summary?;
    if let Some((ledger, path)) = ledger.zip(args.ledger.as_ref()) {
        ledger.finish().map_err(|error| unwritable(path, error))?;
    }
    let mut page = page(&summary, &options, args.verbose, args.output.format);
    let edits: Vec<Edit> = summary.findings().iter().flat_map(|finding| finding.edits.clone()).collect();
    page.sections.extend(args.advice.fix.write(&args.design, &edits)?);
    args.output.print(&page)?;
    let is_ill = summary.health().iter().any(|h| !h.is_good());
    if args.strict && is_ill { Err(Failure::Health) } else { Ok(()) }
}

/// Runs a design; with a folder to write to, also writes its files and the report.
pub(super) fn results(
    design: &Design,
    options: &Options,
    further: &mut [&mut dyn RunObserver],
    progress: &mut dyn FnMut(run::Progress),
) -> Result<Summary, Diagnostics> {
    match options.out {
        Some(_) => reported(design, options, further, progress),
        None => Ok(Run::open(design, options)?.go(further, progress)?.keep()?),
    }
}

/// The page of a run.
pub(super) fn page(summary: &Summary, options: &Options, verbose: bool, format: Format) -> Page {
    let is_brief = !verbose && format == Format::Text;
    let mut page = if is_brief { Shown(summary).brief() } else { Shown(summary).page() };
    page.sections.push(match &options.out {
        Some(out) => {
            let smoothed = summary.smoothed().map(|_| "smoothed.csv");
            let firsts = ["estimates"].into_iter().chain(smoothed.map(|_| "smoothed"));
            let also = firsts.flat_map(|first| options.also.iter().map(move |format| format!("{first}.{}", format.ending)));
            let others = ["updates.csv", "summary.json", "report.html"];
            let revised = summary
                .current()
                .map(|_| if options.causal { "revised.csv" } else { "current.csv" });
            let names = ["estimates.csv"].into_iter().chain(revised).chain(smoothed).chain(others);
            written(names.map(str::to_owned).chain(also).map(|f| out.join(f)))
        }
        None => Section::new("", []).note("Nothing written; `--out DIR` keeps estimates, updates, summary and report."),
    });
    if is_brief {
        page.sections.push(Section::new("", []).note("`--verbose` shows all tables."));
    }
    page
}

/// Files that were written.
pub(super) fn written(files: impl IntoIterator<Item = PathBuf>) -> Section {
    let mut list = Table::list();
    files.into_iter().for_each(|f| list.row([f.display().to_string()]));
    Section::new("Written", [list])
}

/// Runs a design and writes its files, report.html among them.
fn reported(
    design: &Design,
    options: &Options,
    further: &mut [&mut dyn RunObserver],
    progress: &mut dyn FnMut(run::Progress),
) -> Result<Summary, Diagnostics> {
    let (mut finished, recording) = report::record(design, options, further, progress)?;
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
