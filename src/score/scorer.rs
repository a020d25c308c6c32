//! The score of a run, made as it goes.

use super::comparison::{Deviation, EpochError, attitude_error};
use super::convergence::{Limits, Tracker};
use super::drift::{Drifts, Outage};
use super::episodes::EpisodeScorer;
use super::nees::{NeesSeries, of};
use super::travelled::Horizontal;
use super::{Axes, Score};
use fusion_core::geometry::so3;
use fusion_core::time::Time;
use fusion_models::fault::Windows;
use nalgebra::{UnitQuaternion, Vector3};

/// How a run is scored.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Errors count from here on.
    pub from: Option<Time>,
    /// NEES counts from here on, where that is later.
    pub nees_from: Option<Time>,
    /// Within which errors the run has converged; nothing is said without them.
    pub converged: Option<Limits>,
    /// Takes the mean rotation between the two bodies out of the attitude errors.
    pub remove_mean_mounting: bool,
    /// Outages whose drift is reported.
    pub outages: Vec<Outage>,
    /// Times that are scored apart from the others.
    pub episodes: Option<Windows>,
}

/// Errors as they are added up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    count: f64,
    sum: Vector3<f64>,
    squares: Vector3<f64>,
    max: Vector3<f64>,
    sigma: Vector3<f64>,
    /// Epochs at which the axis was estimated, and those of them with the error inside 3σ.
    estimated: Vector3<f64>,
    inside: Vector3<f64>,
}

fusion_core::memory!(Sums {
    count,
    sum,
    squares,
    max,
    sigma,
    estimated,
    inside
});

impl Sums {
    pub(super) fn add(&mut self, d: &Deviation) {
        let (e, sigma) = (&d.error, d.sigma());
        let is_estimated = Vector3::from(d.is_estimated().map(f64::from));
        self.sigma += sigma;
        self.estimated += is_estimated;
        self.inside += e.zip_zip_map(&sigma, &is_estimated, |e, s, known| f64::from(e.abs() <= 3.0 * s) * known);
        self.count += 1.0;
        self.sum += e;
        self.squares += e.component_mul(e);
        self.max = self.max.sup(&e.abs());
    }

    /// Epochs.
    pub(super) const fn count(&self) -> f64 {
        self.count
    }

    pub(super) fn axes(&self) -> Option<Axes> {
        (self.count > 0.0).then(|| Axes {
            rms: self.squares.map(|s| (s / self.count).sqrt()).into(),
            mean: (self.sum / self.count).into(),
            max: self.max.into(),
            three_sigma: (self.sigma * (3.0 / self.count)).into(),
            inside: self.inside.component_div(&self.estimated).into(),
        })
    }
}

/// Scores a run as it goes.
#[derive(Debug)]
pub struct Scorer {
    rules: Rules,
    position: Sums,
    velocity: Sums,
    attitude: Sums,
    horizontal: Horizontal,
    attitudes: Vec<(UnitQuaternion<f64>, UnitQuaternion<f64>, Deviation)>,
    nees_position: NeesSeries,
    nees_velocity: NeesSeries,
    nees_attitude: NeesSeries,
    drifts: Drifts,
    episodes: Option<EpisodeScorer>,
    convergence: Option<Tracker>,
}

fusion_core::memory!(Scorer {
    position,
    velocity,
    attitude,
    horizontal,
    attitudes,
    nees_position,
    nees_velocity,
    nees_attitude,
    drifts,
    episodes,
    convergence;
    rules
});

impl Scorer {
    /// Without an error yet.
    #[must_use]
    pub fn new(rules: Rules) -> Self {
        Self {
            drifts: Drifts::new(&rules.outages),
            episodes: rules.episodes.clone().map(EpisodeScorer::new),
            convergence: rules.converged.map(Tracker::new),
            rules,
            position: Sums::default(),
            velocity: Sums::default(),
            attitude: Sums::default(),
            horizontal: Horizontal::default(),
            attitudes: Vec::new(),
            nees_position: NeesSeries::default(),
            nees_velocity: NeesSeries::default(),
            nees_attitude: NeesSeries::default(),
        }
    }

