//! The batches of a file as rows.

use super::Batches;
use super::place::{Place, Places};
use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use core::fmt::Display;
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::{Cell, Malformed, RawRows};
use fusion::source::table::LogTable;
use fusion::source::{DataFile, LogFormat, OpenContext};
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// An error as text.
pub(super) fn text(error: impl Display) -> String {
    error.to_string()
}

/// The rows of a file of columns.
pub(super) struct Rows {
    columns: Vec<String>,
    places: Places,
    batches: Batches,
    batch: Option<RecordBatch>,
    /// The number of the current row in its batch.
    at: usize,
    count: usize,
    /// Why the file ends here.
    broken: Option<String>,
}

impl Rows {
    /// Opens a file.
    pub(super) fn new(file: &DataFile, open: impl FnOnce(File) -> Result<(SchemaRef, Batches), String>) -> Result<Self, SourceError> {
        let wrong = |why: String| DataError::new(file.name(), why);
        // The common reader says in words why a file cannot be opened.
        drop(file.bytes(&OpenContext::default())?);
        let bytes = File::open(file.path()).map_err(|error| wrong(error.to_string()))?;
        let (schema, mut batches) = guarded(|| open(bytes)).map_err(wrong)?;
        let (batch, broken) = match next(&mut batches) {
            Ok(batch) => (batch, None),
            Err(why) => (None, Some(why)),
        };
        let places = Places::of(schema.fields(), batch.as_ref());
        Ok(Self {
            columns: places.columns.iter().map(|place| place.name.clone()).collect(),
            places,
            batches,
            batch,
            // The first call of `advance` steps to the first row.
            at: usize::MAX,
            count: 0,
            broken,
        })
    }

    /// The whole file as a table.
    pub(super) fn table(self, path: &Path, format: &'static LogFormat) -> Result<LogTable, SourceError> {
        let is_time: Vec<bool> = self.places.columns.iter().map(|place| place.is_time).collect();
        let mut table = LogTable::of_rows(path, format, self)?;
        for (column, _) in table.columns.iter_mut().zip(is_time).filter(|(_, is_time)| *is_time) {
            column.label = Some(format!("{} [ns]", column.name));
        }
        Ok(table)
    }
}

/// The next batch with rows.
fn next(batches: &mut Batches) -> Result<Option<RecordBatch>, String> {
    loop {
        match guarded(|| batches.next().transpose())? {
            Some(batch) if batch.num_rows() == 0 => {}
            other => return Ok(other),
        }
    }
}

/// The libraries of both formats may panic on a damaged file: that is an error of the file.
fn guarded<T>(read: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err("the file is damaged".to_owned()))
}

impl RawRows for Rows {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn absent(&self, column: &str) -> Option<String> {
        let of = |name: &str| {
            column
                .strip_prefix(name)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        self.places.others.iter().find(|(name, _)| of(name)).map(|(_, why)| why.clone())
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.at = self.at.wrapping_add(1);
        self.count += 1;
        if self.batch.as_ref().is_some_and(|batch| self.at < batch.num_rows()) {
            return Ok(true);
        }
        if self.batch.take().is_some() && self.broken.is_none() {
            match next(&mut self.batches) {
                Ok(batch) => (self.batch, self.at) = (batch, 0),
                Err(why) => self.broken = Some(why),
            }
            return Ok(self.batch.is_some() || self.broken.is_some());
        }
        // A file that is damaged from the first row on ends with one row that says so.
        Ok(self.count == 1 && self.broken.is_some())
    }

    fn place(&self) -> usize {
        self.count
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let place: Option<&Place> = self.places.columns.get(column);
        let of = self.batch.as_ref().zip(place);
        of.map_or(super::cell::EMPTY, |(batch, place)| place.cell(batch, self.at))
    }

    fn malformed(&self) -> Option<Malformed> {
        self.broken.clone().filter(|_| self.batch.is_none()).map(|why| Malformed {
            message: why,
            help: "is the file cut off?",
            is_last: true,
        })
    }
}
