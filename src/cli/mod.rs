//! The command line: options, input files and output.
//!
//! Results go to stdout. Diagnostics and progress go to stderr, in colour on a terminal only. Exit codes: 0 success; 1
//! standard output could not be written; 2 a mistake in the command line, the design, the data or the output folder; 3
//! (with `run --strict`) a filter in bad health; 4 (with `tune`) rows that are not independent; 130 and 143 stopped by SIGINT or SIGTERM.

mod allan;
mod bisect;
mod blocks;
mod budget;
mod builtin;
mod check;
mod compare;
mod compile;
mod fix;
mod inspect;
mod live;
mod merge;
mod montecarlo;
mod new;
mod observability;
mod part;
mod progress;
mod record;
mod run;
#[cfg(unix)]
mod stop;
mod stress;
mod tune;

use clap::{Args, Parser, Subcommand, ValueEnum};
use fusion::Selection;
use fusion::config::{Diagnostic, Diagnostics, Document, Files, Severity, Unread, read_piped_text};
use fusion::design::Design;
use fusion::examine::{Missing, examine, surprises, variants};
use fusion::output::Unwritable;
use fusion::run::Options;
use fusion_tables::{Page, json, text};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Runs, checks and documents navigation filters that are declared in TOML.
#[derive(Debug, Parser)]
#[command(
    version,
    max_term_width = 100,
    after_help = "Without a command it runs a built-in simulated design, as `fusion run` does.\n\
                  Exit codes: 0 done, 1 standard output cannot be written, 2 a mistake in the command line, the\n\
                  design, the data or the folder to write to, 3 a filter in ill health (`run --strict`),\n\
                  4 rows that are not independent (`tune`),\n\
                  130 and 143 stopped by SIGINT or SIGTERM: no file is changed then."
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a design over its data, or its simulated world, and print the results.
    ///
    /// Prints sources, sensors, errors against the reference, consistency, drift in declared outages
    /// and estimated parameters. If the filter never started, this is a warning and the exit code
    /// is 0.
    ///
    /// If a declared fault disturbs the data of a sensor, `missed` counts the disturbed measurements
    /// that were used, and `false` the undisturbed ones that were rejected. Innovations are sensor
    /// minus navigation, before the update; their statistics, and NIS, are those of accepted
    /// measurements from `[reference] from` on. All other counts are of the whole run.
    ///
    /// The health of a filter is judged without a reference: good, aligning, coasting (no input),
    /// degraded or lost, each with its reasons. Its limits are those of the table `[health]`.
    #[command(after_long_help = "\
Examples:
  fusion run                                     the built-in design, simulated
  fusion run configs/ins-gps.toml --out results  writes estimates.csv, updates.csv, summary.json
  fusion run drive.toml --data ~/logs/drive-3    the same design on other data
  fusion run drive.toml --variant ekf --variant position-only
  fusion run drive.toml --set sensor.gnss.gate.probability=0.99 --set filter.backend=ekf
  fusion run drive.toml --set 'sensor.gnss.noise.sigma=[\"1 m\", \"1 m\", \"2 m\"]'
  fusion run --seed 7                            other random numbers
  fusion run drive.toml --out results --smooth   smoothed.csv too: what all of the log says of each epoch
  fusion run drive.toml --out results --checkpoint saved --every '10 s'
  fusion run drive.toml --out results --resume saved    goes on after a crash or a kill
  fusion run drive.toml --strict                 exit code 3 unless the filter was in good health
  fusion run drive.toml --ignore nis-small --fix drive2.toml    a copy with the edits of the other findings")]
    Run(run::RunArgs),
    /// Run a design on live links: instruments and programs that send rows while it runs.
    ///
    /// The tables [link.NAME] of the design say where bytes come from and which sources read them, [output.NAME] which
    /// estimates leave and how often. It runs until its links end, until `--for`, or until SIGINT or SIGTERM; then it
    /// writes its results as `fusion run` does. A link that is lost is opened again.
    #[command(after_long_help = "\
