//! Consistency statistics: χ² quantiles and the bands of mean NIS and NEES.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The χ² quantile of `dof` degrees of freedom at `probability`, clamped into [0, 1).
///
/// A `dof` that is not positive gives 0.
#[must_use]
pub fn chi_square_quantile(probability: f64, dof: f64) -> f64 {
    let probability = probability.clamp(0.0, 1.0 - f64::EPSILON);
    ChiSquared::new(dof).map_or(0.0, |d| d.inverse_cdf(probability))
}

/// The two-sided band in which the mean of `count` independent χ² variables of `dof` degrees of
/// freedom lies with `probability`. Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4.
#[must_use]
pub fn mean_band(probability: f64, dof: usize, count: usize) -> (f64, f64) {
    let (n, total) = (count.max(1) as f64, (dof * count.max(1)) as f64);
    let tail = 0.5 * (1.0 - probability);
    (chi_square_quantile(tail, total) / n, chi_square_quantile(1.0 - tail, total) / n)
}

#[cfg(test)]
mod tests {
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
}
