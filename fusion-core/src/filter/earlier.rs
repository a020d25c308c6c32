//! The motion at which h is differentiated by its parameters: an earlier estimate, while the motion does not change.
//!
//! The derivative of z = c u by a parameter c is the estimate û. With noises that are declared too large or too small,
//! successive innovations are correlated. Each innovation r moves û, so that the next r correlates with û. E[û r] ≠ 0
//! then pulls c by many of its 1σ, however small each step is.
//!
//! Instrument  ∂h/∂c uses an earlier û. Later corrections have replaced its error, so E[û r] = 0 for any gain
//! Age         each block sums its shares of the corrections, tr(K H)/rank. At [`REPLACED`] the waiting estimate comes
//!             into use, and the present estimate waits
//! Motion      a block that has changed by more than its 1σ explains is differentiated at the present estimate. The
//!             motion is then large compared with its error
//! Source      instrumental variables: Söderström and Stoica 1983, Instrumental variable methods for system
//!             identification, ch. 3

use crate::consistency::chi_square_quantile;
use crate::covariance::{Covariance, Workspace};
use crate::linear::Jacobian;
use crate::memory::{Memory, Tape};
use crate::state::{Block, Layout, StateRole};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Sum of shares at which a block is renewed: e⁻³ = 5 % of its error is left then.
const REPLACED: f64 = 3.0;
/// The probability that a change of an axis by errors alone stays below the limit.
const EXPLAINED: f64 = 0.999;
/// Axes of the largest kinematic block.
const MOST_AXES: usize = 3;

/// Two earlier estimates of the motion: the estimate in use, and the next one, which waits.
#[derive(Clone, Debug)]
pub(super) struct Earlier {
    /// The state in use, and the state that waits.
    used: Vec<f64>,
    next: Vec<f64>,
    /// Sum of shares of each kinematic block since it was renewed.
    shares: Vec<f64>,
    layout: Arc<Layout>,
    /// Largest square of a change, in σ, that errors explain.
    limit: f64,
}

/// The blocks whose earlier estimates are kept.
fn motion(layout: &Layout) -> impl Iterator<Item = &Block> {
    let moves = |b: &&Block| b.role == StateRole::Kinematic && b.kind.dim() <= MOST_AXES;
    layout.blocks().iter().filter(moves)
}

impl Memory for Earlier {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(&mut self.used);
        tape.numbers(&mut self.next);
        tape.numbers(&mut self.shares);
    }
}

impl Earlier {
    /// For the kinematic blocks of `layout`.
    pub(super) fn of(layout: &Arc<Layout>) -> Self {
        Self {
            used: layout.initial().to_vec(),
            next: layout.initial().to_vec(),
            shares: vec![0.0; motion(layout).count()],
            layout: Arc::clone(layout),
            limit: chi_square_quantile(EXPLAINED, 1.0),
        }
    }

    /// Forgets the past: the state is `x` now.
    pub(super) fn start(&mut self, x: &[f64]) {
        self.used.copy_from_slice(x);
        self.next.copy_from_slice(x);
        self.shares.fill(0.0);
    }

    /// Writes to `out` the state `x`, with the earlier value of each kinematic block that has not changed.
    pub(super) fn write(&self, x: &[f64], covariance: &Covariance, out: &mut [f64]) {
        out.copy_from_slice(x);
        for block in motion(&self.layout) {
            let (storage, mut change) = (block.storage_range(), [0.0; MOST_AXES]);
            block.kind.minus(&x[storage.clone()], &self.used[storage.clone()], &mut change);
            let axes = block.tangent_range().zip(change);
            if axes.into_iter().all(|(axis, d)| d * d <= self.limit * covariance.variance(axis)) {
                out[storage.clone()].copy_from_slice(&self.used[storage]);
            }
        }
    }

    /// Notes a correction that led to `x`, by its H and gain.
    pub(super) fn corrected(&mut self, x: &[f64], h: &Jacobian, work: &Workspace) {
        let (kt, ld) = (work.kt(), work.ld);
        for (block, share) in motion(&self.layout).zip(&mut self.shares) {
            if !h.touches(&block.tangent_range()) {
                continue;
            }
            let axis = |row: usize| block.tangent_range().map(move |a| kt[row * ld + a] * h.get(row, a));
            let trace: f64 = (0..h.rows()).flat_map(axis).sum();
            // The mean over the axes that the rows can see.
            *share += (trace / block.kind.dim().min(h.rows()) as f64).max(0.0);
            if *share >= REPLACED {
                let storage = block.storage_range();
                self.used[storage.clone()].copy_from_slice(&self.next[storage.clone()]);
                self.next[storage.clone()].copy_from_slice(&x[storage]);
                *share = 0.0;
            }
        }
    }
}
