//! Noises from innovations.

use crate::design::Design;
use crate::error::raised;
use fusion::run::{KeptRows, Options};
use fusion_judge::tune::{Log, Settings, Tuned as Result, tune};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The result of a tuning.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Tuned(Result);

#[pymethods]
impl Design {
    /// Tunes the noises whose paths match, on each of `logs`: dicts of rows in place of files.
    #[pyo3(signature = (params, logs, settle, folds, most_runs))]
    fn tune(
        &self,
        py: Python<'_>,
        params: Vec<String>,
        logs: Vec<Bound<'_, PyDict>>,
        settle: f64,
        folds: usize,
        most_runs: u64,
    ) -> PyResult<Tuned> {
        let mut all = Vec::new();
        for rows in logs {
            let mut options = Options {
                kept: Some(KeptRows::default()),
                ..self.options()
            };
            self.rows(&mut options, &rows)?;
            all.push(Log {
                document: self.design.document.clone(),
                options,
            });
        }
        let stop = Arc::new(AtomicBool::new(false));
        let settings = Settings {
            settle,
            folds,
            most_runs,
            stop: Some(stop.clone()),
            ..Settings::default()
        };
        // Python is looked at between two runs: Ctrl-C ends the search with the best so far, and is then raised.
        let look = |_: u64, _: f64| {
            if Python::attach(|py| py.check_signals().is_err()) {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let tuned = py.detach(|| tune(&all, &params, &settings, &look));
        if stop.load(Ordering::Relaxed) {
            return Err(pyo3::exceptions::PyKeyboardInterrupt::new_err(()));
        }
        tuned.map(Tuned).map_err(|mistakes| raised(py, &mistakes))
    }
}

#[pymethods]
impl Tuned {
    /// Path, declared value, factor, ends of its 95 % interval, whether the log determines it.
    fn found(&self) -> Vec<(String, String, f64, f64, f64, bool)> {
        let found = self.0.found.iter().map(|found| {
            let (low, high) = found.interval();
            let parameter = &found.parameter;
            (
                parameter.path.clone(),
                parameter.declared.clone(),
                found.factor,
                low,
                high,
                found.is_identifiable(),
            )
        });
        found.collect()
    }

    /// The edits of the design: path and value as TOML.
    fn edits(&self) -> Vec<(String, String)> {
        let edits = self.0.edits().into_iter();
        edits.filter_map(|edit| Some((edit.key, edit.value?))).collect()
    }

    #[getter]
    fn is_better(&self) -> bool {
        self.0.is_better()
    }

    #[getter]
    fn is_sound(&self) -> bool {
        self.0.is_sound()
    }

    #[getter]
    fn gain(&self) -> f64 {
        self.0.gain()
    }
}
