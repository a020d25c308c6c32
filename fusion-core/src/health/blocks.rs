//! Whether the belief itself is plausible: calibration near its declared value, parameters unchanged while sensors
//! contradict the belief, σ above its floor.

use super::pulse::Held;
use super::{Limits, Reason};
use crate::belief::{Belief, Past, own_dynamics};
use crate::math;
use crate::memory::{Memory, Tape};
use crate::state::{AxisUnit, Block, Dynamics, Layout, StateRole};
use crate::time::Time;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A parameter is right again once the rest of a pull is within this number of its σ. With a separate error of 1σ in
/// addition, that makes 3σ.
const LEFT: f64 = 2.0;

/// Follows the blocks of the layout.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    layout: Arc<Layout>,
    start: Time,
    /// State and variance at the start; a variance is at least the declared variance.
    initial: Vec<f64>,
    variance: Vec<f64>,
    /// By axis: whether its 1σ was above the floor since the start. An axis that never was is declared to be known.
    was_above: Vec<bool>,
    /// By block.
    held: Vec<Held>,
    difference: Vec<f64>,
    past: Past,
    /// By axis: the rest of a pull; 0 for an axis that was not pulled, or is back.
    left: Vec<f64>,
    /// The time of these values, and the variance of each axis then.
    followed: Time,
    known: Vec<f64>,
    /// By block: whether it moved by many of the 1σ that it had, though no sensor contradicts the belief.
    jumped: Vec<Held>,
}

impl Memory for Blocks {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.start.remember(tape);
        self.was_above.as_mut_slice().remember(tape);
        self.held.as_mut_slice().remember(tape);
        self.past.remember(tape);
        self.jumped.as_mut_slice().remember(tape);
        self.followed.remember(tape);
        for numbers in [&mut self.initial, &mut self.variance, &mut self.left, &mut self.known] {
            tape.numbers(numbers);
        }
    }
}

impl Blocks {
    pub(super) fn new(layout: Arc<Layout>) -> Self {
        Self {
            start: Time::MIN,
            initial: layout.initial().to_vec(),
            variance: vec![0.0; layout.dim()],
            was_above: vec![false; layout.dim()],
            held: vec![Held::default(); layout.blocks().len()],
            difference: vec![0.0; layout.dim()],
            past: Past::new(Arc::clone(&layout)),
            left: vec![0.0; layout.dim()],
            followed: Time::MIN,
            known: vec![0.0; layout.dim()],
            jumped: vec![Held::default(); layout.blocks().len()],
            layout,
        }
    }

    /// The filter starts from this belief.
    pub(super) fn start(&mut self, belief: &Belief) {
        self.start = belief.time;
        self.initial.clone_from(&belief.x);
        for b in self.layout.blocks() {
            let declared = b.sigma.iter().map(|s| s * s);
            let both = declared.zip(belief.covariance.variances(b));
            for (out, (declared, written)) in self.variance[b.tangent_range()].iter_mut().zip(both) {
                *out = declared.max(written);
            }
        }
        self.was_above.fill(false);
        self.held.fill(Held::default());
        self.jumped.fill(Held::default());
        self.forget(belief);
    }

    /// Forgets the earlier values of parameters: it was not known which of several beliefs was true.
    pub(super) fn forget(&mut self, belief: &Belief) {
        self.past.start(belief);
        self.left.fill(0.0);
    }

    /// Whether no axis of the attitude has a 1σ above `allowed`.
    pub(super) fn attitude_within(&self, belief: &Belief, allowed: f64) -> bool {
        belief.is_aligned(&self.layout, allowed)
    }

    /// Judges a belief.
    pub(super) fn hear(&mut self, belief: &Belief, limits: &Limits) {
        let elapsed = belief.time.seconds_since(self.start);
        let Self {
            layout,
            initial,
            variance,
            was_above,
            held,
            difference,
            ..
        } = self;
        for (b, held) in layout.blocks().iter().zip(held) {
            let holds = match b.role {
                StateRole::Kinematic => {
                    let both = belief.covariance.variances(b).zip(&mut was_above[b.tangent_range()]);
                    both.enumerate().fold(false, |is_below, (k, (v, was_above))| {
                        let floor = math::powi(floor(b, k, limits), 2);
                        *was_above |= v >= floor;
                        is_below || (v < floor && *was_above)
                    })
                }
                StateRole::Calibration => {
                    let difference = &mut difference[b.tangent_range()];
                    b.kind.minus(&belief.x[b.storage_range()], &initial[b.storage_range()], difference);
                    let allowed = variance[b.tangent_range()]
                        .iter()
                        .enumerate()
                        .map(|(k, v)| v + wandered(b, k, elapsed));
                    let is_far = |(d, v): (&f64, f64)| v > 0.0 && d * d > math::powi(limits.calibration, 2) * v;
                    difference.iter().zip(allowed).any(is_far)
                }
                StateRole::Nuisance => {
                    let Dynamics::GaussMarkov { sigma, .. } = &b.dynamics else {
                        continue;
                    };
                    let mut both = belief.x[b.storage_range()].iter().zip(sigma);
                    both.any(|(x, sigma)| *sigma > 0.0 && x.abs() > limits.calibration * sigma)
                }
            };
            held.hear(belief.time, holds);
        }
    }

