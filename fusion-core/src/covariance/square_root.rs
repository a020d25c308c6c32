//! P = S Sᵀ, S upper triangular: array algorithms.
//!
//! Every step is an orthogonal transformation of an array, so P is positive by construction, and S has
//! half of P's range of exponents: P of condition 1e16 is S of 1e8.
//!
//! Prediction   [ΦS | roots of Q] is made triangular by reflections (Householder); with the feature `faer`, on
//!              large arrays by those of `faer`
//! Update       [[R^½, HS], [0, S]] is made triangular by rotations (Givens), row by row of H after R's
//!              correlations are taken out, in the order that keeps S triangular (Carlson 1973)
//! Storage      columns of S, see `upper`

use super::array::Array;
#[cfg(feature = "faer")]
use super::faer;
use super::upper;
use super::{Form, Workspace};
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use crate::math;
use core::mem::MaybeUninit;
use core::ops::Range;
use fusion_kernels::Kernel;

/// S Sᵀ by orthogonal transformations: positive by construction.
#[derive(Clone, Copy, Debug)]
pub struct SquareRoot {
    /// By how many the states that move, those whose row of Φ is not of the identity, have to exceed
    /// those that do not, for `faer` to make the reflections of the prediction. A state that does not
    /// move costs the kernel here next to nothing, and `faer` as much as any other. It has no effect
    /// without the feature `faer`.
    pub faer_from: usize,
}

impl Default for SquareRoot {
    fn default() -> Self {
        Self { faer_from: CROSSOVER }
    }
}

/// Measured by `cargo bench --bench forms`: with a Φ without zeros both are equally fast at about 250 states,
/// and `faer` is 1.2 times as fast at 300; with three fifths of the states moving, 60 more than stand still,
/// it is no faster at 300. As its last bits are those of the processor's kind, it is used where it is faster.
const CROSSOVER: usize = 250;

impl Form for SquareRoot {
    fn name(&self) -> &'static str {
        "square_root"
    }

    fn storage(&self, n: usize) -> usize {
        n * padded(n)
    }

    fn workspace(&self, n: usize, m: usize) -> usize {
        let own = Array::room(n);
        #[cfg(feature = "faer")]
        let own = own + if n >= self.faer_from { faer::room(n) } else { 0 };
        own.max(upper::room(n, m))
    }

    #[cfg(feature = "faer")]
    fn stack(&self, n: usize, _: usize) -> usize {
        if n >= self.faer_from { faer::stack(n) } else { 0 }
    }

    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64 {
        upper::element(n, p, None, i, j)
    }

    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
        let first = block.start;
        upper::forget(n, p, block.clone(), absorb);
        upper::write(n, p, block.clone(), value);
        upper::factor(n, p, block.clone());
        for k in block {
            let column = &mut p[k * padded(n)..=k * padded(n) + k];
            // Not a number where the variance is negative.
            let root = math::sqrt(column[k]);
            column[first..k].iter_mut().for_each(|u| *u *= root);
            column[k] = root;
        }
    }

    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
        let root = math::sqrt(factor);
        for column in p.chunks_exact_mut(padded(n)) {
            axes.iter().for_each(|a| column[a.clone()].iter_mut().for_each(|s| *s *= root));
        }
    }

    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
        let mut array = Array::new(n, w.kernel, &mut w.extra);
        let is_sound = array.transition(p, None, t);
        if is_sound {
            self.triangularise(p, &mut array, &t.phi, w.kernel, &mut w.stack);
        }
        is_sound
    }

    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
        let mut array = Array::new(n, w.kernel, &mut w.extra);
        array.factor(p, None, j);
        self.triangularise(p, &mut array, j, w.kernel, &mut w.stack);
    }

    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
        upper::project(n, p, None, h, w);
    }

    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (m, ld, kernel) = (h.rows(), padded(n), w.kernel);
        let (rows, rest) = w.extra.split_at_mut(m * ld);
        let (f, rest) = rest.split_at_mut(ld);
        let (scales, variances) = rest.split_at_mut(2 * ld);
        upper::whiten(h, r, rows, variances);
        for (i, row) in rows.chunks_exact(ld).enumerate() {
            kernel.along(n, 1, row, h.columns(), p, f);
            kernel.rotate(n, variances[i * m + i], f, p, scales);
        }
    }

    fn is_positive(&self, n: usize, p: &[f64], w: &mut Workspace) -> bool {
        upper::is_finite(n, p, None, w)
    }
}

impl SquareRoot {
    /// Makes the array of `phi` triangular; S of it into `p`.
    fn triangularise(&self, p: &mut [f64], a: &mut Array<'_>, phi: &BlockMatrix, kernel: Kernel, w: &mut [MaybeUninit<f64>]) {
        #[cfg(feature = "faer")]
        if (2 * phi.active().len()).saturating_sub(phi.dim()) >= self.faer_from {
            faer::triangularise(p, a, w);
            return;
        }
        #[cfg(not(feature = "faer"))]
        let _ = (phi, w);
        kernel.reflect(a.shape, a.columns, p, a.sums);
    }
}

/// (x, y) ← (c x + s y, c y − s x).
fn rotate(c: f64, s: f64, x: &mut [f64], y: &mut [f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
    }
}

/// S Sᵀ of `before` grows by a aᵀ with a in `column`, whose last element counts for nothing: it is
/// that of an axis which has been forgotten.
fn absorb(before: &mut [f64], column: &mut [f64]) {
    let a = &mut column[..];
    let n = a.len() - 1;
    if n == 0 {
        return;
    }
    let ld = before.len() / n;
    for (j, other) in before.chunks_exact_mut(ld).enumerate().rev() {
        let norm = math::sqrt(other[j] * other[j] + a[j] * a[j]);
        if a[j] != 0.0 && norm > 0.0 {
            rotate(other[j] / norm, a[j] / norm, &mut other[..=j], &mut a[..=j]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_form;
    use alloc::sync::Arc;

    #[test]
    fn both_kernels_obey_the_laws_at_every_padded_size() {
        for n in [1, 2, 3, 4, 5, 8, 9, 15, 21, 31, 33, 40, 60] {
            for faer_from in [usize::MAX, 0] {
                check_form(&(Arc::new(SquareRoot { faer_from }) as Arc<dyn Form>), n).unwrap();
            }
        }
    }
}
