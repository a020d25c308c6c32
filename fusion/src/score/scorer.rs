//! Scores a run while it proceeds.

use super::attitudes::Attitudes;
use super::bounded::Quantiles;
use super::comparison::{Deviation, EpochError};
use super::convergence::{Limits, Tracker};
use super::course::CourseFit;
use super::drift::{Drifts, Outage};
use super::episodes::EpisodeScorer;
use super::nees::NeesSeries;
use super::offset::OffsetFit;
use super::trajectory::{Poses, TrajectoryRules};
use super::travelled::Horizontal;
use super::{Axes, LengthSpread, Score, Spreads};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::time::Time;
use fusion_models::fault::Windows;
use nalgebra::Vector3;
use statrs::statistics::{Data, OrderStatistics};

/// The rules for scoring a run.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Errors count from this time.
    pub from: Option<Time>,
    /// NEES counts from this time, if it is later.
    pub nees_from: Option<Time>,
    /// The limits for convergence; without them there is no result for convergence.
    pub converged: Option<Limits>,
    /// Removes the mean rotation between the two bodies from the attitude errors.
    pub remove_mean_mounting: bool,
    /// Outages whose drift is reported.
    pub outages: Vec<Outage>,
    /// Times with a separate score.
    pub episodes: Option<Windows>,
    /// The longest correlation time of a slow error that is a state, for errors in metres, metres per second and
    /// radians \[s\]; 0 without a slow error.
    ///
    /// The square of an error with the correlation time τ has the integrated autocorrelation τ. A run of T seconds
    /// therefore holds 1 + T/τ independent values. In a run of a few τ, the series itself shows less correlation than
    /// that.
    pub slowest: [f64; 3],
    /// The rules for comparing the whole trajectory; `None` if it is not compared.
    pub trajectory: Option<TrajectoryRules>,
}

/// Sums of errors.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    count: f64,
    /// Epochs at which the reference knew the axis.
    known: Vector3<f64>,
    sum: Vector3<f64>,
    squares: Vector3<f64>,
    max: Vector3<f64>,
    /// The time of the largest error.
    max_time: [Time; 3],
    sigma: Vector3<f64>,
    /// Epochs at which the axis was estimated, and the number of them with the error inside 3σ.
    estimated: Vector3<f64>,
    inside: Vector3<f64>,
}

fusion_core::memory!(Sums {
    count,
    known,
    sum,
    squares,
    max,
    max_time,
    sigma,
    estimated,
    inside
});

impl Sums {
    pub(super) fn add(&mut self, time: Time, d: &Deviation) {
        self.add_error(time, &d.error, &d.sigma(), d.known, d.is_estimated());
    }

    /// Adds an error `e` at a time, with its 1σ. The flags state for each axis if the reference knows it, and if the
    /// filter estimates it.
    pub(super) fn add_error(&mut self, time: Time, e: &Vector3<f64>, sigma: &Vector3<f64>, known: [bool; 3], is_estimated: [bool; 3]) {
        self.known += Vector3::from(known.map(f64::from));
        let is_estimated = Vector3::from(is_estimated.map(f64::from));
        self.sigma += sigma.zip_map(&Vector3::from(known), |sigma, known| if known { sigma } else { 0.0 });
        self.estimated += is_estimated;
        self.inside += e.zip_zip_map(sigma, &is_estimated, |e, s, known| f64::from(e.abs() <= 3.0 * s) * known);
        self.count += 1.0;
        self.sum += e;
        self.squares += e.component_mul(e);
        for ((e, max), at) in e.iter().zip(self.max.iter_mut()).zip(&mut self.max_time) {
            if e.abs() > *max {
                (*max, *at) = (e.abs(), time);
            }
        }
    }

    /// RMS of the length; `None` if the reference does not know every axis.
    fn whole_rms(&self) -> Option<f64> {
        let is_known = self.known.min() > 0.0;
        is_known.then(|| math::sqrt(self.squares.component_div(&self.known).sum()))
    }

    /// The number of epochs.
    pub(super) const fn count(&self) -> f64 {
        self.count
    }

    /// The number of epochs with a horizontal position.
    pub(super) fn horizontal(&self) -> f64 {
        self.known.x
    }

    pub(super) fn axes(&self) -> Option<Axes> {
        // NaN for an axis that the reference never knew.
        let once = self.known.map(|known| if known > 0.0 { 1.0 } else { f64::NAN });
        (self.count > 0.0).then(|| Axes {
            rms: self.squares.component_div(&self.known).map(math::sqrt).into(),
            mean: self.sum.component_div(&self.known).into(),
            max: self.max.component_mul(&once).into(),
            max_time: core::array::from_fn(|k| self.max_time[k].seconds() * once[k]),
            three_sigma: (3.0 * self.sigma.component_div(&self.known)).into(),
            inside: self.inside.component_div(&self.estimated).into(),
        })
    }
}

