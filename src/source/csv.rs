//! Tables of text: one row per line, plain or gzip-compressed, read as a stream.
//!
//! ```toml
//! [source.imu]
//! type = "csv"
//! path = "drive/imu.csv.gz"
//! time = { column = "t_ns", unit = "ns", epoch = 1520530308000000000 }
//! rate = "100 Hz"
//! [source.imu.channels]
//! angular_rate = { columns = ["dthx", "dthy", "-dthz"], unit = "rad", increment = true }
//! specific_force = { columns = ["ax", "ay", "az"], unit = "g", rotation = { axes = ["-x", "y", "-z"] } }
//! ```
//!
//! Order    of the tests on a row: number in the file (`keep`), fields, stamp, time order, `start`
//!          and `stop`, `valid`, the cells that channels read, `repeats`. Cells that nobody reads
//!          are never looked at
//! Order    of a channel's arithmetic: sign, unit, `scale`, root of a variance, `offset`, increment
//!          to rate, rotation, mean with the previous sample
//! Interval of an increment: since the previous stamp in the file, be its row used or not; 1/`rate`
//!          in the first row, after an unreadable stamp and where the gap exceeds 1.5 intervals;
//!          always 1/`rate` with `interval = "nominal"`
//! Memory   one row; a quotation mark that is never closed makes the rest of the file that row
//! Not here fields separated by runs of blanks, calendar dates, stamps in two columns (week and
//!          seconds), decimal commas

mod clock;
mod declaration;
mod lines;
mod plan;
mod row;
#[cfg(test)]
mod tests;

pub use declaration::CsvSpec;

use super::report::Tally;
use super::{DataError, OpenContext, ProvidedChannel, Source, SourceError, SourceReport, SourceSpec, width};
use crate::config::did_you_mean;
use ::csv::{ByteRecord, Reader, ReaderBuilder, Trim};
use clock::Clock;
use core::fmt;
use declaration::{Interval, Policy, Repeats, Ties};
use flate2::bufread::MultiGzDecoder;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use lines::Lines;
use plan::Plan;
use row::{Row, Test, Verdict};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// What a gzip file begins with (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];
const BUFFER: usize = 1 << 16;

fusion_models::register!(
    Source,
    "csv",
    CsvSpec,
    r#"
path = "drive/gnss.csv"
time = { column = "t_s", unit = "s" }
valid = { column = "q", equals = 1 }
[channels.position]
latitude = "lat_deg"
longitude = "lon_deg"
height = "h_m"
unit = "deg"
[channels.velocity]
columns = ["vn_mps", "ve_mps", "vd_mps"]
unit = "m/s"
latency = "0.13 s"
"#
);

type Records = Reader<Lines<Box<dyn Read + Send>>>;

impl CsvSpec {
    /// Everything that can be checked without the file.
    fn plan(&self) -> Result<(Clock, Vec<Plan>), Vec<BuildError>> {
        let mut errors = Vec::new();
        let clock = Clock::new(&self.time, &mut errors);
        let plans: Vec<Plan> = self
            .channels
            .iter()
            .filter_map(|(name, spec)| Plan::new(name, spec, &mut errors))
            .collect();
        let mut one_byte = |field: &str, c: Option<char>| {
            if c.is_some_and(|c| !c.is_ascii() || matches!(c, '\n' | '\r' | '"')) {
                errors.push(BuildError::at(
                    field,
                    "this is one plain character, such as \",\", \";\" or \"\\t\"",
                ));
            }
        };
        one_byte("delimiter", Some(self.delimiter));
        one_byte("comment", self.comment);
        for condition in &self.valid.0 {
            if condition.equals.is_none() && condition.at_least.is_none() && condition.at_most.is_none() {
                let message = format!("no condition is set on column `{}`", condition.column);
                errors.push(BuildError::at("valid", message).help("add `equals`, `at_least` or `at_most`"));
            }
        }
        if self.keep.is_some_and(|keep| keep.every.is_some() == keep.except_every.is_some()) {
            errors.push(BuildError::at("keep", "rows are kept by `every` or by `except_every`"));
        }
        if self.interval == Interval::Nominal && self.rate.is_none() {
            errors.push(BuildError::at("interval", "a nominal interval needs the nominal `rate`"));
        }
        if let Some((name, _)) = self.channels.iter().find(|(_, channel)| channel.increment) {
            let message = |what: &str| format!("`{name}` holds increments, {what}");
            if self.keep.is_some() {
                errors.push(BuildError::at(
                    "keep",
                    message("and rows that are left out would take their motion with them"),
                ));
            }
            if self.time.ties == Ties::Keep {
                errors.push(BuildError::at("time.ties", message("which have no rate over no time")));
            }
        }
        if errors.is_empty() { Ok((clock, plans)) } else { Err(errors) }
    }

    fn provided(plans: &[Plan]) -> Vec<ProvidedChannel> {
        let mut offset = 0;
        let place = |plan: &Plan| {
            let at = offset;
            offset += plan.channel.width;
            ProvidedChannel {
                channel: plan.channel.clone(),
                offset: at,
                delay_ns: plan.delay_ns,
            }
        };
        plans.iter().map(place).collect()
    }

