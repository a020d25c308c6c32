//! The figures of a run, and what is kept of them over the runs.

use super::RunRow;
use fusion::observe::{Disturbed, RejectionStreak, SensorStatistics};
use fusion::score::{Consistency, Drift, Moments};
use fusion_core::math;
use fusion_models::sim::{Leg, Record};

/// A figure of which the spread over the runs is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Figure {
    /// Position error RMS, by axis.
    Rms(usize),
    /// Largest position error, by axis.
    Max(usize),
    /// Velocity error RMS, by axis.
    VelocityRms(usize),
    /// Attitude error RMS, by axis.
    AttitudeRms(usize),
    /// RMS of the length of the position error.
    PositionRmse,
    /// RMS over declared outages of the largest horizontal error.
    Drift,
    /// The change of the horizontal error in % of the distance travelled.
    DriftPercent,
    /// Share of the time in a state worse than aligning.
    Ill,
    /// One of the [figures of control](CONTROL).
    Control(usize),
    /// RMS of the innovations, by sensor and residual row.
    InnovationRms(usize, usize),
    /// Largest innovation, by sensor and residual row.
    InnovationMax(usize, usize),
}

/// The figures of a controlled vehicle: heading at the end of a task, overshoot of the heading, distance across at the
/// end of a task, distance from the target at the end of a task, the largest of each; distance from start to end; way.
pub const CONTROL: [fn(&Record) -> f64; 6] = [
    |r| most(r, |leg| Some(leg.heading?.errors.last)),
    |r| most(r, |leg| Some(leg.heading?.overshoot)),
    |r| most(r, |leg| Some(leg.across?.last)),
    |r| most(r, |leg| leg.miss.map(|[n, e]| math::hypot(n, e))),
    |r| math::hypot(r.closure[0], r.closure[1]),
    |r| r.way,
];

/// The largest size of a figure among the tasks.
fn most(record: &Record, figure: fn(&Leg) -> Option<f64>) -> f64 {
    record.legs.iter().filter_map(figure).map(f64::abs).fold(0.0, f64::max)
}

impl Figure {
    /// Passes every figure that a run has.
    pub(super) fn each(row: &RunRow, add: &mut dyn FnMut(Self, f64)) {
        for k in 0..3 {
            add(Self::Rms(k), row.rms[k]);
            add(Self::Max(k), row.max[k]);
            add(Self::VelocityRms(k), row.velocity_rms[k]);
            add(Self::AttitudeRms(k), row.attitude_rms[k]);
        }
        add(Self::PositionRmse, row.position_rmse);
        add(Self::Ill, row.health.ill);
        row.drift_rms.into_iter().for_each(|d| add(Self::Drift, d));
        row.drift_percent.into_iter().for_each(|d| add(Self::DriftPercent, d));
        if let Some(record) = &row.control {
            CONTROL.iter().enumerate().for_each(|(k, of)| add(Self::Control(k), of(record)));
        }
        for (i, sensor) in row.sensors.iter().enumerate().filter(|(_, s)| s.innovations.count > 0) {
            let (rms, max) = (&sensor.innovations.rms, &sensor.innovations.max);
            rms.iter().enumerate().for_each(|(k, v)| add(Self::InnovationRms(i, k), *v));
            max.iter().enumerate().for_each(|(k, v)| add(Self::InnovationMax(i, k), *v));
        }
    }
}

/// A mean χ² statistic that each run has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Statistic {
    /// NEES of position, velocity, attitude.
    Nees(usize),
    /// The same within (0) and outside (1) declared episodes.
    Episodes(usize, usize),
    /// NEES of a block.
    Block(usize),
    /// NIS of a sensor.
    Nis(usize),
}

impl Statistic {
    /// Passes every statistic that a run has.
    pub(super) fn each(row: &RunRow, add: &mut dyn FnMut(Self, Consistency)) {
        let mut known = |statistic, value: Option<Consistency>| value.into_iter().for_each(|value| add(statistic, value));
        for k in 0..3 {
            known(Self::Nees(k), row.nees[k]);
            for (part, (_, score)) in row.episodes.iter().flat_map(|e| e.parts().enumerate()) {
                known(Self::Episodes(part, k), score.nees[k]);
            }
        }
        row.blocks.iter().enumerate().for_each(|(i, b)| known(Self::Block(i), b.nees));
        row.sensors.iter().enumerate().for_each(|(i, s)| known(Self::Nis(i), s.nis));
    }
}

