//! Scores: an estimate against a reference, its drift in outages, its consistency.
//!
//! The error of an estimate is computed in one place, [`Comparison`]; whoever wants it takes its
//! [`EpochError`].

mod comparison;
mod consistency;
mod reference;
mod scorer;

pub use comparison::{AttitudeError, Comparison, EpochError, attitude_error};
pub use consistency::{Consistency, Verdict};
pub use reference::{ReferenceEpoch, differentiate};
pub use scorer::{Rules, Scorer};

use serde::Serialize;

/// RMS, mean and largest magnitude per axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Axes {
    /// Root mean square.
    pub rms: [f64; 3],
    /// Mean.
    pub mean: [f64; 3],
    /// Largest magnitude.
    pub max: [f64; 3],
    /// Mean of the filter's own 3σ.
    pub three_sigma: [f64; 3],
    /// Share of the errors inside their own 3σ; 0.997 for a consistent Gaussian filter.
    pub inside: [f64; 3],
}

impl Axes {
    /// Every number being `value`.
    #[must_use]
    pub const fn all(value: f64) -> Self {
        let three = [value; 3];
        Self {
            rms: three,
            mean: three,
            max: three,
            three_sigma: three,
            inside: three,
        }
    }
}

/// The drift over one outage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Start of the outage \[s\].
    pub from: f64,
    /// Its end \[s\].
    pub to: f64,
    /// Largest horizontal error in it \[m\].
    pub max_horizontal: f64,
    /// Largest horizontal error less the one it began with, as vectors \[m\].
    pub growth: f64,
}

/// The result.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Score {
    /// Reference epochs used.
    pub epochs: usize,
    /// Position error, north east down \[m\].
    pub position: Option<Axes>,
    /// RMS of the horizontal error \[m\].
    pub horizontal_rms: f64,
    /// Largest horizontal error \[m\].
    pub horizontal_max: f64,
    /// Velocity error, north east down \[m/s\].
    pub velocity: Option<Axes>,
    /// Attitude error, roll pitch yaw \[deg\].
    pub attitude_deg: Option<Axes>,
    /// RMS of the heading error 2 atan2(|z|, |w|) of q_est ⊗ q_ref* \[deg\]: the turn about the
    /// vertical. With `inclination_rmse_deg` free of gimbal lock; as Laidig et al. 2021 (BROAD).
    pub heading_rmse_deg: Option<f64>,
    /// RMS of the inclination error 2 acos √(w² + z²) \[deg\]: the rest of the turn.
    pub inclination_rmse_deg: Option<f64>,
    /// The mean rotation from body to the reference's body that was taken out, roll pitch yaw \[deg\].
    pub mounting_deg: Option<[f64; 3]>,
    /// NEES of position.
    pub nees_position: Option<Consistency>,
    /// NEES of velocity.
    pub nees_velocity: Option<Consistency>,
    /// NEES of attitude, where no mounting was taken out.
    pub nees_attitude: Option<Consistency>,
    /// Drift per declared outage.
    pub drift: Vec<Drift>,
    /// RMS over the outages of the largest horizontal error \[m\].
    pub drift_rms: Option<f64>,
    /// Median over the outages of the largest horizontal error \[m\].
    pub drift_median: Option<f64>,
}
