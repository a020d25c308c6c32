//! The outcomes of each sensor's measurements: counts, rejection streaks of its gate, innovations.

use super::page::Page;
use super::{Entry, Filters, HeardSensor, Listed, RunEnd, RunEvent, RunObserver, SectionObserver, Summary};
use crate::score::{Consistency, Quantiles, Series};
use core::ops::Range;
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt, StreamId};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The maximum number of re-acquisition times that are kept.
const REACQUIRED: usize = 10;

/// How the filter treated the rows that declared faults changed, and the other rows.
///
/// Only numbers that the sensor itself reads count: its channel, and the 1σ in the same row. The output of a stage for
/// a disturbed row does not count as disturbed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Disturbed {
    /// Disturbed rows that were used.
    pub missed: u64,
    /// Disturbed rows that were rejected.
    pub caught: u64,
    /// Undisturbed rows that were rejected. In a recorded log some of them may be wrong.
    pub false_rejections: u64,
}

/// Consecutive rejected measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RejectionStreak {
    /// Time of the first \[s\].
    pub from: f64,
    /// The number of measurements.
    pub measurements: u64,
    /// From the first measurement to the next one that was used, or to the end of the run \[s\].
    pub seconds: f64,
}

/// The innovations r = z ⊟ h(x̂) of accepted measurements: sensor minus estimate before the update. They count from
/// `[reference] from` on, if the design has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Innovations {
    /// Measurements counted.
    pub count: u64,
    /// Name of each residual row; empty if they have no names.
    pub axis: Vec<String>,
    /// SI unit per residual row.
    pub unit: Vec<String>,
    /// Root mean square per residual row; 0 if no measurement is counted.
    pub rms: Vec<f64>,
    /// Largest magnitude per residual row; 0 if no measurement is counted.
    pub max: Vec<f64>,
    /// Time of the largest magnitude \[s\].
    pub max_time: Vec<f64>,
    /// Autocorrelation at lag 1 of the innovations in units of their σ, from −1 to 1. With correct models it is 0,
    /// within 2/√count. 0 if no measurement is counted.
    pub lag_1: Vec<f64>,
    /// Mean per residual row; 0 if no measurement is counted.
    pub mean: Vec<f64>,
    /// The mean of the innovations in units of their σ, divided by its own 1σ. This 1σ includes the correlation of
    /// neighbours. 0 if no measurement is counted.
    pub mean_sigmas: Vec<f64>,
    /// The effective number of independent measurements. A mean that is not 0 counts as a slow error.
    pub independent: Vec<f64>,
}

/// The outcomes of a sensor's measurements.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
pub struct SensorStatistics {
    /// The sensor.
    pub name: String,
    /// Measurements that corrected the estimate.
    pub accepted: u64,
    /// Measurements that its gate rejected.
    pub rejected: u64,
    /// Rejected measurements that its gate did not judge: its leader's measurement (`only_with`) was rejected.
    pub with_leader: u64,
    /// Measurements that its gate re-acquired, against the estimate.
    pub reacquired: u64,
    /// Times of re-acquisitions after rejections \[s\]: the first ten.
    pub reacquired_at: Vec<f64>,
    /// Measurements without a value at the estimate, or that could not be used.
    pub unusable: u64,
    /// Counts of disturbed rows, if a declared fault may change the numbers that it reads.
    pub disturbed: Option<Disturbed>,
    /// The longest rejection streak; `None` if no measurement was rejected.
    pub longest_rejection_streak: Option<RejectionStreak>,
    /// True if its gate counted it as denied at the end.
    pub ends_denied: bool,
    /// Mean NIS, with its band, of the accepted measurements that [`Innovations`] counts. A gate that rejects good
    /// measurements lowers it.
    pub nis: Option<Consistency>,
    /// Innovations of accepted measurements.
    pub innovations: Innovations,
    /// The time since which its measurements, including rejected ones, disagree with the estimate more than chance
    /// allows \[s\]. `None` if they never did.
    pub disagrees_from: Option<f64>,
    /// The power of its gate, per residual row in SI: the smallest error of that row alone that the gate would have
    /// rejected. It is the median over the judged measurements. Infinite (`null` in JSON) if the gate would reject no
    /// error. Empty if no measurement was judged.
    #[schemars(with = "Vec<Option<f64>>")]
    pub gate_power: Vec<f64>,
}

