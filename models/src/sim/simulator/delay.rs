//! The delay from a row's validity to its stamp: the design gives it. If the offset is a state, its true value
//! is drawn and may move.

use super::SimulatedSensor;
use fusion_core::math;
use fusion_core::state::{Dynamics, Layout, Scalar, Slot};
use fusion_core::time::nanos;

/// How many σ an offset that moves is expected to stay within.
const MOST_SIGMAS: f64 = 8.0;

/// The delay of a sensor's rows from validity to stamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Delay {
    /// Without the offset \[s\].
    fixed: f64,
    offset: Option<Slot<Scalar>>,
    /// How far the offset may move during the run \[s\].
    play: f64,
}

impl Delay {
    pub(super) fn new(sensor: &SimulatedSensor, layout: &Layout, duration: f64) -> Self {
        let declared = sensor.offset.map_or(0.0, |offset| offset.read(layout.initial()));
        let block = sensor.offset.and_then(|offset| layout.block_of(offset));
        let sigma = match block.map(|block| &block.dynamics) {
            Some(Dynamics::RandomWalk { psd }) => math::sqrt(psd[0] * duration),
            Some(Dynamics::GaussMarkov { sigma, .. }) => sigma[0],
            _ => 0.0,
        };
        Self {
            fixed: sensor.delay - declared,
            offset: sensor.offset,
            play: MOST_SIGMAS * sigma,
        }
    }

    /// The delay if the true state is `x` \[ns\].
    pub(super) fn at(&self, x: &[f64]) -> i64 {
        nanos(self.fixed + self.offset.map_or(0.0, |offset| offset.read(x)))
    }

    /// The smallest delay in the run, if `x` is the true state at the start \[ns\].
    pub(super) fn least(&self, x: &[f64]) -> i64 {
        self.at(x) - nanos(self.play)
    }
}
