//! The noise of a sensor by its innovations, independent of the errors that the filter expects of the estimate.
//!
//! ```text
//! variance of innovations = variance of the predicted measurement + R ≥ R
//! white noise with the information of the innovations: variance · count / independent ones
//! ```
//!
//! If the white noise is smaller than the declared R in every row, R is too large, even for an exact estimate. If it is not,
//! a small NIS comes from the expected error of the estimate: the noise of the process, or an initial 1σ.
//!
//! Not here a constant error: the estimate takes it over, and innovations do not show it

use super::facts::Facts;
use super::instrument::Instrument;
use super::level::is_small_variance;
use fusion::observe::SensorStatistics;
use fusion_core::math;

/// Why NIS is too small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Excess {
    /// The declared noise of the sensor is too large.
    Noise,
    /// The noise is not too large: the filter expects errors of its estimate that are too large.
    Estimate,
    /// The facts do not decide.
    Unknown,
}

/// The 1σ of white noise with the information of the innovations, per row in SI: its density equals that of the error at
/// low frequencies, its variance times τ.
pub(super) fn white(s: &SensorStatistics) -> impl Iterator<Item = f64> {
    let own = &s.innovations;
    let rows = own.rms.iter().zip(&own.independent);
    rows.map(|(rms, independent)| rms * math::sqrt(own.count as f64 / independent))
}

impl Facts<'_> {
    /// Why the NIS of a sensor is too small. The noise is to blame only if all rows say so.
    pub(super) fn excess_of(&self, sensor: &Instrument, s: &SensorStatistics) -> Excess {
        let rows: Vec<(f64, f64)> = white(s).zip(s.innovations.independent.iter().copied()).collect();
        let declared = &sensor.noise;
        if rows.is_empty() || declared.len() != rows.len() {
            return Excess::Unknown;
        }
        let tests: usize = self.instruments.iter().map(|i| i.noise.len()).sum();
        let mut shares = rows
            .iter()
            .zip(declared)
            .map(|((white, n), sigma)| (math::powi(white / sigma, 2), *n));
        if shares.clone().all(|(share, n)| is_small_variance(share, n, tests)) {
            Excess::Noise
        } else if shares.all(|(share, _)| share >= 1.0) {
            Excess::Estimate
        } else {
            Excess::Unknown
        }
    }
}
