//! How P grows when a sensor is believed against the estimate.
//!
//! A gate re-acquires its sensor if the measurements agree with each other but not with the estimate: the *motion*
//! has gone wrong, in a way that no model describes. The knowledge of the equipment (biases, lever arms, latencies)
//! stays valid. So the kinematic blocks get an additional error, P ← P + Q. Q is diagonal, in proportion to the
//! present variances of these blocks. It is independent of everything else, hence
//!
//! - a calibration is moved by less than its own σ, however large the residual is: S grows, and its
//!   covariance with the motion does not;
//! - a position that is believed against the estimate does not turn the attitude, which is a guess of
//!   the correlations of a motion that did not happen. Velocity and attitude are open to the
//!   measurements that follow.
//!
//! The wrong motion may have pulled parameters too, before a gate rejected the sensor. So the filter discards what it
//! learnt of each parameter since before that time: the variance becomes again the value without this learning. If
//! the parameter has moved further than that, its variance becomes the square of the distance. Measurements can then
//! bring it back. A parameter that was neither moved nor learnt stays as it is.

use super::kalman::Filter;
use super::step::Step;
use crate::state::{Block, Layout, StateRole};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

/// The largest growth of the motion's σ: a centimetre becomes ten kilometres.
const MOST_GROWTH: f64 = 1e6;

/// The σ \[rad\] up to which an orientation grows: errors of second order are half a percent there.
const MOST_TURN: f64 = 0.1;

/// The largest growth of the σ of the measured quantities, if no growth of the motion explains the residual.
const MOST_GROWTH_OF_SEEN: f64 = 1e4;

/// The axes of P that grow.
#[derive(Clone, Debug)]
pub(super) struct Growing {
    /// Axes of positions, velocities and all other motion.
    pub(super) linear: Arc<[usize]>,
    /// Axes of orientations, which grow up to [`MOST_TURN`].
    pub(super) angular: Arc<[usize]>,
    /// The axes of each block, and whether it is a parameter; and the axes that the measurement sees.
    blocks: Arc<[(Range<usize>, bool)]>,
    seen: Vec<Range<usize>>,
}

impl Growing {
    pub(super) fn of(layout: &Layout) -> Self {
        let blocks = layout.blocks().iter().map(|b| (b.tangent_range(), b.role != StateRole::Kinematic));
        let motion = || layout.blocks().iter().filter(|b| b.role == StateRole::Kinematic);
        Self {
            linear: motion()
                .filter(|b| !b.kind.is_orientation())
                .flat_map(Block::tangent_range)
                .collect(),
            angular: layout.orientations().flat_map(Block::tangent_range).collect(),
            blocks: blocks.collect(),
            seen: Vec::with_capacity(layout.blocks().len()),
        }
    }
}

impl Filter {
    /// P grows until it explains the residual, rᵀ(HPHᵀ + R)⁻¹r ≤ m. First the motion grows. If no growth of the
    /// motion explains the residual, the parameters that the sensor sees grow, such as its own bias; then everything
    /// that the sensor sees. All other states stay as they are: a compass contains no information about the position.
    /// The filter also forgets what it learnt of parameters lately. Returns false if no growth is enough; the caller
    /// then has to restore P from `p_before`.
    pub(super) fn inflate(&mut self) -> bool {
        let prior = self.prior();
        let grows = self.grow_until_expected(MOST_GROWTH, Self::grow_motion) || self.grow_seen(true) || self.grow_seen(false);
        let grows = grows && self.forget_lately();
        if grows {
            self.keep(prior, |f, prior| Step::Inflated {
                prior,
                posterior: f.belief.clone(),
            });
        }
        grows
    }

    /// Grows P by `grow` to twice, four times, … the variances before, until P explains the residual. Returns false
    /// if σ has grown `most` times without success.
    fn grow_until_expected(&mut self, most: f64, grow: impl Fn(&mut Self, f64)) -> bool {
        let (expected, mut growth) = (self.work.rows as f64, 1.0);
        while growth <= most * most {
            self.work.project(&self.belief.covariance);
            if self.work.factor() && self.work.whiten() <= expected {
                return true;
            }
            grow(self, growth);
            growth *= 2.0;
        }
        false
    }

    /// Grows the blocks that the measurement sees, parameters alone or all, from P as it was.
    fn grow_seen(&mut self, parameters_alone: bool) -> bool {
        self.belief.covariance.copy_from(&self.p_before);
        let (Growing { blocks, seen, .. }, h) = (&mut self.growing, &self.work.jacobian);
        let meant = blocks.iter().filter(|(_, is_parameter)| *is_parameter || !parameters_alone);
        seen.clear();
        seen.extend(
            meant
                .map(|(axes, _)| axes.clone())
                .filter(|axes| axes.clone().any(|axis| h.sees(axis))),
        );
        !self.growing.seen.is_empty()
            && self.grow_until_expected(MOST_GROWTH_OF_SEEN, |f, _| f.belief.covariance.scale(&f.growing.seen, 2.0))
    }

    /// Gives each parameter the variance that it has without recent learning, and prepares the innovation again.
    /// Returns false if that is impossible.
    fn forget_lately(&mut self) -> bool {
        self.transition.reset();
        let after = &mut self.transition.after;
        self.past.moved(&self.belief, |_, moved| {
            let forgotten = moved.unlearnt.max(moved.distance * moved.distance) - moved.variance;
            after.diagonal(moved.axis, forgotten.max(0.0));
        });
        let is_sound = self.belief.covariance.predict(&self.transition, &mut self.work.work);
        self.work.project(&self.belief.covariance);
        is_sound && self.work.factor()
    }

    /// Adds `times` the variances of `p_before` to those of the motion.
    fn grow_motion(&mut self, times: f64) {
        self.transition.reset();
        for &axis in self.growing.linear.iter() {
            self.transition.after.diagonal(axis, times * self.p_before.variance(axis));
        }
        for &axis in self.growing.angular.iter() {
            let room = MOST_TURN * MOST_TURN - self.belief.covariance.variance(axis);
            let added = times * self.p_before.variance(axis);
            self.transition.after.diagonal(axis, added.min(room.max(0.0)));
        }
        // An overflowing variance is not added, and the residual stays unexplained.
        self.belief.covariance.predict(&self.transition, &mut self.work.work);
    }
}
