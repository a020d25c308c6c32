//! The verdicts on a case, compared with the undisturbed run.
//!
//! At each epoch, with the error e of the disturbed run and e₀ of the undisturbed one,
//!
//! ```text
//! r = max over axes of min(|e|, |e − e₀|) / σ
//! x = min(‖e‖, ‖e − e₀‖) / RMS of ‖e₀‖ over the undisturbed run
//! ```
//!
//! and the larger of each where several kinds of error are judged. An error is *large* if r > 3 or x > 2. Where there is
//! no reference, e₀ is 0 and the RMS is that of the undisturbed filter's own σ.

use super::super::cases::Case;
use super::super::errors::Errors;
use super::super::survey::Survey;
use super::super::watch::{Change, Record, Sample, WRONG};
use super::Draw;
use fusion_core::health::State;
use fusion_core::math;
use fusion_core::time::Time;
use serde::{Deserialize, Serialize};

/// An error is large beyond this multiple of the undisturbed root mean square.
const TIMES: f64 = 2.0;

/// A good health is false if the error is beyond this many σ.
const FALSE: f64 = 10.0;
/// For at least this long \[s\].
const FALSE_FOR: f64 = 3.0;

/// The verdicts on a case, and the figures behind them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// Whether the error is small at the end.
    pub recovered: bool,
    /// Whether the health was good while the error was beyond 10σ.
    pub false_good: bool,
    /// Whether it was degraded or lost, and the error never large.
    pub false_alarm: bool,
    /// Whether it was so for long after the error had returned.
    pub late_good: bool,
    /// The greatest error, in σ and in undisturbed RMS; `None` without an estimate.
    pub worst: Option<(f64, f64)>,
    /// The root mean square of both over the end of the run; `None` without an estimate.
    pub end: Option<(f64, f64)>,
    /// The longest time that the health was good while the error was beyond 10σ \[s\].
    pub unsaid: f64,
    /// From the end of the faults until the error was large for the last time \[s\].
    pub large: f64,
    /// How long the health was degraded or lost while that of the undisturbed run was not: in all, and after the error
    /// had returned \[s\].
    pub alarm: [f64; 2],
    /// Why the run stopped before its end.
    pub stopped: Option<String>,
}

impl Judged {
    /// The bad verdicts in words.
    #[must_use]
    pub fn words(&self) -> Vec<&'static str> {
        let said = [
            (!self.recovered, "not recovered"),
            (self.false_good, "false good"),
            (self.false_alarm, "false alarm"),
            (self.late_good, "late good"),
        ];
        said.into_iter().filter(|(is_so, _)| *is_so).map(|(_, word)| word).collect()
    }
}

/// The undisturbed run, with which the others are compared.
#[derive(Debug)]
pub(super) struct Baseline<'a> {
    survey: &'a Survey,
    changes: Vec<Change>,
    end: Time,
    over: f64,
    late: f64,
    /// The judged groups of errors, each with its RMS.
    pub(super) groups: Vec<(usize, f64)>,
}

