//! The samples of a log at rest. They come from the sources of a design or from a plain table.

use crate::inspect::{Clock, stated_unit};
use core::ops::Range;
use flate2::bufread::MultiGzDecoder;
use fusion::config::{Diagnostic, Diagnostics, Node, Place};
use fusion::rows::{DataError, SourceError, width};
use fusion::source::table::{LogTable, gps_of_text};
use fusion::source::{OpenContext, SourceSpec};
use fusion_core::math;
use fusion_models::registry::{self, Role};
use fusion_models::units::STANDARD_GRAVITY;
use fusion_models::vocabulary::channel;
use fusion_tables::short;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The instrument that gives the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instrument {
    /// Angular rate \[rad/s\].
    Gyro,
    /// Specific force \[m/s²\].
    Accelerometer,
}

/// Three axes, evenly spaced.
#[derive(Clone, Debug)]
pub struct Log {
    /// The instrument.
    pub instrument: Instrument,
    /// The source or file.
    pub name: String,
    /// Time between two samples \[s\].
    pub interval: f64,
    /// The axes x, y, z in SI, with equal lengths.
    pub axes: [Vec<f64>; 3],
    /// Number of gaps in time. If there are gaps, the log holds only the longest piece between them.
    pub gaps: usize,
    /// Why the columns were read as increments and divided by the interval; `None` if they were not.
    pub increments: Option<String>,
}

impl Log {
    /// The length of the mean vector of the three axes.
    pub(super) fn force(&self) -> f64 {
        let mean = |axis: &Vec<f64>| axis.iter().sum::<f64>() / axis.len() as f64;
        math::sqrt(self.axes.iter().map(|axis| math::powi(mean(axis), 2)).sum::<f64>())
    }
}

/// Three columns of a plain table.
#[derive(Clone, Debug)]
pub struct Columns {
    /// The instrument.
    pub instrument: Instrument,
    /// Their names, x, y, z.
    pub names: [String; 3],
    /// The value of one unit of the column in SI.
    pub factor: f64,
}

/// Converts columns that hold increments over the interval into rates. There are three kinds: columns whose names state
/// a unit of velocity or angle; accelerometers whose length equals gravity only after division by the interval; and,
/// next to such accelerometers, gyros whose names state no unit.
fn as_rates(mut logs: Vec<Log>, wanted: &[Columns]) -> Vec<Log> {
    let is_gravity = |length: f64| (0.95..1.05).contains(&(length / STANDARD_GRAVITY));
    let by_gravity = |log: &Log| {
        let length = log.force();
        (log.instrument == Instrument::Accelerometer && !is_gravity(length) && is_gravity(length / log.interval)).then(|| {
            let (each, all) = (short(length), short(length / log.interval));
            format!("the mean is {each} long, and over the interval {all} m/s^2, as gravity")
        })
    };
    let beside = logs.iter().find_map(by_gravity);
    for (log, of) in logs.iter_mut().zip(wanted) {
        let stated = stated_unit(&of.names[0]);
        let by_name = match (log.instrument, stated) {
            (Instrument::Gyro, Some("rad" | "deg")) | (Instrument::Accelerometer, Some("m/s")) => {
                Some("their names state its unit".to_owned())
            }
            (Instrument::Gyro, None) => beside.as_ref().map(|_| "those of the accelerometers do".to_owned()),
            _ => None,
        };
        log.increments = by_gravity(log).or(by_name);
        if log.increments.is_some() {
            log.axes.iter_mut().flatten().for_each(|x| *x /= log.interval);
        }
    }
    logs
}

/// A time in a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// Seconds from the first sample on.
    Elapsed(f64),
    /// A stamp \[s\], of a calendar or of GPS weeks in GPS time.
    Stamp(f64),
}

impl Moment {
    /// `120` counts from the beginning, `@1520530308.5` is a stamp in seconds, `2025-07-08T19:34:18Z` is a calendar
    /// stamp.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let number = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
        match text.strip_prefix('@') {
            Some(stamp) => number(stamp).map(Self::Stamp),
            None => number(text).map(Self::Elapsed).or_else(|| gps_of_text(text).map(Self::Stamp)),
        }
    }

    /// The stamp of the moment in a log that begins at `first`.
    const fn of(self, first: f64) -> f64 {
        match self {
            Self::Elapsed(since) => first + since,
            Self::Stamp(stamp) => stamp,
        }
    }
}

/// The part of a log that is used.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// Samples before this moment are left out.
    pub from: Option<Moment>,
    /// The first sample at or after this moment ends the part.
    pub to: Option<Moment>,
}

impl Part {
    /// The samples of the part, by their stamps.
    fn of(self, times: &[f64]) -> Range<usize> {
        let first = times.first().copied().unwrap_or_default();
        let place = |moment: Moment| times.partition_point(|t| *t < moment.of(first));
        let (begin, end) = (self.from.map_or(0, place), self.to.map_or(times.len(), place));
        begin.min(end)..end
    }
}

