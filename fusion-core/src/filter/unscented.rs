//! The unscented update: h of sigma points in place of its Jacobian.
//!
//! Innovation  ẑ = h(x̂) ⊞ μ, S = A Aᵀ + E + R; the columns of A are the odd parts of h, E the noise of second
//!             order (see [`SigmaPoints`](super::SigmaPoints)); differences of values are the model's own
//! Gain        K = L Aᵀ S⁻¹
//! Covariance  P ← M Mᵀ + K (E + R) Kᵀ, M = L − K A: positive for any gain
//! As a step   H = A L⁻¹, R + E: the linear measurement that would do the same

use super::rule::{Innovation, Problem, UpdateRule};
use super::sigma::Spread;
use crate::model::{Size, Undefined};

/// Sigma points for prediction and update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unscented(pub Spread);

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
        points.prepare(n, m, problem.layout.storage());
        points.take(problem.covariance, core::iter::empty());
        let mut drawn = || {
            problem.predict_at(problem.x, &mut work.trial.predicted[..value])?;
            for i in 0..n {
                let is_there = points.point(i, reach);
                for end in (0..2).filter(|_| is_there) {
                    problem.move_to(&points.delta[..n], &mut points.x, &mut work.trial.by);
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
        if is_defined.is_ok() {
            add_offset(problem, work, &mut points.odd, &points.factor, m);
            points.second_order(m, reach, &self.0);
            model.perturb(&mut work.predicted[..value], &points.mean[..m]);
            model.residual(&problem.observed.value[..value], &work.predicted[..value], &mut work.residual[..m]);
            let ld = work.work.ld;
            for r in 0..m {
                for k in 0..n {
                    work.work.hp[r * ld + k] = (0..=k).map(|i| points.factor[k * n + i] * points.odd[i * m + r]).sum();
                }
                for s in 0..m {
                    let sum: f64 = points.odd[..n * m].chunks_exact(m).map(|a| a[r] * a[s]).sum();
                    work.work.hph[r * m + s] = sum + points.spread[r * m + s];
                }
            }
        }
        work.points = points;
        is_defined
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        let (m, n, ld) = (work.rows, problem.layout.dim(), work.work.ld);
        work.gain();
        if !work.correct() {
            return false;
        }
        let points = &mut work.points;
        work.noise[..m * m].iter_mut().zip(&points.spread).for_each(|(r, e)| *r += e);
        for r in 0..m {
            let row = &mut work.trial.row;
            row.copy_from_slice(&work.jacobian.row(r)[..n]);
            points.regress(r, m, row);
            work.jacobian.set_row(r, row);
        }
        // M = L − K A, in place of L.
        let kt = work.work.kt();
        for k in 0..n {
            for i in 0..n {
                let known: f64 = (0..m).map(|r| kt[r * ld + k] * points.odd[i * m + r]).sum();
                points.factor[k * n + i] -= known;
            }
        }
        for a in 0..n {
            for b in 0..=a {
                let own: f64 = (0..n).map(|i| points.factor[a * n + i] * points.factor[b * n + i]).sum();
                let mut noise = 0.0;
                for r in 0..m {
                    noise += kt[r * ld + a] * (0..m).map(|s| work.noise[r * m + s] * kt[s * ld + b]).sum::<f64>();
                }
                // Odd and even parts are no longer needed: their room takes P.
                points.odd[a * n + b] = own + noise;
                points.odd[b * n + a] = own + noise;
            }
        }
        problem.covariance.set_whole(&points.odd[..n * n]);
        true
    }

    fn spread(&self) -> Option<Spread> {
        Some(self.0)
    }
}

/// The time offset of a measurement is no argument of h: its column is that of the linearisation.
fn add_offset(problem: &Problem<'_>, work: &Innovation, odd: &mut [f64], factor: &[f64], m: usize) {
    let n = problem.layout.dim();
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
            odd[i * m + r] += work.jacobian.get(r, axis) * factor[axis * n + i];
        }
    }
}
