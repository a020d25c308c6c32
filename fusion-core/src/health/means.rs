//! Whether the innovations of a sensor have a mean, axis by axis: a sequential test.
//!
//! A lasting mean of 1σ doubles the squares, which is far below any limit that spares single outliers. Over a hundred
//! measurements the mean of z is ten times the 1σ of such a mean.
//!
//! Numbers   z = r_i / √S_ii of the measurements that were used, within ±6
//! Noise     the sum of z grows as if each z were independent with the variance v, the largest of five estimates.
//!           One is an autoregression, max(1, c) (1 + ρ)/(1 − ρ), c the mean of z², ρ the mean of z_k z_k−1 over c,
//!           of the last 300. Four use sums of 8, 16, 32 and 64 neighbours: the mean square of the last 30 sums over
//!           their length. Not learnt while the test is above half its limit
//! Test      S ← max(0, S + z/√v − k), one such sum for each sign; k = ½, half-way between no mean and a mean of 1σ
//! Limit     h, so that all sums of a filter without error together pass their limits once in the declared time: for
//!           one sum the mean number of measurements is 2 (exp b − b − 1), b = h + 1.166
//! Lasts     a sum counts once it has been above zero for the window of the innovations: the error of a vehicle that
//!           brakes harder than its process expects is not the mean of a sensor
//! Source    Batch means: Law & Kelton, Simulation modeling and analysis, section 9.5. Page 1954, Continuous inspection
//!           schemes; Siegmund 1985, Sequential analysis, section II.6

use crate::filter::Update;
use crate::math;
use alloc::vec::Vec;

/// Measurements that the noise is learnt from, and the number of measurements as which the declared noise counts at
/// first.
const MEMORY: f64 = 300.0;
const DECLARED: f64 = 30.0;
/// Lengths of sums of neighbours; the number of sums that the variance is learnt from; the number as which the
/// declared variance counts.
const BATCHES: [f64; 4] = [8.0, 16.0, 32.0, 64.0];
const BATCH_MEMORY: f64 = 30.0;
const BATCH_DECLARED: f64 = 4.0;
/// A larger measurement counts as this value.
const MOST: f64 = 6.0;
/// The largest correlation of neighbours that counts as noise. A correlation closer to one is a slow error.
const CORRELATED: f64 = 0.95;
/// k.
const REFERENCE: f64 = 0.5;
/// Twice the distance by which a discrete sum passes the limit on average \[σ\].
const BEYOND: f64 = 1.166;
/// A sum grows to at most this multiple of its limit, so that good measurements bring it back.
const TOP: f64 = 1.25;

/// One axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// The latest number; NaN before the first.
    last: f64,
    square: f64,
    lagged: f64,
    count: f64,
    batches: [Batch; BATCHES.len()],
    up: Sum,
    down: Sum,
}
crate::memory!(Axis {
    last,
    square,
    lagged,
    count,
    batches,
    up,
    down
});

/// The sum of a number of neighbours, and the statistics of the sums before it.
#[derive(Clone, Copy, Debug)]
struct Batch {
    sum: f64,
    length: f64,
    variance: f64,
    count: f64,
}
crate::memory!(Batch {
    sum,
    length,
    variance,
    count
});

impl Default for Batch {
    fn default() -> Self {
        Self {
            sum: 0.0,
            length: 0.0,
            variance: 1.0,
            count: BATCH_DECLARED,
        }
    }
}

impl Batch {
    /// Adds to sums of `most` numbers. A sum that ends while nothing is learnt is left out.
    fn add(&mut self, z: f64, most: f64, is_learnt: bool) {
        (self.sum, self.length) = (self.sum + z, self.length + 1.0);
        if self.length < most {
            return;
        }
        if is_learnt {
            self.count = (self.count + 1.0).min(BATCH_MEMORY);
            self.variance += (self.sum * self.sum / most - self.variance) / self.count;
        }
        (self.sum, self.length) = (0.0, 0.0);
    }
}

/// S of one sign, and for how many measurements it has been above zero.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    value: f64,
    length: f64,
}
crate::memory!(Sum { value, length });

impl Sum {
    fn add(&mut self, y: f64, most: f64) {
        self.value = math::clamp(self.value + y - REFERENCE, 0.0, most);
        self.length = if self.value > 0.0 { self.length + 1.0 } else { 0.0 };
    }

    fn is_beyond(&self, limit: f64, least: f64) -> bool {
        self.value > limit && self.length >= least
    }
}

impl Default for Axis {
    fn default() -> Self {
        Self {
            last: f64::NAN,
            square: 1.0,
            lagged: 0.0,
            count: DECLARED,
            batches: [Batch::default(); BATCHES.len()],
            up: Sum::default(),
            down: Sum::default(),
        }
    }
}

impl Axis {
    const fn sum(&self) -> f64 {
        self.up.value.max(self.down.value)
    }

    fn add(&mut self, z: f64, limit: f64) {
        if !z.is_finite() {
            return;
        }
        let z = math::clamp(z, -MOST, MOST);
        let is_learnt = self.sum() <= 0.5 * limit;
        for (batch, length) in self.batches.iter_mut().zip(BATCHES) {
            batch.add(z, length, is_learnt);
        }
        if !self.last.is_nan() && is_learnt {
            self.count = (self.count + 1.0).min(MEMORY);
            self.square += (z * z - self.square) / self.count;
            self.lagged += (z * self.last - self.lagged) / self.count;
        }
        self.last = z;
        let rho = math::clamp(self.lagged / self.square, 0.0, CORRELATED);
        let correlated = self.square.max(1.0) * (1.0 + rho) / (1.0 - rho);
        let y = z / math::sqrt(self.batches.iter().fold(correlated, |v, batch| v.max(batch.variance)));
        let most = TOP * limit;
        self.up.add(y, most);
        self.down.add(-y, most);
    }
}

