//! The error that a fault caused, in σ.
//!
//! For each axis of position and velocity (north, east, down) and of the attitude (body axes), with
//! the error e against the reference, the error e₀ of the undisturbed run at the same epoch, and the
//! σ that the disturbed filter and the reference declare together:
//!
//! ```text
//! min(|e|, |e − e₀|) / σ
//! ```
//!
//! An estimate within 3σ of the truth is right. An estimate within 3σ of the undisturbed estimate was not harmed by the
//! fault, even if the undisturbed estimate is wrong. Without a reference, the undisturbed run replaces it: e₀ = 0. An
//! axis that the filter does not estimate (a variance of exactly 0) does not count.

use fusion::score::{Deviation, EpochError};
use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// The quantities of the errors.
pub(super) const GROUPS: [&str; 3] = ["position", "velocity", "attitude"];

/// Larger ratios, and ratios without a finite σ, are shown as this.
pub(super) const MOST: f64 = 1e12;

/// Errors of position \[m\], velocity \[m/s\] and attitude \[rad\] at an epoch, with their σ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    pub(super) time: Time,
    /// By group: the error and its σ per axis.
    pub(super) groups: [Option<(Vector3<f64>, Vector3<f64>)>; 3],
}

impl Errors {
    /// The errors of an epoch. `mounting` is the rotation from the estimate's body to the reference's body; the
    /// attitude errors exclude it.
    pub(super) fn of(error: &EpochError, mounting: &UnitQuaternion<f64>) -> Self {
        let attitude = error.attitude.map(|a| {
            let turned = (a.estimate * mounting).inverse() * a.truth;
            // The covariance is in body axes of the estimate, and so is the error after this.
            let e = mounting * so3::log(&turned);
            (e, sigma(&a.body))
        });
        let with_sigma = |d: Deviation| (d.error, sigma(&d));
        Self {
            time: error.time(),
            groups: [error.position.map(with_sigma), error.velocity.map(with_sigma), attitude],
        }
    }

    /// The largest error in σ that also exceeds the undisturbed error, and its group; `None` if there is no error to
    /// compare.
    pub(super) fn worst(&self, undisturbed: Option<&Self>) -> Option<(f64, usize)> {
        let mut worst: Option<(f64, usize)> = None;
        for (k, group) in self.groups.iter().enumerate() {
            let Some((e, sigma)) = group else { continue };
            let before = undisturbed.and_then(|u| u.groups[k]).map_or_else(Vector3::zeros, |(e, _)| e);
            for axis in 0..3 {
                let ratio = ratio(e[axis].abs().min((e[axis] - before[axis]).abs()), sigma[axis]);
                if worst.is_none_or(|(most, _)| ratio > most) {
                    worst = Some((ratio, k));
                }
            }
        }
        worst
    }

    /// The error of a group that the fault caused: its worst axis in σ, and its length in SI units. `None` if the group
    /// has no error.
    pub(super) fn caused(&self, undisturbed: Option<&Self>, group: usize) -> Option<(f64, f64)> {
        let (e, sigma) = self.groups[group]?;
        let before = undisturbed.and_then(|u| u.groups[group]).map_or_else(Vector3::zeros, |(e, _)| e);
        let of = |axis: usize| ratio(e[axis].abs().min((e[axis] - before[axis]).abs()), sigma[axis]);
        let known = |v: Vector3<f64>| v.zip_map(&sigma, |v, s| if s == f64::INFINITY { 0.0 } else { v }).norm();
        Some((of(0).max(of(1)).max(of(2)), known(e).min(known(e - before))))
    }

    /// The length of the position error \[m\].
    pub(super) fn metres(&self) -> Option<f64> {
        self.groups[0].map(|(e, _)| e.norm())
    }

    /// The angle of the attitude error \[rad\].
    pub(super) fn angle(&self) -> Option<f64> {
        self.groups[2].map(|(e, _)| e.norm())
    }
}

/// σ per axis: infinite if the filter does not estimate it, NaN if a variance is negative, which must not look like
/// certainty.
fn sigma(d: &Deviation) -> Vector3<f64> {
    let estimated = d.is_estimated();
    let total = (d.own + d.reference).diagonal();
    Vector3::from_fn(|i, _| if estimated[i] { math::sqrt(total[i]) } else { f64::INFINITY })
}

/// e/σ; an error that is NaN, or has no σ, gives the largest ratio.
fn ratio(e: f64, sigma: f64) -> f64 {
    /// A smaller error is rounding: a nanometre, a nanoradian.
    const NOTHING: f64 = 1e-9;
    if e <= NOTHING {
        return 0.0;
    }
    let ratio = e / sigma;
    if ratio.is_finite() { ratio.min(MOST) } else { MOST }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(north: f64, sigma: f64) -> Errors {
        let one = (Vector3::new(north, 0.0, 0.0), Vector3::repeat(sigma));
        Errors {
            time: Time::default(),
            groups: [Some(one), None, None],
        }
    }

    #[test]
    fn an_error_counts_as_far_as_it_is_beyond_truth_and_undisturbed_run() {
        let worst = |e: f64, before: f64| errors(e, 2.0).worst(Some(&errors(before, 1.0)));
        assert_eq!(worst(8.0, 0.0), Some((4.0, 0)));
        // The undisturbed run was equally wrong: the fault had no effect.
        assert_eq!(worst(8.0, 7.0), Some((0.5, 0)));
        // The disturbed run happens to be right.
        assert_eq!(worst(1.0, 9.0), Some((0.5, 0)));
        assert_eq!(errors(-8.0, 2.0).worst(None), Some((4.0, 0)));
    }

    #[test]
    fn a_caused_error_is_the_smaller_of_both_in_sigma_and_in_length() {
        assert_eq!(errors(8.0, 2.0).caused(Some(&errors(7.0, 1.0)), 0), Some((0.5, 1.0)));
        assert_eq!(errors(-8.0, 2.0).caused(None, 0), Some((4.0, 8.0)));
        assert_eq!(errors(8.0, 2.0).caused(None, 1), None);
    }

    #[test]
    fn what_is_no_number_or_has_no_sigma_is_as_wrong_as_can_be() {
        for (e, sigma) in [(f64::NAN, 1.0), (1.0, 0.0), (1.0, f64::NAN), (f64::INFINITY, 1.0)] {
            assert_eq!(errors(e, sigma).worst(None), Some((MOST, 0)), "{e} {sigma}");
        }
        assert_eq!(errors(0.0, 0.0).worst(None), Some((0.0, 0)));
    }
}
