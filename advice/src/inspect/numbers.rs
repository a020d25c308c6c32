//! Small statistics of samples.

use fusion_core::math;

/// A vector of three numbers.
pub(super) type Vec3 = [f64; 3];

/// The value that a share of the finite samples stays below; NaN if there are no finite samples.
pub(super) fn quantile(samples: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = samples.into_iter().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get(math::round(share * last as f64) as usize).copied().unwrap_or(f64::NAN)
}

/// The median of the finite samples.
pub(crate) fn median(samples: impl IntoIterator<Item = f64>) -> f64 {
    quantile(samples, 0.5)
}

/// 1σ of normal numbers by their absolute values, half of which are below 0.674 σ.
pub(super) fn by_half(sizes: impl IntoIterator<Item = f64>) -> f64 {
    median(sizes) / 0.674
}

/// The white scatter of samples at equal intervals, 1σ: the middle of three in a row differs from the mean of the outer
/// two by √(3/2) of it. NaN for fewer samples.
pub(super) fn scatter(samples: &[f64]) -> f64 {
    by_half(samples.windows(3).map(|p| (p[1] - 0.5 * (p[0] + p[2])).abs())) / math::sqrt(1.5_f64)
}

/// The smallest step between neighbouring samples: the resolution of the written numbers; NaN for a constant.
pub(super) fn resolution(samples: impl Iterator<Item = f64> + Clone) -> f64 {
    let steps = samples.clone().zip(samples.skip(1)).map(|(a, b)| (b - a).abs());
    steps.filter(|step| *step > 0.0).fold(f64::NAN, f64::min)
}

/// Length and angle of the mean of unit vectors at these angles \[rad\]: the length is 1 if all are equal.
pub(crate) fn direction(angles: impl ExactSizeIterator<Item = f64>) -> (f64, f64) {
    let count = angles.len() as f64;
    let (sin, cos) = angles.map(math::sin_cos).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    (math::hypot(sin, cos) / count, math::atan2(sin, cos))
}

/// Mean and standard deviation of the finite samples.
pub(super) fn moments(samples: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let (mut n, mut mean, mut sum) = (0.0, 0.0, 0.0);
    for v in samples.into_iter().filter(|v| v.is_finite()) {
        n += 1.0;
        let step = v - mean;
        mean += step / n;
        sum += step * (v - mean);
    }
    if n > 0.0 {
        (mean, math::sqrt(sum / n))
    } else {
        (f64::NAN, f64::NAN)
    }
}

/// Slope of y over x through their means, and their correlation.
pub(super) fn line(pairs: &[(f64, f64)]) -> (f64, f64) {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in pairs {
        xx += (p.0 - x) * (p.0 - x);
        xy += (p.0 - x) * (p.1 - y);
        yy += (p.1 - y) * (p.1 - y);
    }
    (xy / xx, xy / math::sqrt(xx * yy))
}

/// The length of a vector.
pub(super) fn norm(v: Vec3) -> f64 {
    math::sqrt(v.iter().map(|x| x * x).sum::<f64>())
}

/// The integral of a sampled vector from its first sample on. Each sample is constant over the interval before it.
#[derive(Clone, Debug, Default)]
pub(super) struct Integral {
    t: Vec<f64>,
    sums: Vec<Vec3>,
}

impl Integral {
    /// Integrates these samples. It ignores times that do not increase and samples that are not numbers.
    pub(super) fn of(t: &[f64], v: &[Vec3]) -> Self {
        let mut all = Self::default();
        let mut sum = [0.0; 3];
        for (&t, v) in t.iter().zip(v) {
            let Some(&before) = all.t.last() else {
                all.push(t, sum);
                continue;
            };
            // Each sample covers the interval before it, however long that is.
            if !(t > before && v.iter().all(|v| v.is_finite())) {
                continue;
            }
            for (s, v) in sum.iter_mut().zip(v) {
                *s += v * (t - before);
            }
            all.push(t, sum);
        }
        all
    }

    fn push(&mut self, t: f64, sum: Vec3) {
        if t.is_finite() {
            self.t.push(t);
            self.sums.push(sum);
        }
    }

    fn at(&self, t: f64) -> Option<Vec3> {
        let k = self.t.partition_point(|s| *s < t);
        if k == 0 || k >= self.t.len() {
            return None;
        }
        let share = (t - self.t[k - 1]) / (self.t[k] - self.t[k - 1]);
        let (a, b) = (self.sums[k - 1], self.sums[k]);
        Some([0, 1, 2].map(|i| a[i] + share * (b[i] - a[i])))
    }

    /// The mean from one time to another; `None` if the samples do not cover it.
    pub(super) fn mean(&self, from: f64, to: f64) -> Option<Vec3> {
        let (a, b) = (self.at(from)?, self.at(to)?);
        (to > from).then(|| [0, 1, 2].map(|i| (b[i] - a[i]) / (to - from)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_leave_out_what_is_no_number() {
        let v = [3.0, f64::NAN, 1.0, 2.0];
        assert_eq!(median(v), 2.0);
        let (mean, std) = moments(v);
        assert!((mean - 2.0).abs() < 1e-15 && (std - (2.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(median([]).is_nan() && moments([]).0.is_nan());
        let (slope, correlation) = line(&[(0.0, 1.0), (1.0, -1.0), (2.0, -3.0)]);
        assert!((slope + 2.0).abs() < 1e-15 && (correlation + 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_mean_takes_parts_of_samples() {
        let integral = Integral::of(&[0.0, 1.0, 2.0], &[[9.0; 3], [1.0; 3], [3.0; 3]]);
        // Half of the sample at t = 1, and a quarter of the sample at t = 2.
        let mean = integral.mean(0.5, 1.25).unwrap();
        assert!((mean[0] - (0.5 + 0.75) / 0.75).abs() < 1e-15, "{mean:?}");
        assert_eq!(integral.mean(-1.0, 1.0), None);
    }
}
