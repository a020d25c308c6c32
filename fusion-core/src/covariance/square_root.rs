//! P = S Sᵀ, S upper triangular: array algorithms.
//!
//! Every step is an orthogonal transformation of an array, so P is positive by construction, and S has
//! half of P's range of exponents: P of condition 1e16 is S of 1e8.
//!
//! Prediction   [ΦS | roots of Q] is made triangular by reflections (Householder), on large arrays by
//!              those of `faer`
//! Update       [[R^½, HS], [0, S]] is made triangular by rotations (Givens), row by row of H after R's
//!              correlations are taken out, in the order that keeps S triangular (Carlson 1973)
//! Storage      columns of S, see `upper`

use super::array::Array;
use super::upper::{self, add, along};
use super::{Form, Workspace, faer};
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use core::mem::MaybeUninit;
use core::ops::Range;

/// S Sᵀ by orthogonal transformations: positive by construction.
#[derive(Clone, Copy, Debug)]
pub struct SquareRoot {
    /// By how many the states that move, those whose row of Φ is not of the identity, have to exceed
    /// those that do not, for `faer` to make the reflections of the prediction. A state that does not
    /// move costs the kernel here next to nothing, and `faer` as much as any other.
    pub faer_from: usize,
}

impl Default for SquareRoot {
    fn default() -> Self {
        Self { faer_from: CROSSOVER }
    }
}

/// Measured by `cargo bench --bench forms`: with a Φ without zeros both kernels are equally fast at 70
/// states and `faer` is 1.4 times as fast at 150; with three fifths of the states moving they are
/// equally fast at 300, which are 60 more that move. As its last bits are those of the processor's
/// kind, it is used where it is clearly faster.
const CROSSOVER: usize = 100;

/// The diagonal of S as it is stored, and columns of weight one.
const fn whole(s: f64) -> (f64, f64) {
    (s, 1.0)
}

impl Form for SquareRoot {
    fn name(&self) -> &'static str {
        "square_root"
    }

    fn storage(&self, n: usize) -> usize {
        n * padded(n)
    }

    fn workspace(&self, n: usize, m: usize) -> usize {
        (Array::room(n) + if n >= self.faer_from { faer::room(n) } else { 0 }).max((m + 1) * padded(n) + m * m)
    }

    fn stack(&self, n: usize, _: usize) -> usize {
        if n >= self.faer_from { faer::stack(n) } else { 0 }
    }

    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64 {
        upper::element(n, p, i, j, |s| s, |_| 1.0)
    }

    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
        let first = block.start;
        upper::forget(n, p, block.clone(), absorb);
        upper::write(n, p, block.clone(), value);
        upper::factor(n, p, block.clone());
        for k in block {
            let column = &mut p[k * padded(n)..=k * padded(n) + k];
            // Not a number where the variance is negative.
            let root = column[k].sqrt();
            column[first..k].iter_mut().for_each(|u| *u *= root);
            column[k] = root;
        }
    }

    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
        let root = factor.sqrt();
        for column in p.chunks_exact_mut(padded(n)) {
            axes.iter().for_each(|a| column[a.clone()].iter_mut().for_each(|s| *s *= root));
        }
    }

    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
        let mut array = Array::new(n, &mut w.extra);
        let is_sound = array.transition(p, t, whole);
        if is_sound {
            self.triangularise(n, p, &mut array, &t.phi, &mut w.stack);
        }
        is_sound
    }

    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
        let mut array = Array::new(n, &mut w.extra);
        array.factor(p, j, whole);
        self.triangularise(n, p, &mut array, j, &mut w.stack);
    }

    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
        upper::project(n, p, h, w, whole);
    }

    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (m, ld) = (h.rows(), padded(n));
        let (rows, rest) = w.extra.split_at_mut(m * ld);
        let (gain, variances) = rest.split_at_mut(ld);
        upper::whiten(h, r, rows, variances);
        for (i, row) in rows.chunks_exact(ld).enumerate() {
            condition_on_one(n, p, row, h.columns(), variances[i * m + i].sqrt(), gain);
        }
    }

    fn is_positive(&self, n: usize, p: &[f64], _: &mut Workspace) -> bool {
        (0..n).all(|i| self.element(n, p, i, i).is_finite())
    }
}

