//! P whole: the Joseph and the standard form.
//!
//! P is stored whole, row by row, rows padded to a multiple of eight doubles, and kept exactly
//! symmetric. `fusion_kernels` does the arithmetic.
//!
//! With S = LLᵀ, U = L⁻¹HP and the optimal gain K = PHᵀS⁻¹ = UᵀL⁻ᵀ, P given the measurement is A = P − UᵀU.
//! If a measurement is much more accurate than the prediction, A is a small difference of two large
//! numbers, with rounding errors. The error E along the measurement can be computed: without it, C = AHᵀ − KR is
//! zero. (I − KH)E(I − KH)ᵀ = E − CKᵀ − KCᵀ + K(HC)Kᵀ removes the error, as Joseph's form does.

use super::form::LARGEST;
use super::{Form, Workspace};
use crate::linear::{BEFORE, BlockMatrix, Jacobian, Transition, padded};
use crate::math;
use alloc::vec::Vec;
use core::ops::Range;
use fusion_kernels::{Kernel, Lines, Product};

/// (I − KH)P(I − KH)ᵀ + KRKᵀ: positive for any gain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Joseph;

/// (I − KH)P, the textbook form: exact for the optimal gain only.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standard;

/// Working memory of the dense forms, sized once.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    product: Product,
    /// The elements of P before noise was added to them, before the transition.
    covered: Vec<f64>,
    /// The gain Kᵀ of one row.
    k: Lines,
    /// m×m.
    along: Vec<f64>,
    /// The largest factor by which the latest measurement has reduced the variance of its rows; infinite if
    /// it is not known.
    reduction: f64,
}

impl Scratch {
    /// Memory for a matrix of n padded rows, which nothing keeps.
    pub(super) fn matrix(&mut self) -> &mut [f64] {
        self.product.lend()
    }

    pub(super) fn new(n: usize, m: usize) -> Self {
        Self {
            product: Product::new(n),
            covered: Vec::with_capacity(BEFORE * n),
            k: Lines::zeros(padded(n)),
            along: vec![0.0; m * m],
            reduction: f64::INFINITY,
        }
    }
}

/// P as these forms see it.
struct Whole<'a> {
    n: usize,
    ld: usize,
    p: &'a mut [f64],
}

impl<'a> Whole<'a> {
    const fn new(n: usize, p: &'a mut [f64]) -> Self {
        Self { n, ld: padded(n), p }
    }

    fn set(&mut self, i: usize, j: usize, value: f64) {
        self.p[i * self.ld + j] = value;
        self.p[j * self.ld + i] = value;
    }

    /// P ← Φ(P + Q_before)Φᵀ + Q_after; false, and P as before, where a variance would overflow, be
    /// negative or not be a number.
    fn predict(&mut self, t: &Transition, w: &mut Scratch, kernel: Kernel) -> bool {
        let (ld, p) = (self.ld, &mut self.p[..self.n * self.ld]);
        w.covered.resize(t.before.entries.len(), 0.0);
        for (&(i, j, value), old) in t.before.entries.iter().zip(&mut w.covered) {
            let p = &mut p[i as usize * ld + j as usize];
            *old = *p;
            *p += value;
        }
        // Meanwhile these numbers reach the cache, from where the product reads whole lines.
        let is_noise = is_noise(&t.before.entries) & is_noise(&t.after.entries);
        let (phi, plan) = t.phi.transposed();
        kernel.product(plan, phi, p, &mut w.product);
        // The noise may lift a variance that rounding has made negative.
        let is_lifted = |i: u16| {
            let v = w.product.variance(plan, p, i.into());
            v.abs() < LARGEST && (v >= 0.0 || v + added(t, i) >= 0.0)
        };
        let is_sound = is_noise && (w.product.is_sound(plan, p, LARGEST) || t.phi.active().iter().all(|&i| is_lifted(i)));
        if !is_sound {
            // Last first: an element may have been covered twice.
            for (&(i, j, _), &old) in t.before.entries.iter().zip(&w.covered).rev() {
                self.p[i as usize * ld + j as usize] = old;
            }
            return false;
        }
        kernel.place(plan, &w.product, self.p);
        for &(i, j, value) in &t.after.entries {
            self.p[i as usize * ld + j as usize] += value;
        }
        true
    }

