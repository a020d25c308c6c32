//! P as its lower triangle, row by row: half the memory of the whole matrix.
//!
//! Every operation unpacks P, works on dense matrices and packs the lower triangle again. The update
//! is the Joseph form, (I − KH)P(I − KH)ᵀ + KRKᵀ.

use core::ops::Range;
use fusion::core::covariance::{Form, Workspace};
use fusion::core::linear::{BlockMatrix, Jacobian, Transition};
use nalgebra::DMatrix;

/// The lower triangle of P: n(n + 1)/2 numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Packed;

/// Where P_ij lies.
const fn at(i: usize, j: usize) -> usize {
    let (row, column) = if i > j { (i, j) } else { (j, i) };
    row * (row + 1) / 2 + column
}

fn unpack(n: usize, p: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| p[at(i, j)])
}

fn pack(p: &mut [f64], full: &DMatrix<f64>) {
    for i in 0..full.nrows() {
        (0..=i).for_each(|j| p[at(i, j)] = full[(i, j)]);
    }
}

fn dense(map: &BlockMatrix) -> DMatrix<f64> {
    DMatrix::from_fn(map.dim(), map.dim(), |i, j| map.get(i, j))
}

fn noise(n: usize, elements: impl Iterator<Item = (usize, usize, f64)>) -> DMatrix<f64> {
    let mut q = DMatrix::zeros(n, n);
    elements.for_each(|(i, j, value)| q[(i, j)] += value);
    q
}

impl Form for Packed {
    fn name(&self) -> &'static str {
        "packed"
    }

    fn storage(&self, n: usize) -> usize {
        n * (n + 1) / 2
    }

    fn element(&self, _: usize, p: &[f64], i: usize, j: usize) -> f64 {
        p[at(i, j)]
    }

    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
        let d = block.len();
        for i in block.clone() {
            for j in 0..n {
                let inside = block.contains(&j);
                p[at(i, j)] = if inside {
                    value[(i - block.start) * d + j - block.start]
                } else {
                    0.0
                };
            }
        }
    }

    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
        let root = |i: usize| if axes.iter().any(|a| a.contains(&i)) { factor.sqrt() } else { 1.0 };
        for i in 0..n {
            (0..=i).for_each(|j| p[at(i, j)] *= root(i) * root(j));
        }
    }

    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, _: &mut Workspace) -> bool {
        let phi = dense(&t.phi);
        let after = &phi * (unpack(n, p) + noise(n, t.noise_before())) * phi.transpose() + noise(n, t.noise_after());
        let diagonal = |q: DMatrix<f64>| q.diagonal().iter().all(|v| *v >= 0.0);
        // 1e300: about to overflow.
        let is_sound = after.iter().all(|v| v.abs() < 1e300)
            && [noise(n, t.noise_before()), noise(n, t.noise_after()), after.clone()]
                .into_iter()
                .all(diagonal);
        if is_sound {
            pack(p, &after);
        }
        is_sound
    }

    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, _: &mut Workspace) {
        let j = dense(j);
        pack(p, &(&j * unpack(n, p) * j.transpose()));
    }

    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
        let m = h.rows();
        let full = DMatrix::from_fn(m, n, |i, j| h.get(i, j));
        let hp = &full * unpack(n, p);
        let hph = &hp * full.transpose();
        for i in 0..m {
            (0..n).for_each(|j| w.hp[i * w.ld + j] = hp[(i, j)]);
            (0..m).for_each(|j| w.hph[i * m + j] = hph[(i, j)]);
        }
    }

    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let m = h.rows();
        let gain = DMatrix::from_fn(n, m, |i, j| w.kt()[j * w.ld + i]);
        let keep = DMatrix::identity(n, n) - &gain * DMatrix::from_fn(m, n, |i, j| h.get(i, j));
        let r = DMatrix::from_row_slice(m, m, r);
        pack(p, &(&keep * unpack(n, p) * keep.transpose() + &gain * r * gain.transpose()));
    }
}
