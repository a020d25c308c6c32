//! A disturbed run: how wrong the filter is, and the health that it reports.

use super::cases::Case;
use super::errors::{Errors, GROUPS};
use super::survey::Survey;
use core::convert::Infallible;
use fusion::health::{NamedReason, Names};
use fusion::observe::{RunEvent, RunObserver};
use fusion::score::Comparison;
use fusion_core::health::{Reason, State};
use fusion_core::runner::{Event, Halt};
use fusion_core::time::{Time, nanos};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A filter is wrong beyond this number of σ.
pub(super) const WRONG: f64 = 3.0;

/// The outcome for a filter under a fault.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct CaseOutcome {
    /// Whether it gives an estimate and is right at the end of the watch.
    pub survived: bool,
    /// The largest error that the fault caused, in σ, and its quantity.
    pub worst: Option<(f64, String)>,
    /// The largest position error \[m\], against the reference or, without one, the undisturbed run.
    pub metres: Option<f64>,
    /// The largest attitude error \[rad\].
    pub angle: Option<f64>,
    /// The time from the end of the faults until it stays right \[s\]; `None` if it is not right at the end.
    pub recovered: Option<f64>,
    /// The time without an estimate \[s\].
    pub missing: f64,
    /// The time in which it was wrong, or gave no estimate, while its health was good \[s\].
    pub unsaid: f64,
    /// The worst health that it reported after the fault began.
    pub health: Option<Said>,
    /// Whether no stream had a row since the fault began.
    pub hears_nothing: bool,
    /// Why the run stopped before its end.
    pub stopped: Option<String>,
}

/// The health that a filter reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// The worst state.
    #[serde(serialize_with = "fusion::health::word", deserialize_with = "fusion::health::from_word")]
    pub state: State,
    /// The first of its reasons.
    pub reason: Option<NamedReason>,
    /// From the start of the fault until the health was no longer good \[s\].
    pub after: f64,
}

/// A change of the health.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub(super) time: Time,
    pub(super) state: State,
    pub(super) reason: Option<Reason>,
}

/// The error of the filter at an epoch; `None` if it gave no estimate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) time: Time,
    pub(super) errors: Option<Errors>,
}

/// A run from the start of the faults to the end of the watch.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// In time order.
    pub(super) samples: Vec<Sample>,
    /// From the start of the run on.
    pub(super) changes: Vec<Change>,
}

/// Observes a disturbed run.
#[derive(Debug)]
pub(super) struct Watch<'a> {
    survey: &'a Survey,
    is_undisturbed: bool,
    from: Time,
    /// The end of the watch.
    until: Time,
    /// The delay of the estimates behind the rows \[ns\].
    lag: i64,
    /// Streams with possibly wrong stamps.
    disturbed: Vec<usize>,
    /// A longer pause between estimates counts as no estimate \[ns\].
    pause: i64,
    /// The times of the last two estimates.
    estimates: [Option<Time>; 2],
    /// The comparison with the undisturbed run; used without a reference.
    comparison: Option<Comparison>,
    mounting: UnitQuaternion<f64>,
    samples: Vec<Sample>,
    /// The time of the log, from streams with correct stamps.
    now: Option<Time>,
    /// Whether any stream had a row after the fault began.
    hears: bool,
    changes: Vec<Change>,
    /// The watch is over; the run can stop.
    pub(super) is_over: bool,
}

impl<'a> Watch<'a> {
    /// For a `case`, until `watch` seconds after its faults; the filter delays rows by `lag` seconds.
    pub(super) fn new(survey: &'a Survey, case: &Case, watch: f64, lag: f64) -> Self {
        /// Shorter pauses are ignored \[s\].
        const PAUSE: f64 = 0.5;
        let from = survey.estimates.partition_point(|e| e.time < case.from);
        let estimates = survey.estimates.get(from..).unwrap_or_default();
        let undisturbed = || Comparison::new(Vector3::zeros(), estimates.iter().copied());
        Self {
            survey,
            is_undisturbed: case.sets.is_empty(),
            from: case.from,
            until: case.to.shifted(nanos(watch)).min(survey.end()),
            lag: nanos(lag),
            disturbed: case.streams.clone(),
            pause: nanos((1.5 * survey.longest_pause).max(PAUSE)),
            estimates: [None; 2],
            comparison: survey.errors.is_empty().then(undisturbed),
            mounting: survey.mounting,
            samples: Vec::new(),
            now: None,
            hears: false,
            changes: Vec::new(),
            is_over: false,
        }
    }

    /// Adds the errors at an epoch between the last two estimates.
    fn add(&mut self, errors: Errors) {
        if errors.time < self.from || errors.time > self.until {
            return;
        }
        let time = errors.time;
        let is_stale = |before: Time, now: Time| now.nanos().saturating_sub(before.nanos()) > self.pause && time > before && time < now;
        let is_missing = matches!(self.estimates, [Some(before), Some(now)] if is_stale(before, now));
        self.samples.push(Sample {
            time,
            errors: (!is_missing).then_some(errors),
        });
    }

    /// The record of the run.
    pub(super) fn record(mut self) -> Record {
        self.close();
        Record {
            samples: self.samples,
            changes: self.changes,
        }
    }

