//! The unscented update: h of sigma points in place of its Jacobian.
//!
//! Innovation  ẑ = h(x̂) ⊞ μ, S = A Aᵀ + E + R; the columns of A are the odd parts of h, E the noise of second
//!             order (see [`SigmaPoints`](super::SigmaPoints)); differences of values are the model's own
//! Gain        K = L Aᵀ S⁻¹
//! Covariance  P ← M Mᵀ + K (E + R) Kᵀ, M = L − K A: positive for any gain
//! As a step   H = A L⁻¹, R + E: the linear measurement that would do the same

use super::rule::{Innovation, Problem, UpdateRule};
use super::sigma::{SigmaPoints, SigmaSpread};
use crate::covariance::{Workspace, axpy};
use crate::model::{Size, Undefined};

/// Sigma points for prediction and update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unscented(pub SigmaSpread);

impl UpdateRule for Unscented {
    fn name(&self) -> &'static str {
        "unscented"
    }

    fn innovation(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> Result<(), Undefined> {
        problem.linearise(work)?;
        let Size { value, residual: m } = problem.observed.model.size();
        let (n, model) = (problem.layout.dim(), problem.observed.model);
        let reach = self.0.reach(n);
        let mut points = core::mem::take(&mut work.points);
        points.prepare(work.work.kernel, n, m, problem.layout.storage());
        points.take(problem.covariance, core::iter::empty());
        work.reset.exchange(&mut work.trial.by);
        let mut drawn = || {
            problem.predict_at(problem.x, &mut work.trial.predicted[..value])?;
            for i in 0..n {
                let is_there = points.point(i, reach);
                for end in (0..2).filter(|_| is_there) {
                    problem.move_to(&points.delta[..n], &mut points.x, &mut work.reset);
                    problem.predict_at(&points.x, &mut work.trial.value[..value])?;
                    let out = &mut points.ends[end][..m];
                    model.residual(&work.trial.value[..value], &work.trial.predicted[..value], out);
                    points.delta.iter_mut().for_each(|d| *d = -*d);
                }
                points.keep(i, m, reach, is_there);
            }
            Ok(())
        };
        let is_defined = drawn();
        work.reset.exchange(&mut work.trial.by);
        if is_defined.is_ok() {
            add_offset(problem, work, &mut points, m);
            points.second_order(m, reach, &self.0);
            model.perturb(&mut work.predicted[..value], &points.mean[..m]);
            model.residual(&problem.observed.value[..value], &work.predicted[..value], &mut work.residual[..m]);
            points.project(m, &mut work.work);
        }
        work.points = points;
        is_defined
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        let (m, n) = (work.rows, problem.layout.dim());
        work.gain();
        if !work.correct() {
            return false;
        }
        let points = &mut work.points;
        for (noise, second) in work.noise.chunks_exact_mut(m).zip(points.spread.chunks_exact(points.lm)).take(m) {
            noise.iter_mut().zip(second).for_each(|(r, e)| *r += e);
        }
        for r in 0..m {
            let row = &mut work.trial.row;
            row.copy_from_slice(&work.jacobian.row(r)[..n]);
            points.regress(r, row);
            work.jacobian.set_row(r, row);
        }
        points.condition(m, work.work.kt(), &work.noise);
        problem.covariance.set_whole(points.unpadded());
        true
    }

    fn spread(&self) -> Option<SigmaSpread> {
        Some(self.0)
    }
}

impl SigmaPoints {
    /// HP = A Lᵀ and HPHᵀ = A Aᵀ + E; even parts are no longer needed: A by rows takes their room.
    fn project(&mut self, m: usize, work: &mut Workspace) {
        let (n, ld, lm) = (self.n, self.ld, self.lm);
        self.even[..m * ld].fill(0.0);
        for (i, odd) in self.odd.chunks_exact(lm).enumerate().take(n) {
            (0..m).for_each(|r| self.even[r * ld + i] = odd[r]);
        }
        work.kernel.project(m, &self.even, &[(0, n)], &self.factor, &mut work.hp, ld);
        work.kernel.inner(m, &self.even, &self.even, &mut work.hph, ld);
        for (sums, second) in work.hph.chunks_exact_mut(m).zip(self.spread.chunks_exact(lm)).take(m) {
            sums.iter_mut().zip(second).for_each(|(sum, e)| *sum += e);
        }
    }

    /// `whole` ← M Mᵀ + K (E + R) Kᵀ, with M = L − K A in place of L, by Kᵀ and E + R.
    fn condition(&mut self, m: usize, kt: &[f64], noise: &[f64]) {
        let (n, ld, lm) = (self.n, self.ld, self.lm);
        for (column, odd) in self.factor.chunks_exact_mut(ld).zip(self.odd.chunks_exact(lm)).take(n) {
            for (odd, gain) in odd[..m].iter().zip(kt.chunks_exact(ld)) {
                axpy(-odd, gain, column);
            }
        }
        // D = −½ (E + R) Kᵀ, so that P − DᵀKᵀ − K D has the noise.
        let halves = &mut self.even[..m * ld];
        halves.fill(0.0);
        for (half, noise) in halves.chunks_exact_mut(ld).zip(noise.chunks_exact(m)) {
            for (r, gain) in noise.iter().zip(kt.chunks_exact(ld)) {
                axpy(-0.5 * r, gain, half);
            }
        }
        let p = &mut self.whole[..n * ld];
        p.fill(0.0);
        self.kernel.outer(n, n, &self.factor, 1.0, p);
        self.kernel.refine(n, &self.even, kt, m, p);
    }
}

/// The time offset of a measurement is no argument of h: its column is that of the linearisation.
fn add_offset(problem: &Problem<'_>, work: &Innovation, points: &mut SigmaPoints, m: usize) {
    let Some(axis) = problem
        .observed
        .lateness
        .as_ref()
        .and_then(|l| l.offset.place())
        .and_then(|(at, is_signal)| (!is_signal).then_some(at))
    else {
        return;
    };
    for i in 0..=axis {
        for r in 0..m {
            points.odd[i * points.lm + r] += work.jacobian.get(r, axis) * points.factor[i * points.ld + axis];
        }
    }
}
