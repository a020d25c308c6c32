//! The interface of every estimator.

use super::lateness::Lateness;
use super::step::Step;
use crate::Printed;
use crate::belief::Belief;
use crate::gate::{Gate, Mode, Outcome};
use crate::linear::Jacobian;
use crate::loss::Loss;
use crate::memory::Memory;
use crate::model::{Input, Measurement, Undefined};
use crate::printed::role;
use crate::state::{Layout, View};
use crate::time::Time;
use alloc::sync::Arc;
use thiserror::Error;

/// Why the estimator failed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilterError {
    /// The state would have left the earth or become NaN, or a variance would have become negative or NaN. The belief
    /// is the last sound one.
    #[error(
        "the estimate would be unsound at {0}: no numbers, a negative variance or a state that nothing can have; the one before is kept"
    )]
    Diverged(Time),
    /// A prediction to a time before that of the belief.
    #[error("asked to predict from {from} back to {to}")]
    Backwards {
        /// The belief's time.
        from: Time,
        /// The time asked for.
        to: Time,
    },
}

/// The outcome of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It corrected the estimate.
    Accepted,
    /// Its gate rejected it.
    Rejected,
    /// Its gate re-acquired the sensor: the covariance was inflated, then the measurement used.
    Reacquired,
    /// The model has no value at this state.
    Undefined(Undefined),
    /// S was not positive definite, or the belief would not have been sound: nothing was changed.
    Unusable,
}

/// One measurement, and what the filter did with it.
#[derive(Clone, Copy, Debug)]
pub struct Update<'a> {
    /// The outcome.
    pub verdict: Verdict,
    /// The measured value z, as it was offered.
    pub value: &'a [f64],
    /// The predicted value h(x̂) before the update; NaN where it is undefined.
    pub predicted: &'a [f64],
    /// R, m×m, row by row, before any robust weight.
    pub noise: &'a [f64],
    /// r = z ⊟ h(x̂) before the update.
    pub residual: &'a [f64],
    /// √S_ii, the predicted 1σ of each residual.
    pub innovation_sigma: &'a [f64],
    /// The Cholesky factor L of S = L Lᵀ at the prediction, m×m, row by row, lower; NaN if S was not computed.
    pub innovation_factor: &'a [f64],
    /// Normalised innovation squared, rᵀS⁻¹r.
    pub nis: f64,
    /// The gate's own statistic.
    pub statistic: f64,
    /// The limit with which the gate compared the statistic.
    pub threshold: f64,
    /// The gate's mode afterwards.
    pub mode: Mode,
    /// Per row of the residual, in its unit: the smallest error of that row alone that the gate's test rejects now;
    /// infinite if it rejects no error, NaN if nothing was judged.
    pub power: &'a [f64],
    /// Robust weight; 1 is full weight.
    pub weight: f64,
    /// See [`Estimator::rivals`].
    pub rivals: Rivals,
    /// H, over the axes of the belief, before the update; `None` if nothing was linearised.
    pub jacobian: Option<&'a Jacobian>,
}

/// Several beliefs, each of which may be true. One of them is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rivals {
    /// The number of beliefs, including the shown belief.
    pub count: usize,
    /// The probability of the shown belief.
    pub probability: f64,
    /// How far apart their attitudes and angles are: RMS of the difference from the shown belief, weighted by their
    /// probabilities \[rad\].
    pub apart: f64,
    /// `Some` if the latest update changed the shown hypothesis. The value is the change of the attitude or angle
    /// that differs most \[rad\].
    pub changed: Option<f64>,
    /// Whether each belief has rejected the latest measurement, by gates that do not know false measurements. False
    /// without a bank.
    pub rejected: bool,
}

impl Rivals {
    /// One belief alone.
    pub const NONE: Self = Self {
        count: 1,
        probability: 1.0,
        apart: 0.0,
        changed: None,
        rejected: false,
    };
}

/// A measurement ready for an estimator.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// Which of the design's sensors it comes from: a number, for estimators that remember.
    pub sensor: usize,
    /// The model.
    pub model: &'a dyn Measurement,
    /// The measured value.
    pub value: &'a [f64],
    /// R, m×m, row by row.
    pub noise: &'a [f64],
    /// The quality that the row itself reports, such as HDOP, for gates that use it.
    pub quality: Option<f64>,
    /// The input under which derivatives are taken. Its rates are free of the noise of the current sample, which is
    /// in the residual too. `None`: the current sample.
    pub derivative_input: Option<Input<'a>>,
    /// The remaining time offset; `None` for a measurement that is valid when it is used.
    pub lateness: Option<Lateness<'a>>,
}

/// Writes the orientations of `from` to `belief`.
pub(super) fn take_orientations(layout: &Layout, from: &Belief, belief: &mut Belief) {
    for block in layout.orientations() {
        let storage = block.storage_range();
        belief.x[storage.clone()].copy_from_slice(&from.x[storage]);
        belief.covariance.set_block(block, &from.covariance.block(block));
    }
}

/// The interface of every estimator, with or without a covariance.
pub trait Estimator: Memory + Printed + Send {
    /// The current belief.
    fn belief(&self) -> &Belief;

    /// The state layout.
    fn layout(&self) -> &Arc<Layout>;

    /// Whether its belief has a covariance that means something.
    fn keeps_covariance(&self) -> bool {
        true
    }

    /// Replaces the belief, at initialisation or when a snapshot is restored. Its covariance may be stored in another
    /// form than the estimator's.
    fn set_belief(&mut self, belief: Belief);

    /// Takes the orientations of `from`, uncorrelated with all other states, which keep their values.
    fn renew(&mut self, from: &Belief) {
        let mut belief = self.belief().clone();
        take_orientations(self.layout(), from, &mut belief);
        self.set_belief(belief);
    }

    /// Moves the belief to `to` under `input`.
    ///
    /// # Errors
    /// [`FilterError`]; the belief stays sound.
    fn predict(&mut self, to: Time, input: &Input<'_>) -> Result<(), FilterError>;

    /// Moves the belief to `to` without input, which has been missing for `missing` seconds by then. At the beginning
    /// of the gap the vehicle moved by the input `expected`, or by the latest input if that is `None`.
    ///
    /// # Errors
    /// [`FilterError`]; the belief stays sound.
    fn coast(&mut self, to: Time, missing: f64, expected: Option<&Input<'_>>) -> Result<(), FilterError>;

    /// Offers a measurement that is valid now. `others` is the latest outcome of each sensor of the design, for gates
    /// that depend on it; it may be empty.
    fn update<'a>(&'a mut self, observed: &Observed<'a>, gate: &mut dyn Gate, others: &[Option<Outcome>], loss: &dyn Loss) -> Update<'a>;

    /// H of the latest update, if it linearised.
    fn jacobian(&self) -> Option<&Jacobian> {
        None
    }

    /// The beliefs that are carried, if there are several.
    fn rivals(&self) -> Rivals {
        Rivals::NONE
    }

    /// The state and the process's signals, as models see them.
    fn view(&mut self) -> View<'_>;

    /// Sets whether it keeps its steps for [`Estimator::steps`]; it does not at first.
    fn keep_steps(&mut self, keep: bool);

    /// The steps of the latest prediction or update, if steps are kept.
    fn steps(&self) -> &[Step];
}

role!(Estimator);
