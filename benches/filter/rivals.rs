//! The cost of the covariance alone by other methods.
//!
//! `dense`         every element, by `SMatrix` of nalgebra, and Joseph's form as three products
//! `block-sparse`  the blocks of three that Φ and H have, by `Matrix3` of nalgebra, P kept symmetric:
//!                 (I + D)P(I + D)ᵀ, and P − UᵀU with U = L⁻¹HP, which is not Joseph's
//! `faer`          every element of the prediction, by faer's product into matrices that are allocated already

use crate::kernel::{Composed, PATTERN, READ, block, noise, phi, start};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use nalgebra::{Matrix3, SMatrix};
use std::hint::black_box;

/// The problem on dense matrices of N states.
pub struct Dense<const N: usize> {
    start: SMatrix<f64, N, N>,
    phi: SMatrix<f64, N, N>,
    half: SMatrix<f64, N, N>,
    h: SMatrix<f64, 6, N>,
}

impl<const N: usize> Dense<N> {
    pub fn new() -> Self {
        let mut all = Self {
            start: SMatrix::from_fn(start),
            phi: SMatrix::identity(),
            half: SMatrix::zeros(),
            h: SMatrix::zeros(),
        };
        for (i, j) in PATTERN.into_iter().filter(|(i, j)| 3 * i.max(j) < N) {
            all.phi.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&phi(i, j));
        }
        for k in 1..3 {
            all.half.fixed_view_mut::<3, 3>(3 * k, 3 * k).copy_from(&(noise(k) * 0.5));
        }
        for (i, j) in READ {
            all.h.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&phi(i, j));
        }
        all
    }

    pub fn predict(&self, steps: usize) -> SMatrix<f64, N, N> {
        let mut p = self.start;
        for _ in 0..steps {
            p = black_box(self.phi) * (p + self.half) * self.phi.transpose() + self.half;
        }
        black_box(p)
    }

    /// By the first M rows of H.
    pub fn update<const M: usize>(&self, updates: usize) -> SMatrix<f64, N, N> {
        let (mut p, all) = (self.start, self.h.fixed_rows::<M>(0).into_owned());
        let r = SMatrix::<f64, M, M>::identity();
        for _ in 0..updates {
            let h = black_box(all);
            let hp = h * p;
            let s = hp * h.transpose() + r;
            let gain = s.cholesky().expect("positive").solve(&hp).transpose();
            let keep = SMatrix::<f64, N, N>::identity() - gain * h;
            p = keep * p * keep.transpose() + gain * r * gain.transpose();
        }
        black_box(p)
    }
}

/// The problem on B blocks of three.
pub struct Sparse<const B: usize> {
    start: [[Matrix3<f64>; B]; B],
    /// Φ − I, row by row.
    d: Vec<(usize, usize, Matrix3<f64>)>,
    half: [Matrix3<f64>; B],
    h: Vec<(usize, usize, Matrix3<f64>)>,
}

/// Rows of Φ that are not those of I.
const MOVED: usize = 3;

impl<const B: usize> Sparse<B> {
    pub fn new() -> Self {
        let own = |i, j| (i, j, block(i, j));
        Self {
            start: std::array::from_fn(|i| std::array::from_fn(|j| Matrix3::from_fn(|a, b| start(3 * i + a, 3 * j + b)))),
            d: PATTERN.into_iter().filter(|(i, j)| *i.max(j) < B).map(|(i, j)| own(i, j)).collect(),
            half: std::array::from_fn(|k| if k == 1 || k == 2 { noise(k) * 0.5 } else { Matrix3::zeros() }),
            h: READ.into_iter().map(|(i, j)| (i, j, phi(i, j))).collect(),
        }
    }

