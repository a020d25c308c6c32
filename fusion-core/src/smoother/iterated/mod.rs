//! All data of a log, linearised at the smoothed states: the maximum a posteriori.
//!
//! Sought     the states x₀ … x_K that minimise the cost
//!            |x₀ ⊟ x̄₀|² in P₀ + Σ |w_k|² in Q_k + Σ ρ(|z_j ⊟ h_j(x)| in R_j),  x_{k+1} = f_k(x_k) ⊞ w_k
//! Steps      those of a filter that has run before: the same times, inputs and measurements. A measurement that a
//!            gate rejected stays rejected, and growth of P at a re-acquisition stays process noise
//! Iteration  Gauss-Newton. With the states x and the corrections d about them,
//!            d_{k+1} = Φ d_k + w_k − e_k,  e_k = x_{k+1} ⊟ f_k(x_k),  z ⊟ h(x ⊞ d) = r − H d
//!            is a linear problem. A filter and the adjoint λ of [the smoother](super) solve it
//! Noise      w_k = −Q_k ν_k with a multiplier ν per step, because Q may be singular: ν = λ solves the linear problem.
//!            e_k − w_k is the defect c_k of a trajectory; it vanishes at the solution
//! Control    x ⊞ α d and ν + α (λ − ν). α is halved, or less, until the merit falls: the cost plus twice the price
//!            Σ |λ| |c| of the defects, the exact penalty of Han and Powell
//! Loss       R / w with the weight w at |r| in R of the present states. The cost with this weight is never below that
//!            with the loss, so that it falls too (iteratively reweighted least squares)
//! End        no state of a wanted estimate is further than 10⁻⁶ of its smoothed σ from the limit of its changes
//! Memory     two tapes that are read from their ends, so that each pass leaves its records in the order of the next
//! Not here   derivatives of Q; second derivatives of ⊞ in the noise of one step; the share by which the filter may
//!            protect calibrations, and its growth of R under an open attitude
//! Batch      [`IteratedInterval::by_cholesky`] solves the linear problem by sparse Cholesky factorisation instead
//! Source     Bell 1994, The iterated Kalman smoother as a Gauss-Newton method; step control by Särkkä and Svensson
//!            2020 (arXiv 2007.14136); merit: Nocedal and Wright 2006, §18.4

mod backward;
#[cfg(feature = "faer")]
mod cholesky;
mod forward;
mod record;
#[cfg(test)]
mod tests;

use alloc::vec::Vec;
pub use record::Replayed;

use super::adjoint::Corrector;
use super::record::{empty, form};
use super::tape::Tape;
use crate::belief::Belief;
use crate::covariance::{Covariance, cholesky, solve_lower};
use crate::filter::{Parts, Replay, SensorModel};
use crate::memory;
use crate::model::{LastInput, Process};
use crate::runner::Halt;
use crate::state::Layout;
use alloc::sync::Arc;
use record::{Linear, Operation, Planned};
use serde::Serialize;
use thiserror::Error;

/// The distance from the optimum at which the iteration ends, in σ of every smoothed state.
const TOLERANCE: f64 = 1e-6;
/// A change in σ below which a step is not tested: the linearisation changes the cost by second order in it, and the
/// rounding of a position, 1 nm, hides that.
const SMALL: f64 = 1e-2;
/// The most passes over the log: with a robust loss the changes fall linearly, by a tenth at least for most logs.
const PASSES: u32 = 200;
/// The smallest part of a step.
const SHORTEST: f64 = 1e-3;
/// The part of the first slope by which the merit has to fall (Armijo's condition; Nocedal and Wright 2006, §3.1).
const ENOUGH: f64 = 1e-4;

