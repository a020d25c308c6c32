//! What to look at next: advice that follows from the statistics of a run.
//!
//! ```text
//! design ──▶ what each sensor is (instrument or constraint, what it measures, whether its bias can be a state)
//!                                                          │
//! summary ─▶ gates, NEES, NIS, gaps ───────────────────────┴──▶ findings, the first to look at first
//! ```
//!
//! Each finding names its evidence in figures and the setting to change. What a gate refused is in no other
//! figure, so that comes first. A reference outranks innovations: they are small, too, where the estimate
//! follows a slow error of a sensor. A constraint has no instrument: nothing is said of its bias, and nothing
//! where it is kept better than declared.
//!
//! Source   Bar-Shalom, Li, Kirubarajan 2001, §5.4: what a mean NEES or NIS outside its band means
//! Not here what a run without findings proves: nothing, if its data do not move the vehicle enough

mod instrument;
#[cfg(test)]
mod tests;

use self::instrument::{Instrument, Measures};
use crate::design::Design;
use crate::observe::SensorStatistics;
use crate::present::{Unit, short};
use crate::run::{FinalState, Summary};
use crate::score::{Consistency, Drift, Offset, Score, Verdict};
use core::fmt;
use serde::Serialize;

/// Something that a designer should look at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What it is about: a sensor, a source, or a NEES.
    pub about: String,
    /// What was found, with its figures.
    pub evidence: String,
    /// What to do.
    pub advice: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.evidence, self.advice)
    }
}

/// The share of rejected measurements from which on a gate does more than to remove outliers: a gate of 99 %
/// refuses 1 % of the good ones.
const REJECTED: f64 = 0.05;
/// Fewer measurements say little about a share: of 20, one rejected is already 5 %.
const FEW: u64 = 20;
/// The mean statistic over its degrees of freedom from which on it is worth a change: errors are then
/// √1.5 = 1.22 times the 1σ of the filter.
const LARGE: f64 = 1.5;
/// The same from which on no noise explains it: innovations are √50 = 7 times their 1σ, all of them.
const FAR: f64 = 50.0;
/// The same below: errors are √0.5 = 0.71 times the 1σ.
const SMALL: f64 = 0.5;
/// The same of errors that are known: half of the 1σ. A little too careful is no fault.
const TINY: f64 = 0.25;
/// The mean over its degrees of freedom of a NIS below which a larger noise changes nothing: the estimate hardly listens.
const FOLLOWED: f64 = 0.3;
/// The autocorrelation at lag 1 from which on innovations are no noise: half of the error of one is left in the next. Below the
/// other they are.
const LASTING: f64 = 0.5;
const WHITE: f64 = 0.2;
/// Fewer innovations do not tell one from the other: 2/√n is then more than what lies between.
const ENOUGH: u64 = 50;
/// The 1σ of a parameter over that at its start from which on the data told nothing of it.
const LEARNT: f64 = 0.9;
/// A mean error of the heading that is worth a word \[deg\], and its share of the mean square.
const LEAST_HEADING: f64 = 1.0;
const MOST_OF_HEADING: f64 = 0.8;
/// A 1σ of an angle from which on its sine and cosine are no straight lines within it \[rad\].
const POOR: f64 = 1.0;
/// How often a consistent filter may be found too sure in its outages.
const CHANCE: f64 = 0.02;
/// So much of the errors a constant offset has to explain, being so many of its 1σ; from that 1σ on \[m\] it is not known.
const MOST: f64 = 0.5;
const CERTAIN: f64 = 5.0;
const UNKNOWN: f64 = 1.0;
/// A stretch without rows that is worth a word: so many intervals of its source, and seconds.
const GAP: (f64, f64) = (10.0, 3.0);

