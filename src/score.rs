//! Scores: an estimate against a reference, its drift in outages, its consistency.

mod consistency;

pub use consistency::{Consistency, Verdict};

use crate::solution::{Solution, sigmas};
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::state::wrap;
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::Serialize;
use std::collections::VecDeque;

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

/// One epoch of the reference.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceEpoch {
    /// Its time.
    pub time: Time,
    /// Position of the reference's point, if it has one at this time.
    pub position: Option<Geodetic>,
    /// Velocity \[m/s\], if it has one.
    pub velocity: Option<Vector3<f64>>,
    /// Attitude of the reference's body, if it has one.
    pub attitude: Option<UnitQuaternion<f64>>,
}

/// How a run is scored.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Errors count from here on.
    pub from: Option<Time>,
    /// The reference's point in body axes \[m\].
    pub lever_arm: Vector3<f64>,
    /// Takes the mean rotation between the two bodies out of the attitude errors.
    pub remove_mean_mounting: bool,
    /// Outage windows whose drift is reported.
    pub windows: Vec<(Time, Time)>,
}

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

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    sum: Vector3<f64>,
    squares: Vector3<f64>,
    max: Vector3<f64>,
    sigma: Vector3<f64>,
    inside: Vector3<f64>,
}

impl Sums {
    fn add(&mut self, e: &Vector3<f64>, sigma: &Vector3<f64>) {
        self.sigma += sigma;
        self.inside += e.zip_map(sigma, |e, s| f64::from(e.abs() <= 3.0 * s));
        self.count += 1.0;
        self.sum += e;
        self.squares += e.component_mul(e);
        self.max = self.max.sup(&e.abs());
    }

    fn axes(&self) -> Option<Axes> {
        (self.count > 0.0).then(|| Axes {
            rms: self.squares.map(|s| (s / self.count).sqrt()).into(),
            mean: (self.sum / self.count).into(),
            max: self.max.into(),
            three_sigma: (self.sigma * (3.0 / self.count)).into(),
            inside: (self.inside / self.count).into(),
        })
    }
}

#[derive(Clone, Copy, Debug)]
struct Window {
    from: Time,
    to: Time,
    first: Option<(f64, f64)>,
    max: f64,
    growth: f64,
    closed: bool,
}

/// Scores a run as it goes.
#[derive(Debug)]
pub struct Scorer {
    rules: Rules,
    epochs: VecDeque<ReferenceEpoch>,
    previous: Option<Solution>,
    position: Sums,
    velocity: Sums,
    horizontal: (f64, f64),
    attitudes: Vec<(UnitQuaternion<f64>, UnitQuaternion<f64>, Vector3<f64>)>,
    nees_position: Vec<f64>,
    nees_velocity: Vec<f64>,
    nees_attitude: Vec<f64>,
    windows: Vec<Window>,
}

impl Scorer {
    /// Against `epochs`, which are in order of time.
    #[must_use]
    pub fn new(rules: Rules, epochs: Vec<ReferenceEpoch>) -> Self {
        let window = |&(from, to): &(Time, Time)| Window {
            from,
            to,
            first: None,
            max: 0.0,
            growth: 0.0,
            closed: false,
        };
        let windows = rules.windows.iter().map(window).collect();
        Self {
            rules,
            epochs: epochs.into(),
            previous: None,
            position: Sums::default(),
            velocity: Sums::default(),
            horizontal: (0.0, 0.0),
            attitudes: Vec::new(),
            nees_position: Vec::new(),
            nees_velocity: Vec::new(),
            nees_attitude: Vec::new(),
            windows,
        }
    }

    /// Adds an epoch, later than those before it: a reference that comes along with the data.
    pub fn push(&mut self, epoch: ReferenceEpoch) {
        self.epochs.push_back(epoch);
    }

    /// Takes the next estimate and scores the reference epochs up to it.
    ///
    /// An epoch between two estimates sees the earlier one carried on by its velocity, so that no
    /// measurement after the epoch can flatter it; attitude and velocity, which a measurement
    /// moves little, are interpolated.
    pub fn observe(&mut self, now: &Solution) {
        let previous = self.previous.replace(*now).unwrap_or(*now);
        while let Some(epoch) = self.epochs.front().copied() {
            if epoch.time > now.time {
                break;
            }
            self.epochs.pop_front();
            if epoch.time >= previous.time {
                let at = Solution::between(&previous, now, epoch.time);
                self.score(&epoch, &at);
            }
        }
    }

