//! Campaigns: many seeds, in parts that any number of processes compute.

use crate::design::Design;
use crate::error::{FusionError, raised};
use fusion_judge::campaign::{Campaign as Runs, monte_carlo};
use fusion_present::Shown;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The runs of a campaign, or a part of them.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Campaign(Runs);

fn refused(error: &dyn core::fmt::Display) -> PyErr {
    FusionError::new_err(error.to_string())
}

#[pymethods]
impl Design {
    /// Runs the numbers `from_` to `to` of a campaign; the last is not included.
    #[pyo3(signature = (from_, to, seed, threads))]
    fn montecarlo(&self, py: Python<'_>, from_: u64, to: u64, seed: u64, threads: usize) -> PyResult<Campaign> {
        let options = self.options();
        let ran = py.detach(|| monte_carlo(&self.design, &options, from_..to, seed, threads, &|_| ()));
        ran.map(Campaign).map_err(|mistakes| raised(py, &mistakes))
    }
}

#[pymethods]
impl Campaign {
    /// The part as bytes, for [`merge`].
    fn part<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let mut bytes = Vec::new();
        self.0.write_part(&mut bytes).map_err(|error| refused(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// runs.csv as text.
    fn csv(&self) -> PyResult<String> {
        let mut bytes = Vec::new();
        self.0.write(&mut bytes).map_err(|error| refused(&error))?;
        String::from_utf8(bytes).map_err(|error| refused(&error))
    }

    fn page(&self, width: usize) -> String {
        fusion_tables::text::page(&Shown(&self.0).page(), width)
    }

    fn html(&self) -> String {
        fusion_tables::html::sections(&Shown(&self.0).page().sections).into_string()
    }

    fn __len__(&self) -> usize {
        self.0.rows.len()
    }
}

/// The campaign that parts make, in any order.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, parts: Vec<Vec<u8>>) -> PyResult<Campaign> {
    py.detach(|| {
        let read = parts
            .iter()
            .enumerate()
            .map(|(number, part)| Runs::read_part(part.as_slice()).map_err(|error| refused(&format!("part {number}: {error}"))));
        let read: PyResult<Vec<Runs>> = read.collect();
        let merged = Runs::merge(read?).map_err(|(number, error)| refused(&format!("part {number}: {error}")));
        Ok(Campaign(merged?))
    })
}
