//! Consistency: compares the errors of a filter with its covariance.
//!
//! This module has all statistics, their thresholds and their words.
//!
//! | statistic | consistent where | otherwise |
//! |---|---|---|
//! | mean NEES, mean NIS | in the two-sided 95 % band of a χ² mean | [`ConsistencyVerdict::Overconfident`] above, [`ConsistencyVerdict::Conservative`] below |
//! | share of errors inside 3σ | at least [`SHARE_INSIDE`] | [`ConsistencyVerdict::Overconfident`]; a share cannot be too large |
//!
//! Sources: Bar-Shalom, Li, Kirubarajan 2001, §5.4 (tests of NEES and NIS; they call the two
//! faults *optimistic* and *pessimistic*); Uhlmann 2003 (*conservative*: the covariance is not
//! smaller than that of the error).

use super::Series;
use fusion_core::consistency::mean_band;
use fusion_core::math;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The probability of the band of a mean statistic.
const BAND: f64 = 0.95;
/// The least share of errors inside 3σ that does not show overconfidence.
///
/// A consistent Gaussian filter has 0.997. At 0.98 the standard deviation of a Gaussian error is
/// 3/2.33 = 1.29 times the filter's own 1σ.
pub const SHARE_INSIDE: f64 = 0.98;

/// The result of comparing the errors of a filter with its covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConsistencyVerdict {
    /// The errors are as large as the covariance says.
    Consistent,
    /// The errors are larger than the covariance says.
    Overconfident,
    /// The errors are smaller than the covariance says.
    Conservative,
}

impl ConsistencyVerdict {
    /// The verdict for a share of errors inside their own 3σ; `None` if the share is NaN.
    #[must_use]
    pub fn of_share(inside: f64) -> Option<Self> {
        match inside {
            s if s.is_nan() => None,
            s if s < SHARE_INSIDE => Some(Self::Overconfident),
            _ => Some(Self::Consistent),
        }
    }

    /// The displayed word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::Overconfident => "overconfident",
            Self::Conservative => "conservative",
        }
    }
}

/// The mean of a χ² statistic with the band that a consistent filter stays in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Consistency {
    /// Mean over all samples.
    pub mean: f64,
    /// Degrees of freedom: the expected mean.
    pub dof: usize,
    /// Samples.
    pub count: usize,
    /// The number of independent samples, from the autocorrelation.
    pub independent: f64,
    /// The 95 % band of the mean.
    pub band: (f64, f64),
}

impl Consistency {
    /// From a series of statistics with `dof` degrees of freedom each; `None` for fewer than two. The band is for the
    /// number of [independent](Series::independent) values.
    #[must_use]
    pub fn of(series: &Series, dof: usize) -> Option<Self> {
        (series.len() >= 2).then(|| Self::with_independent(series.mean(), dof, series.len(), series.independent()))
    }

    /// The mean over several [independent runs](OverRuns::independent). `None` without a run.
    #[must_use]
    pub fn of_runs(runs: impl IntoIterator<Item = Self>) -> Option<Self> {
        OverRuns::of(runs).independent()
    }

    /// The mean over several runs that [repeat each other](OverRuns::repeated). `None` without a run.
    #[must_use]
    pub fn of_repeats(runs: impl IntoIterator<Item = Self>) -> Option<Self> {
        OverRuns::of(runs).repeated()
    }

    /// The same, with at most this number of independent samples.
    #[must_use]
    pub fn at_most(self, independent: f64) -> Self {
        Self::with_independent(self.mean, self.dof, self.count, self.independent.min(independent.max(1.0)))
    }

    /// The same as one of `judged` means that are judged together. The band is wider, so that all of them are within
    /// their bands with a probability of at least 95 %. This holds for any correlation between them (Bonferroni).
    #[must_use]
    pub fn among(self, judged: usize) -> Self {
        let probability = 1.0 - (1.0 - BAND) / judged.max(1) as f64;
        Self {
            band: mean_band(probability, self.dof, math::round(self.independent) as usize),
            ..self
        }
    }

    fn with_independent(mean: f64, dof: usize, count: usize, independent: f64) -> Self {
        Self {
            mean,
            dof,
            count,
            independent,
            band: mean_band(BAND, dof, math::round(independent) as usize),
        }
    }

