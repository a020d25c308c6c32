//! A sensor whose h is a function of Python, to try a model before it is written in Rust.

use fusion::core::geometry::so3;
use fusion::core::model::{Exact, ExactModel, ExactView, Measurement, Real, Undefined};
use fusion::core::state::{Angle, Attitude, Geodetic, Position, Quantity, Scalar, Vector, Velocity};
use fusion::models::block::{Build, BuildError, Channel, Reading, SensorSpec};
use fusion::models::units::{Dimension, parse_unit};
use nalgebra::{Matrix3, Vector3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A function of Python, declared by `fusion.sensor`.
#[derive(Debug)]
struct Function {
    name: String,
    /// The quantities that it reads, and their kinds.
    reads: Vec<(String, String)>,
    dim: usize,
    unit: Dimension,
    /// h of the values, as a list of numbers.
    h: Py<PyAny>,
    /// ∂h along the axes of each quantity in turn, as a list of rows; without it, by differences.
    jacobian: Option<Py<PyAny>>,
}

static FUNCTIONS: Mutex<BTreeMap<String, Arc<Function>>> = Mutex::new(BTreeMap::new());

fn function(name: &str) -> Result<Arc<Function>, String> {
    let known = FUNCTIONS.lock().unwrap_or_else(PoisonError::into_inner);
    known.get(name).cloned().ok_or_else(|| {
        let names: Vec<&str> = known.keys().map(String::as_str).collect();
        format!(
            "no function `{name}` is declared by `@fusion.sensor`; declared: {}",
            names.join(", ")
        )
    })
}

const KINDS: &str = "geodetic, position, velocity, attitude, scalar, angle, vector";

/// Declares a function. One of the same name is replaced; designs that were read before keep the earlier one.
#[pyfunction]
#[pyo3(signature = (name, reads, dim, unit, h, jacobian))]
pub(crate) fn declare_sensor(
    name: String,
    reads: Vec<(String, String)>,
    dim: usize,
    unit: &str,
    h: Py<PyAny>,
    jacobian: Option<Py<PyAny>>,
) -> PyResult<()> {
    if dim == 0 || reads.is_empty() {
        return Err(PyValueError::new_err("dim is at least 1, and at least one quantity is read"));
    }
    if let Some((quantity, kind)) = reads.iter().find(|(_, kind)| !KINDS.split(", ").any(|known| known == kind)) {
        let message = format!("`{quantity}`: the kind `{kind}` is unknown; possible: {KINDS}");
        return Err(PyValueError::new_err(message));
    }
    let unit = if unit.is_empty() {
        Dimension::NONE
    } else {
        let (scale, dimension) = parse_unit(unit).map_err(|error| PyValueError::new_err(error.to_string()))?;
        if scale != 1.0 {
            return Err(PyValueError::new_err(format!(
                "unit={unit:?}: the function works in SI; give the unit of SI"
            )));
        }
        dimension
    };
    let declared = Function {
        name: name.clone(),
        reads,
        dim,
        unit,
        h,
        jacobian,
    };
    let mut functions = FUNCTIONS.lock().unwrap_or_else(PoisonError::into_inner);
    functions.insert(name, Arc::new(declared));
    Ok(())
}

/// A measurement whose h is a function of Python, declared by `@fusion.sensor`. Its channel has the name of the function.
#[derive(Debug, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PythonSpec {
    /// The name of the function.
    function: String,
}

fusion::models::register! { Sensor, "python", PythonSpec, r#"function = "range_to""# }

#[typetag::deserialize(name = "python")]
impl SensorSpec for PythonSpec {
    fn reading(&self) -> Reading {
        let (dim, unit) = function(&self.function).map_or((1, Dimension::NONE), |f| (f.dim, f.unit));
        let mut channel = Channel::vector("value", dim, unit);
        channel.name = Cow::Owned(self.function.clone());
        Reading::Channel(channel)
    }

    fn noise(&self) -> Vec<Dimension> {
        function(&self.function).map_or_else(|_| vec![Dimension::NONE], |f| vec![f.unit; f.dim])
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        let function = function(&self.function).map_err(|why| BuildError::at("function", why))?;
        let read = |(name, kind): &(String, String)| -> Result<Read, BuildError> {
            let name = name.as_str();
            Ok(match kind.as_str() {
                "geodetic" => Read::Geodetic(b.quantity(name)?),
                "position" => Read::Position(b.quantity(name)?),
                "velocity" => Read::Velocity(b.quantity(name)?),
                "attitude" => Read::Attitude(b.quantity(name)?),
                "angle" => Read::Angle(b.quantity(name)?),
                "vector" => Read::Vector(b.quantity(name)?),
                _ => Read::Scalar(b.quantity(name)?),
            })
        };
        let reads: Result<Vec<Read>, BuildError> = function.reads.iter().map(read).collect();
        Ok(Box::new(Exact(Model {
            function,
            reads: reads?,
            latest: Mutex::new(None),
            is_checked: AtomicBool::new(false),
        })))
    }
}

/// A quantity that is read.
#[derive(Debug)]
enum Read {
    Geodetic(Quantity<Geodetic>),
    Position(Quantity<Position>),
    Velocity(Quantity<Velocity>),
    Attitude(Quantity<Attitude>),
    Scalar(Quantity<Scalar>),
    Angle(Quantity<Angle>),
    Vector(Quantity<Vector<3>>),
}

/// The value of a quantity: numbers, or C_nb for an attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    One(f64),
    Three(Vector3<f64>),
    Place(Vector3<f64>),
    Turn(Matrix3<f64>),
}