    /// P ← Φ P Φᵀ.
    fn congruence(&mut self, map: &BlockMatrix, w: &mut Scratch, kernel: Kernel) {
        let (phi, plan) = map.transposed();
        kernel.product(plan, phi, self.p, &mut w.product);
        kernel.place(plan, &w.product, self.p);
    }

    /// Conditions P on a measurement already projected, by the gain in `w`.
    fn condition(&mut self, joseph: bool, h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (m, kernel) = (h.rows(), w.kernel);
        let reduction = reduction(m, &w.s, r);
        if !w.take_optimal() {
            self.condition_by_any_gain(joseph, h, r, w);
        } else if joseph && reduction > ACCURATE {
            self.condition_accurately(h, r, w);
        } else {
            kernel.downdate(self.n, &w.u, m, self.p);
        }
        w.dense.reduction = reduction;
    }

    /// The same by the optimal gain, without the error that accurate measurements leave. Rows whose
    /// noises are independent are taken one by one: their gain does not suffer from an S that is nearly
    /// singular, as where several rows measure nearly the same.
    fn condition_accurately(&mut self, h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (n, ld, m, kernel) = (self.n, self.ld, h.rows(), w.kernel);
        // HP has been used: C takes its place.
        let Workspace { hp: c, u, kt, dense, .. } = w;
        if (0..m * m).any(|k| k / m != k % m && r[k] != 0.0) {
            kernel.downdate(n, u, m, self.p);
            return self.refine(0..m, h, r, (&kt[..m * ld], &mut c[..m * ld]), &mut dense.along, kernel);
        }
        let (c, u, k) = (&mut c[..ld], &mut u[..ld], &mut dense.k);
        for i in 0..m {
            let (row, r) = (&h.padded_rows()[i * ld..], r[i * m + i]);
            let mut s = [0.0];
            kernel.project(1, row, h.columns(), self.p, c, ld);
            kernel.inner(1, row, c, &mut s, ld);
            let s = s[0] + r;
            // Only rounding is left of S: the earlier rows give the same information without noise, so the gain
            // is rounding too. P is then set to NaN, and the estimator detects it.
            if s.is_nan() || s <= SINGULAR * w.s[i * m + i] {
                self.p[0] = f64::NAN;
                return;
            }
            kernel.gain(&[math::sqrt(s)], 1, c, u, k, ld);
            kernel.downdate(n, u, 1, self.p);
            self.refine(i..i + 1, h, &[r], (k, c), &mut dense.along, kernel);
        }
    }

    /// A ← (I − KH)A(I − KH)ᵀ for these rows of H, to the first order of what A is off by. `k` is their gain; `c` is
    /// memory for C, and `along` for m×m numbers.
    fn refine(&mut self, rows: Range<usize>, h: &Jacobian, r: &[f64], (k, c): (&[f64], &mut [f64]), along: &mut [f64], kernel: Kernel) {
        let (n, ld, m) = (self.n, self.ld, rows.len());
        kernel.project(m, &h.padded_rows()[rows.start * ld..], h.columns(), self.p, c, ld);
        kernel.subtract(r, m, k, c, ld);
        // D = C − ½K(HC), so that A − DKᵀ − KDᵀ has the term of second order too; HC is symmetric but for
        // rounding of what is itself rounding.
        let own = &h.padded_rows()[rows.start * ld..];
        kernel.inner(m, own, c, along, ld);
        along[..m * m].iter_mut().for_each(|v| *v *= 0.5);
        kernel.subtract(along, m, k, c, ld);
        kernel.refine(n, c, k, m, self.p);
    }