/// What was found in a run of `design`; nothing in one that is consistent, or that never started.
#[must_use]
pub fn findings(design: &Design, summary: &Summary) -> Vec<Finding> {
    if summary.started.is_none() {
        return Vec::new();
    }
    let instruments = Instrument::of_design(design, &summary.parameters);
    let judged = Judged {
        instruments: &instruments,
        summary,
        point: design.reference.as_ref().map_or([0.0; 3], |r| r.block.point()),
        linearises_once: design.filter.linearises_once(),
    };
    judged.findings()
}

/// A run, and what its sensors are.
#[derive(Clone, Copy)]
struct Judged<'a> {
    instruments: &'a [Instrument],
    summary: &'a Summary,
    /// The point of the reference as it is declared \[m\].
    point: [f64; 3],
    /// Whether the filter has one estimate, and linearises each measurement there alone.
    linearises_once: bool,
}

impl Judged<'_> {
    fn findings(&self) -> Vec<Finding> {
        let sensors = || {
            let of = |i: &Instrument| self.summary.sensors.iter().find(|s| s.name == i.name);
            self.instruments.iter().filter_map(move |i| Some((i, of(i)?)))
        };
        let rejected = sensors().filter(|(i, _)| i.has_gate).filter_map(|(_, s)| rejected(s));
        let errors = Measures::ALL.into_iter().filter_map(|what| self.errors(what));
        let large = sensors().filter_map(|(i, s)| large(i, s));
        let small = sensors().filter_map(|(i, s)| self.small(i, s));
        let lasting = sensors().filter_map(|(i, s)| self.lasting(i, s));
        let gaps = self.gaps();
        let score = self.summary.score.iter();
        let arm = score.clone().filter_map(|score| wrong_arm(score.offset.as_ref()?, self.point));
        let outages = score.clone().filter_map(|score| bold_outages(&score.drift));
        let constant = score.filter_map(constant_heading);
        let errors = constant.chain(arm).chain(alike(errors.collect())).chain(outages);
        self.all_disagree()
            .into_iter()
            .chain(self.poor_start())
            .chain(rejected)
            .chain(errors)
            .chain(large)
            .chain(small)
            .chain(lasting)
            .chain(self.unlearnt())
            .chain(gaps)
            .collect()
    }

    /// Where no sensor agrees by far, it is what they all are compared with.
    fn all_disagree(&self) -> Option<Finding> {
        let judged = Measures::ALL.into_iter().flat_map(|what| self.measuring(what));
        let judged: Vec<(&Instrument, &Consistency)> = judged.collect();
        let is_far = |(_, nis): &(&Instrument, &Consistency)| is_large(nis) && ratio(nis) > FAR;
        if judged.len() < 2 || !judged.iter().all(is_far) {
            return None;
        }
        let each: Vec<String> = judged
            .iter()
            .map(|(i, nis)| format!("`{}` {} of {}", i.name, short(nis.mean), nis.dof))
            .collect();
        Some(Finding {
            about: "process".to_owned(),
            evidence: format!("no sensor agrees with the estimate: NIS of {}", each.join(", ")),
            advice: "they all are compared with what drives the process: look first at the axes, signs and units of its input \
                     (`fusion check DESIGN --data DIR` compares it with the others), then at the start"
                .to_owned(),
        })
    }

    /// A start so poor that one linearisation does not reach the truth, where nothing shows that it did.
    fn poor_start(&self) -> Option<Finding> {
        let (name, sigma) = self.summary.start_angle.as_ref().filter(|(_, sigma)| *sigma > POOR)?;
        let is_found = self.nees(Measures::Attitude).is_some_and(|c| !is_large(c));
        (self.linearises_once && !is_found).then(|| Finding {
            about: name.clone(),
            evidence: format!("the filter starts with a 1σ of {:.0}° of `{name}`", sigma.to_degrees()),
            advice:
                "linearised once, there, it may settle at a wrong angle with a small 1σ: give a better start (`[initial]`), try several \
                     (`filter.bank.headings = 8`), or linearise again (`filter.update = \"iterated\"`, with the chart `right_invariant`)"
                    .to_owned(),
        })
    }

    /// The mean NEES of what a sensor measures.
    fn nees(&self, what: Measures) -> Option<&Consistency> {
        nees_of(self.summary.score.as_ref()?, what)
    }

    /// Errors against the reference that are not what the covariance says.
    fn errors(&self, what: Measures) -> Option<Finding> {
        let c = self.nees(what)?;
        let name = format!("NEES {}", what.word());
        let evidence = format!("{name} is {} of {}", short(c.mean), c.dof);
        let advice = match c.verdict()? {
            Verdict::Overconfident if is_large(c) => self.too_sure(what, c),
            // Other rows of a sensor do not show the error that lasts, for which the filter is careful.
            Verdict::Conservative if self.summary.judged_by.is_some() => return None,
            Verdict::Conservative if ratio(c) < TINY => format!(
                "errors are only {} times the 1σ of the filter; the noises of its sensors or process are larger than need be",
                short(c.error_ratio())
            ),
            _ => return None,
        };
        Some(Finding {
            about: name,
            evidence,
            advice,
        })
    }

    /// Why the filter believes more than it should: a sensor whose error it follows, if there is one.
    fn too_sure(&self, what: Measures, nees: &Consistency) -> String {
        let times = format!("errors are {} times the 1σ of the filter", short(nees.error_ratio()));
        let broken = self.measuring(what).find(|(_, nis)| is_large(nis));
        if let Some((sensor, _)) = broken {
            return format!("{times}; begin with the innovations of `{}`", sensor.name);
        }
        let followed = self.measuring(what).filter(|(_, nis)| nis.verdict() == Some(Verdict::Conservative));
        let Some((sensor, nis)) = followed.min_by(|a, b| ratio(a.1).total_cmp(&ratio(b.1))) else {
            return format!(
                "{times}; a noise of the process is too small, an error of a sensor has no state (of a log, `fusion check DESIGN --data \
                 DIR` tries latencies, arms, scales and angles as states), or the start was far off (`[reference] from` judges from \
                 later on)"
            );
        };
        let name = &sensor.name;
        let follows = format!(
            "{times}, and NIS of `{name}` is only {} of {}: the estimate follows a slow error of `{name}`",
            short(nis.mean),
            nis.dof
        );
        match sensor.bias {
            Some(false) => format!("{follows}; declare its `bias` as a state with a `correlation_time`"),
            Some(true) => format!("{follows}; its `bias` is a state already: is its `sigma` or `random_walk` too small?"),
            None if ratio(nis) < FOLLOWED => format!(
                "{times}, though NIS of `{name}` is {} of {}: does the reference tell of another point (`[reference] lever_arm`), \
                 or late (`latency`)? Else an error of a sensor has no state",
                short(nis.mean),
                nis.dof
            ),
            None => format!("{follows}; raise its `noise`, for its rows are not independent"),
        }
    }

    /// The instruments that measure a part of the solution, with their NIS.
    fn measuring(&self, what: Measures) -> impl Iterator<Item = (&Instrument, &Consistency)> {
        let of = move |i: &&Instrument| i.measures == Some(what) && !i.is_constraint;
        self.instruments.iter().filter(of).filter_map(|i| {
            let sensor = self.summary.sensors.iter().find(|s| s.name == i.name)?;
            Some((i, sensor.nis.as_ref()?))
        })
    }

    /// Whether the innovations of a sensor are all that tells of it: where errors are known, they judge, and what measures no part
    /// of the solution may be slow on purpose.
    fn is_judged_by_innovations(&self, sensor: &Instrument) -> bool {
        let is_judged = Measures::ALL.into_iter().any(|what| self.nees(what).is_some());
        !sensor.is_constraint && sensor.measures.is_some() && !is_judged
    }

    /// Innovations that are smaller than the filter expects.
    fn small(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let nis = s.nis.as_ref()?;
        if !self.is_judged_by_innovations(sensor) || !is_small(nis) {
            return None;
        }
        let name = &sensor.name;
        let slow = "they change slowly and the estimate follows them";
        let state = match sensor.bias {
            Some(false) => "; then declare its `bias` as a state with a `correlation_time`",
            Some(true) | None => "",
        };
        let lag_1 = lag_1(s);
        let advice = match lag_1 {
            Some(rho) if rho > LASTING => format!("{slow}{state}"),
            Some(rho) if rho < WHITE => "its `noise` is larger than its errors".to_owned(),
            _ => format!("its `noise` is larger than its errors, or {slow}{state}"),
        };
        let correlated = lag_1.map_or_else(String::new, |rho| format!(", lag-1 autocorrelation {rho:.2}"));
        Some(Finding {
            about: name.clone(),
            evidence: format!("NIS of `{name}` is {} of {}{correlated}", short(nis.mean), nis.dof),
            advice,
        })
    }

    /// Innovations that are as large as expected, but not independent of each other.
    fn lasting(&self, sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
        let nis = s.nis.as_ref()?;
        let rho = lag_1(s).filter(|rho| *rho > LASTING)?;
        if !self.is_judged_by_innovations(sensor) || is_small(nis) || is_large(nis) {
            return None;
        }
        let name = &sensor.name;
        let advice = match sensor.bias {
            Some(false) => "an error that lasts has no state: declare its `bias` with a `correlation_time`; until then the 1σ is too small",
            Some(true) | None => {
                "an error that lasts has no state: a latency, an arm, a scale, a heading (of a log, `fusion check DESIGN --data DIR` tries \
                 them); until then the 1σ is too small"
            }
        };
        Some(Finding {
            about: name.clone(),
            evidence: format!(
                "innovations of `{name}` are as large as expected, but each is like the one before, lag-1 autocorrelation {rho:.2}"
            ),
            advice: advice.to_owned(),
        })
    }

    /// Parameters that the data told nothing of: none of their 1σ fell.
    fn unlearnt(&self) -> Option<Finding> {
        let unlearnt = || self.summary.parameters.iter().filter(|p| is_unlearnt(p));
        let about = unlearnt().next()?.name.clone();
        let each = unlearnt().map(|p| {
            let unit = Unit::of_si(p.unit);
            let mut known: Vec<String> = Vec::new();
            for (start, end) in p.start_sigma.iter().zip(&p.sigma).filter(|(start, _)| **start > 0.0) {
                let both = format!("{} at the start, {} at the end", short(unit.of(*start)), short(unit.of(*end)));
                if !known.contains(&both) {
                    known.push(both);
                }
            }
            format!("`{}` (1σ [{}] {})", p.name, unit.symbol(), known.join("; "))
        });
        let evidence = format!("the data told nothing of {}", each.collect::<Vec<_>>().join(", "));
        let advice = "a motion or a sensor that shows it is missing; without one, give the value with `estimate = false`";
        Some(Finding {
            about,
            evidence,
            advice: advice.to_owned(),
        })
    }

    /// Sources of sensors that were silent for long, where neither a fault nor a declared outage says so.
    fn gaps(&self) -> impl Iterator<Item = Finding> {
        let has_outages = self.summary.score.as_ref().is_some_and(|score| !score.drift.is_empty());
        let is_read = |name: &str| self.instruments.iter().any(|i| i.source == name);
        let sources = self.summary.sources.iter();
        let sources = sources.filter(move |s| !has_outages && s.report.disturbed.is_empty() && is_read(&s.name));
        sources.filter_map(|source| {
            let (at, gap) = source.report.longest_gap?;
            let rate = source.report.mean_rate()?;
            (gap > GAP.1 && gap * rate > GAP.0).then(|| Finding {
                about: source.name.clone(),
                evidence: format!("`{}` has no row for {gap:.1} s at {:.1} s", source.name, at.seconds()),
                advice: "look at the drift there".to_owned(),
            })
        })
    }
}

