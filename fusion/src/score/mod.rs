//! Scores: an estimate against a reference, its drift in outages, its consistency.
//!
//! [`Comparison`] computes the error of an estimate; all scores use its [`EpochError`].

mod attitudes;
mod blocks;
mod bounded;
mod comparison;
mod consistency;
mod convergence;
mod course;
mod drift;
mod episodes;
mod nees;
mod offset;
mod reference;
mod scorer;
mod series;
pub mod trajectory;
mod travelled;

pub use blocks::BlockScore;
pub(crate) use blocks::BlockScorer;
pub(crate) use bounded::Quantiles;
pub use comparison::{AttitudeError, Comparison, Deviation, EpochError, attitude_error};
pub use consistency::{Consistency, ConsistencyVerdict, Moments, OverRuns};
pub use convergence::{Convergence, Limits};
pub use course::Course;
pub use drift::{Drift, Moved, Outage};
pub use episodes::{Episodes, PartScore};
pub use nees::of as nees_of;
pub use offset::Offset;
pub(crate) use reference::differentiate;
pub use reference::{ReferenceEpoch, ReferenceSigma};
pub use scorer::median;
pub(crate) use scorer::{Rules, Scorer};
pub use series::Series;
pub use trajectory::{Trajectory, TrajectoryRules};
pub use travelled::Travelled;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// RMS, mean and largest magnitude per axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Axes {
    /// Root mean square.
    #[schemars(with = "[Option<f64>; 3]")]
    pub rms: [f64; 3],
    /// Mean.
    #[schemars(with = "[Option<f64>; 3]")]
    pub mean: [f64; 3],
    /// Largest magnitude.
    #[schemars(with = "[Option<f64>; 3]")]
    pub max: [f64; 3],
    /// The time of the largest magnitude \[s\].
    #[schemars(with = "[Option<f64>; 3]")]
    pub max_time: [f64; 3],
    /// Mean of the expected 3σ of the errors, from the filter and the reference's own error.
    #[schemars(with = "[Option<f64>; 3]")]
    pub three_sigma: [f64; 3],
    /// Share of the errors inside this 3σ; 0.997 for a consistent Gaussian filter. NaN for an axis that the filter does
    /// not estimate.
    #[schemars(with = "[Option<f64>; 3]")]
    pub inside: [f64; 3],
}

impl Axes {
    /// All numbers equal to `value`.
    #[must_use]
    pub const fn all(value: f64) -> Self {
        let three = [value; 3];
        Self {
            rms: three,
            mean: three,
            max: three,
            max_time: three,
            three_sigma: three,
            inside: three,
        }
    }
}

/// Median and 95 % of the length of an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct LengthSpread {
    /// The median over the epochs.
    pub median: f64,
    /// The 95 % quantile over the epochs.
    pub p95: f64,
}

impl LengthSpread {
    pub(crate) fn of(lengths: &mut Quantiles) -> Option<Self> {
        let [median, p95] = [0.5, 0.95].map(|share| lengths.within(share));
        let (median, p95) = median.zip(p95)?;
        Some(Self { median, p95 })
    }

    /// Converted to another unit.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            median: factor * self.median,
            p95: factor * self.p95,
        }
    }
}

/// Median and 95 % of each error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Spreads {
    /// Length of the position error \[m\].
    pub position: Option<LengthSpread>,
    /// Length of its horizontal part \[m\].
    pub horizontal: Option<LengthSpread>,
    /// Length of the velocity error \[m/s\].
    pub velocity: Option<LengthSpread>,
    /// Angle between the two attitudes \[deg\].
    pub rotation_deg: Option<LengthSpread>,
    /// Rotation about the vertical \[deg\].
    pub heading_deg: Option<LengthSpread>,
}

/// The result.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct Score {
    /// Reference epochs used.
    pub epochs: usize,
    /// Position error, north east down \[m\]; NaN along an axis that the reference does not know.
    pub position: Option<Axes>,
    /// RMS of the horizontal error \[m\]; NaN without a position.
    #[schemars(with = "Option<f64>")]
    pub horizontal_rms: f64,
    /// Largest horizontal error \[m\]; NaN without a position.
    #[schemars(with = "Option<f64>")]
    pub horizontal_max: f64,
    /// Median of the horizontal error \[m\].
    pub horizontal_median: Option<f64>,
    /// The horizontal error that 95 % of the epochs do not exceed \[m\].
    pub horizontal_p95: Option<f64>,
    /// The change of the horizontal error relative to the distance travelled; `None` below 50 m.
    pub travelled: Option<Travelled>,
    /// The part of the horizontal error that a constant offset in body axes explains; `None` without an attitude.
    pub offset: Option<Offset>,
    /// Velocity error, north east down \[m/s\].
    pub velocity: Option<Axes>,
    /// Attitude error, roll pitch yaw \[deg\].
    pub attitude_deg: Option<Axes>,
    /// The heading that agrees with the course of the reference's velocity; `None` without both, or without motion.
    pub course: Option<Course>,
    /// Epochs with a pitch beyond 80°, where roll and yaw are not judged.
    pub steep: usize,
    /// RMS of the heading error 2 atan2(|z|, |w|) of q_est ⊗ q_ref* \[deg\]: the rotation about the vertical. Like
    /// `inclination_rmse_deg` it has no gimbal lock; as Laidig et al. 2021 (BROAD).
    pub heading_rmse_deg: Option<f64>,
    /// RMS of the inclination error 2 acos √(w² + z²) \[deg\]: the rest of the rotation.
    pub inclination_rmse_deg: Option<f64>,
    /// RMS of the length of the position error \[m\].
    pub position_rmse_m: Option<f64>,
    /// RMS of the angle of the rotation between the two attitudes \[deg\].
    pub rotation_rmse_deg: Option<f64>,
    /// The mean rotation from body to the reference's body that was removed, roll pitch yaw \[deg\].
    pub mounting_deg: Option<[f64; 3]>,
    /// NEES of position; with two degrees of freedom if the reference has no height.
    pub nees_position: Option<Consistency>,
    /// NEES of height or depth, if the reference has only this.
    pub nees_height: Option<Consistency>,
    /// NEES of velocity.
    pub nees_velocity: Option<Consistency>,
    /// NEES of attitude, if no mounting was removed.
    pub nees_attitude: Option<Consistency>,
    /// Epochs at which the NEES of position, velocity, attitude was not defined. The covariance was not positive
    /// semidefinite, a number was not finite, or fewer directions were estimated than at other epochs.
    pub nees_undefined: [usize; 3],
    /// Median and 95 % of the lengths of the errors.
    pub spread: Spreads,
    /// Absolute and relative errors of the trajectory; `None` for fewer than two positions. For one run of many, only
    /// if the design asks for it.
    pub trajectory: Option<Trajectory>,
    /// Convergence: the time from which the errors stay within the declared limits.
    pub convergence: Option<Convergence>,
    /// The score inside and outside the declared episodes; `None` without declared episodes.
    pub episodes: Option<Episodes>,
    /// Each block of the state whose truth a simulation knows.
    pub blocks: Vec<BlockScore>,
    /// Drift per declared outage.
    pub drift: Vec<Drift>,
    /// RMS over the outages of the largest horizontal error \[m\].
    pub drift_rms: Option<f64>,
    /// Median over the outages of the largest horizontal error \[m\].
    pub drift_median: Option<f64>,
}