    /// The same update with the gain in `kt`, which may be any gain.
    fn condition_by_any_gain(&mut self, joseph: bool, h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (n, ld, m) = (self.n, self.ld, h.rows());
        let mut coefficients = core::mem::take(&mut w.dense.along);
        let (hp, kt) = (&w.hp, &w.kt);
        // A = P − K(HP)
        for i in 0..n {
            let row = &mut self.p[i * ld..(i + 1) * ld];
            for j in 0..m {
                axpy(-kt[j * ld + i], &hp[j * ld..(j + 1) * ld], row);
            }
        }
        if joseph {
            // P⁺ = A − (A Hᵀ − K R) Kᵀ
            for i in 0..n {
                let row = &mut self.p[i * ld..(i + 1) * ld];
                let coefficients = &mut coefficients[..m];
                for (j, c) in coefficients.iter_mut().enumerate() {
                    let noise: f64 = (0..m).map(|l| kt[l * ld + i] * r[l * m + j]).sum();
                    *c = along(h, j, row) - noise;
                }
                for (j, c) in coefficients.iter().enumerate() {
                    axpy(-c, &kt[j * ld..(j + 1) * ld], row);
                }
            }
        }
        w.dense.along = coefficients;
        self.symmetrise();
    }

    fn symmetrise(&mut self) {
        let ld = self.ld;
        for i in 0..self.n {
            for j in 0..i {
                let mean = 0.5 * (self.p[i * ld + j] + self.p[j * ld + i]);
                self.p[i * ld + j] = mean;
                self.p[j * ld + i] = mean;
            }
        }
    }
}

/// A measurement that reduces no variance by more than this leaves an error of 1e-16 of the variance before
/// it in A, 1e-15 of the one after it: no more than Joseph's form, so that it needs no refinement.
const ACCURATE: f64 = 10.0;

/// If no more than this share of a row's variance S is left, given the rows before it, the rest is rounding.
const SINGULAR: f64 = 4.0 * f64::EPSILON;

/// A measurement that reduces no variance by more than this factor leaves a rounding error of 1e-16 of the
/// variance before it. That is within the tolerance of the variance after it: P needs no trial.
const HARMLESS: f64 = 1e4;

/// The largest ratio of the variance S of a row to its noise R; infinite where R is not diagonal, as
/// combinations of rows may then be reduced by more.
fn reduction(m: usize, s: &[f64], r: &[f64]) -> f64 {
    let mut largest = 1.0_f64;
    for i in 0..m {
        let row = &r[i * m..(i + 1) * m];
        if row.iter().enumerate().any(|(j, r)| j != i && *r != 0.0) {
            return f64::INFINITY;
        }
        largest = largest.max(s[i * m + i] / row[i]);
    }
    largest
}

/// Returns true if no entry is too large or NaN, and no variance is negative; without branches.
fn is_noise(entries: &[(u16, u16, f64)]) -> bool {
    let mut all = true;
    for &(i, j, v) in entries {
        all &= (v.abs() < LARGEST) & ((i != j) | (v >= 0.0));
    }
    all
}

/// The noise that is added to variance `i` after the transition.
fn added(t: &Transition, i: u16) -> f64 {
    t.after.entries.iter().filter(|e| (e.0, e.1) == (i, i)).map(|e| e.2).sum()
}

/// H_i · x.
fn along(h: &Jacobian, i: usize, x: &[f64]) -> f64 {
    let (row, mut sum) = (h.row(i), 0.0);
    for &(start, end) in h.columns() {
        for (h, x) in row[start..end].iter().zip(&x[start..end]) {
            sum += h * x;
        }
    }
    sum
}

/// The number of the axes `i` and `j` that are in `axes`: 0, 1 or 2.
fn share(axes: &[Range<usize>], i: usize, j: usize) -> usize {
    let is_in = |k| usize::from(axes.iter().any(|a| a.contains(&k)));
    is_in(i) + is_in(j)
}