/// How the iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Iteration {
    /// Linearisations of the whole log.
    pub iterations: u32,
    /// Steps that were shortened because they did not lower the merit.
    pub shortened: u32,
    /// The largest distance of a state of a wanted estimate from the optimum, in its smoothed σ, by the last two changes.
    pub distance: f64,
    /// The cost at the end: the sum of the squares of residuals, noise and initial error.
    pub cost: f64,
    /// Whether that distance is below a millionth of σ.
    pub is_converged: bool,
}

/// Smooths by all data of a log, again and again.
///
/// It receives the filter's events in order: starts, steps, and the beliefs that are to be smoothed. It keeps its
/// records on two [`Tape`]s, so that its own memory does not grow with the log.
#[derive(Debug)]
pub struct IteratedInterval {
    replay: Replay,
    corrector: Corrector,
    /// Whether the linear problem is solved by sparse Cholesky factorisation.
    is_batch: bool,
    /// Records in the order of the log, read from the end of the log.
    forth: Tape,
    record: Vec<u8>,
    linear: Linear,
    planned: Planned,
    belief: Belief,
    state: State,
}

/// The state of the linear problem on the way forward.
#[derive(Debug)]
struct State {
    /// The trajectory.
    x: Vec<f64>,
    input: LastInput,
    /// The mean of the error about it, and its covariance.
    mean: Vec<f64>,
    covariance: Covariance,
    moved: Vec<f64>,
    whole: Vec<f64>,
}

/// The sums of a backward pass: the linear problem about a trajectory.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// The cost of the measurements at the trajectory.
    residuals: f64,
    /// νᵀQν, νᵀQλ and λᵀQλ.
    noise: [f64; 3],
    /// Σ |λ| |c|.
    defects: f64,
    /// The square of the norm of d in the information of the whole problem.
    norm: f64,
    /// The largest |d| at a wanted estimate, in its smoothed σ.
    change: f64,
}

impl Sums {
    fn cost(&self) -> f64 {
        self.residuals + self.noise[0]
    }

    fn merit(&self) -> f64 {
        self.cost() + PRICE * self.defects
    }
}

/// The factor of Σ |λ| |c| in the merit. The cost is twice that of the Lagrangian, and twice its price makes the penalty
/// exact.
const PRICE: f64 = 4.0;

impl IteratedInterval {
    /// For beliefs of `layout`, from a filter of `process` with these parts and sensors. The tape is empty.
    #[must_use]
    pub fn new(layout: Arc<Layout>, process: Arc<dyn Process>, parts: &Parts, sensors: Vec<SensorModel>, tape: Tape) -> Self {
        let (n, storage) = (layout.dim(), layout.storage());
        Self {
            corrector: Corrector::new(layout.clone(), parts),
            replay: Replay::new(layout, process, sensors, form().as_ref(), parts.kernel),
            is_batch: false,
            forth: tape,
            record: Vec::new(),
            linear: Linear::default(),
            planned: Planned::default(),
            belief: empty(storage, n),
            state: State {
                x: vec![0.0; storage],
                input: LastInput::default(),
                mean: vec![0.0; n],
                covariance: Covariance::zeros(n, form()),
                moved: vec![0.0; n],
                whole: Vec::new(),
            },
        }
    }

    /// Solves each linear problem as normal equations over all states, by sparse Cholesky factorisation, instead of by a
    /// filter and an adjoint. The log has to fit into memory. `None` if this crate is built without the feature `faer`.
    #[must_use]
    pub fn by_cholesky(self) -> Option<Self> {
        cfg!(feature = "faer").then_some(Self { is_batch: true, ..self })
    }