    pub fn predict(&self, steps: usize) -> [[Matrix3<f64>; B]; B] {
        let mut p = self.start;
        for _ in 0..steps {
            (1..MOVED).for_each(|k| p[k][k] += self.half[k]);
            let mut w: [[Matrix3<f64>; B]; MOVED] = std::array::from_fn(|i| p[i]);
            for (i, j, d) in black_box(&self.d) {
                for k in 0..B {
                    w[*i][k] += d * p[*j][k];
                }
            }
            let mut moved = w;
            for (k, j, d) in black_box(&self.d) {
                for i in 0..=*k {
                    moved[i][*k] += w[i][*j] * d.transpose();
                }
            }
            for i in 0..MOVED {
                for k in i..B {
                    p[i][k] = moved[i][k];
                    p[k][i] = moved[i][k].transpose();
                }
            }
            (1..MOVED).for_each(|k| p[k][k] += self.half[k]);
        }
        black_box(p)
    }

    /// By the first M rows of H.
    pub fn update<const M: usize>(&self, updates: usize) -> [[Matrix3<f64>; B]; B] {
        let mut p = self.start;
        for _ in 0..updates {
            let h = || black_box(&self.h).iter().filter(|(r, ..)| 3 * r < M);
            let mut hp = [SMatrix::<f64, M, 3>::zeros(); B];
            for (r, j, h) in h() {
                for k in 0..B {
                    let mut rows = hp[k].fixed_rows_mut::<3>(3 * r);
                    rows += h * p[*j][k];
                }
            }
            let mut s = SMatrix::<f64, M, M>::identity();
            for (r, j, h) in h() {
                let mut columns = s.fixed_columns_mut::<3>(3 * r);
                columns += hp[*j] * h.transpose();
            }
            let l = s.cholesky().expect("positive").unpack();
            hp.iter_mut().for_each(|u| assert!(l.solve_lower_triangular_mut(u)));
            for i in 0..B {
                for k in i..B {
                    p[i][k] -= hp[i].transpose() * hp[k];
                    p[k][i] = p[i][k].transpose();
                }
            }
        }
        black_box(p)
    }
}

/// The prediction by products of faer.
pub struct Faer {
    start: Mat<f64>,
    phi: Mat<f64>,
    half: Mat<f64>,
    p: Mat<f64>,
    moved: Mat<f64>,
}

impl Faer {
    pub fn new(n: usize) -> Self {
        let dense = Dense::<21>::new();
        let of = |m: &SMatrix<f64, 21, 21>| Mat::from_fn(n, n, |i, j| m[(i, j)]);
        let start = of(&dense.start);
        Self {
            phi: of(&dense.phi),
            half: of(&dense.half),
            p: start.clone(),
            moved: start.clone(),
            start,
        }
    }

    pub fn predict(&mut self, steps: usize) -> &Mat<f64> {
        self.p.copy_from(&self.start);
        for _ in 0..steps {
            let phi = black_box(&self.phi);
            self.p += &self.half;
            matmul(&mut self.moved, Accum::Replace, phi, &self.p, 1.0, Par::Seq);
            self.p.copy_from(&self.half);
            matmul(&mut self.p, Accum::Add, &self.moved, phi.transpose(), 1.0, Par::Seq);
        }
        black_box(&self.p)
    }
}

/// Every rival must give the result of the form, after a prediction and after an update.
pub fn agree<const N: usize, const B: usize, const M: usize>() {
    let mut own = Composed::new(B, M);
    let (dense, sparse) = (Dense::<N>::new(), Sparse::<B>::new());
    let apart = |own: &Composed, rival: &dyn Fn(usize, usize) -> f64| {
        let each = (0..N * N).map(|k| (own.form.element(N, &own.p, k / N, k % N) - rival(k / N, k % N)).abs());
        // 2e-14: sums of 21 products of numbers around one.
        assert!(each.fold(0.0, f64::max) < 2e-14, "n = {N}, m = {M}");
    };
    own.predict(1);
    let (p, blocks) = (dense.predict(1), sparse.predict(1));
    apart(&own, &|i, j| p[(i, j)]);
    apart(&own, &|i, j| blocks[i / 3][j / 3][(i % 3, j % 3)]);
    let mut faer = Faer::new(N);
    let p = faer.predict(1);
    apart(&own, &|i, j| p[(i, j)]);
    own.update(1);
    let (p, blocks) = (dense.update::<M>(1), sparse.update::<M>(1));
    apart(&own, &|i, j| p[(i, j)]);
    apart(&own, &|i, j| blocks[i / 3][j / 3][(i % 3, j % 3)]);
}