Examples:
  fusion live boat.toml --record dive.mcap --out results
  fusion run boat.toml --replay dive.mcap    the same estimates from the record, to the last bit
  fusion live boat.toml --record dive.mcap --out results --checkpoint saved --every '10 s'
  fusion live boat.toml --record dive.mcap --out results --checkpoint saved --resume saved    after a kill
  fusion live boat.toml --for '60 s' --status '1 s'")]
    Live(live::LiveArgs),
    /// Check a design and show its resolved form, without running it.
    ///
    /// Shows the state layout, sensors, stages, initialisers, sources and faults. The exit code is
    /// 2 if the design has a mistake, or an existing data file does not fit it. A missing data file
    /// is shown as `not found` and is not a mistake. All variants of the file are checked, the
    /// unselected variants separately. All mistakes are reported in one run.
    ///
    /// With `--data` the recorded data are read, and channels of the same motion are compared:
    /// velocity with position, angular rate and specific force with velocity and attitude, and heading
    /// with course. Lever arms are compared with the estimates of this filter. If the data clearly
    /// contradict an axis, a sign or a unit, a warning says what to write instead.
    #[command(after_long_help = "\
Examples:
  fusion check drive.toml
  fusion check drive.toml --data ~/logs/drive-3
  fusion check drive.toml --data ~/logs/drive-3 --fix drive2.toml    a copy with the corrections
  fusion check drive.toml --variant ekf --resolved    every value with its file and line
  fusion check drive.toml --variant ekf --set sensor.wheel.enabled=false
  fusion check drive.toml --observability     what the simulated motion determines
  fusion check drive.toml --data ~/logs/drive-3 --observability --without gnss_velocity")]
    Check(check::CheckArgs),
    /// List the blocks that designs are made of, or describe one.
    #[command(after_long_help = "\
Examples:
  fusion blocks                  every block by role, a line each
  fusion blocks gnss_position    its fields, their units and defaults, and an example")]
    Blocks(blocks::BlocksArgs),
    /// Write a first design: commented, made of parts of the library, ready to run in simulation.
    ///
    /// Writes NAME.toml, and the parts that it includes to the folder `parts` next to it. Existing
    /// files are not overwritten.
    #[command(after_long_help = "\
Examples:
  fusion new --list                 the vehicles and parts that there are
  fusion new mycar --from car       writes mycar.toml
  fusion new --part gnss/neo-m8     writes another part, to include in it
  fusion run mycar.toml             runs it, simulated")]
    New(new::NewArgs),
    /// Run variants of a design, or several designs, on the same data, side by side.
    #[command(after_long_help = "\
Examples:
  fusion compare configs/ins-gps-outlier.toml --variant base,no-gate,dead-reckoning
  fusion compare one.toml other.toml --data ~/logs/drive-3
  fusion compare drive.toml --variant base,outages --set filter.backend=ekf
  fusion compare drive.toml --backend ekf,error_state,iekf,invariant,invariant+iterated,ukf")]
    Compare(compare::CompareArgs),
    /// Find the first measurement that two designs, or two versions of the program, treat differently.
    ///
    /// Compares each measurement of the two runs: its row, and all numbers that the filter computes of it before the
    /// update, to the last bit. The exit code is 3 if they differ. To compare versions, each writes a ledger.
    #[command(after_long_help = "\
Examples:
  fusion bisect drive.toml drive2.toml
  fusion bisect drive.toml --variant base,no-gate
  fusion run drive.toml --ledger old.ledger     with the old version
  fusion bisect old.ledger drive.toml           with the new one
  fusion bisect boat.toml --backend ekf,iekf --replay dive.mcap")]
    Bisect(bisect::BisectArgs),
    /// Look at unknown logs: columns, units, rates, gaps, an inertial unit and its mounting in the
    /// vehicle; and write a first design.
    ///
    /// Shows the reason of each guess. It finds columns of time and of the quantities that a filter can use,
    /// their units, gaps, repeated and empty rows. For an inertial unit it shows which axis of the
    /// accelerometers points up, which axis points ahead, and what accelerometers and gyros read at rest.
    /// It checks whether gyros and course agree, and how late the positions are. The design that `--write`
    /// makes explains every guess in a comment. Compare the guesses with the data sheets of your
    /// instruments: a guess is not a measurement.
    #[command(after_long_help = "\
