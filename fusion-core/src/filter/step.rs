//! Steps as values, for smoothers, ledgers and reports on one update that work without the filter.

use crate::belief::Belief;
use crate::linear::{BlockMatrix, Jacobian, Transition};

/// One step of the estimator. All matrices are in the canonical chart.
#[derive(Clone, Debug)]
pub enum Step {
    /// The belief moved in time: x⁺ = f(x), P⁺ = Φ(P + Q_before)Φᵀ + Q_after.
    Predicted {
        /// Before.
        prior: Belief,
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
