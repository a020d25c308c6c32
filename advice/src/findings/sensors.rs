//! Findings from the gates and innovations of a sensor.

use super::errors::bold_outages;
use super::facts::{Facts, JUDGE};
use super::found::Found;
use super::instrument::{Bias, Instrument, Measures, listed};
use super::level::{is_large_mean, is_more_than, level, sigmas};
use super::noise::{Excess, white};
use super::{CHECK, FAR, Finding, LARGE, is_large, ratio};
use fusion::config::Edit;
use fusion::health::{Spell, State};
use fusion::observe::{RejectionStreak, SensorStatistics};
use fusion::run::FaultWindow;
use fusion::score::{Consistency, ConsistencyVerdict, Score};
use fusion_core::math;
use fusion_tables::{Unit, short};

/// The largest share of outliers of a sound sensor. A gate that rejects a larger share does more than remove outliers: a
/// 99 % gate rejects 1 % of the good ones.
const REJECTED: f64 = 0.05;
/// A mean statistic over its degrees of freedom below this is worth a change: errors are √0.5 = 0.71 times the 1σ.
const SMALL: f64 = 0.5;
/// A larger excess of the mean over its degrees of freedom is reported if a log has no reference: errors are 1.1 times
/// the 1σ.
const SLIGHT: f64 = 0.2;
/// Innovations with a larger autocorrelation at lag 1 are correlated: half of each error is left in the next. Below
/// `WHITE` they count as white.
const LASTING: f64 = 0.5;
const WHITE: f64 = 0.2;
/// Fewer innovations cannot separate the two: 2/√n is then larger than the distance between them.
const ENOUGH: u64 = 50;
/// Correlated innovations are overweighted by this factor or more: the 1σ of the estimated quantity is then √10 = 3
/// times too small. By its inverse, measurements of a filter with known errors are underweighted enough to be worth a change.
const COUNTED: f64 = 10.0;
/// Between its inverse and this factor the declared noise already covers the correlation. A dozen independent innovations determine the
/// factor to a factor of two, and the variance of a consistent filter is within [`LARGE`].
const COVERED: f64 = 2.0 * LARGE;
/// An error larger than this number of medians is outstanding. For normal errors, the largest of a million is five
/// times the 1σ, which is less than eight times the median.
const OUTSTANDING: f64 = 8.0;
/// A constraint with a larger mean does not hold at all: innovations are √10 = 3 times their 1σ.
const BROKEN: f64 = 10.0;
/// A sensor disagrees before another one if it does so earlier by more than this \[s\]. A 1 Hz sensor needs a few
/// measurements to show it.
const LEAD: f64 = 2.0;
/// A disagreement follows from a re-acquisition that came before it by less than this \[s\].
const SOON: f64 = 60.0;

/// The gates of this sensor that tolerate good measurements with larger errors than declared.
fn softer(sensor: &Instrument) -> String {
    let position = if sensor.has_horizontal_position {
        "`two_condition` or "
    } else {
        ""
    };
    format!("a gate that refuses good ones lets the estimate run away, which {position}a `loss` in its place does not")
}

