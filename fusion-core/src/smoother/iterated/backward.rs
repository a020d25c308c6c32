//! The way back: the adjoint of the linear problem, and the direction that solves it.

use super::record::{Entry, Linear, Operation, Planned};
use super::{IteratedInterval, Sums, squared_norm};
use crate::memory;
use crate::runner::Halt;
use crate::smoother::adjoint::Adjoint;
use crate::smoother::link::Link;
use crate::smoother::tape::Tape;
use alloc::vec::Vec;

/// A measurement after the latest state, which is not known yet: its H̃, the factor of S, and R.
struct Later {
    link: Link,
    factor: Vec<f64>,
    weighed: Vec<f64>,
}

impl IteratedInterval {
    /// Solves the linear problem. After the filter itself, `is_first`, there is no trajectory before it.
    pub(super) fn backward(&mut self, back: &mut Tape, is_first: bool) -> Result<Sums, Halt> {
        let n = self.state.mean.len();
        let (mut adjoint, mut later, mut sums) = (Adjoint::new(n), Vec::new(), Sums::default());
        let mut directions = if self.is_batch && !is_first {
            self.solve_whole()?
        } else {
            Vec::new()
        };
        while self.forth.pop(&mut self.record)? {
            memory::recall(&mut self.linear, &self.record)?;
            if !is_first {
                self.forth.pop(&mut self.record)?;
            }
            let Self { linear, planned, .. } = self;
            planned.clear();
            match &linear.operation {
                Operation::Estimate => {
                    let known = directions.last().map(|d: &Direction| d.step.as_slice());
                    let about = (linear.mean.as_slice(), known);
                    self.corrector.correct_about(&linear.kept, about, &adjoint, &mut self.belief);
                    sums.change = sums.change.max(self.corrector.change);
                    planned.kept.take(&self.belief);
                }
                Operation::Measure(_) => {
                    adjoint.back(&linear.link);
                    sums.residuals += linear.cost;
                    planned.weight = if is_first { 0.0 } else { linear.weight };
                    later.push(Later {
                        link: core::mem::take(&mut linear.link),
                        factor: core::mem::take(&mut linear.factor),
                        weighed: core::mem::take(&mut linear.weighed),
                    });
                }
                _ => {
                    direct(linear, &mut adjoint, planned, directions.pop());
                    if !is_first {
                        sums.add(linear, planned);
                        sums.norm += later.iter().map(|l| l.change(&planned.step)).sum::<f64>();
                    }
                    later.clear();
                }
            }
            core::mem::swap(&mut linear.operation, &mut planned.operation);
            self.record.clear();
            memory::save(&mut self.planned, &mut self.record);
            back.push(&self.record)?;
        }
        Ok(sums)
    }

    /// The directions at all states by Cholesky factorisation. The records stay.
    fn solve_whole(&mut self) -> Result<Vec<Direction>, Halt> {
        let (mut records, mut linear) = (Vec::new(), Vec::new());
        while self.forth.pop(&mut self.record)? {
            records.push(self.record.clone());
        }
        for (k, record) in records.iter().rev().enumerate() {
            self.forth.push(record)?;
            // The record before each is that of the way forward.
            if k % 2 == 1 {
                let mut read = Linear::default();
                memory::recall(&mut read, record)?;
                linear.push(read);
            }
        }
        solve(&linear, self.state.mean.len())
    }

    /// Goes back with the trajectory and the direction of before.
    pub(super) fn restore(&mut self, back: &mut Tape) -> Result<(), Halt> {
        while self.forth.pop(&mut self.record)? {
            self.forth.pop(&mut self.record)?;
            back.push(&self.record)?;
        }
        Ok(())
    }
}

/// d and λ of a state.
pub(super) struct Direction {
    pub(super) step: Vec<f64>,
    pub(super) multiplier: Vec<f64>,
}

#[cfg(feature = "faer")]
fn solve(records: &[Linear], n: usize) -> Result<Vec<Direction>, Halt> {
    Ok(super::cholesky::solve(records, n)?)
}

