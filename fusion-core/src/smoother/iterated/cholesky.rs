//! The linear problem as normal equations over all states of the log, solved by sparse Cholesky factorisation.
//!
//! ```text
//! least of Σ |B d_k − Φ d_{k−1} + c_k|² in Q_k + ε D_k  +  Σ |r − H d|² in R,   c_k = e_k − ε D_k ν_k
//! λ_k = −(Q_k + ε D_k)⁻¹ (B d_k − Φ d_{k−1} + c_k)
//! ```
//!
//! Q may be singular: ε D, with the filter's variances D, makes it positive. ν in c_k takes this noise back. Where λ = ν the
//! solution has w_k = −Q_k λ_k, as without ε (proximal method of multipliers: Rockafellar 1976). B is the identity except at
//! a start, where it turns d into the error about the initial state.

use super::Unsound;
use super::backward::Direction;
use super::record::{Entry, Linear, Operation};
use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use nalgebra::{Cholesky, DMatrix, DVector};

/// The noise that is added, as a part of the filter's variance. A log of 10⁵ steps gets 10⁻⁴ of a variance, which the next
/// iteration takes back; the factorisation keeps six digits of the correction.
const ADDED: f64 = 1e-9;

/// A state: the terms between it and the state before, and those of its measurements.
struct Node {
    is_start: bool,
    b: DMatrix<f64>,
    phi: DMatrix<f64>,
    c: DVector<f64>,
    /// (Q + ε D)⁻¹.
    weight: DMatrix<f64>,
    /// Σ HᵀR⁻¹H and Σ HᵀR⁻¹r.
    information: DMatrix<f64>,
    seen: DVector<f64>,
}

/// Solves the problem of all `records`, which are in the order of the log.
pub(super) fn solve(records: &[Linear], n: usize) -> Result<Vec<Direction>, Unsound> {
    let mut nodes: Vec<Node> = Vec::new();
    for record in records {
        match &record.operation {
            Operation::Estimate => {}
            Operation::Measure(_) => nodes.last_mut().ok_or(Unsound)?.measure(record)?,
            _ => nodes.push(Node::of(record, n)?),
        }
    }
    let (matrix, right) = normal_equations(&nodes, n)?;
    let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(|_| Unsound)?;
    let factor = Llt::try_new_with_symbolic(symbolic, matrix.as_ref(), Side::Lower).map_err(|_| Unsound)?;
    let solution = factor.solve(faer::Mat::from_fn(right.len(), 1, |i, _| right[i]));
    let at = |k: usize| DVector::from_fn(n, |i, _| solution[(k * n + i, 0)]);
    let directions = nodes.iter().enumerate().map(|(k, node)| {
        let mut difference = &node.b * at(k) + &node.c;
        if !node.is_start {
            difference -= &node.phi * at(k - 1);
        }
        let multiplier = -(&node.weight * difference);
        Direction {
            step: at(k).as_slice().to_vec(),
            multiplier: multiplier.as_slice().to_vec(),
        }
    });
    Ok(directions.collect())
}

impl Node {
    fn of(record: &Linear, n: usize) -> Result<Self, Unsound> {
        let mut phi = DMatrix::identity(n, n);
        record.link.changes().for_each(|(i, j, change)| phi[(i, j)] += change);
        let (is_start, q) = match &record.operation {
            Operation::Start { p, .. } => (true, unpacked(p, n)),
            _ => (
                false,
                &phi * entries(&record.before, n) * phi.transpose() + entries(&record.after, n),
            ),
        };
        // A state that is known exactly gets a noise of any size.
        let variance = |i: usize| record.p[i * (i + 1) / 2 + i];
        let added = DVector::from_fn(n, |i, _| ADDED * if variance(i) > 0.0 { variance(i) } else { 1.0 });
        let dual = DVector::from_column_slice(&record.dual);
        let c = DVector::from_column_slice(&record.defect) - added.component_mul(&dual);
        let weight = Cholesky::new(q + DMatrix::from_diagonal(&added)).ok_or(Unsound)?.inverse();
        // The matrix of a start turns an error about the initial state into d.
        let b = if is_start {
            phi.clone().try_inverse().ok_or(Unsound)?
        } else {
            DMatrix::identity(n, n)
        };
        Ok(Self {
            is_start,
            b,
            phi,
            c,
            weight,
            information: DMatrix::zeros(n, n),
            seen: DVector::zeros(n),
        })
    }

    fn measure(&mut self, record: &Linear) -> Result<(), Unsound> {
        let (m, n) = (record.residual.len(), self.c.len());
        if m == 0 {
            return Ok(());
        }
        // H = L H̃.
        let whitened: Vec<f64> = record.link.learnt().flat_map(|(h, _)| h).copied().collect();
        let h = DMatrix::from_row_slice(m, m, &record.factor).lower_triangle() * DMatrix::from_row_slice(m, n, &whitened);
        let noise = Cholesky::new(DMatrix::from_row_slice(m, m, &record.weighed)).ok_or(Unsound)?;
        let weighed = noise.solve(&h);
        self.information += h.transpose() * &weighed;
        self.seen += weighed.transpose() * DVector::from_column_slice(&record.residual);
        Ok(())
    }
}

/// The normal equations: the lower triangle of their block-tridiagonal matrix by columns, and the right side.
fn normal_equations(nodes: &[Node], n: usize) -> Result<(SparseColMat<usize, f64>, Vec<f64>), Unsound> {
    let size = nodes.len() * n;
    let (mut ends, mut rows, mut values, mut right) = (vec![0], Vec::new(), Vec::new(), Vec::with_capacity(size));
    for (k, node) in nodes.iter().enumerate() {
        let mut diagonal = node.b.transpose() * &node.weight * &node.b + &node.information;
        let mut side = &node.seen - node.b.transpose() * (&node.weight * &node.c);
        let next = nodes.get(k + 1).filter(|next| !next.is_start);
        let below = next.map(|next| {
            let weighed = &next.weight * &next.phi;
            diagonal += next.phi.transpose() * &weighed;
            side += weighed.transpose() * &next.c;
            -(next.b.transpose() * weighed)
        });
        for j in 0..n {
            rows.extend((j..n).map(|i| k * n + i));
            values.extend((j..n).map(|i| diagonal[(i, j)]));
            if let Some(below) = &below {
                rows.extend((0..n).map(|i| (k + 1) * n + i));
                values.extend((0..n).map(|i| below[(i, j)]));
            }
            ends.push(rows.len());
        }
        right.extend_from_slice(side.as_slice());
    }
    if !values.iter().all(|v: &f64| v.is_finite()) {
        return Err(Unsound);
    }
    let pattern = SymbolicSparseColMat::new_checked(size, size, ends, None, rows);
    Ok((SparseColMat::new(pattern, values), right))
}

fn entries(entries: &[Entry], n: usize) -> DMatrix<f64> {
    let mut q = DMatrix::zeros(n, n);
    entries.iter().for_each(|&(i, j, value)| q[(i.into(), j.into())] += value);
    q
}

/// The symmetric matrix of which `lower` is the lower triangle, row by row.
fn unpacked(lower: &[f64], n: usize) -> DMatrix<f64> {
    let at = |i: usize, j: usize| lower[i * (i + 1) / 2 + j];
    DMatrix::from_fn(n, n, |i, j| at(i.max(j), i.min(j)))
}
