//! The iterated update: Gauss-Newton on the manifold.
//!
//! Sought     δ that minimises δᵀP⁻¹δ + |z ⊟ h(x̂ ⊞ δ)|² in R: the maximum a posteriori. δ are the prior's
//!            own coordinates, scaled to canonical ones at x̂
//! Step       at x_j = x̂ ⊞ δ_j: r_j = z ⊟ h(x_j), H̃ = H(x_j) D_j, D_j = ∂x_j/∂δ the Jacobian of the chart's
//!            retraction; K = PH̃ᵀ(H̃PH̃ᵀ + R)⁻¹; δ ← K (r_j + H̃ δ_j)
//! Control    a step that does not lower the cost is shortened to the least of a parabola
//! After      P ← (I − KH̃)P in coordinates about x̂; the chart carries it to x̂ ⊞ δ by D: [`Reset::Full`]
//! Source     Bell and Cathey 1993; the same estimate as IKFoM (arXiv 2102.03804) and Huai and Gao (arXiv
//!            2307.09237), who write it in coordinates about x_j, J = D⁻¹
//!
//! [`Reset::Full`]: crate::chart::Reset::Full

use super::rule::{Innovation, Problem, UpdateRule};
use crate::covariance::{cholesky, solve_lower, solve_rows};
use crate::math;

/// Gauss-Newton on the manifold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterated {
    /// The most steps.
    pub iterations: u16,
    /// It ends when a step is shorter than this many σ of the belief given the measurement.
    pub tolerance: f64,
}

impl Iterated {
    /// Ten steps at most, until a step is below a thousandth of a σ.
    pub const DEFAULT: Self = Self {
        iterations: 10,
        tolerance: 1e-3,
    };
}

impl Default for Iterated {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The shortest part of a step: a Gauss-Newton step is one of descent, so that a part of it lowers the cost
/// unless rounding hides that.
const SHORTEST: f64 = 1e-6;

/// The part of the first slope by which the cost has to fall (Armijo's condition; Nocedal and Wright 2006, §3.1).
const ENOUGH: f64 = 1e-4;

impl UpdateRule for Iterated {
    fn name(&self) -> &'static str {
        "iterated"
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        let m = work.rows;
        let value = problem.observed.model.size().value;
        work.trial.residual[..m].copy_from_slice(&work.residual[..m]);
        work.trial.predicted[..value].copy_from_slice(&work.predicted[..value]);
        let is_weighed = cholesky(&work.noise, &mut work.trial.noise, m);
        let is_found = self.descend(problem, work, is_weighed);
        // The report contains the innovation of the prediction.
        work.residual[..m].copy_from_slice(&work.trial.residual[..m]);
        work.predicted[..value].copy_from_slice(&work.trial.predicted[..value]);
        if !is_found {
            return false;
        }
        work.condition(problem.covariance);
        true
    }

    fn resets_fully(&self) -> bool {
        true
    }
}

impl Iterated {
    /// δ into `work.correction`, with H̃ and K of the last linearisation; false where a number is not finite.
    fn descend(&self, problem: &mut Problem<'_>, work: &mut Innovation, is_weighed: bool) -> bool {
        work.trial.delta.fill(0.0);
        work.trial.dual_kept.fill(0.0);
        // Without a factor of R there is no cost to compare: then every step is taken.
        let mut least = if is_weighed { cost(work) } else { f64::INFINITY };
        for _ in 0..self.iterations {
            if !solve(work) {
                return false;
            }
            let length = distance(work, is_weighed);
            if length <= self.tolerance {
                return true;
            }
            match shorten(problem, work, is_weighed.then_some(least), length * length) {
                Some(cost) => least = cost,
                // No part of the step lowers the cost: it is at its least, up to rounding.
                None => break,
            }
            keep(work);
            work.project(problem.covariance);
            if !work.factor() {
                return false;
            }
        }
        settle(problem, work)
    }
}

/// Shortens the step to the new δ until it lowers the cost, linearises there, and returns the cost. `least` is the
/// cost where the step starts, `None` if there is nothing to compare. `squared` is the step's squared length in σ, so
/// that the cost falls by 2 `squared` per step at first. `None` if no part of the step lowers the cost.
fn shorten(problem: &mut Problem<'_>, work: &mut Innovation, least: Option<f64>, squared: f64) -> Option<f64> {
    let mut part = 1.0;
    while part > SHORTEST {
        let shorter = if linearise(problem, work) {
            let Some(least) = least else { return Some(f64::INFINITY) };
            let now = cost_of_trial(work);
            if now <= least - ENOUGH * 2.0 * part * squared {
                return Some(now);
            }
            // The minimum of the parabola through value and slope at the start and this value.
            math::clamp(squared * part * part / (now - least + 2.0 * squared * part), 0.1 * part, 0.5 * part)
        } else {
            0.5 * part
        };
        scale(work, shorter / part);
        part = shorter;
    }
    None
}