    fn score(&mut self, epoch: &ReferenceEpoch, at: &Solution) {
        let counts = self.rules.from.is_none_or(|from| epoch.time >= from);
        if let (Some((place, p)), Some(truth)) = (at.position, epoch.position) {
            let lever = at.attitude.map_or_else(Vector3::zeros, |(q, _)| q * self.rules.lever_arm);
            let e = place.offset(&lever).difference(&truth);
            if counts {
                self.position.add(&e, &sigmas(&p));
                let h = e.x.hypot(e.y);
                self.horizontal = (self.horizontal.0 + h * h, self.horizontal.1.max(h));
                self.nees_position.extend(nees(&e, &p));
            }
            for w in &mut self.windows {
                if epoch.time > w.to {
                    w.closed = true;
                } else if epoch.time >= w.from {
                    let (n, east) = *w.first.get_or_insert((e.x, e.y));
                    w.max = w.max.max(e.x.hypot(e.y));
                    w.growth = w.growth.max((e.x - n).hypot(e.y - east));
                }
            }
        }
        if !counts {
            return;
        }
        if let (Some((v, p)), Some(truth)) = (at.velocity, epoch.velocity) {
            let e = v - truth;
            self.velocity.add(&e, &sigmas(&p));
            self.nees_velocity.extend(nees(&e, &p));
        }
        if let (Some((q, _)), Some(truth), Some((_, sigma))) = (at.attitude, epoch.attitude, at.rpy()) {
            self.attitudes.push((q, truth, sigma));
            if let (false, Some((_, p))) = (self.rules.remove_mean_mounting, at.attitude) {
                self.nees_attitude.extend(nees(&so3::log(&(q.inverse() * truth)), &p));
            }
        }
    }

    /// The score.
    #[must_use]
    pub fn finish(self) -> Score {
        let count = self.position.count.max(1.0);
        let drift: Vec<Drift> = self
            .windows
            .iter()
            .filter(|w| w.closed && w.first.is_some())
            .map(|w| Drift {
                from: w.from.seconds(),
                to: w.to.seconds(),
                max_horizontal: w.max,
                growth: w.growth,
            })
            .collect();
        let (attitude_deg, mounting_deg) = self.attitude();
        let [heading_rmse_deg, inclination_rmse_deg] = self.heading_and_inclination(mounting_deg);
        Score {
            epochs: (self.position.count as usize)
                .max(self.velocity.count as usize)
                .max(self.attitudes.len()),
            position: self.position.axes(),
            horizontal_rms: (self.horizontal.0 / count).sqrt(),
            horizontal_max: self.horizontal.1,
            velocity: self.velocity.axes(),
            attitude_deg,
            heading_rmse_deg,
            inclination_rmse_deg,
            mounting_deg,
            nees_position: Consistency::of(&self.nees_position, 3),
            nees_velocity: Consistency::of(&self.nees_velocity, 3),
            nees_attitude: Consistency::of(&self.nees_attitude, 3),
            drift_rms: (!drift.is_empty())
                .then(|| (drift.iter().map(|d| d.max_horizontal.powi(2)).sum::<f64>() / drift.len() as f64).sqrt()),
            drift_median: median(drift.iter().map(|d| d.max_horizontal).collect()),
            drift,
        }
    }

    /// RMS \[deg\], the mean mounting [roll, pitch, yaw, deg] taken out where there is one.
    fn heading_and_inclination(&self, mounting_deg: Option<[f64; 3]>) -> [Option<f64>; 2] {
        let [roll, pitch, yaw] = mounting_deg.unwrap_or_default().map(f64::to_radians);
        let mounting = so3::from_rpy(roll, pitch, yaw);
        let errors = self
            .attitudes
            .iter()
            .map(|(q, truth, _)| swing_and_twist(&(q * mounting * truth.inverse())));
        let sums = errors.fold([0.0; 2], |[h, i], [heading, inclination]| {
            [h + heading * heading, i + inclination * inclination]
        });
        sums.map(|sum| (!self.attitudes.is_empty()).then(|| (sum / self.attitudes.len() as f64).sqrt().to_degrees()))
    }