macro_rules! whole_form {
    ($form:ty, $name:literal, $joseph:literal) => {
        impl Form for $form {
            fn name(&self) -> &'static str {
                $name
            }
            fn storage(&self, n: usize) -> usize {
                n * padded(n)
            }
            fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64 {
                p[i * padded(n) + j]
            }
            fn whole<'p>(&self, p: &'p [f64]) -> Option<&'p [f64]> {
                Some(p)
            }
            fn is_sound(&self, n: usize, p: &[f64]) -> bool {
                // Without branches in between: they nearly always are.
                let variances = p.iter().step_by(padded(n) + 1).take(n);
                variances.fold(true, |all, v| all & (*v >= 0.0) & (*v < f64::INFINITY))
            }
            fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
                set_block(n, p, block, value);
            }
            fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
                scale(n, p, axes, factor);
            }
            fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
                Whole::new(n, p).predict(t, &mut w.dense, w.kernel)
            }
            fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
                Whole::new(n, p).congruence(j, &mut w.dense, w.kernel);
            }
            fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
                project(n, p, h, w);
            }
            fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
                Whole::new(n, p).condition($joseph, h, r, w);
            }
            fn is_positive(&self, n: usize, p: &[f64], w: &mut Workspace) -> bool {
                // The reduction by the next measurement is not known.
                let reduction = core::mem::replace(&mut w.dense.reduction, f64::INFINITY);
                self.is_sound(n, p) && (reduction <= HARMLESS || super::form::on_trial(self, n, p, w))
            }
        }
    };
}

whole_form!(Joseph, "joseph", true);
whole_form!(Standard, "standard", false);

fn set_block(n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
    let d = block.len();
    let mut p = Whole::new(n, p);
    for (k, i) in block.clone().enumerate() {
        (0..n).for_each(|j| p.set(i, j, 0.0));
        for (l, j) in block.clone().enumerate().take(k + 1) {
            p.set(i, j, value[k * d + l]);
        }
    }
}

fn scale(n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
    let (ld, root) = (padded(n), math::sqrt(factor));
    for (i, row) in p.chunks_exact_mut(ld).enumerate() {
        for (j, v) in row[..n].iter_mut().enumerate() {
            *v *= [1.0, root, factor][share(axes, i, j)];
        }
    }
}

/// HP and HPHᵀ.
fn project(n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
    let (m, ld) = (h.rows(), padded(n));
    w.forget_gain();
    w.kernel.project(m, h.padded_rows(), h.columns(), p, &mut w.hp, ld);
    w.kernel.inner(m, h.padded_rows(), &w.hp, &mut w.hph, ld);
}

/// y ← y + a x.
pub(crate) fn axpy(factor: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::{Covariance, FormKind};
    use crate::state::Quantity;
    use crate::testing::{Lcg, check_form, scalars};
    use alloc::sync::Arc;
    use nalgebra::{DMatrix, Matrix1};

    #[test]
    fn both_forms_obey_the_laws_at_every_padded_size() {
        for n in [1, 3, 8, 9, 15, 21, 31, 33, 40, 48, 49, 60] {
            for form in [Arc::new(Joseph) as Arc<dyn Form>, Arc::new(Standard)] {
                check_form(&form, n).unwrap();
            }
        }
    }

    #[test]
    fn josephs_form_takes_any_gain() {
        let (n, m) = (10, 2);
        let (layout, slots) = scalars(n).unwrap();
        let mut random = Lcg::new(4);
        let a = DMatrix::from_fn(n, n, |_, _| random.signed());
        let (p, r) = (&a * a.transpose(), DMatrix::from_row_slice(m, m, &[1.0, 0.3, 0.3, 2.0]));
        let (full, gain) = (
            DMatrix::from_fn(m, n, |_, _| random.signed()),
            DMatrix::from_fn(n, m, |_, _| random.signed()),
        );
        let (mut h, mut w) = (Jacobian::new(&layout, m), Workspace::new(&Joseph, n, m));
        h.reset(m);
        for (i, j) in (0..m * n).map(|k| (k / n, k % n)) {
            h.add(i, &Quantity::State(slots[j]), &Matrix1::new(full[(i, j)]));
        }
        let mut c = Covariance::zeros(n, FormKind::Joseph.form());
        c.set_whole(p.as_slice());
        c.project(&h, &mut w);
        let kt = w.kt_mut();
        (0..m * n).for_each(|k| kt[k % m * padded(n) + k / m] = gain[(k / m, k % m)]);
        c.condition(&h, r.as_slice(), &mut w);
        let keep = DMatrix::identity(n, n) - &gain * &full;
        let wanted = &keep * &p * keep.transpose() + &gain * r * gain.transpose();
        let off = (DMatrix::from_row_slice(n, n, &c.to_dense()) - &wanted).amax() / wanted.amax();
        // 1e-14: sums of ten products.
        assert!(off < 1e-14, "{off:e}");
    }
}
