//! The adjoint: the information in later data.

use super::link::Link;
use super::record::Kept;
use crate::belief::Belief;
use crate::chart::{Chart, Reset};
use crate::covariance::axpy;
use crate::filter::Parts;
use crate::linear::{BlockMatrix, padded};
use crate::math;
use crate::memory::{Memory, Tape};
use crate::state::Layout;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// λ and Λ at an instant, and the memory to move them.
#[derive(Clone, Debug)]
pub(super) struct Adjoint {
    n: usize,
    /// Row length of a matrix.
    ld: usize,
    pub(super) vector: Vec<f64>,
    pub(super) matrix: Vec<f64>,
    /// Whether there are no later data.
    is_zero: bool,
    moved: Vec<f64>,
    turned: Vec<f64>,
    room: Vec<f64>,
}

impl Memory for Adjoint {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(&mut self.vector);
        tape.numbers(&mut self.matrix);
        self.is_zero.remember(tape);
    }
}

impl Adjoint {
    /// The adjoint at the end of the data, in `n` dimensions.
    pub(super) fn new(n: usize) -> Self {
        let ld = padded(n);
        Self {
            n,
            ld,
            vector: vec![0.0; n],
            matrix: vec![0.0; n * ld],
            is_zero: true,
            moved: vec![0.0; n * ld],
            turned: vec![0.0; n * ld],
            room: Vec::new(),
        }
    }

    /// Resets it to the adjoint at the end of the data.
    pub(super) fn forget(&mut self) {
        self.vector.fill(0.0);
        self.matrix.fill(0.0);
        self.is_zero = true;
    }

    /// Moves it to before `link`.
    pub(super) fn back(&mut self, link: &Link) {
        let ld = self.ld;
        if !self.is_zero {
            self.room.resize(link.rows() * ld, 0.0);
            link.pull(&self.vector, &mut self.moved[..self.n], &mut self.room, 1);
            self.vector.copy_from_slice(&self.moved[..self.n]);
            // MᵀΛ, and Mᵀ(MᵀΛ)ᵀ = MᵀΛM.
            link.pull(&self.matrix, &mut self.moved, &mut self.room, ld);
            transpose(&self.moved, &mut self.turned, self.n, ld);
            link.pull(&self.turned, &mut self.matrix, &mut self.room, ld);
            symmetrise(&mut self.matrix, self.n, ld);
        }
        for (h, r) in link.learnt() {
            self.is_zero = false;
            axpy(-r, h, &mut self.vector);
            for (i, factor) in h.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                axpy(*factor, h, &mut self.matrix[i * ld..i * ld + self.n]);
            }
        }
    }

    /// Adds what comes after the end of a stretch of the log: `later` there, carried over it by
    /// `transposed` = Mᵀ of the whole stretch.
    pub(super) fn add(&mut self, transposed: &[f64], later: &Self) {
        if later.is_zero {
            return;
        }
        self.is_zero = false;
        let (n, ld) = (self.n, self.ld);
        for (i, row) in transposed.chunks_exact(ld).enumerate() {
            self.vector[i] += dot(&row[..n], &later.vector);
        }
        multiply(transposed, &later.matrix, &mut self.moved, n, ld);
        transpose(&self.moved, &mut self.turned, n, ld);
        // Mᵀ(MᵀΛ)ᵀ.
        multiply(transposed, &self.turned, &mut self.moved, n, ld);
        self.matrix.iter_mut().zip(&self.moved).for_each(|(a, b)| *a += b);
        symmetrise(&mut self.matrix, n, ld);
    }

    /// Adds the information in `link`; `head` = M carries errors to the beginning of `link`.
    pub(super) fn add_at_end(&mut self, head: &[f64], link: &Link) {
        let (n, ld) = (self.n, self.ld);
        for (h, r) in link.learnt() {
            self.is_zero = false;
            // Mᵀh.
            let row = &mut self.moved[..ld];
            row.fill(0.0);
            for (i, factor) in h.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                axpy(*factor, &head[i * ld..(i + 1) * ld], row);
            }
            axpy(-r, &row[..n], &mut self.vector);
            for i in 0..n {
                axpy(row[i], &row[..n], &mut self.matrix[i * ld..i * ld + n]);
            }
        }
    }
}

/// Corrects a filter's belief at an instant with the adjoint of later data.
#[derive(Clone, Debug)]
pub(super) struct Corrector {
    layout: Arc<Layout>,
    chart: Arc<dyn Chart>,
    /// The state that the filter started from, where its chart may be anchored.
    started: Vec<f64>,
    how: Reset,
    reset: BlockMatrix,
    correction: Vec<f64>,
    p: Vec<f64>,
    product: Vec<f64>,
    less: Vec<f64>,
    whole: Vec<f64>,
    /// The largest correction of a state by the latest call, in its σ afterwards.
    pub(super) change: f64,
}

/// The rounding of P − PΛP, as a part of P.
const ROUNDING: f64 = 1e-14;

impl Memory for Corrector {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.started.remember(tape);
        let is_whole = self.started.len() == self.layout.storage();
        if !self.started.is_empty() && !is_whole {
            tape.refuse("a state has another size");
        } else if tape.is_reading() && is_whole && tape.is_sound() {
            self.anchor();
        }
    }
}

