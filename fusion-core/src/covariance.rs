//! The covariance and its kernels.
//!
//! P is stored whole, row by row, rows padded to a multiple of eight doubles. It is kept exactly
//! symmetric: every kernel computes one triangle's meaning and writes both.
//!
//! Letters: P covariance (n×n), Φ transition (n×n), Q process noise, H Jacobian (m×n),
//! S innovation covariance (m×m), K gain (n×m), R measurement noise (m×m).
//!
//! The inner loops run along pieces of padded rows of a length known at compile time; the portable
//! code has no fused multiply-add, so that every machine gives the same bits.

use crate::linear::{BlockMatrix, Jacobian, Transition, padded};

/// A symmetric covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    n: usize,
    ld: usize,
    p: Vec<f64>,
}

/// One element of Φ that is not zero, with where the row that it multiplies starts in P and in Aᵀ.
#[derive(Clone, Copy, Debug, Default)]
struct Term {
    factor: f64,
    in_p: u32,
    in_at: u32,
}

/// Variances beyond this have overflowed, or are about to.
const LARGEST: f64 = 1e300;

/// How an update keeps P positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Form {
    /// (I − KH)P(I − KH)ᵀ + KRKᵀ: positive for any gain.
    #[default]
    Joseph,
    /// (I − KH)P, the textbook form: exact for the optimal gain only.
    Standard,
}

/// Working memory of the kernels, sized once.
#[derive(Clone, Debug)]
pub struct Scratch {
    a: Vec<f64>,
    at: Vec<f64>,
    core: Vec<f64>,
    terms: Vec<Term>,
    /// Where each row's terms end.
    ends: Vec<usize>,
    /// What P held where noise was added before the transition.
    covered: Vec<f64>,
    coefficients: Vec<f64>,
    /// H P, m × ld.
    pub(crate) hp: Vec<f64>,
    /// H P Hᵀ, m × m.
    pub(crate) hph: Vec<f64>,
    /// S, m × m.
    pub(crate) s: Vec<f64>,
    /// Cholesky factor of S, lower, m × m.
    pub(crate) l: Vec<f64>,
    /// Kᵀ, m × ld.
    pub(crate) kt: Vec<f64>,
}

impl Scratch {
    /// Memory for `n` states and measurements of up to `m` rows.
    #[must_use]
    pub fn new(n: usize, m: usize) -> Self {
        let ld = padded(n);
        Self {
            a: vec![0.0; n.next_multiple_of(2) * ld],
            at: vec![0.0; n * ld],
            core: vec![0.0; n * n.next_multiple_of(2)],
            terms: vec![Term::default(); n * n + 1],
            ends: vec![0; n],
            covered: Vec::with_capacity(n * n),
            coefficients: vec![0.0; m],
            hp: vec![0.0; m * ld],
            hph: vec![0.0; m * m],
            s: vec![0.0; m * m],
            l: vec![0.0; m * m],
            kt: vec![0.0; m * ld],
        }
    }
}

impl Covariance {
    /// The zero covariance of dimension `n`.
    #[must_use]
    pub fn zeros(n: usize) -> Self {
        let ld = padded(n);
        Self {
            n,
            ld,
            p: vec![0.0; n * ld],
        }
    }

