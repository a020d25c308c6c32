//! A series of statistics: its mean, and the correlation of neighbours in time.

use super::bounded::KEPT;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};

/// The number of lags of the autocorrelation.
const LAGS: usize = 5000;
/// The number of lags that are summed in parallel: a single sum would wait for each addition.
const ABREAST: usize = 8;

/// A series, in memory that does not grow with it.
///
/// It keeps the first 2^18 values, or fewer for a coarse series. A longer series keeps the means of 2, 4, … neighbours.
/// Count, mean and variance cover all values.
#[derive(Clone, Debug)]
pub struct Series {
    kept: usize,
    /// Means of `each` values.
    means: Vec<f64>,
    each: u64,
    /// The sum of the values of the next incomplete mean, and their number.
    open: (f64, u64),
    count: u64,
    sum: f64,
    /// Welford's mean and sum of squares.
    centre: f64,
    squares: f64,
}

impl Default for Series {
    fn default() -> Self {
        Self::keeping(KEPT)
    }
}

impl Memory for Series {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.means.remember(tape);
        self.each.remember(tape);
        self.open.remember(tape);
        self.count.remember(tape);
        self.sum.remember(tape);
        self.centre.remember(tape);
        self.squares.remember(tape);
        if self.each == 0 || self.means.len() > self.kept {
            tape.refuse("a series has another size");
        }
    }
}

impl Series {
    const fn keeping(kept: usize) -> Self {
        Self {
            kept,
            means: Vec::new(),
            each: 1,
            open: (0.0, 0),
            count: 0,
            sum: 0.0,
            centre: 0.0,
            squares: 0.0,
        }
    }

    /// A series that keeps 2^12 values, for use together with several others.
    pub(crate) const fn coarse() -> Self {
        Self::keeping(1 << 12)
    }

    /// Adds a value.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        let off = value - self.centre;
        self.centre += off / self.count as f64;
        self.squares += off * (value - self.centre);
        self.open.0 += value;
        self.open.1 += 1;
        if self.open.1 < self.each {
            return;
        }
        if self.means.len() == self.kept {
            // The new value starts a mean of twice as many values.
            (0..self.kept / 2).for_each(|k| self.means[k] = 0.5 * (self.means[2 * k] + self.means[2 * k + 1]));
            self.means.truncate(self.kept / 2);
            self.each *= 2;
            return;
        }
        self.means.push(self.open.0 / self.each as f64);
        self.open = (0.0, 0);
    }

    /// The number of values.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.count as usize
    }

    /// Returns true if there are no values.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Their mean.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// The number of independent values with the same information about the mean.
    ///
    /// Neighbours in time are correlated: N samples carry N/τ independent ones. τ = 1 + 2 Σ ρ_k is the integrated
    /// autocorrelation, summed up to the first ρ_k that is not positive. Source: Sokal 1997, §3.
    ///
    /// For a long series, τ comes from the means of neighbours. It is the variance of the means, times their own τ and
    /// the number of values in each, divided by the variance of the values. Source: Flyvbjerg and Petersen 1989.
    #[must_use]
    pub fn independent(&self) -> f64 {
        let mean = if self.each == 1 {
            self.mean()
        } else {
            self.means.iter().sum::<f64>() / self.means.len() as f64
        };
        self.independent_about(mean, self.squares)
    }

    /// The same for values whose true mean is known to be 0: a non-zero mean counts as an error that lasts for the
    /// whole series.
    #[must_use]
    pub(crate) fn independent_about_zero(&self) -> f64 {
        self.independent_about(0.0, self.squares + self.count as f64 * self.centre * self.centre)
    }

    /// The distance of the mean from 0 in units of its 1σ; 0 without values, or if all are equal.
    #[must_use]
    pub(crate) fn mean_sigmas(&self) -> f64 {
        if self.squares <= 0.0 {
            return 0.0;
        }
        let variance = self.squares / self.count as f64 / self.independent();
        self.mean() / math::sqrt(variance)
    }

    /// The same for a given mean, and the sum of the squared differences of all values from it.
    fn independent_about(&self, mean: f64, squares: f64) -> f64 {
        let off: Vec<f64> = self.means.iter().map(|value| value - mean).collect();
        let variance = off.iter().map(|d| d * d).sum::<f64>();
        if variance.is_nan() || variance <= 0.0 {
            return (self.count as f64).max(1.0);
        }
        let last = off.len().min(LAGS);
        let lags = (1..last).step_by(ABREAST).flat_map(|k| lagged(&off, k)).take(last - 1);
        let correlations = lags.map(|sum| sum / variance);
        let tau = 1.0 + 2.0 * correlations.take_while(|rho| *rho > 0.0).sum::<f64>();
        let of_values = if self.each == 1 {
            1.0
        } else {
            let of_means = variance / self.means.len() as f64;
            of_means * self.each as f64 / (squares / self.count as f64)
        };
        (self.count as f64 / (tau * of_values)).max(1.0)
    }
}

