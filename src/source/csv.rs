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
//!          in the first row, after an unreadable stamp and where the gap exceeds 1.5 intervals
//! Memory   one row; a quotation mark that is never closed makes the rest of the file that row
//! Not here fields separated by runs of blanks, calendar dates, stamps in two columns (week and
//!          seconds), decimal commas

mod clock;
mod declaration;
mod lines;
mod plan;
#[cfg(test)]
mod tests;

pub use declaration::CsvSpec;

use super::report::Tally;
use super::{DataError, OpenContext, ProvidedChannel, Source, SourceError, SourceReport, SourceSpec, width};
use crate::config::did_you_mean;
use ::csv::{ByteRecord, Reader, ReaderBuilder, Trim};
use clock::Clock;
use core::fmt;
use declaration::{Cell, Condition, Policy, Repeats, Ties};
use flate2::bufread::MultiGzDecoder;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use lines::Lines;
use plan::Plan;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// A gap longer than this many nominal intervals is one.
const GAP: f64 = 1.5;
/// What a gzip file begins with (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];
const BUFFER: usize = 1 << 16;
/// Characters of a cell that messages show.
const LONGEST_SHOWN: usize = 40;

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

/// A condition whose column is known.
#[derive(Debug)]
struct Test {
    column: usize,
    equals: Option<Vec<Cell>>,
    at_least: Option<f64>,
    at_most: Option<f64>,
}

impl Test {
    fn new(condition: &Condition, column: usize) -> Self {
        let equals = condition.equals.as_ref().map(|cells| cells.0.clone());
        Self {
            column,
            equals,
            at_least: condition.at_least,
            at_most: condition.at_most,
        }
    }