/// Unreachable: no [`IteratedInterval`] is a batch without the feature.
#[cfg(not(feature = "faer"))]
fn solve(_: &[Linear], _: usize) -> Result<Vec<Direction>, Halt> {
    Err(super::Unsound.into())
}

/// The direction at a state, with the adjoint after its step, which moves to before it; or the direction that is `solved`.
fn direct(linear: &Linear, adjoint: &mut Adjoint, planned: &mut Planned, solved: Option<Direction>) {
    let n = adjoint.vector.len();
    planned.x.clone_from(&linear.x);
    symmetric(&linear.p, &adjoint.vector, &mut planned.step);
    for (i, d) in planned.step.iter_mut().enumerate() {
        *d = linear.mean.get(i).copied().unwrap_or(0.0) - *d;
    }
    let is_start = matches!(linear.operation, Operation::Start { .. });
    if is_start {
        // The initial error is one about x̄₀.
        adjoint.back(&linear.link);
    }
    planned.multiplier.clone_from(&adjoint.vector);
    if let Some(Direction { step, multiplier }) = solved {
        (planned.step, planned.multiplier) = (step, multiplier);
    }
    planned.dual.clone_from(&linear.dual);
    planned.dual.resize(n, 0.0);
    let Planned {
        noise: [own, by_multiplier],
        dual,
        multiplier,
        ..
    } = planned;
    noise(linear, dual, own);
    noise(linear, multiplier, by_multiplier);
    if is_start {
        adjoint.forget();
    } else {
        adjoint.back(&linear.link);
    }
}

impl Sums {
    /// Adds a step other than a measurement.
    fn add(&mut self, linear: &Linear, planned: &Planned) {
        let Planned {
            dual,
            multiplier,
            noise: [own, by_multiplier],
            ..
        } = planned;
        for i in 0..dual.len() {
            let (change, noise) = (multiplier[i] - dual[i], by_multiplier[i] - own[i]);
            self.noise[0] += dual[i] * own[i];
            self.noise[1] += dual[i] * by_multiplier[i];
            self.noise[2] += multiplier[i] * by_multiplier[i];
            self.norm += change * noise;
            self.defects += multiplier[i].abs() * (linear.defect[i] + own[i]).abs();
        }
    }
}

impl Later {
    /// |H d|² in R.
    fn change(&self, d: &[f64]) -> f64 {
        let m = self.link.rows();
        let whitened: Vec<f64> = self.link.learnt().map(|(h, _)| h.iter().zip(d).map(|(h, d)| h * d).sum()).collect();
        let along: Vec<f64> = (0..m)
            .map(|i| (0..=i).map(|j| self.factor[i * m + j] * whitened[j]).sum())
            .collect();
        squared_norm(&along, &self.weighed).unwrap_or(0.0)
    }
}

/// Q v of a step into `out`; P₀ v of a start.
fn noise(linear: &Linear, v: &[f64], out: &mut Vec<f64>) {
    if let Operation::Start { p, .. } = &linear.operation {
        symmetric(p, v, out);
        return;
    }
    let n = v.len();
    out.clear();
    out.resize(n, 0.0);
    if !linear.before.is_empty() {
        let (mut back, mut forth) = (vec![0.0; n], vec![0.0; n]);
        linear.link.pull(v, &mut back, &mut [], 1);
        add(&linear.before, &back, &mut forth);
        linear.link.push(&mut forth, out, &mut [], 1);
    }
    add(&linear.after, v, out);
}

/// out ← out + Q v.
fn add(entries: &[Entry], v: &[f64], out: &mut [f64]) {
    for &(i, j, value) in entries {
        out[usize::from(i)] += value * v[usize::from(j)];
    }
}

/// A v for a symmetric A of which `lower` is the lower triangle, row by row.
fn symmetric(lower: &[f64], v: &[f64], out: &mut Vec<f64>) {
    let n = v.len();
    out.clear();
    out.resize(n, 0.0);
    let mut lower = lower.iter();
    for i in 0..n {
        for (j, value) in lower.by_ref().take(i + 1).enumerate() {
            out[i] += value * v[j];
            if j < i {
                out[j] += value * v[i];
            }
        }
    }
}
