//! Compares two headings with the course, the estimated one and that of the reference.
//!
//! a = course − yaw of the reference, b = course − yaw of the estimate, d = a − b
//!
//! with the course from the reference's own velocity. a is a slip minus the heading error of the reference. d is the
//! heading error of the estimate minus that of the reference. So the slope of a over d is the share of the reference in
//! the squares of d. This holds for any difference between course and heading: a mounting, a slip, noise of the
//! velocity.
//!
//! The weight is the square of the speed, because it determines the accuracy of a course. A vehicle at rest gives no
//! information. Parts of the run, each about its own mean, give the 1σ of the share.
//!
//! Not here  a constant error of either, which a mounting hides; an estimate that follows the course of a sliding
//!           vehicle: the slip then looks like an error of the reference

use super::comparison::EpochError;
use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::UnitQuaternion;
use schemars::JsonSchema;
use serde::Serialize;

/// Headings against the course.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Course {
    /// Standard deviation of the reference's heading about the course \[deg\].
    pub reference_deg: f64,
    /// Standard deviation of the estimated heading about the course \[deg\].
    pub estimate_deg: f64,
    /// 1σ of the varying part of the reference's own heading error \[deg\].
    pub own_deg: f64,
    /// The share of the reference in the squares of the heading errors.
    pub share: f64,
    /// Its 1σ, from the differences between the parts of the run.
    pub share_sigma: f64,
}

/// The largest number of parts of a run; the least number of parts that give a 1σ; the shortest part \[s\]. The part
/// length doubles when there are too many parts.
const PARTS: usize = 16;
const LEAST: usize = 4;
const SHORTEST: f64 = 4.0;

/// Adds up a run.
#[derive(Clone, Debug, Default)]
pub(super) struct CourseFit {
    parts: Vec<Sums>,
    /// The number of doublings of the part length.
    doubled: u32,
}

/// The sums of a part: its start, the weight, and weighted sums of cosine and sine of a, b and d.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    begun: Time,
    weight: f64,
    angles: [[f64; 2]; 3],
}

fusion_core::memory!(CourseFit { parts, doubled });
fusion_core::memory!(Sums { begun, weight, angles });

impl Sums {
    fn of_all(parts: &[Self]) -> Self {
        let begun = parts.first().map_or_else(Time::default, |part| part.begun);
        let mut all = Self { begun, ..Self::default() };
        for part in parts {
            all.weight += part.weight;
            for (sum, more) in all.angles.as_flattened_mut().iter_mut().zip(part.angles.as_flattened()) {
                *sum += more;
            }
        }
        all
    }

    /// The variances of a, b and d. For a normal angle the mean of exp(iφ) has the length exp(−σ²/2).
    fn variances(&self) -> [f64; 3] {
        self.angles
            .map(|[c, s]| -2.0 * math::ln((math::hypot(c, s) / self.weight).min(1.0)))
    }
}

/// The covariance of a and d: 2 cov = a + d − b.
fn own([a, b, d]: [f64; 3]) -> f64 {
    0.5 * (a + d - b)
}

impl CourseFit {
    /// The next epoch of the reference.
    pub(super) fn add(&mut self, error: &EpochError) {
        let (Some(velocity), Some(truth), Some(attitude)) = (error.truth.velocity, error.truth.attitude, &error.attitude) else {
            return;
        };
        let yaw = |q: &UnitQuaternion<f64>| so3::to_rpy(q).z;
        let course = math::atan2(velocity.y, velocity.x);
        let (estimate, truth) = (yaw(&attitude.estimate), yaw(&truth));
        let weight = velocity.xy().norm_squared();
        if !weight.is_finite() {
            return;
        }
        let (time, length) = (error.time(), SHORTEST * math::exp2(f64::from(self.doubled)));
        if self.parts.last().is_none_or(|part| time.seconds_since(part.begun) >= length) {
            if self.parts.len() == PARTS {
                self.parts = self.parts.chunks(2).map(Sums::of_all).collect();
                self.doubled += 1;
            }
            self.parts.push(Sums {
                begun: time,
                ..Sums::default()
            });
        }
        if let Some(part) = self.parts.last_mut() {
            part.weight += weight;
            for (sums, angle) in part.angles.iter_mut().zip([course - truth, course - estimate, estimate - truth]) {
                *sums = [sums[0] + weight * math::cos(angle), sums[1] + weight * math::sin(angle)];
            }
        }
    }