/// ε^⅓: the step of a central difference over the size of the number, with equal errors of rounding and truncation.
const STEP: f64 = 6e-6;
/// The size of a position for the step \[m\]: the step of 6 mm is exact to 1e-7 for distances above 10 m.
const METRES: f64 = 1e3;

/// The largest difference of a given slope from differences, over the largest slope: they are exact to 1e-6 and better, and a
/// wrong sign, unit or axis is wrong by more.
const AGREEMENT: f64 = 1e-3;

impl Value {
    const fn axes(&self) -> usize {
        if matches!(self, Self::One(_)) { 1 } else { 3 }
    }

    fn step(&self, axis: usize) -> f64 {
        match self {
            Self::One(value) => STEP * value.abs().max(1.0),
            Self::Three(values) => STEP * values[axis].abs().max(1.0),
            Self::Place(_) => STEP * METRES,
            Self::Turn(_) => STEP,
        }
    }

    /// The value after a step along an axis of its error: metres north, east, down; the axes of the body.
    fn moved(&self, axis: usize, by: f64) -> Self {
        let mut along = Vector3::zeros();
        along[axis] = by;
        match self {
            Self::One(value) => Self::One(value + by),
            Self::Three(values) => Self::Three(values + along),
            Self::Place(place) => {
                let place = Geodetic::new(place.x, place.y, place.z);
                let (north, east) = place.metres_per_radian();
                Self::Place(Vector3::new(
                    place.lat + along.x / north,
                    place.lon + along.y / east,
                    place.height - along.z,
                ))
            }
            Self::Turn(matrix) => Self::Turn(matrix * so3::exp(&along).to_rotation_matrix().into_inner()),
        }
    }

    fn object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Self::One(value) => value.into_pyobject(py)?.into_any(),
            Self::Three(values) | Self::Place(values) => <[f64; 3]>::from(*values).into_pyobject(py)?.into_any(),
            Self::Turn(m) => {
                let rows: [[f64; 3]; 3] = core::array::from_fn(|i| core::array::from_fn(|j| m[(i, j)]));
                rows.into_pyobject(py)?.into_any()
            }
        })
    }
}

/// The values at which a Jacobian was computed, and the Jacobian, row by row.
type Computed = (Vec<Value>, Vec<f64>, Vec<f64>);

#[derive(Debug)]
struct Model {
    function: Arc<Function>,
    reads: Vec<Read>,
    /// The latest values with h and its Jacobian: an update asks for them once for each axis.
    latest: Mutex<Option<Computed>>,
    /// Whether a given Jacobian was compared with differences.
    is_checked: AtomicBool,
}

const FAILED: Undefined = Undefined("the function of Python has no value");

impl Model {
    /// The values, and their errors along each axis.
    fn read<D: Real>(&self, x: &ExactView<'_, D>) -> (Vec<Value>, Vec<D>) {
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        for read in &self.reads {
            let error_of = |d: D| d - d.re();
            values.push(match read {
                Read::Scalar(q) => one(x.scalar(q), &mut errors),
                Read::Angle(q) => one(x.angle(q), &mut errors),
                Read::Velocity(q) => three(x.velocity(q), &mut errors),
                Read::Position(q) => three(x.position(q), &mut errors),
                Read::Vector(q) => three(x.vector(q), &mut errors),
                Read::Geodetic(q) => {
                    let [lat, lon, height] = x.geodetic(q);
                    let place = Geodetic::new(lat.re(), lon.re(), height.re());
                    let (north, east) = place.metres_per_radian();
                    errors.extend([error_of(lat) * north, error_of(lon) * east, -error_of(height)]);
                    Value::Place(Vector3::new(place.lat, place.lon, place.height))
                }
                Read::Attitude(q) => {
                    let c = x.matrix(q);
                    let at = c.map(|d| d.re());
                    // Exp(δ) of the error, in the axes of the body.
                    let turn = |i: usize, j: usize| c[(0, j)] * at[(0, i)] + c[(1, j)] * at[(1, i)] + c[(2, j)] * at[(2, i)];
                    errors.extend([(2, 1), (0, 2), (1, 0)].map(|(i, j)| error_of(turn(i, j))));
                    Value::Turn(at)
                }
            });
        }
        (values, errors)
    }

