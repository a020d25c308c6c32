//! The way forward: another trajectory, the linear problem about it, and its filter.

use super::record::{Linear, Operation, Planned};
use super::{IteratedInterval, PRICE, State, Sums, squared_norm};
use crate::chart::{Body, Chart, Reset};
use crate::filter::{Offered, Replay};
use crate::linear::BlockMatrix;
use crate::math;
use crate::memory;
use crate::runner::Halt;
use crate::smoother::record::pack_lower;
use crate::smoother::tape::Tape;
use alloc::vec::Vec;

impl IteratedInterval {
    /// Follows the planned direction by `part`, and linearises there. Returns the merit of the new trajectory, by the
    /// noise and the weights of the trajectory before, which has these `sums`.
    pub(super) fn forward(&mut self, back: &mut Tape, part: f64, sums: &Sums) -> Result<f64, Halt> {
        let [own, mixed, planned] = sums.noise;
        let rest = 1.0 - part;
        let mut merit = rest * rest * own + 2.0 * rest * part * mixed + part * part * planned;
        while back.pop(&mut self.record)? {
            memory::recall(&mut self.planned, &self.record)?;
            self.forth.push(&self.record)?;
            let Self {
                replay,
                state,
                planned,
                linear,
                ..
            } = self;
            linear.clear();
            merit += match &planned.operation {
                Operation::Estimate => {
                    state.keep(planned, linear);
                    0.0
                }
                Operation::Measure(offered) => state.measure(replay, offered, planned.weight, linear),
                _ => state.advance(replay, planned, part, linear),
            };
            core::mem::swap(&mut linear.operation, &mut planned.operation);
            self.record.clear();
            memory::save(&mut self.linear, &mut self.record);
            self.forth.push(&self.record)?;
        }
        Ok(merit)
    }
}

impl State {
    /// Keeps the belief at a wanted estimate.
    fn keep(&self, planned: &Planned, linear: &mut Linear) {
        linear.kept.time = planned.kept.time;
        linear.kept.x.clone_from(&self.x);
        linear.kept.input.clone_from(&self.input);
        pack_lower(&self.covariance, &mut linear.kept.p);
        linear.mean.clone_from(&self.mean);
    }

    /// Takes a step other than a measurement. Returns the price of its defect in the merit.
    fn advance(&mut self, replay: &mut Replay, planned: &Planned, part: f64, linear: &mut Linear) -> f64 {
        let layout = replay.layout.clone();
        linear.x.clone_from(&planned.x);
        self.moved.iter_mut().zip(&planned.step).for_each(|(d, step)| *d = part * step);
        layout.plus(&mut linear.x, &self.moved);
        let start = self.begin(replay, &planned.operation);
        linear.defect.resize(self.mean.len(), 0.0);
        layout.minus(&linear.x, &self.x, &mut linear.defect);
        let is_sound = if start {
            self.start(replay, linear);
            true
        } else {
            replay.transition.phi.apply(&self.mean, &mut self.moved);
            let means = self.mean.iter_mut().zip(&self.moved).zip(&linear.defect);
            means.for_each(|((mean, moved), e)| *mean = moved - e);
            linear.moved_by(&replay.transition);
            self.covariance.predict(&replay.transition, &mut replay.work.work)
        };
        self.x.clone_from(&linear.x);
        linear.mean.clone_from(&self.mean);
        pack_lower(&self.covariance, &mut linear.p);
        let along = |(from, to): (&f64, &f64)| (1.0 - part) * from + part * to;
        linear.dual.extend(planned.dual.iter().zip(&planned.multiplier).map(along));
        if !(is_sound && layout.is_sane(&self.x)) {
            return f64::INFINITY;
        }
        let [own, by_multiplier] = &planned.noise;
        let noise = own.iter().zip(by_multiplier).map(along);
        let defects = linear.defect.iter().zip(noise).map(|(e, noise)| (e + noise).abs());
        PRICE * defects.zip(&planned.multiplier).map(|(c, price)| c * price.abs()).sum::<f64>()
    }