/// Scores a run while it proceeds.
#[derive(Debug)]
pub(crate) struct Scorer {
    rules: Rules,
    position: Sums,
    velocity: Sums,
    attitudes: Attitudes,
    horizontal: Horizontal,
    offset: OffsetFit,
    course: CourseFit,
    /// Lengths of the errors of position \[m\] and velocity \[m/s\].
    lengths: [Quantiles; 2],
    poses: Poses,
    nees_position: NeesSeries,
    /// NEES of epochs with a height only.
    nees_height: NeesSeries,
    nees_velocity: NeesSeries,
    nees_attitude: NeesSeries,
    /// The first and the latest epoch at which NEES counts.
    settled: Option<(Time, Time)>,
    drifts: Drifts,
    episodes: Option<EpisodeScorer>,
    convergence: Option<Tracker>,
}

fusion_core::memory!(Scorer {
    position,
    velocity,
    attitudes,
    horizontal,
    offset,
    course,
    lengths,
    poses,
    nees_position,
    nees_height,
    nees_velocity,
    nees_attitude,
    settled,
    drifts,
    episodes,
    convergence;
    rules
});

impl Scorer {
    /// A scorer without errors.
    #[must_use]
    pub fn new(rules: Rules) -> Self {
        Self {
            drifts: Drifts::new(&rules.outages),
            episodes: rules.episodes.clone().map(EpisodeScorer::new),
            convergence: rules.converged.map(Tracker::new),
            attitudes: Attitudes::new(rules.remove_mean_mounting),
            rules,
            position: Sums::default(),
            velocity: Sums::default(),
            horizontal: Horizontal::default(),
            offset: OffsetFit::default(),
            course: CourseFit::default(),
            lengths: Default::default(),
            poses: Poses::default(),
            nees_position: NeesSeries::default(),
            nees_height: NeesSeries::default(),
            nees_velocity: NeesSeries::default(),
            nees_attitude: NeesSeries::default(),
            settled: None,
        }
    }

    /// Takes the error at the next epoch of the reference.
    pub fn add(&mut self, error: &EpochError) {
        self.convergence.iter_mut().for_each(|tracker| tracker.add(error));
        let is_after = |start: Option<Time>| start.is_none_or(|start| error.time() >= start);
        let (counts, is_settled) = (is_after(self.rules.from), is_after(self.rules.nees_from));
        if counts && is_settled {
            self.settled = Some((self.settled.map_or(error.time(), |(first, _)| first), error.time()));
        }
        if let Some(d) = &error.position {
            if counts {
                self.offset.add(error.time(), d, error.motion.as_ref());
                self.add_position(error.time(), d, error.places.as_ref().map(|[_, truth]| truth), is_settled);
            }
            if d.is_horizontal() {
                self.drifts.add(error.time(), d);
            }
        }
        if !counts {
            return;
        }
        self.course.add(error);
        if self.rules.trajectory.is_some() {
            self.poses.add(error);
        }
        if let Some(episodes) = &mut self.episodes {
            episodes.add(error, is_settled, !self.rules.remove_mean_mounting);
        }
        if let Some(d) = &error.velocity {
            self.velocity.add(error.time(), d);
            self.lengths[1].add(d.error.norm());
            if is_settled {
                self.nees_velocity.add_deviation(d);
            }
        }
        if let Some(a) = &error.attitude {
            self.attitudes.add(error.time(), a);
            if is_settled && !self.rules.remove_mean_mounting {
                self.nees_attitude.add_deviation(&a.body);
            }
        }
    }

    /// Takes a position error that counts, along the axes that the reference knows, with the position of the reference.
    fn add_position(&mut self, time: Time, d: &Deviation, place: Option<&Geodetic>, is_settled: bool) {
        self.position.add(time, d);
        if d.is_whole() {
            self.lengths[0].add(d.error.norm());
        }
        if d.is_horizontal() {
            self.horizontal.add([d.error.x, d.error.y], place);
        }
        if is_settled {
            let nees = if d.is_horizontal() {
                &mut self.nees_position
            } else {
                &mut self.nees_height
            };
            nees.add_deviation(d);
        }
    }

    /// Takes the time at which the filter reported its alignment \[s\]: the mean mounting uses the attitudes after it.
    pub const fn align(&mut self, time: Option<f64>) {
        self.attitudes.align(time);
    }

    /// Reports that a sensor's measurement, stamped `stamp` and valid at `time`, was used.
    pub fn used(&mut self, sensor: usize, stamp: Time, time: Time) {
        self.drifts.used(sensor, stamp, time);
    }

    /// Reports that a measurement of `sensor`, called `name` and valid at `time`, moved the measured quantity by
    /// `sigmas` of its 1σ.
    pub fn moved(&mut self, sensor: usize, name: &str, time: Time, sigmas: f64) {
        self.drifts.moved(sensor, name, time, sigmas);
    }

