//! The measurement model: h(x), written once and used by estimator, simulator and tests.

use super::Literal;
use crate::Printed;
use crate::linear::Jacobian;
use crate::printed::role;
use crate::state::View;
use alloc::boxed::Box;
use core::fmt::Debug;
use thiserror::Error;

/// The sizes of a measurement.
#[derive(Clone, Copy, Debug, Literal, PartialEq, Eq)]
#[literal(at = "fusion_core::model")]
pub struct Size {
    /// Numbers in a measured value z.
    pub value: usize,
    /// Numbers in a residual; rows of H and R.
    pub residual: usize,
}

impl Size {
    /// A measurement whose residual has as many numbers as its value.
    #[must_use]
    pub const fn same(n: usize) -> Self {
        Self { value: n, residual: n }
    }
}

/// The model has no value here (a bearing to the own position, a heading straight up).
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("undefined here: {0}")]
pub struct Undefined(pub &'static str);

/// A measurement model: object-safe, immutable, allocation-free. It returns prediction,
/// residual and Jacobian; gains, gates and corrections are the estimator's.
pub trait Measurement: Printed + Send + Sync {
    /// Sizes of value and residual.
    fn size(&self) -> Size;

    /// h(x) into `value`.
    ///
    /// # Errors
    /// [`Undefined`] where h has no value.
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined>;

    /// H = ∂h/∂x in the canonical chart, by [`Jacobian::add`].
    ///
    /// # Errors
    /// [`Undefined`] where h has no derivative.
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined>;

    /// Whether it reads signals of the process: they are evaluated for it only then. The law of measurements
    /// checks a model that returns false.
    fn reads_signals(&self) -> bool {
        true
    }

    /// An example of the numbers of a row that h takes as given: the place of a satellite at the time of a range. They
    /// are the last numbers of the value. [`View::given`] has them, [`predict`](Self::predict) repeats them, and
    /// residual and perturb leave them out. The laws try the model with the example. Empty for most models.
    fn given(&self) -> &'static [f64] {
        &[]
    }

    /// The given numbers in the value `z`.
    fn given_in<'z>(&self, z: &'z [f64]) -> &'z [f64] {
        let all = self.size().value;
        z.get(all.saturating_sub(self.given().len())..all).unwrap_or_default()
    }

    /// Row `row` of value and residual as a separate measurement, if rows come and go one by one, like the
    /// beams of a Doppler log. A separate gate then judges each row, and a missing row does not affect the others.
    /// `None` if the rows belong together.
    fn part(&self, row: usize) -> Option<Box<dyn Measurement>> {
        let _ = row;
        None
    }

    /// r = z ⊟ h. The default subtracts; angles wrap and geodetic positions give metres here.
    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        for ((r, z), h) in r.iter_mut().zip(z).zip(predicted) {
            *r = z - h;
        }
    }

    /// z ← z ⊞ e, the inverse of [`Measurement::residual`]: how the simulator adds an error.
    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        for (z, e) in z.iter_mut().zip(e) {
            *z += e;
        }
    }

    /// The model as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Measurement);
