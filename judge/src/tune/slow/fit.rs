//! The slow error that explains the autocorrelation of innovations.
//!
//! ```text
//! E[u u′] at lag l = (expected S at lag 0) + σ² c(l; τ) + d c(l; white)
//! ```
//!
//! σ² is the variance of the slow error, and d is the variance of the white noise less the declared one. For each τ both
//! follow by least squares, and τ is that with the smallest residuals. The 1σ is by the jackknife over blocks of time.
//!
//! Source     Miller 1974 (Biometrika 61, 1): the jackknife

use super::response::Products;
use crate::likelihood::BLOCKS;
use fusion_core::math;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// The ratio of neighbouring correlation times that are tried.
pub(super) const RATIO: f64 = 2.0;

/// A slow error of a sensor, along the axes of its state.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fit {
    /// Its correlation time \[s\], and the 95 % interval; infinite if the log is too short to limit it.
    pub(super) tau: f64,
    pub(super) interval: (f64, f64),
    /// Its variance along each axis; 0 if nothing is seen along the axis.
    pub(super) variance: Vec<f64>,
    /// The variance of the white noise over the declared one, as the mean of the axes.
    pub(super) white: f64,
}

/// The moments of one axis, with a block left out or with all blocks.
struct Moments<'a> {
    /// Mean product less what the filter expects, for each class of lags. Classes count alike: those with more products have
    /// longer lags, at which the products of a slow error repeat each other.
    excess: Vec<Option<f64>>,
    /// The variance of u that the filter expects.
    scale: f64,
    products: &'a Products,
}

impl<'a> Moments<'a> {
    fn of(products: &'a Products, without: Option<usize>) -> Self {
        let scale = products.declared.0 / products.declared.1;
        let blocks = || {
            products
                .observed
                .iter()
                .enumerate()
                .filter(|(b, _)| Some(*b) != without)
                .map(|(_, own)| own)
        };
        let of_lag = |lag: usize| {
            let (sum, count) = blocks().fold((0.0, 0.0), |all, own| (all.0 + own[lag].0, all.1 + own[lag].1));
            let expected = if lag == 0 { scale } else { 0.0 };
            (count > 0.0).then(|| sum / count - expected)
        };
        Self {
            excess: (0..products.observed[0].len()).map(of_lag).collect(),
            scale,
            products,
        }
    }

    /// The mean product that a unit error gives at a lag, between two correlation times that were tried.
    fn unit(&self, place: f64, lag: usize) -> f64 {
        let mean = |tau: usize| {
            let (sum, count) = self.products.expected[tau][lag];
            if count > 0.0 { sum / count } else { 0.0 }
        };
        let low = place as usize;
        let share = place - low as f64;
        let high = (low + 1).min(self.products.expected.len() - 1);
        (1.0 - share) * mean(low) + share * mean(high)
    }

    /// σ², d and the sum of squared residuals, in units of `scale`.
    fn fit(&self, place: f64) -> [f64; 3] {
        let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
        let rows = || {
            let heard = self.excess.iter().enumerate().filter_map(|(lag, own)| Some((lag, (*own)?)));
            heard.map(|(lag, own)| ([self.unit(place, lag), self.unit(0.0, lag)], own))
        };
        for (unit, excess) in rows() {
            for i in 0..2 {
                b[i] += unit[i] * excess;
                (0..2).for_each(|j| a[i][j] += unit[i] * unit[j]);
            }
        }
        let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        let slow = (b[0] * a[1][1] - b[1] * a[0][1]) / determinant;
        // A variance is not negative, and no number follows from equal columns.
        let slow = if slow > 0.0 { slow } else { 0.0 };
        let white = (b[1] - a[1][0] * slow) / a[1][1];
        let squares: f64 = rows()
            .map(|(unit, excess)| math::powi(excess - slow * unit[0] - white * unit[1], 2))
            .sum();
        [slow, white, squares / (self.scale * self.scale)]
    }
}

