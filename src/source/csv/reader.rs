//! Lines of a text file as rows of cells.

use super::CsvSpec;
use super::lines::Lines;
use crate::rows::{DataError, SourceError};
use crate::source::OpenContext;
use crate::source::decode::{Cell, Malformed, RawRows};
use crate::source::file::{BUFFER, DataFile};
use ::csv::{ByteRecord, Error, ErrorKind, Reader, ReaderBuilder};
use std::io::Read;

/// An open file.
pub(super) struct CsvRows {
    file: String,
    columns: Vec<String>,
    reader: Reader<Lines<Box<dyn Read + Send>>>,
    record: ByteRecord,
    /// The line of the record.
    line: usize,
    /// The record was read while looking for the header and is a row.
    is_pending: bool,
}

impl CsvRows {
    /// Opens the file and reads the names of its columns.
    pub(super) fn open(spec: &CsvSpec, file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let byte = |c: char| u8::try_from(c).unwrap_or(b',');
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).buffer_capacity(BUFFER);
        builder.delimiter(byte(spec.delimiter)).comment(spec.comment.map(byte));
        let mut rows = Self {
            file: file.name(),
            columns: Vec::new(),
            reader: builder.from_reader(Lines::new(file.bytes(context)?)),
            record: ByteRecord::new(),
            line: 1,
            is_pending: false,
        };
        match &spec.names {
            Some(names) => rows.columns.clone_from(names),
            None => rows.read_columns(spec.header)?,
        }
        Ok(rows)
    }

    /// Takes the columns from the first line: their names, or how many there are.
    fn read_columns(&mut self, has_header: bool) -> Result<(), DataError> {
        if !self.read()? {
            return Err(DataError::new(self.file.as_str(), "this file is empty"));
        }
        self.is_pending = !has_header;
        self.columns = if has_header {
            self.record
                .iter()
                .map(|name| String::from_utf8_lossy(name.trim_ascii()).into_owned())
                .collect()
        } else {
            (1..=self.record.len()).map(|k| k.to_string()).collect()
        };
        Ok(())
    }

    fn read(&mut self) -> Result<bool, DataError> {
        let read = self.reader.read_byte_record(&mut self.record);
        let end = self.reader.position().byte();
        self.line = self.reader.get_mut().line(end);
        read.map_err(|error| self.broken(&error))
    }

    /// The file cannot be read on.
    fn broken(&self, error: &Error) -> DataError {
        let message = match error.kind() {
            ErrorKind::Io(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => "the compressed file is cut off".to_owned(),
            ErrorKind::Io(io) => format!("the file is damaged: {io}"),
            _ => format!("the file cannot be read: {error}"),
        };
        DataError::new(self.file.as_str(), message)
            .line(self.line)
            .help("rows before were sound; copy or download it again")
    }
}

impl RawRows for CsvRows {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        if core::mem::take(&mut self.is_pending) {
            return Ok(true);
        }
        self.read()
    }

    fn place(&self) -> usize {
        self.line
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        Cell::Text(self.record.get(column).unwrap_or_default().trim_ascii())
    }

    /// A row has a field per column; one more may be there if it is empty.
    fn malformed(&self) -> Option<Malformed> {
        let (fields, named) = (self.record.len(), self.columns.len());
        let is_trailing = fields == named + 1 && self.record.get(named).is_some_and(|cell| cell.trim_ascii().is_empty());
        if fields == named || is_trailing {
            return None;
        }
        let s = if fields == 1 { "" } else { "s" };
        Some(Malformed {
            message: format!("this row has {fields} field{s}, not {named}"),
            help: if fields < named {
                "is it cut off?"
            } else {
                "is there a delimiter, or a decimal comma, within a field?"
            },
        })
    }
}
