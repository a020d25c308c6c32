//! Rows that a program supplies instead of the file of a source.

use super::decode::{Cell, RawRows};
use crate::rows::{DataError, SourceError};
use core::fmt;
use fusion_models::block::BuildError;
use std::sync::Arc;

/// Rows instead of the file of a source: arrays in memory, or any type that implements [`RawRows`], such as a message
/// channel. The rows are decoded as the source declares: clock, units, rotations, `valid`, bad rows.
///
/// ```
/// use fusion::run::Options;
/// use fusion::source::{Columns, Supply};
///
/// let columns = Columns::default().with("t", vec![0.0, 1.0, 2.0]).with("speed", vec![3.0, 3.1, 2.9]);
/// let mut options = Options::default();
/// options.rows.insert("odometer".to_owned(), Supply::from(columns));
/// ```
#[derive(Clone)]
pub struct Supply(Arc<Open>);

/// Starts the rows from the beginning.
type Open = dyn Fn() -> Result<Box<dyn RawRows>, SourceError> + Send + Sync;

impl Supply {
    /// Rows that `open` starts: once for a run, and once more for each other reader.
    pub fn new(open: impl Fn() -> Result<Box<dyn RawRows>, SourceError> + Send + Sync + 'static) -> Self {
        Self(Arc::new(open))
    }

    pub(crate) fn open(&self) -> Result<Box<dyn RawRows>, SourceError> {
        (self.0)()
    }
}

impl fmt::Debug for Supply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Supply")
    }
}

impl From<Columns> for Supply {
    fn from(columns: Columns) -> Self {
        let columns = Arc::new(columns);
        Self::new(move || {
            let lengths = columns.values.iter().map(Values::len);
            let count = lengths.clone().max().unwrap_or(0);
            if let Some(k) = lengths.clone().position(|length| length != count) {
                let (name, length) = (&columns.names[k], columns.values[k].len());
                let message = format!("column `{name}` in memory has {length} rows, the longest one has {count}");
                return Err(BuildError::at("path", message).into());
            }
            Ok(Box::new(Listed {
                columns: columns.clone(),
                count,
                row: 0,
            }))
        })
    }
}

/// Columns in memory, all of one length.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    names: Vec<String>,
    values: Vec<Values>,
}

/// The cells of a column.
#[derive(Clone, Debug)]
pub enum Values {
    /// Numbers.
    Numbers(Vec<f64>),
    /// Whole numbers; stamps stay exact.
    Integers(Vec<i64>),
    /// Text as in a text file: calendar dates, or numbers.
    Texts(Vec<String>),
}

impl Columns {
    /// Adds a column.
    #[must_use]
    pub fn with(mut self, name: &str, values: impl Into<Values>) -> Self {
        self.names.push(name.to_owned());
        self.values.push(values.into());
        self
    }
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(all) => all.len(),
            Self::Integers(all) => all.len(),
            Self::Texts(all) => all.len(),
        }
    }
}

impl From<Vec<f64>> for Values {
    fn from(all: Vec<f64>) -> Self {
        Self::Numbers(all)
    }
}

impl From<Vec<i64>> for Values {
    fn from(all: Vec<i64>) -> Self {
        Self::Integers(all)
    }
}

impl From<Vec<String>> for Values {
    fn from(all: Vec<String>) -> Self {
        Self::Texts(all)
    }
}

/// The rows of columns.
struct Listed {
    columns: Arc<Columns>,
    count: usize,
    /// The number of the current row, from 1.
    row: usize,
}

impl RawRows for Listed {
    fn columns(&self) -> &[String] {
        &self.columns.names
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.row += 1;
        Ok(self.row <= self.count)
    }

    fn place(&self) -> usize {
        self.row
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let row = self.row - 1;
        match &self.columns.values[column] {
            Values::Numbers(all) => Cell::Number(all[row]),
            Values::Integers(all) => Cell::Integer(all[row]),
            Values::Texts(all) => Cell::Text(all[row].as_bytes()),
        }
    }
}