/// Follows the axes of one sensor.
#[derive(Clone, Debug)]
pub(super) struct Means {
    axes: Vec<Axis>,
    limit: f64,
    /// For how many measurements a sum has to be above zero.
    least: f64,
    /// Mean time between two false alarms of one sum \[s\].
    between: f64,
}

impl crate::memory::Memory for Means {
    fn remember(&mut self, tape: &mut crate::memory::Tape<'_>) {
        self.axes.as_mut_slice().remember(tape);
        self.limit.remember(tape);
        self.least.remember(tape);
    }
}

impl Means {
    /// For a sensor with `rows` rows. One sum alone may pass its limit by chance once in `between` \[s\].
    pub(super) fn new(rows: usize, between: f64) -> Self {
        Self {
            axes: vec![Axis::default(); rows],
            limit: f64::INFINITY,
            least: 0.0,
            between,
        }
    }

    /// Forgets everything.
    pub(super) fn restart(&mut self) {
        self.axes.fill(Axis::default());
    }

    /// Forgets the sums; the noise stays as it was learnt.
    pub(super) fn forget(&mut self) {
        for axis in &mut self.axes {
            (axis.up, axis.down) = (Sum::default(), Sum::default());
        }
    }

    /// Takes a measurement that was used, of a sensor with the period `period` \[s\], 0 if it is not yet known. A
    /// mean has to last for `window` seconds.
    pub(super) fn add(&mut self, update: &Update<'_>, period: f64, window: f64) {
        self.least = window / period;
        self.limit = limit(self.between / period);
        for (axis, (r, sigma)) in self.axes.iter_mut().zip(update.residual.iter().zip(update.innovation_sigma)) {
            axis.add(r / sigma, self.limit);
        }
    }

    /// Whether a sum is beyond the fraction `share` of its limit.
    pub(super) fn is_beyond(&self, share: f64) -> bool {
        let limit = share * self.limit;
        let is_beyond = |sum: &Sum| sum.is_beyond(limit, self.least);
        self.axes.iter().any(|axis| is_beyond(&axis.up) || is_beyond(&axis.down))
    }
}

/// The limit that a sum passes once in this number of measurements on average; infinite if the number is not finite.
fn limit(measurements: f64) -> f64 {
    if !measurements.is_finite() {
        return f64::INFINITY;
    }
    // exp b = 1 + b + n/2: each step of the fixed point is ten times as near if n is some thousands.
    let half = 0.5 * measurements.max(2.0);
    let b = (0..4).fold(math::ln(half), |b, _| math::ln(1.0 + b + half));
    (b - BEYOND).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Lcg;

    /// Gaussian noise of 1σ with this correlation of neighbours.
    fn noise(seed: u64, rho: f64) -> impl FnMut() -> f64 {
        let (mut random, mut last) = (Lcg::new(seed), 0.0);
        move || {
            last = rho * last + (1.0 - rho * rho).sqrt() * random.normal();
            last
        }
    }

    /// The number of measurements with this mean until a sum passes its limit, if within `most`.
    fn passes(mean: f64, limit: f64, most: usize, mut noise: impl FnMut() -> f64) -> Option<usize> {
        let mut axis = Axis::default();
        (0..2000).for_each(|_| axis.add(noise(), f64::INFINITY));
        (axis.up, axis.down) = (Sum::default(), Sum::default());
        (1..=most).find(|_| {
            axis.add(mean + noise(), limit);
            axis.sum() > limit
        })
    }

    #[test]
    fn the_limit_is_that_of_the_declared_rate_of_false_alarms() {
        // The test counts 400 false alarms of two sums: their mean interval has a 1σ of 5 %. The largest of five
        // estimates of the variance is above the true variance: alarms are rarer than declared, and less than four
        // times as rare.
        let limit = limit(2000.0);
        let runs = 400;
        let mean = (0..runs)
            .map(|k| passes(0.0, limit, usize::MAX, noise(k, 0.0)).unwrap())
            .sum::<usize>() as f64
            / runs as f64;
        assert!((900.0..4000.0).contains(&mean), "{mean}");
    }

    #[test]
    fn a_mean_of_one_sigma_is_found_soon_and_correlated_noise_is_none() {
        // An hour at 1 Hz and 100 h between alarms: h = 11, which a mean of 1σ reaches in 2 h measurements.
        let limit = limit(360_000.0);
        let late = (0..100).filter(|k| passes(1.0, limit, 80, noise(*k, 0.0)).is_none()).count();
        assert_eq!(late, 0);
        let quiet = (0..20).filter(|k| passes(0.0, limit, 3600, noise(*k, 0.8)).is_none()).count();
        assert!(quiet >= 19, "{quiet}");
    }

    #[test]
    fn a_short_transient_is_no_mean_and_one_that_lasts_is() {
        let (limit, least) = (limit(360_000.0), 100.0);
        let mut axis = Axis::default();
        let mut told = |z: f64, count: usize| {
            (0..count).fold(false, |told, _| {
                axis.add(z, limit);
                told || axis.down.is_beyond(limit, least)
            })
        };
        // Two seconds of braking at 10 Hz, and then rest.
        assert!(!told(-3.0, 20) && !told(0.0, 200));
        assert!(told(-3.0, 101));
    }
}
