//! Compares the estimate with the reference. All errors are computed here.

use super::ReferenceEpoch;
use crate::solution::{Solution, sigmas};
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::state::wrap;
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::collections::VecDeque;

/// The error of the estimate at an epoch of the reference, for all quantities that both have.
#[derive(Clone, Copy, Debug)]
pub struct EpochError {
    /// The epoch of the reference.
    pub truth: ReferenceEpoch,
    /// The estimated and the reference position of the reference's point. The estimate replaces unknown parts of the
    /// reference.
    pub places: Option<[Geodetic; 2]>,
    /// Position error at the reference's point, north east down \[m\].
    pub position: Option<Deviation>,
    /// Velocity error at the reference's point, north east down \[m/s\].
    pub velocity: Option<Deviation>,
    /// Attitude and its error.
    pub attitude: Option<AttitudeError>,
    /// Estimated attitude q_nb and velocity of the body; they do not need values of the reference.
    pub motion: Option<(UnitQuaternion<f64>, Vector3<f64>)>,
}

/// An error of three axes, with its covariances by the filter and by the reference.
#[derive(Clone, Copy, Debug)]
pub struct Deviation {
    /// Estimate minus reference; 0 along an axis that the reference does not know.
    pub error: Vector3<f64>,
    /// Covariance by the filter.
    pub own: Matrix3<f64>,
    /// Covariance of the reference's own error.
    pub reference: Matrix3<f64>,
    /// For each axis, true if the reference knows it.
    pub known: [bool; 3],
}

fusion_core::memory!(Deviation {
    error,
    own,
    reference,
    known
});

impl Default for Deviation {
    /// No error along three known axes.
    fn default() -> Self {
        Self {
            error: Vector3::zeros(),
            own: Matrix3::zeros(),
            reference: Matrix3::zeros(),
            known: [true; 3],
        }
    }
}

impl Deviation {
    /// The expected 1σ of the error, from filter and reference together.
    #[must_use]
    pub fn sigma(&self) -> Vector3<f64> {
        sigmas(&(self.own + self.reference))
    }

    /// For each axis that the reference knows, true if the filter estimates it. A variance of exactly 0 means that it
    /// is not a state.
    #[must_use]
    pub fn is_estimated(&self) -> [bool; 3] {
        core::array::from_fn(|k| self.known[k] && self.own[(k, k)] != 0.0)
    }

    /// The length of the horizontal error, and the 1σ along its direction.
    #[must_use]
    pub fn horizontal(&self) -> (f64, f64) {
        let e = self.error.xy();
        let p = (self.own + self.reference).fixed_view::<2, 2>(0, 0).into_owned();
        let length = e.norm();
        // An error of exactly 0 has no direction.
        let variance = if length > 0.0 {
            (p * e).dot(&e) / (length * length)
        } else {
            p.trace() / 2.0
        };
        (length, math::sqrt(variance))
    }

    /// Returns true if the reference knows every axis.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.known == [true; 3]
    }

    /// Returns true if it knows north and east.
    #[must_use]
    pub fn is_horizontal(&self) -> bool {
        self.known[0] && self.known[1]
    }
}

/// The estimated attitude compared with the reference.
#[derive(Clone, Copy, Debug)]
pub struct AttitudeError {
    /// Estimated q_nb.
    pub estimate: UnitQuaternion<f64>,
    /// The attitude of the reference's body.
    pub truth: UnitQuaternion<f64>,
    /// The rotation from reference to estimate, about the axes of the body \[rad\].
    pub body: Deviation,
    /// Error of roll, pitch, yaw \[rad\], each within ±π.
    pub rpy: Deviation,
}

impl EpochError {
    /// `rate` is the angular rate of the body in body axes \[rad/s\], if known.
    fn new(truth: &ReferenceEpoch, at: &Solution, lever_arm: &Vector3<f64>, rate: Option<Vector3<f64>>) -> Self {
        let there = AtLever::new(at, lever_arm, rate);
        let position = there.position.and_then(|(place, own)| {
            let (truth_place, known) = truth.position_beside(&place)?;
            let deviation = Deviation {
                error: place.difference(&truth_place),
                own,
                reference: squares(&truth.sigma.position),
                known,
            };
            Some((deviation, [place, truth_place]))
        });
        let (position, places) = position.unzip();
        let velocity = there.velocity.zip(truth.velocity).map(|((v, own), truth_v)| {
            let known: [bool; 3] = truth_v.map(f64::is_finite).into();
            Deviation {
                error: Vector3::from_fn(|k, _| if known[k] { v[k] - truth_v[k] } else { 0.0 }),
                own,
                reference: squares(&truth.sigma.velocity),
                known,
            }
        });
        let attitude = at.attitude.zip(truth.attitude);
        Self {
            truth: *truth,
            places,
            position,
            velocity,
            attitude: attitude.map(|((q, own), true_q)| AttitudeError::new(q, own, true_q, squares(&truth.sigma.attitude))),
            motion: at.attitude.zip(at.velocity).map(|((q, _), (v, _))| (q, v)),
        }
    }

