//! Steps as values, for smoothers, ledgers and reports on one update that work without the filter.

use super::estimator::Observed;
use crate::belief::Belief;
use crate::linear::{BlockMatrix, Jacobian, Transition};
use crate::model::{Gap, Input, LastInput, Size};
use alloc::boxed::Box;
use alloc::vec::Vec;

/// The cause of a change of the belief that is not a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// The process moved by the input of the posterior.
    Input {
        /// The length of the step \[s\].
        duration: f64,
    },
    /// The process moved without input, by the motion of the posterior.
    Gap(Gap),
    /// The orientations were replaced by the posterior's orientations, which do not depend on the earlier estimate.
    Renewal,
}

/// A measurement as it was offered, for an evaluation of its model at another state.
#[derive(Clone, Debug, Default)]
pub struct Offered {
    /// The number of its sensor.
    pub sensor: usize,
    /// The measured value z.
    pub value: Vec<f64>,
    /// R, m×m, row by row, before any robust weight.
    pub noise: Vec<f64>,
    /// The input under which derivatives were taken; `None`: the input of the belief.
    pub derivative_input: Option<LastInput>,
    /// The change of the prediction by the input of the belief, compared with that input; empty without it.
    pub input_change: Vec<f64>,
    /// The time offset by which it would be valid at its time \[s\], and the input about that time; `None` without an
    /// offset.
    pub lateness: Option<(f64, LastInput)>,
}

impl Offered {
    /// A measurement that was linearised at the prior; `input_change` is the change of its prediction by the input of the
    /// belief, if another input was used.
    pub(super) fn of(observed: &Observed<'_>, input_change: &[f64]) -> Self {
        let Size { value, residual: m } = observed.model.size();
        let kept = |input: &Input<'_>| {
            let mut kept = LastInput::default();
            kept.take(input);
            kept
        };
        let smooth = observed.derivative_input.filter(|_| observed.model.reads_signals());
        Self {
            sensor: observed.sensor,
            value: observed.value[..value].to_vec(),
            noise: observed.noise[..m * m].to_vec(),
            derivative_input: smooth.as_ref().map(kept),
            input_change: smooth.map_or_else(Vec::new, |_| input_change.to_vec()),
            lateness: observed.lateness.as_ref().map(|l| (l.assumed, kept(&l.input))),
        }
    }
}

/// One step of the estimator. All matrices are in the canonical chart.
#[derive(Clone, Debug)]
pub enum Step {
    /// The belief moved in time: x⁺ = f(x), P⁺ = Φ(P + Q_before)Φᵀ + Q_after.
    Predicted {
        /// Before.
        prior: Belief,
        /// Why.
        cause: Cause,
        /// Φ and the process noise.
        transition: Transition,
        /// After.
        posterior: Belief,
    },
    /// P grew before a measurement was believed against it; x is unchanged.
    Inflated {
        /// Before.
        prior: Belief,
        /// After.
        posterior: Belief,
    },
    /// A measurement corrected the belief: δ = K r, P⁺ = J (I − KH) P Jᵀ with the prior's P and K = PHᵀS⁻¹. A rule
    /// that does not linearise at the prior gives H, r and J for which this holds: smoothing relies on it.
    Corrected {
        /// Before.
        prior: Belief,
        /// The measurement.
        offered: Box<Offered>,
        /// H.
        jacobian: Jacobian,
        /// R, m×m, row by row, with the robust weight in it.
        noise: Vec<f64>,
        /// The vector that K multiplies to give δ: r = z ⊟ h(x̂), or r + H δ at the last linearisation of an iterated
        /// update.
        residual: Vec<f64>,
        /// S, m×m, row by row.
        innovation: Vec<f64>,
        /// Kᵀ, m×n, row by row.
        gain: Vec<f64>,
        /// δ = K r, in tangent coordinates.
        correction: Vec<f64>,
        /// J of P ← J P Jᵀ where the chart moved the covariance with the state.
        reset: Option<BlockMatrix>,
        /// After.
        posterior: Belief,
    },
}