impl Corrector {
    /// For a filter with these parts.
    pub(super) fn new(layout: Arc<Layout>, parts: &Parts) -> Self {
        let n = layout.dim();
        let ld = padded(n);
        Self {
            reset: BlockMatrix::identity(n),
            correction: vec![0.0; n],
            p: vec![0.0; n * ld],
            product: vec![0.0; n * ld],
            less: vec![0.0; n * ld],
            whole: vec![0.0; n * n],
            change: 0.0,
            layout,
            chart: parts.chart.clone(),
            started: Vec::new(),
            how: parts.reset(),
        }
    }

    /// The filter starts from `belief`, which may be where its chart is anchored.
    pub(super) fn start(&mut self, belief: &Belief) {
        self.started.clone_from(&belief.x);
        self.anchor();
    }

    fn anchor(&mut self) {
        if let Some(chart) = self.chart.anchored(&self.layout, &self.started) {
            self.chart = chart;
        }
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The estimate `kept` given the data that `later` sums up, into `out`.
    pub(super) fn correct(&mut self, kept: &Kept, later: &Adjoint, out: &mut Belief) {
        self.correct_about(kept, (&[], None), later, out);
    }

    /// The same if the mean of the error about `kept` is `mean`, empty for zero, or if its smoothed error is `known`.
    pub(super) fn correct_about(&mut self, kept: &Kept, (mean, known): (&[f64], Option<&[f64]>), later: &Adjoint, out: &mut Belief) {
        let (n, ld) = (later.n, later.ld);
        out.time = kept.time;
        out.x.clone_from(&kept.x);
        out.input.clone_from(&kept.input);
        let mut lower = kept.p.iter();
        for i in 0..n {
            for (j, &value) in lower.by_ref().take(i + 1).enumerate() {
                self.p[i * ld + j] = value;
                self.p[j * ld + i] = value;
            }
        }
        if later.is_zero && mean.is_empty() {
            pack(&self.p, &mut self.whole, n, ld);
            out.covariance.set_whole(&self.whole);
            return;
        }
        for (i, d) in self.correction.iter_mut().enumerate() {
            *d = mean.get(i).copied().unwrap_or(0.0) - dot(&self.p[i * ld..i * ld + n], &later.vector);
        }
        known.into_iter().for_each(|known| self.correction.copy_from_slice(known));
        // P − (PΛ)P
        multiply(&self.p, &later.matrix, &mut self.product, n, ld);
        multiply(&self.product, &self.p, &mut self.less, n, ld);
        self.less.iter_mut().zip(&self.p).for_each(|(less, p)| *less = p - *less);
        symmetrise(&mut self.less, n, ld);
        let variances = (0..n).map(|i| i * ld + i).map(|at| self.less[at].max(ROUNDING * self.p[at]));
        let squares = self.correction.iter().zip(variances).filter(|(_, variance)| *variance > 0.0);
        let largest = squares.map(|(d, variance)| d * d / variance).fold(0.0, f64::max);
        self.change = math::sqrt(largest);
        pack(&self.less, &mut self.whole, n, ld);
        self.reset.reset();
        let (layout, by) = (&self.layout, &mut self.reset);
        if self.chart.correct(layout, &mut out.x, &self.correction, self.how, by) {
            self.turn(n, ld);
        }
        out.covariance.set_whole(&self.whole);
    }

    /// P ← J P Jᵀ in `whole`.
    fn turn(&mut self, n: usize, ld: usize) {
        let changes = || self.reset.changes();
        for (p, row) in self.p.chunks_exact_mut(ld).zip(self.whole.chunks_exact(n)) {
            p[..n].copy_from_slice(row);
        }
        // J P, then J (J P)ᵀ.
        for _ in 0..2 {
            self.product.copy_from_slice(&self.p);
            for (i, j, value) in changes() {
                let from = usize::from(j) * ld;
                axpy(value, &self.p[from..from + ld], &mut self.product[usize::from(i) * ld..][..ld]);
            }
            transpose(&self.product, &mut self.p, n, ld);
        }
        symmetrise(&mut self.p, n, ld);
        pack(&self.p, &mut self.whole, n, ld);
    }
}

/// The identity in rows of `ld`.
pub(super) fn identity(n: usize, ld: usize) -> Vec<f64> {
    let mut one = vec![0.0; n * ld];
    (0..n).for_each(|i| one[i * ld + i] = 1.0);
    one
}

fn pack(padded: &[f64], whole: &mut [f64], n: usize, ld: usize) {
    for (row, out) in padded.chunks_exact(ld).zip(whole.chunks_exact_mut(n)) {
        out.copy_from_slice(&row[..n]);
    }
}

fn transpose(from: &[f64], to: &mut [f64], n: usize, ld: usize) {
    for i in 0..n {
        for j in 0..n {
            to[j * ld + i] = from[i * ld + j];
        }
    }
}

fn symmetrise(m: &mut [f64], n: usize, ld: usize) {
    for i in 0..n {
        for j in 0..i {
            let mean = 0.5 * (m[i * ld + j] + m[j * ld + i]);
            m[i * ld + j] = mean;
            m[j * ld + i] = mean;
        }
    }
}

/// out ← A B.
fn multiply(a: &[f64], b: &[f64], out: &mut [f64], n: usize, ld: usize) {
    out.fill(0.0);
    for (row, out) in a.chunks_exact(ld).zip(out.chunks_exact_mut(ld)) {
        for (factor, b) in row[..n].iter().zip(b.chunks_exact(ld)) {
            axpy(*factor, b, out);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
