//! P = U D Uᵀ, U unit upper triangular and D diagonal: the form of Bierman and Thornton.
//!
//! No variance is ever a difference: D contains only sums and products of positive numbers. So P stays
//! positive definite at every ratio of the noises, and small variances keep their digits next to
//! large ones. No square root is taken.
//!
//! Prediction   weighted Gram-Schmidt of [ΦU | factors of Q], from the last row up (Thornton 1976)
//! Update       one scalar at a time, after R's correlations are taken out (Bierman 1977, ch. V)
//! Storage      columns of U, see `upper`, and D behind them

use super::array::Array;
use super::upper;
use super::{Form, Workspace};
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use crate::math;
use core::ops::Range;

/// U D Uᵀ by Bierman and Thornton: positive by construction, without square roots.
#[derive(Clone, Copy, Debug, Default)]
pub struct Udu;

/// U, and D.
fn parts(n: usize, p: &[f64]) -> (&[f64], &[f64]) {
    p.split_at(n * padded(n))
}

impl Form for Udu {
    fn name(&self) -> &'static str {
        "udu"
    }

    fn storage(&self, n: usize) -> usize {
        (n + 1) * padded(n)
    }

    fn workspace(&self, n: usize, m: usize) -> usize {
        Array::room(n).max(upper::room(n, m))
    }

    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64 {
        let (u, d) = parts(n, p);
        upper::element(n, u, Some(d), i, j)
    }

    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
        let (u, d) = p.split_at_mut(n * padded(n));
        upper::forget(n, u, block.clone(), |before, column| {
            let (_, a) = (column.split_last_mut()).unwrap_or((&mut 0.0, &mut []));
            let (d, own) = d.split_at_mut(a.len());
            absorb(before, d, core::mem::take(&mut own[0]), a);
        });
        upper::write(n, u, block.clone(), value);
        upper::factor(n, u, block.clone());
        for k in block {
            d[k] = core::mem::replace(&mut u[k * padded(n) + k], 1.0);
        }
    }

    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
        let scale = |i: usize| {
            if axes.iter().any(|a| a.contains(&i)) {
                math::sqrt(factor)
            } else {
                1.0
            }
        };
        let (u, d) = p.split_at_mut(n * padded(n));
        for (k, column) in u.chunks_exact_mut(padded(n)).enumerate() {
            let own = scale(k);
            d[k] *= own * own;
            column[..k].iter_mut().enumerate().for_each(|(i, u)| *u *= scale(i) / own);
        }
    }

    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
        let mut array = Array::new(n, w.kernel, &mut w.extra);
        let (u, d) = parts(n, p);
        let is_sound = array.transition(u, Some(d), t);
        if is_sound {
            w.kernel.orthogonalise(array.shape, array.columns, array.weights, p, array.sums);
        }
        is_sound
    }

    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
        let mut array = Array::new(n, w.kernel, &mut w.extra);
        let (u, d) = parts(n, p);
        array.factor(u, Some(d), j);
        w.kernel.orthogonalise(array.shape, array.columns, array.weights, p, array.sums);
    }

    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
        let (u, d) = parts(n, p);
        upper::project(n, u, Some(d), h, w);
    }

    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (m, ld, kernel) = (h.rows(), padded(n), w.kernel);
        let (rows, rest) = w.extra.split_at_mut(m * ld);
        let (f, rest) = rest.split_at_mut(ld);
        let (lambda, variances) = rest.split_at_mut(ld);
        upper::whiten(h, r, rows, variances);
        for (i, row) in rows.chunks_exact(ld).enumerate() {
            kernel.along(n, 1, row, h.columns(), p, f);
            kernel.weigh(n, variances[i * m + i], f, p, lambda);
        }
    }

    fn is_positive(&self, n: usize, p: &[f64], w: &mut Workspace) -> bool {
        let (u, d) = parts(n, p);
        d.iter().all(|d| *d >= 0.0) && upper::is_finite(n, u, Some(d), w)
    }
}

/// U D Uᵀ, U in `before`, grows by c a aᵀ (Agee and Turner); `a` is working memory.
fn absorb(before: &mut [f64], d: &mut [f64], mut c: f64, a: &mut [f64]) {
    if a.is_empty() {
        return;
    }
    let ld = before.len() / a.len();
    for (j, other) in before.chunks_exact_mut(ld).enumerate().rev() {
        let aj = a[j];
        if aj == 0.0 || c == 0.0 {
            continue;
        }
        let old = d[j];
        d[j] += c * aj * aj;
        let gain = c * aj / d[j];
        for (u, a) in other[..j].iter_mut().zip(&mut *a) {
            *a -= aj * *u;
            *u += gain * *a;
        }
        c *= old / d[j];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_form;
    use alloc::sync::Arc;

    #[test]
    fn it_obeys_the_laws_at_every_padded_size() {
        for n in [1, 2, 3, 4, 5, 8, 9, 15, 21, 31, 33, 40, 60] {
            check_form(&(Arc::new(Udu) as Arc<dyn Form>), n).unwrap();
        }
    }
}