    /// Takes the error at the next epoch of the reference.
    pub fn add(&mut self, error: &EpochError) {
        self.convergence.iter_mut().for_each(|tracker| tracker.add(error));
        let is_after = |start: Option<Time>| start.is_none_or(|start| error.time() >= start);
        let (counts, is_settled) = (is_after(self.rules.from), is_after(self.rules.nees_from));
        if let Some(d) = &error.position {
            if counts {
                self.position.add(d);
                self.horizontal.lengths.push(d.error.x.hypot(d.error.y));
                if let Some(place) = &error.truth.position {
                    self.horizontal.way.add(place, [d.error.x, d.error.y]);
                }
                if is_settled {
                    self.nees_position.add(of(d));
                }
            }
            self.drifts.add(error.time(), &d.error);
        }
        if !counts {
            return;
        }
        if let Some(episodes) = &mut self.episodes {
            episodes.add(error, is_settled, !self.rules.remove_mean_mounting);
        }
        if let Some(d) = &error.velocity {
            self.velocity.add(d);
            if is_settled {
                self.nees_velocity.add(of(d));
            }
        }
        if let Some(a) = &error.attitude {
            self.attitudes.push((a.estimate, a.truth, a.rpy));
            if !self.rules.remove_mean_mounting {
                self.attitude.add(&in_degrees(&a.rpy));
                if is_settled {
                    self.nees_attitude.add(of(&a.body));
                }
            }
        }
    }

    /// Hears that a sensor's measurement, stamped `stamp` and valid at `time`, was used.
    pub fn used(&mut self, sensor: usize, stamp: Time, time: Time) {
        self.drifts.used(sensor, stamp, time);
    }

    /// The score.
    #[must_use]
    pub fn finish(mut self) -> Score {
        let count = self.position.count;
        let Horizontal { mut lengths, way } = core::mem::take(&mut self.horizontal);
        let squares: f64 = lengths.iter().map(|h| h * h).sum();
        lengths.sort_unstable_by(f64::total_cmp);
        // As many as a share of all do not exceed it.
        let within = |share: f64| lengths.get(((share * count).ceil() as usize).saturating_sub(1)).copied();
        let (attitude_deg, mounting_deg) = self.attitude();
        let [heading_rmse_deg, inclination_rmse_deg] = self.heading_and_inclination(mounting_deg);
        let rotation_rmse_deg = self.rotation(mounting_deg);
        let drift = self.drifts.finish();
        Score {
            epochs: (self.position.count as usize)
                .max(self.velocity.count as usize)
                .max(self.attitudes.len()),
            position: self.position.axes(),
            horizontal_rms: (squares / count).sqrt(),
            horizontal_max: lengths.last().copied().unwrap_or(f64::NAN),
            horizontal_median: within(0.5),
            horizontal_p95: within(0.95),
            travelled: way.finish(),
            velocity: self.velocity.axes(),
            attitude_deg,
            position_rmse_m: self.position.axes().map(|a| a.rms.iter().map(|rms| rms * rms).sum::<f64>().sqrt()),
            rotation_rmse_deg,
            heading_rmse_deg,
            inclination_rmse_deg,
            mounting_deg,
            nees_position: self.nees_position.consistency(),
            nees_velocity: self.nees_velocity.consistency(),
            nees_attitude: self.nees_attitude.consistency(),
            nees_undefined: [&self.nees_position, &self.nees_velocity, &self.nees_attitude].map(NeesSeries::undefined),
            convergence: self.convergence.and_then(|tracker| tracker.finish()),
            episodes: self.episodes.map(EpisodeScorer::finish),
            blocks: Vec::new(),
            drift_rms: (!drift.is_empty())
                .then(|| (drift.iter().map(|d| d.max_horizontal.powi(2)).sum::<f64>() / drift.len() as f64).sqrt()),
            drift_median: median(drift.iter().map(|d| d.max_horizontal).collect()),
            drift,
        }
    }

    /// RMS \[deg\] of the angle between the attitudes, the mounting taken out as below.
    fn rotation(&self, mounting_deg: Option<[f64; 3]>) -> Option<f64> {
        let mounting = rotation_of(mounting_deg);
        let angles = self
            .attitudes
            .iter()
            .map(|(q, truth, _)| so3::log(&(q * mounting * truth.inverse())).norm_squared());
        (!self.attitudes.is_empty()).then(|| (angles.sum::<f64>() / self.attitudes.len() as f64).sqrt().to_degrees())
    }

    /// RMS \[deg\], the mean mounting [roll, pitch, yaw, deg] taken out where there is one.
    fn heading_and_inclination(&self, mounting_deg: Option<[f64; 3]>) -> [Option<f64>; 2] {
        let mounting = rotation_of(mounting_deg);
        let errors = self
            .attitudes
            .iter()
            .map(|(q, truth, _)| swing_and_twist(&(q * mounting * truth.inverse())));
        let sums = errors.fold([0.0; 2], |[h, i], [heading, inclination]| {
            [h + heading * heading, i + inclination * inclination]
        });
        sums.map(|sum| (!self.attitudes.is_empty()).then(|| (sum / self.attitudes.len() as f64).sqrt().to_degrees()))
    }