/// Mean, standard deviation, smallest and largest over the runs.
#[derive(Clone, Copy, Debug)]
pub struct RunSpread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// The spread of a figure, of which the values come one by one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tally {
    moments: Moments,
    min: f64,
    max: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            moments: Moments::default(),
            min: f64::MAX,
            max: f64::MIN,
        }
    }
}

impl Tally {
    /// Adds a value, if it is finite.
    pub(super) fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.moments.add(value);
            (self.min, self.max) = (self.min.min(value), self.max.max(value));
        }
    }

    pub(super) fn spread(&self) -> Option<RunSpread> {
        let n = self.moments.count();
        (n > 0.0).then(|| RunSpread {
            mean: self.moments.mean(),
            std: math::sqrt(self.moments.squares() / (n - 1.0).max(1.0)),
            min: self.min,
            max: self.max,
        })
    }
}

/// The errors of an axis of a block at the end of the runs, and the 1σ that the filter gives for them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ends {
    squares: Moments,
    sigma: Moments,
    inside: Moments,
}

impl Ends {
    pub(super) fn add(&mut self, error: f64, sigma: f64) {
        self.squares.add(error * error);
        self.sigma.add(sigma);
        self.inside.add(f64::from(error.abs() <= 3.0 * sigma));
    }

    /// RMS error, mean 1σ, and the share of the errors inside 3σ.
    #[must_use]
    pub fn figures(&self) -> [f64; 3] {
        [math::sqrt(self.squares.mean()), self.sigma.mean(), self.inside.mean()]
    }
}

/// A declared outage over the runs.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutageTally {
    /// Start \[s\].
    pub from: f64,
    /// End \[s\].
    pub to: f64,
    /// Runs that have it.
    pub runs: usize,
    max: f64,
    /// Squared error at its end, 3σ there, squared ratio of both, inside 3σ.
    means: [Moments; 4],
}

impl OutageTally {
    pub(super) fn add(&mut self, d: &Drift) {
        (self.from, self.to) = (d.from, d.to);
        self.runs += 1;
        self.max = self.max.max(d.end_horizontal);
        let ratio = d.end_ratio();
        let values = [
            math::powi(d.end_horizontal, 2),
            3.0 * d.end_sigma,
            math::powi(ratio, 2),
            f64::from(ratio <= 3.0),
        ];
        self.means.iter_mut().zip(values).for_each(|(mean, value)| mean.add(value));
    }

    /// At its end: RMS error, largest error, mean 3σ, RMS of the error in σ, share of the errors inside 3σ.
    #[must_use]
    pub fn figures(&self) -> [f64; 5] {
        let [squares, sigma, ratio, inside] = self.means.each_ref().map(Moments::mean);
        [math::sqrt(squares), self.max, sigma, math::sqrt(ratio), inside]
    }
}

/// A sensor over the runs.
#[derive(Clone, Debug)]
pub struct SensorTally {
    /// Its names and units; its counts are sums, its streak has the most of either kind.
    pub all: SensorStatistics,
    /// Runs at whose end its gate counted it as denied.
    pub denied: usize,
}

impl SensorTally {
    /// Without counts.
    pub(super) fn new(like: &SensorStatistics) -> Self {
        Self {
            all: SensorStatistics {
                name: like.name.clone(),
                innovations: like.innovations.clone(),
                ..SensorStatistics::default()
            },
            denied: 0,
        }
    }

    pub(super) fn add(&mut self, s: &SensorStatistics) {
        let all = &mut self.all;
        let sums = [
            (&mut all.accepted, s.accepted),
            (&mut all.rejected, s.rejected),
            (&mut all.reacquired, s.reacquired),
            (&mut all.unusable, s.unusable),
        ];
        sums.into_iter().for_each(|(sum, count)| *sum += count);
        if let Some(d) = s.disturbed {
            let sum = all.disturbed.unwrap_or_default();
            all.disturbed = Some(Disturbed {
                missed: sum.missed + d.missed,
                caught: sum.caught + d.caught,
                false_rejections: sum.false_rejections + d.false_rejections,
            });
        }
        if let Some(streak) = s.longest_rejection_streak {
            let most = all.longest_rejection_streak.unwrap_or(streak);
            all.longest_rejection_streak = Some(RejectionStreak {
                measurements: most.measurements.max(streak.measurements),
                seconds: most.seconds.max(streak.seconds),
                ..most
            });
        }
        self.denied += usize::from(s.ends_denied);
    }
}
