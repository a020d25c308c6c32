//! Gravity in the axes of a body that keeps more or less upright.

use super::log::Track;
use super::motion::GRAVITY;
use super::regression::Fit;
use crate::inspect::median;
use fusion_core::math;
use nalgebra::Vector3;

/// The specific force of a body that keeps more or less upright.
pub(super) struct Upright {
    axis: usize,
    negative: bool,
    pub(super) size: f64,
    count: usize,
    steadiness: f64,
}

impl Upright {
    /// Its mean over seconds; `None` if the direction changes too much, or is not along an axis.
    pub(super) fn of(track: &Track) -> Option<Self> {
        let times = track.times.iter().zip(track.times.iter().skip(10));
        let seconds: Vec<Vector3<f64>> = times.step_by(10).filter_map(|(a, b)| track.mean(*a, *b)).collect();
        let size = median(seconds.iter().map(|f| f.norm()));
        let mean = seconds.iter().sum::<Vector3<f64>>() / seconds.len() as f64;
        let axis = mean.iamax();
        let is_along = mean[axis].abs() > UPRIGHT * mean.norm() && mean.norm() > UPRIGHT * size && size > 0.0;
        (is_along && seconds.len() >= 10).then(|| Self {
            axis,
            negative: mean[axis] > 0.0,
            size,
            count: seconds.len(),
            steadiness: mean[axis].abs() / size,
        })
    }

    /// Returns true if the size is clearly not gravity. Walking changes the median by a quarter.
    pub(super) fn is_wrong(&self) -> bool {
        math::ln(self.size / GRAVITY).abs() > 0.5
    }

    pub(super) fn fit(&self) -> Fit {
        let is_declared = self.axis == 2 && !self.negative;
        Fit {
            axis: self.axis,
            negative: self.negative,
            correlation: self.steadiness,
            certainty: f64::INFINITY,
            margin: if is_declared { 0.0 } else { f64::INFINITY },
            factor: if self.is_wrong() { [GRAVITY / self.size; 2] } else { [1.0; 2] },
            along: core::array::from_fn(|axis| match (axis == self.axis, self.negative) {
                (true, true) => f64::NEG_INFINITY,
                (true, false) => f64::INFINITY,
                _ => 0.0,
            }),
            count: self.count,
            parts: self.count,
        }
    }
}

/// An upright body has gravity within 26° of an axis on average: cos 26°.
const UPRIGHT: f64 = 0.9;