impl Facts<'_> {
    /// The findings of a rule about each sensor.
    pub(super) fn of_each_sensor(&self, find: fn(&Self, &Instrument, &SensorStatistics) -> Option<Finding>) -> Vec<Finding> {
        self.sensors().filter_map(|(i, s)| find(self, i, s)).collect()
    }

    /// The same for sensors whose innovations mean something. A small NIS means nothing for a sensor whose gate rejected
    /// good measurements: only those that agree were counted.
    pub(super) fn of_each_sensor_but(
        &self,
        found: &Found,
        find: fn(&Self, &Instrument, &SensorStatistics) -> Option<Finding>,
    ) -> Vec<Finding> {
        let rest = self
            .sensors()
            .filter(|(i, _)| !found.is_about(&["innovations-repeat", "lost"], &i.name));
        rest.filter_map(|(i, s)| find(self, i, s)).collect()
    }

    /// Disturbed rows that the filter used while declared faults were active, if errors are too large.
    pub(super) fn disturbed(&self) -> Option<Finding> {
        if !self.has_large_errors() {
            return None;
        }
        let (mut used, mut faults) = (Vec::new(), Vec::new());
        for (sensor, s) in self.sensors() {
            let missed = s.disturbed.map_or(0, |d| d.missed);
            let windows = self.run.faults.iter();
            let own: Vec<_> = windows.filter(|w| w.stream == sensor.source || w.stream == sensor.name).collect();
            if missed == 0 || own.is_empty() {
                continue;
            }
            used.push(format!("{missed} of `{}`", sensor.name));
            for window in own {
                let name = format!("`{}`", window.fault);
                if !faults.iter().any(|(known, _)| *known == name) {
                    faults.push((name, window.from));
                }
            }
        }
        if used.is_empty() {
            return None;
        }
        let faults: Vec<String> = faults.iter().map(|(name, from)| format!("{name} (from {from:.1} s on)")).collect();
        Some(Finding {
            about: "faults".to_owned(),
            evidence: format!(
                "disturbed rows were used while faults were at work: {}; {}",
                used.join(", "),
                faults.join(", ")
            ),
            advice:
                "errors follow from them: look at how gates took them (`missed` in the table of sensors), and judge the rest of the run \
                     apart from them (`[reference] episodes`)"
                    .to_owned(),
            ..Finding::of("fault-used")
        })
    }

    /// Gates that reject more than outliers, and sensors that were re-acquired against the estimate. The first to
    /// disagree comes first.
    pub(super) fn refused(&self) -> Vec<Finding> {
        let gated = self.sensors().filter(|(i, _)| i.has_gate);
        let told = gated.filter_map(|(i, s)| Some((disagrees_from(s), self.reacquired(i, s).or_else(|| self.rejected(i, s))?)));
        let mut told: Vec<(f64, Finding)> = told.collect();
        told.sort_by(|a, b| a.0.total_cmp(&b.0));
        told.into_iter().map(|(_, finding)| finding).collect()
    }

    /// The filter was lost outside declared outages; this finding comes first. It is about the sensor whose measurements
    /// were rejected in a row at that time, if there is one.
    pub(super) fn lost(&self) -> Option<Finding> {
        let own = self.run.health?;
        // For a filter that was never good, another finding names what it waits for.
        let aligned = own.aligned?;
        let spells = own.spells();
        let is_lost = |s: &Spell| s.state == State::Lost && s.is_ill_undeclared() && s.from >= aligned;
        let lost = || spells.iter().enumerate().filter(|(_, s)| is_lost(s));
        let (at, longest) = lost().max_by(|a, b| a.1.seconds().total_cmp(&b.1.seconds()))?;
        let all = lost().count();
        // The first ill spell of a chain with no good spell in between.
        let begun = spells[..=at]
            .iter()
            .rev()
            .take_while(|s| s.state >= State::Degraded)
            .last()
            .unwrap_or(longest);
        let times = if all > 1 {
            format!(", the longest of {all} times")
        } else {
            String::new()
        };
        let (mut evidence, mut advice) = (
            format!(
                "the filter was lost for {:.1} s, from {:.1} s on{times}",
                longest.seconds(),
                longest.from
            ),
            None,
        );
        // So many outliers in a row are improbable: one series can begin at every measurement.
        let is_improbable = |s: &SensorStatistics, streak: &RejectionStreak| {
            let chance = math::powf(REJECTED, streak.measurements as f64);
            chance < level((s.accepted + s.rejected) as usize)
        };
        let refused = self
            .sensors()
            .filter_map(|(i, s)| Some((i, s.longest_rejection_streak.filter(|streak| is_improbable(s, streak))?)));
        let is_then = |streak: &RejectionStreak| streak.from < longest.to && streak.from + streak.seconds > longest.from;
        let refused = refused.filter(|(_, streak)| is_then(streak));
        let refused = refused.max_by_key(|(_, streak)| streak.measurements);
        if let Some((sensor, streak)) = refused {
            evidence += &format!(
                ": {} measurements of `{}` were refused in a row, from {:.1} s on",
                streak.measurements, sensor.name, streak.from
            );
            advice = Some(format!(
                "either they were wrong, or the estimate had left them: compare the two there, {}, then look at its `noise`, which may be too \
                 small; {}",
                self.look(sensor),
                softer(sensor)
            ));
        } else {
            let reasons: Vec<String> = begun.reasons.iter().map(ToString::to_string).collect();
            evidence += &format!(": it began at {:.1} s with {}", begun.from, listed(&reasons));
        }
        let advice = advice.unwrap_or_else(|| "what is shown since then may be wrong: look at what it began with".to_owned());
        Some(Finding {
            about: refused.map_or_else(|| "health".to_owned(), |(sensor, _)| sensor.name.clone()),
            evidence,
            advice,
            ..Finding::of("lost")
        })
    }

    fn rejected(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let (good, all) = refused_by_its_gate(s);
        let share = rejected_share(s)?;
        Some(Finding {
            about: s.name.clone(),
            evidence: format!(
                "the gate of `{}` rejected {good} of {all} measurements, {:.0} %",
                s.name,
                100.0 * share
            ),
            advice: format!(
                "if they are not outliers, {}, then look at its `noise`; {}",
                self.look(sensor),
                softer(sensor)
            ),
            ..Finding::of("gate-rejects")
        })
    }

    /// A sensor that was re-acquired against the estimate, if a large error follows or the run has no reference.
    fn reacquired(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let last_before = |at: f64| s.reacquired_at.iter().copied().rev().find(|t| (0.0..SOON).contains(&(at - t)));
        let (time, error) = match self.run.score {
            None => (*s.reacquired_at.first()?, String::new()),
            Some(score) => {
                outstanding(score).find_map(|(at, error)| Some((last_before(at)?, format!("; {error} followed at {at:.1} s"))))?
            }
        };
        let (refused, all) = refused_by_its_gate(s);
        // Only a declared fault shows that the sensor was wrong, not the estimate.
        let is_own = |w: &&FaultWindow| w.stream == sensor.source || w.stream == sensor.name;
        let fault = self.run.faults.iter().filter(is_own).find(|w| (w.from..=w.to).contains(&time));
        let mut edits = Vec::new();
        let advice = match fault {
            Some(w) if sensor.has_recovery => {
                edits.push(Edit::set(format!("sensor.{}.gate.recovery.never_reacquire", sensor.name), "true"));
                format!("it was disturbed then by `{}`: {}, which forbids it", w.fault, edits[0])
            }
            Some(w) => format!("it was disturbed then by `{}`, which its gate took for good", w.fault),
            None => format!(
                "either it was wrong, or what the estimate had followed until then: another sensor, the input or the start; {}, and do the \
                 same with the others",
                self.look(sensor)
            ),
        };
        Some(Finding {
            about: s.name.clone(),
            evidence: format!(
                "`{}` was believed against the estimate at {time:.1} s (re-acquired), its gate rejected {refused} of {all} measurements{error}",
                s.name
            ),
            advice,
            edits,
            ..Finding::of("reacquired")
        })
    }

    /// The sensor that disagreed with the estimate before the `refused` sensors.
    pub(super) fn first_to_disagree(&self, refused: &[Finding]) -> Option<Finding> {
        let from = disagrees_from;
        let is_refused = |s: &SensorStatistics| refused.iter().any(|f| f.about == s.name);
        let earlier = |a: &(&Instrument, &SensorStatistics), b: &(&Instrument, &SensorStatistics)| from(a.1).total_cmp(&from(b.1));
        let (other, next) = self.sensors().filter(|(_, s)| is_refused(s)).min_by(earlier)?;
        let (sensor, first) = self.sensors().min_by(earlier)?;
        let name = &first.name;
        // If two parts of one instrument disagree, the fault is in this instrument or in the other sensors, not between
        // the parts.
        let is_told = !is_refused(first) && !sensor.is_of_one_with(other) && from(first) + LEAD < from(next);
        is_told.then(|| Finding {
            about: name.clone(),
            evidence: format!(
                "`{name}` was the first to disagree, from {:.1} s on, before `{}`, from {:.1} s on",
                from(first),
                next.name,
                from(next)
            ),
            advice: format!(
                "it comes before them, for they may disagree because of it: {}, then run once with `sensor.{name}.enabled = false`; if the \
                 others agree then, it was wrong or disturbed",
                self.look(sensor)
            ),
            ..Finding::of("first-to-disagree")
        })
    }

    /// The first step for a sensor that disagrees.
    fn look(&self, sensor: &Instrument) -> String {
        let parts = sensor.parts();
        if self.is_recorded {
            format!("let {CHECK} judge its {parts}")
        } else {
            format!("look at its {parts}")
        }
    }

    /// The same for a constant error.
    fn look_for_constant(&self, sensor: &Instrument) -> String {
        let bias = match sensor.bias {
            Some(Bias::Fixed) => ", or declare its `bias` as a state",
            _ => "",
        };
        if self.is_recorded {
            format!("let {CHECK} look for one{bias}")
        } else {
            format!("look at its {}{bias}", sensor.parts())
        }
    }

    /// Innovations that are larger than the filter expects.
    pub(super) fn large(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let (name, nis) = (&sensor.name, s.nis.as_ref()?);
        // A gate that rejects nothing has an infinite power.
        let is_gated = s.gate_power.iter().any(|power| power.is_finite());
        let look = self.look(sensor);
        let advice = if sensor.is_detected() && ratio(nis) > BROKEN {
            let input = format!("the axes, signs and units of the input of the process ({CHECK} compares it with others)");
            let limits = match sensor.limits.as_slice() {
                [] => "when it is applied".to_owned(),
                limits => format!("what tells when it holds: {}", listed(limits)),
            };
            // A simulated input is as declared.
            let parts = if self.is_recorded {
                format!("{input}, then at {limits}")
            } else {
                limits
            };
            let growth = self
                .growth_between(sensor)
                .map_or_else(String::new, |growth| format!(", then at {growth}, which may be too small"));
            let parts = format!("{parts}{growth}");
            format!("so much is hardly noise: look first at {parts}; leave its `noise` until that is right")
        } else if let Some(growth) = self.growth_between(sensor) {
            format!(
                "what stands still is hardly faster than declared: between two stops the estimate errs by more than the process says; raise \
                 {growth} first, its own `noise` only if the vehicle creeps while its detector holds"
            )
        } else if sensor.is_constraint {
            "the vehicle does not keep this constraint so well; raise its `noise`, or apply it less often".to_owned()
        } else if ratio(nis) > FAR {
            format!("so much is hardly noise: first {look}; leave its `noise` until they are right")
        } else if lag_1(s).is_some_and(|rho| rho > LASTING) {
            let slow = match sensor.bias {
                Some(Bias::Fixed) => "a slow error without a state, such as its `bias`",
                Some(_) => "a slow error that its `bias` does not take, or that changes more than it may",
                None => "a slow error without a state",
            };
            format!("each is like the one before, so it is not noise: {look}, then look for {slow}")
        } else if !is_gated {
            format!("are there outliers, which a `gate` would refuse? Else {look}, then look at its `noise`")
        } else {
            format!("{look}; if they are right, raise its `noise` or that of the process")
        };
        let reported = self.reported(sensor).filter(|_| ratio(nis) <= FAR);
        let (reported, edits) = reported.unzip();
        let advice = reported.map_or_else(|| advice.clone(), |reported| format!("{advice}; {reported}"));
        // Limits that are too wide also accept motion.
        let held = self.detector(sensor).filter(|d| d.held > 0).map_or_else(String::new, |d| {
            format!(
                "; `{}` held in {:.0} % of its tests",
                d.stage,
                100.0 * d.held as f64 / d.tests as f64
            )
        });
        is_large(nis).then(|| Finding {
            about: name.clone(),
            evidence: format!(
                "NIS of `{name}` is {} of {}, innovations are {} times what is expected{held}{}",
                short(nis.mean),
                nis.dof,
                short(nis.error_ratio()),
                self.moved_too(sensor)
            ),
            advice,
            edits: edits.unwrap_or_default(),
            ..Finding::of("nis-large")
        })
    }

    /// The settings for the error growth of an inertial process. Only for a sensor that stops the growth when its
    /// detector finds rest.
    fn growth_between(&self, sensor: &Instrument) -> Option<String> {
        let is_stopping = sensor.is_constraint && sensor.measures == Some(Measures::Velocity) && !sensor.limits.is_empty();
        (is_stopping && !self.growth.is_empty()).then(|| listed(&self.growth).replace(" and ", " or "))
    }

    /// Whether each innovation of a sensor resembles the one before.
    pub(super) fn is_lasting(&self, name: &str) -> bool {
        let own = self.sensors().find(|(_, s)| s.name == name);
        own.and_then(|(_, s)| lag_1(s)).is_some_and(|rho| rho > LASTING)
    }

    /// Innovations of a log that are slightly larger than expected, but more than chance allows, if there is nothing
    /// better to judge by.
    pub(super) fn beyond_chance(&self) -> Option<Finding> {
        let judged = self.sensors().filter(|(i, _)| self.is_judged_by_innovations(i));
        let nis = judged.filter_map(|(i, s)| Some((i, s.nis.as_ref()?)));
        let is_told = |nis: &Consistency| !is_large(nis) && ratio(nis) > 1.0 + SLIGHT && is_large_mean(nis, self.run.sensors.len());
        let (sensor, nis) = nis
            .filter(|(_, nis)| is_told(nis))
            .max_by(|a, b| ratio(a.1).total_cmp(&ratio(b.1)))?;
        Some(Finding {
            about: sensor.name.clone(),
            evidence: format!(
                "NIS of `{}` is {} of {}, more than chance allows",
                sensor.name,
                short(nis.mean),
                nis.dof
            ),
            advice: format!("it, or what the estimate takes from another sensor, is not quite as declared: let {CHECK} compare them"),
            ..Finding::of("nis-beyond-chance")
        })
    }

    /// A detector that never held in a run that failed.
    pub(super) fn never_held(&self) -> Option<Finding> {
        let has_health = self.run.health.iter().any(|h| h.filter.is_empty() && h.is_good());
        // A summary of several runs does not count the rows of each consumer.
        let had_no_row = |i: &&Instrument| match self.run.consumers.iter().find(|c| c.name == i.name) {
            Some(consumer) => consumer.rows == 0,
            None => self.detector(i).is_some_and(|d| d.held == 0),
        };
        let sensor = self.instruments.iter().filter(|i| !i.limits.is_empty()).find(had_no_row)?;
        let nearest = self.detector(sensor).and_then(|d| d.nearest.as_ref());
        let (figures, wider) = nearest.map_or_else(Default::default, |n| (format!(" ({n})"), ", at first twice of what it says"));
        (!has_health).then(|| Finding {
            about: sensor.name.clone(),
            evidence: format!(
                "`{}` had no measurement: nothing in the run was within the limits of `{}`{}",
                sensor.name, sensor.source, figures
            ),
            advice: format!(
                "if it should have had some, they are too narrow for this unit and vehicle: look at {}{wider}",
                listed(&sensor.limits)
            ),
            ..Finding::of("never-held")
        })
    }

    /// Sensors whose measurements are overweighted, because each repeats the error of the one before; the most
    /// overweighted first. They explain errors only up to their own factor.
    pub(super) fn counted(&self) -> Vec<Finding> {
        let nees = || Measures::ALL.into_iter().filter_map(|what| self.nees(what));
        let largest = nees().filter(|c| is_large(c)).map(ratio).fold(COUNTED, f64::max);
        let has_errors = nees().any(is_large) || self.run.score.is_some_and(|score| bold_outages(&score.drift).is_some());
        let told = self.sensors().filter_map(|(i, s)| {
            let is_told = has_errors && !i.is_constraint && i.measures.is_some() || self.is_judged_by_innovations(i);
            let times = counts(s).filter(|times| is_told && *times > largest)?;
            let finding = self.repeats(i, s).filter(|_| !s.nis.as_ref().is_some_and(is_large))?;
            Some((times, finding))
        });
        let mut told: Vec<(f64, Finding)> = told.collect();
        told.sort_by(|a, b| b.0.total_cmp(&a.0));
        told.into_iter().map(|(_, finding)| finding).collect()
    }

    /// A sensor whose measurements each repeat the error of the one before.
    fn repeats(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let (name, rho) = (&sensor.name, lag_1(s).filter(|rho| *rho > LASTING)?);
        let own = &s.innovations;
        let fewest = own.independent.iter().copied().reduce(f64::min)?;
        let white = as_white_noise(s)?;
        let find = match sensor.bias {
            Some(Bias::Fixed) => "; then declare its `bias` as a state with a `correlation_time`",
            _ => "",
        };
        Some(Finding {
            about: name.clone(),
            evidence: format!(
                "innovations of `{name}` each repeat the one before, lag-1 autocorrelation {rho:.2}: its {} measurements tell no more than \
                 {fewest:.0} independent ones, but the filter takes each for another",
                own.count
            ),
            advice: format!(
                "the 1σ of what it measures is too small by far: {}{find}; if nothing is found wrong, its `noise` as white noise that tells \
                 as much is {white}",
                self.look(sensor),
            ),
            ..Finding::of("innovations-repeat")
        })
    }

    /// Innovations that are smaller than the filter expects. A small NIS alone says nothing of the noise: an error that
    /// lasts needs a noise that covers its repetitions, and the expected error of the estimate may be too large.
    pub(super) fn small(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let nis = s.nis.as_ref()?;
        if !is_small(nis) || is_covered(s) {
            return None;
        }
        // If the errors are known and not too large, a designer may have covered an error that the innovations do not
        // show, such as that of a detector. Only a noise that nothing explains is then reported.
        let is_refuted = sensor.measures.and_then(|what| self.nees(what)).is_some_and(is_large);
        let excess = self.excess_of(sensor, s);
        let is_wide = counts(s).is_none_or(|times| times < 1.0 / COVERED);
        let most = if excess == Excess::Noise { COUNTED } else { FAR };
        let is_far = counts(s).is_some_and(|times| times < 1.0 / most);
        let is_told = !sensor.is_detected() && sensor.measures.is_some() && is_far && !is_refuted;
        if !(self.is_judged_by_innovations(sensor) || is_told) {
            return None;
        }
        let (name, lag_1) = (&sensor.name, lag_1(s));
        let (advice, edits) = self.why_small(sensor, s, excess, is_wide);
        let correlated = lag_1.map_or_else(String::new, |rho| format!(", lag-1 autocorrelation {rho:.2}"));
        Some(Finding {
            about: name.clone(),
            evidence: format!("NIS of `{name}` is {} of {}{correlated}", short(nis.mean), nis.dof),
            advice,
            edits,
            ..Finding::of("nis-small")
        })
    }

    /// The advice for a small NIS. Only if the facts separate the noise from all other causes, it has edits.
    fn why_small(&self, sensor: &Instrument, s: &SensorStatistics, excess: Excess, is_wide: bool) -> (String, Vec<Edit>) {
        let slow = match sensor.bias {
            Some(Bias::Fixed) => {
                "its errors change slowly and the estimate follows them; then declare its `bias` as a state with a `correlation_time`"
            }
            _ => "its errors change slowly and the estimate follows them",
        };
        let lag_1 = lag_1(s);
        let is_lasting = lag_1.is_some_and(|rho| rho > LASTING);
        if is_lasting && !(is_wide && counts(s).is_some()) {
            return (slow.to_owned(), Vec::new());
        }
        if let Some(mean) = self.lasting_mean(s) {
            let look = self.look_for_constant(sensor);
            let advice = format!("{mean}, so an error that lasts is among them, which a smaller `noise` would only follow: first {look}");
            return (advice, Vec::new());
        }
        if !is_wide {
            return (slow.to_owned(), Vec::new());
        }
        let (much, edits) = Self::smaller_noise(sensor, s);
        let hidden = if self.has_judge(sensor) {
            String::new()
        } else {
            let look = self.look_for_constant(sensor);
            format!("; a constant error that the estimate has taken over does not show in innovations, so before you lower it {look}")
        };
        match excess {
            Excess::Estimate => (self.wide_estimate(), Vec::new()),
            Excess::Noise if hidden.is_empty() => (format!("its `noise` is too large, even for an exact estimate{much}"), edits),
            Excess::Noise => {
                let advice = format!("its `noise` is larger than need be, even for an exact estimate{hidden}{much}");
                (advice, Vec::new())
            }
            Excess::Unknown => {
                let is_white = lag_1.is_some_and(|rho| rho < WHITE);
                let also = if is_white { String::new() } else { format!(", or {slow}") };
                let advice = format!("its `noise`, or that of the process, is larger than need be{also}{hidden}{much}");
                (advice, Vec::new())
            }
        }
    }

    /// The advice if the filter expects too large errors of its estimate.
    fn wide_estimate(&self) -> String {
        let growth = match self.growth.as_slice() {
            [] => String::new(),
            growth => format!(" ({})", listed(growth).replace(" and ", " or ")),
        };
        format!(
            "its innovations, with their correlation, need all of its `noise`, so the filter expects too large errors of its estimate: look \
             at the noises of the process{growth}, the `random_walk` of its states, and the initial σ; leave `noise`"
        )
    }

    /// Whether a constant error of a sensor would show: rows are simulated, or the errors of the part that it measures are
    /// known and not too large.
    fn has_judge(&self, sensor: &Instrument) -> bool {
        let nees = sensor.measures.and_then(|what| self.nees(what));
        !self.is_recorded || nees.is_some_and(|nees| nees.independent >= JUDGE && !is_large(nees))
    }

    /// A smaller noise, in words, and the edit that declares it. The 1σ that a file reports would be added to the noise.
    fn smaller_noise(sensor: &Instrument, s: &SensorStatistics) -> (String, Vec<Edit>) {
        let Some((white, key)) = as_white_noise(s).zip(sensor.noise_key.as_ref()) else {
            return Default::default();
        };
        let words = format!("; with their correlation its innovations tell as much as a white `noise` of {white}");
        (words, vec![Edit::set(key, format!("{white:?}"))])
    }

    /// A significant mean innovation, in words: the row whose mean is furthest from zero in its 1σ.
    fn lasting_mean(&self, s: &SensorStatistics) -> Option<String> {
        let own = &s.innovations;
        let tests = self.run.sensors.iter().map(|s| s.innovations.mean.len()).sum();
        let rows = own.mean.iter().zip(&own.mean_sigmas).zip(&own.unit).enumerate();
        let most = rows.max_by(|a, b| a.1.0.1.abs().total_cmp(&b.1.0.1.abs()));
        let (row, ((mean, far), unit)) = most.filter(|(_, ((_, far), _))| far.abs() > sigmas(tests) && own.count >= ENOUGH)?;
        let unit = Unit::of_si(unit);
        let axis = own.axis.get(row).map_or_else(String::new, |axis| format!(" ({axis})"));
        Some(format!(
            "their mean{axis} is {} {}, {:.1} times its own 1σ",
            short(unit.of(*mean)),
            unit.symbol(),
            far.abs()
        ))
    }

    /// Innovations with the expected size that are not independent of each other.
    pub(super) fn lasting(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let nis = s.nis.as_ref()?;
        let rho = lag_1(s).filter(|rho| *rho > LASTING)?;
        if !self.is_judged_by_innovations(sensor) || is_small(nis) || is_large(nis) || is_covered(s) {
            return None;
        }
        let name = &sensor.name;
        let until = "until then the 1σ is too small";
        let advice = match sensor.bias {
            Some(Bias::Fixed) => format!("an error that lasts has no state: declare its `bias` with a `correlation_time`; {until}"),
            _ => format!("an error that lasts has no state: a latency, an arm, a scale, a heading (of a log, {CHECK} tries them); {until}"),
        };
        Some(Finding {
            about: name.clone(),
            evidence: format!(
                "innovations of `{name}` are as large as expected, but each is like the one before, lag-1 autocorrelation {rho:.2}"
            ),
            advice,
            ..Finding::of("innovations-last")
        })
    }
}

