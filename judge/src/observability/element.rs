//! A part of a log as one value: how it carries errors, the noise that it adds, and what its measurements say.
//!
//! ```text
//! x₁ = A x₀ + w, w ~ (0, C);  information J about x₀
//! one after the other:   A = A₂ (I + C₁J₂)⁻¹ A₁
//!                        C = A₂ (C₁⁻¹ + J₂)⁻¹ A₂ᵀ + C₂
//!                        J = A₁ᵀ (J₂⁻¹ + C₁)⁻¹ A₁ + J₁
//! ```
//!
//! Without noise, A is the product of Φ, and J is the Gramian Σ AᵀHᵀR⁻¹HA.
//!
//! Source     Särkkä, García-Fernández 2021 (IEEE TAC 66(1), 299), eqs. 10 to 15: A, C, J and their product

use nalgebra::DMatrix;

/// An element of Φ − I: row, column, difference.
pub type Change = (usize, usize, f64);

/// A part of a log, for a state of n axes.
#[derive(Clone, Debug)]
pub struct Element {
    /// A, n×n.
    pub transition: DMatrix<f64>,
    /// C, n×n.
    pub noise: DMatrix<f64>,
    /// J, n×n.
    pub information: DMatrix<f64>,
    room: DMatrix<f64>,
}

impl Element {
    /// A part without any step.
    #[must_use]
    pub fn empty(n: usize) -> Self {
        Self {
            transition: DMatrix::identity(n, n),
            noise: DMatrix::zeros(n, n),
            information: DMatrix::zeros(n, n),
            room: DMatrix::zeros(n, n),
        }
    }

    /// x ← Φ x, by the elements of Φ − I.
    pub fn carry(&mut self, changes: &[Change]) {
        apply(changes, &mut self.transition, &mut self.room);
        apply(changes, &mut self.noise, &mut self.room);
        self.noise.transpose_mut();
        apply(changes, &mut self.noise, &mut self.room);
    }

    /// Adds elements of the covariance of a noise: row, column, value, both triangles.
    pub fn disturb(&mut self, noise: impl IntoIterator<Item = Change>) {
        noise.into_iter().for_each(|(i, j, value)| self.noise[(i, j)] += value);
    }

    /// Adds a measurement with the Jacobian `h`, m×n, and the noise covariance `r`, m×m. A measurement whose covariance
    /// is not positive definite does not count.
    pub fn measure(&mut self, h: &DMatrix<f64>, r: &DMatrix<f64>) {
        let seen = h * &self.noise;
        let Some(innovation) = (&seen * h.transpose() + r).cholesky() else {
            return;
        };
        let l = innovation.l_dirty();
        let (Some(said), Some(less)) = (l.solve_lower_triangular(&(h * &self.transition)), l.solve_lower_triangular(&seen)) else {
            return;
        };
        self.information.gemm_tr(1.0, &said, &said, 1.0);
        self.transition.gemm_tr(-1.0, &less, &said, 1.0);
        self.noise.gemm_tr(-1.0, &less, &less, 1.0);
    }

    /// This part, and then the part `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let known = conditioned(&self.noise, &next.information);
        // (I + C₁J₂)⁻¹ = I − (C₁⁻¹ + J₂)⁻¹ J₂
        let carried = &self.transition - &known * (&next.information * &self.transition);
        let said = conditioned(&next.information, &self.noise);
        Self {
            transition: &next.transition * carried,
            noise: symmetric(&next.transition * known * next.transition.transpose() + &next.noise),
            information: self.before(&said),
            room: self.room.clone(),
        }
    }

    /// The information about the state before the part, with the information `later` about the state after its noise.
    fn before(&self, later: &DMatrix<f64>) -> DMatrix<f64> {
        symmetric(self.transition.tr_mul(later) * &self.transition + &self.information)
    }

    /// The covariance after the part, from the covariance `p` before it.
    pub(super) fn forward(&self, p: &DMatrix<f64>) -> DMatrix<f64> {
        let known = conditioned(p, &self.information);
        symmetric(&self.transition * known * self.transition.transpose() + &self.noise)
    }

    /// The information before the part, from the information `j` after it.
    pub(super) fn backward(&self, j: &DMatrix<f64>) -> DMatrix<f64> {
        self.before(&conditioned(j, &self.noise))
    }

    /// The same part in other coordinates: y = M x, with `first` = M⁻¹ before the part and `last` = M after it.
    pub(super) fn in_coordinates(&self, first: &DMatrix<f64>, last: &DMatrix<f64>) -> Self {
        Self {
            transition: last * &self.transition * first,
            noise: symmetric(last * &self.noise * last.transpose()),
            information: symmetric(first.tr_mul(&self.information) * first),
            room: self.room.clone(),
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        let all = [&self.transition, &self.noise, &self.information];
        all.iter().all(|m| m.iter().all(|v| v.is_finite()))
    }
}

