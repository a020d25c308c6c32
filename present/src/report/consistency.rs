//! Whether errors and innovations are as large, and as independent, as the filter says.
//!
//! NEES, NIS   χ² with one degree of freedom per number: 19 of 20 lie between its quantiles of 2.5 and 97.5 %
//! r / σ       normal with variance one, each innovation r over its own σ from S = H P Hᵀ + R
//! ρ_k         Σ u_j u_{j+k} / Σ u_j², u = r / σ, no mean taken out: of white innovations 19 of 20 lie within
//!             ±1.96 / √N
//! gate        a consistent filter's NIS exceeds the threshold with the probability of the tail of its χ²
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4.2.

use super::trace::Trace;
use core::ops::RangeInclusive;
use fusion_core::consistency::{chi_square_quantile, chi_square_tail};
use fusion_core::filter::{Update, Verdict};
use fusion_core::math;

/// Bins of a histogram, a quarter of σ each, from −5 to 5; values beyond are in the outermost bins.
const BINS: usize = 40;
const PER_SIGMA: f64 = 4.0;
/// Lags of an autocorrelation, in measurements.
const LAGS: usize = 25;

/// The band in which 95 % of χ² of `dof` degrees of freedom lie.
pub(super) fn band(dof: usize) -> RangeInclusive<f64> {
    // The few quantiles are searched once: `chi_square_quantile` keeps them.
    let dof = dof as f64;
    chi_square_quantile(0.025, dof)..=chi_square_quantile(0.975, dof)
}

/// The number of values of a statistic within its expected band.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Share {
    /// Degrees of freedom.
    pub dof: usize,
    /// How many there were, and how many of them inside the band.
    pub count: u64,
    pub inside: u64,
}

fusion_core::memory!(Share { dof, count, inside });

impl Share {
    /// A value with its degrees of freedom. Values with fewer than the most are not counted: they have another band.
    /// Whether it was counted.
    pub(super) fn add(&mut self, value: f64, dof: usize) -> bool {
        if !value.is_finite() || dof == 0 || dof < self.dof {
            return false;
        }
        if dof > self.dof {
            *self = Self { dof, ..Self::default() };
        }
        self.count += 1;
        self.inside += u64::from(band(dof).contains(&value));
        true
    }
}

/// A statistic that should be χ², over time.
#[derive(Clone, Debug)]
pub(super) struct Judged {
    pub share: Share,
    pub series: Trace,
    buckets: usize,
}

fusion_core::memory!(Judged { share, series; buckets });

impl Judged {
    pub(super) fn new(buckets: usize) -> Self {
        Self {
            share: Share::default(),
            series: Trace::new(1, buckets),
            buckets,
        }
    }

    /// Adds the statistic at `t` \[s\] with its degrees of freedom, if there is one.
    pub(super) fn add(&mut self, t: f64, found: Option<(f64, usize)>) {
        let Some((value, dof)) = found else { return };
        let before = self.share.dof;
        if self.share.add(value, dof) {
            if dof > before {
                self.series = Trace::new(1, self.buckets);
            }
            self.series.push(t, &[value]);
        }
    }
}

/// The normalised innovations of one residual row.
#[derive(Clone, Debug)]
pub(super) struct Normalised {
    bins: [u64; BINS],
    /// How many.
    pub count: u64,
    /// Sums of products with itself, 0 to [`LAGS`] measurements later.
    products: [f64; LAGS + 1],
    /// The last ones, in a ring.
    recent: [f64; LAGS],
}

fusion_core::memory!(Normalised {
    bins,
    count,
    products,
    recent
});

impl Normalised {
    pub(super) const fn new() -> Self {
        Self {
            bins: [0; BINS],
            count: 0,
            products: [0.0; LAGS + 1],
            recent: [0.0; LAGS],
        }
    }

    /// The innovation `u` in units of its σ.
    pub(super) fn add(&mut self, u: f64) {
        if !u.is_finite() {
            return;
        }
        let bin = math::floor(u * PER_SIGMA) + BINS as f64 / 2.0;
        self.bins[bin.clamp(0.0, BINS as f64 - 1.0) as usize] += 1;
        self.products[0] += u * u;
        let at = self.count as usize % LAGS;
        // Before the first one there are zeros.
        for (lag, product) in self.products.iter_mut().enumerate().skip(1) {
            *product += u * self.recent[(at + LAGS - lag) % LAGS];
        }
        self.recent[at] = u;
        self.count += 1;
    }