    /// Dimension.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.n
    }

    /// One element.
    #[must_use]
    pub fn get(&self, i: usize, j: usize) -> f64 {
        self.p[i * self.ld + j]
    }

    /// Standard deviation of tangent coordinate `i`; zero where rounding left a variance below it.
    #[must_use]
    pub fn sigma(&self, i: usize) -> f64 {
        self.get(i, i).max(0.0).sqrt()
    }

    /// Sets one element and its mirror.
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        self.p[i * self.ld + j] = value;
        self.p[j * self.ld + i] = value;
    }

    /// Takes the values of another of the same dimension, without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.p.copy_from_slice(&other.p);
    }

    /// Forgets what `range` knows of everything else and sets its variances: a reset block.
    pub fn reset_block(&mut self, range: core::ops::Range<usize>, sigma: &[f64]) {
        for (k, i) in range.enumerate() {
            for j in 0..self.n {
                self.set(i, j, 0.0);
            }
            self.set(i, i, sigma[k] * sigma[k]);
        }
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.p[i * self.ld..(i + 1) * self.ld]
    }

    /// P ← Φ(P + Q_before)Φᵀ + Q_after; false, and P as before, where a variance would overflow or
    /// not be a number.
    pub fn predict(&mut self, t: &Transition, w: &mut Scratch) -> bool {
        let ld = self.ld;
        w.covered.clear();
        for &(i, j, value) in &t.before.entries {
            let p = &mut self.p[i as usize * ld + j as usize];
            w.covered.push(*p);
            *p += value;
        }
        self.product(&t.phi, w);
        let m = t.phi.active().len();
        let diagonal = (0..m).map(|a| w.core[a * m.next_multiple_of(2) + a]);
        let noise = t.before.entries.iter().chain(&t.after.entries).map(|e| e.2);
        if !diagonal.chain(noise).all(|v| v.abs() < LARGEST) {
            // Last first: an element may have been covered twice.
            for (&(i, j, _), &old) in t.before.entries.iter().zip(&w.covered).rev() {
                self.p[i as usize * ld + j as usize] = old;
            }
            return false;
        }
        self.place(&t.phi, w);
        for &(i, j, value) in &t.after.entries {
            self.p[i as usize * ld + j as usize] += value;
        }
        true
    }

    /// P ← Φ P Φᵀ.
    pub fn congruence(&mut self, phi: &BlockMatrix, w: &mut Scratch) {
        self.product(phi, w);
        self.place(phi, w);
    }

    /// The active rows of A = ΦP into `w.a`, those of ΦPΦᵀ among themselves into `w.core`.
    ///
    /// Active are the rows in which Φ may differ from the identity. For an active row i and any
    /// other j, (ΦPΦᵀ)_ij = A_ij; for two others it is P_ij. So there is a second product, ΦAᵀ,
    /// among the active rows only, and one triangle of it is computed.
    fn product(&self, phi: &BlockMatrix, w: &mut Scratch) {
        let (ld, m) = (self.ld, phi.active().len());
        let width = m.next_multiple_of(2);
        if m == 0 {
            return;
        }
        let mut len = 0;
        for (elements, end) in phi.elements().zip(&mut w.ends) {
            for e in elements {
                let factor = phi.value(e);
                w.terms[len] = Term {
                    factor,
                    in_p: e.padded,
                    in_at: e.compact,
                };
                len += usize::from(factor != 0.0);
            }
            *end = len;
        }
        let mut start = 0;
        for (&end, out) in w.ends[..m].iter().zip(w.a.chunks_exact_mut(ld)) {
            combine(&w.terms[start..end], |t| t.in_p, &self.p, 0, self.n.next_multiple_of(2), out);
            start = end;
        }
        // Aᵀ, active rows as columns, as far as Φ reads it; in pairs, as they are read again at once.
        // The last row of an odd number has any other beside it: nothing reads that column.
        for (pair, rows) in w.a[..width * ld].chunks_exact(2 * ld).enumerate() {
            let (first, second) = rows.split_at(ld);
            for (&column, out) in phi.columns().iter().zip(w.at.chunks_exact_mut(width)) {
                out[2 * pair..2 * pair + 2].copy_from_slice(&[first[column as usize], second[column as usize]]);
            }
        }
        let mut start = 0;
        for (a, (&end, out)) in w.ends[..m].iter().zip(w.core.chunks_exact_mut(width)).enumerate() {
            combine(&w.terms[start..end], |t| t.in_at, &w.at, a / 2 * 2, width, out);
            start = end;
        }
    }

    /// Puts what [`Covariance::product`] made into rows and columns of P.
    fn place(&mut self, phi: &BlockMatrix, w: &Scratch) {
        let (ld, m) = (self.ld, phi.active().len());
        if m == 0 {
            return;
        }
        for (&i, row) in phi.active().iter().zip(w.a.chunks_exact(ld)) {
            let (out, _) = self.p[i as usize * ld..(i as usize + 1) * ld].as_chunks_mut::<8>();
            out.iter_mut().zip(row.as_chunks::<8>().0).for_each(|(out, row)| *out = *row);
        }
        for &j in phi.rest() {
            let out = &mut self.p[j as usize * ld..(j as usize + 1) * ld];
            let mut at = j as usize;
            for &i in phi.active() {
                out[i as usize] = w.a[at];
                at += ld;
            }
        }
        for (a, (&i, row)) in phi.active().iter().zip(w.core.chunks_exact(m.next_multiple_of(2))).enumerate() {
            let i = i as usize;
            for (&j, &value) in phi.active()[a..].iter().zip(&row[a..]) {
                let j = j as usize;
                self.p[i * ld + j] = value;
                self.p[j * ld + i] = value;
            }
        }
    }

    /// Fills `w.hp` with HP and `w.hph` with HPHᵀ.
    pub(crate) fn project(&self, h: &Jacobian, w: &mut Scratch) {
        let (m, ld) = (h.rows(), self.ld);
        for i in 0..m {
            let out = &mut w.hp[i * ld..(i + 1) * ld];
            out.fill(0.0);
            let hi = h.row(i);
            for &(start, end) in h.columns() {
                for (k, &factor) in hi[start..end].iter().enumerate() {
                    if factor != 0.0 {
                        axpy(factor, self.row(start + k), out);
                    }
                }
            }
        }
        for i in 0..m {
            for j in 0..=i {
                let hj = h.row(j);
                let hp = &w.hp[i * ld..(i + 1) * ld];
                let mut sum = 0.0;
                for &(start, end) in h.columns() {
                    for k in start..end {
                        sum += hp[k] * hj[k];
                    }
                }
                w.hph[i * m + j] = sum;
                w.hph[j * m + i] = sum;
            }
        }
    }

    /// Conditions P on a measurement already projected: `w.hp`, and `w.kt` = Kᵀ.
    pub(crate) fn update(&mut self, form: Form, h: &Jacobian, r: &[f64], w: &mut Scratch) {
        let (n, ld, m) = (self.n, self.ld, h.rows());
        // A = P − K(HP)
        for i in 0..n {
            let row = &mut self.p[i * ld..(i + 1) * ld];
            for j in 0..m {
                axpy(-w.kt[j * ld + i], &w.hp[j * ld..(j + 1) * ld], row);
            }
        }
        if form == Form::Joseph {
            // P⁺ = A − (A Hᵀ − K R) Kᵀ
            for i in 0..n {
                let row = &mut self.p[i * ld..(i + 1) * ld];
                let coefficients = &mut w.coefficients[..m];
                for (j, c) in coefficients.iter_mut().enumerate() {
                    let hj = h.row(j);
                    let mut sum = 0.0;
                    for &(start, end) in h.columns() {
                        for k in start..end {
                            sum += row[k] * hj[k];
                        }
                    }
                    for l in 0..m {
                        sum -= w.kt[l * ld + i] * r[l * m + j];
                    }
                    *c = sum;
                }
                for (j, c) in coefficients.iter().enumerate() {
                    axpy(-c, &w.kt[j * ld..(j + 1) * ld], row);
                }
            }
        }
        self.symmetrise();
    }

    /// P ← factor · P.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.p.iter_mut().for_each(|p| *p *= factor);
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

