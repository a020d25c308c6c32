//! The array that a factored form has to triangularise: the factor of Φ(P + Q_before)Φᵀ + Q_after,
//! column beside column.
//!
//! With P = F W Fᵀ (W diagonal) and the noises by their own factors, Q = L V Lᵀ,
//!
//! ```text
//! A = [Φ F | Φ L_before | L_after],   weights (W, V_before, V_after),   P⁺ = A diag(weights) Aᵀ
//! ```
//!
//! A column of zero weight is left out, so no noise needs an inverse, and it may be of any rank.
//! Columns of A are rows of the storage.

use super::dense::axpy;
use super::form::LARGEST;
use super::upper;
use crate::linear::{BlockMatrix, NoiseBlocks, Transition, padded};
use crate::math;
use core::ops::Range;
use fusion_kernels::{Kernel, Shape};

/// The largest negative pivot of a noise, as a part of its variance, that is left out: models compute
/// noise by a few products, which round, and a pivot magnifies that.
const NEGLIGIBLE: f64 = 1e-6;

/// Memory for the array of `n` states, taken from the memory that the form requested.
pub(super) struct Array<'a> {
    kernel: Kernel,
    ld: usize,
    /// States; columns in use, the first n of the factor itself; where rows begin that have one column.
    pub(super) shape: Shape,
    /// The columns, padded.
    pub(super) columns: &'a mut [f64],
    pub(super) weights: &'a mut [f64],
    /// A column's worth of results.
    pub(super) sums: &'a mut [f64],
    noise: &'a mut [f64],
    /// The noise of axes whose noises are independent of all others.
    diagonal: &'a mut [f64],
    /// The memory beyond, for `faer`.
    #[cfg(feature = "faer")]
    pub(super) rest: &'a mut [f64],
}

impl<'a> Array<'a> {
    /// Numbers it takes.
    pub(super) const fn room(n: usize) -> usize {
        let ld = padded(n);
        // 3n columns and weights, Q, its diagonal and sums.
        3 * n * ld + 3 * ld + n * ld + 2 * ld
    }

    /// An array without columns in `extra`.
    pub(super) fn new(n: usize, kernel: Kernel, extra: &'a mut [f64]) -> Self {
        let ld = padded(n);
        let (columns, extra) = extra.split_at_mut(3 * n * ld);
        let (weights, extra) = extra.split_at_mut(3 * ld);
        let (noise, extra) = extra.split_at_mut(n * ld);
        let (diagonal, extra) = extra.split_at_mut(ld);
        let (sums, _rest) = extra.split_at_mut(ld);
        Self {
            kernel,
            ld,
            shape: Shape { n, len: 0, end: 0 },
            columns,
            weights,
            sums,
            noise,
            diagonal,
            #[cfg(feature = "faer")]
            rest: _rest,
        }
    }

    /// Φ F, and the columns of both noises. Returns false if a noise is not a valid covariance, or if a variance of
    /// the result would overflow or be NaN. Without `weights`, the weights of the noises are multiplied into
    /// their columns.
    pub(super) fn transition(&mut self, f: &[f64], weights: Option<&[f64]>, t: &Transition) -> bool {
        self.factor(f, weights, &t.phi);
        let unite = weights.is_none();
        self.noise(&t.before, Some(&t.phi), unite) && self.noise(&t.after, None, unite) && self.is_finite()
    }

    /// J F.
    pub(super) fn factor(&mut self, f: &[f64], weights: Option<&[f64]>, j: &BlockMatrix) {
        let (map, reach) = j.reached();
        self.kernel.through(reach, map, f, self.columns);
        let n = self.shape.n;
        match weights {
            Some(weights) => self.weights[..n].copy_from_slice(&weights[..n]),
            None => self.weights[..n].fill(1.0),
        }
        (self.shape.len, self.shape.end) = (n, reach.end());
    }

    /// The columns of a factor of Q, through `phi` where there is one; false where Q has a negative
    /// eigenvalue, or an element that is too large or not a number.
    fn noise(&mut self, q: &NoiseBlocks, phi: Option<&BlockMatrix>, unite: bool) -> bool {
        let is_noise = |&(i, j, v): &(u16, u16, f64)| v.abs() < LARGEST && (i != j || v >= 0.0);
        if !q.entries.iter().all(is_noise) {
            return false;
        }
        let (n, ld) = (self.shape.n, self.ld);
        let apart = q.entries.iter().filter(|e| e.0 != e.1);
        let (first, end) = apart.fold((n, 0), |(first, end), &(i, j, _)| {
            (first.min(i.min(j).into()), end.max(usize::from(i.max(j)) + 1))
        });
        let coupled = first.min(end)..end;
        self.noise[coupled.start * ld..coupled.end * ld].fill(0.0);
        self.diagonal.fill(0.0);
        for &(i, j, value) in q.entries.iter().filter(|e| e.0 <= e.1) {
            let (i, j) = (usize::from(i), usize::from(j));
            if coupled.contains(&j) {
                self.noise[j * ld + i] += value;
            } else {
                self.diagonal[j] += value;
            }
        }
        let worst = upper::factor(n, self.noise, coupled.clone());
        for k in 0..n {
            let weight = if coupled.contains(&k) {
                self.noise[k * ld + k]
            } else {
                self.diagonal[k]
            };
            if weight > 0.0 {
                let above = if coupled.contains(&k) { coupled.start..k } else { k..k };
                self.push(k, above, phi, weight, unite);
            }
        }
        worst <= NEGLIGIBLE
    }

    /// Adds Φ times e_k and what `noise` has of column k in the axes `above`.
    fn push(&mut self, k: usize, above: Range<usize>, phi: Option<&BlockMatrix>, weight: f64, unite: bool) {
        let (ld, Shape { len, end, .. }) = (self.ld, self.shape);
        let out = &mut self.columns[len * ld..(len + 1) * ld];
        let part = &self.noise[k * ld..k * ld + k];
        if let Some(phi) = phi {
            let (map, _) = phi.reached();
            out.copy_from_slice(&map[k * ld..(k + 1) * ld]);
            for i in above {
                axpy(part[i], &map[i * ld..(i + 1) * ld], out);
            }
        } else {
            out.fill(0.0);
            out[above.clone()].copy_from_slice(&part[above]);
            out[k] = 1.0;
        }
        self.weights[len] = weight;
        if unite {
            let root = math::sqrt(weight);
            out.iter_mut().for_each(|c| *c *= root);
            self.weights[len] = 1.0;
        }
        (self.shape.len, self.shape.end) = (len + 1, end.max(k + 1));
    }

    /// Returns true if no variance of P⁺ overflows, is negative or is NaN.
    fn is_finite(&mut self) -> bool {
        let Shape { n, len, .. } = self.shape;
        self.kernel.squares(len, self.columns, self.weights, self.sums);
        // A comparison with NaN is false.
        self.weights[..n].iter().all(|w| *w >= 0.0) && self.sums.iter().all(|sum| *sum < LARGEST)
    }
}