Examples:
  fusion inspect ~/logs/drive-3                          every .csv, .csv.gz and .txt of the folder
  fusion inspect imu.csv gnss.csv --write first.toml     and a first design
  fusion run first.toml")]
    Inspect(inspect::InspectArgs),
    /// Run a design many times with independent seeds: spread of the errors, NEES and NIS.
    ///
    /// Runs in parallel. The seed of a run depends only on the seed of the campaign and on the number
    /// of the run. So runs.csv is the same for any number of threads.
    ///
    /// Counts are sums over the runs. `longest streak` is the largest number of measurements rejected
    /// in a row in any run, `lasting` the longest time of such a streak. `end denied` counts the runs
    /// at the end of which the gate denied the sensor. Innovations in runs.csv are in SI units.
    #[command(
        after_long_help = "\
Examples:
  fusion montecarlo configs/ins-gps-outlier.toml -n 100
  fusion montecarlo drive.toml -n 20 --variant no-gate --seed 7 --out results",
        visible_alias = "mc"
    )]
    Montecarlo(montecarlo::MonteCarloArgs),
    /// Join the parts of a campaign, a comparison or a stress that several processes or machines have run.
    ///
    /// Tables and files are those of one process, for any parts in any order; memory does not grow with the rows. Parts
    /// of another command, design, seed, program or platform are refused, and so are numbers that are missing or in two
    /// parts. For parts that are cut or missing, the message has the command that writes them.
    #[command(after_long_help = "\
Examples:
  fusion montecarlo drive.toml --runs 0..50 --part a.cbor      on one machine
  fusion montecarlo drive.toml --runs 50..100 --part b.cbor    on another one
  fusion merge a.cbor b.cbor --out results
  fusion stress drive.toml --draw 200 --runs 1..101 --part c.cbor    cases count from 1
  fusion compare a.toml b.toml --runs 0..50 --part d.cbor")]
    Merge(merge::MergeArgs),
    /// Write a crate in Rust, or a library for C, that assembles the filter of a design: no parser, no `std`.
    ///
    /// The program calls the constructors of the blocks with their numbers, bit by bit. With the same rows it has the
    /// estimates of the design with the kernel `portable`. Banks of hypotheses, filters inside stages and
    /// `order = "rewind"` are refused.
    #[command(after_long_help = "\
Examples:
  fusion compile car.toml --out car
  cd car && cargo build --release --target thumbv7em-none-eabihf")]
    Compile(compile::CompileArgs),
    /// Run a design under a catalogue of faults, one at a time and in random pairs: does it survive,
    /// and does it report its failures.
    ///
    /// First the design runs undisturbed. Then each fault of the catalogue is applied to each stream or
    /// channel that it fits, at one moment in motion, to recorded and simulated data alike. A case
    /// fails if the estimate is wrong beyond 3σ, or missing, for longer than its recovery time while the
    /// health of the filter is good. The exit code is then 3.
    ///
    /// `--draw N` draws N cases instead: from one to three faults at once, of any kind, size and moment,
    /// that end early enough to recover. It counts the cases that recovered, and those in which the health
    /// was wrong. The exit code is 3 if fewer recovered, or more were falsely good, than [stress.draw]
    /// allows. A case is a function of the seed and of its number: `--case 17` runs this case alone.
    ///
    /// The table [stress] of a design changes the catalogue: `[stress] at = "600 s"`,
    /// `[stress.fault.spike] size.value = 50`, `[stress.fault.ramp] enabled = false`.
    #[command(after_long_help = "\
Examples:
  fusion stress configs/ins-gps-outlier.toml
  fusion stress drive.toml --data ~/logs/drive-3 --only gap-5,spike --pairs 0
  fusion stress drive.toml --draw 200 --seed 3
  fusion stress drive.toml --draw 200 --seed 3 --case 17
  fusion stress drive.toml --out results    writes stress.csv with what --set repeats each case by")]
    Stress(stress::StressArgs),
    /// Find the noises that explain the innovations of logs best, without a reference.
    ///
    /// Fisher scoring over the likelihood of the innovations. Each noise has one factor. The rows of a sensor are
    /// thinned until its innovations are white; if too few are left, nothing is tuned and the exit code is 4. A noise
    /// that the log does not determine keeps its value. Each part of the log is judged by what the other parts give.
    ///
    /// With `--start`, the searches from several starts can be parts in several processes: each iteration of a search needs
    /// the one before, so one search stays whole.
    #[command(after_long_help = "\