    /// The instant.
    #[must_use]
    pub const fn time(&self) -> Time {
        self.truth.time
    }
}

impl AttitudeError {
    fn new(estimate: UnitQuaternion<f64>, own: Matrix3<f64>, truth: UnitQuaternion<f64>, reference: Matrix3<f64>) -> Self {
        let rpy = so3::to_rpy(&estimate);
        let e = so3::euler_rate_of_body(rpy.x, rpy.y);
        Self {
            estimate,
            truth,
            body: Deviation {
                error: so3::log(&(truth.inverse() * estimate)),
                own,
                reference,
                known: [true; 3],
            },
            rpy: Deviation {
                error: attitude_error(&estimate, &truth),
                own: e * own * e.transpose(),
                reference: e * reference * e.transpose(),
                known: [true; 3],
            },
        }
    }
}

fn squares(sigma: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(&sigma.component_mul(sigma))
}

/// Position and velocity of a point of the body, with their covariances.
///
/// Position  r + C l, δ: I, −C [l×] on the attitude error in body axes
/// Velocity  v + C (ω × l), δ: I, −C [(ω × l)×]
/// Not here  the error of ω; the cross-covariance of a position, velocity or attitude that is not a state
struct AtLever {
    position: Option<(Geodetic, Matrix3<f64>)>,
    velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
}

impl AtLever {
    /// Without an attitude, the body origin replaces the point. The velocity is missing if the body may rotate but
    /// its rate is unknown.
    fn new(at: &Solution, lever_arm: &Vector3<f64>, rate: Option<Vector3<f64>>) -> Self {
        let Some((q, p_attitude)) = at.attitude.filter(|_| *lever_arm != Vector3::zeros()) else {
            return Self {
                position: at.position,
                velocity: at.velocity,
            };
        };
        let c = q.to_rotation_matrix().into_inner();
        let moved = |p: Matrix3<f64>, with_attitude: &Matrix3<f64>, arm: &Vector3<f64>| {
            let j = -c * so3::skew(arm);
            let cross = with_attitude * j.transpose();
            p + cross + cross.transpose() + j * p_attitude * j.transpose()
        };
        let [with_position, with_velocity] = &at.with_attitude;
        Self {
            position: at
                .position
                .map(|(r, p)| (r.offset(&(c * lever_arm)), moved(p, with_position, lever_arm))),
            velocity: at.velocity.zip(rate).map(|((v, p), w)| {
                let turning = w.cross(lever_arm);
                (v + c * turning, moved(p, with_velocity, &turning))
            }),
        }
    }
}

/// Error of roll, pitch, yaw \[rad\] of `q` against `truth`, each within ±π.
#[must_use]
pub fn attitude_error(q: &UnitQuaternion<f64>, truth: &UnitQuaternion<f64>) -> Vector3<f64> {
    (so3::to_rpy(q) - so3::to_rpy(truth)).map(wrap)
}

/// Compares estimates with a reference, while both arrive.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The point of each source of the reference in body axes \[m\].
    points: Vec<Vector3<f64>>,
    /// Epochs that no estimate has reached, in order of time.
    ahead: VecDeque<ReferenceEpoch>,
    /// The number of epochs that were given at the start: they are the first.
    given: usize,
    previous: Option<Solution>,
}

/// Epochs that were given at the start are not saved, only the number of them that are left.
impl Memory for Comparison {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut left = self.given;
        left.remember(tape);
        if left > self.given {
            tape.refuse("the reference has fewer epochs");
            return;
        }
        self.ahead.drain(..self.given - left);
        self.given = left;
        let mut pushed = self.ahead.split_off(left);
        pushed.remember(tape);
        self.ahead.append(&mut pushed);
        self.previous.remember(tape);
    }
}

