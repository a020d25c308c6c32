//! Steps as values: what a smoother, a ledger or a look at one update needs, without the filter.

use crate::linear::{BlockMatrix, Jacobian, Transition};
use crate::state::Belief;

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
    /// A measurement corrected the belief.
    Corrected {
        /// Before.
        prior: Belief,
        /// H.
        jacobian: Jacobian,
        /// R, m×m, row by row, with the robust weight in it.
        noise: Vec<f64>,
        /// r = z ⊟ h(x̂).
        residual: Vec<f64>,
        /// δ = K r, in tangent coordinates.
        correction: Vec<f64>,
        /// J of P ← J P Jᵀ where the chart moved the covariance with the state.
        reset: Option<BlockMatrix>,
        /// After.
        posterior: Belief,
    },
}