/// Keeps the new δ.
fn keep(work: &mut Innovation) {
    let (correction, trial) = (&work.correction, &mut work.trial);
    trial.delta.copy_from_slice(correction);
    trial.dual_kept.copy_from_slice(&trial.dual);
}

/// H̃ and K at the δ kept, which is the correction.
fn settle(problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
    work.correction.copy_from_slice(&work.trial.delta);
    if !linearise(problem, work) {
        return false;
    }
    work.project(problem.covariance);
    let is_solved = work.factor() && solve(work);
    work.correction.copy_from_slice(&work.trial.delta);
    is_solved
}

/// δ ← K (r + H̃ δ) from the linearisation at the δ kept, and P⁻¹δ.
fn solve(work: &mut Innovation) -> bool {
    let m = work.rows;
    for i in 0..m {
        let along: f64 = work.jacobian.row(i).iter().zip(&work.trial.delta).map(|(h, d)| h * d).sum();
        work.effective[i] = work.residual[i] + along;
    }
    work.gain();
    if !work.correct_by_effective() {
        return false;
    }
    // P⁻¹δ = H̃ᵀ S⁻¹ (r + H̃ δ).
    let weighed = &mut work.whitened[..m];
    weighed.copy_from_slice(&work.effective[..m]);
    solve_rows(&work.work.l, weighed, m, 1);
    let dual = &mut work.trial.dual;
    dual.fill(0.0);
    for (i, y) in weighed.iter().enumerate() {
        dual.iter_mut().zip(work.jacobian.row(i)).for_each(|(d, h)| *d += h * y);
    }
    true
}

/// The distance of the new δ from the kept δ, in σ of the belief given the measurement.
fn distance(work: &mut Innovation, is_weighed: bool) -> f64 {
    let (new, old) = (
        work.correction.iter().zip(&work.trial.dual),
        work.trial.delta.iter().zip(&work.trial.dual_kept),
    );
    let mut squared: f64 = new.zip(old).map(|((d, y), (d0, y0))| (d - d0) * (y - y0)).sum();
    if is_weighed {
        let m = work.rows;
        for i in 0..m {
            let step = work.correction.iter().zip(&work.trial.delta).map(|(d, d0)| d - d0);
            work.whitened[i] = work.jacobian.row(i).iter().zip(step).map(|(h, d)| h * d).sum();
        }
        solve_lower(&work.trial.noise, &mut work.whitened[..m], m);
        squared += work.whitened[..m].iter().map(|v| v * v).sum::<f64>();
    }
    math::sqrt(squared.max(0.0))
}

/// Residual and H̃ at x̂ ⊞ δ; false where h has no value there.
pub(super) fn linearise(problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
    work.reset.exchange(&mut work.trial.by);
    problem.move_to(&work.correction, &mut work.trial.x, &mut work.reset);
    // Lent for the time being, for `work` goes to the linearisation as a whole.
    let x = core::mem::take(&mut work.trial.x);
    let linearised = problem.linearise_at(&x, work);
    work.trial.x = x;
    work.jacobian.compose(&work.reset, &mut work.trial.row);
    work.reset.exchange(&mut work.trial.by);
    linearised.is_ok() && work.residual[..work.rows].iter().all(|r| r.is_finite())
}

/// rᵀR⁻¹r of the residual at hand.
fn cost(work: &mut Innovation) -> f64 {
    let m = work.rows;
    let whitened = &mut work.whitened[..m];
    whitened.copy_from_slice(&work.residual[..m]);
    solve_lower(&work.trial.noise, whitened, m);
    whitened.iter().map(|r| r * r).sum()
}

/// δᵀP⁻¹δ + rᵀR⁻¹r at the new δ.
fn cost_of_trial(work: &mut Innovation) -> f64 {
    let prior: f64 = work.correction.iter().zip(&work.trial.dual).map(|(d, y)| d * y).sum();
    prior + cost(work)
}

/// A part of the way from the δ kept.
fn scale(work: &mut Innovation, part: f64) {
    let along = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(d, d0)| *d = d0 + part * (*d - d0));
    along(&mut work.correction, &work.trial.delta);
    along(&mut work.trial.dual, &work.trial.dual_kept);
}
