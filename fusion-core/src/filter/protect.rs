//! The share of a correction that calibrations get from a sensor with larger errors than it declares.
//!
//! A receiver that has just started may err by several times its declared σ for minutes. Position and velocity follow
//! it and come back. A lever arm that was estimated in this time has become certain, and stays wrong.
//!
//! Excess    k² of a sensor is the mean of NIS/m over its latest measurements, used or not. It counts where it is above
//!           the quantile of its χ² at the probability 0.999, so that a filter with true noises is as it would be
//! Outlier   a NIS/m beyond that quantile for one measurement, times k² or 1, counts as that
//! Update    where k² counts, the gain is K for the motion and K/k² for the calibrations. That is the gain for
//!           innovations of the covariance k² S
//! P         P⁺ = P − KSKᵀ, but P − KSKᵀ/k² among the calibrations
//! Not used  the correlation of neighbours: that of a wrong calibration is as large as that of a wrong sensor
//! Source    the quantile by Wilson and Hilferty 1931; the update in part by Brink 2017, Partial-update
//!           Schmidt-Kalman filter; for k → ∞ it is that of Schmidt 1966

use super::kalman::Filter;
use crate::math;
use crate::state::{Block, Layout, StateRole};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Standard normal quantile of the probability 0.999.
const EXPLAINED: f64 = 3.090_232_306_167_813;
/// Measurements that the mean is taken of: it is known to 8 % where they have three rows.
const WINDOW: f64 = 100.0;

/// The latest innovations of each sensor, and the axes to protect.
#[derive(Clone, Debug)]
pub(super) struct Protection {
    axes: Arc<[usize]>,
    sensors: Vec<Lately>,
}
crate::memory!(Protection { sensors; axes });

/// Of one sensor: the mean of NIS/m, of how many measurements, and the share that it leaves.
#[derive(Clone, Copy, Debug)]
struct Lately {
    mean: f64,
    count: f64,
    share: f64,
}
crate::memory!(Lately { mean, count, share });

impl Default for Lately {
    fn default() -> Self {
        Self {
            mean: 0.0,
            count: 0.0,
            share: 1.0,
        }
    }
}

/// The largest mean of `numbers` squares of a standard normal variable that chance explains.
fn explained(numbers: f64) -> f64 {
    let spread = 2.0 / (9.0 * numbers);
    math::powi(1.0 - spread + EXPLAINED * math::sqrt(spread), 3)
}

impl Lately {
    fn hear(&mut self, nis: f64, rows: f64) {
        let most = explained(rows) * self.mean.max(1.0);
        self.count = (self.count + 1.0).min(WINDOW);
        self.mean += ((nis / rows).min(most) - self.mean) / self.count;
        let counts = self.mean > explained(rows * self.count);
        self.share = if counts { 1.0 / self.mean } else { 1.0 };
    }
}

impl Protection {
    /// For the calibrations of `layout`, or for none where `is_wanted` is false.
    pub(super) fn of(layout: &Layout, is_wanted: bool) -> Self {
        let is_protected = |b: &&Block| is_wanted && b.role == StateRole::Calibration;
        let calibrations = layout.blocks().iter().filter(is_protected);
        Self {
            axes: calibrations.flat_map(|b| b.tangent_range()).collect(),
            sensors: Vec::new(),
        }
    }

    /// Forgets what was.
    pub(super) fn start(&mut self) {
        self.sensors.clear();
    }

    /// Hears the NIS of a measurement of `rows` rows, used or not.
    pub(super) fn hear(&mut self, sensor: usize, nis: f64, rows: usize) {
        if self.axes.is_empty() {
            return;
        }
        if self.sensors.len() <= sensor {
            self.sensors.resize(sensor + 1, Lately::default());
        }
        self.sensors[sensor].hear(nis, rows as f64);
    }

    /// The share of the gain that calibrations get, 1/k².
    pub(super) fn share(&self, sensor: usize) -> f64 {
        self.sensors.get(sensor).map_or(1.0, |lately| lately.share)
    }
}

impl Filter {
    /// Reduces the correction of the calibrations to its `share`, and the loss of their variance as well.
    pub(super) fn protect(&mut self, share: f64) {
        let (axes, m) = (&self.protection.axes, self.work.rows);
        let work = &self.work.work;
        let (kt, ld) = (work.kt(), work.ld);
        self.transition.reset();
        for &a in axes.iter() {
            self.work.correction[a] *= share;
            for &b in axes.iter() {
                let of_row = |i: usize| (0..m).map(|j| work.s[i * m + j] * kt[j * ld + b]).sum::<f64>();
                let kept: f64 = (0..m).map(|i| kt[i * ld + a] * of_row(i)).sum();
                self.transition.after.element(a, b, (1.0 - share) * kept);
            }
        }
        self.belief.covariance.predict(&self.transition, &mut self.work.work);
    }
}