Examples:
  fusion tune drive.toml --data ~/logs/drive-3
  fusion tune drive.toml --params 'gyro.noise,sensor.*.noise' --fix tuned.toml
  fusion tune drive.toml --data ~/logs/drive-3 --also ~/logs/drive-4    two logs, one set of noises
  fusion tune drive.toml --start 'sensor.gnss.noise=5 m' --runs 1..2 --part one.part    then `fusion merge` of all parts")]
    Tune(tune::TuneArgs),
    /// Show which share of each error comes from which source: noise, bias, start, slow error of each instrument.
    ///
    /// One run of the simulated design gives the gains of the filter. The errors of the simulated world are carried
    /// through its steps as covariances, without drawing them. So the result does not depend on luck, and takes the time
    /// of a few runs. Gates are outside of it: a rejected measurement of that run has gain 0.
    #[command(after_long_help = "\
Examples:
  fusion budget configs/ins-gps.toml
  fusion budget configs/ins-gps.toml --at '80 s,120 s'
  fusion budget configs/templates/car.toml --out results    writes budget.toml and budget.svg")]
    Budget(budget::BudgetArgs),
    /// Find the noises of an inertial unit from a log at rest: Allan deviation, N, B and K per axis.
    ///
    /// The overlapping Allan deviation of each axis is fitted by white noise N, bias instability B and
    /// random walk K of the bias, with weighted least squares. Copy the printed TOML into a design.
    #[command(after_long_help = "\
Examples:
  fusion allan rest.toml --data ~/logs/rest          the inertial channels that the design's sources declare
  fusion allan rest.csv --rate '100 Hz' --gyro gx,gy,gz --gyro-unit deg/s
  fusion allan rest.csv.gz --rate '100 Hz' --accelerometer ax,ay,az --accelerometer-unit '3.33 mg' --out results")]
    Allan(allan::AllanArgs),
    /// Write the simulated world of a design as a log: a CSV file for each stream, and a design that reads them.
    ///
    /// With this log the filter gives the same results as in simulation, except for its start. With
    /// `draw_start` the simulated filter starts at a random draw around the truth. Faults of the simulated
    /// streams are in the log.
    #[command(after_long_help = "\
Examples:
  fusion record configs/ins-gps.toml --out log
  fusion run log/design.toml")]
    Record(record::RecordArgs),
    /// Print the JSON Schema of a design, for editors that complete and check TOML, or that of summary.json.
    #[command(after_long_help = "\
Examples:
  fusion schema > fusion.schema.json

Then name it in the first line of a design:
  #:schema ./fusion.schema.json")]
    Schema {
        /// The schema of summary.json, the result of a run.
        #[arg(long)]
        summary: bool,
    },
}

/// How results are printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Tables for people.
    #[default]
    Text,
    /// The same tables as JSON, numbers in full precision.
    Json,
}

/// How results are printed.
#[derive(Debug, Default, Args)]
struct OutputArgs {
    /// Prints the tables as text, or as JSON with every number in full precision.
    #[arg(
        long,
        value_enum,
        default_value_t,
        hide_default_value = true,
        hide_possible_values = true,
        value_name = "text|json"
    )]
    format: Format,
}

impl OutputArgs {
    /// Writes a result to stdout, and its important warnings to stderr.
    fn print(&self, page: &Page) -> Result<(), Failure> {
        match self.format {
            Format::Text => print(&text::page(page, width())),
            Format::Json => print(&format!("{:#}\n", json::page(page))),
        }?;
        let mut warnings = Diagnostics::new();
        warnings.extend(page.warnings.iter().map(Diagnostic::warning));
        report(&warnings);
        Ok(())
    }
}

