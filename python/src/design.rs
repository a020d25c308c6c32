//! Designs, and runs over their data.

use crate::arrays::Grid;
use crate::columns::supply;
use crate::error::{DataError, raised};
use crate::recording::{Cells, Change, Estimates, Recording};
use fusion::Selection;
use fusion::config::Diagnostics;
use fusion::observe::RunObserver;
use fusion::output::Digits;
use fusion::run::{Keep, Options, Run, Smoothing, Summary};
use fusion_present::Shown;
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// A design that can be assembled.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Design {
    pub(crate) design: Arc<fusion::design::Design>,
    /// The file, or the text with its folder.
    from: From,
    selection: Selection,
    data: Option<PathBuf>,
}

#[derive(Clone, Debug)]
enum From {
    File(PathBuf),
    Text { folder: PathBuf, text: String },
}

impl From {
    fn read(&self, selection: &Selection) -> Result<fusion::design::Design, Diagnostics> {
        match self {
            Self::File(path) => selection.load(path),
            Self::Text { folder, text } => selection.read(folder, text),
        }
    }

    fn base(&self) -> PathBuf {
        match self {
            Self::File(path) => path.parent().map(PathBuf::from).unwrap_or_default(),
            Self::Text { folder, .. } => folder.clone(),
        }
    }
}

impl Design {
    /// Options with its folders.
    pub(crate) fn options(&self) -> Options {
        Options {
            base: self.from.base(),
            data: self.data.clone(),
            ..Options::default()
        }
    }

    /// Adds rows in place of files.
    pub(crate) fn rows(&self, options: &mut Options, rows: &Bound<'_, PyDict>) -> PyResult<()> {
        let known = || self.design.sources.iter().map(|source| source.name.as_str());
        for (name, columns) in rows {
            let name: String = name.extract()?;
            if !known().any(|known| known == name) {
                let known: Vec<&str> = known().collect();
                let known = if known.is_empty() {
                    "none: give it a table [source.NAME]".to_owned()
                } else {
                    known.join(", ")
                };
                let message = format!("the design has no source `{name}`; it has: {known}");
                return Err(DataError::new_err(message));
            }
            options.rows.insert(name.clone(), supply(&name, columns.cast()?)?);
        }
        Ok(())
    }
}

/// The word for smoothing.
fn smoothing(word: Option<&str>) -> PyResult<Smoothing> {
    Ok(match word {
        None => Smoothing::Declared,
        Some("never") => Smoothing::Never,
        Some("whole") => Smoothing::Whole(Keep::Memory),
        Some("iterate") => Smoothing::Iterated(Keep::Memory),
        Some(other) => {
            let message = format!("smooth={other:?} is unknown: None, \"never\", \"whole\" and \"iterate\" are possible");
            return Err(PyValueError::new_err(message));
        }
    })
}

/// File or folder, text, variants, backend, values, folder of the data.
type Arguments = (PathBuf, Option<String>, Vec<String>, Option<String>, Vec<String>, Option<PathBuf>);

#[pymethods]
impl Design {
    #[new]
    #[pyo3(signature = (path, text, variants, backend, set, data))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        text: Option<String>,
        variants: Vec<String>,
        backend: Option<String>,
        set: Vec<String>,
        data: Option<PathBuf>,
    ) -> PyResult<Self> {
        let selection = Selection { variants, backend, set };
        let from = match text {
            Some(text) => From::Text { folder: path, text },
            None => From::File(path),
        };
        let design = py.detach(|| from.read(&selection)).map_err(|mistakes| raised(py, &mistakes))?;
        Ok(Self {
            design: Arc::new(design),
            from,
            selection,
            data,
        })
    }

    /// The arguments of `__new__`, so that another process can make the same design.
    fn arguments(&self) -> Arguments {
        let Selection { variants, backend, set } = self.selection.clone();
        let (path, text) = match self.from.clone() {
            From::File(path) => (path, None),
            From::Text { folder, text } => (folder, Some(text)),
        };
        (path, text, variants, backend, set, self.data.clone())
    }

    #[getter]
    fn description(&self) -> &str {
        &self.design.run.description
    }

    #[getter]
    fn sources(&self) -> Vec<String> {
        self.design.sources.iter().map(|source| source.name.clone()).collect()
    }

    #[getter]
    fn sensors(&self) -> Vec<String> {
        self.design.sensors.iter().map(|sensor| sensor.name.clone()).collect()
    }

    #[getter]
    fn is_simulated(&self) -> bool {
        self.design.simulation.is_some()
    }

    #[getter]
    fn backend(&self) -> String {
        self.design.filter.backend_name()
    }

    #[getter]
    fn hash(&self) -> String {
        fusion::provenance::Provenance::of(&self.design, None).hash
    }

    /// Runs it. `tick` is called from time to time; an exception that it raises stops the run.
    #[pyo3(signature = (rows, seed, smooth, out, tick))]
    fn run(
        &self,
        py: Python<'_>,
        rows: &Bound<'_, PyDict>,
        seed: Option<u64>,
        smooth: Option<&str>,
        out: Option<PathBuf>,
        tick: Py<PyAny>,
    ) -> PyResult<Finished> {
        let mut options = Options {
            seed,
            smooth: smoothing(smooth)?,
            out,
            ..self.options()
        };
        self.rows(&mut options, rows)?;
        let mut stopper = Stopper { tick, raised: None };
        let ran = py.detach(|| recorded(&self.design, &options, &mut stopper));
        if let Some(raised) = stopper.raised {
            return Err(raised);
        }
        ran.map_err(|mistakes| raised(py, &mistakes))
    }
}