    /// The verdict; `None` if the mean is NaN, or without a band for comparison.
    #[must_use]
    pub fn verdict(&self) -> Option<ConsistencyVerdict> {
        let (low, high) = self.band;
        if self.dof == 0 || self.mean.is_nan() || low.is_nan() || high.is_nan() {
            return None;
        }
        Some(match self.mean {
            m if m > high => ConsistencyVerdict::Overconfident,
            m if m < low => ConsistencyVerdict::Conservative,
            _ => ConsistencyVerdict::Consistent,
        })
    }

    /// Returns true if the mean is within its band.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        self.verdict() == Some(ConsistencyVerdict::Consistent)
    }

    /// The mean divided by its expected value: 1 if consistent, for any degrees of freedom.
    #[must_use]
    pub fn over_expected(&self) -> f64 {
        self.mean / self.dof as f64
    }

    /// The size of the errors in units of the filter's own 1σ: √(mean / dof), 1 if consistent.
    #[must_use]
    pub fn error_ratio(&self) -> f64 {
        math::sqrt(self.over_expected())
    }
}

/// Mean and variance of numbers that arrive one by one (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    count: f64,
    sum: f64,
    /// The mean that the squares refer to; [`Moments::mean`] has fewer roundings.
    about: f64,
    squares: f64,
}

impl Moments {
    /// Adds a number.
    pub fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.sum += value;
        let off = value - self.about;
        self.about += off / self.count;
        self.squares += off * (value - self.about);
    }

    /// The number of numbers.
    #[must_use]
    pub fn count(&self) -> f64 {
        self.count
    }

    /// The mean; NaN without a number.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.sum / self.count
    }

    /// The sum of the squared deviations from the mean.
    #[must_use]
    pub fn squares(&self) -> f64 {
        self.squares
    }
}

/// A mean χ² statistic over several runs that arrive one by one.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverRuns {
    dof: usize,
    means: Moments,
    count: usize,
    /// The independent samples of all runs, and of the run with the most.
    within: f64,
    most: f64,
}

impl OverRuns {
    fn of(runs: impl IntoIterator<Item = Consistency>) -> Self {
        runs.into_iter().fold(Self::default(), |mut all, run| {
            all.add(&run);
            all
        })
    }

    /// Adds a run.
    pub fn add(&mut self, run: &Consistency) {
        if self.means.count() == 0.0 {
            (self.dof, self.most) = (run.dof, 1.0);
        }
        self.means.add(run.mean);
        self.count += run.count;
        self.within += run.independent;
        self.most = self.most.max(run.independent);
    }

    /// The mean of independent runs, with a band for all their independent samples. `None` without a run.
    ///
    /// An error that is constant within a run, and new in each run, does not show in the autocorrelation. The runs then
    /// scatter more than their own samples predict. A mean of n independent χ² of d degrees of freedom has the variance
    /// 2 mean²/(d n). The scatter of the runs therefore limits n per run; the least n per run is 1.
    #[must_use]
    pub fn independent(&self) -> Option<Consistency> {
        let (number, mean) = (self.means.count(), self.means.mean());
        let scatter = self.means.squares() / (number - 1.0);
        let between = number * 2.0 * mean * mean / (self.dof as f64 * scatter);
        // One run, or runs without scatter, give no limit.
        let between = if between.is_finite() { between.max(number) } else { self.within };
        (number > 0.0).then(|| Consistency::with_independent(mean, self.dof, self.count, self.within.min(between)))
    }