fn nees_of(score: &Score, what: Measures) -> Option<&Consistency> {
    match what {
        Measures::Position => score.nees_position.as_ref(),
        Measures::Velocity => score.nees_velocity.as_ref(),
        Measures::Attitude => score.nees_attitude.as_ref(),
    }
}

/// Findings of which only the size differs, as one.
fn alike(all: Vec<Finding>) -> Vec<Finding> {
    fn what(finding: &Finding) -> Option<&str> {
        let (size, what) = finding.advice.split_once("; ")?;
        size.ends_with("times the 1σ of the filter").then_some(what)
    }
    let mut kept: Vec<Finding> = Vec::new();
    for finding in all {
        let same = what(&finding);
        match kept.iter_mut().find(|before| same.is_some() && what(before) == same) {
            Some(before) => before.evidence += &format!(", {}", finding.evidence),
            None => kept.push(finding),
        }
    }
    kept
}

/// A heading that is wrong by a constant.
fn constant_heading(score: &Score) -> Option<Finding> {
    let errors = score.attitude_deg.as_ref()?;
    let (mean, rms) = (errors.mean[2], errors.rms[2]);
    let is_told = mean.abs() > LEAST_HEADING && mean * mean > MOST_OF_HEADING * rms * rms;
    let is_too_much = score.nees_attitude.as_ref().is_some_and(is_large);
    (is_told && is_too_much).then(|| Finding {
        about: "heading".to_owned(),
        evidence: format!("the heading error is nearly constant, {mean:.1}° on average and {rms:.1}° RMS"),
        advice: "look at what tells the heading: the `declination` or `bias` of a compass, the `mounting` of the inertial unit or of an \
                 odometer, or whether the reference has an axis of its own (`[reference] remove_mean_mounting`)"
            .to_owned(),
    })
}

