//! Rows of numbers as arrays of numpy, which take them without a copy.

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Rows of numbers, one after the other.
#[derive(Debug)]
pub(crate) struct Grid {
    numbers: Vec<f64>,
    width: usize,
}

impl Grid {
    pub(crate) const fn new(width: usize) -> Self {
        Self {
            numbers: Vec::new(),
            width,
        }
    }

    pub(crate) fn push(&mut self, number: f64) {
        self.numbers.push(number);
    }

    pub(crate) fn extend(&mut self, numbers: impl IntoIterator<Item = f64>) {
        self.numbers.extend(numbers);
    }

    /// The array of numpy, with a row for each row.
    pub(crate) fn array(mut self, py: Python<'_>) -> PyResult<Bound<'_, PyArray2<f64>>> {
        self.numbers.shrink_to_fit();
        let rows = self.numbers.len().checked_div(self.width).unwrap_or(0);
        let array = Array2::from_shape_vec((rows, self.width), self.numbers);
        let array = array.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(array.into_pyarray(py))
    }
}