    /// The result; `None` without motion, or for too few parts.
    pub(super) fn finish(&self) -> Option<Course> {
        let all = Sums::of_all(&self.parts);
        let [a, b, d] = all.variances();
        // The squares of d in each part, and the share of the reference in them.
        let moved = self.parts.iter().filter(|part| part.weight > 0.0);
        let parts: Vec<(f64, f64)> = moved
            .map(|p| (p.weight * p.variances()[2], p.weight * own(p.variances())))
            .collect();
        let (squares, of_reference) = parts.iter().fold((0.0, 0.0), |(s, o), (squares, own)| (s + squares, o + own));
        let share = of_reference / squares;
        let scatter = parts.iter().map(|(squares, own)| math::powi(own - share * squares, 2)).sum::<f64>();
        let n = parts.len() as f64;
        (parts.len() >= LEAST && squares > 0.0).then(|| Course {
            reference_deg: math::sqrt(a).to_degrees(),
            estimate_deg: math::sqrt(b).to_degrees(),
            own_deg: math::sqrt(own([a, b, d]).max(0.0)).to_degrees(),
            share,
            share_sigma: math::sqrt(scatter * n / (n - 1.0)) / squares,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Comparison, ReferenceEpoch};
    use super::*;
    use crate::solution::Solution;
    use core::convert::Infallible;
    use fusion_core::time::Time;
    use nalgebra::{Matrix3, Vector3};

    /// Errors that are independent of each other, in (−1, 1).
    fn noise(k: u32) -> f64 {
        2.0 * (f64::from(k) * 0.754_877_666 + 0.3).fract() - 1.0
    }

    /// A drive with slips and heading errors of these sizes.
    fn of(slip: f64, reference: f64, estimate: f64) -> Course {
        let mut fit = CourseFit::default();
        let epoch = |k: u32| ReferenceEpoch {
            time: Time::from_seconds(f64::from(k)),
            // Half of the time at rest, where the course is undefined.
            velocity: Some(
                if k.is_multiple_of(2) { 10.0 } else { 0.0 } * Vector3::new((slip * noise(k * k)).cos(), (slip * noise(k * k)).sin(), 0.0),
            ),
            attitude: Some(so3::from_rpy(0.0, 0.0, 0.7 + reference * noise(k + 7))),
            ..ReferenceEpoch::default()
        };
        let mut comparison = Comparison::new(Vector3::zeros(), (0..2000).map(epoch));
        for k in 0..2000 {
            let solution = Solution {
                time: Time::from_seconds(f64::from(k)),
                velocity: Some((Vector3::zeros(), Matrix3::identity())),
                attitude: Some((so3::from_rpy(0.0, 0.0, 0.2 + estimate * noise(5 * k + 3)), Matrix3::identity())),
                ..Solution::default()
            };
            let added = comparison.reach(&solution, None, |_, error| {
                error.into_iter().for_each(|error| fit.add(error));
                Ok::<_, Infallible>(())
            });
            let Ok(()) = added;
        }
        fit.finish().unwrap()
    }

    #[test]
    fn the_heading_with_the_smaller_error_goes_with_the_course_whatever_the_vehicle_slips() {
        // 1σ of noise in (−1, 1) is 1/√3; 5 % for the number of samples and their chance correlation.
        let sigma = |scale: f64| scale.to_degrees() / 3.0_f64.sqrt();
        let is_near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.05;
        let found = of(0.01, 0.02, 0.0);
        assert!(is_near(found.reference_deg, sigma(0.01_f64.hypot(0.02))), "{found:?}");
        assert!(is_near(found.estimate_deg, sigma(0.01)), "{found:?}");
        assert!(is_near(found.own_deg, sigma(0.02)), "{found:?}");
        assert!(
            (found.share - 1.0).abs() < 3.0 * found.share_sigma && found.share_sigma < 0.1,
            "{found:?}"
        );
        let found = of(0.01, 0.0, 0.02);
        assert!(
            is_near(found.estimate_deg, sigma(0.01_f64.hypot(0.02))) && found.own_deg < 0.3 * sigma(0.02),
            "{found:?}"
        );
    }
}