/// Whether the 1σ of a parameter fell on no axis.
fn is_unlearnt(p: &FinalState) -> bool {
    let mut axes = p.start_sigma.iter().zip(&p.sigma).filter(|(start, _)| **start > 0.0).peekable();
    axes.peek().is_some() && axes.all(|(start, end)| *end >= LEARNT * start)
}

/// A gate that refuses more than some outliers.
fn rejected(s: &SensorStatistics) -> Option<Finding> {
    let all = s.accepted + s.reacquired + s.rejected;
    // Rejected rows that a declared fault disturbed are what the gate is there for.
    let good = s.rejected - s.disturbed.map_or(0, |d| d.caught).min(s.rejected);
    let share = good as f64 / all as f64;
    (all >= FEW && share > REJECTED).then(|| Finding {
        about: s.name.clone(),
        evidence: format!(
            "the gate of `{}` rejected {good} of {all} measurements, {:.0} %",
            s.name,
            100.0 * share
        ),
        advice: "if they are not outliers, look at its time stamps, lever arm and axes, then at its `noise`".to_owned(),
    })
}

/// A constant offset in body axes that explains the position errors.
fn wrong_arm(offset: &Offset, point: [f64; 3]) -> Option<Finding> {
    let is_known = |k: usize| offset.body[k].abs() > CERTAIN * offset.sigma[k];
    if offset.explained < MOST || !(0..3).any(is_known) {
        return None;
    }
    // What nothing tells stays as it is declared.
    let off: [f64; 3] = core::array::from_fn(|k| if offset.sigma[k] < UNKNOWN { -offset.body[k] } else { 0.0 });
    let arm: [f64; 3] = core::array::from_fn(|k| point[k] + off[k]);
    let [off, arm] = [off, arm].map(|v| v.map(|v| format!("{v:.2}")).join(", "));
    Some(Finding {
        about: "reference".to_owned(),
        evidence: format!(
            "position error is explained to {:.0} % by an offset of [{off}] m in body axes",
            100.0 * offset.explained
        ),
        advice: format!(
            "if the reference tells of a point there, give `reference.lever_arm = [{arm}]`; else look at the `lever_arm` of the sensors \
             of position"
        ),
    })
}

