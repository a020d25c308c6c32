//! The search of the maximum: Fisher scoring over the innovations.

use super::sensitivity::Sensitivity;
use super::trials::{Part, Score, Trials};
use fusion::config::Diagnostics;
use fusion_core::math;
use nalgebra::{DMatrix, DVector};

/// No step changes a parameter by more than e² times.
const LONGEST: f64 = 2.0;
/// The search ends if the next step is expected to gain less: a hundredth of what one parameter gains by chance. Where
/// gates decide, jumps of the likelihood hide smaller gains.
const ENOUGH: f64 = 0.005;
/// The same without gates: a parameter then lies within 1e-4 of its 1σ.
const ENOUGH_SMOOTH: f64 = 1e-8;
/// The search finds the slopes anew before it ends, if the steps since the last slopes were expected to gain more than
/// this multiple of the limit. The distance is the root of it.
const NEAR: f64 = 100.0;

/// Where a search begins.
pub(super) struct Start {
    /// All parameters: logarithms of factors.
    pub(super) theta: Vec<f64>,
    /// The places of those that may move.
    pub(super) free: Vec<usize>,
    /// The weight of the prior of each: its declared value, with the 1σ of its logarithm as 1/√weight.
    pub(super) prior: Vec<f64>,
    /// The innovations at θ, and how they change, if known.
    pub(super) known: Option<(Score, Sensitivity)>,
}

/// The end of a search.
pub(super) struct Point {
    pub(super) theta: Vec<f64>,
    pub(super) prior: Vec<f64>,
    pub(super) score: Score,
    sensitivity: Sensitivity,
    /// Whether it is a maximum; the search may end before, at the limit of runs.
    pub(super) has_converged: bool,
}

impl Point {
    pub(super) fn free(&self) -> &[usize] {
        &self.sensitivity.free
    }

    /// A start from here, with other parameters free or another prior.
    pub(super) fn again(self, free: Vec<usize>, prior: Vec<f64>) -> Start {
        let is_same = free == self.sensitivity.free;
        Start {
            theta: self.theta,
            free,
            prior,
            known: is_same.then_some((self.score, self.sensitivity)),
        }
    }

    /// A start from here, with some parameters fixed at other values.
    pub(super) fn pinned(&self, pinned: &[(usize, f64)]) -> Start {
        let mut theta = self.theta.clone();
        pinned.iter().for_each(|(j, value)| theta[*j] = *value);
        let is_free = |j: &usize| pinned.iter().all(|(pinned, _)| pinned != j);
        Start {
            theta,
            free: self.free().iter().copied().filter(is_free).collect(),
            prior: self.prior.clone(),
            known: None,
        }
    }

    /// The 1σ of the logarithm of each parameter; infinite if it was not free.
    pub(super) fn sigmas(&self) -> Vec<f64> {
        let mut sigmas = vec![f64::INFINITY; self.theta.len()];
        let weights = of(&self.prior, self.free());
        if let Some(covariance) = self.sensitivity.covariance(&weights) {
            self.free()
                .iter()
                .enumerate()
                .for_each(|(k, j)| sigmas[*j] = math::sqrt(covariance[(k, k)]));
        }
        sigmas
    }

    /// The parameters that the other parts give: one step of Fisher scoring from the maximum of all.
    pub(super) fn without(&self, part: &Part) -> Vec<f64> {
        let (slope, information) = self.sensitivity.without(part);
        let (step, _) = damped((&slope, &information), (&self.theta, &self.prior), self.free(), 0.0);
        moved(&self.theta, self.free(), &step)
    }
}

/// The values of some parameters.
fn of(all: &[f64], free: &[usize]) -> DVector<f64> {
    DVector::from_iterator(free.len(), free.iter().map(|j| all[*j]))
}

fn moved(theta: &[f64], free: &[usize], step: &DVector<f64>) -> Vec<f64> {
    let mut next = theta.to_vec();
    free.iter().zip(step.iter()).for_each(|(j, step)| next[*j] += step);
    next
}

/// The step of Fisher scoring, with the prior and `damping` times the diagonal, and the gain that it is expected to make.
fn damped(
    (slope, information): (&DVector<f64>, &DMatrix<f64>),
    (theta, prior): (&[f64], &[f64]),
    free: &[usize],
    damping: f64,
) -> (DVector<f64>, f64) {
    let weights = of(prior, free);
    let mut matrix = information.clone();
    for j in 0..free.len() {
        matrix[(j, j)] += weights[j] + damping * information[(j, j)];
    }
    let right = slope - of(theta, free).component_mul(&weights);
    let step = matrix.cholesky().map_or_else(|| DVector::zeros(free.len()), |c| c.solve(&right));
    let step = step.map(|s| s.clamp(-LONGEST, LONGEST));
    let gain = 0.5 * step.dot(&right);
    (step, gain)
}

/// Climbs to the maximum of likelihood and prior. `progress` hears the number of runs, and the gain so far.
pub(super) fn climb(trials: &Trials<'_>, start: Start, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Point, Diagnostics> {
    let Start {
        mut theta,
        free,
        prior,
        known,
    } = start;
    let enough = if trials.is_smooth() { ENOUGH_SMOOTH } else { ENOUGH };
    let of_prior = |theta: &[f64]| -0.5 * theta.iter().zip(&prior).map(|(t, weight)| weight * t * t).sum::<f64>();
    let (mut score, mut sensitivity) = match known {
        Some(known) => known,
        None => {
            let score = trials.at(&theta)?;
            let sensitivity = Sensitivity::new(trials, &theta, &free, &score)?;
            (score, sensitivity)
        }
    };
    let (mut damping, mut gained, mut since) = (0.0, 0.0, 0.0);
    let has_converged = loop {
        let (slope, information) = sensitivity.all();
        let (step, expected) = damped((&slope, &information), (&theta, &prior), &free, damping);
        if trials.is_at_its_end() {
            break expected < enough;
        }
        if expected < enough {
            if since < NEAR * enough {
                break true;
            }
            (sensitivity, since) = (Sensitivity::new(trials, &theta, &free, &score)?, 0.0);
            continue;
        }
        let next = moved(&theta, &free, &step);
        let other = trials.at(&next)?;
        let gain = trials.gain(&score, &other, &|_, _| true) + of_prior(&next) - of_prior(&theta);
        if gain > 0.0 {
            sensitivity.follow(trials, &step, &score, &other);
            (theta, score) = (next, other);
            since += expected;
            gained += gain;
            progress(trials.runs(), gained);
            damping = if damping < 1e-2 { 0.0 } else { damping / 10.0 };
        } else if since > 0.0 {
            // The slopes may be those of a place far away.
            (sensitivity, since) = (Sensitivity::new(trials, &theta, &free, &score)?, 0.0);
        } else {
            damping = if damping == 0.0 { 0.1 } else { damping * 10.0 };
        }
    };
    Ok(Point {
        theta,
        prior,
        score,
        sensitivity,
        has_converged,
    })
}
