//! A file as columns of numbers, before their meaning is declared.
//!
//! The rows come from the reader of the format. A cell that is not a number is NaN here; a row that
//! cannot be split into cells is counted and left out.
//!
//! Memory   all of the file, eight bytes for each cell

mod head;

use super::OpenContext;
use super::csv::CsvSpec;
use super::decode::{Origin, RawRows, Scale};
use super::format::{LogFormat, TEXT};
use crate::rows::{DataError, SourceError};
use fusion_models::block::BuildError;
use head::{Head, Names};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Possible delimiters of the fields of a text file, the usual delimiter first.
const DELIMITERS: [&str; 3] = [",", ";", "\t"];
/// The delimiter if the first line has none of these.
const BLANKS: &str = "blanks";

/// A file as columns of numbers.
#[derive(Clone, Debug, Default)]
pub struct LogTable {
    /// The file.
    pub path: PathBuf,
    /// The stream, if the file has several streams of unlike types.
    pub topic: Option<Topic>,
    /// The role of its rows, as far as its format knows it.
    pub role: Role,
    /// How it is written; text by default.
    pub format: &'static LogFormat,
    /// The delimiter of its fields.
    pub delimiter: String,
    /// The mark of its comments, if the file begins with comments.
    pub comment: Option<&'static str>,
    /// Whether a line names the columns.
    pub header: bool,
    /// Whether this line is the last comment before the first row.
    pub is_commented: bool,
    /// Names for the columns, if a name in the file belongs to several columns.
    pub names: Option<Vec<String>>,
    /// Lines that are skipped: after the line with the names, or, with `names`, at the beginning of the file.
    pub skip: usize,
    /// The column of the stamps, if several columns are possible.
    pub stamp: Option<usize>,
    /// The unit of the stamps, if the file does not tell it and other files do.
    pub unit: Option<&'static str>,
    /// A comment that states the rate, and the rate in samples per second.
    pub told: Option<(String, f64)>,
    /// Its columns.
    pub columns: Vec<LogColumn>,
    /// The name of the number that gives the rate, and the rate in samples per second. The first column then holds
    /// the stamps in nanoseconds.
    pub rate: Option<(String, f64)>,
    /// All arrays of a file of arrays, each with its shape.
    pub arrays: Vec<(String, String)>,
    /// Number of rows that cannot be split into one cell per column.
    pub malformed: usize,
    /// The damage at which the file ends.
    pub broken: Option<String>,
    /// Remarks of the file about itself, such as drop-outs of the logger.
    pub remarks: Vec<String>,
}

/// A stream of a file with several streams. A source of such a format has the key `topic`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, as a source declares it: `/imu/data`.
    pub name: String,
    /// The type of its messages, as the file names it: `sensor_msgs/msg/Imu`.
    pub message_type: String,
}

/// The role of rows, by the type of their messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Role {
    /// Names and values have to show it.
    #[default]
    Unknown,
    /// Measurements of an instrument.
    Measurement,
    /// The estimate of another filter.
    Estimate,
    /// The truth of a simulation.
    Truth,
    /// Something else: a setpoint, a state of the system, a statistic.
    Other,
}

/// A column.
#[derive(Clone, Debug, Default)]
pub struct LogColumn {
    /// The name used in declarations.
    pub name: String,
    /// Its first cell as written.
    pub first: String,
    /// A label that replaces the name: for a name with an index (`imu_acc_y` for `imu.acc(:,2)`), for a line of units
    /// below the names, for a number that replaces a repeated name, or with the unit of a message: `lat [1e-7 deg]`.
    pub label: Option<String>,
    /// The calendar, if it holds dates with the time of day.
    pub calendar: Option<Calendar>,
    /// Whether it holds times of day and no column has their dates: they are read with the date [`SOME_DAY`].
    pub is_time_of_day: bool,
    /// The numbers; for a calendar, nanoseconds of GPS time. NaN if a cell is not a number.
    pub values: Vec<f64>,
}

/// Dates with the time of day.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Calendar {
    /// The scale named in the cells, as designs write it; `utc` by default.
    pub scale: &'static str,
    /// The column of the date, if the cells hold only the time of day.
    pub date: Option<usize>,
}

/// The date used for times of day without a date.
pub const SOME_DAY: &str = "2000-01-01";

/// A second of GPS time as a date and time of day of UTC, such as `2025-07-08T19:34:18Z`.
#[must_use]
pub fn utc_text(gps_seconds: i64) -> String {
    super::decode::utc_text(gps_seconds)
}

/// Nanoseconds since 1970-01-01 UTC, without leap seconds as computers count, of nanoseconds of GPS time.
#[must_use]
pub fn unix_of_gps(nanos: i64) -> i64 {
    super::decode::unix_of_gps(nanos)
}