impl<'a> Baseline<'a> {
    pub(super) fn new(record: &Record, survey: &'a Survey, limits: &Draw) -> Self {
        let rms = |group: usize| {
            let squares = record.samples.iter().filter_map(|s| {
                let (e, sigma) = s.errors?.groups[group]?;
                let known = sigma.iter().any(|s| s.is_finite());
                // Without a reference it is compared with itself.
                let size = if survey.errors.is_empty() {
                    sigma.map(|s| if s.is_finite() { s } else { 0.0 }).norm_squared()
                } else {
                    e.norm_squared()
                };
                (known && size.is_finite()).then_some(size)
            });
            let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), size| (sum + size, n + 1.0));
            (count > 0.0).then(|| (group, math::sqrt(sum / count).max(f64::MIN_POSITIVE)))
        };
        let groups: Vec<(usize, f64)> = if limits.of.is_empty() {
            (0..3).find_map(rms).into_iter().collect()
        } else {
            limits.of.iter().filter_map(|group| rms(*group)).collect()
        };
        let is_judged = |s: &&Sample| s.errors.is_some_and(|e| groups.iter().any(|(group, _)| e.groups[*group].is_some()));
        Self {
            survey,
            changes: record.changes.clone(),
            end: record.samples.iter().rev().find(is_judged).map_or(survey.end(), |s| s.time),
            over: limits.over,
            late: limits.late,
            groups,
        }
    }

    /// The error at an epoch, in σ and in undisturbed RMS.
    fn size(&self, errors: &Errors) -> Option<(f64, f64)> {
        let before = self.survey.errors_at(errors.time);
        let sizes = self.groups.iter().filter_map(|(group, rms)| {
            let (ratio, length) = errors.caused(before, *group)?;
            Some((ratio, length / rms))
        });
        sizes.reduce(|a, b| (greater(a.0, b.0), greater(a.1, b.1)))
    }

    pub(super) fn judge(&self, record: &Record, case: &Case, stopped: Option<String>) -> Judged {
        // An epoch of the reference that has nothing to be judged says nothing.
        let size = |Sample { time, errors }: &Sample| match errors {
            None => Some((*time, None)),
            Some(errors) => self.size(errors).map(|size| (*time, Some(size))),
        };
        let sizes: Vec<(Time, Option<(f64, f64)>)> = record.samples.iter().filter_map(size).collect();
        let is_large = |(ratio, times): &(f64, f64)| !(*ratio <= WRONG && *times <= TIMES);
        let mut judged = Judged::default();
        let (mut false_since, mut last_large): (Option<Time>, Option<Time>) = (None, None);
        for (time, size) in &sizes {
            // No estimate is neither small nor a false good.
            if size.as_ref().is_none_or(is_large) {
                last_large = Some(*time);
            }
            let is_false = size.is_some_and(|(ratio, _)| ratio > FALSE) && state(&record.changes, *time) == State::Good;
            let since = if is_false { *false_since.get_or_insert(*time) } else { *time };
            false_since = false_since.filter(|_| is_false);
            judged.unsaid = judged.unsaid.max(time.seconds_since(since));
            if let Some(size) = size {
                let (ratio, times) = judged.worst.unwrap_or((0.0, 0.0));
                judged.worst = Some((greater(ratio, size.0), greater(times, size.1)));
            }
        }
        judged.end = self.at_end(&sizes);
        judged.recovered = stopped.is_none() && judged.end.is_some_and(|end| !is_large(&end));
        judged.false_good = judged.unsaid >= FALSE_FOR;
        let returned = last_large.map_or(case.to, |t| t.max(case.to));
        judged.large = returned.seconds_since(case.to);
        judged.alarm = [case.from, returned].map(|since| self.alarm(&record.changes, since));
        judged.false_alarm = last_large.is_none() && judged.alarm[0] > 0.0;
        judged.late_good = judged.recovered && judged.alarm[1] > self.late;
        judged.stopped = stopped;
        judged
    }

    /// The root mean square over the end of the run; `None` without an estimate.
    fn at_end(&self, sizes: &[(Time, Option<(f64, f64)>)]) -> Option<(f64, f64)> {
        let since = self.end.seconds() - self.over;
        let last = &sizes[sizes.partition_point(|(time, _)| time.seconds() < since)..];
        let mut sums = (0.0, 0.0);
        for (_, size) in last {
            let (ratio, times) = (*size)?;
            sums = (sums.0 + ratio * ratio, sums.1 + times * times);
        }
        let n = last.len() as f64;
        (n > 0.0).then(|| (math::sqrt(sums.0 / n), math::sqrt(sums.1 / n)))
    }

    /// How long the health is degraded or lost from `since` to the end, and that of the undisturbed run is not \[s\].
    fn alarm(&self, changes: &[Change], since: Time) -> f64 {
        let mut times: Vec<Time> = changes.iter().chain(&self.changes).map(|c| c.time).collect();
        times.extend([since, self.end]);
        times.retain(|t| (since..=self.end).contains(t));
        times.sort_unstable();
        let is_alarm = |t: Time| state(changes, t) >= State::Degraded && state(&self.changes, t) < State::Degraded;
        let spans = times.windows(2).filter(|span| is_alarm(span[0]));
        spans.fold(0.0, |sum, span| sum + span[1].seconds_since(span[0]))
    }
}

/// The health at a time.
fn state(changes: &[Change], time: Time) -> State {
    changes.iter().rev().find(|c| c.time <= time).map_or(State::default(), |c| c.state)
}