    /// f(x) into `x`, with Φ and Q. Returns whether it is a start, which has none.
    fn begin(&mut self, replay: &mut Replay, operation: &Operation) -> bool {
        let Self {
            x,
            input,
            covariance,
            whole,
            ..
        } = self;
        match operation {
            Operation::Start { x: prior, p } => {
                x.clone_from(prior);
                unpack(p, covariance.dim(), whole);
                covariance.set_whole(whole);
                return true;
            }
            Operation::Move { duration, input: now } => {
                replay.advance(x, *duration, None, now, covariance);
                input.clone_from(now);
            }
            Operation::Coast { gap, input: before, after } => {
                replay.advance(x, gap.duration(), Some(gap), before, covariance);
                input.clone_from(after);
            }
            Operation::Renew { x: found, axes, noise } => {
                replay.transition.reset();
                for &axis in axes {
                    replay.transition.phi.set_element(axis.into(), axis.into(), 0.0);
                }
                replay.transition.after.entries.clone_from(noise);
                for block in replay.layout.orientations() {
                    x[block.storage_range()].copy_from_slice(&found[block.storage_range()]);
                }
            }
            Operation::Grow { noise } => {
                replay.transition.reset();
                replay.transition.after.entries.clone_from(noise);
            }
            Operation::Estimate | Operation::Measure(_) => {}
        }
        false
    }

    /// The error about the trajectory at a start. A large initial error is one in the coordinates about x̄₀.
    fn start(&mut self, replay: &mut Replay, linear: &mut Linear) {
        let mut by = BlockMatrix::identity(self.mean.len());
        let e = &linear.defect;
        Body.correct(&replay.layout, &mut self.x, e, Reset::Full, &mut by);
        by.apply(e, &mut self.mean);
        self.mean.iter_mut().for_each(|mean| *mean = -*mean);
        self.covariance.congruence(&by, &mut replay.work.work);
        linear.link.changed(&by);
    }

    /// Uses a measurement. Returns its cost with the robust weight `frozen`.
    fn measure(&mut self, replay: &mut Replay, offered: &Offered, frozen: f64, linear: &mut Linear) -> f64 {
        linear.weight = 0.0;
        let left_out = if frozen > 0.0 { f64::INFINITY } else { 0.0 };
        if replay.observe(offered, &self.x, &self.input).is_err() {
            return left_out;
        }
        let m = replay.work.rows;
        let squared = squared_norm(&replay.work.residual[..m], &offered.noise);
        let loss = replay.loss(offered.sensor).zip(squared);
        let weight = loss.map_or(1.0, |(loss, squared)| loss.weight(math::sqrt(squared), m));
        let work = &mut replay.work;
        let residual = work.residual[..m].to_vec();
        work.noise[..m * m].iter_mut().for_each(|r| *r /= weight);
        for i in 0..m {
            let along: f64 = work.jacobian.row(i).iter().zip(&self.mean).map(|(h, d)| h * d).sum();
            work.residual[i] -= along;
        }
        work.project(&self.covariance);
        if !work.factor() {
            return left_out;
        }
        work.gain();
        if !work.correct() {
            return left_out;
        }
        let (n, gains) = (self.mean.len(), work.work.kt().chunks(work.work.ld).take(m));
        let gain: Vec<f64> = gains.flat_map(|row| &row[..n]).copied().collect();
        linear.factor.extend_from_slice(&work.work.l[..m * m]);
        linear.weighed.extend_from_slice(&work.noise[..m * m]);
        linear.link.learn(&work.jacobian, &linear.factor, &gain, &work.residual[..m]);
        linear.residual = residual;
        linear.weight = weight;
        linear.cost = weight * squared.unwrap_or(0.0);
        self.mean.iter_mut().zip(&work.correction).for_each(|(mean, d)| *mean += d);
        work.condition(&mut self.covariance);
        frozen * squared.unwrap_or(0.0)
    }
}

/// The whole of a symmetric matrix of which `lower` is the lower triangle, row by row.
fn unpack(lower: &[f64], n: usize, whole: &mut Vec<f64>) {
    whole.resize(n * n, 0.0);
    let mut lower = lower.iter();
    for i in 0..n {
        for (j, value) in lower.by_ref().take(i + 1).enumerate() {
            whole[i * n + j] = *value;
            whole[j * n + i] = *value;
        }
    }
}