    /// The mean of runs that repeat each other. The band is that of the run with the most independent samples. `None`
    /// without a run.
    #[must_use]
    pub fn repeated(&self) -> Option<Consistency> {
        (self.means.count() > 0.0).then(|| Consistency::with_independent(self.means.mean(), self.dof, self.count, self.most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_mean(mean: f64) -> Consistency {
        Consistency {
            mean,
            dof: 3,
            count: 100,
            independent: 100.0,
            band: (2.5, 3.5),
        }
    }

    #[test]
    fn a_mean_above_its_band_is_overconfident_and_one_below_conservative() {
        use ConsistencyVerdict::{Conservative, Consistent, Overconfident};
        let verdicts = [3.6, 3.5, 3.0, 2.5, 2.4, f64::INFINITY].map(|m| with_mean(m).verdict());
        let expected = [Overconfident, Consistent, Consistent, Consistent, Conservative, Overconfident];
        assert_eq!(verdicts, expected.map(Some));
    }

    #[test]
    fn there_is_no_verdict_on_what_is_not_a_number() {
        let no_band = Consistency {
            band: (f64::NAN, f64::NAN),
            ..with_mean(3.0)
        };
        let no_rows = Consistency { dof: 0, ..with_mean(0.0) };
        for c in [with_mean(f64::NAN), no_band, no_rows] {
            assert_eq!((c.verdict(), c.is_consistent()), (None, false), "{c:?}");
        }
        assert_eq!(ConsistencyVerdict::of_share(f64::NAN), None);
    }

    #[test]
    fn a_share_is_overconfident_below_its_threshold_only() {
        let verdicts = [0.0, 0.979, 0.98, 1.0].map(ConsistencyVerdict::of_share);
        use ConsistencyVerdict::{Consistent, Overconfident};
        assert_eq!(verdicts, [Overconfident, Overconfident, Consistent, Consistent].map(Some));
    }

    #[test]
    fn the_band_widens_with_correlation() {
        let slow: Series = (0..1000).map(|k| 3.0 + (k as f64 * 0.01).sin()).collect();
        let fast: Series = (0..1000).map(|k| 3.0 + if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let (slow, fast) = (Consistency::of(&slow, 3).unwrap(), Consistency::of(&fast, 3).unwrap());
        assert!(slow.independent < 10.0 && fast.independent > 999.0, "{slow:?} {fast:?}");
        assert!(slow.band.1 - slow.band.0 > 5.0 * (fast.band.1 - fast.band.0));
    }

    #[test]
    fn runs_together_have_the_band_of_all_their_independent_samples() {
        // 0.08 apart: less than the scatter of two means of 100 χ² of three degrees, √(2·9/300) = 0.24.
        let runs = [with_mean(2.96), with_mean(3.04)];
        let all = Consistency::of_runs(runs).unwrap();
        assert_eq!((all.mean, all.count, all.independent), (3.0, 200, 200.0));
        assert_eq!(all.band, mean_band(0.95, 3, 200));
        assert_eq!(Consistency::of_runs([]), None);
        let repeats = Consistency::of_repeats(runs).unwrap();
        assert_eq!((repeats.mean, repeats.count, repeats.independent), (3.0, 200, 100.0));
        assert_eq!(repeats.band, mean_band(0.95, 3, 100));
    }

    #[test]
    fn runs_that_scatter_by_an_error_of_their_own_are_that_many_samples() {
        // χ² of three degrees, one for each run: 60 of them at equal steps of their distribution.
        let quantile = |k: u32| fusion_core::consistency::chi_square_quantile((f64::from(k) + 0.5) / 60.0, 3.0);
        let all = Consistency::of_runs((0..60).map(|k| with_mean(quantile(k)))).unwrap();
        // As many samples as runs, and not 6000; a tenth more for the missing tail of 60 values.
        assert!((60.0..66.0).contains(&all.independent) && all.is_consistent(), "{all:?}");
    }

    #[test]
    fn fewer_independent_samples_widen_the_band_and_more_do_not_narrow_it() {
        let c = with_mean(3.2);
        let (fewer, more) = (c.at_most(2.3), c.at_most(1e6));
        assert_eq!((fewer.independent, fewer.band), (2.3, mean_band(0.95, 3, 2)));
        assert_eq!((more.independent, c.at_most(0.1).independent), (100.0, 1.0));
    }

    #[test]
    fn one_of_many_has_the_band_in_which_all_of_them_lie() {
        let c = with_mean(3.2).at_most(100.0);
        assert_eq!(c.among(1).band, mean_band(0.95, 3, 100));
        // χ² of 300 degrees at 1/8 of 5 %: 3 ± 0.67; 2.5 % would give 3 ± 0.48.
        let among = c.among(8);
        assert_eq!((among.mean, among.band), (3.2, mean_band(1.0 - 0.05 / 8.0, 3, 100)));
        assert!(among.band.0 < c.among(1).band.0 && c.among(1).band.1 < among.band.1);
    }

    #[test]
    fn the_error_ratio_is_that_of_the_standard_deviations() {
        assert_eq!(with_mean(12.0).error_ratio(), 2.0);
    }
}
