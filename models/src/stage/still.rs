//! The stillness test: short-time statistics of an IMU at rest.
//!
//! A causal window is still if the standard deviation of specific force and angular rate is within
//! its bound on every axis, and the mean rate minus the bias too. Engines and waves shake some axes
//! more than others, so each bound is per axis.
//! Source: Skog et al. 2010 (variance detectors), with the mean-rate test for slow turns.

use alloc::collections::VecDeque;
use alloc::string::String;
use alloc::vec::Vec;
use fusion_core::math;
use fusion_core::model::Literal;
use nalgebra::Vector3;

/// A sliding window of rate and force with its sums.
#[derive(Clone, Debug, Literal)]
pub struct StillTest {
    window: f64,
    accel_std: Vector3<f64>,
    gyro_std: Vector3<f64>,
    mean_rate: Vector3<f64>,
    samples: VecDeque<(f64, Vector3<f64>, Vector3<f64>)>,
    sum: [Vector3<f64>; 2],
    squares: [Vector3<f64>; 2],
    origin: Option<[Vector3<f64>; 2]>,
    /// The full window that was nearest to still: standard deviations of rate and force, mean rate minus the bias.
    nearest: Option<[Vector3<f64>; 3]>,
}
fusion_core::memory!(StillTest { samples, sum, squares, origin, nearest; window, accel_std, gyro_std, mean_rate });

impl StillTest {
    /// Adds a sample: time \[s\], angular rate \[rad/s\], specific force \[m/s²\].
    pub fn push(&mut self, time: f64, w: Vector3<f64>, f: Vector3<f64>) {
        // NaN would stay in the sums forever: the window starts again after it.
        if !w.iter().chain(f.iter()).all(|v| v.is_finite()) {
            self.samples.clear();
            (self.sum, self.squares, self.origin) = Default::default();
            return;
        }
        // The sums are relative to the first sample, so that squares do not cancel.
        let origin = *self.origin.get_or_insert([w, f]);
        self.samples.push_back((time, w, f));
        self.add([w - origin[0], f - origin[1]], 1.0);
        while let Some(&(t, w, f)) = self.samples.front() {
            if time - t < self.window {
                break;
            }
            self.samples.pop_front();
            self.add([w - origin[0], f - origin[1]], -1.0);
        }
    }

    fn add(&mut self, d: [Vector3<f64>; 2], sign: f64) {
        for ((sum, squares), d) in self.sum.iter_mut().zip(&mut self.squares).zip(d) {
            *sum += d * sign;
            *squares += d.component_mul(&d) * sign;
        }
    }

    /// Mean rate and force over the window.
    #[must_use]
    pub fn means(&self) -> [Vector3<f64>; 2] {
        let n = self.samples.len().max(1) as f64;
        let origin = self.origin.unwrap_or_default();
        [origin[0] + self.sum[0] / n, origin[1] + self.sum[1] / n]
    }

    /// Standard deviations of rate \[rad/s\] and force \[m/s²\] over the window, per axis.
    #[must_use]
    pub fn deviations(&self) -> [Vector3<f64>; 2] {
        let n = self.samples.len().max(1) as f64;
        core::array::from_fn(|k| {
            let mean = self.sum[k] / n;
            (self.squares[k] / n - mean.component_mul(&mean)).map(|v| math::sqrt(v.max(0.0)))
        })
    }

    /// How far the window is from still, given the gyro bias \[rad/s\], as shares of the bounds: the largest standard
    /// deviation of rate, that of force, and the largest mean rate.
    #[must_use]
    pub fn unrest(&self, gyro_bias: &Vector3<f64>) -> [f64; 3] {
        self.shares(&self.figures(gyro_bias)).map(|share| share.max())
    }

    /// The values that are compared with the bounds.
    fn figures(&self, gyro_bias: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let [w, f] = self.deviations();
        [w, f, (self.means()[0] - gyro_bias).abs()]
    }

