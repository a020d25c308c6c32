//! Lines of a text file as rows of cells.

use super::blanks::Blanks;
use super::dropped::{Dropped, Drops};
use super::lines::{LONGEST, Lines};
use crate::rows::{DataError, SourceError};
use crate::source::OpenContext;
use crate::source::decode::{Cell, Malformed, RawRows};
use crate::source::file::{BUFFER, DataFile};
use ::csv::{ByteRecord, Error, ErrorKind, Reader, ReaderBuilder};
use std::io::{BufRead, BufReader, Cursor, Read};

/// How text is split.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Dialect<'a> {
    /// The delimiter of fields; `None` for runs of blanks.
    pub(in super::super) delimiter: Option<u8>,
    /// The mark of comments.
    pub(in super::super) comment: Option<&'a str>,
}

/// Where the names of the columns come from.
#[derive(Clone, Copy, Debug)]
pub(in super::super) enum Names<'a> {
    Given(&'a [String]),
    FirstLine,
    /// The last comment before the first row.
    Comment,
    Numbered,
}

/// The head of a file.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Head<'a> {
    pub(in super::super) names: Names<'a>,
    /// Lines before the line with the names; they are dropped.
    pub(in super::super) before: usize,
    /// Lines after it that are not rows.
    pub(in super::super) after: usize,
}

impl<'a> Head<'a> {
    /// Names, and then rows.
    pub(in super::super) const fn of(names: Names<'a>) -> Self {
        Self {
            names,
            before: 0,
            after: 0,
        }
    }
}

/// An open file.
pub(in super::super) struct CsvRows {
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
    pub(in super::super) fn open(
        dialect: Dialect<'_>,
        head: Head<'_>,
        file: &DataFile,
        context: &OpenContext,
    ) -> Result<Self, SourceError> {
        let Head { names, before, after } = head;
        let mut bytes = file.bytes(context)?;
        let mut columns = Vec::new();
        // The line after which rows may begin.
        let mut header = 0;
        if let (Names::Comment, Some(mark)) = (names, dialect.comment) {
            let head = Comments::read(bytes, mark).map_err(|error| broken(&file.name(), 1, &error.into()))?;
            columns = head.columns(dialect);
            header = head.line;
            if columns.is_empty() {
                let message = "no comment before the first row names the columns";
                return Err(DataError::new(file.name(), message).into());
            }
            bytes = head.bytes;
        }
        if dialect.delimiter.is_none() {
            bytes = Box::new(Blanks::new(bytes));
        }
        let byte = match dialect.comment.map(str::as_bytes) {
            Some(&[byte]) => Some(byte),
            _ => None,
        };
        // Lines that are not rows are dropped as text: a quotation mark in them has no effect.
        let drops = match names {
            Names::FirstLine => Drops { before, after },
            Names::Comment if after > 0 => Drops::first(header + after),
            Names::Given(_) | Names::Numbered | Names::Comment => Drops::first(before + after),
        };
        let mark = dialect.comment.unwrap_or_default();
        if drops != Drops::default() || mark.len() > 1 {
            bytes = Box::new(Dropped::new(bytes, mark, drops));
        }
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).buffer_capacity(BUFFER);
        builder.delimiter(dialect.delimiter.unwrap_or(b' ')).comment(byte);
        let mut rows = Self {
            file: file.name(),
            columns,
            reader: builder.from_reader(Lines::new(bytes)),
            record: ByteRecord::new(),
            line: 1,
            is_pending: false,
        };
        match names {
            Names::Given(names) => rows.columns = names.to_vec(),
            Names::FirstLine => rows.read_columns()?,
            Names::Comment => {}
            Names::Numbered => rows.is_pending = rows.read()?,
        }
        if matches!(names, Names::Numbered) {
            if !rows.is_pending {
                return Err(rows.empty().into());
            }
            rows.columns = (1..=rows.record.len()).map(|k| k.to_string()).collect();
        }
        Ok(rows)
    }

    /// Renames the columns.
    pub(in super::super) fn rename(&mut self, columns: Vec<String>) {
        self.columns = columns;
    }

    /// Takes the names of the columns from the next line.
    fn read_columns(&mut self) -> Result<(), DataError> {
        if !self.read()? {
            return Err(self.empty());
        }
        let names = self.record.iter();
        self.columns = names.map(|name| String::from_utf8_lossy(name.trim_ascii()).into_owned()).collect();
        Ok(())
    }

    fn empty(&self) -> DataError {
        DataError::new(self.file.as_str(), "this file is empty")
    }

    fn read(&mut self) -> Result<bool, DataError> {
        let read = self.reader.read_byte_record(&mut self.record);
        let end = self.reader.position().byte();
        self.line = self.reader.get_mut().line(end);
        let is_read = read.map_err(|error| broken(&self.file, self.line, &error))?;
        // A record with an open quotation mark may have many lines; skipping it as one bad row would lose them
        // silently. Such a record has too few fields or ends with the file.
        if is_read && !self.columns.is_empty() && (self.reader.get_ref().has_ended() || self.malformed().is_some()) {
            let text = self.record.as_slice();
            // With an open mark, the end of the file is the end of the row.
            let within = memchr::memchr_iter(b'\n', text.strip_suffix(b"\n").unwrap_or(text)).count();
            if within > 0 {
                let message = format!("a quotation mark is open from line {} to here", self.line.saturating_sub(within));
                let error = DataError::new(self.file.as_str(), message).line(self.line);
                return Err(error.help("close it, or remove it"));
            }
        }
        Ok(is_read)
    }
}

