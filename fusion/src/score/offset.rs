//! The part of the position error that is a constant offset in body axes: a wrong lever arm.
//!
//! e = C_nb l + d + v τ + noise, horizontally, by least squares over all epochs
//!
//! with l the offset, d a constant error north and east, and τ a latency, which must not look like a forward offset.
//! Without turns, l and d are not separable. At constant speed, the forward part of l and τ are not separable. In both
//! cases the 1σ of l remains its prior.
//!
//! Not here  errors that change in time: they are noise, and count as independent after [`INDEPENDENT`]

use super::comparison::Deviation;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// Unknowns: l, d, τ.
const N: usize = 6;
/// The index of τ.
const LATENCY: usize = 5;
/// The prior 1σ of each unknown: 10 m, 100 m, 1 s.
const PRIOR: [f64; N] = [10.0, 10.0, 10.0, 100.0, 100.0, 1.0];
/// The position errors of an inertial unit with receiver fixes are correlated over some seconds. One error counts in
/// each such interval \[s\].
const INDEPENDENT: f64 = 10.0;

/// A constant offset in body axes that was fitted to the position errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Offset {
    /// The position of the estimate relative to the reference, forward right down \[m\].
    pub body: [f64; 3],
    /// 1σ of each axis \[m\]; 10 m if the axis is not observable.
    pub sigma: [f64; 3],
    /// The share of the squares of the horizontal error that it explains, in addition to a constant error and a
    /// latency.
    pub explained: f64,
    /// For each axis: the share that it explains of the squares left by a fit without it.
    pub own: [f64; 3],
    /// The same offset from the errors of the first and of the second half of the run \[m\].
    pub halves: [[f64; 3]; 2],
    /// Their 1σ \[m\].
    pub halves_sigma: [[f64; 3]; 2],
    /// The time by which the estimate is ahead of the reference \[s\], for a vehicle whose speed changes.
    pub latency: f64,
    /// Its 1σ \[s\].
    pub latency_sigma: f64,
    /// The share of the squares that it explains, in addition to a constant error and an offset.
    pub latency_explained: f64,
}

/// The largest number of parts of a run, an even number. Each part has separate sums.
const PARTS: usize = 16;
/// The length of a part of a short run \[s\]; it doubles when there are too many.
const SHORTEST: f64 = 4.0;

/// Fits all of a run, and its halves.
#[derive(Clone, Debug, Default)]
pub(super) struct OffsetFit {
    parts: Vec<Sums>,
    /// The number of doublings of the part length.
    doubled: u32,
}

fusion_core::memory!(OffsetFit { parts, doubled });

/// Sums of the normal equations.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    information: [[f64; N]; N],
    against: [f64; N],
    squares: f64,
    count: f64,
    span: Option<(Time, Time)>,
}

fusion_core::memory!(Sums {
    information,
    against,
    squares,
    count,
    span
});

impl OffsetFit {
    /// Takes the error at the next epoch, with estimated attitude and velocity.
    pub(super) fn add(&mut self, time: Time, d: &Deviation, motion: Option<&(UnitQuaternion<f64>, Vector3<f64>)>) {
        let length = SHORTEST * math::exp2(f64::from(self.doubled));
        let is_full = |part: &Sums| part.span.is_some_and(|(first, _)| time.seconds_since(first) >= length);
        if self.parts.last().is_none_or(is_full) {
            if self.parts.len() == PARTS {
                self.parts = self.parts.chunks(2).map(Sums::of_all).collect();
                self.doubled += 1;
            }
            self.parts.push(Sums::default());
        }
        if let Some(part) = self.parts.last_mut() {
            part.add(time, d, motion);
        }
    }

    /// The offset; `None` without an epoch, or if all errors are equal.
    pub(super) fn finish(&self) -> Option<Offset> {
        let middle = self.parts.len().div_ceil(2);
        let half = |parts: &[Sums]| Sums::of_all(parts).offset();
        let (first, second) = self.parts.split_at(middle);
        let offset = Sums::of_all(&self.parts).offset()?;
        let halves = half(first)
            .zip(half(second))
            .map(|(first, second)| [first, second])
            .unwrap_or_default();
        Some(Offset {
            halves: halves.map(|half| half.body),
            halves_sigma: halves.map(|half| half.sigma),
            ..offset
        })
    }
}