/// Follows the sensors of all filters through a run.
#[derive(Debug)]
pub struct Statistics(Box<[Follower]>);

impl Statistics {
    /// Innovations count from `from` on. Faults may change the columns `disturbable` of the outer streams. Inside a
    /// stage, disturbed rows are reported, but the columns that may be disturbed are not known.
    #[must_use]
    pub fn new(filters: &Filters, from: Option<Time>, disturbable: &[(StreamId, Range<usize>)]) -> Self {
        let of_filter = |f: &super::Heard| if f.is_outermost() { disturbable } else { &[] };
        let sensors = filters.iter().flat_map(|f| f.sensors.iter().map(move |s| (s, of_filter(f))));
        Self(
            sensors
                .map(|(sensor, disturbable)| Follower::new(sensor, from, disturbable))
                .collect(),
        )
    }
}

impl Listed for SensorStatistics {
    const NAME: &'static str = "sensors";
}

impl SectionObserver for Statistics {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let last = end.assembly.runner.belief().time;
        let sensors: Vec<SensorStatistics> = self.0.into_iter().map(|f| f.finish(last)).collect();
        Ok(sensors.into())
    }
}

impl Summary {
    /// The sensors of all filters.
    #[must_use]
    pub fn sensors(&self) -> &[SensorStatistics] {
        self.list()
    }
}

impl Memory for Statistics {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

fusion_core::memory!(Follower { statistics, nis, power, rows, streak, page; from });
fusion_core::memory!(SensorStatistics {
    accepted,
    rejected,
    with_leader,
    reacquired,
    reacquired_at,
    unusable,
    disturbed,
    longest_rejection_streak,
    ends_denied,
    innovations,
    disagrees_from;
    name,
    nis,
    gate_power
});
fusion_core::memory!(Disturbed {
    missed,
    caught,
    false_rejections
});
fusion_core::memory!(RejectionStreak {
    from,
    measurements,
    seconds
});
fusion_core::memory!(Innovations { count, max, max_time; axis, unit, rms, lag_1, mean, mean_sigmas, independent });
fusion_core::memory!(Row {
    sum,
    squares,
    pairs,
    scaled
});
fusion_core::memory!(Pairs { latest, own, products });

impl RunObserver for Statistics {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, row },
        } = event
        {
            self.0[filter.first_sensor + sensor].judged(*time, row.disturbed, update);
        }
        Ok(())
    }
}

/// Follows one sensor through a run.
#[derive(Debug)]
struct Follower {
    statistics: SensorStatistics,
    nis: Series,
    /// The smallest rejected errors, for each residual row.
    power: Box<[Quantiles]>,
    /// The innovations of each residual row.
    rows: Box<[Row]>,
    /// Innovations count from this time on.
    from: Option<Time>,
    /// The time of the first measurement of the current rejection streak, and the number of its measurements.
    streak: Option<(Time, u64)>,
    page: Page,
}

/// The innovations of a residual row.
#[derive(Clone, Debug)]
struct Row {
    sum: f64,
    squares: f64,
    pairs: Pairs,
    /// The innovations in units of their σ.
    scaled: Series,
}

impl Default for Row {
    fn default() -> Self {
        Self {
            sum: 0.0,
            squares: 0.0,
            pairs: Pairs::default(),
            scaled: Series::coarse(),
        }
    }
}

impl Row {
    /// Adds an innovation.
    fn add(&mut self, r: f64) {
        self.sum += r;
        self.squares += r * r;
    }

    /// Adds an innovation in units of its σ, if it has a σ.
    fn add_scaled(&mut self, u: f64) {
        if u.is_finite() {
            self.pairs.add(u);
            self.scaled.push(u);
        }
    }
}

/// Sums of the products of a residual row, in units of its σ, with itself and with the next one.
#[derive(Clone, Copy, Debug, Default)]
struct Pairs {
    latest: f64,
    own: f64,
    products: f64,
}

impl Pairs {
    fn add(&mut self, u: f64) {
        self.own += u * u;
        self.products += u * self.latest;
        self.latest = u;
    }

    fn correlation(&self) -> f64 {
        if self.own > 0.0 { self.products / self.own } else { 0.0 }
    }
}

