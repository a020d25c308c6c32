//! Aligning anew after a gap in which the attitude was lost.
//!
//! A gap of the input may leave an attitude that is not aligned any more. A measurement of its sine or cosine fits two
//! headings then, and the filter keeps the nearer one. The initialisers say which one is right: they begin
//! anew, and the first attitude that they find replaces that of the filter, unless the two agree. Everything else that
//! the filter knows stays.
//!
//! Limit      three σ of a right angle, beyond which a sine turns back: twice what can be linearised about
//! Not        initialisers that read no stream: a declared start is not true later

use crate::belief::Belief;
use crate::consistency::chi_square_quantile;
use crate::covariance::{cholesky, solve_lower};
use crate::state::{ALIGNED, Block};

/// The largest 1σ of an attitude that still counts as aligned \[rad\].
pub(super) const LOST: f64 = 2.0 * ALIGNED;
/// The probability with which a right attitude agrees with that of the initialisers.
const AGREES: f64 = 0.99;

/// Whether two beliefs about a block are the same to the bit.
pub(super) fn is_same(block: &Block, a: &Belief, b: &Belief) -> bool {
    a.x[block.storage_range()] == b.x[block.storage_range()] && a.covariance.variances(block).eq(b.covariance.variances(block))
}

/// Whether two independent beliefs about a block are those of one value.
pub(super) fn agree(block: &Block, a: &Belief, b: &Belief) -> bool {
    let (storage, n) = (block.storage_range(), block.kind.dim());
    let [mut difference, mut sum, mut factor] = [[0.0; 9]; 3];
    block.kind.minus(&a.x[storage.clone()], &b.x[storage], &mut difference[..n]);
    for (k, s) in sum[..n * n].iter_mut().enumerate() {
        let at = |i: usize| block.tangent_range().start + i;
        *s = a.covariance.element(at(k / n), at(k % n)) + b.covariance.element(at(k / n), at(k % n));
    }
    let is_factored = cholesky(&sum[..n * n], &mut factor[..n * n], n);
    solve_lower(&factor[..n * n], &mut difference[..n], n);
    is_factored && difference[..n].iter().map(|d| d * d).sum::<f64>() <= chi_square_quantile(AGREES, n as f64)
}
