//! The steps between two corrections, as one step.
//!
//! Operations on the errors are kept. At the end of a segment, one pass backwards through them gives the response of the
//! final error to everything that came in between, and the covariances of all sources move once.
//!
//! ```text
//! e, t   the errors at an operation;  e_K, t_K at the end;  e_0, t_0 at the beginning
//! Ψ, b   ∂e_K/∂e and ∂e_K/∂t;  A = ∂t_K/∂t;  from the end: Ψ = I, b = 0, A = 1
//!
//! e ← (I + D) e            Ψ ← Ψ (I + D)
//! e ← e + l t              b ← b + Ψ l
//! e ← e + noise Q          W ← W + Ψ Q Ψᵀ
//! t ← a t + noise q        W ← W + q b bᵀ, c ← c + q A b, s ← s + q A²;  then b ← a b, A ← a A
//!
//! e_K = Ψ e_0 + b t_0 + noise of covariance W
//! t_K = A t_0 + noise of variance s, whose covariance with the noise of e_K is c
//! ```
//!
//! So a source without input costs nothing in the steps of a segment: it needs only Ψ.

use super::spread::{LANES, Spread, axpy, part, part_mut};
use core::ops::Range;

/// Steps in a segment at most. It bounds the memory where neither correction nor estimate ends a segment.
const MOST_STEPS: usize = 64;

/// A change of the errors.
#[derive(Clone, Debug)]
enum Operation {
    /// e ← (I + D) e: a part of `Segment::elements`.
    Carry(Range<usize>),
    /// e ← e + l Σ f t: a row of `Segment::responses`, a part of `Segment::factors`.
    Act(usize, Range<usize>),
    /// e ← e + noise of one source: an element of its covariance.
    Add {
        block: usize,
        row: usize,
        column: usize,
        value: f64,
    },
    /// t ← a t + noise.
    Age { error: usize, a: f64, fresh: f64 },
}

/// The operations since the covariances moved last.
#[derive(Debug)]
pub(super) struct Segment {
    n: usize,
    operations: Vec<Operation>,
    steps: usize,
    /// Row, column and value.
    elements: Vec<(u16, u16, f64)>,
    /// Rows of l, each of the width of `psi_l`.
    responses: Vec<f64>,
    /// The number of an error, and its factor.
    factors: Vec<(usize, f64)>,
    /// Sums of the backward pass: the columns of Ψ, and those before a step; Ψ l; all errors.
    psi: Vec<f64>,
    psi_before: Vec<f64>,
    psi_l: Vec<f64>,
    errors: Vec<Passing>,
    /// W of each source, above its diagonal.
    noise: Vec<f64>,
}

/// An error in the backward pass.
#[derive(Clone, Debug)]
struct Passing {
    b: Vec<f64>,
    c: Vec<f64>,
    a: f64,
    fresh: f64,
    is_new: bool,
}

impl Segment {
    /// Without operations, for the errors of `spread`.
    pub(super) fn new(spread: &Spread) -> Self {
        let n = spread.dim();
        let ld = n.next_multiple_of(LANES);
        let passing = Passing {
            b: vec![0.0; ld],
            c: vec![0.0; ld],
            a: 1.0,
            fresh: 0.0,
            is_new: true,
        };
        Self {
            n,
            operations: Vec::new(),
            steps: 0,
            elements: Vec::new(),
            responses: Vec::new(),
            factors: Vec::new(),
            psi: vec![0.0; n * ld],
            psi_before: vec![0.0; n * ld],
            psi_l: vec![0.0; ld],
            errors: vec![passing; spread.errors()],
            noise: vec![0.0; spread.blocks() * n * ld],
        }
    }

    /// Whether a step should end the segment.
    pub(super) fn is_long(&self) -> bool {
        self.steps >= MOST_STEPS
    }

    /// e ← (I + D) e, D given by its elements.
    pub(super) fn carry(&mut self, changes: impl Iterator<Item = (u16, u16, f64)>) -> &[(u16, u16, f64)] {
        let first = self.elements.len();
        changes.for_each(|change| self.elements.push(change));
        self.operations.push(Operation::Carry(first..self.elements.len()));
        self.steps += 1;
        &self.elements[first..]
    }

