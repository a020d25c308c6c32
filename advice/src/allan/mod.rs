//! Allan deviation: the noises of an inertial unit, from what it gives at rest.
//!
//! [`deviation`] of each axis, [`Noises::fit`] to it, [`Study`] of a whole log; `fusion allan` shows it.
//!
//! Source   IEEE Std 952-1997, annex C: white noise N σ² = N²/τ, flicker noise B σ² = (2 ln 2/π) B²,
//!          random walk K σ² = K² τ/3; W. J. Riley, NIST Special Publication 1065 (2008)
//! Not here temperature, vibration and turn-on bias: a log at rest does not show them

mod chart;
mod fit;
mod log;
mod study;

pub use chart::svg;
pub use fit::Noises;
use fusion_core::math;
pub use log::{Columns, Instrument, Log, Moment, Part, declared, plain, stamped};
pub use study::{Axis, Study, toml};

use rayon::prelude::*;

/// Cluster lengths in a decade of time.
const PER_DECADE: f64 = 10.0;
/// Fewest clusters of one length: of 9 the deviation is known to a quarter, 1/√(2·8).
pub const FEWEST: usize = 9;

/// The deviation at one cluster time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Cluster time τ \[s\].
    pub tau: f64,
    /// Overlapping Allan deviation, in the unit of the samples.
    pub sigma: f64,
    /// Clusters in the log side by side, less one: the standard error of σ is σ/√(2 · `freedom`).
    pub freedom: f64,
}

/// The overlapping Allan deviation of evenly spaced samples, at cluster times that grow by a tenth of
/// a decade, up to a ninth of the log. Empty where there are fewer than two times nine samples.
///
/// σ²(τ) = ⟨(θ(t+2τ) − 2θ(t+τ) + θ(t))²⟩ / 2τ², θ the integral of the samples.
#[must_use]
pub fn deviation(samples: &[f64], interval: f64) -> Vec<Point> {
    let longest = samples.len() / FEWEST;
    if longest < 2 {
        return Vec::new();
    }
    // A mean would only cost digits of the sums.
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let mut sums = Vec::with_capacity(samples.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    sums.extend(samples.iter().map(|sample| {
        sum += sample - mean;
        sum
    }));
    let point = |m: usize| {
        let ends = sums.iter().zip(&sums[m..]).zip(&sums[2 * m..]);
        let terms = sums.len() - 2 * m;
        let squares: f64 = ends.map(|((first, middle), last)| math::powi(last - 2.0 * middle + first, 2)).sum();
        Point {
            tau: m as f64 * interval,
            sigma: math::sqrt(squares / (2.0 * terms as f64)) / m as f64,
            freedom: samples.len() as f64 / m as f64 - 1.0,
        }
    };
    lengths(longest).into_par_iter().map(point).collect()
}

/// Cluster lengths in samples, evenly spaced by their logarithm.
fn lengths(longest: usize) -> Vec<usize> {
    let steps = math::floor(PER_DECADE * math::log10(longest as f64)) as u32;
    let mut all: Vec<usize> = (0..=steps)
        .map(|k| math::round(math::powf(10_f64, f64::from(k) / PER_DECADE)) as usize)
        .collect();
    all.dedup();
    all
}

#[cfg(test)]
mod tests;