/// The inertial channels of the sources that a design declares under `[source]`. Each source is opened as the design
/// declares. If `only` is given, only the source of this name is read.
///
/// # Errors
/// Mistakes in the declarations or in the data; no inertial channel.
pub fn declared(root: &Node, data_dir: &Path, only: Option<&str>, part: Part) -> Result<Vec<Log>, Diagnostics> {
    fusion_models::link();
    let sources = root.get("source").map_or(&[][..], Node::entries);
    let names: Vec<&str> = sources.iter().map(|s| s.key.as_str()).collect();
    if let Some(only) = only.filter(|only| !names.contains(only)) {
        let unknown = Diagnostic::error(format!("there is no source `{only}`")).at(root.place());
        return Err(unknown.suggest(only, &names, "there are").into());
    }
    let (mut d, mut logs) = (Diagnostics::new(), Vec::new());
    for source in sources.iter().filter(|s| only.is_none_or(|only| only == s.key)) {
        let mut node = source.node.clone();
        drop(node.take("fault"));
        let context = OpenContext {
            data_dir: data_dir.to_owned(),
            name: source.key.clone(),
            ..OpenContext::default()
        };
        let Some(spec) = node.read_block::<dyn SourceSpec>("source", &registry::names(Role::Source), &mut d) else {
            continue;
        };
        match read(spec.as_ref(), &context, part) {
            Ok(found) => logs.extend(found),
            Err(error) => d.extend(error.diagnostics(&node)),
        }
    }
    if logs.is_empty() && !d.has_errors() {
        let help =
            "declare one in a source: `[source.imu.channels] angular_rate = { columns = [\"gx\", \"gy\", \"gz\"], unit = \"deg/s\" }`";
        let message = "no source has a channel `angular_rate` or `specific_force`";
        d.push(Diagnostic::error(message).at(root.place()).help(help));
    }
    d.unless_errors(logs)
}

/// The inertial channels of one source.
fn read(spec: &dyn SourceSpec, context: &OpenContext, part: Part) -> Result<Vec<Log>, SourceError> {
    let wanted = [
        (Instrument::Gyro, channel::ANGULAR_RATE),
        (Instrument::Accelerometer, channel::SPECIFIC_FORCE),
    ];
    let is_wanted = |name: &str| wanted.iter().any(|(_, channel)| channel.name == name);
    if !spec.channels()?.iter().any(|p| is_wanted(&p.channel.name)) {
        return Ok(Vec::new());
    }
    let mut rows = spec.open(context)?;
    let provided = rows.channels().to_vec();
    let found: Vec<(Instrument, usize)> = wanted
        .iter()
        .filter_map(|(of, channel)| Some((*of, provided.iter().find(|p| p.channel.name == channel.name)?.offset)))
        .collect();
    let mut samples = vec![<[Vec<f64>; 3]>::default(); found.len()];
    let (mut times, mut row) = (Vec::new(), Vec::with_capacity(width(&provided)));
    while let Some(stamp) = rows.next(&mut row)? {
        let is_whole = |(_, at): &(Instrument, usize)| row[*at..at + 3].iter().all(|x| x.is_finite());
        if !found.iter().all(is_whole) {
            continue;
        }
        times.push(stamp.time.seconds());
        for ((_, at), axes) in found.iter().zip(&mut samples) {
            axes.iter_mut().zip(&row[*at..]).for_each(|(axis, x)| axis.push(*x));
        }
    }
    let Some((piece, interval, gaps)) = longest_piece(&times, part) else {
        return Err(DataError::new(&context.name, "there are fewer than three samples, or between `--from` and `--to`").into());
    };
    let log = |((instrument, _), axes): (&(Instrument, usize), [Vec<f64>; 3])| Log {
        instrument: *instrument,
        name: context.name.clone(),
        interval,
        axes: axes.map(|axis| axis[piece.clone()].to_vec()),
        gaps,
        increments: None,
    };
    Ok(found.iter().zip(samples).map(log).collect())
}

/// The longest piece of a part without a gap, its mean interval, and the number of gaps. A gap is an interval of more
/// than one and a half times the median. One missing sample makes an interval of twice the median.
fn longest_piece(all: &[f64], part: Part) -> Option<(Range<usize>, f64, usize)> {
    let part = part.of(all);
    let times = &all[part.clone()];
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = intervals.clone();
    sorted.sort_by(f64::total_cmp);
    let median = *sorted.get(sorted.len() / 2)?;
    let ends: Vec<usize> = (0..intervals.len())
        .filter(|k| intervals[*k] > 1.5 * median)
        .map(|k| k + 1)
        .collect();
    let starts = core::iter::once(0).chain(ends.iter().copied());
    let pieces = starts.zip(ends.iter().copied().chain([times.len()]));
    let (start, end) = pieces.max_by_key(|(start, end)| end - start)?;
    let interval = (times[end - 1] - times[start]) / (end - 1 - start) as f64;
    let piece = part.start + start..part.start + end;
    (end - start > 2 && interval > 0.0).then_some((piece, interval, ends.len()))
}

