//! P = U D Uᵀ, U unit upper triangular and D diagonal: the form of Bierman and Thornton.
//!
//! No variance is ever a difference: D is made of sums and of products of positive numbers, so P stays
//! positive definite whatever the ratio of the noises, and small variances keep their digits beside
//! large ones. No square root is taken.
//!
//! Prediction   weighted Gram-Schmidt of [ΦU | factors of Q], from the last row up (Thornton 1976)
//! Update       one scalar at a time, after R's correlations are taken out (Bierman 1977, ch. V)
//! Storage      columns of U, see `upper`; D_k in place of U_kk = 1

use super::array::Array;
use super::upper::{self, add, along};
use super::{Form, Workspace};
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use core::ops::Range;

/// U D Uᵀ by Bierman and Thornton: positive by construction, without square roots.
#[derive(Clone, Copy, Debug, Default)]
pub struct Udu;

/// The diagonal of U, and the weight of its column, out of what is stored in its place.
const fn unit(d: f64) -> (f64, f64) {
    (1.0, d)
}

impl Form for Udu {
    fn name(&self) -> &'static str {
        "udu"
    }

    fn storage(&self, n: usize) -> usize {
        n * padded(n)
    }

    fn workspace(&self, n: usize, m: usize) -> usize {
        Array::room(n).max((m + 1) * padded(n) + m * m)
    }

    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64 {
        upper::element(n, p, i, j, |_| 1.0, |d| d)
    }

    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
        upper::forget(n, p, block.clone(), absorb);
        upper::write(n, p, block.clone(), value);
        upper::factor(n, p, block);
    }

    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
        let scale = |i: usize| if axes.iter().any(|a| a.contains(&i)) { factor.sqrt() } else { 1.0 };
        for (k, column) in p.chunks_exact_mut(padded(n)).enumerate() {
            let own = scale(k);
            column[k] *= own * own;
            column[..k].iter_mut().enumerate().for_each(|(i, u)| *u *= scale(i) / own);
        }
    }

    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
        let mut array = Array::new(n, &mut w.extra);
        let is_sound = array.transition(p, t, unit);
        if is_sound {
            orthogonalise(n, p, &mut array);
        }
        is_sound
    }

    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
        let mut array = Array::new(n, &mut w.extra);
        array.factor(p, j, unit);
        orthogonalise(n, p, &mut array);
    }

    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
        upper::project(n, p, h, w, unit);
    }

    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (m, ld) = (h.rows(), padded(n));
        let (rows, rest) = w.extra.split_at_mut(m * ld);
        let (gain, variances) = rest.split_at_mut(ld);
        upper::whiten(h, r, rows, variances);
        for (i, row) in rows.chunks_exact(ld).enumerate() {
            condition_on_one(n, p, row, h.columns(), variances[i * m + i], gain);
        }
    }

    fn is_positive(&self, n: usize, p: &[f64], _: &mut Workspace) -> bool {
        let ld = padded(n);
        (0..n).all(|k| p[k * ld + k] >= 0.0 && p[k * ld..=k * ld + k].iter().all(|u| u.is_finite()))
            && (0..n).all(|i| self.element(n, p, i, i).is_finite())
    }
}

/// Thornton's weighted Gram-Schmidt: the rows of A, the last first, are made orthogonal under the
/// weights; their squared norms are D, the projections of the rows above are the column of U.
///
/// Each state is a position in the columns of A, so that the projections of all states are summed
/// and subtracted at once. Elements that are zero cost a comparison.
fn orthogonalise(n: usize, p: &mut [f64], a: &mut Array<'_>) {
    let ld = padded(n);
    let used = a.len * ld;
    for j in (0..n).rev() {
        // In fours, for the processor; sums beyond j are of states that are done, and nobody's.
        let end = j.next_multiple_of(4);
        let (sums, mut d) = (&mut a.sums[..end], 0.0);
        sums.fill(0.0);
        for (column, weight) in a.columns[..used].chunks_exact(ld).zip(&*a.weights) {
            let factor = column[j] * weight;
            if factor != 0.0 {
                d += factor * column[j];
                add(factor, &column[..end], sums);
            }
        }
        let out = &mut p[j * ld..=j * ld + j];
        out[j] = d;
        if d.abs() < f64::MIN_POSITIVE {
            out[..j].fill(0.0);
            continue;
        }
        sums.iter_mut().for_each(|u| *u /= d);
        out[..j].copy_from_slice(&sums[..j]);
        for column in a.columns[..used].chunks_exact_mut(ld) {
            let factor = column[j];
            if factor != 0.0 {
                add(-factor, sums, &mut column[..end]);
            }
        }
    }
}

/// Bierman's update by one row h with noise variance r ≥ 0; `gain` is working memory.
///
/// f = Uᵀh, v = D f; α grows from r to r + hPhᵀ, and D shrinks by the ratio of each step.
fn condition_on_one(n: usize, p: &mut [f64], h: &[f64], ranges: &[(usize, usize)], r: f64, gain: &mut [f64]) {
    let (ld, mut alpha) = (padded(n), r);
    gain[..n].fill(0.0);
    for (k, column) in p.chunks_exact_mut(ld).enumerate() {
        let f = along(column, k, 1.0, h, ranges);
        let v = f * column[k];
        if v == 0.0 {
            continue;
        }
        let next = alpha + f * v;
        column[k] *= alpha / next;
        // Without noise the first column is known exactly: it is left with no weight.
        let lambda = if alpha == 0.0 { 0.0 } else { -f / alpha };
        for (u, g) in column[..k].iter_mut().zip(&mut gain[..k]) {
            let old = *u;
            *u += lambda * *g;
            *g += old * v;
        }
        gain[k] = v;
        alpha = next;
    }
}

/// U D Uᵀ of `before` grows by c a aᵀ with a and then c in `column` (Agee and Turner); `column` is
/// working memory.
fn absorb(before: &mut [f64], column: &mut [f64]) {
    let Some((c, a)) = column.split_last_mut() else { return };
    if a.is_empty() {
        return;
    }
    let ld = before.len() / a.len();
    for (j, other) in before.chunks_exact_mut(ld).enumerate().rev() {
        let (aj, d) = (a[j], other[j]);
        if aj == 0.0 || *c == 0.0 {
            continue;
        }
        other[j] = d + *c * aj * aj;
        let gain = *c * aj / other[j];
        for (u, a) in other[..j].iter_mut().zip(&mut *a) {
            *a -= aj * *u;
            *u += gain * *a;
        }
        *c *= d / other[j];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_form;
    use std::sync::Arc;

    #[test]
    fn it_obeys_the_laws_at_every_padded_size() {
        for n in [1, 2, 3, 4, 5, 8, 9, 15, 21, 31, 33, 40, 60] {
            check_form(&(Arc::new(Udu) as Arc<dyn Form>), n).unwrap();
        }
    }
}
