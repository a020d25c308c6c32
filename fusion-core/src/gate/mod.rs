//! Gates: whether a measurement may touch the estimate.
//!
//! A gate is a policy with a memory. It sees the whitened, unweighted residual, answers with its
//! statistic, notices when it has been rejecting for long, and says how it recovers. A rejected
//! measurement is an outcome, never an error.

mod lockout;
mod nis;
mod only_with;
mod two_condition;

pub use lockout::{Lockout, Recovery};
pub use nis::Nis;
pub use only_with::OnlyWith;
pub use two_condition::{Ellipse, Magnitude, TwoCondition};

use crate::time::Time;
use core::fmt::Debug;

/// The data that a gate judges. Matrices are m×m, row by row.
#[derive(Clone, Copy, Debug)]
pub struct GateInput<'a> {
    /// Time of validity.
    pub time: Time,
    /// r = z ⊟ h(x̂).
    pub residual: &'a [f64],
    /// HPHᵀ: the estimate's own covariance seen through the sensor.
    pub predicted: &'a [f64],
    /// R.
    pub noise: &'a [f64],
    /// S = HPHᵀ + R.
    pub innovation: &'a [f64],
    /// rᵀS⁻¹r.
    pub nis: f64,
    /// The outcome of the latest measurement of each sensor of the design, by number; none before
    /// the first. It may be empty.
    pub others: &'a [Option<Outcome>],
}

/// The outcome of a sensor's measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Its time of validity.
    pub time: Time,
    /// Whether it corrected the estimate.
    pub is_used: bool,
    /// The mode of its gate afterwards.
    pub mode: Mode,
}

/// What a gate decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Use it.
    Accept,
    /// Do not use it.
    Reject,
    /// Re-acquire the sensor: P is scaled up as a whole until the NIS is an expected one, then the
    /// measurement is used.
    Reacquire,
}

/// Whether a gate trusts its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// The sensor is followed.
    #[default]
    Track,
    /// The gate has been rejecting: interference, or a wrong estimate.
    Denied,
}

/// A gate's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The decision.
    pub decision: Decision,
    /// The statistic it was based on.
    pub statistic: f64,
    /// What the statistic was compared with.
    pub threshold: f64,
    /// The gate's mode after the decision.
    pub mode: Mode,
}

/// A gate policy.
pub trait Gate: Debug + Send {
    /// Judges one measurement.
    fn judge(&mut self, input: &GateInput<'_>) -> Answer;

    /// The number of the leader, if any: the sensor whose outcome this gate depends on; never
    /// cyclic. At equal times the leader is served first. If the leader's measurement of the same
    /// row is valid later, the runner looks ahead for its outcome.
    fn leader(&self) -> Option<usize> {
        None
    }

    /// Copies the gate with its memory: the copy continues bit for bit as the original would.
    fn boxed_clone(&self) -> Box<dyn Gate>;
}

impl Clone for Box<dyn Gate> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}

/// Accepts everything and still reports the NIS.
#[derive(Clone, Copy, Debug, Default)]
pub struct Open;

impl Gate for Open {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        Answer {
            decision: Decision::Accept,
            statistic: input.nis,
            threshold: f64::INFINITY,
            mode: Mode::Track,
        }
    }

    fn boxed_clone(&self) -> Box<dyn Gate> {
        Box::new(*self)
    }
}