    /// The score.
    #[must_use]
    pub fn finish(mut self) -> Score {
        let attitude_count = self.attitudes.count() as usize;
        let attitude = self.attitudes.finish();
        let [position, velocity] = self.lengths.each_mut().map(LengthSpread::of);
        let spread = Spreads {
            position,
            horizontal: LengthSpread::of(&mut self.horizontal.lengths),
            velocity,
            rotation_deg: attitude.rotation_spread,
            heading_deg: attitude.heading_spread,
        };
        let trajectory = self.rules.trajectory.as_ref();
        let trajectory = trajectory.and_then(|rules| self.poses.finish(rules, &attitude.mounting));
        let drift = self.drifts.finish();
        let span = self.settled.map_or(0.0, |(first, latest)| latest.seconds_since(first));
        let slowest = self.rules.slowest;
        let judged = |series: &NeesSeries, what: usize| {
            let found = series.consistency();
            // Without a slow error the series itself decides.
            found.map(|c| {
                if slowest[what] > 0.0 {
                    c.at_most(1.0 + span / slowest[what])
                } else {
                    c
                }
            })
        };
        Score {
            epochs: (self.position.count as usize).max(self.velocity.count as usize).max(attitude_count),
            position: self.position.axes(),
            horizontal_rms: math::sqrt(self.horizontal.squares / self.position.horizontal()),
            horizontal_max: self.horizontal.largest(),
            horizontal_median: spread.horizontal.map(|s| s.median),
            horizontal_p95: spread.horizontal.map(|s| s.p95),
            spread,
            trajectory,
            travelled: self.horizontal.travelled(),
            offset: self.offset.finish(),
            velocity: self.velocity.axes(),
            attitude_deg: attitude.axes,
            course: self.course.finish(),
            position_rmse_m: self.position.whole_rms(),
            rotation_rmse_deg: attitude.rotation,
            steep: attitude.steep as usize,
            heading_rmse_deg: attitude.heading,
            inclination_rmse_deg: attitude.inclination,
            mounting_deg: attitude.mounting_deg,
            nees_position: judged(&self.nees_position, 0),
            nees_height: judged(&self.nees_height, 0),
            nees_velocity: judged(&self.nees_velocity, 1),
            nees_attitude: judged(&self.nees_attitude, 2),
            nees_undefined: [&self.nees_position, &self.nees_velocity, &self.nees_attitude].map(NeesSeries::undefined),
            convergence: self.convergence.and_then(|tracker| tracker.finish()),
            episodes: self.episodes.map(EpisodeScorer::finish),
            blocks: Vec::new(),
            drift_rms: (!drift.is_empty())
                .then(|| math::sqrt(drift.iter().map(|d| math::powi(d.max_horizontal, 2)).sum::<f64>() / drift.len() as f64)),
            drift_median: median(drift.iter().map(|d| d.max_horizontal).collect()),
            drift,
        }
    }
}

/// The median of `values`; `None` if it is empty.
pub fn median(values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| Data::new(values).median())
}

#[cfg(test)]
mod tests {
    use super::super::{Comparison, ReferenceEpoch};
    use super::*;
    use crate::solution::Solution;
    use fusion_core::geometry::so3;
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
    fn a_slow_error_makes_few_independent_epochs() {
        let independent = |tau: f64| {
            let rules = Rules {
                slowest: [tau, 0.0, 0.0],
                ..Rules::default()
            };
            let mut scorer = Scorer::new(rules);
            let mut comparison = Comparison::new(Vector3::zeros(), (0..101).map(|k| truth(f64::from(k))));
            for k in 0..101 {
                let add = |_: &ReferenceEpoch, error: Option<&EpochError>| {
                    error.into_iter().for_each(|error| scorer.add(error));
                    Ok::<_, core::convert::Infallible>(())
                };
                // The sign changes from epoch to epoch, so the errors are not correlated.
                let north = if k % 2 == 0 { 1.0 } else { -1.5 };
                comparison.reach(&estimate(f64::from(k), north, 0.0), None, add).unwrap();
            }
            scorer.finish().nees_position.unwrap().independent
        };
        assert!(independent(0.0) > 50.0);
        // 100 s with a correlation time of 50 s: 1 + 2.
        assert_eq!(independent(50.0), 3.0);
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
            comparison.reach(&estimate(t, n, e), None, add).unwrap();
        }
        let score = scorer.finish();
        // Geodetic ⊞/⊟ about points metres apart agree to 1e-5 relative.
        assert!(
            (score.horizontal_rms - ((25.0 + 100.0 + 117.0) / 5.0_f64).sqrt()).abs() < 1e-4,
            "{score:?}"
        );
        // The values 0, 5, 10, √117 and 0 m.
        let [median, p95] = [score.horizontal_median, score.horizontal_p95].map(Option::unwrap);
        assert!((median - 5.0).abs() < 1e-4 && (p95 - 117_f64.sqrt()).abs() < 1e-4, "{score:?}");
        assert!((score.drift[0].max_horizontal - 117_f64.sqrt()).abs() < 1e-3);
        assert!((score.drift[0].growth - 1.0).abs() < 1e-3);
        assert!((score.nees_position.unwrap().mean - (25.0 + 100.0 + 117.0) / 5.0 / 4.0).abs() < 1e-3);
        let attitude = score.attitude_deg.unwrap();
        // 1e-9 deg: rounding of trigonometric functions.
        assert!(attitude.rms[2] < 1e-9 && (score.mounting_deg.unwrap()[2] - 0.2_f64.to_degrees()).abs() < 1e-9);
    }
}