/// The larger number; NaN counts as the largest.
fn greater(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn time(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    /// A run of 200 s, a sample each second: its errors north \[m\] by time, less 2 m east and down, with a σ of 1 m;
    /// NaN is a missing estimate.
    /// Between two samples the reference has an epoch without a position.
    fn record(error: impl Fn(f64) -> f64, changes: &[(f64, State)]) -> Record {
        let sample = |k: i32| {
            let at = f64::from(k);
            let group = (Vector3::new(error(at), error(at) - 2.0, error(at) - 2.0), Vector3::repeat(1.0));
            let errors = Errors {
                time: time(at),
                groups: [Some(group), None, None],
            };
            Sample {
                time: time(at),
                errors: (!error(at).is_nan()).then_some(errors),
            }
        };
        let between = |k: i32| Sample {
            time: time(f64::from(k) + 0.5),
            errors: Some(Errors {
                time: time(f64::from(k) + 0.5),
                groups: [None; 3],
            }),
        };
        let change = |(at, state): &(f64, State)| Change {
            time: time(*at),
            state: *state,
            reason: None,
        };
        Record {
            samples: (0..=200).flat_map(|k| [sample(k), between(k)]).collect(),
            changes: core::iter::once(&(0.0, State::Good)).chain(changes).map(change).collect(),
        }
    }

    /// A case whose faults last from 50 s to 60 s, beside a run whose error is 2 m throughout.
    fn judged(error: impl Fn(f64) -> f64, changes: &[(f64, State)]) -> Judged {
        let mut survey = Survey::new(Vec::new());
        let undisturbed = record(|_| 2.0, &[(100.0, State::Degraded), (101.0, State::Good)]);
        survey.errors = undisturbed.samples.iter().filter_map(|s| s.errors).collect();
        let limits = Draw::read(&super::super::DrawSpec::default(), None, &mut fusion::config::Diagnostics::new());
        let baseline = Baseline::new(&undisturbed, &survey, &limits);
        assert_eq!(baseline.groups, [(0, 2.0)]);
        baseline.judge(&record(error, changes), &Case::quiet(time(50.0), time(60.0)), None)
    }

    /// The undisturbed error, and `by` from `from` to `to`.
    fn bump(from: f64, to: f64, by: f64) -> impl Fn(f64) -> f64 {
        move |at| if (from..to).contains(&at) { 2.0 + by } else { 2.0 }
    }

    #[test]
    fn a_run_as_good_as_the_undisturbed_one_has_recovered_and_nothing_is_said() {
        let all_well = judged(|_| 2.0, &[]);
        assert_eq!(
            (all_well.words(), all_well.worst, all_well.alarm),
            (vec![], Some((0.0, 0.0)), [0.0, 0.0])
        );
        // The undisturbed run has this alarm too.
        assert_eq!(judged(|_| 2.0, &[(100.0, State::Lost), (101.0, State::Good)]).words(), [""; 0]);
    }

    #[test]
    fn an_error_that_stays_has_not_recovered() {
        assert_eq!(judged(bump(55.0, 999.0, 5.0), &[]).words(), ["not recovered"]);
        // Within 3σ per axis, yet more than twice the undisturbed RMS of 2 m: 4.3 m; and 3.8 m.
        assert_eq!(judged(bump(55.0, 999.0, 2.5), &[]).words(), ["not recovered"]);
        assert!(judged(bump(55.0, 999.0, 2.2), &[]).recovered);
        // No estimate at the end.
        assert_eq!(judged(|at| if at > 195.0 { f64::NAN } else { 2.0 }, &[]).words(), ["not recovered"]);
        let back = judged(bump(55.0, 189.5, 5.0), &[]);
        assert_eq!((back.words(), back.large), (vec![], 129.0));
    }

    #[test]
    fn a_good_health_is_false_beyond_ten_sigma_for_three_seconds() {
        assert_eq!(judged(bump(55.0, 59.0, 11.0), &[]).words(), ["false good"]);
        // Of 2 s, or of 9σ, or said.
        assert_eq!(judged(bump(55.0, 58.0, 11.0), &[]).words(), [""; 0]);
        assert_eq!(judged(bump(55.0, 99.0, 9.0), &[]).words(), [""; 0]);
        assert_eq!(
            judged(bump(55.0, 59.0, 11.0), &[(56.0, State::Lost), (70.0, State::Good)]).words(),
            [""; 0]
        );
    }

    #[test]
    fn an_alarm_without_an_error_is_false_and_one_that_stays_is_late() {
        let ill = [(55.0, State::Degraded), (58.0, State::Good)];
        let false_alarm = judged(bump(55.0, 70.0, 1.0), &ill);
        assert_eq!((false_alarm.words(), false_alarm.alarm[0].round()), (vec!["false alarm"], 3.0));
        // Coasting does not count.
        assert_eq!(judged(|_| 2.0, &[(55.0, State::Coasting), (58.0, State::Good)]).words(), [""; 0]);
        // The error is large until 69 s.
        let said = |until: f64| judged(bump(55.0, 70.0, 5.0), &[(55.0, State::Lost), (until, State::Good)]);
        assert_eq!(said(129.0).words(), [""; 0]);
        // One of the seconds is the undisturbed run's own.
        assert_eq!(
            (said(131.0).words(), said(131.0).alarm.map(f64::round)),
            (vec!["late good"], [75.0, 61.0])
        );
        // Who has not recovered is rightly ill.
        assert_eq!(judged(bump(55.0, 999.0, 5.0), &[(55.0, State::Lost)]).words(), ["not recovered"]);
    }
}
