//! NEES: an error against its covariance, in the directions that the filter estimates.
//!
//! NEES  eᵀ Uᵀ (U S Uᵀ)⁻¹ U e with S = P + R, P that of the filter, R that of the reference
//! U     an orthonormal basis of the directions in which P is not zero: a planar filter has two
//!       of a position, one of an attitude. They are the degrees of freedom
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4.2.

use super::comparison::Deviation;
use super::{Consistency, Series};
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, DimMin, OMatrix, OVector, SymmetricEigen};

/// A variance below this share of the largest is none: rounding of the largest, in a sum of a few
/// tens of products.
const ZERO: f64 = 1e-14;
/// Pivots above this share of the largest variance need no closer look.
const FULL: f64 = 1e-8;

/// The NEES of `error` with its degrees of freedom, `own` being the covariance by the filter and
/// `reference` that of what it is compared with; `None` where `own` is not positive semidefinite or
/// a number is not finite.
pub(super) fn nees<D>(error: &OVector<f64, D>, own: &OMatrix<f64, D, D>, reference: &OMatrix<f64, D, D>) -> Option<(f64, usize)>
where
    D: DimMin<D, Output = D>,
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    // Without a branch each: they nearly always are.
    let is_finite = |all: &[f64]| all.iter().fold(true, |all, v| all & v.is_finite());
    if !(is_finite(error.as_slice()) & is_finite(own.as_slice()) & is_finite(reference.as_slice())) {
        return None;
    }
    let largest = own.diagonal().amax();
    // The pivots of a factor bound the eigenvalues: far from zero, every direction is estimated.
    let has_all = |l: &OMatrix<f64, D, D>| l.diagonal().iter().all(|pivot| pivot * pivot > FULL * largest);
    if let Some(factor) = factor(own.clone()).filter(has_all) {
        // A reference without an error of its own leaves the factor as it is.
        let is_exact = reference.as_slice().iter().fold(true, |all, v| all & (*v == 0.0));
        let factor = if is_exact { factor } else { self::factor(own + reference)? };
        let mut solved = error.clone();
        solve(&factor, &mut solved);
        return Some((error.dot(&solved), error.len()));
    }
    let n = error.len();
    let dense = |m: &OMatrix<f64, D, D>| DMatrix::from_column_slice(n, n, m.as_slice());
    nees_in_part(&DVector::from_column_slice(error.as_slice()), dense(own), &dense(reference))
}

/// L of `a` = L Lᵀ below and on the diagonal, above it what was there; `None` where `a` is not positive definite.
///
/// Plain loops, which the compiler unrolls for three axes: half the time of nalgebra's, and the same bits.
fn factor<D: DimMin<D, Output = D>>(mut a: OMatrix<f64, D, D>) -> Option<OMatrix<f64, D, D>>
where
    DefaultAllocator: Allocator<D, D>,
{
    let n = a.nrows();
    for j in 0..n {
        for k in 0..j {
            let l = a[(j, k)];
            (j..n).for_each(|i| a[(i, j)] -= l * a[(i, k)]);
        }
        if a[(j, j)].is_nan() || a[(j, j)] <= 0.0 {
            return None;
        }
        let pivot = a[(j, j)].sqrt();
        a[(j, j)] = pivot;
        (j + 1..n).for_each(|i| a[(i, j)] /= pivot);
    }
    Some(a)
}

/// `b` becomes x of L Lᵀ x = b.
fn solve<D: DimMin<D, Output = D>>(l: &OMatrix<f64, D, D>, b: &mut OVector<f64, D>)
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    let n = b.len();
    for j in 0..n {
        b[j] /= l[(j, j)];
        let known = b[j];
        (j + 1..n).for_each(|i| b[i] -= known * l[(i, j)]);
    }
    for j in (0..n).rev() {
        let known: f64 = (j + 1..n).map(|i| l[(i, j)] * b[i]).sum();
        b[j] = (b[j] - known) / l[(j, j)];
    }
}

/// The same of finite numbers where a direction may not be estimated.
fn nees_in_part(error: &DVector<f64>, own: DMatrix<f64>, reference: &DMatrix<f64>) -> Option<(f64, usize)> {
    let sum = &own + reference;
    let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(own);
    let least = ZERO * eigenvalues.amax();
    if eigenvalues.iter().any(|v| *v < -least) {
        return None;
    }
    let known: Vec<usize> = (0..error.len()).filter(|k| eigenvalues[*k] > least).collect();
    if known.is_empty() {
        return Some((0.0, 0));
    }
    let u = eigenvectors.select_columns(&known);
    let s = u.tr_mul(&(sum * &u));
    let e = u.tr_mul(error);
    let solved = s.cholesky()?.solve(&e);
    Some((e.dot(&solved), known.len()))
}

