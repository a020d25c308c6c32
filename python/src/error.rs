//! Mistakes as exceptions of Python.

use fusion::config::{Diagnostic, Diagnostics, Severity};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

pyo3::create_exception!(
    fusion,
    FusionError,
    PyException,
    "Any error of fusion. `mistakes` is the list of them: dicts with message, file, line, column, help."
);
pyo3::create_exception!(
    fusion,
    DesignError,
    FusionError,
    "Mistakes in a design. `file`, `line`, `column` and `help` are those of the first one; `mistakes` lists all."
);
pyo3::create_exception!(fusion, DataError, FusionError, "Rows that a filter or a source refuses.");

/// The exception for mistakes of a design or of its data.
pub(crate) fn raised(py: Python<'_>, mistakes: &Diagnostics) -> PyErr {
    let error = DesignError::new_err(format!("\n{mistakes}"));
    match with_attributes(py, &error, mistakes) {
        Ok(()) => error,
        Err(other) => other,
    }
}

fn with_attributes(py: Python<'_>, error: &PyErr, mistakes: &Diagnostics) -> PyResult<()> {
    let value = error.value(py);
    let all = PyList::empty(py);
    for mistake in mistakes.iter() {
        all.append(entry(py, mistake)?)?;
    }
    let first = mistakes.iter().find(|mistake| mistake.severity == Severity::Error);
    let first = match first {
        Some(first) => entry(py, first)?,
        None => PyDict::new(py),
    };
    for name in ["message", "file", "line", "column", "help"] {
        value.setattr(name, first.get_item(name)?)?;
    }
    value.setattr("mistakes", all)
}

/// A mistake as a dict.
fn entry<'py>(py: Python<'py>, mistake: &Diagnostic) -> PyResult<Bound<'py, PyDict>> {
    let (file, line, column) = mistake.place.position();
    let entry = PyDict::new(py);
    let severity = match mistake.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    entry.set_item("severity", severity)?;
    entry.set_item("message", &mistake.message)?;
    entry.set_item("file", file)?;
    entry.set_item("line", line)?;
    entry.set_item("column", column)?;
    let advice: Vec<&str> = mistake.label.as_deref().into_iter().chain(mistake.help.as_deref()).collect();
    entry.set_item("help", Some(advice.join("; ")).filter(|advice| !advice.is_empty()))?;
    Ok(entry)
}
