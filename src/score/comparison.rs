//! The estimate against the reference: where an error is computed.

use super::ReferenceEpoch;
use crate::solution::Solution;
use fusion_core::geometry::so3;
use fusion_core::state::wrap;
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::collections::VecDeque;

/// The error of the estimate at an epoch of the reference, of all that both have there.
#[derive(Clone, Copy, Debug)]
pub struct EpochError {
    /// The epoch of the reference.
    pub truth: ReferenceEpoch,
    /// Position error at the reference's point and its covariance, north east down \[m\].
    pub position: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Velocity error and its covariance, north east down \[m/s\].
    pub velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Attitude and its error.
    pub attitude: Option<AttitudeError>,
}

/// An attitude against that of the reference.
#[derive(Clone, Copy, Debug)]
pub struct AttitudeError {
    /// Estimated q_nb.
    pub estimate: UnitQuaternion<f64>,
    /// That of the reference's body.
    pub truth: UnitQuaternion<f64>,
    /// Error of roll, pitch, yaw \[rad\], each within ±π.
    pub rpy: Vector3<f64>,
    /// 1σ of roll, pitch, yaw \[rad\].
    pub sigma: Vector3<f64>,
    /// Covariance of the body-frame error \[rad²\].
    pub covariance: Matrix3<f64>,
}

impl EpochError {
    fn new(truth: &ReferenceEpoch, at: &Solution, lever_arm: &Vector3<f64>) -> Self {
        let lever = at.attitude.map_or_else(Vector3::zeros, |(q, _)| q * lever_arm);
        let attitude = at.attitude.zip(truth.attitude).zip(at.rpy());
        Self {
            truth: *truth,
            position: at
                .position
                .zip(truth.position)
                .map(|((place, p), truth)| (place.offset(&lever).difference(&truth), p)),
            velocity: at.velocity.zip(truth.velocity).map(|((v, p), truth)| (v - truth, p)),
            attitude: attitude.map(|(((estimate, covariance), truth), (_, sigma))| AttitudeError {
                estimate,
                truth,
                rpy: attitude_error(&estimate, &truth),
                sigma,
                covariance,
            }),
        }
    }

    /// The instant.
    #[must_use]
    pub const fn time(&self) -> Time {
        self.truth.time
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
    previous: Option<Solution>,
}

impl Comparison {
    /// With `epochs` in order of time; the reference's point is `lever_arm` off the body origin,
    /// in body axes \[m\].
    #[must_use]
    pub fn new(lever_arm: Vector3<f64>, epochs: impl IntoIterator<Item = ReferenceEpoch>) -> Self {
        Self {
            lever_arm,
            ahead: epochs.into_iter().collect(),
            previous: None,
        }
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
    /// moves little, are interpolated.
    ///
    /// # Errors
    /// The first that `tell` returns.
    pub fn reach<E>(
        &mut self,
        now: &Solution,
        mut tell: impl FnMut(&ReferenceEpoch, Option<&EpochError>) -> Result<(), E>,
    ) -> Result<(), E> {
        let previous = self.previous.replace(*now).unwrap_or(*now);
        while let Some(epoch) = self.ahead.pop_front_if(|e| e.time <= now.time) {
            let is_known = epoch.time >= previous.time;
            let error = is_known.then(|| EpochError::new(&epoch, &Solution::between(&previous, now, epoch.time), &self.lever_arm));
            tell(&epoch, error.as_ref())?;
        }
        Ok(())
    }

    /// The epochs that no estimate has reached.
    pub fn rest(&mut self) -> impl Iterator<Item = ReferenceEpoch> {
        self.ahead.drain(..)
    }
}
