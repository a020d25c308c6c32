//! The filter inside a program of Python.

use crate::design::Design;
use crate::error::{DataError, FusionError, raised};
use fusion::core::runner::Event;
use fusion::core::time::Time;
use fusion::solution::{Solution, sigmas};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;

/// A filter that is fed and read. Threads of Python take turns, and none holds the interpreter while it waits.
#[pyclass(frozen, module = "fusion._fusion")]
#[derive(Debug)]
pub(crate) struct Navigator {
    nav: Mutex<fusion::Navigator>,
    /// The thread that works on the filter.
    worker: Mutex<Option<ThreadId>>,
}

/// Locks. A panic of another thread does not spoil the content.
fn held<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A thread works on the filter while this value exists.
struct Working<'a>(&'a Mutex<Option<ThreadId>>);

impl Drop for Working<'_> {
    fn drop(&mut self) {
        *held(self.0) = None;
    }
}

impl Navigator {
    /// Works on the filter without the interpreter. A sensor of Python that asks the filter that calls it has an error:
    /// it would wait for itself.
    fn on<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut fusion::Navigator) -> T + Send) -> PyResult<T> {
        let here = std::thread::current().id();
        if *held(&self.worker) == Some(here) {
            let message = "this filter is at work: a sensor reads the state that it is given, not the navigator that calls it";
            return Err(FusionError::new_err(message));
        }
        Ok(py.detach(|| {
            let mut nav = held(&self.nav);
            *held(&self.worker) = Some(here);
            let _working = Working(&self.worker);
            work(&mut nav)
        }))
    }
}

/// The solution after each row, as one array for each group of three numbers. A missing number is NaN.
#[derive(Debug)]
struct Solutions {
    time: Vec<f64>,
    groups: [Vec<f64>; GROUPS.len()],
}

/// Names of the groups, in order.
const GROUPS: [&str; 6] = [
    "position",
    "sigma_position",
    "velocity",
    "sigma_velocity",
    "attitude",
    "sigma_attitude",
];

impl Solutions {
    fn new(rows: usize) -> Self {
        let of = |width: usize| Vec::with_capacity(rows * width);
        Self {
            time: of(1),
            groups: core::array::from_fn(|_| of(3)),
        }
    }

    fn push(&mut self, solution: Option<Solution>) {
        const NONE: [f64; 3] = [f64::NAN; 3];
        let s = solution.unwrap_or_default();
        self.time.push(solution.map_or(f64::NAN, |s| s.time.seconds()));
        let position = s.position.map(|(at, p)| ([at.lat, at.lon, at.height], sigmas(&p).into()));
        let velocity = s.velocity.map(|(v, p)| (v.into(), sigmas(&p).into()));
        let attitude = s.rpy().map(|(rpy, spread)| (rpy.into(), spread.into()));
        for (pair, group) in self.groups.chunks_exact_mut(2).zip([position, velocity, attitude]) {
            let (value, sigma) = group.unwrap_or((NONE, NONE));
            pair[0].extend(value);
            pair[1].extend(sigma);
        }
    }

    fn arrays<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let rows = self.time.len();
        dict.set_item("time", PyArray1::from_vec(py, self.time))?;
        for (name, numbers) in GROUPS.into_iter().zip(self.groups) {
            dict.set_item(name, PyArray1::from_vec(py, numbers).reshape([rows, 3])?)?;
        }
        Ok(dict)
    }
}

/// Rows between two looks at signals: some ten milliseconds.
const PIECE: usize = 1 << 14;

/// A solution as a dict, in SI with angles in radians.
fn solved<'py>(py: Python<'py>, solution: &Solution) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("time", solution.time.seconds())?;
    let put = |name: &str, values: [f64; 3], sigma: [f64; 3]| {
        dict.set_item(name, values)?;
        dict.set_item(format!("sigma_{name}"), sigma)
    };
    if let Some((place, p)) = &solution.position {
        put("position", [place.lat, place.lon, place.height], sigmas(p).into())?;
    }
    if let Some((velocity, p)) = &solution.velocity {
        put("velocity", (*velocity).into(), sigmas(p).into())?;
    }
    if let Some((rpy, spread)) = solution.rpy() {
        put("attitude", rpy.into(), spread.into())?;
    }
    Ok(dict)
}

/// The name of a channel, its first column and its width.
type Channel = (String, usize, usize);

/// The time, and of each state its name, its values as stored and its 1σ.
type States = (f64, Vec<(String, Vec<f64>, Vec<f64>)>);