impl Comparison {
    /// Compares with `epochs`, in order of time. The reference's point is at `lever_arm` from the body origin, in body
    /// axes \[m\].
    #[must_use]
    pub fn new(lever_arm: Vector3<f64>, epochs: impl IntoIterator<Item = ReferenceEpoch>) -> Self {
        Self::of_points(vec![lever_arm], epochs)
    }

    /// As `new`, for a reference with several sources, each with its own point.
    #[must_use]
    pub fn of_points(points: Vec<Vector3<f64>>, epochs: impl IntoIterator<Item = ReferenceEpoch>) -> Self {
        let ahead: VecDeque<ReferenceEpoch> = epochs.into_iter().collect();
        Self {
            points,
            given: ahead.len(),
            ahead,
            previous: None,
        }
    }

    /// The same comparison without an epoch.
    #[must_use]
    pub fn emptied(&self) -> Self {
        Self::of_points(self.points.clone(), [])
    }

    /// Returns true if the point of a source of the reference moves when the body rotates.
    #[must_use]
    pub(crate) fn wants_rate(&self) -> bool {
        self.points.iter().any(|point| *point != Vector3::zeros())
    }

    /// Adds an epoch, later than all before: for a reference that arrives with the data.
    pub fn push(&mut self, epoch: ReferenceEpoch) {
        self.ahead.push_back(epoch);
    }

    /// The filter restarts: its earlier estimate is not valid for the epochs up to the restart.
    pub fn begin(&mut self) {
        self.previous = None;
    }

