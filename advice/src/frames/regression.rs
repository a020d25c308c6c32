//! Which measured axis, with which sign and factor, is what is expected along one axis.
//!
//! What is expected is correlated with each measured axis; means are taken out of each part of the log, and with them
//! biases. Correlations are compared by Fisher's z = artanh ρ, and z over its standard error by the jackknife: the
//! scatter between parts of the log tells what correlated errors, of which neither number nor time is known, are worth.

use nalgebra::Vector3;

/// Parts of a log at most.
const PARTS: usize = 20;
/// Parts at least: below, their scatter is not known.
const FEWEST: usize = 8;
/// Samples of a part at least.
const SHORTEST: usize = 6;
/// Samples at least.
pub(super) const ENOUGH: usize = FEWEST * SHORTEST;
/// An explanation is better from so many standard errors on. Of 100 comparisons of twenty parts, Student's t with
/// 19 degrees of freedom exceeds 6 by chance in 1 of 2000 logs.
pub(super) const CERTAIN: f64 = 6.0;
/// ... and from this correlation on: a small one that is certain may be one of sensitive axes that are not square.
pub(super) const CLEAR: f64 = 0.4;
/// ... or so many, where the correlation is as high as that: what rises and falls once or twice scatters between the parts of the log.
const LIKELY: f64 = 4.0;
const PLAIN: f64 = 0.9;
/// From which factor on the numbers are wrong, not just inexact: of two channels that tell of the same thing, as a velocity and the
/// slope of a position. Scale errors of instruments are below.
pub(super) const NEAR: f64 = 1.25;
/// ... and of what a course tells, which slips, lags and cuts corners.
pub(super) const FAR: f64 = 2.0;
/// Standard errors from which on a correlation tells a sign, where nothing else does.
const LEANS: f64 = 3.0;

/// What is expected along one axis, best explained.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// The axis that explains it best, and whether its sign is the other one.
    pub(super) axis: usize,
    /// Whether its sign is the other one.
    pub(super) negative: bool,
    /// The correlation with it, without sign.
    pub(super) correlation: f64,
    /// How much better this is than no explanation, in standard errors.
    pub(super) certainty: f64,
    /// How much better this is than what is declared, in standard errors; zero where it is that.
    pub(super) margin: f64,
    /// By how much the numbers are too small: between the slopes of both regressions, which noise in the one or in the
    /// other lets be too flat.
    pub(super) factor: [f64; 2],
    /// How well each axis explains it, in standard errors, with the sign of the correlation.
    pub(super) along: [f64; 3],
    /// Samples.
    pub(super) count: usize,
}

impl Fit {
    /// Whether the data can tell.
    pub(super) fn is_clear(&self) -> bool {
        self.certainty >= self.certain() && self.correlation >= CLEAR
    }

    /// Whether the data speak clearly for another signed axis than the declared one.
    pub(super) fn is_other(&self) -> bool {
        self.is_clear() && self.margin >= self.certain()
    }

    fn certain(&self) -> f64 {
        if self.correlation >= PLAIN { LIKELY } else { CERTAIN }
    }

    /// Whether an axis explains it with the other sign; `None` where the data do not decide.
    pub(super) fn leans(&self, axis: usize) -> Option<bool> {
        let z = self.along[axis];
        (z.abs() >= LEANS).then_some(z < 0.0)
    }

    /// The factor, where all from 1/`limit` to `limit` are excluded.
    pub(super) fn wrong_factor(&self, limit: f64) -> Option<f64> {
        let [least, most] = self.factor;
        let is_wrong = least > limit || most < 1.0 / limit;
        (self.is_clear() && is_wrong).then(|| (least * most).sqrt())
    }
}

/// Explains `expected` by an axis of `measured`; `own` is the declared one. `None` for a log that is too short.
pub(super) fn fit(own: usize, expected: &[f64], measured: &[Vector3<f64>]) -> Option<Fit> {
    let count = (expected.len() / SHORTEST).min(PARTS);
    if count < FEWEST {
        return None;
    }
    let bound = |part: usize| part * expected.len() / count;
    let range = |part: usize| bound(part)..bound(part + 1);
    let parts: Vec<Moments> = (0..count).map(|p| Moments::of(&expected[range(p)], &measured[range(p)])).collect();
    let all = parts.iter().fold(Moments::default(), |a, b| a.plus(b, 1.0));
    let rho = Vector3::from_fn(|axis, _| all.correlation(axis));
    let axis = rho.iamax();
    let sign = rho[axis].signum();
    if rho[axis] == 0.0 {
        return None;
    }
    let without: Vec<Moments> = parts.iter().map(|p| all.plus(p, -1.0)).collect();
    let best = |m: &Moments| sign * m.fisher(axis);
    let is_declared = axis == own && sign > 0.0;
    let slope = all.em[axis].abs() / all.mm[axis];
    Some(Fit {
        axis,
        negative: sign < 0.0,
        correlation: rho[axis].abs(),
        certainty: certainty(&all, &without, best),
        margin: if is_declared {
            0.0
        } else {
            certainty(&all, &without, |m| best(m) - m.fisher(own))
        },
        factor: [slope, all.ee / all.em[axis].abs()],
        along: [0, 1, 2].map(|axis| certainty(&all, &without, |m| m.fisher(axis))),
        count: expected.len(),
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
    fn of(e: &[f64], m: &[Vector3<f64>]) -> Self {
        let n = e.len() as f64;
        let (mean_e, mean_m) = (e.iter().sum::<f64>() / n, m.iter().sum::<Vector3<f64>>() / n);
        e.iter().zip(m).fold(Self::default(), |sums, (e, m)| {
            let (e, m) = (e - mean_e, m - mean_m);
            sums.plus(
                &Self {
                    ee: e * e,
                    em: m * e,
                    mm: m.component_mul(&m),
                },
                1.0,
            )
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
        if power > 0.0 { self.em[axis] / power.sqrt() } else { 0.0 }
    }

    /// Fisher's transformation, in which correlations scatter alike; exact data are as good as 1 − 10⁻⁶.
    fn fisher(&self, axis: usize) -> f64 {
        const EXACT: f64 = 1.0 - 1e-6;
        self.correlation(axis).clamp(-EXACT, EXACT).atanh()
    }
}

/// A figure of the whole log over its standard error, by the jackknife: its scatter when each part in turn is left out.
fn certainty(all: &Moments, without: &[Moments], figure: impl Fn(&Moments) -> f64) -> f64 {
    let n = without.len() as f64;
    let figures: Vec<f64> = without.iter().map(&figure).collect();
    let mean = figures.iter().sum::<f64>() / n;
    let variance = (n - 1.0) / n * figures.iter().map(|f| (f - mean).powi(2)).sum::<f64>();
    // Exact data leave no scatter: 1 % is as good as it gets.
    figure(all) / variance.sqrt().max(0.01)
}