fn axpy(factor: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// out\[j\] = Σ factor · x[start + j] over `terms`, for j from `at` to `end`, an even number of them,
/// in pieces that fit the registers.
#[inline]
fn combine(terms: &[Term], start: impl Fn(&Term) -> u32 + Copy, x: &[f64], mut at: usize, end: usize, out: &mut [f64]) {
    while at < end {
        match end - at {
            2 => piece::<2>(terms, start, x, at, out),
            4 => piece::<4>(terms, start, x, at, out),
            6 => piece::<6>(terms, start, x, at, out),
            8 => piece::<8>(terms, start, x, at, out),
            10 => piece::<10>(terms, start, x, at, out),
            12 => piece::<12>(terms, start, x, at, out),
            14 => piece::<14>(terms, start, x, at, out),
            _ => piece::<16>(terms, start, x, at, out),
        }
        at += 16;
    }
}

#[inline]
fn piece<const W: usize>(terms: &[Term], start: impl Fn(&Term) -> u32, x: &[f64], at: usize, out: &mut [f64]) {
    let x = &x[at..];
    let mut sum = [0.0; W];
    for term in terms {
        let start = start(term) as usize;
        for (s, x) in sum.iter_mut().zip(&x[start..start + W]) {
            *s += term.factor * x;
        }
    }
    out[at..at + W].copy_from_slice(&sum);
}

/// Lower Cholesky factor of the symmetric m×m matrix `s` into `l`; false if it is not positive
/// definite.
pub(crate) fn cholesky(s: &[f64], l: &mut [f64], m: usize) -> bool {
    for i in 0..m {
        for j in 0..=i {
            let mut sum = s[i * m + j];
            for k in 0..j {
                sum -= l[i * m + k] * l[j * m + k];
            }
            if i == j {
                if !(sum > 0.0 && sum.is_finite()) {
                    return false;
                }
                l[i * m + i] = sum.sqrt();
            } else {
                l[i * m + j] = sum / l[j * m + j];
            }
        }
        l[i * m + i + 1..(i + 1) * m].fill(0.0);
    }
    true
}

/// Solves L y = b in place.
pub(crate) fn solve_lower(l: &[f64], b: &mut [f64], m: usize) {
    for i in 0..m {
        let mut sum = b[i];
        for k in 0..i {
            sum -= l[i * m + k] * b[k];
        }
        b[i] = sum / l[i * m + i];
    }
}

/// Solves (L Lᵀ) X = B in place for B of `m` rows of length `ld`.
pub(crate) fn solve_rows(l: &[f64], b: &mut [f64], m: usize, ld: usize) {
    for i in 0..m {
        let (done, rest) = b.split_at_mut(i * ld);
        let row = &mut rest[..ld];
        for k in 0..i {
            axpy(-l[i * m + k], &done[k * ld..(k + 1) * ld], row);
        }
        let inverse = 1.0 / l[i * m + i];
        row.iter_mut().for_each(|v| *v *= inverse);
    }
    for i in (0..m).rev() {
        let (head, tail) = b.split_at_mut((i + 1) * ld);
        let row = &mut head[i * ld..];
        for k in i + 1..m {
            axpy(-l[k * m + i], &tail[(k - i - 1) * ld..(k - i) * ld], row);
        }
        let inverse = 1.0 / l[i * m + i];
        row.iter_mut().for_each(|v| *v *= inverse);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Declaration, Dynamics, Layout, LayoutBuilder, Quantity, Scalar, Slot, StateRole};
    use crate::testing::Lcg;
    use nalgebra::{DMatrix, Matrix1};

    /// A layout of `n` scalars.
    fn layout(n: usize) -> (Layout, Vec<Slot<Scalar>>) {
        let mut b = LayoutBuilder::new();
        let slots = (0..n).map(|i| {
            let (name, owner) = (format!("x{i}"), String::new());
            b.declare::<Scalar>(Declaration {
                name,
                owner,
                unit: "",
                initial: 0.0,
                sigma: vec![1.0],
                role: StateRole::Calibration,
                dynamics: Dynamics::Constant,
            })
            .unwrap()
        });
        let slots = slots.collect();
        (b.finish(), slots)
    }

    fn dense(p: &Covariance) -> DMatrix<f64> {
        DMatrix::from_fn(p.dim(), p.dim(), |i, j| p.get(i, j))
    }

    /// A random positive covariance.
    fn random(n: usize, random: &mut Lcg) -> Covariance {
        let a = DMatrix::from_fn(n, n, |_, _| random.signed());
        let full = &a * a.transpose() + DMatrix::identity(n, n);
        let mut p = Covariance::zeros(n);
        (0..n).for_each(|i| (0..=i).for_each(|j| p.set(i, j, full[(i, j)])));
        p
    }

    fn close(a: &DMatrix<f64>, b: &DMatrix<f64>, tolerance: f64) {
        assert!((a - b).amax() <= tolerance * b.amax(), "{:e} of {:e}", (a - b).amax(), b.amax());
    }

    #[test]
    fn congruence_equals_the_dense_product_at_every_padded_size() {
        let mut r = Lcg::new(1);
        for n in [1, 3, 8, 9, 15, 21, 31, 33, 40, 48, 49, 60] {
            let (mut p, mut w, mut phi) = (random(n, &mut r), Scratch::new(n, 1), BlockMatrix::identity(n));
            // Twice, so that the learnt pattern is used again with other numbers.
            for _ in 0..2 {
                phi.reset();
                for k in 0..n {
                    phi.set_element((k * 7) % n, (k * 5 + 1) % n, r.signed());
                }
                let full = DMatrix::from_fn(n, n, |i, j| phi.get(i, j));
                let expected = &full * dense(&p) * full.transpose();
                p.congruence(&phi, &mut w);
                close(&dense(&p), &expected, 1e-13); // rounding of sums of up to 60 terms
                assert_eq!(dense(&p), dense(&p).transpose());
            }
        }
    }

    #[test]
    fn prediction_adds_noise_before_and_after_the_transition() {
        let (layout, slots) = layout(3);
        let (mut p, mut w, mut t) = (random(3, &mut Lcg::new(2)), Scratch::new(3, 1), Transition::new(&layout));
        let before = dense(&p);
        t.set(slots[0], slots[1], &Matrix1::new(0.5));
        t.noise(slots[0], slots[2], &Matrix1::new(0.1));
        t.noise_trapezoid(slots[1], slots[1], &Matrix1::new(0.4));
        assert!(p.predict(&t, &mut w));
        let mut phi = DMatrix::identity(3, 3);
        phi[(0, 1)] = 0.5;
        let mut half = DMatrix::zeros(3, 3);
        half[(1, 1)] = 0.2;
        let mut expected = &phi * (before + &half) * phi.transpose() + half;
        expected[(0, 2)] += 0.1;
        expected[(2, 0)] += 0.1;
        close(&dense(&p), &expected, 1e-15); // rounding
    }

    #[test]
    fn a_prediction_that_overflows_leaves_the_covariance_as_it_was() {
        let (layout, slots) = layout(3);
        for (element, noise) in [(1e160, 0.0), (f64::NAN, 0.0), (0.5, f64::INFINITY)] {
            let (mut p, mut w, mut t) = (random(3, &mut Lcg::new(4)), Scratch::new(3, 1), Transition::new(&layout));
            let before = p.clone();
            t.set(slots[0], slots[1], &Matrix1::new(element));
            // Twice the same element: what it held first must come back.
            t.noise_trapezoid(slots[1], slots[1], &Matrix1::new(0.4));
            t.noise_trapezoid(slots[1], slots[1], &Matrix1::new(1.0 / 3.0));
            t.noise(slots[2], slots[2], &Matrix1::new(noise));
            assert!(!p.predict(&t, &mut w));
            assert_eq!(p, before);
        }
    }

    /// Updates P by `rows` random measurements in `form`; also what dense algebra makes of it.
    fn updated(n: usize, m: usize, form: Form) -> (DMatrix<f64>, DMatrix<f64>) {
        let (layout, slots) = layout(n);
        let mut r = Lcg::new((n * 10 + m) as u64);
        let (mut p, mut w, mut h) = (random(n, &mut r), Scratch::new(n, m), Jacobian::new(&layout, m));
        let noise = random(m, &mut r);
        h.reset(m);
        for (i, slot) in (0..m).flat_map(|i| slots.iter().map(move |s| (i, s))) {
            if r.signed() > 0.0 {
                h.add(i, &Quantity::State(*slot), &Matrix1::new(r.signed()));
            }
        }
        let noise: Vec<f64> = (0..m * m).map(|k| noise.get(k / m, k % m)).collect();
        p.project(&h, &mut w);
        w.s = w.hph.iter().zip(&noise).map(|(p, r)| p + r).collect();
        assert!(cholesky(&w.s, &mut w.l, m));
        w.kt.copy_from_slice(&w.hp);
        solve_rows(&w.l, &mut w.kt, m, padded(n));
        let (before, full) = (dense(&p), DMatrix::from_fn(m, n, |i, j| h.get(i, j)));
        let s = &full * &before * full.transpose() + DMatrix::from_row_slice(m, m, &noise);
        let gain = &before * full.transpose() * s.try_inverse().unwrap();
        p.update(form, &h, &noise, &mut w);
        (dense(&p), (DMatrix::identity(n, n) - gain * full) * before)
    }

    #[test]
    fn both_forms_of_the_update_equal_the_dense_reference() {
        for (n, m) in [(1, 1), (6, 3), (15, 6), (21, 2), (50, 4)] {
            for form in [Form::Joseph, Form::Standard] {
                let (p, reference) = updated(n, m, form);
                close(&p, &reference, 1e-12); // an inverse of condition about 100
                assert_eq!(p, p.transpose());
            }
        }
    }

    #[test]
    fn cholesky_refuses_what_is_not_positive() {
        let mut l = [0.0; 4];
        assert!(cholesky(&[4.0, 2.0, 2.0, 3.0], &mut l, 2));
        assert_eq!(l, [2.0, 0.0, 1.0, 2_f64.sqrt()]);
        for bad in [
            [1.0, 1.0, 1.0, 1.0],
            [1.0, 2.0, 2.0, 1.0],
            [f64::NAN, 0.0, 0.0, 1.0],
            [f64::INFINITY, 0.0, 0.0, 1.0],
        ] {
            assert!(!cholesky(&bad, &mut l, 2), "{bad:?}");
        }
    }
}