/// Columns of a table with a stamp column, which is found as in `fusion inspect`. Rows without a number are left out.
/// So are rows whose stamp is not later than the stamp of the row before.
///
/// # Errors
/// An unreadable file, no stamp column, a missing column, fewer than three samples.
pub fn stamped(path: &Path, wanted: &[Columns], part: Part) -> Result<Vec<Log>, Diagnostics> {
    let name = path.display().to_string();
    let table = LogTable::read(path).map_err(|error| {
        let mut d = Diagnostics::new();
        d.extend(error.of_file());
        d
    })?;
    let Some(clock) = Clock::named(&table) else {
        let message = format!("`{name}` has no column of stamps: none is called `t`, `time` or `timestamp`");
        let help = "add `--rate \"100 Hz\"`: every row is then one sample";
        return Err(Diagnostic::error(message).help(help).into());
    };
    let known: Vec<&str> = table.columns.iter().map(|c| c.name.as_str()).collect();
    let mut logs = Vec::new();
    for of in wanted {
        let columns = places(&name, &known, &of.names)?;
        let value = |k: usize, row: usize| table.columns[k].values[row] * of.factor;
        let (mut times, mut axes) = (Vec::new(), <[Vec<f64>; 3]>::default());
        for (row, stamp) in clock.stamps.iter().enumerate() {
            let is_later = times.last().is_none_or(|last| stamp > last);
            if stamp.is_finite() && is_later && columns.iter().all(|k| value(*k, row).is_finite()) {
                times.push(*stamp);
                axes.iter_mut().zip(&columns).for_each(|(axis, k)| axis.push(value(*k, row)));
            }
        }
        let Some((piece, interval, gaps)) = longest_piece(&times, part) else {
            let message = format!("`{name}` has fewer than three samples with stamps that rise, or between `--from` and `--to`");
            return Err(Diagnostic::error(message).into());
        };
        logs.push(Log {
            instrument: of.instrument,
            name: name.clone(),
            interval,
            axes: axes.map(|axis| axis[piece.clone()].to_vec()),
            gaps,
            increments: None,
        });
    }
    Ok(as_rates(logs, wanted))
}

/// The positions of the columns with these names.
fn places(file: &str, known: &[&str], names: &[String]) -> Result<Vec<usize>, Diagnostics> {
    let (mut d, mut places) = (Diagnostics::new(), Vec::new());
    for column in names {
        match known.iter().position(|k| k == column) {
            Some(place) => places.push(place),
            None => {
                let unknown = Diagnostic::error(format!("`{file}` has no column `{column}`"));
                d.push(unknown.suggest(column, known, "its columns"));
            }
        }
    }
    d.unless_errors(places)
}

/// Columns of a table with a header, comma-separated, plain or gzip-compressed, sampled every
/// `interval` seconds.
///
/// # Errors
/// An unreadable file, a missing column, a field that does not hold a number.
pub fn plain(path: &Path, interval: f64, wanted: &[Columns], part: Part) -> Result<Vec<Log>, Diagnostics> {
    let name = path.display().to_string();
    let failed = |why: &dyn std::fmt::Display| Diagnostic::error(format!("`{name}` cannot be read: {why}"));
    let bytes: Box<dyn Read> = {
        let file = BufReader::new(File::open(path).map_err(|e| failed(&e))?);
        if path.extension().is_some_and(|e| e == "gz") {
            Box::new(MultiGzDecoder::new(file))
        } else {
            Box::new(file)
        }
    };
    let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let header = table.headers().map_err(|e| failed(&e))?.clone();
    let known: Vec<&str> = header.iter().collect();
    let names: Vec<String> = wanted.iter().flat_map(|w| w.names.clone()).collect();
    let places = places(&name, &known, &names)?;
    let mut columns = vec![Vec::new(); places.len()];
    let mut record = csv::StringRecord::new();
    while table.read_record(&mut record).map_err(|e| failed(&e))? {
        for (column, place) in columns.iter_mut().zip(&places) {
            let text = record.get(*place).unwrap_or_default();
            let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
            let wrong = || {
                let line = record.position().map_or(0, |p| p.line() as usize);
                let message = format!("{text:?} in column `{}` is not a finite number", known[*place]);
                let help = "every row counts as one sample: cut the log to a piece without missing values";
                Diagnostic::error(message).at(&Place::row(&name, line)).help(help)
            };
            column.push(number.ok_or_else(wrong)?);
        }
    }
    let rows = columns.first().map_or(0, Vec::len);
    let piece = part.of(&(0..rows).map(|row| row as f64 * interval).collect::<Vec<_>>());
    let mut columns = columns.into_iter();
    let log = |of: &Columns| {
        let scaled = |column: Vec<f64>| column[piece.clone()].iter().map(|x| x * of.factor).collect();
        Log {
            instrument: of.instrument,
            name: name.clone(),
            interval,
            axes: core::array::from_fn(|_| columns.next().map(scaled).unwrap_or_default()),
            gaps: 0,
            increments: None,
        }
    };
    Ok(as_rates(wanted.iter().map(log).collect(), wanted))
}