impl Follower {
    /// Follows `sensor`, whose rows may be `disturbable`: streams and columns.
    fn new(sensor: &HeardSensor, from: Option<Time>, disturbable: &[(StreamId, Range<usize>)]) -> Self {
        let m = sensor.rows.len();
        let may_be = disturbable.iter().any(|(stream, columns)| sensor.reads_any(*stream, columns));
        Self {
            statistics: SensorStatistics {
                name: sensor.name.clone(),
                innovations: Innovations {
                    count: 0,
                    axis: sensor.axes.iter().map(|axis| (*axis).to_owned()).collect(),
                    unit: sensor.rows.iter().map(ToString::to_string).collect(),
                    rms: vec![0.0; m],
                    max: vec![0.0; m],
                    max_time: vec![0.0; m],
                    lag_1: vec![0.0; m],
                    ..Innovations::default()
                },
                disturbed: may_be.then(Disturbed::default),
                ..SensorStatistics::default()
            },
            nis: Series::default(),
            power: vec![Quantiles::default(); m].into(),
            rows: vec![Row::default(); m].into(),
            from,
            streak: None,
            page: Page::default(),
        }
    }

    /// Hears the outcome of a measurement.
    fn judged(&mut self, time: Time, was_disturbed: bool, update: &Update<'_>) {
        let statistics = &mut self.statistics;
        let is_used = match update.verdict {
            Verdict::Accepted => {
                statistics.accepted += 1;
                true
            }
            Verdict::Reacquired => {
                statistics.reacquired += 1;
                // A bank may re-acquire a sensor without a rejection before.
                if self.streak.is_some() && statistics.reacquired_at.len() < REACQUIRED {
                    statistics.reacquired_at.push(time.seconds());
                }
                true
            }
            Verdict::Rejected => {
                statistics.rejected += 1;
                statistics.with_leader += u64::from(update.threshold == f64::INFINITY);
                false
            }
            Verdict::Undefined(_) | Verdict::Unusable => {
                statistics.unusable += 1;
                return;
            }
        };
        statistics.ends_denied = update.mode == Mode::Denied;
        for (all, power) in self.power.iter_mut().zip(update.power) {
            all.add(*power);
        }
        if let Some(d) = &mut statistics.disturbed {
            d.missed += u64::from(is_used && was_disturbed);
            d.caught += u64::from(!is_used && was_disturbed);
            d.false_rejections += u64::from(!is_used && !was_disturbed);
        }
        if is_used {
            self.end_streak(time);
        } else {
            self.streak.get_or_insert((time, 0)).1 += 1;
        }
        let is_counted = self.from.is_none_or(|from| time >= from);
        // A rejection of the leader says nothing about this sensor.
        let is_judged = is_used || update.threshold < f64::INFINITY;
        if is_counted && is_judged && self.statistics.disagrees_from.is_none() {
            let since = self.page.hear(time, update.nis, update.residual.len() as f64);
            self.statistics.disagrees_from = since.map(Time::seconds);
        }
        if update.verdict == Verdict::Accepted && is_counted {
            self.nis.push(update.nis);
            self.statistics.innovations.count += 1;
            let Innovations { max, max_time, .. } = &mut self.statistics.innovations;
            for (row, r) in self.rows.iter_mut().zip(update.residual) {
                row.add(*r);
            }
            let scaled = update.residual.iter().zip(update.innovation_sigma).map(|(r, sigma)| r / sigma);
            for (row, u) in self.rows.iter_mut().zip(scaled) {
                row.add_scaled(u);
            }
            for (r, (max, at)) in update.residual.iter().zip(max.iter_mut().zip(max_time)) {
                if r.abs() > *max {
                    (*max, *at) = (r.abs(), time.seconds());
                }
            }
        }
    }

    fn end_streak(&mut self, end: Time) {
        let Some((first, measurements)) = self.streak.take() else { return };
        let streak = RejectionStreak {
            from: first.seconds(),
            measurements,
            seconds: end.seconds_since(first),
        };
        let size = |r: &RejectionStreak| (r.measurements, r.seconds);
        let longest = &mut self.statistics.longest_rejection_streak;
        if longest.as_ref().is_none_or(|l| size(&streak) > size(l)) {
            *longest = Some(streak);
        }
    }

