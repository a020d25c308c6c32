//! Sigma points: the belief as a set of states, each moved through a function.
//!
//! Set        x̂ and x̂ ⊞ (±γ L_i), P = L Lᵀ, γ = α√(n + κ), ⊞ and ⊟ those of the chart
//! Weights    w = 1/(2γ²) for each point of a pair. For x̂: 1 − n/γ² in the mean, and 1 − α² + β more in the
//!            covariance
//! Read as    odd part φ_i = (y_i⁺ − y_i⁻)/2γ and even part e_i = (y_i⁺ + y_i⁻)/2 of the moved points,
//!            relative to the moved x̂:
//!            mean μ = 2w Σ e_i, covariance Σ φ_i φ_iᵀ + 2w Σ e_i e_iᵀ + (β − α²) μ μᵀ
//!            The numbers are those of the usual weighted sums, in which one weight is large and negative for a
//!            small α. In this form the covariance is evidently positive for β ≥ α²
//! Source     Julier and Uhlmann 2004; scaled set: Julier 2002; on manifolds: Brossard, Barrau,
//!            Bonnabel 2019 (arXiv 2002.00878)

use crate::covariance::{Covariance, Kernel, Lines, axpy};
use crate::linear::{BlockMatrix, Transition, padded};
use crate::math;
use alloc::vec::Vec;

/// How the sigma points are spread: the scaled set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaSpread {
    /// α: the points lie α√(n + κ) σ from the estimate.
    pub alpha: f64,
    /// β: 2 is best for a Gaussian; at least α², so that no variance can become negative.
    pub beta: f64,
    /// κ.
    pub kappa: f64,
}

impl SigmaSpread {
    /// α = 1, β = 2, κ = 0: the points lie √n σ away, no weight is negative.
    pub const DEFAULT: Self = Self {
        alpha: 1.0,
        beta: 2.0,
        kappa: 0.0,
    };

    /// γ over n dimensions.
    #[must_use]
    pub fn reach(&self, n: usize) -> f64 {
        self.alpha * math::sqrt(n as f64 + self.kappa)
    }
}

impl Default for SigmaSpread {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Memory of a rule that draws sigma points; sized when they are first drawn. Rows are padded.
#[derive(Clone, Debug, Default)]
pub struct SigmaPoints {
    pub(super) kernel: Kernel,
    pub(super) n: usize,
    /// The length of a row of n numbers, and of the m numbers of a function.
    pub(super) ld: usize,
    pub(super) lm: usize,
    /// Lᵀ, n×n: row i is L_i.
    pub(super) factor: Lines,
    /// A correction to a point; the moved points of a pair.
    pub(super) delta: Vec<f64>,
    pub(super) ends: [Vec<f64>; 2],
    /// φ_i and e_i, row after row.
    pub(super) odd: Lines,
    pub(super) even: Lines,
    /// μ.
    pub(super) mean: Lines,
    /// The part of second order, m×m.
    pub(super) spread: Lines,
    /// A covariance, n×n; the same without padding.
    pub(super) whole: Lines,
    dense: Vec<f64>,
    /// A state, and the moved x̂.
    pub(super) x: Vec<f64>,
    pub(super) centre: Vec<f64>,
}

impl SigmaPoints {
    /// Room for functions of `m` numbers over `n` dimensions and states of `storage` numbers.
    pub(super) fn prepare(&mut self, kernel: Kernel, n: usize, m: usize, storage: usize) {
        (self.kernel, self.n, self.ld, self.lm) = (kernel, n, padded(n), padded(m));
        let fit = |lines: &mut Lines, length: usize| {
            if lines.len() < length {
                *lines = Lines::zeros(length);
            }
        };
        let rows = n.max(m) * self.ld.max(self.lm);
        for lines in [&mut self.factor, &mut self.odd, &mut self.even, &mut self.spread, &mut self.whole] {
            fit(lines, rows);
        }
        fit(&mut self.mean, self.ld.max(self.lm));
        let longest = n.max(m);
        for list in self.ends.iter_mut().chain([&mut self.delta]) {
            list.resize(longest.max(list.len()), 0.0);
        }
        self.dense.resize(n * n, 0.0);
        self.x.resize(storage, 0.0);
        self.centre.resize(storage, 0.0);
    }

    /// L of P plus `added`. An axis whose variance is zero, up to rounding, has no points.
    pub(super) fn take(&mut self, covariance: &Covariance, added: impl Iterator<Item = (usize, usize, f64)>) {
        let (n, ld) = (self.n, self.ld);
        for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            let value = covariance.element(i, j);
            self.whole[i * ld + j] = value;
            self.whole[j * ld + i] = value;
        }
        added.for_each(|(i, j, q)| self.whole[i * ld + j] += q);
        self.kernel.root(n, &self.whole, &mut self.factor);
    }

