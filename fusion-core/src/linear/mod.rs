//! Sparse linear maps on the tangent space: Φ, chart changes, Jacobians H.
//!
//! Models write small dense blocks; the pattern of blocks is learnt from what they write and
//! then stays, so that later calls allocate nothing and the kernels touch only what is there.

mod block_matrix;
mod jacobian;
mod pattern;
mod transition;

pub use block_matrix::BlockMatrix;
pub use jacobian::Jacobian;
pub(crate) use pattern::Pattern;
pub use transition::Transition;
pub(crate) use transition::{BEFORE, NoiseBlocks};

/// Row length of a padded matrix of `n` columns: the next multiple of 8 doubles.
#[must_use]
#[inline]
pub const fn padded(n: usize) -> usize {
    n.div_ceil(8) * 8
}