/// The time since when a sensor disagreed \[s\]; infinite if it never did.
pub(super) fn disagrees_from(s: &SensorStatistics) -> f64 {
    s.disagrees_from.unwrap_or(f64::INFINITY)
}

/// The number of good measurements that a sensor's own gate rejected, and the number that it judged.
fn refused_by_its_gate(s: &SensorStatistics) -> (u64, u64) {
    let own = s.rejected.saturating_sub(s.with_leader);
    // The gate is meant to reject rows that a declared fault disturbed.
    let good = own - s.disturbed.map_or(0, |d| d.caught).min(own);
    (good, s.accepted + s.reacquired + own)
}

/// The share of good measurements that its own gate rejected, if it exceeds the share of outliers.
pub(super) fn rejected_share(s: &SensorStatistics) -> Option<f64> {
    let (good, all) = refused_by_its_gate(s);
    let share = good as f64 / all as f64;
    is_more_than(good, all, REJECTED, 1).then_some(share)
}

/// The time and text of errors that are much larger than the others of a run.
fn outstanding(score: &Score) -> impl Iterator<Item = (f64, String)> {
    let horizontal = score.position.as_ref().and_then(|axes| {
        let larger = usize::from(axes.max[1] > axes.max[0]);
        let is_one = score.horizontal_max > OUTSTANDING * score.horizontal_median?;
        is_one.then(|| {
            (
                axes.max_time[larger],
                format!("a horizontal error of {} m", short(score.horizontal_max)),
            )
        })
    });
    let heading = score.attitude_deg.as_ref().and_then(|axes| {
        let is_one = axes.max[2] > OUTSTANDING * score.spread.heading_deg?.median;
        is_one.then(|| (axes.max_time[2], format!("a heading error of {}°", short(axes.max[2]))))
    });
    horizontal.into_iter().chain(heading)
}