    /// `delta` ← `reach` L_i; false where it is zero.
    pub(super) fn point(&mut self, i: usize, reach: f64) -> bool {
        let column = &self.factor[i * self.ld..i * self.ld + self.n];
        self.delta.iter_mut().zip(column).for_each(|(d, l)| *d = reach * l);
        column[i] > 0.0
    }

    /// φ_i and e_i of `m` numbers from the ends of pair i; zero if the pair is missing.
    pub(super) fn keep(&mut self, i: usize, m: usize, reach: f64, is_there: bool) {
        let [plus, minus] = &self.ends;
        for k in 0..m {
            let (odd, even) = if is_there {
                ((plus[k] - minus[k]) / (2.0 * reach), 0.5 * (plus[k] + minus[k]))
            } else {
                (0.0, 0.0)
            };
            self.odd[i * self.lm + k] = odd;
            self.even[i * self.lm + k] = even;
        }
        for row in [&mut self.odd, &mut self.even] {
            row[i * self.lm + m..(i + 1) * self.lm].fill(0.0);
        }
    }

    /// μ from the even parts. Their contribution to the covariance goes into `spread`, m×m.
    pub(super) fn second_order(&mut self, m: usize, reach: f64, set: &SigmaSpread) {
        let (n, lm, w) = (self.n, self.lm, 1.0 / (2.0 * reach * reach));
        let mean = &mut self.mean[..lm];
        mean.fill(0.0);
        for even in self.even.chunks_exact(lm).take(n) {
            axpy(2.0 * w, even, mean);
        }
        let spread = &mut self.spread[..m * lm];
        spread.fill(0.0);
        self.kernel.outer(m, n, &self.even, 2.0 * w, spread);
        self.kernel.outer(m, 1, mean, set.beta - set.alpha * set.alpha, spread);
    }

    /// Carries odd parts, and the part of second order, by a map of their space.
    pub(super) fn carry(&mut self, by: &BlockMatrix) {
        let (n, ld) = (self.n, self.ld);
        let carried = |row: &mut [f64], delta: &mut [f64]| {
            by.apply(&row[..n], &mut delta[..n]);
            row[..n].copy_from_slice(&delta[..n]);
        };
        self.odd.chunks_exact_mut(ld).take(n).for_each(|row| carried(row, &mut self.delta));
        // E ← M E Mᵀ, rows and then columns of the symmetric E.
        for _ in 0..2 {
            self.spread
                .chunks_exact_mut(ld)
                .take(n)
                .for_each(|row| carried(row, &mut self.delta));
            for i in 0..n {
                for j in 0..i {
                    self.spread.swap(i * ld + j, j * ld + i);
                }
            }
        }
    }

    /// Φ as the regression, and the part of second order as noise.
    pub(super) fn explain(&mut self, transition: &mut Transition) {
        let n = self.n;
        for k in 0..n {
            let row = &mut self.ends[0];
            (0..n).for_each(|j| row[j] = transition.phi.get(k, j));
            let mut row = core::mem::take(row);
            self.regress(k, &mut row[..n]);
            transition.phi.set_row(k, &row[..n]);
            self.ends[0] = row;
        }
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            transition.after.element(i, j, self.spread[i * self.ld + j]);
        }
    }

    /// The covariance: odd parts, the part of second order, and `noise`, n×n, row by row; `None` if it is not sound.
    pub(super) fn covariance(&mut self, noise: impl Iterator<Item = (usize, usize, f64)>) -> Option<&[f64]> {
        let (n, ld) = (self.n, self.ld);
        let p = &mut self.whole[..n * ld];
        p.copy_from_slice(&self.spread[..n * ld]);
        self.kernel.outer(n, n, &self.odd, 1.0, p);
        for (i, j, q) in noise {
            p[i * ld + j] += q;
        }
        let is_sound = (0..n).all(|i| p[i * (ld + 1)].is_finite() && p[i * (ld + 1)] >= 0.0);
        is_sound.then(|| self.unpadded())
    }

    /// `whole` without its padding.
    pub(super) fn unpadded(&mut self) -> &[f64] {
        let (n, ld) = (self.n, self.ld);
        for i in 0..n {
            self.dense[i * n..(i + 1) * n].copy_from_slice(&self.whole[i * ld..i * ld + n]);
        }
        &self.dense[..n * n]
    }

    /// Solves y L = `odd` row-wise: writes row `k` of A L⁻¹ to `out`, A having the columns φ_i. Axes without points
    /// keep their values in `out`.
    pub(super) fn regress(&self, k: usize, out: &mut [f64]) {
        let n = self.n;
        for j in (0..n).rev() {
            let column = &self.factor[j * self.ld..j * self.ld + n];
            if column[j] > 0.0 {
                let known: f64 = out[j + 1..].iter().zip(&column[j + 1..]).map(|(y, l)| y * l).sum();
                out[j] = (self.odd[j * self.lm + k] - known) / column[j];
            }
        }
    }
}
