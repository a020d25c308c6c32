//! Convergence of a run: the time from which its errors stay within declared limits.
//!
//! Position and velocity count by the length of the error; if the reference has no height, by its horizontal part. The
//! heading counts by the rotation about the vertical between the two attitudes. Nothing is removed from it. Every epoch
//! from the start of the filter counts, also epochs before `reference.from`.

use super::attitudes::swing_and_twist;
use super::comparison::{AttitudeError, Deviation, EpochError};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The errors that a run has to stay within.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Length of the position error \[m\].
    pub position: Option<f64>,
    /// Length of the velocity error \[m/s\].
    pub velocity: Option<f64>,
    /// Rotation about the vertical \[rad\].
    pub heading: Option<f64>,
    /// The time from which the errors have to stay within the limits; by default the last epoch.
    pub by: Option<Time>,
}

/// The result for the limits in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Convergence {
    /// True if the errors stay within the limits from the declared time.
    pub converged: bool,
    /// The time after the start from which they stay within the limits \[s\]; `None` if they are outside at the end.
    pub after: Option<f64>,
}

/// One error and its limit.
#[derive(Clone, Copy, Debug, Default)]
struct Limited {
    limit: Option<f64>,
    /// True if it was ever known, and if its latest value was within the limit.
    is_known: bool,
    is_within: bool,
}

/// Follows a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tracker {
    /// Position, velocity, heading.
    limited: [Limited; 3],
    by: Option<Time>,
    /// The first and the last epoch.
    span: Option<(Time, Time)>,
    /// The first epoch of the current unbroken sequence in which all errors are within their limits.
    since: Option<Time>,
}

fusion_core::memory!(Tracker { limited, span, since; by });
fusion_core::memory!(Limited { is_known, is_within; limit });

impl Tracker {
    pub(super) fn new(limits: Limits) -> Self {
        let of = |limit| Limited {
            limit,
            ..Limited::default()
        };
        Self {
            limited: [limits.position, limits.velocity, limits.heading].map(of),
            by: limits.by,
            span: None,
            since: None,
        }
    }

    /// Takes the errors at the next epoch, as far as they are known.
    pub(super) fn add(&mut self, error: &EpochError) {
        let turn = |a: &AttitudeError| swing_and_twist(&(a.estimate * a.truth.inverse()))[0];
        let errors = [
            error.position.filter(Deviation::is_horizontal).map(|d| d.error.norm()),
            error.velocity.map(|d| d.error.norm()),
            error.attitude.as_ref().map(turn),
        ];
        let now = error.time();
        for (limited, error) in self.limited.iter_mut().zip(errors) {
            let Some((limit, error)) = limited.limit.zip(error) else { continue };
            limited.is_known = true;
            self.span = Some((self.span.map_or(now, |(start, _)| start), now));
            // NaN counts as outside.
            limited.is_within = error <= limit;
        }
        let is_within = self.limited.iter().all(|l| l.limit.is_none() || l.is_within);
        self.since = is_within.then(|| self.since.unwrap_or(now));
    }

    /// `None` if a limited error was never known.
    pub(super) fn finish(&self) -> Option<Convergence> {
        let (start, end) = self.span?;
        if self.limited.iter().any(|l| l.limit.is_some() && !l.is_known) {
            return None;
        }
        let by = self.by.unwrap_or(end);
        Some(Convergence {
            converged: self.since.is_some_and(|since| since <= by.max(start)),
            after: self.since.map(|since| since.seconds_since(start)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Comparison, ReferenceEpoch};
    use super::*;
    use crate::solution::Solution;
    use core::convert::Infallible;
    use fusion_core::geometry::so3;
    use fusion_core::geometry::wgs84::Geodetic;
    use nalgebra::{Matrix3, Vector3};

    /// Errors of position \[m\] and heading \[deg\], one each second from 100 s on.
    fn of(errors: &[(f64, f64)], limits: Limits) -> Option<Convergence> {
        let place = Geodetic::new(0.6, 0.1, 0.0);
        let truth = |k: usize| ReferenceEpoch {
            time: Time::from_seconds(100.0 + k as f64),
            position: Some(place),
            attitude: Some(so3::from_rpy(0.1, -0.2, 3.1)),
            ..ReferenceEpoch::default()
        };
        let mut tracker = Tracker::new(limits);
        let mut comparison = Comparison::new(Vector3::zeros(), (0..errors.len()).map(truth));
        for (k, (far, turn)) in errors.iter().enumerate() {
            let estimate = Solution {
                time: truth(k).time,
                position: Some((place.offset(&Vector3::new(0.0, 0.6 * far, -0.8 * far)), Matrix3::identity())),
                attitude: Some((
                    so3::exp(&(Vector3::z() * turn.to_radians())) * so3::from_rpy(0.1, -0.2, 3.1),
                    Matrix3::identity(),
                )),
                ..Solution::default()
            };
            let tell = |_: &ReferenceEpoch, error: Option<&EpochError>| {
                error.into_iter().for_each(|error| tracker.add(error));
                Ok::<_, Infallible>(())
            };
            comparison.reach(&estimate, None, tell).unwrap();
        }
        tracker.finish()
    }

    fn found(converged: bool, after: Option<f64>) -> Option<Convergence> {
        Some(Convergence { converged, after })
    }

    const LIMITS: Limits = Limits {
        position: Some(5.0),
        velocity: None,
        heading: Some(0.1),
        by: None,
    };

    #[test]
    fn a_run_has_converged_from_when_on_its_errors_stay_within_the_limits() {
        // 0.1 rad are 5.7°.
        let errors = [(9.0, 0.0), (4.0, -5.0), (4.0, 6.0), (4.9, 5.0), (0.0, -5.0)];
        assert_eq!(of(&errors, LIMITS), found(true, Some(3.0)));
        let by = |t: f64| Limits {
            by: Some(Time::from_seconds(t)),
            ..LIMITS
        };
        assert_eq!(of(&errors, by(103.0)), found(true, Some(3.0)));
        assert_eq!(of(&errors, by(102.0)), found(false, Some(3.0)));
        // Within the limits from a start that is later than the declared time.
        assert_eq!(of(&errors[3..], by(10.0)), found(true, Some(0.0)));
        assert_eq!(of(&errors[..3], LIMITS), found(false, None));
        assert_eq!(of(&[(f64::NAN, 0.0)], LIMITS), found(false, None));
    }

    #[test]
    fn without_an_error_that_is_limited_nothing_is_said() {
        let limits = Limits {
            velocity: Some(1.0),
            ..LIMITS
        };
        assert_eq!(of(&[(0.0, 0.0)], limits), None);
        assert_eq!(of(&[], LIMITS), None);
    }
}
