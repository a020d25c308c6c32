//! The stacked matrix of a motion: what each measurement says about the state at the start, without process noise.
//!
//! ```text
//!     ⎡ L₁⁻¹ H₁ Φ(1,0) ⎤
//! O = ⎢ L₂⁻¹ H₂ Φ(2,0) ⎥ = Q U,   R = L Lᵀ;   only U is kept, n×n
//!     ⎣      …         ⎦
//! ```
//!
//! The Gramian OᵀO would lose half of the digits, and with them the small singular values that decide the rank.

use super::element::{Change, apply};
use nalgebra::DMatrix;

/// Rows that wait before they are folded into U: one decomposition of n + 64 rows costs less than 64 of n + 1.
const WAITING: usize = 64;

/// The stacked matrix, for a state of n axes.
#[derive(Clone, Debug)]
pub struct Stacked {
    /// Φ(k, 0).
    carried: DMatrix<f64>,
    room: DMatrix<f64>,
    /// U.
    factor: DMatrix<f64>,
    /// Rows that are not yet in U, one after the other.
    waiting: Vec<f64>,
    rows: usize,
}

impl Stacked {
    /// Without any measurement.
    #[must_use]
    pub fn empty(n: usize) -> Self {
        Self {
            carried: DMatrix::identity(n, n),
            room: DMatrix::zeros(n, n),
            factor: DMatrix::zeros(n, n),
            waiting: Vec::new(),
            rows: 0,
        }
    }

    /// x ← Φ x, by the elements of Φ − I.
    pub fn carry(&mut self, changes: &[Change]) {
        apply(changes, &mut self.carried, &mut self.room);
    }

    /// Adds a measurement with the Jacobian `h`, m×n, and the noise covariance `r`, m×m, which has to be positive
    /// definite.
    pub fn measure(&mut self, h: &DMatrix<f64>, r: &DMatrix<f64>) {
        let Some(said) = r
            .clone()
            .cholesky()
            .and_then(|r| r.l_dirty().solve_lower_triangular(&(h * &self.carried)))
        else {
            return;
        };
        self.rows += said.nrows();
        said.row_iter().for_each(|row| self.waiting.extend(row.iter()));
        if self.waiting.len() >= WAITING * self.factor.ncols() {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let n = self.factor.ncols();
        let more = self.waiting.len() / n.max(1);
        let mut all = self.factor.clone().resize_vertically(n + more, 0.0);
        all.rows_mut(n, more).copy_from(&DMatrix::from_row_slice(more, n, &self.waiting));
        self.factor = all.qr().r();
        self.waiting.clear();
    }

    /// The singular values of O with its columns multiplied by `scale`, the largest first. Columns with the scale 0 are
    /// left out.
    #[must_use]
    pub fn singular_values(&self, scale: &[f64]) -> Vec<f64> {
        let mut folded = self.clone();
        folded.fold();
        let columns: Vec<usize> = (0..scale.len()).filter(|i| scale[*i] != 0.0).collect();
        let mut scaled = folded.factor.select_columns(&columns);
        for (mut column, i) in scaled.column_iter_mut().zip(&columns) {
            column *= scale[*i];
        }
        let mut values: Vec<f64> = scaled.singular_values().iter().copied().collect();
        values.sort_by(|a, b| b.total_cmp(a));
        values
    }

    /// The number of singular values that rounding cannot explain: above max(rows, n) ε of the largest, the bound of
    /// Golub and Van Loan (Matrix Computations, §5.5.8).
    #[must_use]
    pub fn rank(&self, singular_values: &[f64]) -> usize {
        let rows = self.rows.max(singular_values.len()) as f64;
        let largest = singular_values.first().copied().unwrap_or(0.0);
        singular_values.iter().filter(|s| **s > rows * f64::EPSILON * largest).count()
    }
}
