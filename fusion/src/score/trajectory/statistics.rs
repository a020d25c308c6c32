//! Statistics of non-negative errors.

use fusion_core::math;
use schemars::JsonSchema;
use serde::Serialize;

/// Statistics of errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Statistics {
    /// The number of errors.
    pub count: usize,
    /// Root mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median: the middle value, or the mean of the two middle values.
    pub median: f64,
    /// The 95 % quantile.
    pub p95: f64,
    /// Standard deviation about the mean, with division by the count.
    pub std: f64,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
}

impl Statistics {
    /// `None` without values.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.collect();
        values.sort_unstable_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let (count, n) = (values.len(), values.len() as f64);
        let mean = values.iter().sum::<f64>() / n;
        Some(Self {
            count,
            rmse: math::sqrt(values.iter().map(|v| v * v).sum::<f64>() / n),
            mean,
            median: 0.5 * (values[(count - 1) / 2] + values[count / 2]),
            p95: values[(math::ceil(0.95 * n) as usize).clamp(1, count) - 1],
            std: math::sqrt(values.iter().map(|v| math::powi(v - mean, 2)).sum::<f64>() / n),
            min,
            max,
        })
    }
}
