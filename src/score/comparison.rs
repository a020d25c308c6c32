//! The estimate against the reference: where an error is computed.

use super::ReferenceEpoch;
use crate::solution::{Solution, sigmas};
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::memory::{Memory, Tape};
use fusion_core::state::wrap;
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::collections::VecDeque;

/// The error of the estimate at an epoch of the reference, of all that both have there.
#[derive(Clone, Copy, Debug)]
pub struct EpochError {
    /// The epoch of the reference.
    pub truth: ReferenceEpoch,
    /// Position error at the reference's point, north east down \[m\].
    pub position: Option<Deviation>,
    /// Velocity error at the reference's point, north east down \[m/s\].
    pub velocity: Option<Deviation>,
    /// Attitude and its error.
    pub attitude: Option<AttitudeError>,
}

/// An error of three axes, and what the filter and the reference say of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deviation {
    /// Estimate less reference.
    pub error: Vector3<f64>,
    /// Covariance by the filter.
    pub own: Matrix3<f64>,
    /// Covariance of the reference's own error.
    pub reference: Matrix3<f64>,
}

fusion_core::memory!(Deviation { error, own, reference });

impl Deviation {
    /// 1σ that the error is expected to have, filter and reference together.
    #[must_use]
    pub fn sigma(&self) -> Vector3<f64> {
        sigmas(&(self.own + self.reference))
    }

    /// Whether the filter estimates each axis; one whose variance is exactly 0 is no state.
    #[must_use]
    pub fn is_estimated(&self) -> [bool; 3] {
        self.own.diagonal().map(|v| v != 0.0).into()
    }
}

/// An attitude against that of the reference.
#[derive(Clone, Copy, Debug)]
pub struct AttitudeError {
    /// Estimated q_nb.
    pub estimate: UnitQuaternion<f64>,
    /// That of the reference's body.
    pub truth: UnitQuaternion<f64>,
    /// The rotation from reference to estimate, about the axes of the body \[rad\].
    pub body: Deviation,
    /// Error of roll, pitch, yaw \[rad\], each within ±π.
    pub rpy: Deviation,
}

