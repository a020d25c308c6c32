//! The forms and kernels against arithmetic of sixty digits.

use crate::covariance::{Covariance, FormKind, Kernel, Workspace, cholesky};
use crate::linear::{Jacobian, Transition, padded};
use crate::state::{Layout, Quantity, Scalar, Slot};
use crate::testing::{Lcg, scalars};
use dashu_float::{FBig, round::mode::HalfEven};
use nalgebra::{DMatrix, Matrix1};

/// A number of 200 bits, sixty digits.
type Big = FBig<HalfEven, 2>;

fn big(value: f64) -> Big {
    Big::try_from(value).unwrap().with_precision(200).value()
}

/// A symmetric matrix of them.
type Exact = Vec<Vec<Big>>;

/// P exactly as it is stored: whole, or Σ w c cᵀ over the columns of a factor.
fn stored(c: &Covariance, kind: FormKind) -> Exact {
    let (n, ld) = (c.dim(), padded(c.dim()));
    if matches!(kind, FormKind::Joseph | FormKind::Standard) {
        return (0..n).map(|i| (0..n).map(|j| big(c.p[i * ld + j])).collect()).collect();
    }
    let mut p = vec![vec![big(0.0); n]; n];
    for k in 0..n {
        let column: Vec<Big> = c.p[k * ld..k * ld + k + 1].iter().map(|v| big(*v)).collect();
        let mut weight = big(1.0);
        if kind == FormKind::Udu {
            weight = big(c.p[n * ld + k]);
        }
        for i in 0..=k {
            for j in 0..=k {
                p[i][j] = &p[i][j] + &weight * &column[i] * &column[j];
            }
        }
    }
    p
}

/// P given z = Hx with noise diag(r), by the textbook equations.
fn condition(p: &mut Exact, h: &DMatrix<f64>, r: &[f64]) {
    let n = p.len();
    for (row, r) in h.row_iter().zip(r) {
        let read: Vec<(usize, Big)> = (0..n).filter(|&k| row[k] != 0.0).map(|k| (k, big(row[k]))).collect();
        let along = |x: &dyn Fn(usize) -> Big| read.iter().fold(big(0.0), |sum, (k, h)| sum + h * x(*k));
        let hp: Vec<Big> = (0..n).map(|j| along(&|k| p[k][j].clone())).collect();
        let s = along(&|k| hp[k].clone()) + big(*r);
        for i in 0..n {
            let gain = &hp[i] / &s;
            for j in 0..n {
                p[i][j] = &p[i][j] - &gain * &hp[j];
            }
        }
    }
}

/// The largest error as a part of √(P_ii P_jj) of `wanted`.
fn apart(found: &Exact, wanted: &Exact) -> f64 {
    let sigma: Vec<f64> = (0..wanted.len()).map(|i| wanted[i][i].to_f64().value().sqrt()).collect();
    let error = |i: usize, j: usize| (&found[i][j] - &wanted[i][j]).to_f64().value().abs() / (sigma[i] * sigma[j]);
    let n = wanted.len();
    (0..n * n).map(|k| error(k / n, k % n)).fold(0.0, f64::max)
}

/// A position, velocity and attitude in metres and radians, and further states: correlated, of scales
/// as a filter has them.
fn prior(n: usize, random: &mut Lcg) -> DMatrix<f64> {
    let scale = [3.0, 3.0, 5.0, 0.3, 0.3, 0.3, 0.01, 0.01, 0.03];
    let a = DMatrix::from_fn(n, n, |i, _| scale.get(i).copied().unwrap_or(1e-3) * random.signed());
    &a * a.transpose()
}

/// Positions of two antennas that are 1 m apart: 6 rows, that differ by what attitude does.
fn antennas(n: usize, rows: usize) -> DMatrix<f64> {
    let mut h = DMatrix::zeros(rows, n);
    for i in 0..rows {
        h[(i, i % 3)] = 1.0;
        let arm = if i < 3 { [0.4, -0.2, -1.1] } else { [0.4, 0.8, -1.1] };
        h[(i, 6 + (i + 1) % 3)] = arm[(i + 2) % 3];
        h[(i, 6 + (i + 2) % 3)] = -arm[(i + 1) % 3];
    }
    h
}

struct Bench {
    layout: Layout,
    slots: Vec<Slot<Scalar>>,
    c: Covariance,
    w: Workspace,
}

impl Bench {
    fn new(kind: FormKind, kernel: Kernel, p: &DMatrix<f64>) -> Self {
        let n = p.nrows();
        let (layout, slots) = scalars(n).unwrap();
        let mut c = Covariance::zeros(n, kind.form());
        c.set_whole(p.as_slice());
        let mut w = Workspace::new(kind.form().as_ref(), n, 6);
        w.kernel = kernel;
        Self { layout, slots, c, w }
    }

    fn update(&mut self, h: &DMatrix<f64>, r: &[f64]) {
        let noise = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(r));
        self.update_correlated(h, noise.as_slice());
    }

    fn update_correlated(&mut self, h: &DMatrix<f64>, noise: &[f64]) {
        let m = h.nrows();
        let mut jacobian = Jacobian::new(&self.layout, m);
        jacobian.reset(m);
        for (i, k) in (0..m).flat_map(|i| (0..h.ncols()).map(move |k| (i, k))).filter(|at| h[*at] != 0.0) {
            jacobian.add(i, &Quantity::State(self.slots[k]), &Matrix1::new(h[(i, k)]));
        }
        self.c.project(&jacobian, &mut self.w);
        let w = &mut self.w;
        (0..m * m).for_each(|k| w.s[k] = w.hph[k] + noise[k]);
        assert!(cholesky(&w.s, &mut w.l, m));
        w.gain(m);
        self.c.condition(&jacobian, noise, w);
    }
}

