//! The belief: a nominal state and the covariance of its error, as a value.

use super::layout::Layout;
use crate::covariance::Covariance;
use crate::time::Time;

/// What the filter believes at one instant. Clone it to save it, assign it to restore it.
#[derive(Clone, Debug)]
pub struct Belief {
    /// The instant it is valid at.
    pub time: Time,
    /// Nominal state, in storage order of the [`Layout`].
    pub x: Vec<f64>,
    /// Covariance of the error true ⊟ nominal in the canonical chart.
    pub covariance: Covariance,
}

impl Belief {
    /// The initial belief a layout declares: initial values and variances, no correlation.
    #[must_use]
    pub fn initial(layout: &Layout, time: Time) -> Self {
        let mut covariance = Covariance::zeros(layout.dim());
        for block in layout.blocks() {
            for (i, sigma) in block.tangent_range().zip(&block.sigma) {
                covariance.set(i, i, sigma * sigma);
            }
        }
        Self {
            time,
            x: layout.initial().to_vec(),
            covariance,
        }
    }

    /// Whether every number of state and variance is finite and no variance negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.x.iter().all(|v| v.is_finite())
            && (0..self.covariance.dim()).all(|i| {
                let v = self.covariance.get(i, i);
                v.is_finite() && v >= 0.0
            })
    }
}