impl EpochError {
    /// `rate` is the angular rate of the body \[rad/s\], in its axes, where it is known.
    fn new(truth: &ReferenceEpoch, at: &Solution, lever_arm: &Vector3<f64>, rate: Option<Vector3<f64>>) -> Self {
        let there = AtLever::new(at, lever_arm, rate);
        let position = there.position.zip(truth.position).map(|((place, own), truth_place)| Deviation {
            error: place.difference(&truth_place),
            own,
            reference: squares(&truth.sigma.position),
        });
        let velocity = there.velocity.zip(truth.velocity).map(|((v, own), truth_v)| Deviation {
            error: v - truth_v,
            own,
            reference: squares(&truth.sigma.velocity),
        });
        let attitude = at.attitude.zip(truth.attitude);
        Self {
            truth: *truth,
            position,
            velocity,
            attitude: attitude.map(|((q, own), true_q)| AttitudeError::new(q, own, true_q, squares(&truth.sigma.attitude))),
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
            },
            rpy: Deviation {
                error: attitude_error(&estimate, &truth),
                own: e * own * e.transpose(),
                reference: e * reference * e.transpose(),
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
/// Not here  the error of ω; the covariance of a position, velocity or attitude that is no state
///           with another
struct AtLever {
    position: Option<(Geodetic, Matrix3<f64>)>,
    velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
}

impl AtLever {
    /// Without an attitude the body origin stands for the point; where the body may turn, but its
    /// rate is not known, there is no velocity.
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

/// Compares estimates with a reference, as both go on.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The reference's point in body axes \[m\].
    lever_arm: Vector3<f64>,
    /// Epochs that no estimate has reached, in order of time.
    ahead: VecDeque<ReferenceEpoch>,
    /// How many of them were there from the beginning: they are the first.
    given: usize,
    previous: Option<Solution>,
}

/// Epochs that were there from the beginning are not remembered, but how many of them are left.
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
    /// With `epochs` in order of time; the reference's point is `lever_arm` off the body origin,
    /// in body axes \[m\].
    #[must_use]
    pub fn new(lever_arm: Vector3<f64>, epochs: impl IntoIterator<Item = ReferenceEpoch>) -> Self {
        let ahead: VecDeque<ReferenceEpoch> = epochs.into_iter().collect();
        Self {
            lever_arm,
            given: ahead.len(),
            ahead,
            previous: None,
        }
    }

    /// The same without an epoch.
    #[must_use]
    pub fn emptied(&self) -> Self {
        Self::new(self.lever_arm, [])
    }

    /// Adds an epoch, later than those before it: a reference that comes along with the data.
    pub fn push(&mut self, epoch: ReferenceEpoch) {
        self.ahead.push_back(epoch);
    }

    /// Takes the next estimate and tells the reference epochs up to it, each with the error there;
    /// those before the first estimate have none.
    ///
    /// An epoch between two estimates sees the earlier one carried on by its velocity, so that no
    /// measurement after the epoch can flatter it; attitude and velocity, which a measurement
    /// moves little, are interpolated. The angular rate, by which the velocity of a point off the
    /// body origin differs, is that between the two attitudes.
    ///
    /// # Errors
    /// The first that `tell` returns.
    pub fn reach<E>(
        &mut self,
        now: &Solution,
        mut tell: impl FnMut(&ReferenceEpoch, Option<&EpochError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let reached = self.reach_from(now, &mut tell);
        self.previous = Some(*now);
        reached
    }

    /// The same from the previous estimate, which stays.
    fn reach_from<E>(
        &mut self,
        now: &Solution,
        tell: &mut impl FnMut(&ReferenceEpoch, Option<&EpochError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let previous = self.previous.as_ref().unwrap_or(now);
        while let Some(epoch) = self.ahead.pop_front_if(|e| e.time <= now.time) {
            self.given = self.given.saturating_sub(1);
            let is_known = epoch.time >= previous.time;
            let rate = (self.lever_arm != Vector3::zeros()).then(|| previous.rate_to(now)).flatten();
            let error = is_known.then(|| EpochError::new(&epoch, &Solution::between(previous, now, epoch.time), &self.lever_arm, rate));
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

    /// A body that stands on a turntable of 0.5 rad/s, heading `heading` at `t` seconds.
    fn turning(t: f64, heading: f64) -> Solution {
        let q = so3::from_rpy(0.0, 0.0, heading);
        let a = q.to_rotation_matrix().into_inner() * so3::skew(&ARM);
        let p_attitude = Matrix3::identity() * 1e-2;
        Solution {
            time: Time::from_seconds(t),
            // Known by a fix of the point at the lever arm: r = a φ, so that the point has no error.
            position: Some((origin(), a * p_attitude * a.transpose())),
            velocity: Some((Vector3::zeros(), Matrix3::identity())),
            attitude: Some((q, p_attitude)),
            with_attitude: [a * p_attitude, Matrix3::zeros()],
        }
    }

    fn errors(lever_arm: Vector3<f64>) -> EpochError {
        let epoch = ReferenceEpoch {
            time: Time::from_seconds(0.1),
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
            comparison.reach(&turning(t, heading), tell).unwrap();
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
    fn the_covariance_is_that_at_the_point_and_the_reference_has_its_own() {
        let position = errors(ARM).position.unwrap();
        // 1e-6: the curvature of the Earth over two metres.
        assert!((position.error - Vector3::new(2.0, 0.0, 0.0)).amax() < 1e-6, "{position:?}");
        assert!(position.own.amax() < 1e-15, "{position:?}");
        assert!((position.sigma() - Vector3::new(0.1, 0.2, 0.3)).amax() < 1e-15);
    }
}