impl Sums {
    fn of_all(parts: &[Self]) -> Self {
        parts.iter().fold(Self::default(), |mut all, part| {
            let sums = all.information.as_flattened_mut().iter_mut().chain(&mut all.against);
            let further = part.information.as_flattened().iter().chain(&part.against);
            sums.zip(further).for_each(|(sum, more)| *sum += more);
            all.squares += part.squares;
            all.count += part.count;
            all.span = match (all.span, part.span) {
                (Some((first, _)), Some((_, last))) => Some((first, last)),
                (all, part) => all.or(part),
            };
            all
        })
    }

    /// Takes the error at the next epoch, with estimated attitude and velocity.
    fn add(&mut self, time: Time, d: &Deviation, motion: Option<&(UnitQuaternion<f64>, Vector3<f64>)>) {
        let Some((q, v)) = motion.filter(|_| d.is_horizontal() && d.error.xy().iter().all(|e| e.is_finite())) else {
            return;
        };
        let c = q.to_rotation_matrix().into_inner();
        for axis in 0..2 {
            let e = d.error[axis];
            let constant = [f64::from(axis == 0), f64::from(axis == 1)];
            let row = [c[(axis, 0)], c[(axis, 1)], c[(axis, 2)], constant[0], constant[1], v[axis]];
            for (i, a) in row.iter().enumerate() {
                self.against[i] += a * e;
                row.iter().zip(&mut self.information[i]).for_each(|(b, sum)| *sum += a * b);
            }
            self.squares += e * e;
        }
        self.count += 1.0;
        self.span = Some((self.span.map_or(time, |(first, _)| first), time));
    }

    /// The offset; `None` without an epoch, or if all errors are equal.
    fn offset(&self) -> Option<Offset> {
        let (first, last) = self.span?;
        let share = (last.seconds_since(first) / INDEPENDENT / self.count).clamp(f64::MIN_POSITIVE, 1.0);
        let without = self.fit(share, |unknown| unknown >= 3)?;
        let without_latency = self.fit(share, |unknown| unknown != LATENCY)?;
        let with = self.fit(share, |_| true)?;
        let explained = |without: &Fit| 1.0 - with.left / without.left;
        explained(&without).is_finite().then(|| Offset {
            body: core::array::from_fn(|k| with.x[k]),
            sigma: core::array::from_fn(|k| with.sigma[k]),
            explained: explained(&without),
            own: core::array::from_fn(|k| {
                // Without this axis, the variance of an independent row would increase by (x/σ)².
                let more = math::powi(with.x[k] / with.sigma[k], 2) / (2.0 * self.count * share);
                more / (1.0 + more)
            }),
            halves: [[0.0; 3]; 2],
            halves_sigma: [[0.0; 3]; 2],
            latency: with.x[LATENCY],
            latency_sigma: with.sigma[LATENCY],
            latency_explained: explained(&without_latency),
        })
    }

    /// The unknowns with `is_free`, with their 1σ and the remaining squares; `share` of the rows are independent. The
    /// noise of a row is the residual of the previous fit, and at first the whole error.
    fn fit(&self, share: f64, is_free: impl Fn(usize) -> bool) -> Option<Fit> {
        let m = SMatrix::<f64, N, N>::from_fn(|i, j| self.information[i][j]);
        let y = SVector::<f64, N>::from(self.against);
        let mut found = None;
        let mut variance = self.squares / (2.0 * self.count);
        // The residual settles within a few rounds: it hardly depends on the priors.
        for _ in 0..3 {
            let weight = share / variance.max(f64::MIN_POSITIVE);
            let mut p = m * weight;
            for k in 0..N {
                p[(k, k)] += math::powi(PRIOR[k], -2);
                if !is_free(k) {
                    p[(k, k)] += 1e12 * (weight * m[(k, k)]).max(1.0);
                }
            }
            let p = p.cholesky()?;
            let x = p.solve(&(y * weight));
            let left = self.squares - 2.0 * x.dot(&y) + (m * x).dot(&x);
            let sigma = p.inverse().diagonal().map(math::sqrt);
            variance = left / (2.0 * self.count);
            found = Some(Fit { x, sigma, left });
        }
        found
    }
}