    fn attitude(&self) -> (Option<Axes>, Option<[f64; 3]>) {
        let mut mounting = UnitQuaternion::identity();
        if self.rules.remove_mean_mounting && !self.attitudes.is_empty() {
            mounting = mean_rotation(self.attitudes.iter().map(|(q, truth, _)| q.inverse() * truth));
        }
        let mut sums = Sums::default();
        for (q, truth, sigma) in &self.attitudes {
            let e = so3::to_rpy(&(q * mounting)) - so3::to_rpy(truth);
            sums.add(&e.map(|e| wrap(e).to_degrees()), &sigma.map(f64::to_degrees));
        }
        let degrees = so3::to_rpy(&mounting).map(f64::to_degrees).into();
        (sums.axes(), self.rules.remove_mean_mounting.then_some(degrees))
    }
}

/// The least turn about the vertical of the rotation `e` between two attitudes, resolved in
/// navigation axes, and the turn about a level axis that is left \[rad\].
fn swing_and_twist(e: &UnitQuaternion<f64>) -> [f64; 2] {
    // atan2 for acos √(w² + z²), which is coarse near 0.
    [2.0 * e.k.abs().atan2(e.w.abs()), 2.0 * e.i.hypot(e.j).atan2(e.w.hypot(e.k))]
}

/// The rotation with the least mean squared angle to all of `rotations`.
fn mean_rotation(rotations: impl Iterator<Item = UnitQuaternion<f64>> + Clone) -> UnitQuaternion<f64> {
    let mut mean = rotations.clone().next().unwrap_or_default();
    // The intrinsic mean; each pass squares the remaining error.
    for _ in 0..10 {
        let inverse = mean.inverse();
        let (count, sum) = rotations
            .clone()
            .fold((0.0, Vector3::zeros()), |(n, s), r| (n + 1.0, s + so3::log(&(inverse * r))));
        mean *= so3::exp(&(sum / f64::max(count, 1.0)));
    }
    mean
}

/// eᵀP⁻¹e, where P can be factored.
fn nees(e: &Vector3<f64>, p: &Matrix3<f64>) -> Option<f64> {
    let solved = p.cholesky()?.solve(e);
    Some(e.dot(&solved))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    Some(if values.len() % 2 == 1 {
        values[middle]
    } else {
        0.5 * (values[middle - 1] + values[middle])
    })
}