/// Each form with each kernel.
fn cases() -> impl Iterator<Item = (FormKind, Kernel)> {
    let kinds = [FormKind::Joseph, FormKind::Udu, FormKind::SquareRoot];
    kinds.into_iter().flat_map(|kind| Kernel::here().map(move |kernel| (kind, kernel)))
}

/// The largest error over all `ratios` = HPHᵀ/R, for P of `n` states and this number of rows.
fn worst(kind: FormKind, kernel: Kernel, n: usize, h: &DMatrix<f64>, ratios: &[f64]) -> f64 {
    let p = prior(n, &mut Lcg::new((10 * n + h.nrows()) as u64));
    let hph = h * &p * h.transpose();
    let off = |ratio: &f64| {
        let r: Vec<f64> = (0..h.nrows()).map(|i| hph[(i, i)] / ratio).collect();
        let mut bench = Bench::new(kind, kernel, &p);
        let mut wanted = stored(&bench.c, kind);
        condition(&mut wanted, h, &r);
        bench.update(h, &r);
        apart(&stored(&bench.c, kind), &wanted)
    };
    ratios.iter().map(off).fold(0.0, f64::max)
}

#[test]
fn a_measurement_loses_no_digits_to_the_variance_that_it_takes_away() {
    // 1e-12: the error of Joseph's form by dense products. Without the refinement it is 1e-16 of the ratio.
    let ratios = [1.0, 9.0, 11.0, 1e4, 1e6, 1e8, 1e12, 1e16];
    for (n, rows) in [(15, 3), (21, 3), (33, 2), (9, 1)] {
        for (kind, kernel) in cases() {
            let off = worst(kind, kernel, n, &antennas(n, rows), &ratios);
            let most = if kind == FormKind::Joseph { 1e-14 } else { 1e-12 };
            assert!(off < most, "{kind:?} {} n = {n}, {rows} rows: {off:e}", kernel.name());
        }
    }
}

#[test]
fn two_antennas_that_measure_nearly_the_same_are_no_worse_for_a_whole_covariance_than_for_a_factor() {
    for (kind, kernel) in cases() {
        let off = worst(kind, kernel, 15, &antennas(15, 6), &[1.0, 1e2, 1e4, 1e6, 1e8]);
        // 3e-12: the measurements of the second see one part in 1e5 of the first's variance.
        assert!(off < 3e-12, "{kind:?} {}: {off:e}", kernel.name());
    }
}

#[test]
fn noise_that_is_correlated_is_refined_as_a_whole() {
    let (n, ratio) = (15, 1e8);
    let p = prior(n, &mut Lcg::new(8));
    // Two rows of noises r and 4r with a covariance of r are independent as z₀ and z₁ − z₀.
    let h = antennas(n, 2);
    let mut apart_rows = h.clone();
    apart_rows.set_row(1, &(h.row(1) - h.row(0)));
    let r = (&h * &p * h.transpose())[(0, 0)] / ratio;
    for kernel in Kernel::here() {
        let mut bench = Bench::new(FormKind::Joseph, kernel, &p);
        let mut wanted = stored(&bench.c, FormKind::Joseph);
        condition(&mut wanted, &apart_rows, &[r, 3.0 * r]);
        bench.update_correlated(&h, &[r, r, r, 4.0 * r]);
        let off = apart(&stored(&bench.c, FormKind::Joseph), &wanted);
        // 1e-12: as above.
        assert!(off < 1e-12, "{}: {off:e}", kernel.name());
    }
}

#[test]
fn a_prediction_is_exact_to_the_rounding_of_its_sums() {
    let n = 15;
    let mut random = Lcg::new(6);
    let p = prior(n, &mut random);
    let phi = DMatrix::from_fn(n, n, |i, j| match (i, j) {
        (i, j) if i == j => 1.0 + 1e-3 * random.signed(),
        (0..9, _) => 0.01 * random.signed(),
        _ => 0.0,
    });
    for (kind, kernel) in cases() {
        let mut bench = Bench::new(kind, kernel, &p);
        let before = stored(&bench.c, kind);
        let mut t = Transition::new(&bench.layout);
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)).filter(|at| phi[*at] != 0.0) {
            t.set(bench.slots[i], bench.slots[j], &Matrix1::new(phi[(i, j)]));
        }
        assert!(bench.c.predict(&t, &mut bench.w));
        let row = |i: usize| (0..n).map(|k| big(phi[(i, k)])).collect::<Vec<_>>();
        let of = |i: usize, j: usize| {
            let (a, b) = (row(i), row(j));
            let pairs = (0..n * n).map(|k| (k / n, k % n));
            pairs.fold(big(0.0), |sum, (k, l)| sum + &a[k] * &before[k][l] * &b[l])
        };
        let wanted: Exact = (0..n).map(|i| (0..n).map(|j| of(i, j)).collect()).collect();
        let off = apart(&stored(&bench.c, kind), &wanted);
        // 1e-15: a sum of fifteen terms, each to 1e-16.
        assert!(off < 1e-15, "{kind:?} {}: {off:e}", kernel.name());
    }
}