    /// Whether the cell meets it; `None` where a number is wanted and the cell holds none.
    fn holds(&self, cell: &str) -> Option<bool> {
        let number = cell.parse::<f64>().ok();
        let is_equal = self.equals.as_ref().map_or(Some(true), |wanted| {
            let texts = wanted.iter().any(|w| matches!(w, Cell::Text(text) if text == cell));
            let numbers = wanted.iter().any(|w| matches!((w, number), (Cell::Number(w), Some(n)) if *w == n));
            let wants_text = wanted.iter().any(|w| matches!(w, Cell::Text(_)));
            (texts || numbers || wants_text || number.is_some()).then_some(texts || numbers)
        });
        let is_within = match (self.at_least, self.at_most) {
            (None, None) => Some(true),
            (least, most) => number.map(|n| least.is_none_or(|least| n >= least) && most.is_none_or(|most| n <= most)),
        };
        Some(is_equal? && is_within?)
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

/// What becomes of a row.
enum Verdict {
    Used(Time),
    /// Left out as declared.
    Left(&'static str),
    /// Left out, or the end, by a policy; what is wrong, what to do.
    Wrong {
        policy: Policy,
        reason: &'static str,
        message: String,
        help: String,
    },
    /// The declared end.
    End,
}

/// How rows are read.
#[derive(Debug)]
struct Row {
    file: String,
    header: Vec<String>,
    time_column: usize,
    clock: Clock,
    bad_rows: Policy,
    backwards: Policy,
    ties: Ties,
    drops_repeats: bool,
    needs_interval: bool,
    /// The nominal interval [s].
    nominal: Option<f64>,
    keep: Option<declaration::Keep>,
    valid: Vec<Test>,
    /// Column and sign of every cell that a channel reads.
    cells: Vec<(usize, f64)>,
    raw: Vec<f64>,
    last_raw: Option<Vec<f64>>,
    channels: Vec<(core::ops::Range<usize>, Plan)>,
    /// The last stamp in order.
    stamp: Option<i64>,
    /// Whether no row since had an unreadable stamp.
    is_interval_known: bool,
}

const SKIP_BAD: &str = "to leave such rows out and have them counted, write `bad_rows = \"skip\"`";

impl Row {
    /// Judges and converts row `number` of the file, from 0.
    fn read(&mut self, number: u64, record: &ByteRecord, row: &mut Vec<f64>) -> Verdict {
        if self.keep.is_some_and(|keep| !keep.keeps(number)) {
            return Verdict::Left("not among the rows to keep");
        }
        let (fields, named) = (record.len(), self.header.len());
        let is_trailing = fields == named + 1 && record.get(named).is_some_and(<[u8]>::is_empty);
        if fields != named && !is_trailing {
            self.is_interval_known = false;
            let few = if fields < named {
                "is it cut off?"
            } else {
                "is there a delimiter, or a decimal comma, within a field?"
            };
            return self.bad(
                format!("this row has {fields} field{}, not {named}", if fields == 1 { "" } else { "s" }),
                Some(few),
            );
        }
        let stamp = match text(record, self.time_column).map_or(Err("is not text"), |text| self.clock.read(text)) {
            Ok(stamp) => stamp,
            Err(what) => {
                self.is_interval_known = false;
                return self.bad(self.complaint(record, self.time_column, what), None);
            }
        };
        if let Some(verdict) = self.out_of_order(stamp) {
            return verdict;
        }
        let was_known = core::mem::replace(&mut self.is_interval_known, true);
        let previous = self.stamp.replace(stamp).filter(|_| was_known);
        if stamp < self.clock.start {
            return Verdict::Left("before the declared start");
        }
        if stamp >= self.clock.stop {
            return Verdict::End;
        }
        for test in &self.valid {
            match text(record, test.column).and_then(|text| test.holds(text)) {
                Some(true) => {}
                Some(false) => return Verdict::Left("not valid as declared"),
                None => return self.bad(self.complaint(record, test.column, "is not a number"), None),
            }
        }
        for (&(column, sign), raw) in self.cells.iter().zip(&mut self.raw) {
            let number = text(record, column).and_then(|text| text.parse::<f64>().ok());
            match number.filter(|number| number.is_finite()) {
                Some(number) => *raw = sign * number,
                None => {
                    let what = if number.is_some() { "is not finite" } else { "is not a number" };
                    return self.bad(self.complaint(record, column, what), None);
                }
            }
        }
        if self.drops_repeats {
            if self.last_raw.as_ref() == Some(&self.raw) {
                return Verdict::Left("repeats the values before");
            }
            self.last_raw.get_or_insert_default().clone_from(&self.raw);
        }
        let Some(interval) = self.interval(previous, stamp) else {
            return Verdict::Left("first of its increments, over an unknown interval (declare `rate`)");
        };
        // A channel makes as many numbers as it reads cells, so that both lie alike.
        for (at, plan) in &mut self.channels {
            if let Err(wrong) = plan.convert(&self.raw[at.clone()], interval, &mut row[at.clone()]) {
                return self.bad(wrong.message, wrong.help);
            }
        }
        Verdict::Used(Time::from_nanos(stamp))
    }

    fn out_of_order(&self, stamp: i64) -> Option<Verdict> {
        let last = self.stamp.filter(|last| stamp <= *last)?;
        let (now, before) = (Time::from_nanos(stamp), Time::from_nanos(last));
        if stamp < last {
            let message = format!("time runs backwards: {now} comes after {before}");
            let help = "sort the file, or leave such rows out: `time.backwards = \"skip\"`".to_owned();
            return Some(Verdict::Wrong {
                policy: self.backwards,
                reason: "time runs backwards",
                message,
                help,
            });
        }
        let policy = match self.ties {
            Ties::Keep => return None,
            Ties::Skip => Policy::Skip,
            Ties::Stop => Policy::Stop,
        };
        let message = format!("the stamp {now} is that of the row before");
        let help = "leave such rows out by `time.ties = \"skip\"`, or use them by `time.ties = \"keep\"`".to_owned();
        Some(Verdict::Wrong {
            policy,
            reason: "the stamp of the row before",
            message,
            help,
        })
    }

    /// Seconds that an increment covers; `None` where increments are wanted and it is unknown.
    fn interval(&self, previous: Option<i64>, stamp: i64) -> Option<f64> {
        if !self.needs_interval {
            return Some(1.0);
        }
        let since = previous.map(|previous| Time::from_nanos(stamp).seconds_since(Time::from_nanos(previous)));
        match (since, self.nominal) {
            (Some(since), Some(nominal)) if since > GAP * nominal => Some(nominal),
            (Some(since), _) => Some(since),
            (None, nominal) => nominal,
        }
    }

    fn bad(&self, message: String, help: Option<&str>) -> Verdict {
        let help = help.map_or_else(
            || SKIP_BAD.to_owned(),
            |help| format!("{help} {SKIP_BAD}").replacen("? to", "? To", 1),
        );
        Verdict::Wrong {
            policy: self.bad_rows,
            reason: "bad rows",
            message,
            help,
        }
    }

    /// What is wrong with a cell.
    fn complaint(&self, record: &ByteRecord, column: usize, what: &str) -> String {
        let content = String::from_utf8_lossy(record.get(column).unwrap_or_default());
        let shown: String = content.chars().take(LONGEST_SHOWN).collect();
        let name = self.header.get(column).map_or("", String::as_str);
        if shown.is_empty() {
            format!("column `{name}` is empty")
        } else {
            format!("`{shown}` in column `{name}` {what}")
        }
    }
}

fn text(record: &ByteRecord, column: usize) -> Option<&str> {
    core::str::from_utf8(record.get(column)?).ok()
}

impl declaration::Keep {
    const fn keeps(&self, number: u64) -> bool {
        match (self.every, self.except_every) {
            (Some(every), _) => number >= self.offset && (number - self.offset).is_multiple_of(every.get()),
            (None, Some(every)) => !(number >= self.offset && (number - self.offset).is_multiple_of(every.get())),
            (None, None) => true,
        }
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
        .line(line as usize)
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