/// Outages at whose end the error is more than 3σ, in more of them than chance allows.
fn bold_outages(drift: &[Drift]) -> Option<Finding> {
    let ratios = drift.iter().map(Drift::end_ratio).filter(|ratio| ratio.is_finite());
    let (all, bold) = ratios.fold((0_u32, 0_u32), |(all, bold), ratio| (all + 1, bold + u32::from(ratio > 3.0)));
    // χ² of two degrees of freedom exceeds 9 with exp(−9/2), and that so often or oftener:
    let p = (-4.5_f64).exp();
    let mut chance = 1.0;
    let mut exactly = (1.0 - p).powi(i32::try_from(all).ok()?);
    for k in 0..bold {
        chance -= exactly;
        exactly *= f64::from(all - k) / f64::from(k + 1) * p / (1.0 - p);
    }
    (bold > 0 && chance < CHANCE).then(|| Finding {
        about: "outages".to_owned(),
        evidence: format!("at the end of {bold} of {all} outages the error is more than 3σ of the filter"),
        advice: "raise the noise of the process or the random walk of its biases (`fusion allan` measures both); a constraint that \
                 does not hold, such as a false `zero_velocity`, does the same"
            .to_owned(),
    })
}

/// Innovations that are larger than the filter expects.
fn large(sensor: &Instrument, s: &SensorStatistics) -> Option<Finding> {
    let (name, nis) = (&sensor.name, s.nis.as_ref()?);
    // Of a gate that refuses nothing the power is infinite.
    let is_gated = s.gate_power.iter().any(|power| power.is_finite());
    let advice = if sensor.is_constraint {
        "the vehicle does not keep this constraint so well; raise its `noise`, or apply it less often"
    } else if ratio(nis) > FAR {
        "so much is hardly noise: look first at its axes, signs and units, at its time stamps (`fusion check DESIGN --data DIR` compares \
         its channels with others) and its lever arm; leave its `noise` until they are right"
    } else if lag_1(s).is_some_and(|rho| rho > LASTING) {
        "each is like the one before, so it is no noise: look at its time stamps (`time_offset`), lever arm, axes and scale, then for a \
         slow error without a state, such as its `bias`"
    } else if !is_gated {
        "are there outliers, which a `gate` would refuse? Else look at its time stamps (`time_offset`), lever arm and axes, then at \
         its `noise`"
    } else {
        "look at its time stamps (`time_offset`), lever arm and axes; if they are right, raise its `noise` or that of the process"
    };
    is_large(nis).then(|| Finding {
        about: name.clone(),
        evidence: format!(
            "NIS of `{name}` is {} of {}, innovations are {} times what is expected",
            short(nis.mean),
            nis.dof,
            short(nis.error_ratio())
        ),
        advice: advice.to_owned(),
    })
}

/// The largest autocorrelation at lag 1 of the innovations of a sensor, where there are enough to tell.
fn lag_1(s: &SensorStatistics) -> Option<f64> {
    let rows = s.innovations.lag_1.iter().filter(|_| s.innovations.count >= ENOUGH);
    rows.copied().reduce(f64::max)
}

/// Whether innovations are so much smaller than expected that it is worth a change.
fn is_small(nis: &Consistency) -> bool {
    nis.verdict() == Some(Verdict::Conservative) && ratio(nis) < SMALL
}

/// Whether errors are so much larger than expected that it is worth a change.
fn is_large(c: &Consistency) -> bool {
    c.verdict() == Some(Verdict::Overconfident) && ratio(c) > LARGE
}

/// The mean over what it should be.
fn ratio(c: &Consistency) -> f64 {
    c.mean / c.dof as f64
}
