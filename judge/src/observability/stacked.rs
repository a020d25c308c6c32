//! The stacked matrix of a motion: the rows of all measurements, as functions of the state at the start, without process
//! noise.
//!
//! ```text
//!     ⎡ L₁⁻¹ H₁ Φ(1,0) ⎤
//! O = ⎢ L₂⁻¹ H₂ Φ(2,0) ⎥ D = Q U,   R = L Lᵀ;   only U is kept, k×k
//!     ⎣      …         ⎦
//! ```
//!
//! The Gramian OᵀO would lose half of the digits, and with them the small singular values that decide the rank.

use super::element::{Change, apply};
use nalgebra::DMatrix;

/// Rows that wait before they are folded into U: one decomposition of k + 64 rows costs less than 64 of k + 1.
const WAITING: usize = 64;

/// The stacked matrix, for k directions of a state of n axes.
#[derive(Clone, Debug)]
pub struct Stacked {
    /// Φ(·, 0) D, n×k.
    carried: DMatrix<f64>,
    room: DMatrix<f64>,
    /// U.
    factor: DMatrix<f64>,
    /// Rows that are not yet in U, one after the other.
    waiting: Vec<f64>,
    rows: usize,
}

impl Stacked {
    /// Without any measurement. The columns of `directions`, n×k, are the unknown errors at the start, each of one σ.
    #[must_use]
    pub fn new(directions: DMatrix<f64>) -> Self {
        let k = directions.ncols();
        Self {
            room: directions.clone(),
            carried: directions,
            factor: DMatrix::zeros(k, k),
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
        let k = self.factor.ncols();
        let more = self.waiting.len() / k.max(1);
        let mut all = self.factor.clone().resize_vertically(k + more, 0.0);
        all.rows_mut(k, more).copy_from(&DMatrix::from_row_slice(more, k, &self.waiting));
        self.factor = all.qr().r();
        self.waiting.clear();
    }

    /// The singular values of O, the largest first.
    #[must_use]
    pub fn singular_values(&self) -> Vec<f64> {
        let mut folded = self.clone();
        folded.fold();
        let mut values: Vec<f64> = folded.factor.singular_values().iter().copied().collect();
        values.sort_by(|a, b| b.total_cmp(a));
        values
    }

    /// The number of singular values that rounding cannot explain: above max(rows, k) ε of the largest, the bound of
    /// Golub and Van Loan (Matrix Computations, §5.5.8).
    #[must_use]
    pub fn rank(&self) -> usize {
        let values = self.singular_values();
        let rows = self.rows.max(values.len()) as f64;
        let largest = values.first().copied().unwrap_or(0.0);
        values.iter().filter(|s| **s > rows * f64::EPSILON * largest).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An agent that sees only the optic flow r = g/d of a wall: its speed g over its distance d. Its own command u
    /// changes the speed, ġ = u, and is known.
    fn optic_flow(u: f64) -> Stacked {
        let mut stacked = Stacked::new(DMatrix::identity(2, 2));
        let (mut g, d, dt) = (2.0, 4.0, 0.1);
        for _ in 0..50 {
            let h = DMatrix::from_row_slice(1, 2, &[1.0 / d, -g / (d * d)]);
            stacked.measure(&h, &DMatrix::from_element(1, 1, 0.01));
            // Φ = I: the speed grows by u Δt, and its error does not.
            stacked.carry(&[]);
            g += u * dt;
        }
        stacked
    }

    /// The example of `pybounds` (Cellini, Boyacioglu, van Breugel 2023): speed and distance are separated by
    /// acceleration only.
    #[test]
    fn speed_and_distance_from_optic_flow_need_an_acceleration() {
        for (u, rank) in [(0.0, 1), (1.0, 2)] {
            let stacked = optic_flow(u);
            assert_eq!(stacked.rank(), rank, "{:?}", stacked.singular_values());
        }
    }

    #[test]
    fn a_small_singular_value_survives_that_its_gramian_would_lose() {
        let mut stacked = Stacked::new(DMatrix::identity(2, 2));
        let one = DMatrix::from_element(1, 1, 1.0);
        for k in 0..200 {
            let small = if k == 77 { 1e-10 } else { 0.0 };
            stacked.measure(&DMatrix::from_row_slice(1, 2, &[1.0, small]), &one);
        }
        let values = stacked.singular_values();
        assert_eq!(stacked.rank(), 2, "{values:?}");
        // The second is 1e-10 √(1 − 1/200), the part of the column that is orthogonal to the first. Rounding is a few ε √200,
        // 1e-4 of it.
        assert!(
            (values[1] / (1e-10 * (1.0 - 1.0 / 200.0_f64).sqrt()) - 1.0).abs() < 1e-3,
            "{values:?}"
        );
    }
}