    fn reader(&self, path: &Path, context: &OpenContext) -> Result<Records, SourceError> {
        let unreadable = |error: std::io::Error| {
            let message = format!("`{}` cannot be read: {}", self.path.display(), in_words(&error));
            BuildError::at("path", message).help(whereabouts(path, context))
        };
        let file = File::open(path).map_err(unreadable)?;
        if file.metadata().is_ok_and(|m| m.is_dir()) {
            let message = format!("`{}` is a directory, not a file", self.path.display());
            return Err(BuildError::at("path", message).into());
        }
        let mut file = BufReader::with_capacity(BUFFER, file);
        let is_gzip = file.fill_buf().map_err(unreadable)?.starts_with(&GZIP);
        if !is_gzip && path.extension().is_some_and(|e| e == "gz") {
            let error = DataError::new(
                path.display().to_string(),
                "this file is not gzip-compressed, although its name ends in `.gz`",
            );
            return Err(error.help("copy or download it again, or rename it").into());
        }
        let bytes: Box<dyn Read + Send> = if is_gzip {
            Box::new(MultiGzDecoder::new(file))
        } else {
            Box::new(file)
        };
        let byte = |c: char| u8::try_from(c).unwrap_or(b',');
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).trim(Trim::All).buffer_capacity(BUFFER);
        Ok(builder
            .delimiter(byte(self.delimiter))
            .comment(self.comment.map(byte))
            .from_reader(Lines::new(bytes)))
    }
}

#[typetag::deserialize(name = "csv")]
impl SourceSpec for CsvSpec {
    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>> {
        self.plan().map(|(_, plans)| Self::provided(&plans))
    }

    fn open(&self, context: &OpenContext) -> Result<Box<dyn Source>, SourceError> {
        let (clock, mut plans) = self.plan()?;
        for plan in plans.iter_mut().filter(|plan| plan.needs_origin()) {
            let missing = || {
                let field = format!("channels.{}", plan.channel.name);
                let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
                BuildError::at(field, "metres north, east and down need an origin").help(help)
            };
            let origin = context.origin.ok_or_else(missing)?;
            plan.set_origin(origin);
        }
        let path = context.resolve(&self.path);
        let mut reader = self.reader(&path, context)?;
        let file = path.display().to_string();
        let mut record = ByteRecord::new();
        let no_rows = || SourceError::from(DataError::new(file.as_str(), "this file is empty"));
        let mut is_pending = false;
        let header: Vec<String> = match &self.names {
            Some(names) => names.clone(),
            None => {
                if !reader.read_byte_record(&mut record).map_err(|e| broken(&file, &e, 1))? {
                    return Err(no_rows());
                }
                is_pending = !self.header;
                let names = record.iter().map(|name| String::from_utf8_lossy(name).into_owned());
                if self.header {
                    names.collect()
                } else {
                    (1..=record.len()).map(|k| k.to_string()).collect()
                }
            }
        };
        let columns = Columns {
            header: &header,
            path: &self.path,
        };
        let mut errors = Vec::new();
        let time_column = columns.find("time.column", &self.time.column, false, &mut errors).0;
        let mut cells = Vec::new();
        let mut channels = Vec::new();
        for plan in plans {
            let start = cells.len();
            for (field, column) in &plan.columns {
                let field = format!("channels.{}.{field}", plan.channel.name);
                cells.push(columns.find(&field, column, true, &mut errors));
            }
            channels.push((start..cells.len(), plan));
        }
        let valid = self
            .valid
            .0
            .iter()
            .map(|c| Test::new(c, columns.find("valid", &c.column, false, &mut errors).0))
            .collect();
        if !errors.is_empty() {
            return Err(errors.into());
        }
        let plans: Vec<Plan> = channels.iter().map(|(_, plan)| plan.clone()).collect();
        Ok(Box::new(CsvSource {
            provided: Self::provided(&plans),
            row: Row {
                file,
                header,
                time_column,
                clock,
                bad_rows: self.bad_rows,
                backwards: self.time.backwards,
                ties: self.time.ties,
                drops_repeats: self.repeats == Repeats::Drop,
                needs_interval: plans.iter().any(|plan| plan.increment),
                nominal: self.rate.map(|rate| 1.0 / rate.si()),
                evenly: self.interval == Interval::Nominal,
                keep: self.keep,
                valid,
                raw: vec![0.0; cells.len()],
                last_raw: None,
                cells,
                channels,
                stamp: None,
                is_interval_known: false,
            },
            reader,
            record,
            is_pending,
            has_ended: false,
            tally: Tally::default(),
        }))
    }
}

/// The column names of a file.
struct Columns<'a> {
    header: &'a [String],
    path: &'a Path,
}

