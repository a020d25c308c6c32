//! Columns of numpy as the rows of a source, without a copy.

use fusion::models::block::BuildError;
use fusion::rows::{DataError, SourceError};
use fusion::source::Supply;
use fusion::source::decode::{Cell, RawRows};
use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::Arc;

/// The cells of a column.
enum Values {
    Numbers(Strided<f64>),
    Integers(Strided<i64>),
    Texts(Vec<String>),
}

/// An array of numpy, which it keeps alive.
struct Strided<T> {
    first: *const T,
    /// Bytes from one element to the next.
    stride: isize,
    length: usize,
    _owner: Py<PyAny>,
}

// SAFETY: it only reads, and the owner keeps the memory. A caller who writes to the array during a run, from another
// thread of Python, changes numbers and nothing else: each is read once, by its bits.
#[expect(unsafe_code, reason = "an array without a copy")]
unsafe impl<T: Sync> Send for Strided<T> {}
// SAFETY: as above.
#[expect(unsafe_code, reason = "an array without a copy")]
unsafe impl<T: Sync> Sync for Strided<T> {}

impl<T: numpy::Element + Copy> Strided<T> {
    fn new(array: &Bound<'_, PyArray1<T>>) -> Self {
        Self {
            first: array.data(),
            stride: array.strides()[0],
            length: array.len(),
            _owner: array.clone().into_any().unbind(),
        }
    }

    fn at(&self, index: usize) -> Option<T> {
        if index >= self.length {
            return None;
        }
        // SAFETY: `index` is within the array, whose memory the owner keeps; elements may be unaligned.
        #[expect(unsafe_code, reason = "an array without a copy")]
        let value = Some(unsafe { self.first.byte_offset(self.stride * index as isize).read_unaligned() });
        value
    }
}

/// Columns of a source.
struct Columns {
    names: Vec<String>,
    values: Vec<Values>,
    count: usize,
}

/// The rows of columns.
struct Rows {
    columns: Arc<Columns>,
    /// The number of the current row, from 1.
    row: usize,
}

impl RawRows for Rows {
    fn columns(&self) -> &[String] {
        &self.columns.names
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.row += 1;
        Ok(self.row <= self.columns.count)
    }

    fn place(&self) -> usize {
        self.row
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let index = self.row.saturating_sub(1);
        let cell = self.columns.values.get(column).and_then(|values| match values {
            Values::Numbers(all) => all.at(index).map(Cell::Number),
            Values::Integers(all) => all.at(index).map(Cell::Integer),
            Values::Texts(all) => all.get(index).map(|text| Cell::Text(text.as_bytes())),
        });
        cell.unwrap_or(Cell::Text(b""))
    }
}

/// The rows of `columns`: a dict of names to arrays of f64 or i64 with one axis, or to lists of text.
pub(crate) fn supply(source: &str, columns: &Bound<'_, PyDict>) -> PyResult<Supply> {
    let (mut names, mut values) = (Vec::new(), Vec::new());
    for (name, column) in columns {
        let name: String = name.extract()?;
        values.push(if let Ok(array) = column.cast::<PyArray1<f64>>() {
            Values::Numbers(Strided::new(array))
        } else if let Ok(array) = column.cast::<PyArray1<i64>>() {
            Values::Integers(Strided::new(array))
        } else if let Ok(list) = column.cast::<PyList>() {
            Values::Texts(list.extract()?)
        } else {
            let kind = column.get_type();
            let message = format!("source `{source}`, column `{name}`: {kind} is not an array of numbers with one axis");
            return Err(PyTypeError::new_err(message));
        });
        names.push(name);
    }
    let lengths = values.iter().map(|values| match values {
        Values::Numbers(all) => all.length,
        Values::Integers(all) => all.length,
        Values::Texts(all) => all.len(),
    });
    let count = lengths.clone().max().unwrap_or(0);
    let unequal = lengths.clone().zip(&names).find(|(length, _)| *length != count);
    let unequal = unequal.map(|(length, name)| format!("column `{name}` has {length} rows, the longest one has {count}"));
    drop(lengths);
    let columns = Arc::new(Columns { names, values, count });
    Ok(Supply::new(move || match &unequal {
        Some(message) => Err(SourceError::from(BuildError::at("path", message.clone()))),
        None => Ok(Box::new(Rows {
            columns: columns.clone(),
            row: 0,
        })),
    }))
}
