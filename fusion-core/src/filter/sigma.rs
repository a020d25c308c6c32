//! Sigma points: the belief as a set of states, moved through a function as they are.
//!
//! Set        x̂ and x̂ ⊞ (±γ L_i), P = L Lᵀ, γ = α√(n + κ), ⊞ and ⊟ those of the chart
//! Weights    w = 1/(2γ²) of each pair's points; of the mean 1 − n/γ² for x̂, of the covariance
//!            1 − α² + β more
//! Read as    odd part φ_i = (y_i⁺ − y_i⁻)/2γ and even part e_i = (y_i⁺ + y_i⁻)/2 of what the points
//!            become, seen from what x̂ becomes:
//!            mean μ = 2w Σ e_i, covariance Σ φ_i φ_iᵀ + 2w Σ e_i e_iᵀ + (β − α²) μ μᵀ
//!            The same numbers as the usual sums of weights, of which one is large and negative for a
//!            small α; and the covariance is seen to be positive for β ≥ α²
//! Source     Julier and Uhlmann 2004; scaled set: Julier 2002; on manifolds: Brossard, Barrau,
//!            Bonnabel 2019 (arXiv 2002.00878)

use crate::covariance::Covariance;
use crate::linear::{BlockMatrix, Transition};

/// How the sigma points are spread: the scaled set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// α: the points lie α√(n + κ) σ from the estimate.
    pub alpha: f64,
    /// β: 2 is best for a Gaussian; at least α², so that no variance can become negative.
    pub beta: f64,
    /// κ.
    pub kappa: f64,
}

impl Spread {
    /// α = 1, β = 2, κ = 0: the points lie √n σ away, no weight is negative.
    pub const DEFAULT: Self = Self {
        alpha: 1.0,
        beta: 2.0,
        kappa: 0.0,
    };

    /// γ over n dimensions.
    #[must_use]
    pub fn reach(&self, n: usize) -> f64 {
        self.alpha * (n as f64 + self.kappa).sqrt()
    }
}

impl Default for Spread {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Memory of a rule that draws sigma points; sized when they are first drawn.
#[derive(Clone, Debug, Default)]
pub struct SigmaPoints {
    pub(super) n: usize,
    /// L, lower, n×n, row by row.
    pub(super) factor: Vec<f64>,
    /// A correction to a point; what becomes of the points of a pair.
    pub(super) delta: Vec<f64>,
    pub(super) ends: [Vec<f64>; 2],
    /// φ_i and e_i, row after row.
    pub(super) odd: Vec<f64>,
    pub(super) even: Vec<f64>,
    /// μ.
    pub(super) mean: Vec<f64>,
    /// A covariance, row by row, or the noise of second order.
    pub(super) spread: Vec<f64>,
    /// A state, and what x̂ becomes.
    pub(super) x: Vec<f64>,
    pub(super) centre: Vec<f64>,
}

impl SigmaPoints {
    /// Room for functions of `m` numbers over `n` dimensions and states of `storage` numbers.
    pub(super) fn prepare(&mut self, n: usize, m: usize, storage: usize) {
        self.n = n;
        let fit = |v: &mut Vec<f64>, length: usize| {
            if v.len() < length {
                v.resize(length, 0.0);
            }
        };
        fit(&mut self.factor, n * n);
        fit(&mut self.delta, n.max(m));
        fit(&mut self.ends[0], n.max(m));
        fit(&mut self.ends[1], n.max(m));
        fit(&mut self.odd, n * n.max(m));
        fit(&mut self.even, n * n.max(m));
        fit(&mut self.mean, n.max(m));
        fit(&mut self.spread, n.max(m) * n.max(m));
        self.x.resize(storage, 0.0);
        self.centre.resize(storage, 0.0);
    }

    /// L of P and what is added to it; the axis of a variance that is zero, up to rounding, has no points.
    pub(super) fn take(&mut self, covariance: &Covariance, added: impl Iterator<Item = (usize, usize, f64)>) {
        let n = self.n;
        let p = &mut self.spread[..n * n];
        covariance.write_dense(p);
        added.for_each(|(i, j, q)| p[i * n + j] += q);
        let l = &mut self.factor[..n * n];
        for j in 0..n {
            let own: f64 = l[j * n..j * n + j].iter().map(|v| v * v).sum();
            let pivot = p[j * n + j] - own;
            // 1e-14: what rounding leaves of a variance that others explain.
            let root = if pivot > 1e-14 * p[j * n + j] { pivot.sqrt() } else { 0.0 };
            l[j * n + j] = root;
            l[j * n + j + 1..(j + 1) * n].fill(0.0);
            for i in j + 1..n {
                let (above, row) = l.split_at_mut(i * n);
                let along: f64 = row[..j].iter().zip(&above[j * n..j * n + j]).map(|(a, b)| a * b).sum();
                row[j] = if root > 0.0 { (p[i * n + j] - along) / root } else { 0.0 };
            }
        }
    }