/// The number of characters in a line of stdout.
fn width() -> usize {
    /// Narrower lines leave no room for words and numbers; wider lines are hard to follow.
    const RANGE: (usize, usize) = (60, 140);
    if !std::io::stdout().is_terminal() {
        return text::WIDTH;
    }
    let found = terminal_size::terminal_size_of(std::io::stdout());
    found.map_or(text::WIDTH, |(terminal_size::Width(w), _)| usize::from(w).clamp(RANGE.0, RANGE.1))
}

/// The selected design.
#[derive(Clone, Debug, Default, Args)]
struct DesignArgs {
    /// The design; without a file, a built-in simulated design.
    config: Option<PathBuf>,
    /// Applies `[variant.NAME]` of the file; several in the given order, or as `A+B`.
    #[arg(long, value_name = "NAME")]
    variant: Vec<String>,
    /// Replaces one value, after all variants: `sensor.gnss.noise.sigma=3 m`.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// A backend in place of the table [filter]: `ekf`, `error_state`, `iekf`, `invariant`, `ukf`, or any chart, update
    /// and form, as in `left_invariant+iterated`. Before `--set`.
    #[arg(long, value_name = "A")]
    backend: Option<String>,
    /// Where relative source paths start, instead of at the design's `data_dir`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

impl DesignArgs {
    /// The design. Mistakes in unselected variants are warnings: they do not stop a run.
    fn read(&self) -> Result<Design, Diagnostics> {
        let file = self.load()?;
        let others = as_warnings(&variants(&file, &self.selection().names()));
        match self.design(&file, Missing::Told) {
            Ok(design) => {
                report(&others);
                Ok(design)
            }
            Err(mut d) => {
                d.extend(others.iter().cloned());
                Err(d)
            }
        }
    }

    /// Its options after the file, as a user types them.
    fn words(&self) -> Vec<String> {
        let mut words: Vec<String> = self.variant.iter().map(|name| format!("--variant {name}")).collect();
        words.extend(self.backend.iter().map(|name| format!("--backend {name}")));
        words.extend(self.set.iter().map(|set| format!("--set '{}'", set.replace('\'', r"'\''"))));
        words.extend(self.data.iter().map(|data| format!("--data {}", data.display())));
        words
    }

    /// The file with the parts it includes.
    fn load(&self) -> Result<Document, Diagnostics> {
        let (name, text, files) = match &self.config {
            None => (builtin::NAME.to_owned(), builtin::DESIGN.to_owned(), builtin::INCLUDED),
            Some(path) => (path.display().to_string(), read_text(path)?, Files::Disk),
        };
        let mut d = Diagnostics::new();
        let (mut document, mistakes) = Document::parse(&name, &text);
        d.extend(mistakes);
        d.extend(document.compose(Path::new(&name), files));
        // After syntax errors, further mistakes of a file are guesswork.
        d.unless_errors(document)
    }

    /// The changes to the file: variants, backend and values.
    fn selection(&self) -> Selection {
        Selection {
            variants: self.variant.clone(),
            backend: self.backend.clone(),
            set: self.set.clone(),
        }
    }

    /// The selected design of this file.
    fn design(&self, file: &Document, missing: Missing) -> Result<Design, Diagnostics> {
        let (document, mut d) = self.selection().over(file);
        match examine(document, &self.options(), missing) {
            Ok(design) => {
                report(&surprises(&design));
                d.unless_errors(design)
            }
            Err(more) => {
                d.extend(more.iter().cloned());
                Err(d)
            }
        }
    }

    fn options(&self) -> Options {
        Options {
            data: self.data.clone(),
            base: self.base(),
            ..Options::default()
        }
    }

