//! The interface of a format: rows of named columns, one at a time.

use crate::rows::{DataError, LINE};
use std::borrow::Cow;

/// Reads the rows of one file in their order; the row read last is the current row.
pub trait RawRows: Send {
    /// The names of the columns, as declarations refer to them.
    fn columns(&self) -> &[String];

    /// Explains why a name that the file knows is not one of its columns.
    fn absent(&self, _column: &str) -> Option<String> {
        None
    }

    /// Whether a column may also be called by its number, from 1.
    fn is_numbered(&self) -> bool {
        false
    }

    /// Selects the columns that will be read, before the first row. A format may leave the cells of the others empty.
    fn select(&mut self, _columns: &[usize]) {}

    /// Reads the next row; `false` after the last.
    ///
    /// # Errors
    /// The file cannot be read on.
    fn advance(&mut self) -> Result<bool, DataError>;

    /// The place of the current row in the file, as messages name it: for text, its line, from 1.
    fn place(&self) -> usize;

    /// The unit of [`place`](Self::place): `line`, or `message` for a log of messages.
    fn counted(&self) -> &'static str {
        LINE
    }

    /// The cell of the current row in the column with this number.
    fn cell(&self, column: usize) -> Cell<'_>;

    /// Why the current row cannot be split into cells; `None` if it can.
    fn malformed(&self) -> Option<Malformed> {
        None
    }
}

impl<R: RawRows + ?Sized> RawRows for Box<R> {
    fn columns(&self) -> &[String] {
        (**self).columns()
    }

    fn absent(&self, column: &str) -> Option<String> {
        (**self).absent(column)
    }

    fn is_numbered(&self) -> bool {
        (**self).is_numbered()
    }

    fn select(&mut self, columns: &[usize]) {
        (**self).select(columns);
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        (**self).advance()
    }

    fn place(&self) -> usize {
        (**self).place()
    }

    fn counted(&self) -> &'static str {
        (**self).counted()
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        (**self).cell(column)
    }

    fn malformed(&self) -> Option<Malformed> {
        (**self).malformed()
    }
}

/// The content of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// The bytes as written in a text file; valid text is UTF-8.
    Text(&'a [u8]),
    /// A number of a binary format.
    Number(f64),
    /// A whole number of a binary format; stamps stay exact.
    Integer(i64),
}

/// A mistake in the form of a row.
#[derive(Clone, Debug)]
pub struct Malformed {
    /// The mistake.
    pub message: String,
    /// How to correct it.
    pub help: &'static str,
    /// The file is cut off or damaged here, and no row after it can be read. Such a row is reported. It never stops a
    /// run, also with `bad_rows = "stop"`.
    pub is_last: bool,
}

impl<'a> Cell<'a> {
    /// The text of a sound text cell.
    pub(super) fn text(self) -> Option<&'a str> {
        match self {
            Self::Text(bytes) => core::str::from_utf8(bytes).ok(),
            Self::Number(_) | Self::Integer(_) => None,
        }
    }

    /// The number that it holds, finite or not.
    #[inline]
    #[must_use]
    pub fn number(self) -> Option<f64> {
        match self {
            Self::Text(_) => self.text()?.parse().ok(),
            Self::Number(number) => Some(number),
            Self::Integer(number) => Some(number as f64),
        }
    }

    /// As messages show it.
    #[must_use]
    pub fn shown(self) -> Cow<'a, str> {
        match self {
            Self::Text(bytes) => String::from_utf8_lossy(bytes),
            Self::Number(number) => number.to_string().into(),
            Self::Integer(number) => number.to_string().into(),
        }
    }
}
