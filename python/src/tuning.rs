//! Noises from innovations.

use crate::design::Design;
use crate::error::raised;
use fusion::config::{Diagnostics, Document};
use fusion::run::{KeptRows, Options};
use fusion_judge::tune::{Log, Searched, Settings, Tuned as Result, searches, tune};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The result of a tuning.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Tuned(Result);

/// Designs with other values of the parameters, from which the search starts too.
type Starts<'py> = Vec<PyRef<'py, Design>>;

/// The logs of a tuning. Their rows are decoded by the first run that needs them, and kept.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Logs(Vec<Log>);

#[pymethods]
impl Design {
    /// Logs: dicts of rows in place of files.
    fn logs(&self, logs: Vec<Bound<'_, PyDict>>) -> PyResult<Logs> {
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
        Ok(Logs(all))
    }
}

/// Does `work` with Python detached, which is looked at between two runs: Ctrl-C ends the search, and is then raised.
fn searching<T: Send>(
    py: Python<'_>,
    mut settings: Settings,
    work: impl FnOnce(&Settings, &(dyn Fn(u64, f64) + Sync)) -> core::result::Result<T, Diagnostics> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    settings.stop = Some(stop.clone());
    let look = |_: u64, _: f64| {
        if Python::attach(|py| py.check_signals().is_err()) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let done = py.detach(|| work(&settings, &look));
    if stop.load(Ordering::Relaxed) {
        return Err(pyo3::exceptions::PyKeyboardInterrupt::new_err(()));
    }
    done.map_err(|mistakes| raised(py, &mistakes))
}

fn documents(starts: &Starts<'_>) -> Vec<Document> {
    starts.iter().map(|start| start.design.document.clone()).collect()
}

#[pymethods]
impl Design {
    /// Tunes the noises whose paths match, on each of `logs`. `searched` has the ends of the searches from all starts, if
    /// other processes found them.
    #[pyo3(signature = (params, logs, settle, folds, most_runs, starts, searched))]
    #[expect(clippy::too_many_arguments, reason = "Python's side has names for them")]
    fn tune(
        &self,
        py: Python<'_>,
        params: Vec<String>,
        logs: PyRef<'_, Logs>,
        settle: f64,
        folds: usize,
        most_runs: u64,
        starts: Starts<'_>,
        searched: Vec<(Vec<f64>, u64)>,
    ) -> PyResult<Tuned> {
        let logs = &logs.0;
        let settings = Settings {
            settle,
            folds,
            most_runs,
            starts: documents(&starts),
            searched: searched.into_iter().map(|(theta, runs)| Searched { theta, runs }).collect(),
            ..Settings::default()
        };
        searching(py, settings, |settings, look| tune(logs, &params, settings, look)).map(Tuned)
    }

    /// The end of the search from the start of this number.
    #[pyo3(signature = (params, logs, settle, most_runs, starts, number))]
    #[expect(clippy::too_many_arguments, reason = "Python's side has names for them")]
    fn search(
        &self,
        py: Python<'_>,
        params: Vec<String>,
        logs: PyRef<'_, Logs>,
        settle: f64,
        most_runs: u64,
        starts: Starts<'_>,
        number: u64,
    ) -> PyResult<Vec<(Vec<f64>, u64)>> {
        let logs = &logs.0;
        let settings = Settings {
            settle,
            most_runs,
            starts: documents(&starts),
            ..Settings::default()
        };
        let ends = searching(py, settings, |settings, look| {
            searches(logs, &params, settings, number..number + 1, look)
        })?;
        Ok(ends.into_iter().map(|end| (end.theta, end.runs)).collect())
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