/// The NEES of a deviation, with its degrees of freedom: along the axes that the reference knows.
pub(crate) fn of(d: &Deviation) -> Option<(f64, usize)> {
    if !d.is_whole() {
        let known: Vec<usize> = (0..3).filter(|k| d.known[*k]).collect();
        let part = |m: &nalgebra::Matrix3<f64>| DMatrix::from_fn(known.len(), known.len(), |i, j| m[(known[i], known[j])]);
        let error = DVector::from_fn(known.len(), |i, _| d.error[known[i]]);
        return nees(&error, &part(&d.own), &part(&d.reference));
    }
    nees(&d.error, &d.own, &d.reference)
}

/// The NEES of many epochs.
///
/// An epoch may have fewer degrees of freedom than the others: before a direction is estimated.
/// Its NEES has another mean, and is not counted with them.
#[derive(Clone, Debug, Default)]
pub(super) struct NeesSeries {
    values: Series,
    dof: usize,
    undefined: usize,
}

fusion_core::memory!(NeesSeries { values, dof, undefined });

impl NeesSeries {
    /// Takes what [`nees`] found at an epoch.
    pub(super) fn add(&mut self, found: Option<(f64, usize)>) {
        match found {
            Some((value, dof)) if dof > self.dof => {
                self.undefined += self.values.len();
                self.values = Series::from_iter([value]);
                self.dof = dof;
            }
            Some((value, dof)) if dof == self.dof && dof > 0 => self.values.push(value),
            Some((_, 0)) if self.dof == 0 => {}
            _ => self.undefined += 1,
        }
    }

    /// Epochs at which it was not defined, or had fewer degrees of freedom than later.
    pub(super) const fn undefined(&self) -> usize {
        self.undefined
    }

    /// Its mean and band.
    pub(super) fn consistency(&self) -> Option<Consistency> {
        Consistency::of(&self.values, self.dof)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_numbers(error: &[f64], own: &[f64], reference: f64) -> Option<(f64, usize)> {
        let n = error.len();
        let reference = DMatrix::identity(n, n) * reference;
        nees(&DVector::from_column_slice(error), &DMatrix::from_row_slice(n, n, own), &reference)
    }

    #[test]
    fn the_covariance_of_the_reference_is_added_to_that_of_the_filter() {
        let (value, dof) = of_numbers(&[1.0, 2.0], &[2.0, 1.0, 1.0, 3.0], 1.0).unwrap();
        // eᵀS⁻¹e, S = [3 1; 1 4] of determinant 11: (4·1 − 2·1·2 + 3·4)/11. 1e-14: rounding.
        assert!((value - 12.0 / 11.0).abs() < 1e-14 && dof == 2, "{value}");
    }

    #[test]
    fn what_is_no_state_is_no_degree_of_freedom() {
        // The velocity of a vehicle that drives north-east: down is no state, nor is across.
        let (value, dof) = of_numbers(&[1.0, 1.0, 7.0], &[0.5, 0.5, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0], 0.0).unwrap();
        // √2 ahead of a variance of 1; 1e-14: rounding.
        assert!((value - 2.0).abs() < 1e-14 && dof == 1, "{value} {dof}");
        // The reference's own error does not make it one.
        let (value, dof) = of_numbers(&[1.0, 7.0], &[1.0, 0.0, 0.0, 0.0], 1.0).unwrap();
        assert!((value - 0.5).abs() < 1e-14 && dof == 1, "{value} {dof}");
        assert_eq!(of_numbers(&[1.0], &[0.0], 0.0), Some((0.0, 0)));
    }

    #[test]
    fn where_the_covariance_is_none_there_is_no_nees() {
        let unsound = [&[1.0, 2.0, 2.0, 1.0], &[-1.0, 0.0, 0.0, 1.0], &[f64::NAN, 0.0, 0.0, 1.0]];
        for own in unsound {
            assert_eq!(of_numbers(&[1.0, 1.0], own, 9.0), None, "{own:?}");
        }
        assert_eq!(of_numbers(&[f64::NAN], &[1.0], 0.0), None);
    }

    #[test]
    fn epochs_without_the_full_nees_are_counted_apart() {
        let mut series = NeesSeries::default();
        for found in [
            Some((0.0, 0)),
            Some((9.0, 1)),
            Some((2.0, 2)),
            None,
            Some((4.0, 2)),
            Some((9.0, 1)),
            Some((0.0, 0)),
        ] {
            series.add(found);
        }
        let mean = series.consistency().unwrap();
        // Not defined: one before all directions were estimated, one unsound, two with fewer again.
        assert_eq!((mean.mean, mean.dof, mean.count, series.undefined()), (3.0, 2, 2, 4));
    }
}