impl SquareRoot {
    /// Makes the array of `phi` triangular; S of it into `p`.
    fn triangularise(&self, n: usize, p: &mut [f64], a: &mut Array<'_>, phi: &BlockMatrix, w: &mut [MaybeUninit<f64>]) {
        a.unite();
        if (2 * phi.active().len()).saturating_sub(phi.dim()) >= self.faer_from {
            faer::triangularise(n, p, a, w);
        } else {
            reflect(n, p, a);
        }
    }
}

/// Reflections that make the array triangular, the last state first.
///
/// A reflection makes the row of state j zero in all columns that are not done, but column j, which
/// is then done. Each state is a position in the columns, so that a reflection acts on the rows of
/// all other states at once. Elements that are zero cost a comparison.
fn reflect(n: usize, p: &mut [f64], a: &mut Array<'_>) {
    let (ld, len) = (padded(n), a.len);
    for j in (0..n).rev() {
        // In fours, for the processor; what is beyond j belongs to states that are done, and to nobody.
        let end = j.next_multiple_of(4);
        let others = || (0..j).chain(n..len);
        let own = a.columns[j * ld + j];
        let rest: f64 = others().map(|k| a.columns[k * ld + j] * a.columns[k * ld + j]).sum();
        let norm = (own * own + rest).sqrt();
        let mut sign = if own < 0.0 { -1.0 } else { 1.0 };
        if rest > 0.0 {
            // I − v vᵀ/scale with v = x + sign |x| e_j takes x to −sign |x| e_j; scale = |v|²/2.
            let scale = norm * (norm + own.abs());
            a.columns[j * ld + j] = own + sign * norm;
            let sums = &mut a.sums[..end];
            sums.fill(0.0);
            for k in others().chain([j]) {
                let column = &a.columns[k * ld..(k + 1) * ld];
                if column[j] != 0.0 {
                    add(column[j], &column[..end], sums);
                }
            }
            sums.iter_mut().for_each(|s| *s /= scale);
            for k in others().chain([j]) {
                let column = &mut a.columns[k * ld..(k + 1) * ld];
                if column[j] != 0.0 {
                    add(-column[j], sums, &mut column[..end]);
                }
            }
            sign = -sign;
        }
        // The diagonal of S is positive: column j by its sign.
        for (out, value) in p[j * ld..j * ld + j].iter_mut().zip(&a.columns[j * ld..]) {
            *out = sign * value;
        }
        p[j * ld + j] = norm;
    }
}

/// One row h of H with noise of standard deviation ρ: rotations of the noise's column with those of
/// S, the first first, take hS to zero; `gain` is the rest of the noise's column.
fn condition_on_one(n: usize, p: &mut [f64], h: &[f64], ranges: &[(usize, usize)], mut rho: f64, gain: &mut [f64]) {
    gain[..n].fill(0.0);
    for (k, column) in p.chunks_exact_mut(padded(n)).enumerate() {
        let f = along(column, k, column[k], h, ranges);
        if f == 0.0 {
            continue;
        }
        let norm = (rho * rho + f * f).sqrt();
        rotate(rho / norm, f / norm, &mut gain[..=k], &mut column[..=k]);
        rho = norm;
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
        let norm = (other[j] * other[j] + a[j] * a[j]).sqrt();
        if a[j] != 0.0 && norm > 0.0 {
            rotate(other[j] / norm, a[j] / norm, &mut other[..=j], &mut a[..=j]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_form;
    use std::sync::Arc;

    #[test]
    fn both_kernels_obey_the_laws_at_every_padded_size() {
        for n in [1, 2, 3, 4, 5, 8, 9, 15, 21, 31, 33, 40, 60] {
            for faer_from in [usize::MAX, 0] {
                check_form(&(Arc::new(SquareRoot { faer_from }) as Arc<dyn Form>), n).unwrap();
            }
        }
    }
}