/// The place of the best correlation time among those that were tried: the vertex of a parabola through the best and its
/// neighbours.
fn best(axes: &[Moments<'_>], count: usize) -> f64 {
    // The first one is white noise.
    let squares: Vec<f64> = (1..count)
        .map(|place| axes.iter().map(|axis| axis.fit(place as f64)[2]).sum())
        .collect();
    let least = (0..squares.len()).min_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(0);
    let vertex = match (least.checked_sub(1), squares.get(least + 1)) {
        (Some(before), Some(after)) => {
            let (slope, curve) = (0.5 * (after - squares[before]), after - 2.0 * squares[least] + squares[before]);
            if curve > 0.0 { -slope / curve } else { 0.0 }
        }
        _ => 0.0,
    };
    1.0 + least as f64 + vertex
}

/// The 1σ, from estimates that leave out one block each.
fn jackknife(estimates: &[f64]) -> f64 {
    let count = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / count;
    let squares: f64 = estimates.iter().map(|e| math::powi(e - mean, 2)).sum();
    math::sqrt(squares * (count - 1.0) / count)
}

/// The quantile of Student's distribution of a figure whose 1σ is by the jackknife over so many blocks.
fn student(probability: f64, blocks: usize) -> f64 {
    StudentsT::new(0.0, 1.0, blocks as f64 - 1.0).map_or(f64::INFINITY, |t| t.inverse_cdf(probability))
}

/// The slow error that products show, with the correlation times that were tried, of which the first is white noise. `None` if
/// chance alone gives one of the axes such an error with this probability, and if too few rows were heard.
pub(super) fn fit(products: &[Products], taus: &[f64], chance: f64) -> Option<Fit> {
    let heard: Vec<&Products> = products.iter().filter(|own| own.declared.1 > 0.0).collect();
    let is_filled = |b: &usize| heard.iter().all(|own| own.observed[*b][0].1 > 0.0);
    let blocks: Vec<usize> = (0..BLOCKS).filter(is_filled).collect();
    if heard.is_empty() || taus.len() < 3 || blocks.len() < 2 {
        return None;
    }
    let axes = |without: Option<usize>| heard.iter().map(|own| Moments::of(own, without)).collect::<Vec<_>>();
    let all = axes(None);
    let place = best(&all, taus.len());
    let others: Vec<Vec<Moments<'_>>> = blocks.iter().map(|b| axes(Some(*b))).collect();
    let places: Vec<f64> = others.iter().map(|own| best(own, taus.len())).collect();
    let fitted = heard.iter().enumerate().map(|(axis, own)| {
        let [slow, white, _] = all[axis].fit(place);
        let each: Vec<f64> = others.iter().map(|axes| axes[axis].fit(place)[0]).collect();
        (slow, slow / jackknife(&each), 1.0 + white * own.noise.1 / own.noise.0)
    });
    let fitted: Vec<(f64, f64, f64)> = fitted.collect();
    let limit = student(1.0 - chance / heard.len() as f64, blocks.len());
    // A variance of zero without scatter has no number of its 1σ.
    if !fitted.iter().any(|(_, sigmas, _)| *sigmas > limit) {
        return None;
    }
    let mut variances = fitted.iter().map(|f| f.0);
    let variance = products.iter().map(|own| {
        if own.declared.1 > 0.0 {
            variances.next().unwrap_or(0.0)
        } else {
            0.0
        }
    });
    let width = student(0.975, blocks.len()) * jackknife(&places);
    let tau_at = |place: f64| taus[1] * math::exp((place - 1.0) * math::ln(RATIO));
    let (from, to, last) = (place - width, place + width, taus.len() as f64 - 1.0);
    Some(Fit {
        tau: tau_at(place),
        interval: (
            if from < 1.0 || width == 0.0 { 0.0 } else { tau_at(from) },
            if to < last { tau_at(to) } else { f64::INFINITY },
        ),
        variance: variance.collect(),
        white: fitted.iter().map(|f| f.2).sum::<f64>() / fitted.len() as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor whose error is not followed: unit errors have the autocorrelation e^(−l/τ).
    fn products(taus: &[f64], observed: impl Fn(usize, usize) -> f64) -> Products {
        let lags = 0..12_u32;
        let unit = |tau: f64| {
            lags.clone()
                .map(|lag| {
                    (
                        (if tau > 0.0 {
                            (-f64::from(lag) / tau).exp()
                        } else {
                            f64::from(u8::from(lag == 0))
                        }),
                        1.0,
                    )
                })
                .collect()
        };
        Products {
            observed: (0..BLOCKS)
                .map(|b| lags.clone().map(|lag| (observed(b, lag as usize), 1.0)).collect())
                .collect(),
            expected: taus.iter().map(|tau| unit(*tau)).collect(),
            declared: (4.0, 1.0),
            noise: (4.0, 1.0),
        }
    }

    #[test]
    fn variance_and_correlation_time_of_an_exact_autocorrelation_are_found() {
        let taus = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0];
        // σ² = 9 with τ = 4, and white noise of variance 1 where 4 is declared. Blocks differ by a part in ten thousand.
        let exact =
            |b: usize, lag: usize| (9.0 * (-(lag as f64) / 4.0).exp() + if lag == 0 { 1.0 } else { 0.0 }) * (1.0 + 1e-4 * (b as f64 - 9.5));
        let found = fit(&[products(&taus, exact)], &taus, 0.05).unwrap();
        // The blocks have the mean 1, and a parabola through unequal neighbours moves the vertex by less than a quarter.
        assert!((found.tau / 4.0 - 1.0).abs() < 0.25, "{found:?}");
        assert!(found.interval.0 <= found.tau && found.tau <= found.interval.1, "{found:?}");
        let at_best = products(&taus, exact);
        let moments = Moments::of(&at_best, None);
        let [slow, white, squares] = moments.fit(3.0);
        assert!(
            (slow - 9.0).abs() < 1e-9 && (white + 3.0).abs() < 1e-9 && squares < 1e-18,
            "{slow} {white} {squares}"
        );
    }

    #[test]
    fn white_innovations_have_no_slow_error() {
        let taus = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0];
        // Products at lags above zero are noise that changes its sign from block to block.
        let white = |b: usize, lag: usize| {
            if lag == 0 {
                4.0
            } else {
                0.3 * (((7 * b + 3 * lag) % 5) as f64 - 2.0)
            }
        };
        assert_eq!(fit(&[products(&taus, white)], &taus, 0.05), None);
    }
}
