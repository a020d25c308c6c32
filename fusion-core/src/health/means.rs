//! Whether the innovations of a sensor have a mean, axis by axis: a sequential test.
//!
//! A mean of 1σ that lasts doubles the squares, which is far below any limit that spares single outliers. Of a hundred
//! measurements it is ten of its own 1σ.
//!
//! Numbers   z = r_i / √S_ii of the measurements that were used, within ±6
//! Noise     z is taken for an autoregression of first order: its sum grows as if each were independent with the
//!           variance v = max(1, c) (1 + ρ)/(1 − ρ), c the mean of z², ρ that of z_k z_k−1 over c, of the last 300.
//!           Not learnt while the test has come half way
//! Test      S ← max(0, S + z/√v − k), one such sum for each sign; k = ½, half-way between no mean and one of 1σ
//! Limit     h, so that all sums of a filter without error pass theirs once in the declared time: of one sum the
//!           mean number of measurements is 2 (exp b − b − 1), b = h + 1.166
//! Source    Page 1954, Continuous inspection schemes; Siegmund 1985, Sequential analysis, section II.6

use crate::filter::Update;

/// Measurements that the noise is learnt from, and for how many the declared noise counts at the beginning.
const MEMORY: f64 = 300.0;
const DECLARED: f64 = 30.0;
/// Beyond it a measurement says no more of a mean.
const MOST: f64 = 6.0;
/// The largest correlation of neighbours that is believed: what is closer to one is an error that lasts.
const CORRELATED: f64 = 0.95;
/// k.
const REFERENCE: f64 = 0.5;
/// By how much a discrete sum goes beyond the limit on average, twice \[σ\].
const BEYOND: f64 = 1.166;
/// A sum grows to so much of its limit and no further, so that good measurements bring it back.
const TOP: f64 = 1.25;

/// One axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// The latest number; not a number before the first.
    last: f64,
    square: f64,
    lagged: f64,
    count: f64,
    up: f64,
    down: f64,
}
crate::memory!(Axis {
    last,
    square,
    lagged,
    count,
    up,
    down
});

impl Default for Axis {
    fn default() -> Self {
        Self {
            last: f64::NAN,
            square: 1.0,
            lagged: 0.0,
            count: DECLARED,
            up: 0.0,
            down: 0.0,
        }
    }
}

impl Axis {
    const fn sum(&self) -> f64 {
        self.up.max(self.down)
    }

    fn add(&mut self, z: f64, limit: f64) {
        if !z.is_finite() {
            return;
        }
        let z = z.clamp(-MOST, MOST);
        if !self.last.is_nan() && self.sum() <= 0.5 * limit {
            self.count = (self.count + 1.0).min(MEMORY);
            self.square += (z * z - self.square) / self.count;
            self.lagged += (z * self.last - self.lagged) / self.count;
        }
        self.last = z;
        let rho = (self.lagged / self.square).clamp(0.0, CORRELATED);
        let y = z / (self.square.max(1.0) * (1.0 + rho) / (1.0 - rho)).sqrt();
        let most = TOP * limit;
        self.up = (self.up + y - REFERENCE).clamp(0.0, most);
        self.down = (self.down - y - REFERENCE).clamp(0.0, most);
    }
}

/// Follows the axes of one sensor.
#[derive(Clone, Debug)]
pub(super) struct Means {
    axes: Vec<Axis>,
    limit: f64,
    /// Mean time between two false alarms of one sum \[s\].
    between: f64,
}

impl crate::memory::Memory for Means {
    fn remember(&mut self, tape: &mut crate::memory::Tape<'_>) {
        self.axes.as_mut_slice().remember(tape);
        self.limit.remember(tape);
    }
}

impl Means {
    /// Of a sensor with so many rows, where one sum alone may pass its limit by chance once in `between` \[s\].
    pub(super) fn new(rows: usize, between: f64) -> Self {
        Self {
            axes: vec![Axis::default(); rows],
            limit: f64::INFINITY,
            between,
        }
    }

    /// Nothing is known of it.
    pub(super) fn restart(&mut self) {
        self.axes.fill(Axis::default());
    }

    /// What was said before is said no more; the noise stays as it is known.
    pub(super) fn forget(&mut self) {
        for axis in &mut self.axes {
            (axis.up, axis.down) = (0.0, 0.0);
        }
    }

    /// Hears a measurement that was used, of a sensor with one every `period` seconds; 0 where that is not yet known.
    pub(super) fn add(&mut self, update: &Update<'_>, period: f64) {
        self.limit = limit(self.between / period);
        for (axis, (r, sigma)) in self.axes.iter_mut().zip(update.residual.iter().zip(update.innovation_sigma)) {
            axis.add(r / sigma, self.limit);
        }
    }

    /// Whether a sum is beyond so much of its limit.
    pub(super) fn is_beyond(&self, share: f64) -> bool {
        self.axes.iter().any(|axis| axis.sum() > share * self.limit)
    }
}

/// The limit that a sum passes once in so many measurements on average; infinite where that is not finite.
fn limit(measurements: f64) -> f64 {
    if !measurements.is_finite() {
        return f64::INFINITY;
    }
    // exp b = 1 + b + n/2: each step of the fixed point is ten times as near where n is some thousands.
    let half = 0.5 * measurements.max(2.0);
    let b = (0..4).fold(half.ln(), |b, _| (1.0 + b + half).ln());
    (b - BEYOND).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Lcg;

    /// Of white noise of 1σ and this correlation of neighbours.
    fn noise(seed: u64, rho: f64) -> impl FnMut() -> f64 {
        let (mut random, mut last) = (Lcg::new(seed), 0.0);
        move || {
            last = rho * last + (1.0 - rho * rho).sqrt() * random.normal();
            last
        }
    }

    /// After how many measurements of this mean a sum passes its limit.
    fn passes(mean: f64, limit: f64, mut noise: impl FnMut() -> f64) -> usize {
        let mut axis = Axis::default();
        (0..2000).for_each(|_| axis.add(noise(), f64::INFINITY));
        (axis.up, axis.down) = (0.0, 0.0);
        (1..10_000_000)
            .find(|_| {
                axis.add(mean + noise(), limit);
                axis.sum() > limit
            })
            .unwrap()
    }

    #[test]
    fn the_limit_is_that_of_the_declared_rate_of_false_alarms() {
        // 400 alarms by chance of one sum of two: their mean has a 1σ of 5 %. The noise is known to a tenth, which
        // moves the rate by as much, and Siegmund's formula is good to some per cent.
        let limit = limit(2000.0);
        let runs = 400;
        let mean = (0..runs).map(|k| passes(0.0, limit, noise(k, 0.0))).sum::<usize>() as f64 / runs as f64;
        assert!((700.0..1500.0).contains(&mean), "{mean}");
    }

    #[test]
    fn a_mean_of_one_sigma_is_found_soon_and_correlated_noise_is_none() {
        // An hour at 1 Hz and 100 h between alarms: h = 11, which a mean of 1σ reaches in 2 h measurements.
        let limit = limit(360_000.0);
        let delay = (0..100).map(|k| passes(1.0, limit, noise(k, 0.0))).max().unwrap();
        assert!(delay < 80, "{delay}");
        let quiet = (0..20).filter(|k| passes(0.0, limit, noise(*k, 0.8)) > 3600).count();
        assert!(quiet >= 19, "{quiet}");
    }
}