fn states(nav: &fusion::Navigator) -> Option<States> {
    let belief = nav.belief()?;
    let blocks = nav.layout().blocks().iter().map(|block| {
        let values = belief.x[block.storage_range()].to_vec();
        let sigmas = belief.covariance.sigmas(block).collect();
        (block.name.to_string(), values, sigmas)
    });
    Some((belief.time.seconds(), blocks.collect()))
}

#[pymethods]
impl Navigator {
    #[new]
    fn new(py: Python<'_>, design: &Design) -> PyResult<Self> {
        let nav = py.detach(|| fusion::Navigator::of(&design.design));
        Ok(Self {
            nav: Mutex::new(nav.map_err(|mistakes| raised(py, &mistakes))?),
            worker: Mutex::new(None),
        })
    }

    /// The streams: name, and the name, first column and width of each channel.
    fn streams(&self, py: Python<'_>) -> PyResult<Vec<(String, Vec<Channel>)>> {
        let channels = |stream: &fusion::assembly::StreamLayout| {
            let channels = stream.channels.iter();
            channels.map(|c| (c.name.clone(), c.offset, c.width)).collect()
        };
        let named = |stream: &fusion::assembly::StreamLayout| (stream.name.clone(), channels(stream));
        self.on(py, |nav| nav.streams().iter().map(named).collect())
    }

    /// Feeds rows in their order. With `solutions`, returns the solution after each row, as arrays.
    #[pyo3(signature = (stream, times, rows, solutions))]
    fn feed<'py>(
        &self,
        py: Python<'py>,
        stream: &str,
        times: PyReadonlyArray1<'py, f64>,
        rows: PyReadonlyArray2<'py, f64>,
        solutions: bool,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let refused = |error: &dyn core::fmt::Display, row: usize| DataError::new_err(format!("row {row}: {error}"));
        let id = self.on(py, |nav| nav.stream(stream))?;
        let id = id.map_err(|error| DataError::new_err(error.to_string()))?;
        let (times, rows) = (times.as_slice()?, rows.as_slice()?);
        let width = rows.len().checked_div(times.len()).unwrap_or(0);
        let mut after = solutions.then(|| Solutions::new(times.len()));
        let mut done = 0;
        // Without numbers there is no row to feed.
        let pieces = times.chunks(PIECE).zip(rows.chunks((PIECE * width).max(1)));
        for (times, rows) in pieces.take_while(|_| width > 0) {
            self.on(py, |nav| {
                for (k, (seconds, row)) in times.iter().zip(rows.chunks_exact(width)).enumerate() {
                    let fed = if seconds.is_finite() && seconds.abs() < 9e9 {
                        nav.feed_stream(id, Time::from_seconds(*seconds), row, &mut |_: &Event<'_>| {})
                    } else {
                        // It has the message about such a stamp.
                        nav.feed(stream, *seconds, row)
                    };
                    fed.map_err(|error| refused(&error, done + k))?;
                    if let Some(after) = &mut after {
                        after.push(nav.solution());
                    }
                }
                Ok::<(), PyErr>(())
            })??;
            done += times.len();
            py.check_signals()?;
        }
        after.map(|after| after.arrays(py)).transpose()
    }

    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        let finished = self.on(py, |nav| nav.finish(&mut |_: &Event<'_>| {}))?;
        finished.map_err(|error| DataError::new_err(error.to_string()))
    }

    fn solution<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let solution = self.on(py, fusion::Navigator::solution)?;
        solution.map(|solution| solved(py, &solution)).transpose()
    }

    fn predict<'py>(&self, py: Python<'py>, seconds: f64) -> PyResult<Option<Bound<'py, PyDict>>> {
        let solution = self.on(py, |nav| nav.predict(seconds))?;
        solution.map(|solution| solved(py, &solution)).transpose()
    }

    /// The time and the states: name, values as stored, 1σ.
    fn belief(&self, py: Python<'_>) -> PyResult<Option<States>> {
        self.on(py, |nav| states(nav))
    }

    fn health(&self, py: Python<'_>) -> PyResult<(&'static str, Vec<String>)> {
        self.on(py, |nav| {
            let reasons = nav.health_reasons().into_iter();
            (nav.health().state.word(), reasons.map(|reason| reason.to_string()).collect())
        })
    }

    fn waits_for(&self, py: Python<'_>) -> PyResult<Vec<(String, String)>> {
        self.on(py, |nav| nav.waits_for())
    }

    fn checkpoint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.on(py, fusion::Navigator::checkpoint)?))
    }

    fn restore(&self, py: Python<'_>, checkpoint: &[u8]) -> PyResult<()> {
        let restored = self.on(py, |nav| nav.restore(checkpoint))?;
        restored.map_err(|error| DataError::new_err(error.to_string()))
    }
}