/// The largest autocorrelation at lag 1 of the innovations of a sensor, if there are enough of them.
fn lag_1(s: &SensorStatistics) -> Option<f64> {
    let rows = s.innovations.lag_1.iter().filter(|_| s.innovations.count >= ENOUGH);
    rows.copied().reduce(f64::max)
}

/// The factor by which the measurements of a sensor are overweighted. It is the variance of the innovations over its
/// expected value, times their integrated autocorrelation. It is 1 for white innovations of the expected size, and for
/// correlated ones with a raised `noise`; `None` for few.
fn counts(s: &SensorStatistics) -> Option<f64> {
    let own = &s.innovations;
    let fewest = own.independent.iter().copied().reduce(f64::min).filter(|_| own.count >= ENOUGH)?;
    Some(ratio(s.nis.as_ref()?) * own.count as f64 / fewest)
}

/// Whether the declared noise is that of white noise with the information of the innovations, to within the factor that
/// the data can resolve.
fn is_covered(s: &SensorStatistics) -> bool {
    counts(s).is_some_and(|times| (1.0 / COVERED..COVERED).contains(&times))
}

/// White noise with the same information as the innovations of the row with the largest one, with its unit.
fn as_white_noise(s: &SensorStatistics) -> Option<String> {
    let largest = white(s).reduce(f64::max).filter(|white| white.is_finite())?;
    let unit = Unit::of_si(s.innovations.unit.first()?);
    Some(format!("{} {}", short(unit.of(largest)), unit.symbol()))
}

/// Returns true if innovations are smaller than expected by enough to need a change.
fn is_small(nis: &Consistency) -> bool {
    nis.verdict() == Some(ConsistencyVerdict::Conservative) && ratio(nis) < SMALL
}