    /// Where the design's own relative paths start.
    fn base(&self) -> PathBuf {
        let folder = self.config.as_ref().and_then(|p| p.parent()).filter(|p| !p.as_os_str().is_empty());
        folder.unwrap_or(Path::new(".")).to_path_buf()
    }
}

/// Turns mistakes into warnings, which do not stop a run.
fn as_warnings(mistakes: &Diagnostics) -> Diagnostics {
    let mut warnings = Diagnostics::new();
    warnings.extend(mistakes.iter().cloned().map(Diagnostic::into_warning));
    warnings
}

fn read_text(path: &Path) -> Result<String, Diagnostics> {
    let unreadable = |why: &str, help: &str| Diagnostic::error(format!("`{}` cannot be read: {why}", path.display())).help(help);
    let error = match read_piped_text(path) {
        Ok(text) => return Ok(text),
        Err(Unread::Because(why, help)) => unreadable(&why, help),
        Err(Unread::Missing) => {
            let mut other = path.to_path_buf();
            other.set_extension("toml");
            if other != path && other.exists() {
                unreadable("there is no such file", &format!("did you mean `{}`?", other.display()))
            } else {
                unreadable(
                    "there is no such file",
                    "name a design such as `configs/ins-gps.toml`, or none for the built-in one",
                )
            }
        }
    };
    Err(error.into())
}

/// Why a subcommand ended early.
enum Failure {
    /// Mistakes in the design or the data.
    Mistakes(Diagnostics),
    /// stdout could not be written.
    Output(std::io::Error),
    /// A filter was in bad health, with `--strict`.
    Health,
    /// The filter failed under stress, which was reported before.
    Stress,
    /// The rows of a log are not independent, which was reported before.
    Dependent,
    /// Two runs differ, which was reported before.
    Difference,
}

impl From<Diagnostics> for Failure {
    fn from(mistakes: Diagnostics) -> Self {
        Self::Mistakes(mistakes)
    }
}

impl From<Diagnostic> for Failure {
    fn from(mistake: Diagnostic) -> Self {
        Self::Mistakes(mistake.into())
    }
}

impl From<Unwritable> for Failure {
    fn from(unwritable: Unwritable) -> Self {
        Self::Mistakes(unwritable.into())
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Output(error)
    }
}

/// Runs the command.
pub fn main() -> ExitCode {
    fusion_formats::link();
    fusion_live::link_blocks();
    #[cfg(feature = "ros2")]
    fusion_ros2::link();
    #[cfg(unix)]
    if let Err(error) = stop::watch() {
        report(&Diagnostic::warning(format!("a stop may leave unfinished files: {error}")).into());
    }
    let command = Cli::parse().command.unwrap_or_else(|| Command::Run(run::RunArgs::default()));
    let done = match command {
        Command::Allan(args) => allan::allan(&args),
        Command::Run(args) => run::run(&args),
        Command::Live(args) => live::live(&args),
        Command::Bisect(args) => bisect::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Blocks(args) => blocks::blocks(&args),
        Command::New(args) => new::new(&args),
        Command::Compare(args) => compare::compare(&args),
        Command::Inspect(args) => inspect::inspect(&args),
        Command::Montecarlo(args) => montecarlo::montecarlo(&args),
        Command::Budget(args) => budget::budget(&args),
        Command::Tune(args) => tune::tune(&args),
        Command::Merge(args) => merge::merge(&args),
        Command::Compile(args) => compile::compile(&args),
        Command::Stress(args) => stress::stress(&args),
        Command::Record(args) => record::record_world(&args),
        Command::Schema { summary: true } => print(&format!("{:#}\n", fusion::run::summary_schema())),
        Command::Schema { summary: false } => print(&format!("{:#}\n", fusion::schema::design())),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Mistakes(d)) => {
            report(&d);
            let errors = d.iter().filter(|d| d.severity == Severity::Error).count();
            if errors > 1 {
                report_line(&format!("\n{errors} mistakes"));
            }
            ExitCode::from(2)
        }
        Err(Failure::Health | Failure::Stress | Failure::Difference) => ExitCode::from(3),
        Err(Failure::Dependent) => ExitCode::from(4),
        // The reader of a pipe has stopped reading: `fusion schema | head`.
        Err(Failure::Output(e)) if e.kind() == std::io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(Failure::Output(e)) => {
            report(&Diagnostic::error(format!("the output cannot be written: {e}")).into());
            ExitCode::FAILURE
        }
    }
}

/// Writes results to stdout.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Shows diagnostics on stderr, in colour on a terminal.
fn report(d: &Diagnostics) {
    if !d.is_empty() {
        report_line(&d.render(std::io::stderr().is_terminal()));
    }
}

fn report_line(text: &str) {
    // If stderr cannot be written either, the message is lost.
    let _ = writeln!(std::io::stderr(), "{text}");
}