    /// e ← e + l Σ f t, for errors with their factors.
    pub(super) fn act(&mut self, l: &[f64], factors: impl Iterator<Item = (usize, f64)>) {
        let (row, first) = (self.responses.len(), self.factors.len());
        self.responses.extend_from_slice(l);
        self.factors.extend(factors);
        self.operations.push(Operation::Act(row, first..self.factors.len()));
    }

    /// Adds white noise to e: an element of the covariance of a source. Both triangles are added.
    pub(super) fn add(&mut self, block: usize, row: usize, column: usize, value: f64) {
        self.operations.push(Operation::Add { block, row, column, value });
    }

    /// An error ages: t ← a t + w, with the variance `fresh` of w.
    pub(super) fn age(&mut self, error: usize, a: f64, fresh: f64) {
        self.operations.push(Operation::Age { error, a, fresh });
    }

    /// Ends the segment: moves the covariances.
    pub(super) fn end(&mut self, spread: &mut Spread) {
        if self.operations.is_empty() {
            return;
        }
        self.pass_back(spread);
        let (n, ld) = (self.n, self.psi_l.len());
        let psi = |i: usize, j: usize| self.psi[j * ld + i] - f64::from(u8::from(i == j));
        self.elements.clear();
        for i in 0..n {
            let row = (0..n).map(|j| (i as u16, j as u16, psi(i, j)));
            self.elements.extend(row.filter(|(.., value)| *value != 0.0));
        }
        spread.carry(&self.elements);
        for (number, error) in self.errors.iter_mut().enumerate().filter(|(_, error)| !error.is_new) {
            spread.act(number, &error.b[..n]);
            spread.age(number, error.a, error.fresh);
            spread.covary(number, &error.c[..n]);
            error.b.fill(0.0);
            error.c.fill(0.0);
            (error.a, error.fresh, error.is_new) = (1.0, 0.0, true);
        }
        spread.add_all(&self.noise, ld);
        self.noise.fill(0.0);
        self.operations.clear();
        self.steps = 0;
        self.elements.clear();
        self.responses.clear();
        self.factors.clear();
    }

    fn pass_back(&mut self, spread: &Spread) {
        let Self {
            n, psi, psi_before, psi_l, ..
        } = self;
        let (n, ld) = (*n, psi_l.len());
        psi.fill(0.0);
        (0..n).for_each(|i| psi[i * ld + i] = 1.0);
        for operation in self.operations.iter().rev() {
            match operation {
                Operation::Carry(own) => {
                    psi_before.copy_from_slice(psi);
                    for &(i, j, by) in &self.elements[own.clone()] {
                        axpy(by, part(psi_before, i.into(), ld), part_mut(psi, j.into(), ld));
                    }
                }
                Operation::Act(row, factors) => {
                    psi_l.fill(0.0);
                    let l = self.responses[*row..*row + n].iter().enumerate();
                    l.filter(|(_, l)| **l != 0.0).for_each(|(i, l)| axpy(*l, part(psi, i, ld), psi_l));
                    for (number, factor) in &self.factors[factors.clone()] {
                        let error = &mut self.errors[*number];
                        axpy(*factor, psi_l, &mut error.b);
                        error.is_new = false;
                    }
                }
                Operation::Add { block, row, column, value } => {
                    let w = part_mut(&mut self.noise, *block, n * ld);
                    add_product(w, *value, part(psi, *row, ld), part(psi, *column, ld));
                }
                Operation::Age { error: number, a, fresh } => {
                    let error = &mut self.errors[*number];
                    error.is_new = false;
                    if let Some(block) = spread.owner(*number).filter(|_| *fresh > 0.0) {
                        add_product(part_mut(&mut self.noise, block, n * ld), *fresh, &error.b, &error.b);
                        axpy(fresh * error.a, &error.b, &mut error.c);
                        error.fresh += fresh * error.a * error.a;
                    }
                    if *a != 1.0 {
                        error.b.iter_mut().for_each(|b| *b *= a);
                        error.a *= a;
                    }
                }
            }
        }
    }
}

/// W ← W + q x yᵀ from its diagonal on, in whole groups.
fn add_product(w: &mut [f64], q: f64, x: &[f64], y: &[f64]) {
    let ld = y.len();
    for (i, w) in w.chunks_exact_mut(ld).enumerate().filter(|(i, _)| x[*i] != 0.0) {
        let from = i / LANES * LANES;
        axpy(q * x[i], &y[from..], &mut w[from..]);
    }
}
