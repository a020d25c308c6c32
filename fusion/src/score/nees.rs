//! NEES: an error against its covariance, in the directions that the filter estimates.
//!
//! NEES  eᵀ Uᵀ (U S Uᵀ)⁻¹ U e with S = P + R, P of the filter, R of the reference
//! U     an orthonormal basis of the directions in which P is not zero: a planar filter has two for a position,
//!       one for an attitude. They are the degrees of freedom
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4.2.

use super::comparison::Deviation;
use super::{Consistency, Series};
use fusion_core::math;
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, DimMin, OMatrix, OVector, SymmetricEigen};

/// A variance below this share of the largest counts as zero. It is rounding of the largest, in a sum of a few tens of
/// products.
const ZERO: f64 = 1e-14;
/// Pivots above this share of the largest variance need no further check.
const FULL: f64 = 1e-8;

/// The NEES of `error` with its degrees of freedom. `own` is the covariance of the filter, `reference` that of the
/// reference. `None` if `own` is not positive semidefinite or a number is not finite.
pub(super) fn nees<D>(error: &OVector<f64, D>, own: &OMatrix<f64, D, D>, reference: &OMatrix<f64, D, D>) -> Option<(f64, usize)>
where
    D: DimMin<D, Output = D>,
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    // A check without branches, because the numbers are nearly always finite.
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

/// The error in units of its 1σ, L⁻¹ e with S = L Lᵀ: the NEES is the sum of its squares. `None` if a direction is
/// not estimated, or S is not positive definite.
fn whitened<D>(error: &OVector<f64, D>, own: &OMatrix<f64, D, D>, reference: &OMatrix<f64, D, D>) -> Option<OVector<f64, D>>
where
    D: DimMin<D, Output = D>,
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    let largest = own.diagonal().amax();
    // The pivots of a factor bound the eigenvalues: if they are far from zero, every direction is estimated.
    let has_all = |l: &OMatrix<f64, D, D>| l.diagonal().iter().all(|pivot| pivot * pivot > FULL * largest);
    let factor = factor(own.clone()).filter(has_all)?;
    // An exact reference leaves the factor unchanged.
    let is_exact = reference.as_slice().iter().fold(true, |all, v| all & (*v == 0.0));
    let factor = if is_exact { factor } else { self::factor(own + reference)? };
    let mut z = error.clone();
    solve(&factor, &mut z);
    Some(z)
}

/// L of `a` = L Lᵀ, on and below the diagonal; above it `a` is unchanged. `None` if `a` is not positive definite.
///
/// Plain loops, which the compiler unrolls for three axes: half the time of nalgebra's, with the same bits.
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
        let pivot = math::sqrt(a[(j, j)]);
        a[(j, j)] = pivot;
        (j + 1..n).for_each(|i| a[(i, j)] /= pivot);
    }
    Some(a)
}

/// Solves L x = b; `b` becomes x.
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

/// The NEES of finite numbers if some directions may not be estimated.
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

/// The NEES of a deviation, with its degrees of freedom, along the axes that the reference knows.
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
/// Some epochs may have fewer degrees of freedom than others, before a direction is estimated. Their NEES has a
/// different mean and does not count.
///
/// A nearly constant error counts as a single value. The NEES alone shows only the changes of such an error. So the
/// number of independent values also depends on the error in units of its 1σ, whose mean is known to be 0. If
/// neighbours have the correlation ρ, this error has τ = (1 + ρ)/(1 − ρ). Its square has (1 + ρ²)/(1 − ρ²) = (τ +
/// 1/τ)/2.
#[derive(Clone, Debug)]
pub(super) struct NeesSeries {
    values: Series,
    /// The errors in units of their 1σ, for the epochs that have all three axes.
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
    /// Takes the result of [`nees`] at an epoch.
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

    /// Epochs at which the NEES was not defined, or had fewer degrees of freedom than later.
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
        // The velocity of a vehicle that drives north-east: neither down nor across is a state.
        let (value, dof) = of_numbers(&[1.0, 1.0, 7.0], &[0.5, 0.5, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0], 0.0).unwrap();
        // √2 forward with a variance of 1; 1e-14: rounding.
        assert!((value - 2.0).abs() < 1e-14 && dof == 1, "{value} {dof}");
        // The reference's own error does not make it a state.
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
        // Not defined: one epoch before all directions were estimated, one unsound epoch, two with fewer directions
        // again.
        assert_eq!((mean.mean, mean.dof, mean.count, series.undefined()), (3.0, 2, 2, 4));
    }

    /// Deviations with a covariance of 1. Each axis has a constant part of size `drawn`, and noise with the correlation
    /// `rho` between neighbours.
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
        // A constant error of 1.3 of its 1σ along each axis, with a little noise: any number of epochs repeats the same
        // draw. Its NEES of 5.3 varies only by the noise, as a thousand samples would.
        let drawn = deviations(1000, 1.3, 0.0, 0.3).consistency().unwrap();
        assert!(
            drawn.independent < 3.0 && drawn.verdict() == Some(crate::score::ConsistencyVerdict::Consistent),
            "{drawn:?}"
        );
        // A hundred samples show white errors twice as large as stated; at least half of 1000 count.
        let white = deviations(1000, 0.0, 0.0, 2.0).consistency().unwrap();
        assert!(
            white.independent > 500.0 && white.verdict() == Some(crate::score::ConsistencyVerdict::Overconfident),
            "{white:?}"
        );
        // With ρ = 0.9 between neighbours, τ of the squares is (1 + 0.81)/(1 − 0.81) = 9.5: 105 of 1000. The tolerance
        // is a factor of 1.5, the accuracy of the autocorrelation of a hundred.
        let slow = deviations(1000, 0.0, 0.9, 1.0).consistency().unwrap();
        assert!((70.0..160.0).contains(&slow.independent), "{slow:?}");
    }
}