    /// Takes the next estimate and reports the reference epochs up to it, each with its error. Epochs before the first
    /// estimate since the last start have no error.
    ///
    /// For an epoch between two estimates, the earlier position is propagated by its velocity. So no measurement after
    /// the epoch can improve the error. Attitude and velocity, which a measurement changes little, are interpolated.
    /// `rate` is the mean angular rate w_nb_b \[rad/s\] since the previous estimate. It gives the velocity of a point
    /// that is not at the body origin.
    ///
    /// # Errors
    /// The first error that `tell` returns.
    pub fn reach<E>(
        &mut self,
        now: &Solution,
        rate: Option<Vector3<f64>>,
        mut tell: impl FnMut(&ReferenceEpoch, Option<&EpochError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let reached = self.reach_from(now, rate, &mut tell);
        self.previous = Some(*now);
        reached
    }

    /// The same from the previous estimate, which does not change.
    fn reach_from<E>(
        &mut self,
        now: &Solution,
        rate: Option<Vector3<f64>>,
        tell: &mut impl FnMut(&ReferenceEpoch, Option<&EpochError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let previous = self.previous.as_ref().unwrap_or(now);
        while let Some(epoch) = self.ahead.pop_front_if(|e| e.time <= now.time) {
            self.given = self.given.saturating_sub(1);
            let is_known = epoch.time >= previous.time;
            let point = self.points.get(epoch.source).copied().unwrap_or_default();
            let error = is_known.then(|| EpochError::new(&epoch, &Solution::between(previous, now, epoch.time), &point, rate));
            tell(&epoch, error.as_ref())?;
        }
        Ok(())
    }

    /// The epochs that no estimate has reached.
    pub fn rest(&mut self) -> impl Iterator<Item = ReferenceEpoch> {
        self.given = 0;
        self.ahead.drain(..)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: Vector3<f64> = Vector3::new(2.0, 0.0, 0.0);

    fn origin() -> Geodetic {
        Geodetic {
            lat: 0.6,
            lon: 0.1,
            height: 0.0,
        }
    }

    /// A body on a turntable at 0.5 rad/s, with heading `heading` at `t` seconds.
    fn turning(t: f64, heading: f64) -> Solution {
        let q = so3::from_rpy(0.0, 0.0, heading);
        let a = q.to_rotation_matrix().into_inner() * so3::skew(&ARM);
        let p_attitude = Matrix3::identity() * 1e-2;
        Solution {
            time: Time::from_seconds(t),
            // A fix of the point at the lever arm gives the position: r = a φ. So the point has no error.
            position: Some((origin(), a * p_attitude * a.transpose())),
            velocity: Some((Vector3::zeros(), Matrix3::identity())),
            attitude: Some((q, p_attitude)),
            with_attitude: [a * p_attitude, Matrix3::zeros()],
        }
    }

    fn errors(lever_arm: Vector3<f64>) -> EpochError {
        let epoch = ReferenceEpoch {
            time: Time::from_seconds(0.1),
            source: 0,
            position: Some(origin()),
            velocity: Some(Vector3::zeros()),
            attitude: Some(so3::from_rpy(0.0, 0.0, 0.0)),
            sigma: super::super::ReferenceSigma {
                position: Vector3::new(0.1, 0.2, 0.3),
                ..Default::default()
            },
        };
        let mut comparison = Comparison::new(lever_arm, [epoch]);
        let mut found = None;
        for (t, heading) in [(0.0, -0.05), (0.1, 0.0)] {
            let tell = |_: &ReferenceEpoch, error: Option<&EpochError>| {
                found = error.copied();
                Ok::<_, core::convert::Infallible>(())
            };
            comparison
                .reach(&turning(t, heading), Some(Vector3::new(0.0, 0.0, 0.5)), tell)
                .unwrap();
        }
        found.unwrap()
    }

    #[test]
    fn a_point_off_the_body_origin_moves_with_the_turning_body() {
        let velocity = errors(ARM).velocity.unwrap();
        // 0.5 rad/s to the right: 2 m ahead moves east at 1 m/s. 1e-12: rounding of the rate.
        assert!((velocity.error - Vector3::new(0.0, 1.0, 0.0)).amax() < 1e-12, "{velocity:?}");
        // A heading error of 0.1 rad turns it by 0.1 m/s north.
        let expected = Matrix3::from_diagonal(&Vector3::new(1.01, 1.0, 1.01));
        assert!((velocity.own - expected).amax() < 1e-12, "{velocity:?}");
        assert_eq!(errors(Vector3::zeros()).velocity.unwrap().error, Vector3::zeros());
    }

    #[test]
    fn an_axis_that_the_reference_does_not_know_has_no_error_and_no_degree_of_freedom() {
        let nothing = Geodetic::new(f64::NAN, f64::NAN, f64::NAN);
        let truth = origin().offset(&Vector3::new(-3.0, 4.0, -7.0));
        let horizontal = Geodetic { height: f64::NAN, ..truth };
        let height = Geodetic {
            height: truth.height,
            ..nothing
        };
        let at = Solution {
            position: Some((origin(), Matrix3::identity())),
            ..Solution::default()
        };
        let [flat, deep] = [horizontal, height].map(|position| {
            let epoch = ReferenceEpoch {
                position: Some(position),
                ..ReferenceEpoch::default()
            };
            let error = EpochError::new(&epoch, &at, &Vector3::zeros(), None);
            error.position.unwrap()
        });
        // 1e-5: two charts of the ellipsoid metres apart.
        assert!((flat.error - Vector3::new(3.0, -4.0, 0.0)).amax() < 1e-5, "{flat:?}");
        assert!((deep.error - Vector3::new(0.0, 0.0, 7.0)).amax() < 1e-9, "{deep:?}");
        let [(flat_nees, two), (deep_nees, one)] = [flat, deep].map(|d| super::super::nees_of(&d).unwrap());
        assert!((flat_nees - 25.0).abs() < 1e-4 && (deep_nees - 49.0).abs() < 1e-6);
        assert_eq!(
            ((two, one), flat.is_estimated(), deep.known),
            ((2, 1), [true, true, false], [false, false, true])
        );
    }

    #[test]
    fn each_source_of_a_reference_has_its_own_point() {
        let epoch = |source| ReferenceEpoch {
            source,
            position: Some(origin()),
            ..ReferenceEpoch::default()
        };
        let mut comparison = Comparison::of_points(vec![Vector3::zeros(), ARM], [epoch(0), epoch(1)]);
        let mut north = Vec::new();
        let tell = |_: &ReferenceEpoch, error: Option<&EpochError>| {
            north.extend(error.and_then(|e| e.position).map(|d| d.error.x));
            Ok::<_, core::convert::Infallible>(())
        };
        comparison.reach(&turning(0.0, 0.0), None, tell).unwrap();
        // 1e-6: the curvature of the Earth over two metres.
        assert!(north.len() == 2 && north[0] == 0.0 && (north[1] - 2.0).abs() < 1e-6, "{north:?}");
    }

    #[test]
    fn the_covariance_is_that_at_the_point_and_the_reference_has_its_own() {
        let position = errors(ARM).position.unwrap();
        // 1e-6: the curvature of the Earth over two metres.
        assert!((position.error - Vector3::new(2.0, 0.0, 0.0)).amax() < 1e-6, "{position:?}");
        assert!(position.own.amax() < 1e-15, "{position:?}");
        assert!((position.sigma() - Vector3::new(0.1, 0.2, 0.3)).amax() < 1e-15);
    }
}
