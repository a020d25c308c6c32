//! The array that a factored form has to triangularise: the factor of Φ(P + Q_before)Φᵀ + Q_after,
//! column beside column.
//!
//! With P = F W Fᵀ (W diagonal) and the noises Q = L V Lᵀ by factors of their own,
//!
//! ```text
//! A = [Φ F | Φ L_before | L_after],   weights (W, V_before, V_after),   P⁺ = A diag(weights) Aᵀ
//! ```
//!
//! A column of zero weight is left out, so no noise needs an inverse, and it may be of any rank.
//! Columns of A are rows of the storage.

use super::form::LARGEST;
use super::upper;
use crate::linear::{BlockMatrix, NoiseBlocks, Transition, padded};

/// The largest negative pivot of a noise, as a part of its variance, that is left out: models compute
/// noise by a few products, which round, and a pivot magnifies that.
const NEGLIGIBLE: f64 = 1e-6;

/// Memory for the array of `n` states, out of what the form asked for.
pub(super) struct Array<'a> {
    n: usize,
    ld: usize,
    /// Columns in use, the first n of the factor itself.
    pub(super) len: usize,
    /// The columns, padded.
    pub(super) columns: &'a mut [f64],
    pub(super) weights: &'a mut [f64],
    /// A column's worth of results.
    pub(super) sums: &'a mut [f64],
    noise: &'a mut [f64],
    column: &'a mut [f64],
    pub(super) rest: &'a mut [f64],
}

impl<'a> Array<'a> {
    /// Numbers it takes.
    pub(super) const fn room(n: usize) -> usize {
        let ld = padded(n);
        // 3n columns and weights, Q, a column and its sums.
        3 * n * ld + 3 * ld + n * ld + 2 * ld
    }

    /// An array without columns in `extra`, of which the rest is `rest`.
    pub(super) fn new(n: usize, extra: &'a mut [f64]) -> Self {
        let ld = padded(n);
        let (columns, extra) = extra.split_at_mut(3 * n * ld);
        let (weights, extra) = extra.split_at_mut(3 * ld);
        let (noise, extra) = extra.split_at_mut(n * ld);
        let (column, extra) = extra.split_at_mut(ld);
        let (sums, rest) = extra.split_at_mut(ld);
        Self {
            n,
            ld,
            len: 0,
            columns,
            weights,
            sums,
            noise,
            column,
            rest,
        }
    }

    /// Φ F, and the columns of both noises; false where a noise is none, or a variance of the result
    /// would overflow or not be a number. `split` makes a column's stored diagonal element into the
    /// factor's own and the weight.
    pub(super) fn transition(&mut self, p: &[f64], t: &Transition, split: impl Fn(f64) -> (f64, f64)) -> bool {
        self.factor(p, &t.phi, split);
        self.noise(&t.before, Some(&t.phi)) && self.noise(&t.after, None) && self.is_finite()
    }

    /// J F.
    pub(super) fn factor(&mut self, p: &[f64], j: &BlockMatrix, split: impl Fn(f64) -> (f64, f64)) {
        self.len = 0;
        for (k, stored) in p.chunks_exact(self.ld).enumerate() {
            let (own, weight) = split(stored[k]);
            self.column.copy_from_slice(stored);
            self.column[k] = own;
            self.push(k, Some(j), weight);
        }
    }

    /// The columns of a factor of Q, through `phi` where there is one; false where Q has a negative
    /// eigenvalue, or an element that is too large or not a number.
    fn noise(&mut self, q: &NoiseBlocks, phi: Option<&BlockMatrix>) -> bool {
        let is_noise = |&(i, j, v): &(u16, u16, f64)| v.abs() < LARGEST && (i != j || v >= 0.0);
        if !q.entries.iter().all(is_noise) {
            return false;
        }
        if q.entries.is_empty() {
            return true;
        }
        self.noise.fill(0.0);
        for &(i, j, value) in q.entries.iter().filter(|e| e.0 <= e.1) {
            self.noise[usize::from(j) * self.ld + usize::from(i)] += value;
        }
        let worst = upper::factor(self.n, self.noise, 0..self.n);
        for k in 0..self.n {
            let stored = &self.noise[k * self.ld..(k + 1) * self.ld];
            let weight = stored[k];
            if weight > 0.0 {
                self.column.copy_from_slice(stored);
                self.column[k] = 1.0;
                self.push(k, phi, weight);
            }
        }
        worst <= NEGLIGIBLE
    }

    /// Adds Φ times `self.column`, whose last element is that of state k.
    fn push(&mut self, k: usize, phi: Option<&BlockMatrix>, weight: f64) {
        let out = &mut self.columns[self.len * self.ld..(self.len + 1) * self.ld];
        out.copy_from_slice(self.column);
        if let Some(phi) = phi {
            phi.active_rows(self.column, k + 1, out);
        }
        self.weights[self.len] = weight;
        self.len += 1;
    }

    /// Takes the weights into the columns.
    pub(super) fn unite(&mut self) {
        for (column, weight) in self.columns.chunks_exact_mut(self.ld).zip(&mut *self.weights).take(self.len) {
            if *weight != 1.0 {
                let root = weight.sqrt();
                column.iter_mut().for_each(|c| *c *= root);
                *weight = 1.0;
            }
        }
    }

    /// Whether no variance of P⁺ overflows, is negative or is not a number.
    fn is_finite(&mut self) -> bool {
        self.sums.fill(0.0);
        for (column, weight) in self.columns.chunks_exact(self.ld).zip(&*self.weights).take(self.len) {
            if weight.is_nan() || *weight < 0.0 {
                return false;
            }
            for (sum, c) in self.sums.iter_mut().zip(column) {
                *sum += weight * c * c;
            }
        }
        // A comparison with what is not a number is false.
        self.sums.iter().all(|sum| *sum < LARGEST)
    }
}