    /// The attitude errors, and the mean mounting that was taken out of them, if it was.
    fn attitude(&self) -> (Option<Axes>, Option<[f64; 3]>) {
        if !self.rules.remove_mean_mounting {
            return (self.attitude.axes(), None);
        }
        let mounting = mean_rotation(self.attitudes.iter().map(|(q, truth, _)| q.inverse() * truth));
        let mut sums = Sums::default();
        for (q, truth, rpy) in &self.attitudes {
            let error = attitude_error(&(q * mounting), truth);
            sums.add(&in_degrees(&Deviation { error, ..*rpy }));
        }
        (sums.axes(), Some(so3::to_rpy(&mounting).map(f64::to_degrees).into()))
    }
}

/// The rotation of roll, pitch, yaw \[deg\]; none without them.
fn rotation_of(rpy_deg: Option<[f64; 3]>) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = rpy_deg.unwrap_or_default().map(f64::to_radians);
    so3::from_rpy(roll, pitch, yaw)
}

/// The least turn about the vertical of the rotation `e` between two attitudes, resolved in
/// navigation axes, and the turn about a level axis that is left \[rad\].
pub(super) fn swing_and_twist(e: &UnitQuaternion<f64>) -> [f64; 2] {
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

/// Of an error in radians.
fn in_degrees(d: &Deviation) -> Deviation {
    let degree = 1_f64.to_degrees();
    Deviation {
        error: d.error * degree,
        own: d.own * (degree * degree),
        reference: d.reference * (degree * degree),
    }
}

/// The middle of `values`; none without one.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
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

#[cfg(test)]
mod tests {
    use super::super::{Comparison, ReferenceEpoch};
    use super::*;
    use crate::solution::Solution;
    use fusion_core::geometry::wgs84::Geodetic;
    use nalgebra::Matrix3;

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
            ..Solution::default()
        }
    }

    fn truth(t: f64) -> ReferenceEpoch {
        ReferenceEpoch {
            time: Time::from_seconds(t),
            position: Some(place(0.0, 0.0)),
            attitude: Some(so3::from_rpy(0.0, 0.0, 0.5)),
            ..ReferenceEpoch::default()
        }
    }

    #[test]
    fn errors_drift_and_nees_of_a_known_run() {
        let rules = Rules {
            outages: vec![Outage::of("{ from = 2, to = 3 }", &[])],
            remove_mean_mounting: true,
            ..Rules::default()
        };
        let mut scorer = Scorer::new(rules);
        let mut comparison = Comparison::new(Vector3::zeros(), (0..5).map(|k| truth(k as f64)));
        for (t, n, e) in [(0.0, 0.0, 0.0), (1.0, 3.0, 4.0), (2.0, 6.0, 8.0), (3.0, 6.0, 9.0), (4.0, 0.0, 0.0)] {
            let add = |_: &ReferenceEpoch, error: Option<&EpochError>| {
                error.into_iter().for_each(|error| scorer.add(error));
                Ok::<_, core::convert::Infallible>(())
            };
            comparison.reach(&estimate(t, n, e), add).unwrap();
        }
        let score = scorer.finish();
        // Geodetic ⊞/⊟ about points metres apart agree to 1e-5 relative.
        assert!(
            (score.horizontal_rms - ((25.0 + 100.0 + 117.0) / 5.0_f64).sqrt()).abs() < 1e-4,
            "{score:?}"
        );
        // Of 0, 5, 10, √117 and 0 m.
        let [median, p95] = [score.horizontal_median, score.horizontal_p95].map(Option::unwrap);
        assert!((median - 5.0).abs() < 1e-4 && (p95 - 117_f64.sqrt()).abs() < 1e-4, "{score:?}");
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
        let mut scorer = Scorer::new(Rules::default());
        let none = Deviation {
            error: Vector3::zeros(),
            own: Matrix3::zeros(),
            reference: Matrix3::zeros(),
        };
        for turn in [0.03, -0.04] {
            scorer.attitudes.push((so3::exp(&(down * turn)) * truth, truth, none));
        }
        let score = scorer.finish();
        // √((9 + 16)/2)·1e-2 rad; 1e-12: rounding.
        assert!((score.heading_rmse_deg.unwrap() - (12.5_f64.sqrt() * 1e-2).to_degrees()).abs() < 1e-12);
        assert!(score.inclination_rmse_deg.unwrap() < 1e-12);
    }
}