/// Fills in velocities as the slope of a cubic fitted to the positions of `half` epochs on either
/// side; epochs whose neighbours span more than `max_span` seconds get none.
///
/// Source: Savitzky, Golay 1964, for stamps that are not equidistant.
pub fn differentiate(epochs: &mut [ReferenceEpoch], half: usize, max_span: f64) {
    let slopes: Vec<Option<Vector3<f64>>> = (0..epochs.len())
        .map(|i| {
            let window = epochs.get(i.checked_sub(half)?..i + half + 1)?;
            let span = window.last()?.time.seconds_since(window.first()?.time);
            if span > max_span {
                return None;
            }
            let mut normal = nalgebra::Matrix4::<f64>::zeros();
            let mut right = nalgebra::Matrix4x3::<f64>::zeros();
            for e in window {
                let t = e.time.seconds_since(epochs[i].time) / span;
                let row = nalgebra::Vector4::new(1.0, t, t * t, t * t * t);
                normal += row * row.transpose();
                right += row * e.position?.difference(&epochs[i].position?).transpose();
            }
            let fit = normal.cholesky()?.solve(&right);
            Some(fit.row(1).transpose() / span)
        })
        .collect();
    for (epoch, slope) in epochs.iter_mut().zip(slopes) {
        epoch.velocity = epoch.velocity.or(slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(north: f64, east: f64) -> Geodetic {
        Geodetic {
            lat: 0.6,
            lon: 0.1,
            height: 0.0,
        }
        .offset(&Vector3::new(north, east, 0.0))
    }

    fn estimate(t: f64, north: f64, east: f64) -> Solution {
        Solution {
            time: Time::from_seconds(t),
            position: Some((place(north, east), Matrix3::identity() * 4.0)),
            velocity: Some((Vector3::zeros(), Matrix3::identity())),
            attitude: Some((so3::from_rpy(0.0, 0.0, 0.3), Matrix3::identity())),
        }
    }

    fn truth(t: f64) -> ReferenceEpoch {
        ReferenceEpoch {
            time: Time::from_seconds(t),
            position: Some(place(0.0, 0.0)),
            velocity: None,
            attitude: Some(so3::from_rpy(0.0, 0.0, 0.5)),
        }
    }

    #[test]
    fn errors_drift_and_nees_of_a_known_run() {
        let rules = Rules {
            windows: vec![(Time::from_seconds(2.0), Time::from_seconds(3.0))],
            remove_mean_mounting: true,
            ..Rules::default()
        };
        let mut scorer = Scorer::new(rules, (0..5).map(|k| truth(k as f64)).collect());
        for (t, n, e) in [(0.0, 0.0, 0.0), (1.0, 3.0, 4.0), (2.0, 6.0, 8.0), (3.0, 6.0, 9.0), (4.0, 0.0, 0.0)] {
            scorer.observe(&estimate(t, n, e));
        }
        let score = scorer.finish();
        // Geodetic ⊞/⊟ about points metres apart agree to 1e-5 relative.
        assert!(
            (score.horizontal_rms - ((25.0 + 100.0 + 117.0) / 5.0_f64).sqrt()).abs() < 1e-4,
            "{score:?}"
        );
        assert!((score.drift[0].max_horizontal - 117_f64.sqrt()).abs() < 1e-3);
        assert!((score.drift[0].growth - 1.0).abs() < 1e-3);
        assert!((score.nees_position.unwrap().mean - (25.0 + 100.0 + 117.0) / 5.0 / 4.0).abs() < 1e-3);
        let attitude = score.attitude_deg.unwrap();
        // 1e-9 deg: rounding of trigonometric functions.
        assert!(attitude.rms[2] < 1e-9 && (score.mounting_deg.unwrap()[2] - 0.2_f64.to_degrees()).abs() < 1e-9);
    }

    #[test]
    fn a_turn_splits_into_heading_and_inclination() {
        let (level, down) = (Vector3::new(0.6, 0.8, 0.0), Vector3::z());
        for (tilt, turn) in [(0.0, 0.0), (1e-9, 0.4), (0.3, -3.0), (-1.2, 0.7)] {
            let e = so3::exp(&(level * tilt)) * so3::exp(&(down * turn));
            let [heading, inclination] = swing_and_twist(&e);
            // 1e-15: rounding; by acos it would be 1e-8.
            assert!(
                (heading - f64::abs(turn)).abs() < 1e-15 && (inclination - f64::abs(tilt)).abs() < 1e-15,
                "{heading} {inclination}"
            );
        }
        let truth = so3::from_rpy(0.5, -0.2, 2.0);
        let mut scorer = Scorer::new(Rules::default(), Vec::new());
        for turn in [0.03, -0.04] {
            scorer.attitudes.push((so3::exp(&(down * turn)) * truth, truth, Vector3::zeros()));
        }
        let score = scorer.finish();
        // √((9 + 16)/2)·1e-2 rad; 1e-12: rounding.
        assert!((score.heading_rmse_deg.unwrap() - (12.5_f64.sqrt() * 1e-2).to_degrees()).abs() < 1e-12);
        assert!(score.inclination_rmse_deg.unwrap() < 1e-12);
    }

    #[test]
    fn a_cubic_is_differentiated_exactly() {
        let mut epochs: Vec<ReferenceEpoch> = (0..21)
            .map(|k| {
                let t = k as f64 * 0.01;
                ReferenceEpoch {
                    time: Time::from_seconds(t),
                    position: Some(place(5.0 * t + 2.0 * t.powi(3), 0.0)),
                    velocity: None,
                    attitude: None,
                }
            })
            .collect();
        differentiate(&mut epochs, 6, 0.2);
        let v = epochs[10].velocity.unwrap();
        // 1e-6: the curvature of the Earth over a metre, and rounding over 0.12 s.
        assert!((v.x - (5.0 + 6.0 * 0.01)).abs() < 1e-6, "{v}");
        assert!(epochs[2].velocity.is_none());
    }
}