    /// Follows what parameters do while sensors contradict the belief, and afterwards.
    ///
    /// A pull loses weight as the parameter is learnt anew: an update that leaves the share w of its
    /// variance leaves the share w of its error.
    pub(super) fn follow(&mut self, belief: &Belief, limits: &Limits, is_contradicted: bool) {
        if !is_contradicted && self.left.iter().all(|left| *left == 0.0) {
            self.past.hear(belief);
            self.look_back(belief, limits);
            return;
        }
        let elapsed = belief.time.seconds_since(self.followed);
        self.followed = belief.time;
        let Self {
            layout, past, left, known, ..
        } = self;
        past.moved(belief, |block, moved| {
            let (left, known) = (&mut left[moved.axis], &mut known[moved.axis]);
            if !is_contradicted {
                let block = &layout.blocks()[block];
                let (decay, added) = own_dynamics(block, moved.axis - block.tangent, elapsed);
                *left *= decay * (moved.variance / (decay * decay * *known + added)).min(1.0);
            } else if moved.is_beyond(limits.pulled) {
                *left = moved.distance.abs();
            }
            *known = moved.variance;
            let wrong = left.min(moved.distance.abs());
            if wrong * wrong <= LEFT * LEFT * moved.variance {
                *left = 0.0;
            }
        });
    }

    /// Judges whether a parameter is far from its earlier value, though nothing contradicts the belief. The parameter
    /// then was wrong, or is wrong now.
    fn look_back(&mut self, belief: &Belief, limits: &Limits) {
        let Self { past, jumped, .. } = self;
        past.moved(belief, |block, moved| {
            if moved.is_far(limits.jumped) {
                jumped[block].hear(belief.time, true);
            }
        });
    }

    /// Puts the reasons that are reported at `now` into `reasons`.
    pub(super) fn tell(&self, now: Time, limits: &Limits, reasons: &mut Vec<Reason>) {
        let told = self.held.iter().enumerate().filter(|(_, held)| held.is_told(now, limits));
        reasons.extend(told.map(|(block, _)| match self.layout.blocks()[block].role {
            StateRole::Kinematic => Reason::Floor { block },
            _ => Reason::Calibration { block },
        }));
        let blocks = self.layout.blocks().iter().enumerate();
        let pulled = blocks.filter(|(_, b)| self.left[b.tangent_range()].iter().any(|left| *left > 0.0));
        reasons.extend(pulled.map(|(block, _)| Reason::Pulled { block }));
        let jumped = self.jumped.iter().enumerate().filter(|(_, held)| held.is_told(now, limits));
        reasons.extend(jumped.map(|(block, _)| Reason::Jumped { block }));
    }
}

/// Variance of the random walk of axis `k` of a block in `elapsed` seconds.
fn wandered(block: &Block, k: usize, elapsed: f64) -> f64 {
    match &block.dynamics {
        Dynamics::Process | Dynamics::Constant => 0.0,
        // Its rate moves it without limit.
        Dynamics::Integral { .. } => f64::INFINITY,
        Dynamics::RandomWalk { psd } => psd[k] * elapsed,
        Dynamics::GaussMarkov { sigma, .. } => sigma[k] * sigma[k],
    }
}

/// The least 1σ of axis `k` of a kinematic block; 0 for an axis that is neither of a position, a velocity nor an
/// attitude.
fn floor(block: &Block, k: usize, limits: &Limits) -> f64 {
    match block.kind.axis(k) {
        AxisUnit::Metre => limits.floor.position,
        AxisUnit::MetrePerSecond => limits.floor.velocity,
        AxisUnit::Radian => limits.floor.attitude,
        AxisUnit::Other => 0.0,
    }
}