    fn h(&self, py: Python<'_>, values: &[Value]) -> PyResult<Vec<f64>> {
        let objects: PyResult<Vec<_>> = values.iter().map(|value| value.object(py)).collect();
        self.function.h.call1(py, PyTuple::new(py, objects?)?)?.extract(py)
    }

    /// ∂h along the axes of all values, row by row.
    fn jacobian(&self, py: Python<'_>, values: &[Value]) -> PyResult<Vec<f64>> {
        let Some(given) = &self.function.jacobian else {
            return self.differences(py, values);
        };
        let dim = self.function.dim;
        let axes: usize = values.iter().map(Value::axes).sum();
        let objects: PyResult<Vec<_>> = values.iter().map(|value| value.object(py)).collect();
        let rows: Vec<Vec<f64>> = given.call1(py, PyTuple::new(py, objects?)?)?.extract(py)?;
        if rows.len() != dim || rows.iter().any(|row| row.len() != axes) {
            let message = format!("the Jacobian of `{}` has {dim} rows of {axes} numbers", self.function.name);
            return Err(PyValueError::new_err(message));
        }
        let rows = rows.concat();
        if !self.is_checked.load(Ordering::Relaxed) {
            self.check(&rows, &self.differences(py, values)?, axes)?;
            self.is_checked.store(true, Ordering::Relaxed);
        }
        Ok(rows)
    }

    /// Compares a given Jacobian with differences, once.
    fn check(&self, given: &[f64], differences: &[f64], axes: usize) -> PyResult<()> {
        let largest = differences.iter().fold(0.0_f64, |largest, slope| largest.max(slope.abs()));
        let wrong = |(a, b): (&f64, &f64)| (a - b).abs() > AGREEMENT * largest;
        let Some(place) = given.iter().zip(differences).position(wrong) else {
            return Ok(());
        };
        let (name, row, axis) = (&self.function.name, place / axes, place % axes);
        let (given, found) = (given[place], differences[place]);
        let message = format!("the Jacobian of `{name}` has {given:.6e} in row {row}, axis {axis}; differences give {found:.6e}");
        Err(PyValueError::new_err(message))
    }

    /// The same by central differences.
    fn differences(&self, py: Python<'_>, values: &[Value]) -> PyResult<Vec<f64>> {
        let dim = self.function.dim;
        let axes: usize = values.iter().map(Value::axes).sum();
        let mut all = vec![0.0; dim * axes];
        let mut column = 0;
        for (k, value) in values.iter().enumerate() {
            for axis in 0..value.axes() {
                let step = value.step(axis);
                let at = |by: f64| {
                    let mut moved = values.to_vec();
                    moved[k] = value.moved(axis, by);
                    self.h(py, &moved)
                };
                for (row, (above, below)) in at(step)?.into_iter().zip(at(-step)?).enumerate() {
                    all[row * axes + column] = (above - below) / (2.0 * step);
                }
                column += 1;
            }
        }
        Ok(all)
    }

    /// h and its Jacobian at these values.
    fn computed(&self, values: Vec<Value>, with_jacobian: bool) -> Result<Computed, Undefined> {
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = latest
            .as_ref()
            .filter(|(at, _, j)| *at == values && (!with_jacobian || !j.is_empty()))
        {
            return Ok(known.clone());
        }
        let called = Python::attach(|py| {
            let called = self.h(py, &values).and_then(|h| {
                let jacobian = if with_jacobian { self.jacobian(py, &values)? } else { Vec::new() };
                Ok((h, jacobian))
            });
            // The measurement is undefined, and Python shows why.
            called.map_err(|error| error.write_unraisable(py, None)).ok()
        });
        let (h, jacobian) = called.ok_or(FAILED)?;
        if h.iter().chain(&jacobian).any(|number| !number.is_finite()) {
            return Err(FAILED);
        }
        let computed = (values, h, jacobian);
        *latest = Some(computed.clone());
        Ok(computed)
    }
}

fn one<D: Real>(value: D, errors: &mut Vec<D>) -> Value {
    errors.push(value - value.re());
    Value::One(value.re())
}

fn three<D: Real>(values: Vector3<D>, errors: &mut Vec<D>) -> Value {
    errors.extend(values.iter().map(|value| *value - value.re()));
    Value::Three(values.map(|value| value.re()))
}

impl ExactModel for Model {
    fn dim(&self) -> usize {
        self.function.dim
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let (values, errors) = self.read(x);
        // A real number has no derivative to carry.
        let has_derivative = size_of::<D>() > size_of::<f64>();
        let (_, h, jacobian) = self.computed(values, has_derivative)?;
        for (row, z) in z.iter_mut().enumerate() {
            *z = D::from(*h.get(row).ok_or(FAILED)?);
            if has_derivative {
                let row = &jacobian[row * errors.len()..(row + 1) * errors.len()];
                row.iter().zip(&errors).for_each(|(slope, error)| *z += *error * *slope);
            }
        }
        Ok(())
    }
}