/// Seconds of GPS time of a date and time of day; UTC if the text names no scale.
#[must_use]
pub fn gps_of_text(text: &str) -> Option<f64> {
    Scale::guessed(text).map(|(_, count)| count as f64 * 1e-9)
}

/// Converts seconds since 1970-01-01 UTC to seconds of GPS time, with leap seconds; `None` beyond any log.
#[must_use]
pub fn gps_of_unix(seconds: f64) -> Option<f64> {
    let count = Origin::Unix.instant((seconds * 1e9) as i128)?;
    Some(count as f64 * 1e-9)
}

impl LogColumn {
    /// The label, or else the name.
    #[must_use]
    pub fn called(&self) -> &str {
        self.label.as_deref().unwrap_or(&self.name)
    }
}

impl LogTable {
    /// The name of its file, with the topic if the file has several streams.
    #[must_use]
    pub fn name(&self) -> String {
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        match &self.topic {
            Some(topic) => format!("{file} {}", topic.name),
            None => file.into_owned(),
        }
    }

    /// Reads a whole file with its [`LogFormat`].
    ///
    /// # Errors
    /// It cannot be opened or read.
    pub fn read_all(path: &Path) -> Result<Vec<Self>, SourceError> {
        (LogFormat::of(path)?.read)(path)
    }

    /// Reads the first table of a file.
    ///
    /// # Errors
    /// It cannot be opened or read.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let first = Self::read_all(path)?.into_iter().next();
        first.ok_or_else(|| DataError::new(path.display().to_string(), "there is no table in this file").into())
    }

    /// All rows of a file of this format, whose columns have names.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn of_rows(path: &Path, format: &'static LogFormat, rows: impl RawRows) -> Result<Self, SourceError> {
        let table = Self {
            path: path.to_owned(),
            format,
            header: true,
            ..Self::default()
        };
        table.filled(rows)
    }

    /// A topic of a log of messages, before its first row.
    #[must_use]
    pub fn of_topic(path: &Path, format: &'static LogFormat, topic: Topic, columns: &[String]) -> Self {
        let table = Self {
            path: path.to_owned(),
            topic: Some(topic),
            format,
            header: true,
            ..Self::default()
        };
        table.named(columns)
    }

    /// Reads all of a text file.
    ///
    /// # Errors
    /// It cannot be opened or read.
    pub(super) fn of_text(path: &Path) -> Result<Self, SourceError> {
        let head = Head::read(path)?;
        let Names { given, skip, labels } = head.names();
        let mut table = Self {
            path: path.to_owned(),
            format: &TEXT,
            delimiter: head.delimiter.to_owned(),
            comment: head.comment,
            header: head.has_header() || head.is_commented,
            is_commented: head.is_commented,
            names: given,
            skip,
            told: head.rate(),
            ..Self::default()
        };
        let rows = table.spec()?.raw(&OpenContext::default())?;
        table = table.filled(rows)?;
        for (column, label) in table.columns.iter_mut().zip(labels) {
            column.label = Some(label);
        }
        table.number_twins();
        Ok(table)
    }

    /// Names columns by their numbers if the file gives them the same name.
    fn number_twins(&mut self) {
        let names: Vec<String> = self.columns.iter().map(|c| c.name.clone()).collect();
        for (k, column) in self.columns.iter_mut().enumerate() {
            if names.iter().filter(|name| **name == names[k]).count() > 1 {
                column.name = (k + 1).to_string();
                column.label.get_or_insert(names[k].clone());
            }
        }
    }

    /// Adds all rows.
    fn filled(mut self, mut rows: impl RawRows) -> Result<Self, SourceError> {
        self = self.named(rows.columns());
        while rows.advance()? {
            self.add(&rows);
        }
        Ok(self)
    }

    /// With columns of these names, still empty.
    fn named(self, columns: &[String]) -> Self {
        let named = columns.iter().map(|name| LogColumn {
            name: name.clone(),
            ..LogColumn::default()
        });
        Self {
            columns: named.collect(),
            ..self
        }
    }

    /// Adds the current row of `row`.
    pub fn add(&mut self, row: &impl RawRows) {
        if row.malformed().is_some() {
            self.malformed += 1;
            return;
        }
        if self.rows() == 0 {
            for (k, column) in self.columns.iter_mut().enumerate() {
                column.first = row.cell(k).shown().into_owned();
            }
            self.find_calendars();
        }
        for (k, column) in self.columns.iter_mut().enumerate() {
            let cell = row.cell(k);
            let number = match &column.calendar {
                None => cell.number(),
                Some(_) if column.is_time_of_day => Scale::guessed_of_day(SOME_DAY, &cell.shown()).map(|(_, count)| count as f64),
                Some(calendar) => instant(calendar, row, k).map(|count| count as f64),
            };
            column.values.push(number.unwrap_or(f64::NAN));
        }
    }

    /// Finds the columns that hold dates, by their first cells.
    fn find_calendars(&mut self) {
        let first: Vec<String> = self.columns.iter().map(|c| c.first.clone()).collect();
        for (column, text) in self.columns.iter_mut().zip(&first) {
            let whole = Scale::guessed(text).map(|(scale, _)| (scale, None));
            let apart = || {
                let days = first.iter().enumerate();
                days.filter_map(|(k, day)| Some((Scale::guessed_of_day(day, text)?.0, Some(k))))
                    .next()
            };
            let alone = || Scale::guessed_of_day(SOME_DAY, text).map(|(scale, _)| (scale, None));
            column.is_time_of_day = whole.is_none() && apart().is_none() && alone().is_some();
            let found = whole.or_else(apart).or_else(alone);
            column.calendar = found.map(|(scale, date)| Calendar { scale: scale.name(), date });
        }
    }

    /// The number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }
}