/// m ← Φ m, by the elements of Φ − I.
pub(crate) fn apply(changes: &[Change], m: &mut DMatrix<f64>, room: &mut DMatrix<f64>) {
    room.copy_from(m);
    let n = m.nrows();
    let columns = m.as_mut_slice().chunks_exact_mut(n).zip(room.as_slice().chunks_exact(n));
    for (to, from) in columns {
        changes.iter().for_each(|(i, j, value)| to[*i] += value * from[*j]);
    }
}

/// (P⁻¹ + J)⁻¹ for positive semidefinite P and J.
pub(super) fn conditioned(p: &DMatrix<f64>, j: &DMatrix<f64>) -> DMatrix<f64> {
    let n = p.nrows();
    let eigen = p.clone().symmetric_eigen();
    let mut root = eigen.eigenvectors;
    for (mut column, value) in root.column_iter_mut().zip(&eigen.eigenvalues) {
        // Rounding may make a zero negative.
        column *= fusion_core::math::sqrt(value.max(0.0));
    }
    let weight = DMatrix::identity(n, n) + symmetric(root.tr_mul(j) * &root);
    match weight.cholesky() {
        Some(weight) => symmetric(&root * weight.solve(&root.transpose())),
        // One is added to each eigenvalue: this happens only where numbers overflow.
        None => p.clone(),
    }
}

fn symmetric(m: DMatrix<f64>) -> DMatrix<f64> {
    let transposed = m.transpose();
    (m + transposed) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A position that drifts by its velocity, which walks; the second and the fourth step are measured.
    fn steps() -> Vec<Element> {
        let (h, r) = (DMatrix::from_row_slice(1, 2, &[1.0, 0.0]), DMatrix::from_element(1, 1, 0.25));
        let step = |k: usize| {
            let mut step = Element::empty(2);
            step.carry(&[(0, 1, 0.5)]);
            step.disturb([(0, 0, 0.01), (1, 1, 0.04), (0, 1, 0.01), (1, 0, 0.01)]);
            if k % 2 == 1 {
                step.measure(&h, &r);
            }
            step
        };
        (0..4).map(step).collect()
    }

    /// The covariance of the states 0 … 4 with the prior I, from the information of all of them at once.
    fn dense() -> DMatrix<f64> {
        let phi = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 1.0]);
        let q = DMatrix::from_row_slice(2, 2, &[0.01, 0.01, 0.01, 0.04]).try_inverse().unwrap();
        let mut all = DMatrix::zeros(10, 10);
        all.view_mut((0, 0), (2, 2)).fill_with_identity();
        for k in 0..4 {
            // x₁ − Φ x₀ has the covariance Q.
            let mut jump = DMatrix::zeros(2, 10);
            jump.view_mut((0, 2 * k), (2, 2)).copy_from(&-&phi);
            jump.view_mut((0, 2 * k + 2), (2, 2)).fill_with_identity();
            all += jump.transpose() * &q * jump;
            if k % 2 == 1 {
                all[(2 * k + 2, 2 * k + 2)] += 4.0;
            }
        }
        all.try_inverse().unwrap()
    }

    #[test]
    fn parts_joined_in_any_way_smooth_as_one_dense_problem_does() {
        let (steps, dense) = (steps(), dense());
        let joined = [
            steps[0].then(&steps[1]).then(&steps[2].then(&steps[3])),
            steps[0].then(&steps[1].then(&steps[2]).then(&steps[3])),
        ];
        for whole in joined {
            let first = conditioned(&DMatrix::identity(2, 2), &whole.information);
            // The dense inverse has a condition of 1e4, and loses as many ε.
            assert!((first - dense.view((0, 0), (2, 2))).amax() < 1e-11);
            let last = whole.forward(&DMatrix::identity(2, 2));
            assert!((last - dense.view((8, 8), (2, 2))).amax() < 1e-11);
        }
        let (before, after) = (steps[0].then(&steps[1]), steps[2].then(&steps[3]));
        let middle = conditioned(&before.forward(&DMatrix::identity(2, 2)), &after.backward(&DMatrix::zeros(2, 2)));
        assert!((middle - dense.view((4, 4), (2, 2))).amax() < 1e-11);
    }

    #[test]
    fn without_noise_the_information_is_the_gramian() {
        let mut part = Element::empty(2);
        let (h, r) = (DMatrix::from_row_slice(1, 2, &[1.0, 0.0]), DMatrix::from_element(1, 1, 4.0));
        part.measure(&h, &r);
        part.carry(&[(0, 1, 3.0)]);
        part.measure(&h, &r);
        // ¼ ([1 0]ᵀ[1 0] + [1 3]ᵀ[1 3]): powers of two, exact.
        assert_eq!(part.information.as_slice(), [0.5, 0.75, 0.75, 2.25]);
        assert_eq!(part.transition.as_slice(), [1.0, 0.0, 3.0, 1.0]);
        assert_eq!(part.noise.amax(), 0.0);
    }
}
