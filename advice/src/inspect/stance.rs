//! Finds a foot by its inertial unit: it is at rest for a moment, swings, and is at rest again.

use super::numbers::{Vec3, median, moments, norm, quantile};
use fusion_core::math;

/// A standing foot turns slower than `SLOW` [rad/s], and its force differs from gravity by less than `STILL` [m/s²].
const SLOW: f64 = 0.6;
const STILL: f64 = 1.0;
/// A swing turns the foot faster than this [rad/s].
const SWING: f64 = 2.5;
/// The time from one stance to the next when walking or running [s].
const STRIDE: core::ops::Range<f64> = 0.5..2.5;
/// Fewer strides do not make a walk.
const ENOUGH: usize = 10;
/// Initial 1σ of the gyro bias in a design of a foot [rad/s].
const BIAS: f64 = 0.0087;
/// At least this share of all pauses between two swings are stances of a walk.
const REGULAR: f64 = 0.6;

/// Regular stances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stances {
    /// The number of stances.
    pub count: usize,
    /// Median time from one stance to the next \[s\].
    pub period: f64,
    /// Median length of a stance \[s\].
    pub duration: f64,
    /// Twice the median standard deviation of the specific force in the middle of a stance, the largest of the axes
    /// \[m/s²\].
    pub accel_std: f64,
    /// The same for the angular rate \[rad/s\].
    pub gyro_std: f64,
    /// The limit that 95 % of the mean rates there stay below, less the bias, the largest of the axes \[rad/s\]. It
    /// contains noise and the rolling of the foot.
    pub rolling: f64,
    /// The limit of the mean rate of a stance for a filter with an unknown or poorly known bias \[rad/s\]. It is the
    /// bias plus three times the root sum square of `rolling` and the 1σ of the bias.
    pub mean_rate: f64,
}

impl Stances {
    /// The length of the evaluated middle of a stance \[s\].
    pub(super) const WINDOW: f64 = 0.15;

    /// Returns true if its mean rates are the gyro bias. Those of a rolling foot are not. They do not average out,
    /// because the foot rolls the same way in every stride.
    pub(super) fn tell_bias(&self) -> bool {
        // 95 % of biases are within twice their 1σ.
        self.rolling < 2.0 * BIAS
    }

    /// From the samples of a unit and the gyro bias, if a rest gives it; `None` if the samples are not from a walking
    /// foot.
    pub(super) fn of(t: &[f64], force: &[Vec3], rate: &[Vec3], gravity: f64, known: Option<Vec3>) -> Option<Self> {
        let bias = known.unwrap_or_default();
        let turning = |k: usize| norm([0, 1, 2].map(|i| rate[k][i] - bias[i]));
        let stands = |k: usize| turning(k) < SLOW && (norm(force[k]) - gravity).abs() < STILL;
        // Runs of standing samples, and whether there is a swing before each.
        let (mut runs, mut begin, mut has_swung): (Vec<(usize, usize, bool)>, _, _) = (Vec::new(), None::<usize>, false);
        for k in 0..t.len() {
            if stands(k) {
                begin = begin.or(Some(k));
                continue;
            }
            if let Some(from) = begin.take().filter(|from| t[k] - t[*from] >= Self::WINDOW) {
                runs.push((from, k, has_swung));
                has_swung = false;
            }
            has_swung |= turning(k) > SWING;
        }
        let swung: Vec<[(usize, usize); 2]> = runs
            .windows(2)
            .filter(|w| w[1].2)
            .map(|w| [(w[0].0, w[0].1), (w[1].0, w[1].1)])
            .collect();
        let strides: Vec<&[(usize, usize); 2]> = swung.iter().filter(|[a, b]| STRIDE.contains(&(t[b.0] - t[a.0]))).collect();
        if strides.len() < ENOUGH || (strides.len() as f64) < REGULAR * swung.len() as f64 {
            return None;
        }
        let middles: Vec<(usize, usize)> = strides.iter().map(|[a, _]| middle(t, *a)).collect();
        let typical = |v: &[Vec3]| {
            let axis = |i: usize| median(middles.iter().map(|(a, b)| moments(v[*a..*b].iter().map(|v| v[i])).1));
            2.0 * [0, 1, 2].map(axis).into_iter().fold(0.0, f64::max)
        };
        let means: Vec<Vec3> = middles
            .iter()
            .map(|(a, b)| [0, 1, 2].map(|i| moments(rate[*a..*b].iter().map(|w| w[i])).0))
            .collect();
        // Without a rest, the bias is the median over the stances.
        let bias = known.unwrap_or_else(|| [0, 1, 2].map(|i| median(means.iter().map(|m| m[i]))));
        let off = |i: usize| quantile(means.iter().map(|m| (m[i] - bias[i]).abs()), 0.95);
        let rolling = [0, 1, 2].map(off).into_iter().fold(0.0, f64::max);
        let largest = bias.into_iter().map(f64::abs).fold(0.0, f64::max);
        Some(Self {
            count: strides.len() + 1,
            period: median(strides.iter().map(|[a, b]| t[b.0] - t[a.0])),
            duration: median(strides.iter().map(|[a, _]| t[a.1] - t[a.0])),
            accel_std: typical(force),
            gyro_std: typical(rate),
            rolling,
            // Faster turns were not accepted as a stance here either.
            mean_rate: largest + (3.0 * math::hypot(rolling, BIAS)).min(SLOW),
        })
    }
}

