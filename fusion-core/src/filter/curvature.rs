//! The error of a linearisation under an attitude with a large σ, as noise of the measurement.
//!
//! H is the derivative at the estimate. It describes h within the 1σ of the attitude while sin x is x. A measurement
//! that is used beyond that, again and again at changing estimates, leaves a σ that the errors do not obey.
//!
//! Points     x± = x̂ ⊞ ±√3 d, d = P eₐ/σₐ: along the widest axis a of orientations, with all that is correlated with it
//! Left out   e± = h(x±) ⊟ h(x̂) ∓ √3 H d along d, and ΔH± = H(x±) − H across it
//! Noise      R ← R + ⅙ Σ± (e± e±ᵀ + ΔH± (P − ddᵀ) ΔH±ᵀ): the mean square of what is left out, by Gauss and Hermite's
//!            quadrature of three points; zero where h is linear
//! Source     Gaussian filter of second order: Bar-Shalom, Li and Kirubarajan 2001, §10.3.2; the points replace its
//!            derivatives, so that a sine stays bounded. Quadrature: Ito and Xiong 2000

use super::iterated::linearise;
use super::rule::{Innovation, Problem};
use crate::math;
use crate::state::ALIGNED;

/// The outer points of the quadrature, in σ, and the weight of each; the point in the middle leaves nothing out.
const REACH: f64 = 1.732_050_807_568_877_2;
const WEIGHT: f64 = 1.0 / 6.0;

/// The axis of `angular` with the largest variance, if its 1σ is too large for a linearisation of a measurement that
/// depends on it.
fn open_axis(angular: &[usize], problem: &Problem<'_>, work: &Innovation) -> Option<usize> {
    let variance = |axis: usize| problem.covariance.variance(axis);
    let is_open = |axis: &&usize| variance(**axis) > ALIGNED * ALIGNED && work.jacobian.touches(&(**axis..**axis + 1));
    let open = angular.iter().filter(is_open);
    open.copied().max_by(|a, b| variance(*a).total_cmp(&variance(*b)))
}

/// Adds to R what the linearisation leaves out along the widest axis of `angular`.
pub(super) fn add_curvature(angular: &[usize], problem: &mut Problem<'_>, work: &mut Innovation) {
    let Some(axis) = open_axis(angular, problem, work) else { return };
    let (m, model) = (work.rows, problem.observed.model);
    let value = model.size().value;
    let sigma = math::sqrt(problem.covariance.variance(axis));
    for (i, d) in work.trial.delta.iter_mut().enumerate() {
        *d = problem.covariance.element(i, axis) / sigma;
    }
    work.trial.residual[..m].copy_from_slice(&work.residual[..m]);
    work.trial.predicted[..value].copy_from_slice(&work.predicted[..value]);
    core::mem::swap(&mut work.jacobian, &mut work.trial.jacobian);
    for sign in [1.0, -1.0] {
        work.correction
            .iter_mut()
            .zip(&work.trial.delta)
            .for_each(|(c, d)| *c = sign * REACH * d);
        if !linearise(problem, work) {
            continue;
        }
        let (along, across, trial) = (&mut work.whitened[..m], &mut work.effective[..m], &mut work.trial);
        for (i, step) in across.iter_mut().enumerate() {
            *step = sign * REACH * dot(trial.jacobian.row(i), &trial.delta);
        }
        // The model takes the difference: half a turn and more of an angle is no error of it.
        trial.value[..value].copy_from_slice(&trial.predicted[..value]);
        model.perturb(&mut trial.value[..value], across);
        model.residual(&work.predicted[..value], &trial.value[..value], along);
        work.jacobian.subtract(&trial.jacobian);
        for (i, step) in across.iter_mut().enumerate() {
            *step = dot(work.jacobian.row(i), &trial.delta);
        }
        problem.covariance.project(&work.jacobian, &mut work.work);
        for i in 0..m {
            for j in 0..m {
                let aside = work.work.hph[i * m + j] - across[i] * across[j];
                work.noise[i * m + j] += WEIGHT * (along[i] * along[j] + aside);
            }
        }
    }
    core::mem::swap(&mut work.jacobian, &mut work.trial.jacobian);
    work.residual[..m].copy_from_slice(&work.trial.residual[..m]);
    work.predicted[..value].copy_from_slice(&work.trial.predicted[..value]);
    work.project(problem.covariance);
}

fn dot(row: &[f64], d: &[f64]) -> f64 {
    row.iter().zip(d).map(|(h, d)| h * d).sum()
}