    /// The values as shares of the bounds.
    fn shares(&self, figures: &[Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        let bounds = [self.gyro_std, self.accel_std, self.mean_rate];
        core::array::from_fn(|k| figures[k].component_div(&bounds[k]))
    }

    /// The bounds that every judged window exceeded: the values of the window nearest to still, and their bounds.
    /// `None` if a window was still, or no window was full.
    #[must_use]
    pub fn missed(&self) -> Option<String> {
        let nearest = self.nearest.as_ref()?;
        let shares = self.shares(nearest);
        let kinds = [
            ("gyro_std", "deg/s", 1_f64.to_degrees()),
            ("accel_std", "m/s²", 1.0),
            ("mean_rate", "deg/s", 1_f64.to_degrees()),
        ];
        let missed = (0..3).filter(|k| shares[*k].max() > 1.0).map(|k| {
            let (axis, (name, unit, factor)) = (shares[k].imax(), kinds[k]);
            let value = nearest[k][axis];
            let [value, bound] = [value, value / shares[k][axis]].map(|v| two_digits(factor * v));
            format!("{value} {unit} where `still.{name}` allows {bound}")
        });
        let missed: Vec<String> = missed.collect();
        (!missed.is_empty()).then(|| format!("the quietest window has {}", missed.join(", and ")))
    }

    /// Returns true if the window is full and still, given the gyro bias \[rad/s\].
    #[must_use]
    pub fn is_still(&mut self, gyro_bias: &Vector3<f64>) -> bool {
        let (Some(first), Some(last)) = (self.samples.front(), self.samples.back()) else {
            return false;
        };
        let n = self.samples.len() as f64;
        // n samples cover n intervals; n − 1 of them are between the samples.
        let full = n >= 4.0 && (last.0 - first.0) * n / (n - 1.0) >= 0.9 * self.window;
        if !full {
            return false;
        }
        let figures = self.figures(gyro_bias);
        let most = |figures: &[Vector3<f64>; 3]| self.shares(figures).iter().map(Vector3::max).fold(0.0, f64::max);
        let unrest = most(&figures);
        let is_nearer = self.nearest.as_ref().is_none_or(|nearest| unrest < most(nearest));
        if is_nearer {
            self.nearest = Some(figures);
        }
        unrest <= 1.0
    }
}

/// Two significant digits.
fn two_digits(value: f64) -> String {
    let decimals = (1.0 - math::floor(math::log10(value.abs()))).clamp(0.0, 9.0);
    format!("{value:.*}", decimals as usize)
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::units::{Axes, Positive, dim, range};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Bounds of the stillness test.
    #[derive(Clone, Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct StillSpec {
        /// Length of the causal window.
        #[serde(default = "one_second")]
        pub window: Positive<dim::Duration>,
        /// Largest standard deviation of specific force over the window, per axis.
        pub accel_std: Axes<dim::Acceleration, range::Positive>,
        /// Largest standard deviation of angular rate over the window, per axis.
        pub gyro_std: Axes<dim::AngularRate, range::Positive>,
        /// Largest mean rate minus the bias over the window, per axis.
        #[serde(default = "fast")]
        pub mean_rate: Axes<dim::AngularRate, range::Positive>,
    }

    fn one_second() -> Positive<dim::Duration> {
        Positive::try_from_si(1.0).unwrap_or_else(|_| unreachable!("one is positive"))
    }

    fn fast() -> Axes<dim::AngularRate, range::Positive> {
        // Without declared bounds: so wide that they never decide.
        [Positive::try_from_si(1e3).unwrap_or_else(|_| unreachable!("it is positive")); 3].into()
    }