    /// The statistics of a run that ends at `end`.
    fn finish(mut self, end: Time) -> SensorStatistics {
        self.end_streak(end);
        let innovations = &mut self.statistics.innovations;
        let count = innovations.count.max(1) as f64;
        innovations.rms = self.rows.iter().map(|row| math::sqrt(row.squares / count)).collect();
        innovations.lag_1 = self.rows.iter().map(|row| row.pairs.correlation()).collect();
        innovations.mean = self.rows.iter().map(|row| row.sum / count).collect();
        innovations.mean_sigmas = self.rows.iter().map(|row| row.scaled.mean_sigmas()).collect();
        innovations.independent = self.rows.iter().map(|row| row.scaled.independent_about_zero()).collect();
        self.statistics.gate_power = self.power.iter_mut().filter_map(median).collect();
        // If every row is disturbed, there are no good rows to compare with.
        let judged = self.statistics.accepted + self.statistics.rejected + self.statistics.reacquired;
        self.statistics.disturbed = (self.statistics.disturbed).filter(|d| judged == 0 || d.missed + d.caught < judged);
        self.statistics.nis = Consistency::of(&self.nis, innovations.unit.len());
        self.statistics
    }
}

/// The median of `values`; the upper of two.
fn median(values: &mut Quantiles) -> Option<f64> {
    values.at(values.len() / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A follower of one residual row, with some disturbed rows.
    fn follower() -> Follower {
        Follower {
            statistics: SensorStatistics {
                disturbed: Some(Disturbed::default()),
                ..SensorStatistics::default()
            },
            nis: Series::default(),
            power: Box::new([Quantiles::default()]),
            rows: Box::new([Row::default()]),
            from: Some(at(2.0)),
            streak: None,
            page: Page::default(),
        }
    }

    fn at(t: f64) -> Time {
        Time::from_seconds(t)
    }

    fn judge(f: &mut Follower, t: f64, verdict: Verdict, residual: f64, mode: Mode) {
        f.judged(at(t), false, &update(verdict, &[residual], mode));
    }

    fn update(verdict: Verdict, residual: &[f64], mode: Mode) -> Update<'_> {
        Update {
            verdict,
            value: &[],
            predicted: &[],
            noise: &[],
            residual,
            innovation_sigma: &[],
            innovation_factor: &[],
            nis: 1.0,
            statistic: 1.0,
            threshold: 1.0,
            mode,
            power: &[],
            weight: 1.0,
            rivals: fusion_core::filter::Rivals::NONE,
            jacobian: None,
        }
    }

    #[test]
    fn disturbed_rows_are_caught_or_missed_and_others_rejected_by_mistake() {
        use Verdict::{Accepted, Reacquired, Rejected, Unusable};
        let mut f = follower();
        let judged = [
            (true, Accepted),
            (true, Reacquired),
            (true, Rejected),
            (false, Rejected),
            (false, Rejected),
            (false, Accepted),
            (true, Unusable),
        ];
        for (t, (was_disturbed, verdict)) in judged.into_iter().enumerate() {
            f.judged(at(t as f64), was_disturbed, &update(verdict, &[0.0], Mode::Track));
        }
        let expected = Disturbed {
            missed: 2,
            caught: 1,
            false_rejections: 2,
        };
        assert_eq!(f.finish(at(8.0)).disturbed, Some(expected));
    }

    #[test]
    fn the_longest_rejection_streak_ends_with_the_next_measurement_used_or_with_the_run() {
        use Verdict::{Accepted, Reacquired, Rejected, Unusable};
        let mut f = follower();
        let verdicts = [Rejected, Accepted, Rejected, Unusable, Rejected, Reacquired, Rejected, Rejected];
        for (t, verdict) in verdicts.into_iter().enumerate() {
            // An unusable measurement is not judged, so its mode does not matter.
            let mode = if verdict == Rejected { Mode::Denied } else { Mode::Track };
            judge(&mut f, t as f64, verdict, 0.0, mode);
        }
        judge(&mut f, 8.0, Unusable, 0.0, Mode::Track);
        let streak = |from, seconds| {
            Some(RejectionStreak {
                from,
                measurements: 2,
                seconds,
            })
        };
        let (mut early, mut late) = (follower(), follower());
        for f in [&mut early, &mut late] {
            f.streak = Some((at(6.0), 2));
            f.statistics.longest_rejection_streak = streak(2.0, 3.0);
        }
        // The longest streak has the most measurements, then the longest duration; of equal streaks the first counts.
        assert_eq!(early.finish(at(9.0)).longest_rejection_streak, streak(2.0, 3.0));
        assert_eq!(late.finish(at(9.5)).longest_rejection_streak, streak(6.0, 3.5));
        let found = f.finish(at(9.0));
        assert_eq!((found.longest_rejection_streak, found.ends_denied), (streak(2.0, 3.0), true));
    }

    #[test]
    fn the_power_of_the_gate_is_the_median_of_what_was_judged() {
        use Verdict::{Accepted, Rejected, Unusable};
        let mut f = follower();
        let judged = [(4.0, Accepted), (f64::INFINITY, Accepted), (2.0, Rejected), (0.5, Unusable)];
        for (t, (power, verdict)) in judged.into_iter().enumerate() {
            let update = Update {
                power: &[power],
                ..update(verdict, &[0.0], Mode::Track)
            };
            f.judged(at(t as f64), false, &update);
        }
        assert_eq!(f.finish(at(8.0)).gate_power, [4.0]);
        assert!(follower().finish(at(8.0)).gate_power.is_empty());
    }

    #[test]
    fn a_slow_error_correlates_with_the_next_one_and_a_change_of_sign_against_it() {
        let lag_1 = |residuals: &[f64]| {
            let mut f = follower();
            for (k, r) in residuals.iter().enumerate() {
                let update = Update {
                    innovation_sigma: &[0.5],
                    innovation_factor: &[],
                    ..update(Verdict::Accepted, core::slice::from_ref(r), Mode::Track)
                };
                f.judged(at(10.0 + k as f64), false, &update);
            }
            f.finish(at(99.0)).innovations.lag_1[0]
        };
        // All pairs count, and four values have three pairs: 3 of 4.
        assert_eq!(lag_1(&[2.0, 2.0, 2.0, 2.0]), 0.75);
        assert_eq!(lag_1(&[2.0, -2.0, 2.0, -2.0]), -0.75);
        assert_eq!(lag_1(&[1.0, 1.0, -1.0, -1.0, 1.0]), 0.0);
        assert_eq!(lag_1(&[]), 0.0);
    }

    #[test]
    fn a_mean_is_told_in_its_own_sigma_and_an_error_that_lasts_by_how_few_are_independent() {
        let of = |residual: &dyn Fn(u32) -> f64| {
            let mut f = follower();
            for k in 0..400 {
                let residual = [residual(k)];
                let update = Update {
                    innovation_sigma: &[0.5],
                    innovation_factor: &[],
                    ..update(Verdict::Accepted, &residual, Mode::Track)
                };
                f.judged(at(10.0 + f64::from(k)), false, &update);
            }
            f.finish(at(999.0)).innovations
        };
        // ±2 in alternation, with and without a mean of 0.5: √400 = 20, each with a 1σ of 2.
        let turns = |k: u32| if k.is_multiple_of(2) { 2.0 } else { -2.0 };
        let found = of(&turns);
        assert_eq!((found.mean[0], found.mean_sigmas[0], found.independent[0]), (0.0, 0.0, 400.0));
        let found = of(&|k| turns(k) + 0.5);
        assert_eq!((found.mean[0], found.mean_sigmas[0]), (0.5, 5.0));
        // Blocks of 20 equal values: τ is 20.
        let found = of(&|k| turns(k / 20));
        assert!((10.0..40.0).contains(&found.independent[0]), "{found:?}");
        assert!(found.mean_sigmas[0].abs() < 1e-9);
    }

    #[test]
    fn innovations_are_those_of_accepted_measurements_in_the_window() {
        use Verdict::{Accepted, Reacquired, Rejected};
        let mut f = follower();
        let innovations = &mut f.statistics.innovations;
        (innovations.max, innovations.max_time) = (vec![0.0], vec![0.0]);
        let judged = [
            (1.0, Accepted, 50.0),
            (2.0, Accepted, 3.0),
            (3.0, Rejected, 90.0),
            (4.0, Reacquired, 70.0),
            (5.0, Accepted, -4.0),
        ];
        for (t, verdict, r) in judged {
            judge(&mut f, t, verdict, r, Mode::Track);
        }
        let found = f.finish(at(6.0)).innovations;
        assert_eq!(
            (found.count, &found.rms[..], &found.max[..], &found.max_time[..]),
            (2, &[12.5_f64.sqrt()][..], &[4.0][..], &[5.0][..])
        );
    }
}
