//! Finds the measured axis, with sign and factor, that explains the expected value along one axis.
//!
//! The expected value is correlated with each measured axis. The mean of each part of the log is subtracted, which
//! removes biases. Correlations are compared by Fisher's z = artanh ρ. The jackknife gives the standard error of z: the
//! scatter between parts of the log covers correlated errors of unknown size and duration.

use crate::findings::level::{BY_CHANCE, beyond, standard_errors};
use fusion_core::math;
use nalgebra::Vector3;

/// The largest number of parts of a log.
const PARTS: usize = 20;
/// The least number of parts: with fewer, their scatter is unknown.
const FEWEST: usize = 8;
/// The least number of samples in a part.
const SHORTEST: usize = 6;
/// The least number of samples.
pub(super) const ENOUGH: usize = FEWEST * SHORTEST;
/// The explanations that a log offers: three rows, each by three axes with two signs, in so many comparisons.
const EXPLANATIONS: usize = 3 * 3 * 2 * 6;
/// The least correlation of an explanation: cos 66°. A small but certain correlation may come from sensitive axes that
/// are not orthogonal.
const CLEAR: f64 = 0.4;
/// From this correlation, cos 26°, there is only one explanation to judge. A value that rises and falls once or twice
/// scatters between the parts.
pub(super) const PLAIN: f64 = 0.9;
/// The least factor that means wrong numbers, not just inexact ones. It is for two channels that measure the same
/// quantity, such as a velocity and the slope of a position. Scale errors of instruments are smaller.
pub(super) const NEAR: f64 = 1.25;
/// ... and for a comparison with a course, which slips, lags and cuts corners.
pub(super) const FAR: f64 = 2.0;

/// The best explanation of the expected value along one axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// The axis that explains it best.
    pub(super) axis: usize,
    /// True if its sign is inverted.
    pub(super) negative: bool,
    /// The absolute correlation with it.
    pub(super) correlation: f64,
    /// How much better this is than no explanation, in standard errors.
    pub(super) certainty: f64,
    /// How much better this is than the declaration, in standard errors; zero if it is the declared axis.
    pub(super) margin: f64,
    /// The factor by which the numbers are too small. It is between the slopes of both regressions, because noise in
    /// either variable flattens a slope.
    pub(super) factor: [f64; 2],
    /// How well each axis explains the expected value, in standard errors, with the sign of the correlation.
    pub(super) along: [f64; 3],
    /// Samples, and the number of parts that give the standard errors.
    pub(super) count: usize,
    pub(super) parts: usize,
}

impl Fit {
    /// Returns true if the data decide.
    pub(super) fn is_clear(&self) -> bool {
        self.certainty >= self.certain() && self.correlation >= CLEAR
    }

    /// Returns true if the data clearly support another signed axis than the declared one.
    pub(super) fn is_other(&self) -> bool {
        self.is_clear() && self.margin >= self.certain()
    }

    /// Returns true if it is better than the declaration by more than chance, at any correlation.
    pub(super) fn is_better(&self) -> bool {
        self.margin >= standard_errors(EXPLANATIONS, self.parts)
    }

    /// Returns true if this is more than no explanation, for a result that is certain by other data.
    pub(super) fn confirms(&self) -> bool {
        self.certainty >= beyond(BY_CHANCE, self.parts)
    }

    fn certain(&self) -> f64 {
        standard_errors(if self.correlation >= PLAIN { 1 } else { EXPLANATIONS }, self.parts)
    }

    /// Returns true if an axis explains it with the inverted sign; `None` if the data do not decide.
    pub(super) fn leans(&self, axis: usize) -> Option<bool> {
        let z = self.along[axis];
        (z.abs() >= standard_errors(1, self.parts)).then_some(z < 0.0)
    }

    /// The factor, if the data exclude all factors from 1/`limit` to `limit`.
    pub(super) fn wrong_factor(&self, limit: f64) -> Option<f64> {
        let [least, most] = self.factor;
        let is_wrong = least > limit || most < 1.0 / limit;
        (self.is_clear() && is_wrong).then(|| math::sqrt(least * most))
    }
}

/// Expected and measured values of the same times; NaN where the expected value of a row is unknown.
pub(super) type Pairs = Vec<(Vector3<f64>, Vector3<f64>)>;

/// The explanations of the expected values, row by row.
pub(super) type Fits = [Option<Fit>; 3];

/// For each row the axis that it is found at, and whether its sign is inverted; `None` if the data do not decide.
pub(super) type Known = [Option<(usize, bool)>; 3];

/// Explains each row by an axis of the measured values.
pub(super) fn fits(pairs: &Pairs) -> Fits {
    [0, 1, 2].map(|row| fit(row, pairs))
}

/// The axes that the data determine.
pub(super) fn known(fits: &Fits) -> Known {
    [0, 1, 2].map(|row| {
        let fit = fits[row].filter(Fit::is_clear)?;
        let best = (fit.axis, fit.negative);
        (fit.is_other() || best == (row, false)).then_some(best)
    })
}