/// Ends a run when Python wants to: Ctrl-C, or what the progress raises.
struct Stopper {
    tick: Py<PyAny>,
    raised: Option<PyErr>,
}

/// Events between two looks at Python.
const TICK: u32 = 1 << 14;

struct Watch<'a> {
    stopper: &'a mut Stopper,
    count: u32,
}

impl RunObserver for Watch<'_> {
    fn on(&mut self, _: &fusion::observe::RunEvent<'_>) -> Result<(), fusion::core::runner::Halt> {
        self.count = self.count.wrapping_add(1);
        if !self.count.is_multiple_of(TICK) {
            return Ok(());
        }
        let called = Python::attach(|py| {
            py.check_signals()?;
            self.stopper.tick.call0(py)
        });
        called.map(drop).map_err(|error| {
            self.stopper.raised = Some(error);
            fusion::core::runner::Halt::from(std::io::Error::other("Python stopped the run"))
        })
    }
}

fn recorded(design: &fusion::design::Design, options: &Options, stopper: &mut Stopper) -> Result<Finished, Diagnostics> {
    let run = Run::open(design, options)?;
    let (mut recording, mut smoothed) = Recording::of(design, run.assembly()).ok_or_else(Diagnostics::new)?;
    let mut watch = Watch { stopper, count: 0 };
    let finished = run.go_and_smooth(&mut [&mut recording, &mut watch], &mut [&mut smoothed], &mut |_| {})?;
    let summary = finished.keep()?;
    let smoothed = summary.smoothed().is_some().then_some(smoothed);
    Ok(Finished {
        summary,
        recording: Some(recording),
        smoothed,
        digits: Vec::new(),
    })
}

/// A run that has ended. Each array is taken once.
#[pyclass(module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Finished {
    summary: Summary,
    recording: Option<Recording>,
    smoothed: Option<Estimates>,
    digits: Vec<Digits>,
}

/// The rows of estimates, the names of their columns, the columns with a value, those in degrees, the further states.
type Taken<'py> = (
    Bound<'py, PyArray2<f64>>,
    Vec<String>,
    Vec<bool>,
    Vec<bool>,
    Vec<(String, usize, usize)>,
);

fn taken<'py>(py: Python<'py>, estimates: Estimates) -> PyResult<Taken<'py>> {
    let (names, further, degrees) = (estimates.names(), estimates.further(), estimates.cells.in_degrees());
    let Cells { rows, filled, .. } = estimates.cells;
    Ok((rows.array(py)?, names, filled, degrees, further))
}

/// The name of a sensor and its rows.
type SensorRows<'py> = (String, Bound<'py, PyArray2<f64>>);

/// Estimates, smoothed estimates, innovations, the words of the verdicts, errors, changes of the health.
type Recorded<'py> = (
    Taken<'py>,
    Option<Taken<'py>>,
    Vec<SensorRows<'py>>,
    Vec<&'static str>,
    Bound<'py, PyArray2<f64>>,
    Vec<Change>,
);

#[pymethods]
impl Finished {
    /// The summary as JSON, as summary.json has it.
    fn summary(&self) -> PyResult<String> {
        serde_json::to_string(&self.summary).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// The page of the run as the command prints it.
    #[pyo3(signature = (whole, width))]
    fn page(&self, whole: bool, width: usize) -> String {
        let shown = Shown(&self.summary);
        let page = if whole { shown.page() } else { shown.brief() };
        fusion_tables::text::page(&page, width)
    }

    /// The tables of the page as HTML.
    fn html(&self) -> String {
        fusion_tables::html::sections(&Shown(&self.summary).brief().sections).into_string()
    }

    /// All that was recorded: estimates, smoothed estimates, innovations with the words of the verdicts, errors, health.
    fn take<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Recorded<'py>>> {
        let Some(recording) = self.recording.take() else {
            return Ok(None);
        };
        self.digits = recording.estimates.cells.digits().to_vec();
        let smoothed = self.smoothed.take().map(|smoothed| taken(py, smoothed)).transpose()?;
        let innovations = recording.innovations.into_iter();
        let innovations: PyResult<Vec<SensorRows<'py>>> = innovations.map(|s| Ok((s.name, s.rows.array(py)?))).collect();
        Ok(Some((
            taken(py, recording.estimates)?,
            smoothed,
            innovations?,
            recording.verdicts,
            recording.errors.array(py)?,
            recording.health,
        )))
    }

    /// The numbers that estimates.csv has for these rows.
    fn written<'py>(&self, py: Python<'py>, rows: numpy::PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = rows.as_slice().map_err(|error| PyValueError::new_err(error.to_string()))?;
        let written: Grid = py.detach(|| Cells::written(&self.digits, rows));
        written.array(py)
    }
}