    /// The share of values in each bin, per σ, to be compared with a density.
    pub(super) fn density(&self) -> Vec<f64> {
        let all = self.count.max(1) as f64;
        self.bins.iter().map(|n| *n as f64 * PER_SIGMA / all).collect()
    }

    /// The autocorrelation at 1, 2, … measurements; empty without innovations.
    pub(super) fn autocorrelation(&self) -> Vec<f64> {
        let lags = LAGS.min((self.count as usize).saturating_sub(1));
        let own = self.products[0];
        if own > 0.0 {
            self.products[1..=lags].iter().map(|p| p / own).collect()
        } else {
            Vec::new()
        }
    }
}

/// The rejections of a gate, and those expected for a consistent filter.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rejections {
    /// Measurements judged.
    pub judged: u64,
    /// Those rejected.
    pub rejected: u64,
    /// How many of them the gate would reject if all were as the filter expects.
    pub expected: f64,
    /// The latest threshold, and the probability of exceeding it.
    known: (f64, f64),
}

fusion_core::memory!(Rejections {
    judged,
    rejected,
    expected,
    known
});

impl Rejections {
    /// Counts the outcome of a measurement.
    pub(super) fn add(&mut self, update: &Update<'_>) {
        let is_judged = matches!(update.verdict, Verdict::Accepted | Verdict::Rejected | Verdict::Reacquired);
        if !is_judged || !update.threshold.is_finite() {
            return;
        }
        if self.known.0 != update.threshold {
            self.known = (update.threshold, chi_square_tail(update.threshold, update.residual.len() as f64));
        }
        self.judged += 1;
        self.rejected += u64::from(update.verdict == Verdict::Rejected);
        self.expected += self.known.1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform from −1 to 1, by its own generator.
    fn noise(count: usize) -> impl Iterator<Item = f64> {
        let mut bits = 9_u64;
        (0..count).map(move |_| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (bits >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
        })
    }

    #[test]
    fn white_innovations_have_no_correlation_and_averaged_ones_have_that_of_their_overlap() {
        let (mut white, mut mean) = (Normalised::new(), Normalised::new());
        let mut last = 0.0;
        for u in noise(40_000) {
            white.add(u);
            mean.add(0.5 * (u + last));
            last = u;
        }
        // ±1/√N = 0.005 each: four of them.
        assert!(
            white.autocorrelation().iter().all(|rho| rho.abs() < 0.02),
            "{:?}",
            white.autocorrelation()
        );
        let rho = mean.autocorrelation();
        // The mean of two neighbours shares half of its variance with the next, and nothing with those after.
        assert!(
            (rho[0] - 0.5).abs() < 0.02 && rho[1..].iter().all(|rho| rho.abs() < 0.02),
            "{rho:?}"
        );
        assert_eq!(rho.len(), LAGS);
    }

    #[test]
    fn a_histogram_has_the_density_of_its_values() {
        let mut n = Normalised::new();
        for u in [0.1, 0.2, -0.1, 0.3, 70.0, -70.0, f64::NAN] {
            n.add(u);
        }
        let density = n.density();
        assert_eq!((n.count, density.len()), (6, BINS));
        let expected = |count: f64| count / 6.0 / 0.25;
        assert_eq!(
            [density[19], density[20], density[21]],
            [expected(1.0), expected(2.0), expected(1.0)]
        );
        assert_eq!(
            [density[0], density[BINS - 1]],
            [expected(1.0); 2],
            "what lies beyond is in the outermost"
        );
    }

    #[test]
    fn one_value_has_no_autocorrelation() {
        let mut n = Normalised::new();
        assert!(n.autocorrelation().is_empty());
        n.add(1.0);
        assert!(n.autocorrelation().is_empty());
        n.add(-1.0);
        assert_eq!(n.autocorrelation(), [-0.5]);
    }

    #[test]
    fn what_has_fewer_degrees_of_freedom_is_not_judged_with_the_others() {
        let mut judged = Judged::new(16);
        // 95 % of χ² with two degrees of freedom lie between 0.051 and 7.378, with one between 0.001 and 5.024.
        for (t, found) in [(0.0, (6.0, 1)), (1.0, (6.0, 2)), (2.0, (8.0, 2)), (3.0, (1.0, 1)), (4.0, (0.05, 2))] {
            judged.add(t, Some(found));
        }
        judged.add(5.0, None);
        judged.add(6.0, Some((0.0, 0)));
        assert_eq!((judged.share.dof, judged.share.count, judged.share.inside), (2, 3, 1));
        assert_eq!(judged.series.columns(16, false).time, [1.0, 2.0, 4.0]);
    }
}
