//! P by an upper triangular factor: the common part of the factored forms.
//!
//! The factor is stored by columns. Row k of the storage, padded to a multiple of eight, holds the
//! elements i ≤ k in column k of the factor; the other elements stay zero. The kernels add columns to
//! each other, so the inner loops run along memory.

use super::Workspace;
use super::dense::axpy;
use crate::linear::{Jacobian, padded};
use core::ops::Range;

/// A pivot of a factorisation that is smaller than this part of its diagonal element is rounding.
///
/// The elements of a covariance or of a noise are sums of products, each of which rounds by 1e-16
/// of √(P_ii P_jj); a hundred of them leave 1e-14 of a pivot that ought to be zero.
const ROUNDING: f64 = 1e-14;

/// Writes the upper triangle of `value` (d×d, row by row) at the axes `block` of the storage.
pub(super) fn write(n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
    let (ld, first, d) = (padded(n), block.start, block.len());
    for k in block {
        for (i, out) in p[k * ld + first..=k * ld + k].iter_mut().enumerate() {
            *out = value[i * d + k - first];
        }
    }
}

/// Factors A = U D Uᵀ in place on the axes `block`, U unit upper triangular, D in place of its ones;
/// the most negative pivot is returned as a part of its diagonal element, and is in D: zero where A
/// has no negative eigenvalue. Pivots within rounding are zero, and so are their columns of U.
pub(super) fn factor(n: usize, a: &mut [f64], block: Range<usize>) -> f64 {
    let (ld, first, end) = (padded(n), block.start, block.end);
    let mut worst = 0.0_f64;
    for j in block.rev() {
        let eliminated = |k: usize| a[k * ld + j] * a[k * ld + j] * a[k * ld + k];
        let diagonal = a[j * ld + j] + (j + 1..end).map(eliminated).sum::<f64>();
        let (before, rest) = a.split_at_mut(j * ld);
        let column = &mut rest[..=j];
        let d = column[j];
        if d.abs() <= ROUNDING * diagonal.abs() {
            column[first..].fill(0.0);
            continue;
        }
        // Not a number stays: max would leave it out.
        worst = if d.is_finite() {
            worst.max(-d / diagonal.abs())
        } else {
            f64::INFINITY
        };
        for i in first..j {
            let u = column[i] / d;
            if u != 0.0 {
                axpy(-u, &column[first..=i], &mut before[i * ld + first..=i * ld + i]);
            }
        }
        column[first..j].iter_mut().for_each(|u| *u /= d);
    }
    worst
}

/// Σ_k F_ik w_k F_jk of the factor F with `weights`, or with ones.
pub(super) fn element(n: usize, f: &[f64], weights: Option<&[f64]>, i: usize, j: usize) -> f64 {
    let ld = padded(n);
    let term = |k: usize| weights.map_or(1.0, |w| w[k]) * (f[k * ld + i] * f[k * ld + j]);
    (i.max(j)..n).map(term).sum()
}

/// Whether the variances of F W Fᵀ are finite; `weights` is `None` if all are one.
pub(super) fn is_finite(n: usize, f: &[f64], weights: Option<&[f64]>, w: &mut Workspace) -> bool {
    let ld = padded(n);
    let (sums, ones) = w.extra[..2 * ld].split_at_mut(ld);
    ones.fill(1.0);
    w.kernel.squares(n, f, weights.unwrap_or(ones), sums);
    sums[..n].iter().all(|v| v.is_finite())
}

/// Numbers that [`project`] and the updates of a factor take.
pub(super) fn room(n: usize, m: usize) -> usize {
    (2 * m).max(m + 3) * padded(n)
}

/// HP and HPHᵀ of P = F W Fᵀ; `weights` is `None` if all are one.
pub(super) fn project(n: usize, f: &[f64], weights: Option<&[f64]>, h: &Jacobian, w: &mut Workspace) {
    let (m, ld, kernel) = (h.rows(), padded(n), w.kernel);
    let (along, rest) = w.extra.split_at_mut(m * ld);
    let weighed = &mut rest[..m * ld];
    kernel.along(n, m, h.padded_rows(), h.columns(), f, along);
    weighed.copy_from_slice(along);
    if let Some(weights) = weights {
        for row in weighed.chunks_exact_mut(ld) {
            row.iter_mut().zip(weights).for_each(|(v, w)| *v *= w);
        }
    }
    kernel.project(m, weighed, &[(0, n)], f, &mut w.hp, ld);
    kernel.inner(m, along, weighed, &mut w.hph, ld);
}

/// Takes the axes `block` out of the factor. Their rows become zero; then each of their columns, the
/// last first, is handed to `absorb` with all columns before it, whose covariance is to grow by what
/// the column held, and becomes zero too.
pub(super) fn forget(n: usize, p: &mut [f64], block: Range<usize>, mut absorb: impl FnMut(&mut [f64], &mut [f64])) {
    let ld = padded(n);
    for (k, column) in p.chunks_exact_mut(ld).enumerate().skip(block.start) {
        column[block.start..block.end.min(k)].fill(0.0);
    }
    for b in block.rev() {
        let (before, rest) = p.split_at_mut(b * ld);
        absorb(before, &mut rest[..=b]);
        rest[..=b].fill(0.0);
    }
}

/// Takes the correlations out of R = L D Lᵀ, L unit lower triangular: the rows of L⁻¹H into `rows`,
/// each padded as those of H, and D into the diagonal of `variances` (m×m). R may be singular.
pub(super) fn whiten(h: &Jacobian, r: &[f64], rows: &mut [f64], variances: &mut [f64]) {
    let m = h.rows();
    variances[..m * m].copy_from_slice(&r[..m * m]);
    for i in 0..m {
        let ld = h.row(i).len();
        let (done, rest) = rows.split_at_mut(i * ld);
        let row = &mut rest[..ld];
        row.copy_from_slice(h.row(i));
        for k in 0..i {
            // Below the diagonal is L D.
            let d = variances[k * m + k];
            let l = if d == 0.0 { 0.0 } else { variances[i * m + k] / d };
            if l == 0.0 {
                continue;
            }
            for j in k + 1..=i {
                variances[i * m + j] -= l * variances[j * m + k];
            }
            axpy(-l, &done[k * ld..(k + 1) * ld], row);
        }
        let d = &mut variances[i * m + i];
        if d.abs() <= ROUNDING * r[i * m + i].abs() {
            *d = 0.0;
        }
    }
}