/// The instant in a column of the current row, in nanoseconds of GPS time.
fn instant(calendar: &Calendar, row: &impl RawRows, column: usize) -> Option<i128> {
    let text = row.cell(column).shown();
    let read = match calendar.date {
        None => Scale::guessed(&text),
        Some(date) => Scale::guessed_of_day(&row.cell(date).shown(), &text),
    };
    Some(read?.1)
}

/// Returns true if a field is a stamp and not a number: a date with its time of day, a time of day, or a date whose
/// time of day is another of these fields.
fn is_stamp(field: &str, fields: &[String]) -> bool {
    let is_of = |date: &str, time: &str| Scale::guessed_of_day(date, time).is_some();
    Scale::guessed(field).is_some() || is_of(SOME_DAY, field) || fields.iter().any(|other| is_of(other, field) || is_of(field, other))
}

impl LogTable {
    /// The declaration of a file of which only the head is known; its column of time is a placeholder that is not read.
    fn spec(&self) -> Result<CsvSpec, SourceError> {
        let path = &self.path;
        let unreadable = |why: String| SourceError::from(DataError::new(path.display().to_string(), why));
        let Some(name) = path.to_str() else {
            return Err(BuildError::at("path", "the name of this file is not UTF-8 text").into());
        };
        let mut declared = toml::Table::new();
        let mut declare = |key: &str, value: toml::Value| declared.insert(key.to_owned(), value);
        declare("path", name.into());
        declare("delimiter", self.delimiter.as_str().into());
        let header = if self.is_commented { "comment".into() } else { self.header.into() };
        declare("header", header);
        self.comment.map(|comment| declare("comment", comment.into()));
        self.names.clone().map(|names| declare("names", names.into()));
        declare("skip", (self.skip as i64).into());
        declare("time", toml::Table::from_iter([("column".to_owned(), "1".into())]).into());
        CsvSpec::deserialize(declared).map_err(|e| unreadable(e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, text: &str) -> LogTable {
        let path = std::env::temp_dir().join(format!("fusion-table-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let table = LogTable::read(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        table
    }

    #[test]
    fn a_solution_of_rtklib_has_its_stamps_in_nanoseconds() {
        let header = "% program : RTKPOST\n%  GPST  latitude(deg) longitude(deg) height(m) Q\n";
        let rows = "2025/07/08 19:34:18.500 40.1 -105.2 1601.4 1\n2374 243259.750 40.2 -105.2 1601.5 2\n2025/07/08 lost\n";
        let table = of("solution.pos", &format!("{header}{rows}"));
        assert_eq!((table.format.name, table.rows(), table.malformed), ("rtklib", 2, 1));
        let names: Vec<&str> = table.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["time", "latitude(deg)", "longitude(deg)", "height(m)", "Q"]);
        // Week 2374 began on 6 July 2025; in double precision a stamp of today is known to 256 ns.
        let stamps = &table.columns[0].values;
        assert!((stamps[1] - stamps[0] - 1.25e9).abs() < 512.0, "{stamps:?}");
        assert_eq!(table.columns[1].values, [40.1, 40.2]);
    }

    #[test]
    fn names_are_taken_from_a_header_and_numbers_where_there_is_none() {
        let named = of("named", "t_s;x\n1;2\n2;lost\n3\n");
        assert_eq!(
            (named.delimiter.as_str(), named.header, named.rows(), named.malformed),
            (";", true, 2, 1)
        );
        assert_eq!((named.columns[1].name.as_str(), named.columns[1].first.as_str()), ("x", "2"));
        assert!(named.columns[1].values[1].is_nan());
        let bare = of("bare", "1,2\n3,4\n");
        assert_eq!((bare.header, bare.rows(), bare.columns[1].name.as_str()), (false, 2, "2"));
    }
}
