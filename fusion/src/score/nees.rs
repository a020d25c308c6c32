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
    if let Some(z) = whitened(error, own, reference) {
        return Some((z.norm_squared(), z.len()));
    }
    let n = error.len();
    let dense = |m: &OMatrix<f64, D, D>| DMatrix::from_column_slice(n, n, m.as_slice());
    nees_in_part(&DVector::from_column_slice(error.as_slice()), dense(own), &dense(reference))
}

/// The error in units of its own 1σ, L⁻¹ e of S = L Lᵀ: the NEES is the sum of its squares. `None` where a direction is not
/// estimated, or S is not positive definite.
fn whitened<D>(error: &OVector<f64, D>, own: &OMatrix<f64, D, D>, reference: &OMatrix<f64, D, D>) -> Option<OVector<f64, D>>
where
    D: DimMin<D, Output = D>,
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    let largest = own.diagonal().amax();
    // The pivots of a factor bound the eigenvalues: far from zero, every direction is estimated.
    let has_all = |l: &OMatrix<f64, D, D>| l.diagonal().iter().all(|pivot| pivot * pivot > FULL * largest);
    let factor = factor(own.clone()).filter(has_all)?;
    // A reference without an error of its own leaves the factor as it is.
    let is_exact = reference.as_slice().iter().fold(true, |all, v| all & (*v == 0.0));
    let factor = if is_exact { factor } else { self::factor(own + reference)? };
    let mut z = error.clone();
    solve(&factor, &mut z);
    Some(z)
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

/// `b` becomes x of L x = b.
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
pub fn of(d: &Deviation) -> Option<(f64, usize)> {
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
///
/// An error that is in the mean of a run as large as one of its 1σ, and hardly changes, says no more than one of its
/// values: the NEES alone shows only how it changes. So the values that count as independent are also those of the error
/// in units of its 1σ, whose mean is known to be 0. Of an error with ρ between neighbours that is
/// τ = (1 + ρ)/(1 − ρ), of its square (1 + ρ²)/(1 − ρ²) = (τ + 1/τ)/2.
#[derive(Clone, Debug)]
pub(super) struct NeesSeries {
    values: Series,
    /// The errors in units of their 1σ, of the epochs that have all three.
    errors: [Series; 3],
    dof: usize,
    undefined: usize,
}

fusion_core::memory!(NeesSeries {
    values,
    errors,
    dof,
    undefined
});

impl Default for NeesSeries {
    fn default() -> Self {
        Self {
            values: Series::default(),
            errors: [const { Series::coarse() }; 3],
            dof: 0,
            undefined: 0,
        }
    }
}

impl NeesSeries {
    /// Takes what [`nees`] found at an epoch.
    pub(super) fn add(&mut self, found: Option<(f64, usize)>) {
        self.take(found, None);
    }

    /// Takes the deviation of an epoch.
    pub(super) fn add_deviation(&mut self, d: &Deviation) {
        let z = if d.is_whole() {
            whitened(&d.error, &d.own, &d.reference)
        } else {
            None
        };
        match &z {
            Some(z) if z.norm_squared().is_finite() => self.take(Some((z.norm_squared(), 3)), Some((*z).into())),
            _ => self.take(of(d), None),
        }
    }

    fn take(&mut self, found: Option<(f64, usize)>, z: Option<[f64; 3]>) {
        match found {
            Some((value, dof)) if dof > self.dof => {
                self.undefined += self.values.len();
                *self = Self {
                    dof,
                    undefined: self.undefined,
                    ..Self::default()
                };
                self.push(value, z);
            }
            Some((value, dof)) if dof == self.dof && dof > 0 => self.push(value, z),
            Some((_, 0)) if self.dof == 0 => {}
            _ => self.undefined += 1,
        }
    }

    fn push(&mut self, value: f64, z: Option<[f64; 3]>) {
        self.values.push(value);
        if let Some(z) = z {
            self.errors.iter_mut().zip(z).for_each(|(error, z)| error.push(z));
        }
    }

    /// Epochs at which it was not defined, or had fewer degrees of freedom than later.
    pub(super) const fn undefined(&self) -> usize {
        self.undefined
    }

    /// Its mean and band.
    pub(super) fn consistency(&self) -> Option<Consistency> {
        let found = Consistency::of(&self.values, self.dof)?;
        if self.errors[0].len() != self.values.len() {
            return Some(found);
        }
        let count = self.values.len() as f64;
        let tau = self.errors.iter().map(|z| count / z.independent_about_zero());
        let of_squares = tau.map(|tau| 0.5 * (tau + 1.0 / tau)).sum::<f64>() / 3.0;
        Some(found.at_most(count / of_squares))
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

    /// Deviations with a covariance of 1: along each axis what was drawn once, and noise that goes on with `rho` from one
    /// to the next.
    fn deviations(count: usize, drawn: f64, rho: f64, size: f64) -> NeesSeries {
        let (mut bits, mut error) = (9_u64, [0.0; 3]);
        let mut series = NeesSeries::default();
        let mut noise = || {
            // The sum of twelve is normal enough.
            (0..12).fold(-6.0, |sum, _| {
                bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (bits >> 33) as f64 / f64::from(1_u32 << 31)
            })
        };
        for _ in 0..count {
            error.iter_mut().for_each(|e| *e = rho * *e + (1.0 - rho * rho).sqrt() * noise());
            series.add_deviation(&Deviation {
                error: nalgebra::Vector3::from(error.map(|e| drawn + size * e)),
                own: nalgebra::Matrix3::identity(),
                ..Deviation::default()
            });
        }
        series
    }

    #[test]
    fn an_error_that_lasts_as_long_as_the_run_is_one_error() {
        // Drawn once, 1.3 of its 1σ along each axis, with a little noise: however many epochs repeat it, it is one draw. Its
        // NEES of 5.3 varies by the noise alone, as a thousand samples would.
        let drawn = deviations(1000, 1.3, 0.0, 0.3).consistency().unwrap();
        assert!(
            drawn.independent < 3.0 && drawn.verdict() == Some(crate::score::Verdict::Consistent),
            "{drawn:?}"
        );
        // White errors twice as large as stated are told by a hundred of them; half of 1000 count at least.
        let white = deviations(1000, 0.0, 0.0, 2.0).consistency().unwrap();
        assert!(
            white.independent > 500.0 && white.verdict() == Some(crate::score::Verdict::Overconfident),
            "{white:?}"
        );
        // τ of the squares with ρ = 0.9 between neighbours is (1 + 0.81)/(1 − 0.81) = 9.5: 105 of 1000; within a factor of
        // 1.5, as the autocorrelation of a hundred is known.
        let slow = deviations(1000, 0.0, 0.9, 1.0).consistency().unwrap();
        assert!((70.0..160.0).contains(&slow.independent), "{slow:?}");
    }
}