    /// The filter starts or restarts from `belief`: later data contain no information about the time before.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn start(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.corrector.start(belief);
        self.step(Replayed::start(belief))
    }

    /// The filter has taken a step.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn step(&mut self, mut step: Replayed) -> Result<(), Halt> {
        step.write(&mut self.record);
        self.forth.push(&self.record)
    }

    /// The filter is at a belief that is to be smoothed.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn estimate(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.step(Replayed::estimate(belief))
    }

    /// The end of the log: iterates. `back` is an empty tape.
    ///
    /// # Errors
    /// Where a record cannot be kept or read back, or the linear problem is not sound.
    pub fn smooth(mut self, mut back: Tape) -> Result<(Optimum, Iteration), Halt> {
        // The filter has linearised at its own estimates: there is no trajectory to compare the first one with.
        let mut sums = self.backward(&mut back, true)?;
        let (mut part, mut change, mut told) = (1.0, f64::INFINITY, Iteration::START);
        for _ in 0..PASSES {
            let merit = self.forward(&mut back, part, &sums)?;
            let least = if told.iterations > 0 && change > SMALL {
                sums.merit() - ENOUGH * 2.0 * part * sums.norm
            } else {
                f64::MAX
            };
            let falls = merit <= least;
            if told.iterations > 0 && !falls {
                self.restore(&mut back)?;
                // The minimum of the parabola through value and slope at the start and this value.
                let least = sums.norm * part * part / (merit - sums.merit() + 2.0 * sums.norm * part);
                part = if least.is_finite() {
                    least.clamp(0.1 * part, 0.5 * part)
                } else {
                    0.1 * part
                };
                told.shortened += 1;
                if part < SHORTEST {
                    break;
                }
                continue;
            }
            if !merit.is_finite() {
                return Err(Unsound.into());
            }
            sums = self.backward(&mut back, false)?;
            part = 1.0;
            let before = change;
            change = sums.change;
            told.iterations += 1;
            told.cost = sums.cost();
            told.distance = remaining(before, change);
            told.is_converged = told.distance <= TOLERANCE;
            // A small change that does not fall is rounding.
            if told.is_converged || before <= SMALL && change >= before {
                break;
            }
        }
        Ok((
            Optimum {
                tape: back,
                planned: self.planned,
                record: self.record,
                whole: Vec::new(),
                belief: self.belief,
            },
            told,
        ))
    }
}

impl Iteration {
    const START: Self = Self {
        iterations: 0,
        shortened: 0,
        distance: f64::INFINITY,
        cost: f64::NAN,
        is_converged: false,
    };
}

/// The covariance of the linear problem is not sound.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the smoothed estimates cannot be linearised again: a state or a covariance is not sound")]
pub struct Unsound;

/// Smoothed beliefs in order of time.
#[derive(Debug)]
pub struct Optimum {
    tape: Tape,
    planned: Planned,
    record: Vec<u8>,
    whole: Vec<f64>,
    belief: Belief,
}

impl Optimum {
    /// The next belief; `None` at the end.
    ///
    /// # Errors
    /// Where it cannot be read back.
    pub fn read(&mut self) -> Result<Option<&Belief>, Halt> {
        while self.tape.pop(&mut self.record)? {
            memory::recall(&mut self.planned, &self.record)?;
            if matches!(self.planned.operation, Operation::Estimate) {
                self.planned.kept.give(&mut self.belief, &mut self.whole);
                return Ok(Some(&self.belief));
            }
        }
        Ok(None)
    }
}

/// The distance that is left after a `change` that followed the change `before`, if changes fall in proportion.
fn remaining(before: f64, change: f64) -> f64 {
    match change / before {
        0.0 => change,
        rate if rate < 1.0 && change <= SMALL => change * rate / (1.0 - rate),
        _ => f64::INFINITY,
    }
}

/// The square of the norm of `residual` in the covariance `noise`, m×m, row by row; `None` if that is not positive
/// definite.
fn squared_norm(residual: &[f64], noise: &[f64]) -> Option<f64> {
    let m = residual.len();
    let mut l = vec![0.0; m * m];
    if !cholesky(noise, &mut l, m) {
        return None;
    }
    let mut whitened = residual.to_vec();
    solve_lower(&l, &mut whitened, m);
    Some(whitened.iter().map(|r| r * r).sum())
}