    /// `delta` ← `reach` L_i; false where it is zero.
    pub(super) fn point(&mut self, i: usize, reach: f64) -> bool {
        let n = self.n;
        for k in 0..n {
            self.delta[k] = reach * self.factor[k * n + i];
        }
        self.factor[i * n + i] > 0.0
    }

    /// φ_i and e_i of `m` numbers from the ends of pair i; zero for a pair that is not there.
    pub(super) fn keep(&mut self, i: usize, m: usize, reach: f64, is_there: bool) {
        let [plus, minus] = &self.ends;
        for k in 0..m {
            let (odd, even) = if is_there {
                ((plus[k] - minus[k]) / (2.0 * reach), 0.5 * (plus[k] + minus[k]))
            } else {
                (0.0, 0.0)
            };
            self.odd[i * m + k] = odd;
            self.even[i * m + k] = even;
        }
    }

    /// μ from the even parts, and what they add to the covariance into `spread`, m×m.
    pub(super) fn second_order(&mut self, m: usize, reach: f64, set: &Spread) {
        let (n, w) = (self.n, 1.0 / (2.0 * reach * reach));
        self.mean[..m].fill(0.0);
        for even in self.even[..n * m].chunks_exact(m) {
            self.mean.iter_mut().zip(even).for_each(|(mean, e)| *mean += 2.0 * w * e);
        }
        for a in 0..m {
            for b in 0..=a {
                let pairs = self.even[..n * m].chunks_exact(m);
                let sum: f64 = pairs.map(|e| e[a] * e[b]).sum();
                let value = 2.0 * w * sum + (set.beta - set.alpha * set.alpha) * self.mean[a] * self.mean[b];
                self.spread[a * m + b] = value;
                self.spread[b * m + a] = value;
            }
        }
    }

    /// Carries odd parts, and what is of second order, by a map of their space.
    pub(super) fn carry(&mut self, by: &BlockMatrix) {
        let n = self.n;
        for i in 0..n {
            by.apply(&self.odd[i * n..(i + 1) * n], &mut self.delta[..n]);
            self.odd[i * n..(i + 1) * n].copy_from_slice(&self.delta[..n]);
        }
        // E ← M E Mᵀ, rows and then columns of the symmetric E.
        for _ in 0..2 {
            for i in 0..n {
                by.apply(&self.spread[i * n..(i + 1) * n], &mut self.delta[..n]);
                self.spread[i * n..(i + 1) * n].copy_from_slice(&self.delta[..n]);
            }
            for i in 0..n {
                for j in 0..i {
                    self.spread.swap(i * n + j, j * n + i);
                }
            }
        }
    }

    /// Φ as the regression, and what is of second order as noise.
    pub(super) fn explain(&mut self, transition: &mut Transition) {
        let n = self.n;
        for k in 0..n {
            let row = &mut self.ends[0];
            (0..n).for_each(|j| row[j] = transition.phi.get(k, j));
            let mut row = core::mem::take(row);
            self.regress(k, n, &mut row[..n]);
            transition.phi.set_row(k, &row[..n]);
            self.ends[0] = row;
        }
        for (k, value) in self.spread[..n * n].iter().enumerate() {
            transition.after.element(k / n, k % n, *value);
        }
    }

    /// The covariance: odd parts, what is of second order, and `noise`, n×n, row by row; `None` where it
    /// is not sound. It takes the room of the even parts.
    pub(super) fn covariance(&mut self, noise: impl Iterator<Item = (usize, usize, f64)>) -> Option<&[f64]> {
        let n = self.n;
        let p = &mut self.even[..n * n];
        for a in 0..n {
            for b in 0..=a {
                let sum: f64 = self.odd[..n * n].chunks_exact(n).map(|odd| odd[a] * odd[b]).sum();
                let value = self.spread[a * n + b] + sum;
                p[a * n + b] = value;
                p[b * n + a] = value;
            }
        }
        for (i, j, q) in noise {
            p[i * n + j] += q;
        }
        let is_sound = (0..n).all(|i| p[i * n + i].is_finite() && p[i * n + i] >= 0.0);
        is_sound.then_some(p)
    }

    /// Solves y L = `odd` row-wise: the matrix A L⁻¹ of the columns φ_i, its row `k` into `out`; axes
    /// without points keep what `out` has there.
    pub(super) fn regress(&self, k: usize, m: usize, out: &mut [f64]) {
        let n = self.n;
        for j in (0..n).rev() {
            let root = self.factor[j * n + j];
            if root > 0.0 {
                let known: f64 = (j + 1..n).map(|i| out[i] * self.factor[i * n + j]).sum();
                out[j] = (self.odd[j * m + k] - known) / root;
            }
        }
    }
}