impl Columns<'_> {
    /// Number of a column and the sign before its name.
    fn find(&self, field: &str, name: &str, signed: bool, errors: &mut Vec<BuildError>) -> (usize, f64) {
        let at = |name: &str| self.header.iter().position(|known| known == name);
        if let Some(at) = at(name) {
            return (at, 1.0);
        }
        let bare = name.strip_prefix('-').filter(|_| signed);
        if let Some(at) = bare.and_then(at) {
            return (at, -1.0);
        }
        let known: Vec<&str> = self.header.iter().map(String::as_str).collect();
        let meant = did_you_mean(bare.unwrap_or(name), &known)
            .map(|meant| format!("did you mean `{meant}`? "))
            .unwrap_or_default();
        let error = BuildError::at(field, format!("`{}` has no column `{}`", self.path.display(), bare.unwrap_or(name)));
        errors.push(error.help(format!("{meant}its columns: `{}`", known.join("`, `"))));
        (0, 1.0)
    }
}

/// An open file.
struct CsvSource {
    provided: Vec<ProvidedChannel>,
    row: Row,
    reader: Records,
    record: ByteRecord,
    /// The record was read while looking for the header and is a row.
    is_pending: bool,
    has_ended: bool,
    tally: Tally,
}

impl fmt::Debug for CsvSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CsvSource").field("row", &self.row).finish_non_exhaustive()
    }
}

impl Source for CsvSource {
    fn channels(&self) -> &[ProvidedChannel] {
        &self.provided
    }

    fn next(&mut self, row: &mut Vec<f64>) -> Result<Option<Time>, SourceError> {
        if self.has_ended {
            return Ok(None);
        }
        let next = self.advance(row);
        self.has_ended = !matches!(next, Ok(Some(_)));
        next
    }

    fn report(&self) -> SourceReport {
        self.tally.report()
    }
}

impl CsvSource {
    /// The line of the record read last.
    fn line(&mut self) -> usize {
        let end = self.reader.position().byte();
        self.reader.get_mut().line(end)
    }

    fn advance(&mut self, row: &mut Vec<f64>) -> Result<Option<Time>, SourceError> {
        row.clear();
        row.resize(width(&self.provided), 0.0);
        loop {
            if !core::mem::take(&mut self.is_pending) {
                let read = self.reader.read_byte_record(&mut self.record);
                let line = self.line();
                if !read.map_err(|e| broken(&self.row.file, &e, line))? {
                    return self.end();
                }
            }
            let number = self.tally.rows();
            let line = self.line();
            match self.row.read(number, &self.record, row) {
                Verdict::Used(time) => {
                    self.tally.row();
                    self.tally.used(time);
                    return Ok(Some(time));
                }
                Verdict::Left(reason) => {
                    self.tally.row();
                    self.tally.skipped(reason, None);
                }
                Verdict::Wrong {
                    policy: Policy::Skip,
                    reason,
                    message,
                    ..
                } => {
                    self.tally.row();
                    self.tally.skipped(reason, Some((line, message)));
                }
                Verdict::Wrong {
                    policy: Policy::Stop,
                    message,
                    help,
                    ..
                } => {
                    return Err(DataError::new(self.row.file.as_str(), message).line(line).help(help).into());
                }
                Verdict::End => return self.end(),
            }
        }
    }

    /// The end, which is an error where nothing was delivered.
    fn end(&self) -> Result<Option<Time>, SourceError> {
        let report = self.tally.report();
        if report.used > 0 {
            return Ok(None);
        }
        let file = self.row.file.as_str();
        if report.rows == 0 && self.row.stamp.is_none() {
            return Err(DataError::new(file, "this file has a header, but no rows").into());
        }
        let reasons: Vec<String> = report.skipped.iter().map(|s| format!("{} × {}", s.count, s.reason)).collect();
        let why = if reasons.is_empty() {
            "the first is after the declared stop".to_owned()
        } else {
            reasons.join(", ")
        };
        let error = DataError::new(file, format!("no row of this file can be used: {why}"));
        let example = report.skipped.iter().flat_map(|s| &s.examples).next();
        Err(match example {
            Some(example) => error
                .line(example.line)
                .help(format!("this is the first one: {}", example.what))
                .into(),
            None => error.into(),
        })
    }
}

/// The file could not be read on.
fn broken(file: &str, error: &::csv::Error, line: usize) -> SourceError {
    let message = match error.kind() {
        ::csv::ErrorKind::Io(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => "the compressed file is cut off".to_owned(),
        ::csv::ErrorKind::Io(io) => format!("the file is damaged: {io}"),
        _ => format!("the file cannot be read: {error}"),
    };
    DataError::new(file, message)
        .line(line)
        .help("rows before were sound; copy or download it again")
        .into()
}

fn in_words(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        std::io::ErrorKind::PermissionDenied => "permission is denied".to_owned(),
        _ => error.to_string(),
    }
}

/// Where a missing file was looked for, and the one that was probably meant.
fn whereabouts(path: &Path, context: &OpenContext) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.parent().and_then(|parent| std::fs::read_dir(parent).ok());
    let beside = beside
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    let mut known: Vec<String> = beside.collect();
    known.sort_unstable();
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    match did_you_mean(&name, &known) {
        Some(meant) => format!("did you mean `{meant}`, beside it?"),
        None => format!("a relative path starts at the data directory, `{}`", context.data_dir.display()),
    }
}
