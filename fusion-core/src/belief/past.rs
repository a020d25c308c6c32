//! The parameters of a filter as they were before something went wrong.
//!
//! A *parameter* is every block that is not kinematic: a calibration or a nuisance. Left alone, the
//! estimate of one moves because it is learnt, and by no more than the covariance that is lost
//! meanwhile: for x̂₀ of variance P₀ and, later, x̂ of variance P,
//!
//! ```text
//! x̂ − a x̂₀  has the variance  a²P₀ + q − P
//! ```
//!
//! where a and q are the block's own dynamics over the time between: 1 and 0 of a constant, 1 and
//! ψΔt of a random walk, e^{−Δt/τ} and σ²(1 − a²) of a Gauss-Markov process. (The correction of an
//! optimal filter is independent of the error that it leaves.) What has moved by many times that was
//! pulled by something that the filter has no model of.

use super::Belief;
use crate::math;
use crate::memory::{Memory, Tape};
use crate::state::{Block, Dynamics, Layout, StateRole};
use crate::time::Time;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Parameters are looked back at over this time \[s\] at least and twice as much at most: a fault is
/// older than its first sign, since parameters give way to it before residuals are large.
const SPACING: f64 = 30.0;

/// State and variances at a time.
#[derive(Clone, Debug)]
struct Snapshot {
    time: Time,
    x: Vec<f64>,
    variance: Vec<f64>,
}

impl Memory for Snapshot {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.time.remember(tape);
        tape.numbers(&mut self.x);
        tape.numbers(&mut self.variance);
    }
}

impl Snapshot {
    fn take(&mut self, layout: &Layout, belief: &Belief) {
        self.time = belief.time;
        self.x.copy_from_slice(&belief.x);
        for b in layout.blocks() {
            let out = &mut self.variance[b.tangent_range()];
            out.iter_mut().zip(belief.covariance.variances(b)).for_each(|(out, v)| *out = v);
        }
    }
}

/// How an axis of a parameter has moved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moved {
    /// Its axis in the tangent space.
    pub(crate) axis: usize,
    /// x̂ − a x̂₀.
    pub(crate) distance: f64,
    /// The variance that the parameter would have had, had nothing been learnt since: a²P₀ + q.
    pub(crate) unlearnt: f64,
    /// The variance now, P.
    pub(crate) variance: f64,
}

impl Moved {
    /// Whether it has moved by more than `sigmas` of all that it might have been off.
    pub(crate) fn is_far(&self, sigmas: f64) -> bool {
        self.distance * self.distance > sigmas * sigmas * self.unlearnt
    }

    /// Whether it has moved by more than `sigmas` of what the covariances explain.
    pub(crate) fn is_beyond(&self, sigmas: f64) -> bool {
        let expected = (self.unlearnt - self.variance).max(0.0);
        self.distance * self.distance > sigmas * sigmas * expected
    }
}

/// Keeps the parameters of half a minute ago.
#[derive(Clone, Debug)]
pub(crate) struct Past {
    layout: Arc<Layout>,
    before: Snapshot,
    latest: Snapshot,
    difference: Vec<f64>,
}
crate::memory!(Past { before, latest; layout, difference });

impl Past {
    pub(crate) fn new(layout: Arc<Layout>) -> Self {
        let snapshot = Snapshot {
            time: Time::MIN,
            x: layout.initial().to_vec(),
            variance: vec![0.0; layout.dim()],
        };
        Self {
            before: snapshot.clone(),
            latest: snapshot,
            difference: vec![0.0; layout.dim()],
            layout,
        }
    }

    /// The filter starts from this belief.
    pub(crate) fn start(&mut self, belief: &Belief) {
        self.before.take(&self.layout, belief);
        self.latest.take(&self.layout, belief);
    }

    /// Hears a belief that nothing speaks against.
    pub(crate) fn hear(&mut self, belief: &Belief) {
        if belief.time.seconds_since(self.latest.time) >= SPACING {
            core::mem::swap(&mut self.before, &mut self.latest);
            self.latest.take(&self.layout, belief);
        }
    }

    /// Tells `each` how every axis of every parameter has moved since. An axis without variance is no
    /// state: it turns with the others of its block, and is left out.
    pub(crate) fn moved(&mut self, belief: &Belief, mut each: impl FnMut(usize, Moved)) {
        let Self {
            layout,
            before,
            difference,
            ..
        } = self;
        let elapsed = belief.time.seconds_since(before.time);
        let parameters = layout.blocks().iter().enumerate().filter(|(_, b)| b.role != StateRole::Kinematic);
        for (number, b) in parameters {
            let difference = &mut difference[b.tangent_range()];
            b.kind.minus(&belief.x[b.storage_range()], &before.x[b.storage_range()], difference);
            for (k, variance) in belief.covariance.variances(b).enumerate() {
                let (decay, added) = own_dynamics(b, k, elapsed);
                // Only what is a vector decays: its coordinates are those of the tangent space.
                let faded = if decay < 1.0 {
                    (1.0 - decay) * before.x[b.storage + k]
                } else {
                    0.0
                };
                let moved = Moved {
                    axis: b.tangent + k,
                    distance: difference[k] + faded,
                    unlearnt: decay * decay * before.variance[b.tangent + k] + added,
                    variance,
                };
                if moved.unlearnt > 0.0 {
                    each(number, moved);
                }
            }
        }
    }
}

/// Over `elapsed` seconds, of axis `k` of a block that the process does not move: the factor by which
/// it decays, and the variance that is added.
#[must_use]
pub fn own_dynamics(block: &Block, k: usize, elapsed: f64) -> (f64, f64) {
    match &block.dynamics {
        Dynamics::Process | Dynamics::Constant => (1.0, 0.0),
        // The part of the rate is uncertain without limit here: its block alone says nothing about it.
        Dynamics::Integral { .. } => (1.0, f64::INFINITY),
        Dynamics::RandomWalk { psd } => (1.0, psd[k] * elapsed),
        Dynamics::GaussMarkov { sigma, tau } => {
            let decay = math::exp(-elapsed / tau);
            (decay, sigma[k] * sigma[k] * (1.0 - decay * decay))
        }
    }
}
