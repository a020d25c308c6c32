//! Campaigns: many seeds, in parts that any number of processes compute.

use crate::design::Design;
use crate::error::{FusionError, raised};
use fusion_judge::campaign::{Campaign as Runs, Outcome, Runner, read, write};
use fusion_judge::part::{Head, Kind, Part, Parts, Subject};
use fusion_present::Shown;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::Arc;

/// The runs of a campaign, or a part of them.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Campaign {
    bytes: Arc<[u8]>,
    parts: Parts,
    runs: Runs,
}

impl Campaign {
    fn new(bytes: Vec<u8>) -> PyResult<Self> {
        let bytes: Arc<[u8]> = bytes.into();
        let part = Part::in_memory("campaign", Arc::clone(&bytes)).map_err(|error| refused(&error))?;
        let parts = Parts::from(part);
        let runs = read(&parts).map_err(|error| refused(&error))?.into_iter().next();
        let runs = runs.ok_or_else(|| refused(&"the part has no design"))?;
        Ok(Self { bytes, parts, runs })
    }
}

fn refused(error: &dyn core::fmt::Display) -> PyErr {
    FusionError::new_err(error.to_string())
}

#[pymethods]
impl Design {
    /// Runs the numbers `from_` to `to` of a campaign; the last is not included.
    #[pyo3(signature = (from_, to, seed, threads))]
    fn montecarlo(&self, py: Python<'_>, from_: u64, to: u64, seed: u64, threads: usize) -> PyResult<Campaign> {
        let options = self.options();
        let subject = Subject::new("", &self.design, seed);
        let head = Head {
            again: format!("fusion montecarlo {} --seed {seed}", subject.provenance.design),
            ..Head::new(Kind::Montecarlo, vec![subject], from_..to, None)
        };
        let ran = py.detach(|| {
            let mut bytes = Vec::new();
            let work = [(Arc::clone(&self.design), options)];
            let _ = Runner::new(seed, threads, false, &|_| ())?.write(&work, &head, &mut bytes)?;
            Ok(bytes)
        });
        ran.map_err(|mistakes| raised(py, &mistakes)).and_then(Campaign::new)
    }
}

#[pymethods]
impl Campaign {
    /// The part as bytes, for [`merge`].
    fn part<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes)
    }

    /// runs.csv as text.
    fn csv(&self) -> PyResult<String> {
        let mut bytes = Vec::new();
        write(&self.parts, &self.runs, &mut bytes).map_err(|error| refused(&error))?;
        String::from_utf8(bytes).map_err(|error| refused(&error))
    }

    /// The failed runs: number and reason.
    fn failed(&self) -> PyResult<Vec<(u64, String)>> {
        let mut failed = Vec::new();
        let mut add = |row: Vec<Outcome>| {
            failed.extend(row.into_iter().filter_map(|outcome| match outcome {
                Outcome::Failed(run) => Some((run.run, run.reason)),
                Outcome::Ended(_) => None,
            }));
            Ok(())
        };
        self.parts.rows(&mut add).map_err(|error| refused(&error))?;
        Ok(failed)
    }

    fn page(&self, width: usize) -> String {
        fusion_tables::text::page(&Shown(&self.runs).page(), width)
    }

    fn html(&self) -> String {
        fusion_tables::html::sections(&Shown(&self.runs).page().sections).into_string()
    }

    fn __len__(&self) -> usize {
        self.runs.runs + self.runs.failed
    }
}

/// The campaign that parts make, in any order, from the run `first` on.
#[pyfunction]
pub(crate) fn merge(py: Python<'_>, parts: Vec<Vec<u8>>, first: u64) -> PyResult<Campaign> {
    py.detach(|| {
        let parts = parts.into_iter().enumerate();
        let read: Result<Vec<Part>, _> = parts
            .map(|(number, part)| Part::in_memory(&format!("part {number}"), part.into()))
            .collect();
        let mut bytes = Vec::new();
        let joined = Parts::from_number(read.map_err(|error| refused(&error))?, first).and_then(|whole| whole.join(&mut bytes));
        joined.map_err(|error| refused(&error))?;
        Campaign::new(bytes)
    })
}