/// The result of least squares.
struct Fit {
    x: SVector<f64, N>,
    sigma: SVector<f64, N>,
    left: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3;

    /// The fit over 200 s. `motion` gives heading and speed by time, `error` the error of the estimate by attitude and
    /// velocity.
    fn fitted(motion: impl Fn(f64) -> (f64, f64), error: impl Fn(f64, &UnitQuaternion<f64>, &Vector3<f64>) -> Vector3<f64>) -> Offset {
        let mut fit = OffsetFit::default();
        for k in 0..2000 {
            let t = 0.1 * f64::from(k);
            let (heading, speed) = motion(t);
            let q = so3::from_rpy(0.0, 0.0, heading);
            let v = q * Vector3::new(speed, 0.0, 0.0);
            // Noise of ±0.3 m, without a pattern in body axes.
            let noise = Vector3::new((1.7 * t).sin(), (2.3 * t).cos(), 0.0) * 0.3;
            let deviation = Deviation {
                error: error(t, &q, &v) + noise,
                ..Deviation::default()
            };
            fit.add(Time::from_seconds(t), &deviation, Some(&(q, v)));
        }
        fit.finish().unwrap()
    }

    /// A drive there and back, from rest to rest.
    fn drive(t: f64) -> (f64, f64) {
        (0.05 * t, 5.0 - 5.0 * (0.2 * t).cos())
    }

    #[test]
    fn an_offset_of_the_body_is_found_beside_a_constant_error_and_a_latency() {
        let arm = Vector3::new(-2.0, 0.5, 1.0);
        let found = fitted(drive, |_, q, v| q * arm + Vector3::new(3.0, -1.0, 0.0) + v * 0.2);
        for k in 0..2 {
            // A fifth of the noise of a row: there are 20 independent rows.
            assert!((found.body[k] - arm[k]).abs() < 0.06 && found.sigma[k] < 0.2, "{found:?}");
        }
        // A 25th: the noise divided by an RMS speed of 3 m/s.
        assert!((found.latency - 0.2).abs() < 0.01 && found.latency_explained > 0.5, "{found:?}");
        // The horizontal errors of a level vehicle do not show a height.
        assert!(found.sigma[2] > 9.9 && found.explained > 0.9, "{found:?}");
    }

    #[test]
    fn an_offset_is_the_same_in_both_halves_and_each_axis_explains_its_part() {
        let arm = Vector3::new(-2.0, 0.5, 0.0);
        let found = fitted(drive, |_, q, _| q * arm);
        for half in found.halves {
            assert!((half[0] + 2.0).abs() < 0.3 && (half[1] - 0.5).abs() < 0.3, "{found:?}");
        }
        assert!(found.own[0] > 0.9 && found.own[1] > 0.5 && found.own[2] < 0.01, "{found:?}");
        // Another arm in the second half: drifting errors.
        let wanders = fitted(drive, |t, q, _| q * arm * if t < 100.0 { 1.0 } else { -1.0 });
        assert!(wanders.halves[0][0] < -1.0 && wanders.halves[1][0] > 1.0, "{wanders:?}");
    }

    #[test]
    fn neither_a_constant_error_nor_a_latency_nor_a_straight_way_gives_an_offset() {
        let constant = fitted(drive, |_, _, v| Vector3::new(3.0, -1.0, 0.0) + v * 0.2);
        assert!(constant.explained < 0.05, "{constant:?}");
        let straight = fitted(|t| (0.3, drive(t).1), |_, q, _| q * Vector3::new(2.0, 0.0, 0.0));
        assert!(straight.explained < 0.05 && straight.sigma[0] > 5.0, "{straight:?}");
    }
}