/// The error for a file that cannot be read further.
fn broken(file: &str, line: usize, error: &Error) -> DataError {
    let help = "rows before were sound; copy or download it again";
    let (message, help) = match error.kind() {
        ErrorKind::Io(io) if io.kind() == std::io::ErrorKind::FileTooLarge => {
            (io.to_string(), "is a quotation mark open, or is it no text?")
        }
        ErrorKind::Io(io) if io.kind() == std::io::ErrorKind::UnexpectedEof => ("the compressed file is cut off".to_owned(), help),
        ErrorKind::Io(io) => (format!("the file is damaged: {io}"), help),
        _ => (format!("the file cannot be read: {error}"), help),
    };
    DataError::new(file, message).line(line).help(help)
}

/// The comments at the beginning of a file, up to its first row, and all bytes of the file.
struct Comments {
    /// The last comment, without its mark.
    comment: String,
    /// Its line, from 1.
    line: usize,
    bytes: Box<dyn Read + Send>,
}

impl Comments {
    fn read(bytes: Box<dyn Read + Send>, mark: &str) -> std::io::Result<Self> {
        let mut reader = BufReader::with_capacity(BUFFER, bytes);
        let (mut head, mut comment, mut named) = (Vec::new(), String::new(), 0);
        for number in 1.. {
            let start = head.len();
            let left = LONGEST.saturating_sub(start as u64);
            reader.by_ref().take(left).read_until(b'\n', &mut head)?;
            if head.len() as u64 == LONGEST {
                let message = format!("comments are longer than {} MiB", LONGEST >> 20);
                return Err(std::io::Error::new(std::io::ErrorKind::FileTooLarge, message));
            }
            let line = head.get(start..).unwrap_or_default();
            match line.trim_ascii() {
                [] if !line.is_empty() => {}
                text if text.starts_with(mark.as_bytes()) => {
                    comment = String::from_utf8_lossy(text).trim_start_matches(mark).to_owned();
                    named = number;
                }
                _ => break,
            }
        }
        let bytes = Box::new(Cursor::new(head).chain(reader));
        Ok(Self {
            comment,
            line: named,
            bytes,
        })
    }

    /// The names in the comment.
    fn columns(&self, dialect: Dialect<'_>) -> Vec<String> {
        let names = self.comment.trim();
        match dialect.delimiter {
            _ if names.is_empty() => Vec::new(),
            None => names.split_ascii_whitespace().map(str::to_owned).collect(),
            Some(delimiter) => names.split(char::from(delimiter)).map(|name| name.trim().to_owned()).collect(),
        }
    }
}

impl RawRows for CsvRows {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn is_numbered(&self) -> bool {
        true
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

    /// A row has one field per column; one additional field is allowed if it is empty.
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
            is_last: false,
        })
    }
}