    /// Ends the run.
    fn close(&mut self) {
        // If the estimates end early, the rest of the watch has no estimate. If the reference ends early, nothing is
        // known.
        let last = self
            .samples
            .last()
            .map_or(self.from, |s| s.time)
            .max(self.estimates[1].unwrap_or(self.from));
        if self.until.nanos().saturating_sub(last.nanos()) > self.pause {
            self.samples.push(Sample {
                time: self.until,
                errors: None,
            });
        }
    }

    /// The outcome for the filter.
    pub(super) fn finish(mut self, to: Time, names: &Names) -> CaseOutcome {
        self.close();
        let mut out = CaseOutcome::default();
        let (mut previous, mut last_wrong, mut ends_wrong) = (self.from, None, false);
        for Sample { time, errors } in &self.samples {
            let lasted = time.seconds_since(previous).max(0.0);
            let since = previous;
            previous = *time;
            // The undisturbed run is judged by its own errors.
            let undisturbed = || self.survey.errors_at(*time).filter(|_| !self.is_undisturbed);
            let ratio = errors.and_then(|e| e.worst(undisturbed()));
            ends_wrong = ratio.is_none_or(|(ratio, _)| ratio > WRONG);
            if let Some(errors) = errors {
                out.metres = greatest(out.metres, errors.metres());
                out.angle = greatest(out.angle, errors.angle());
            } else {
                out.missing += lasted;
            }
            if let Some((ratio, group)) = ratio.filter(|(ratio, _)| out.worst.as_ref().is_none_or(|(most, _)| ratio > most)) {
                out.worst = Some((ratio, GROUPS[group].to_owned()));
            }
            if ends_wrong {
                last_wrong = Some(*time);
                out.unsaid += self.good_within(since, *time);
            }
        }
        out.health = self.said(names);
        out.hears_nothing = !self.hears;
        out.survived = !ends_wrong;
        out.recovered = (!ends_wrong).then(|| last_wrong.map_or(0.0, |t| t.seconds_since(to).max(0.0)));
        out
    }

    /// The time between `since` and `to` with good health \[s\].
    fn good_within(&self, since: Time, to: Time) -> f64 {
        let ends = self.changes.iter().skip(1).map(|c| c.time).chain([Time::MAX]);
        let good = self.changes.iter().zip(ends).filter(|(change, _)| change.state == State::Good);
        let within = |(change, end): (&Change, Time)| end.min(to).seconds_since(change.time.max(since)).max(0.0);
        good.map(within).sum()
    }

    /// The worst health that the filter reported from the start of the faults to the end.
    fn said(&self, names: &Names) -> Option<Said> {
        let before = self.changes.iter().rev().find(|c| c.time <= self.from);
        let since = before.into_iter().chain(self.changes.iter().filter(|c| c.time > self.from));
        let ill: Vec<&Change> = since.filter(|c| c.state != State::Good).collect();
        let worst = ill.iter().rev().max_by_key(|c| c.state)?;
        Some(Said {
            state: worst.state,
            reason: worst.reason.map(|r| names.of(r)),
            after: ill.first()?.time.seconds_since(self.from).max(0.0),
        })
    }
}

fn greatest(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    // NaN counts as the largest number.
    let larger = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
    a.zip(b).map(|(a, b)| larger(a, b)).or(a).or(b)
}

impl RunObserver for Watch<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Row(row) = event {
            self.hears |= row.time > self.from;
        }
        match event {
            RunEvent::Row(row) if !self.disturbed.contains(&row.stream) => {
                self.now = self.now.max(Some(row.time));
                if row.time > self.until.shifted(self.lag) {
                    self.is_over = true;
                    return Err("the watch is over".into());
                }
            }
            RunEvent::Filter { filter, event } => {
                if let Event::Health { health } = event
                    && filter.is_outermost()
                {
                    self.changes.push(Change {
                        // A wrong clock may have misled the filter.
                        time: self.now.unwrap_or(health.since),
                        state: health.state,
                        reason: health.reasons.iter().copied().max_by_key(|r| r.state()),
                    });
                }
            }
            RunEvent::Estimate { filter, solution, belief } if filter.is_outermost() => {
                self.estimates = [self.estimates[1], Some(belief.time)];
                let (mut found, mounting) = (Vec::new(), self.mounting);
                if let Some(comparison) = &mut self.comparison {
                    let reached = comparison.reach(solution, None, |_, error| {
                        found.extend(error.map(|e| Errors::of(e, &mounting)));
                        Ok::<_, Infallible>(())
                    });
                    let Ok(()) = reached;
                }
                found.into_iter().for_each(|errors| self.add(errors));
            }
            RunEvent::Reference {
                filter,
                error: Some(error),
                ..
            } if filter.is_outermost() && self.comparison.is_none() => {
                let errors = Errors::of(error, &self.mounting);
                self.add(errors);
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_the_end_of_the_reference_nothing_is_known_and_behind_that_of_the_estimates_there_is_none() {
        let survey = Survey::new(Vec::new());
        let missing = |estimates: f64| {
            let mut watch = Watch::new(&survey, &Case::undisturbed(Time::default()), 60.0, 0.0);
            watch.until = Time::from_seconds(60.0);
            watch.estimates = [None, Some(Time::from_seconds(estimates))];
            watch.samples = vec![Sample {
                time: Time::from_seconds(20.0),
                errors: Some(Errors {
                    time: Time::from_seconds(20.0),
                    groups: [None; 3],
                }),
            }];
            watch.record().samples.iter().filter(|s| s.errors.is_none()).count()
        };
        // The reference ends at 20 s.
        assert_eq!((missing(60.0), missing(20.0)), (0, 1));
    }
}
