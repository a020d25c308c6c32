//! `fusion allan`.

use super::run::written;
use super::{Failure, Format, OutputArgs, print, read_text};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics, Document, Files};
use fusion::models::units::{Dimension, Dimensional, dim, parse, parse_unit};
use fusion::output::FileSet;
use fusion_advice::allan::{Columns, Instrument, Log, Moment, Part, Study, declared, plain, stamped, svg, toml};
use fusion_tables::Section;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct AllanArgs {
    /// A design (.toml) whose sources declare the inertial channels, or a table of columns (.csv, .csv.gz).
    log: PathBuf,
    /// Reads only this source of a design.
    #[arg(long, value_name = "NAME")]
    source: Option<String>,
    /// The folder where relative source paths of a design start, instead of its `data_dir`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The sample rate of a table without stamps, e.g. "100 Hz": every row is one sample. Without this option, the
    /// stamps are read from the column `t`, `time` or `timestamp`.
    #[arg(long, value_name = "RATE")]
    rate: Option<String>,
    /// The gyro columns of a table, x, y, z.
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', num_args = 1)]
    gyro: Vec<String>,
    /// The unit of the gyros of a table, with a factor if necessary: "0.05 deg/s".
    #[arg(long, value_name = "UNIT", default_value = "rad/s")]
    gyro_unit: String,
    /// The accelerometer columns of a table, x, y, z.
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', num_args = 1)]
    accelerometer: Vec<String>,
    /// The unit of the accelerometers of a table, with a factor if necessary: "3.33 mg".
    #[arg(long, value_name = "UNIT", default_value = "m/s^2")]
    accelerometer_unit: String,
    /// Leaves out the samples before this time, such as a warm-up. The time is seconds from the log's first sample, `@`
    /// and a stamp in seconds, or, for a log with a calendar, a date and time, `2025-07-08T19:34:18Z`.
    #[arg(long, value_name = "TIME", value_parser = moment)]
    from: Option<Moment>,
    /// Leaves out the samples from this time on, such as the way home: a time as for `--from`.
    #[arg(long, value_name = "TIME", value_parser = moment)]
    to: Option<Moment>,
    /// Writes allan.svg, allan.csv and noise.toml here; creates the folder if necessary.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

impl AllanArgs {
    const fn part(&self) -> Part {
        Part {
            from: self.from,
            to: self.to,
        }
    }
}

fn moment(text: &str) -> Result<Moment, String> {
    let expected = "expected seconds from the first sample, as 120, a stamp in seconds, as @1520530308.5, or a date and time";
    Moment::parse(text).ok_or_else(|| expected.to_owned())
}

pub(super) fn allan(args: &AllanArgs) -> Result<(), Failure> {
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let logs = if args.log.extension().is_some_and(|e| e == "toml") {
        of_design(args)?
    } else {
        of_table(args)?
    };
    let studies = logs.iter().map(Study::of).collect::<Result<Vec<_>, _>>()?;
    let mut page = Study::page(&studies);
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("allan.svg", |file| file.write_all(svg(&studies).as_bytes()))?;
        files.write("allan.csv", |file| {
            writeln!(file, "log,instrument,axis,tau,sigma,fit")?;
            for study in &studies {
                for (name, axis) in ["x", "y", "z"].iter().zip(&study.axes) {
                    for p in &axis.curve {
                        let (log, of, fit) = (&study.name, study.instrument, axis.noises.deviation(p.tau));
                        let log = log.replace('"', "\"\"");
                        writeln!(file, "\"{log}\",{of:?},{name},{},{},{fit}", p.tau, p.sigma)?;
                    }
                }
            }
            Ok(())
        })?;
        files.write("noise.toml", |file| file.write_all(toml(&studies).as_bytes()))?;
        files.commit()?;
        page.sections
            .push(written(["allan.svg", "allan.csv", "noise.toml"].map(|f| out.join(f))));
    }
    match args.output.format {
        // Not in the tables: a wrapped line could not be pasted.
        Format::Text => {
            args.output.print(&page)?;
            print(&format!("\n# For a design:\n{}", toml(&studies)))
        }
        Format::Json => {
            let paste = toml(&studies);
            page.sections
                .push(paste.lines().fold(Section::new("For a design", []), Section::note));
            args.output.print(&page)
        }
    }
}

fn of_design(args: &AllanArgs) -> Result<Vec<Log>, Diagnostics> {
    let mut d = Diagnostics::new();
    let (mut document, mistakes) = Document::parse(&args.log.display().to_string(), &read_text(&args.log)?);
    d.extend(mistakes);
    d.extend(document.compose(&args.log, Files::Disk));
    let document = d.unless_errors(document)?;
    let root = document.root();
    let folder = args.log.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let own = || folder.join(root.at("run.data_dir").and_then(|n| n.as_str()).unwrap_or_default());
    declared(root, &args.data.clone().unwrap_or_else(own), args.source.as_deref(), args.part())
}

fn of_table(args: &AllanArgs) -> Result<Vec<Log>, Diagnostics> {
    let mut d = Diagnostics::new();
    let kind = dim::Frequency::KIND;
    let rate = args
        .rate
        .as_deref()
        .map(|text| factor("--rate", text, kind.dimension, kind.example));
    let rate = rate.and_then(|rate| d.keep(rate));
    let given = [
        (Instrument::Gyro, "--gyro", &args.gyro, &args.gyro_unit, dim::AngularRate::KIND),
        (
            Instrument::Accelerometer,
            "--accelerometer",
            &args.accelerometer,
            &args.accelerometer_unit,
            dim::Acceleration::KIND,
        ),
    ];
    let mut wanted = Vec::new();
    for (instrument, option, names, unit, kind) in given {
        if names.is_empty() {
            continue;
        }
        let Ok(names) = <[String; 3]>::try_from(names.clone()) else {
            let message = format!("`{option}` takes three columns, not {}", names.len());
            d.push(Diagnostic::error(message).help(format!("write `{option} gx,gy,gz`, in the order x, y, z")));
            continue;
        };
        if let Some(factor) = d.keep(factor(&format!("{option}-unit"), unit, kind.dimension, kind.example)) {
            wanted.push(Columns { instrument, names, factor });
        }
    }
    if wanted.is_empty() && !d.has_errors() {
        let help = "add `--gyro gx,gy,gz`, `--accelerometer ax,ay,az`, or both; or name a design (.toml)";
        d.push(Diagnostic::error("a table needs the names of its columns").help(help));
    }
    d.unless_errors(())?;
    match rate {
        Some(rate) => plain(&args.log, 1.0 / rate, &wanted, args.part()),
        None => stamped(&args.log, &wanted, args.part()),
    }
}

/// SI value of a unit, or of a number with a unit, in an option.
fn factor(option: &str, text: &str, wanted: Dimension, example: &str) -> Result<f64, Diagnostic> {
    let refused =
        |why: String| Err(Diagnostic::error(format!("`{option}`: {why}")).help(format!("{} is expected, e.g. {example:?}", wanted.kind())));
    let is_number = text
        .trim_start()
        .starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
    match if is_number { parse(text) } else { parse_unit(text) } {
        Ok((si, dimension)) if dimension == wanted && si > 0.0 => Ok(si),
        Ok((_, dimension)) if dimension == wanted => refused(format!("{text:?} is not above zero")),
        Ok((_, dimension)) => refused(format!("{text:?} is {}", dimension.kind())),
        Err(why) => refused(why.to_string()),
    }
}
