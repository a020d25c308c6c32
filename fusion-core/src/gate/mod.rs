//! Gates: whether a measurement may touch the estimate.
//!
//! A gate is a policy with a memory. It sees the whitened, unweighted residual and answers with its
//! statistic. It notices when it has been rejecting for long, and decides how to recover. A rejected
//! measurement is an outcome, never an error.

mod false_tracks;
mod lockout;
mod nis;
mod only_with;
mod two_condition;

pub use false_tracks::{FalseTracks, Hypotheses};
pub(crate) use false_tracks::{log_normal, log_sum};
pub use lockout::{Lockout, Recovery};
pub use nis::Nis;
pub use only_with::OnlyWith;
pub use two_condition::{Ellipse, Magnitude, TwoCondition, TwoConditions};

use crate::Printed;
use crate::memory::{Memory, Tape};
use crate::model::Literal;
use crate::printed::role;
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
    /// (S⁻¹)_ii: the NIS that a residual of one unit in row i alone would have.
    pub unit_nis: &'a [f64],
    /// The quality number in the row, such as HDOP, if the sensor reads one.
    pub quality: Option<f64>,
    /// The outcome of each sensor's latest measurement, by the sensor's number in the design; `None` before
    /// the first. The slice may be empty.
    pub others: &'a [Option<Outcome>],
}

/// The outcome of a sensor's measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Its time of validity.
    pub time: Time,
    /// Whether it corrected the estimate.
    pub is_used: bool,
    /// The mode of its gate afterwards.
    pub mode: Mode,
}
crate::memory!(Outcome { time, is_used, mode });

/// A gate's decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Use it.
    Accept,
    /// Do not use it.
    Reject,
    /// Re-acquire the sensor: the covariance of the motion is scaled up until the NIS has an expected
    /// value, then the measurement is used.
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
    /// The threshold for the statistic.
    pub threshold: f64,
    /// The gate's mode after the decision.
    pub mode: Mode,
}

impl Memory for Mode {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.choice(self, &[Self::Track, Self::Denied]);
    }
}

/// How probable a measurement is under each hypothesis: ln of its density times the hypothesis's probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odds {
    /// It is good, and the estimate is as good as its covariance says.
    pub good: f64,
    /// It is false.
    pub bad: f64,
    /// It is good, and the estimate is wrong beyond its covariance.
    pub lost: f64,
}

/// A gate policy.
pub trait Gate: Memory + Printed + Send {
    /// Judges one measurement.
    fn judge(&mut self, input: &GateInput<'_>) -> Answer;

    /// Receives whether the measurement that it judged last has corrected the estimate.
    fn settle(&mut self, is_used: bool) {
        let _ = is_used;
    }

    /// The power of the test, per row: the smallest error of that row alone, in its unit, that the
    /// test rejects now while all other rows agree with the estimate; infinite if it rejects no error.
    /// Denial does not count: the power belongs to the test, not to the earlier measurements.
    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]);

    /// How probable the measurement is, for a bank of hypotheses. The bank then decides in place of the
    /// gate. `None` if the gate's own decision holds in every hypothesis.
    fn odds(&self, input: &GateInput<'_>) -> Option<Odds> {
        let _ = input;
        None
    }

    /// The number of the leader, if any: the sensor whose outcome this gate depends on; never
    /// cyclic. At equal times the leader is served first. If the leader's measurement of the same
    /// row is valid later, the runner looks ahead for its outcome.
    fn leader(&self) -> Option<usize> {
        None
    }

    /// The gate as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Gate);

/// Accepts everything and still reports the NIS.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Open;
crate::memory!(Open {});

impl Gate for Open {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        Answer {
            decision: Decision::Accept,
            statistic: input.nis,
            threshold: f64::INFINITY,
            mode: Mode::Track,
        }
    }

    fn power(&self, _: &GateInput<'_>, smallest: &mut [f64]) {
        smallest.fill(f64::INFINITY);
    }

    crate::literal!();
}
