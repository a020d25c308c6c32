//! P whole: the Joseph and the standard form.
//!
//! P is stored whole, row by row, rows padded to a multiple of eight doubles. It is kept exactly
//! symmetric: every kernel computes one triangle's meaning and writes both.
//!
//! The inner loops run along pieces of padded rows of a length known at compile time; the portable
//! code has no fused multiply-add, so that every machine gives the same bits.

use super::form::LARGEST;
use super::{Form, Workspace};
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use core::ops::Range;

/// (I − KH)P(I − KH)ᵀ + KRKᵀ: positive for any gain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Joseph;

/// (I − KH)P, the textbook form: exact for the optimal gain only.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standard;

/// One element of Φ that is not zero, with where the row that it multiplies starts in P and in Aᵀ.
#[derive(Clone, Copy, Debug, Default)]
struct Term {
    factor: f64,
    in_p: u32,
    in_at: u32,
}

/// Working memory of the kernels, sized once.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    pub(super) a: Vec<f64>,
    at: Vec<f64>,
    core: Vec<f64>,
    terms: Vec<Term>,
    /// Where each row's terms end.
    ends: Vec<usize>,
    /// What P held where noise was added before the transition.
    covered: Vec<f64>,
    coefficients: Vec<f64>,
    /// By what the latest measurement has reduced the variance of its rows at most; infinite where
    /// that is not known.
    reduction: f64,
}

impl Scratch {
    pub(super) fn new(n: usize, m: usize) -> Self {
        let ld = padded(n);
        Self {
            a: vec![0.0; n.next_multiple_of(2) * ld],
            at: vec![0.0; n * ld],
            core: vec![0.0; n * n.next_multiple_of(2)],
            terms: vec![Term::default(); n * n + 1],
            ends: vec![0; n],
            covered: Vec::with_capacity(n * n),
            coefficients: vec![0.0; m],
            reduction: f64::INFINITY,
        }
    }
}

/// P as these kernels see it.
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
    fn predict(&mut self, t: &Transition, w: &mut Scratch) -> bool {
        let ld = self.ld;
        w.covered.clear();
        for &(i, j, value) in &t.before.entries {
            let p = &mut self.p[i as usize * ld + j as usize];
            w.covered.push(*p);
            *p += value;
        }
        self.product(&t.phi, w);
        let m = t.phi.active().len();
        let moved = t.phi.active().iter().enumerate();
        let mut diagonal = moved.map(|(a, &i)| (i, w.core[a * m.next_multiple_of(2) + a]));
        let mut noise = t.before.entries.iter().chain(&t.after.entries);
        let is_sound = noise.all(|&(i, j, v)| v.abs() < LARGEST && (i != j || v >= 0.0))
            && diagonal.all(|(i, v)| v.abs() < LARGEST && (v >= 0.0 || v + added(t, i) >= 0.0));
        if !is_sound {
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
    fn congruence(&mut self, phi: &BlockMatrix, w: &mut Scratch) {
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
            combine(&w.terms[start..end], |t| t.in_p, self.p, 0, self.n.next_multiple_of(2), out);
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

    /// Conditions P on a measurement already projected: `w.hp`, and `w.kt` = Kᵀ.
    fn condition(&mut self, joseph: bool, h: &Jacobian, r: &[f64], w: &mut Workspace) {
        let (n, ld, m) = (self.n, self.ld, h.rows());
        // A = P − K(HP)
        for i in 0..n {
            let row = &mut self.p[i * ld..(i + 1) * ld];
            for j in 0..m {
                axpy(-w.kt[j * ld + i], &w.hp[j * ld..(j + 1) * ld], row);
            }
        }
        if joseph {
            // P⁺ = A − (A Hᵀ − K R) Kᵀ
            for i in 0..n {
                let row = &mut self.p[i * ld..(i + 1) * ld];
                let coefficients = &mut w.dense.coefficients[..m];
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
        w.dense.reduction = reduction(m, &w.s, r);
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

/// A measurement that reduces no variance by more leaves rounding, 1e-16 of the variance before it,
/// that is within what is tolerated of the variance after it: P needs no trial.
const HARMLESS: f64 = 1e4;

/// The largest ratio of the variance S of a row to its noise R; infinite where R is not diagonal, as
/// combinations of rows may then be reduced by more.
fn reduction(m: usize, s: &[f64], r: &[f64]) -> f64 {
    let ratio = |(i, j): (usize, usize)| match i == j {
        true => s[i * m + j] / r[i * m + j],
        false if r[i * m + j] == 0.0 => 1.0,
        false => f64::INFINITY,
    };
    (0..m * m).map(|k| ratio((k / m, k % m))).fold(1.0, f64::max)
}

/// The noise that is added to variance `i` after the transition.
fn added(t: &Transition, i: u16) -> f64 {
    t.after.entries.iter().filter(|e| (e.0, e.1) == (i, i)).map(|e| e.2).sum()
}

/// Whether both axes, one or none of them lie in `axes`.
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
            fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]) {
                set_block(n, p, block, value);
            }
            fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64) {
                scale(n, p, axes, factor);
            }
            fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool {
                Whole::new(n, p).predict(t, &mut w.dense)
            }
            fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace) {
                Whole::new(n, p).congruence(j, &mut w.dense);
            }
            fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
                project(n, p, h, w);
            }
            fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace) {
                Whole::new(n, p).condition($joseph, h, r, w);
            }
            fn is_positive(&self, n: usize, p: &[f64], w: &mut Workspace) -> bool {
                // What comes after this one is not known.
                let reduction = core::mem::replace(&mut w.dense.reduction, f64::INFINITY);
                reduction <= HARMLESS || super::form::on_trial(self, n, p, w)
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
    let (ld, root) = (padded(n), factor.sqrt());
    for (i, row) in p.chunks_exact_mut(ld).enumerate() {
        for (j, v) in row[..n].iter_mut().enumerate() {
            *v *= [1.0, root, factor][share(axes, i, j)];
        }
    }
}

/// HP and HPHᵀ.
fn project(n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace) {
    let (m, ld) = (h.rows(), padded(n));
    for i in 0..m {
        let out = &mut w.hp[i * ld..(i + 1) * ld];
        out.fill(0.0);
        let hi = h.row(i);
        for &(start, end) in h.columns() {
            for (k, &factor) in hi[start..end].iter().enumerate() {
                if factor != 0.0 {
                    let at = (start + k) * ld;
                    axpy(factor, &p[at..at + ld], out);
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

/// y ← y + a x.
pub(crate) fn axpy(factor: f64, x: &[f64], y: &mut [f64]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_form;
    use std::sync::Arc;

    #[test]
    fn both_forms_obey_the_laws_at_every_padded_size() {
        for n in [1, 3, 8, 9, 15, 21, 31, 33, 40, 48, 49, 60] {
            for form in [Arc::new(Joseph) as Arc<dyn Form>, Arc::new(Standard)] {
                check_form(&form, n).unwrap();
            }
        }
    }
}
