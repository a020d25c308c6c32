//! Consistency statistics: χ² quantiles and the bands of mean NIS and NEES.

use crate::math;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The χ² quantile of `dof` degrees of freedom at `probability`, clamped into [0, 1).
///
/// A `dof` that is not positive gives 0.
#[must_use]
pub fn chi_square_quantile(probability: f64, dof: f64) -> f64 {
    #[cfg(feature = "std")]
    return kept::quantile(probability, dof);
    #[cfg(not(feature = "std"))]
    searched(probability, dof)
}

#[cfg(feature = "std")]
mod kept {
    use std::cell::RefCell;

    /// Quantiles that a thread keeps: a filter, each of its hypotheses and every variant of a design ask for the same
    /// few, and each is a search of some tens of microseconds.
    pub(super) const KEPT: usize = 32;

    std::thread_local! {
        /// Probability and degrees of freedom as bits, and the quantile; the latest last.
        pub(super) static KNOWN: RefCell<Vec<([u64; 2], f64)>> = const { RefCell::new(Vec::new()) };
    }

    pub(super) fn quantile(probability: f64, dof: f64) -> f64 {
        let key = [probability.to_bits(), dof.to_bits()];
        let known = KNOWN.with_borrow(|known| known.iter().find(|(of, _)| *of == key).map(|(_, quantile)| *quantile));
        known.unwrap_or_else(|| {
            let quantile = super::searched(probability, dof);
            KNOWN.with_borrow_mut(|known| {
                if known.len() == KEPT {
                    known.remove(0);
                }
                known.push((key, quantile));
            });
            quantile
        })
    }
}

fn searched(probability: f64, dof: f64) -> f64 {
    let probability = math::clamp(probability, 0.0, 1.0 - f64::EPSILON);
    ChiSquared::new(dof).map_or(0.0, |d| d.inverse_cdf(probability))
}

/// The probability that a χ² variable of `dof` degrees of freedom exceeds `x`: the share of the measurements of a
/// consistent filter that a gate with this threshold rejects.
///
/// A `dof` that is not positive gives 0.
#[must_use]
pub fn chi_square_tail(x: f64, dof: f64) -> f64 {
    ChiSquared::new(dof).map_or(0.0, |d| d.sf(x))
}

/// The two-sided band in which the mean of `count` independent χ² variables of `dof` degrees of
/// freedom lies with `probability`. Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4.
#[must_use]
pub fn mean_band(probability: f64, dof: usize, count: usize) -> (f64, f64) {
    let (n, total) = (count.max(1) as f64, (dof * count.max(1)) as f64);
    let tail = 0.5 * (1.0 - probability);
    (searched(tail, total) / n, searched(1.0 - tail, total) / n)
}

#[cfg(test)]
mod tests {
    use super::kept::{KEPT, KNOWN};
    use super::*;

    #[test]
    fn chi_square_quantiles_of_95_99_and_99_9_percent_match_the_printed_table() {
        // 6e-4: tables give three decimals.
        for (dof, want) in [
            (1.0, [3.841, 6.635, 10.828]),
            (2.0, [5.991, 9.210, 13.816]),
            (3.0, [7.815, 11.345, 16.266]),
            (6.0, [12.592, 16.812, 22.458]),
            (9.0, [16.919, 21.666, 27.877]),
            (15.0, [24.996, 30.578, 37.697]),
        ] {
            for (p, want) in [0.95, 0.99, 0.999].into_iter().zip(want) {
                assert!((chi_square_quantile(p, dof) - want).abs() < 6e-4, "{dof} {p}");
            }
        }
    }

    #[test]
    fn the_tail_beyond_a_quantile_is_what_the_quantile_leaves() {
        for dof in [1.0, 3.0, 15.0] {
            for p in [0.5, 0.95, 0.999] {
                let tail = chi_square_tail(chi_square_quantile(p, dof), dof);
                // The search for the quantile ends at a relative error of about 1e-8.
                assert!((tail - (1.0 - p)).abs() < 1e-6, "{dof} {p}: {tail}");
            }
        }
        assert_eq!(chi_square_tail(1.0, 0.0), 0.0);
    }

    #[test]
    fn mean_nees_bounds_of_50_and_100_runs_match_bar_shalom() {
        for (dof, n, lo, hi) in [
            (2, 50, 1.484, 2.591),
            (3, 50, 2.360, 3.716),
            (9, 50, 7.862, 10.213),
            (15, 50, 13.520, 16.556),
            (15, 100, 13.946, 16.092),
        ] {
            let (a, b) = mean_band(0.95, dof, n);
            // 6e-4: printed to three decimals.
            assert!((a - lo).abs() < 6e-4 && (b - hi).abs() < 6e-4, "{dof} {n}: {a} {b}");
        }
    }

    #[test]
    fn a_quantile_is_the_same_when_it_is_asked_for_again() {
        let all = || (1..=3 * KEPT).map(|dof| chi_square_quantile(0.95, dof as f64)).collect::<Vec<_>>();
        let expected: Vec<f64> = (1..=3 * KEPT).map(|dof| searched(0.95, dof as f64)).collect();
        assert_eq!((all(), all()), (expected.clone(), expected));
        assert_eq!(KNOWN.with_borrow(Vec::len), KEPT);
    }
}