impl FromIterator<f64> for Series {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut series = Self::default();
        values.into_iter().for_each(|value| series.push(value));
        series
    }
}

/// Sums of the products of `off` with itself, shifted by `first` and by each of the following lags; 0 beyond its end.
/// Each sum is added in order of time.
fn lagged(off: &[f64], first: usize) -> [f64; ABREAST] {
    let mut sums = [0.0; ABREAST];
    let later = off.get(first..).unwrap_or_default();
    for (a, window) in off.iter().zip(later.windows(ABREAST)) {
        for (sum, b) in sums.iter_mut().zip(window) {
            *sum += a * b;
        }
    }
    let whole = (later.len() + 1).saturating_sub(ABREAST);
    for (k, sum) in sums.iter_mut().enumerate() {
        let rest = off[whole..].iter().zip(later.get(whole + k..).unwrap_or_default());
        *sum = rest.fold(*sum, |sum, (a, b)| sum + a * b);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise with the correlation `rho` between neighbours, from a separate generator, and its τ.
    fn noise(count: usize, rho: f64) -> (Series, f64) {
        let (mut bits, mut last) = (9_u64, 0.0);
        let series = (0..count).map(|_| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            last = rho * last + (bits >> 33) as f64 / f64::from(1_u32 << 31) - 0.5;
            last
        });
        (series.collect(), (1.0 + rho) / (1.0 - rho))
    }

    #[test]
    fn a_long_series_has_as_many_independent_values_as_its_parts() {
        for rho in [0.0, 0.9, 0.99] {
            for count in [KEPT, 5 * KEPT] {
                let (series, tau) = noise(count, rho);
                assert_eq!(series.len(), count);
                assert!(series.means.len() <= KEPT && series.means.capacity() <= KEPT);
                // For 262144 values with τ = 199, the sum of 1000 lags scatters by √(2·2000/262144) = 0.12: twice that.
                let found = count as f64 / series.independent();
                assert!((found / tau - 1.0).abs() < 0.25, "{found} for {tau} of {count}");
            }
        }
    }

    #[test]
    fn lags_side_by_side_are_the_lags_one_by_one_to_the_last_bit() {
        let series: Vec<f64> = (0..29).map(|k| f64::from(k * k % 17).sin()).collect();
        for count in [1, 7, 8, 9, 29] {
            let off = &series[..count];
            for first in 1..count + 2 {
                let one = |k: usize| {
                    off.iter()
                        .zip(off.get(k..).unwrap_or_default())
                        .fold(0.0, |sum, (a, b)| sum + a * b)
                };
                let expected: [f64; ABREAST] = core::array::from_fn(|k| one(first + k));
                assert_eq!(lagged(off, first), expected, "{count} {first}");
            }
        }
    }

    #[test]
    fn mean_and_count_are_those_of_all_values() {
        let count = 3 * KEPT + 1;
        let series: Series = (0..count).map(|k| k as f64).collect();
        assert_eq!(series.mean(), (count - 1) as f64 / 2.0);
        assert_eq!((series.len(), series.each), (count, 4));
        // The values of a mean are consecutive.
        assert_eq!(series.means[..3], [1.5, 5.5, 9.5]);
        assert_eq!(series.means.last(), Some(&(count as f64 - 3.5)));
        assert_eq!(series.open, ((count - 1) as f64, 1));
    }
}
