//! The calibration of a belief, which a filter that starts again does not lose.

use crate::belief::Belief;
use crate::memory::{Memory, Tape};
use crate::state::{Block, Layout, StateRole};
use crate::time::Time;
use alloc::vec::Vec;

/// The calibrations of a belief, and the covariance of each.
#[derive(Clone, Debug, Default)]
pub(super) struct Calibration {
    /// The time of the belief.
    pub(super) time: Time,
    x: Vec<f64>,
    /// Block by block, each row by row.
    covariances: Vec<f64>,
}

impl Memory for Calibration {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.time.remember(tape);
        tape.numbers(&mut self.x);
        tape.numbers(&mut self.covariances);
    }
}

/// The blocks that a filter keeps.
fn blocks(layout: &Layout) -> impl Iterator<Item = &Block> {
    layout.blocks().iter().filter(|b| b.role == StateRole::Calibration)
}

impl Calibration {
    /// Room for the calibration of a belief of this layout.
    pub(super) fn of(layout: &Layout) -> Self {
        Self {
            time: Time::MIN,
            x: vec![0.0; blocks(layout).map(|b| b.storage_range().len()).sum()],
            covariances: vec![0.0; blocks(layout).map(|b| b.tangent_range().len().pow(2)).sum()],
        }
    }

    /// Takes the calibration of a belief, without an allocation.
    pub(super) fn take(&mut self, layout: &Layout, belief: &Belief) {
        self.time = belief.time;
        let states = blocks(layout).flat_map(|b| &belief.x[b.storage_range()]);
        self.x.iter_mut().zip(states).for_each(|(own, x)| *own = *x);
        let elements = blocks(layout).flat_map(|b| belief.covariance.block_elements(b));
        self.covariances.iter_mut().zip(elements).for_each(|(own, p)| *own = p);
    }

    /// Writes it to a belief.
    pub(super) fn give(&self, layout: &Layout, belief: &mut Belief) {
        let (mut x, mut covariances) = (self.x.as_slice(), self.covariances.as_slice());
        for block in blocks(layout) {
            let (storage, d) = (block.storage_range(), block.tangent_range().len());
            let (own, rest) = x.split_at(storage.len());
            belief.x[storage].copy_from_slice(own);
            let (covariance, others) = covariances.split_at(d * d);
            belief.covariance.set_block(block, covariance);
            (x, covariances) = (rest, others);
        }
    }
}