/// The rows in the middle of a run.
fn middle(t: &[f64], (from, to): (usize, usize)) -> (usize, usize) {
    let centre = 0.5 * (t[from] + t[to]);
    let at = |time: f64| from + t[from..to].partition_point(|t| *t < time);
    (at(centre - 0.5 * Stances::WINDOW), at(centre + 0.5 * Stances::WINDOW))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute at 200 Hz: after each `pause` a swing of 0.6 s about y.
    fn foot(pause: f64) -> (Vec<f64>, Vec<Vec3>, Vec<Vec3>) {
        let of = |k: i32| {
            let t = 0.005 * f64::from(k);
            let swing = (t.rem_euclid(pause + 0.6) - pause).max(0.0) / 0.6 * core::f64::consts::TAU;
            let noise = 0.01 * (12.9898 * f64::from(k)).sin();
            (t, ([3.0 * swing.sin(), noise, -9.81], [noise, 6.0 * swing.sin(), 0.0]))
        };
        let (t, samples): (Vec<f64>, Vec<_>) = (0..12_000).map(of).unzip();
        let (force, rate) = samples.into_iter().unzip();
        (t, force, rate)
    }

    #[test]
    fn the_stances_of_a_walk_are_found_and_pauses_of_a_hand_are_not() {
        let (t, force, rate) = foot(0.5);
        let s = Stances::of(&t, &force, &rate, 9.81, Some([0.0; 3])).unwrap();
        // 1.1 s each; a swing is slow at its beginning and end for a few samples.
        assert!((s.period - 1.1).abs() < 0.01 && (0.5..0.56).contains(&s.duration), "{s:?}");
        assert!(s.count > 50 && s.accel_std < 0.03 && s.gyro_std < 0.03, "{s:?}");
        let (t, force, rate) = foot(4.0);
        assert_eq!(Stances::of(&t, &force, &rate, 9.81, Some([0.0; 3])), None);
    }

    #[test]
    fn stances_tell_the_bias_unless_the_foot_rolls() {
        let (t, force, rate) = foot(0.5);
        // 2 deg/s of bias, and a scatter of 0.01 rad/s · sin from sample to sample, most of which a mean over 0.15 s
        // removes.
        let biased: Vec<Vec3> = rate.iter().map(|w| [w[0] + 0.035, w[1], w[2]]).collect();
        for known in [None, Some([0.035, 0.0, 0.0])] {
            let s = Stances::of(&t, &force, &biased, 9.81, known).unwrap();
            // 2 deg/s, and three times 0.5 deg/s.
            assert!(s.tell_bias() && s.rolling < 0.005, "{s:?}");
            assert!((0.061..0.066).contains(&s.mean_rate), "{s:?}");
        }
        // 6 deg/s forwards in every stance: a rest before the walk shows that this is not a bias.
        let rolling: Vec<Vec3> = rate.iter().map(|w| [w[0], w[1] + 0.1, w[2]]).collect();
        let s = Stances::of(&t, &force, &rolling, 9.81, Some([0.0; 3])).unwrap();
        assert!(!s.tell_bias() && (0.09..0.13).contains(&s.rolling), "{s:?}");
        assert!((0.27..0.4).contains(&s.mean_rate), "{s:?}");
    }
}