    impl StillTest {
        /// A test with the declared bounds.
        #[must_use]
        pub fn new(spec: &StillSpec) -> Self {
            Self {
                window: spec.window.si(),
                accel_std: spec.accel_std.si().into(),
                gyro_std: spec.gyro_std.si().into(),
                mean_rate: spec.mean_rate.si().into(),
                samples: VecDeque::new(),
                sum: [Vector3::zeros(); 2],
                squares: [Vector3::zeros(); 2],
                origin: None,
                nearest: None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn test() -> StillTest {
        let spec: StillSpec = toml::from_str(
            r#"accel_std = "0.2 m/s^2"\ngyro_std = ["1 rad/s", "1 rad/s", 0.004]\nmean_rate = 0.02"#
                .replace("\\n", "\n")
                .as_str(),
        )
        .unwrap();
        StillTest::new(&spec)
    }

    #[test]
    fn a_quiet_full_window_is_still_and_a_short_one_is_not() {
        let mut t = test();
        for k in 0..50 {
            t.push(k as f64 * 0.01, Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
        }
        assert!(!t.is_still(&Vector3::zeros()), "half a window");
        for k in 50..110 {
            t.push(k as f64 * 0.01, Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
        }
        assert!(t.is_still(&Vector3::zeros()));
    }

    #[test]
    fn a_full_window_of_few_samples_stays_full() {
        let mut t = test();
        for k in 0..100 {
            // Ten samples in the window of a second; stamps rounded either way.
            t.push(1e5 + f64::from(k) * 0.1, Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
            assert_eq!(t.is_still(&Vector3::zeros()), k >= 8, "{k}");
        }
    }

    #[test]
    fn a_steady_turn_is_told_from_a_gyro_bias_by_the_mean_rate() {
        let mut t = test();
        let turn = Vector3::new(0.0, 0.0, 0.05);
        for k in 0..200 {
            t.push(k as f64 * 0.01, turn, Vector3::new(0.0, 0.0, -9.8));
        }
        assert!(!t.is_still(&Vector3::zeros()), "0.05 rad/s is a turn");
        assert!(t.is_still(&turn), "0.05 rad/s is the bias");
    }

    #[test]
    fn what_was_missed_is_that_of_the_quietest_window_with_its_figures() {
        let mut t = test();
        assert_eq!(t.missed(), None);
        for k in 0..900 {
            // Quietest from 3 s to 6 s, and never still; 1σ of a force that changes its sign is its size.
            let size = if (300..600).contains(&k) { 0.4 } else { 4.0 };
            let shake = if k % 2 == 0 { size } else { -size };
            t.push(f64::from(k) * 0.01, Vector3::new(0.0, 0.03, 0.0), Vector3::new(0.0, shake, -9.8));
            assert!(!t.is_still(&Vector3::zeros()));
        }
        assert_eq!(
            t.missed().unwrap(),
            "the quietest window has 0.40 m/s² where `still.accel_std` allows 0.20, and 1.7 deg/s where `still.mean_rate` allows 1.1"
        );
        for k in 900..1100 {
            t.push(f64::from(k) * 0.01, Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
            let _ = t.is_still(&Vector3::zeros());
        }
        assert_eq!(t.missed(), None, "one was still");
    }

    #[test]
    fn what_is_not_a_number_is_not_still() {
        let mut t = test();
        for k in 0..110 {
            let force = if k == 50 { f64::NAN } else { -9.8 };
            t.push(f64::from(k) * 0.01, Vector3::zeros(), Vector3::new(0.0, 0.0, force));
        }
        assert!(!t.is_still(&Vector3::zeros()) && t.missed().is_none());
        for k in 110..160 {
            t.push(f64::from(k) * 0.01, Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
        }
        assert!(t.is_still(&Vector3::zeros()), "a window after it");
    }

    #[test]
    fn shaking_on_one_axis_is_motion() {
        let mut t = test();
        for k in 0..200 {
            let shake = if k % 2 == 0 { 0.3 } else { -0.3 };
            t.push(k as f64 * 0.01, Vector3::zeros(), Vector3::new(shake, 0.0, -9.8));
        }
        assert!(!t.is_still(&Vector3::zeros()));
    }
}