/// The factor by which all clear axes are wrong, and the accuracy of its logarithm. A wrong factor on only one of
/// several axes may come from the comparison itself.
pub(super) fn wrong_factor(fits: &Fits, limit: f64) -> Option<(f64, f64)> {
    let clear = || fits.iter().flatten().filter(|f| f.is_clear());
    let is_wrong = clear().all(|f| f.wrong_factor(limit).is_some());
    let first = clear().next().filter(|_| is_wrong)?;
    let [least, most] = first.factor;
    Some((first.wrong_factor(limit)?, math::ln(most / least) / 2.0))
}

/// Returns true if only north and east are wrong by a factor: angles in another unit.
pub(super) fn wrong_across(fits: &Fits) -> bool {
    let wrong = |row: usize| fits[row].is_some_and(|f| f.wrong_factor(NEAR).is_some());
    wrong(0) && wrong(1) && !wrong(2)
}

/// A vote for (1) or against (−1) the declaration.
pub(super) fn vote(fits: &Fits, limit: f64) -> i32 {
    let known = known(fits);
    let is_other = (0..3).any(|row| known[row].is_some_and(|k| k != (row, false)));
    if is_other || wrong_factor(fits, limit).is_some() || wrong_across(fits) {
        -1
    } else {
        i32::from(known != [None; 3])
    }
}

/// Explains a row by an axis of the measured values; the axis of this number is the declared one. `None` if the log is
/// too short.
pub(super) fn fit(row: usize, pairs: &Pairs) -> Option<Fit> {
    let pairs: Vec<(f64, Vector3<f64>)> = pairs
        .iter()
        .filter_map(|(expected, measured)| Some((expected[row], *measured)).filter(|(e, _)| e.is_finite()))
        .collect();
    let count = (pairs.len() / SHORTEST).min(PARTS);
    if count < FEWEST {
        return None;
    }
    let bound = |part: usize| part * pairs.len() / count;
    let parts: Vec<Moments> = (0..count).map(|part| Moments::of(&pairs[bound(part)..bound(part + 1)])).collect();
    let all = parts.iter().fold(Moments::default(), |a, b| a.plus(b, 1.0));
    let rho = Vector3::from_fn(|axis, _| all.correlation(axis));
    let axis = rho.iamax();
    let sign = rho[axis].signum();
    if rho[axis] == 0.0 {
        return None;
    }
    let without: Vec<Moments> = parts.iter().map(|p| all.plus(p, -1.0)).collect();
    let best = |m: &Moments| sign * m.fisher(axis);
    let is_declared = axis == row && sign > 0.0;
    let slope = all.em[axis].abs() / all.mm[axis];
    Some(Fit {
        axis,
        negative: sign < 0.0,
        correlation: rho[axis].abs(),
        certainty: certainty(&all, &without, best),
        margin: if is_declared {
            0.0
        } else {
            certainty(&all, &without, |m| best(m) - m.fisher(row))
        },
        factor: [slope, all.ee / all.em[axis].abs()],
        along: [0, 1, 2].map(|axis| certainty(&all, &without, |m| m.fisher(axis))),
        count: pairs.len(),
        parts: count,
    })
}

/// Sums over a part of the log of products of deviations from its means.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    ee: f64,
    em: Vector3<f64>,
    mm: Vector3<f64>,
}

impl Moments {
    fn of(pairs: &[(f64, Vector3<f64>)]) -> Self {
        let n = pairs.len() as f64;
        let mean_e = pairs.iter().map(|(e, _)| e).sum::<f64>() / n;
        let mean_m = pairs.iter().map(|(_, m)| m).sum::<Vector3<f64>>() / n;
        pairs.iter().fold(Self::default(), |sums, (e, m)| {
            let (e, m) = (e - mean_e, m - mean_m);
            let squares = Self {
                ee: e * e,
                em: m * e,
                mm: m.component_mul(&m),
            };
            sums.plus(&squares, 1.0)
        })
    }

    fn plus(&self, other: &Self, factor: f64) -> Self {
        Self {
            ee: self.ee + factor * other.ee,
            em: self.em + factor * other.em,
            mm: self.mm + factor * other.mm,
        }
    }

    fn correlation(&self, axis: usize) -> f64 {
        let power = self.ee * self.mm[axis];
        if power > 0.0 { self.em[axis] / math::sqrt(power) } else { 0.0 }
    }

    /// Fisher's transformation, which gives correlations an equal scatter. Exact data count as 1 − 10⁻⁶.
    fn fisher(&self, axis: usize) -> f64 {
        const EXACT: f64 = 1.0 - 1e-6;
        math::atanh(self.correlation(axis).clamp(-EXACT, EXACT))
    }
}

/// A figure of the whole log divided by its standard error. The jackknife gives the error: each part in turn is left
/// out.
fn certainty(all: &Moments, without: &[Moments], figure: impl Fn(&Moments) -> f64) -> f64 {
    let n = without.len() as f64;
    let figures: Vec<f64> = without.iter().map(&figure).collect();
    let mean = figures.iter().sum::<f64>() / n;
    let variance = (n - 1.0) / n * figures.iter().map(|f| math::powi(f - mean, 2)).sum::<f64>();
    // Exact data have no scatter: 1 % is the lower limit.
    figure(all) / math::sqrt(variance).max(0.01)
}
