//! The QR factorisation of large arrays, by `faer`: the one place that knows it.
//!
//! It takes many columns at a time and uses what the processor has, fused multiply-add included, so
//! its last bits are those of the processor's kind; everything else here gives the same bits everywhere.

use super::array::Array;
use crate::linear::padded;
use core::mem::MaybeUninit;
use faer::dyn_stack::MemStack;
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::{MatMut, Par};

/// Rows of the largest transposed array: the factor and two noises.
const fn rows(n: usize) -> usize {
    3 * n
}

/// Numbers of working memory: the transposed array by columns, and the reflections' coefficients.
pub(super) fn room(n: usize) -> usize {
    (padded(rows(n)) + block(n)) * n
}

fn block(n: usize) -> usize {
    recommended_block_size::<f64>(rows(n), n)
}

/// Numbers of memory without contents.
pub(super) fn stack(n: usize) -> usize {
    let bytes = qr_in_place_scratch::<f64>(rows(n), n, block(n), Par::Seq, Default::default()).unaligned_bytes_required();
    bytes.div_ceil(size_of::<f64>())
}

/// S, upper triangular with a positive diagonal, of A = Q R into `p`, with the states in reverse
/// order, so that Rᵀ is S from the last state up.
pub(super) fn triangularise(p: &mut [f64], a: &mut Array<'_>, stack: &mut [MaybeUninit<f64>]) {
    let (n, len) = (a.shape.n, a.shape.len);
    let ld = padded(n);
    let (transposed, coefficients) = a.rest.split_at_mut(padded(rows(n)) * n);
    for (k, column) in a.columns.chunks_exact(ld).enumerate().take(len) {
        for (out, value) in transposed.chunks_exact_mut(len).zip(column[..n].iter().rev()) {
            out[k] = *value;
        }
    }
    let block = block(n);
    let matrix = MatMut::from_column_major_slice_mut(&mut transposed[..len * n], len, n);
    let coefficients = MatMut::from_column_major_slice_mut(&mut coefficients[..block * n], block, n);
    qr_in_place(matrix, coefficients, Par::Seq, MemStack::new_any(stack), Default::default());
    for (k, out) in p.chunks_exact_mut(ld).enumerate() {
        let row = n - 1 - k;
        let sign = if transposed[row * len + row] < 0.0 { -1.0 } else { 1.0 };
        for (i, out) in out[..=k].iter_mut().enumerate() {
            *out = sign * transposed[(n - 1 - i) * len + row];
        }
    }
}
