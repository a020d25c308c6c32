//! Findings from the errors against the reference.

use super::facts::Facts;
use super::found::Found;
use super::instrument::{Bias, Instrument, Measures, listed};
use super::level::{is_more_than, level, sigmas};
use super::{CHECK, FAR, Finding, LARGE, is_large, ratio};
use fusion::config::Edit;
use fusion::score::{Axes, Consistency, ConsistencyVerdict, Drift, Offset, Score};
use fusion_core::math;
use fusion_tables::short;

/// A mean NEES over its degrees of freedom below this is worth a change: errors are half of the 1σ. A slightly
/// conservative filter is not reported.
const TINY: f64 = 0.25;
/// A larger noise changes nothing if the mean NIS over its degrees of freedom is below this: the gain is already small.
const FOLLOWED: f64 = 0.3;
/// A mean heading error is reported above this \[deg\], if it makes up this share of the mean square.
const LEAST_HEADING: f64 = 1.0;
const MOST_OF_HEADING: f64 = 0.8;
/// A constant heading error above this \[deg\] is too large for a small mounting error.
const MOUNTED: f64 = 20.0;
/// A heading with a larger RMS error is wrong for any use \[deg\].
const WRONG_HEADING: f64 = 10.0;
/// Above this share of the squared heading errors, most of the error comes from the reference.
const MOST_OF_ERRORS: f64 = 0.5;
/// Above this scatter of the heading about the course \[deg\], the vehicle does not move where its nose points. It is
/// half a radian: smaller angles can be added as numbers.
const MOST_SLIP: f64 = 28.6;
/// A measurement that moves the estimate by more than this number of its 1σ is worth a look, in an outage that is
/// certainly wrong. A measurement that alone determines the estimate does so by chance once in twenty times.
const MOVED: f64 = 2.0;
/// An offset or a latency is the main cause if it explains the share `MOST` of the errors. It is named if it explains
/// `LEAST` and exceeds `CERTAIN` times its 1σ. An offset whose 1σ is larger than `UNKNOWN` \[m\] is unknown.
const MOST: f64 = 0.5;
const LEAST: f64 = 0.2;
const CERTAIN: f64 = 5.0;
const UNKNOWN: f64 = 1.0;
/// An axis of an offset has to explain more than the share `OWN` of the squares that remain without it. The halves of
/// the run may differ from it by at most the share `ALIKE`.
const OWN: f64 = 0.05;
const ALIKE: f64 = 0.5;
/// Smaller offsets \[m\] and latencies \[s\] are not reported.
const LEAST_OFFSET: f64 = 0.05;
const LEAST_LATENCY: f64 = 0.01;

impl Facts<'_> {
    /// Whether errors of a part of the solution are larger than the filter says.
    pub(super) fn has_large_errors(&self) -> bool {
        Measures::ALL.into_iter().filter_map(|what| self.nees(what)).any(is_large)
    }

    /// Errors of all parts of the solution. They may follow from the findings so far.
    pub(super) fn all_errors(&self, found: &Found) -> Vec<Finding> {
        let late = if found.has(&["reference-late"]) {
            self.late_reference()
        } else {
            Vec::new()
        };
        let errors = Measures::ALL.into_iter().filter_map(|what| {
            let is_late = found.has(&["reference-latency"]) || late.iter().any(|(of, _)| *of == what);
            let is_reference = is_late || what == Measures::Position && found.has(&["reference-arm"]);
            let is_heading = what == Measures::Attitude && found.has(&["heading-constant", "reference-heading", "heading-wrong"]);
            let own = [(is_reference, "the reference"), (is_heading, "the heading")];
            let own = own.into_iter().filter(|(is_found, _)| *is_found).map(|(_, words)| words.to_owned());
            let causes: Vec<String> = found.causes().iter().cloned().chain(own).collect();
            self.errors(what, &causes)
        });
        let mut errors = alike(errors.collect());
        // For a log, name checks that find the cause before causes that are guesses.
        let is_guessed = |f: &&mut Finding| f.advice.split_once(TIMES).is_some_and(|(_, cause)| !cause.starts_with(BEGIN));
        if let Some(first) = errors.iter_mut().find(is_guessed).filter(|_| self.is_recorded) {
            let check = format!("{BEGIN}{CHECK}, which tries latencies, lever arms, axes, scales and angles; if nothing is found wrong: ");
            first.advice = first.advice.replacen(TIMES, &format!("{TIMES}{check}"), 1);
        }
        errors
    }

    /// Errors against the reference that do not agree with the covariance.
    fn errors(&self, what: Measures, causes: &[String]) -> Option<Finding> {
        let c = self.nees(what)?;
        let name = format!("NEES {}", what.word());
        let evidence = format!("{name} is {} of {}", short(c.mean), c.dof);
        let times = || format!("{ERRORS}{}{TIMES}", short(c.error_ratio()));
        let rule = match c.verdict()? {
            ConsistencyVerdict::Overconfident => "nees-large",
            _ => "nees-small",
        };
        let advice = match c.verdict()? {
            ConsistencyVerdict::Overconfident if ratio(c) > LARGE && !causes.is_empty() => {
                format!("{}{BEGIN}what is said of {}", times(), listed(causes))
            }
            ConsistencyVerdict::Overconfident if ratio(c) > LARGE => times() + &self.cause(what, c),
            // Other rows of a sensor do not show the slow error that makes the filter conservative.
            ConsistencyVerdict::Conservative if self.run.is_judged_by_its_sensor => return None,
            ConsistencyVerdict::Conservative if ratio(c) < TINY => format!(
                "errors are only {} times the 1σ of the filter; the noises of its sensors or process are larger than need be",
                short(c.error_ratio())
            ),
            _ => return None,
        };
        Some(Finding {
            about: name,
            evidence,
            advice,
            ..Finding::of(rule)
        })
    }

    /// Why the filter is overconfident although no sensor disagrees: it may follow the error of a sensor.
    fn cause(&self, what: Measures, nees: &Consistency) -> String {
        let axis = worst_axis(self.run.score.and_then(|score| axes_of(score, what)));
        let told = self.measuring(what).filter(|(i, _)| axis.is_none_or(|k| i.axes[k]));
        let followed = told.filter(|(_, nis)| nis.verdict() == Some(ConsistencyVerdict::Conservative));
        let Some((sensor, nis)) = followed.min_by(|a, b| ratio(a.1).total_cmp(&ratio(b.1))) else {
            let start = "the start was far off (`[reference] from` judges from later on)";
            let others = "a noise of the process is too small, an error of a sensor has no state";
            return if self.is_recorded {
                format!("{others}, {start}, or {}", self.reference(what))
            } else {
                format!("{others}, or {start}")
            };
        };
        // For a sensor without a bias the rows are independent, except if a constant input bias leaves an error in
        // them.
        if sensor.bias != Some(Bias::Fixed) && self.is_lasting(&sensor.name) && !self.constant_biases.is_empty() {
            return format!(
                "an error that lasts is left in the innovations of `{}`, and {} cannot change: give a `random_walk` (`fusion allan` measures \
                 it), or raise the noise of the process",
                sensor.name,
                listed(&self.constant_biases)
            );
        }
        let is_deaf = ratio(nis) < FOLLOWED && (sensor.bias.is_none() || ratio(nees) > FAR);
        let nis_is = format!("NIS of `{}` is only {} of {}", sensor.name, short(nis.mean), nis.dof);
        if self.is_recorded && is_deaf {
            let reference = self.reference(what);
            let process = match what {
                Measures::Velocity | Measures::Attitude => "a noise of the process is too small, ",
                Measures::Position => "",
            };
            format!("{nis_is}, so it agrees with the estimate; either {process}{reference}, or an error of a sensor has no state")
        } else {
            format!("{nis_is}, so {}", slow(sensor))
        }
    }

    /// The possible faults of the reference.
    fn reference(&self, what: Measures) -> String {
        let sigma = if self.is_exact[what as usize] {
            "its own errors (`sigma`), "
        } else {
            ""
        };
        let offset = self.run.score.and_then(|score| score.offset.as_ref());
        // Position errors do not determine the offset of a velocity.
        let arm = offset.and_then(|offset| known_arm(offset, self.point)).map(|(_, arm)| arm);
        let other = match (what, arm) {
            (Measures::Attitude, _) => "other axes (`remove_mean_mounting`)".to_owned(),
            (Measures::Velocity, _) | (Measures::Position, None) => "another point (`lever_arm`)".to_owned(),
            (Measures::Position, Some(arm)) => format!("another point (the position errors fit `lever_arm = [{}]`)", metres(arm)),
        };
        format!("the `[reference]` has {sigma}{other} or late stamps (`latency` of its channels)")
    }

    /// A reference whose heading fits its own velocity less well than the estimated heading does.
    pub(super) fn wrong_reference(&self) -> Option<Finding> {
        let score = self.run.score?;
        let (axes, course) = (score.attitude_deg.as_ref()?, score.course?);
        // A share above 1 cannot come from the reference: then the slip correlates with the errors, because the nose
        // does not follow the motion.
        let least = course.share - sigmas(1) * course.share_sigma;
        let is_share = least <= 1.0 && course.reference_deg < MOST_SLIP;
        let is_worse = is_share && least > MOST_OF_ERRORS;
        let is_outside = ConsistencyVerdict::of_share(axes.inside[2]) == Some(ConsistencyVerdict::Overconfident);
        (is_outside && is_worse).then(|| Finding {
            about: "heading".to_owned(),
            evidence: format!(
                "{:.0} % of the heading errors lie inside 3σ; about the course of the reference's own velocity its heading scatters by {}°, \
                 that of the filter by {}°, so {:.0} % of the squares of these errors are of the reference, 1σ {:.0} %",
                100.0 * axes.inside[2],
                short(course.reference_deg),
                short(course.estimate_deg),
                100.0 * course.share,
                100.0 * course.share_sigma
            ),
            advice: format!(
                "unless the vehicle slides sideways, give the heading of the reference a 1σ of \"{:.2} deg\", the third of \
                 `reference.sigma.attitude`",
                course.own_deg
            ),
            ..Finding::of("reference-heading")
        })
    }

    /// Attitude errors outside 3σ, if the mounting was removed and the run has no NEES. `tells_heading`: another
    /// finding is about the heading alone.
    pub(super) fn attitude_outside(&self, causes: &[String], tells_heading: bool) -> Option<Finding> {
        let score = self.run.score?;
        let axes = score.attitude_deg.as_ref().filter(|_| score.nees_attitude.is_none())?;
        let is_outside = |k: &usize| ConsistencyVerdict::of_share(axes.inside[*k]) == Some(ConsistencyVerdict::Overconfident);
        let outside: Vec<usize> = (0..3).filter(is_outside).collect();
        // The first finding shows the worst axis; do not report it twice.
        let worst = outside.iter().copied().min_by(|a, b| axes.inside[*a].total_cmp(&axes.inside[*b]))?;
        if worst == 2 && tells_heading {
            return None;
        }
        let each: Vec<String> = outside
            .iter()
            .map(|k| format!("{:.1} % of {}", 100.0 * axes.inside[*k], ["roll", "pitch", "yaw"][*k]))
            .collect();
        let advice = if causes.is_empty() {
            let check = if self.is_recorded {
                format!("{BEGIN}{CHECK}; if nothing is found wrong: ")
            } else {
                String::new()
            };
            format!(
                "{check}a noise of the process is too small, an error of a sensor has no state, or the `[reference]` has errors of its own \
                 (`sigma.attitude`) or late stamps (`latency` of its channels)"
            )
        } else {
            format!("{BEGIN}what is said of {}", listed(causes))
        };
        Some(Finding {
            about: "attitude".to_owned(),
            evidence: format!("inside 3σ lie {} of the attitude errors", each.join(", ")),
            advice,
            ..Finding::of("attitude-outside")
        })
    }

    /// Another point of the reference.
    pub(super) fn wrong_arm(&self) -> Option<Finding> {
        let offset = self.run.score?.offset.as_ref()?;
        self.other_arm().or_else(|| offset_arm(offset, self.point))
    }

    /// A latency that explains the position errors.
    pub(super) fn wrong_latency(&self) -> Option<Finding> {
        let offset = self.run.score?.offset.as_ref()?;
        let Offset {
            latency,
            latency_sigma,
            latency_explained,
            ..
        } = *offset;
        if latency_explained < MOST || latency.abs() < LEAST_LATENCY.max(CERTAIN * latency_sigma) {
            return None;
        }
        let mut edits = Vec::new();
        let (evidence, advice) = if latency > 0.0 {
            (
                "late",
                format!(
                    "if its stamps are late, give its channels `latency = \"{latency:.2} s\"`; else the sensors of position are earlier than \
                     their `time_offset` says"
                ),
            )
        } else {
            let sensors = || {
                format!(
                    "the sensors of position are later than their `time_offset` says, by {:.2} s, or the stamps of the reference are early",
                    -latency
                )
            };
            let (advice, edit) = self.late_input(offset).unzip();
            edits.extend(edit);
            ("early", advice.unwrap_or_else(sensors))
        };
        Some(Finding {
            about: "reference".to_owned(),
            evidence: format!(
                "position error is explained to {:.0} % by a reference that is {evidence} by {:.2} s",
                100.0 * latency_explained,
                latency.abs()
            ),
            advice,
            edits,
            ..Finding::of("reference-latency")
        })
    }

    /// A heading that is certainly wrong, although its 1σ is small.
    pub(super) fn wrong_heading(&self) -> Option<Finding> {
        let score = self.run.score?;
        let (axes, rms) = (score.attitude_deg.as_ref()?, score.heading_rmse_deg?);
        let is_told = rms > WRONG_HEADING && ConsistencyVerdict::of_share(axes.inside[2]) == Some(ConsistencyVerdict::Overconfident);
        let median = score.spread.heading_deg.map_or(rms, |s| s.median);
        // Before its alignment the filter itself reports a wrong heading.
        let own = self.run.health;
        let aligned = own.and_then(|h| h.aligned).filter(|aligned| axes.max_time[2] < *aligned);
        let from = aligned.map(|aligned| Edit::set("reference.from", format!("\"{aligned:.1} s\"")));
        let advice = if let (Some(aligned), Some(from)) = (aligned, &from) {
            format!(
                "the largest is of the time before the filter was aligned, at {aligned:.1} s: {from}, which leaves it out and shows what \
                 the others are"
            )
        } else if self.is_recorded {
            format!("either the filter or the reference is wrong: {CHECK} compares both with the way travelled")
        } else {
            "look at what gives the heading, and at how it starts (`[initial]`, `filter.bank`)".to_owned()
        };
        is_told.then(|| Finding {
            about: "heading".to_owned(),
            evidence: format!(
                "the heading error is {}° RMS, {}° by the median, {}° at most, at {:.1} s, and {:.0} % of the errors lie inside 3σ",
                short(rms),
                short(median),
                short(axes.max[2]),
                axes.max_time[2],
                100.0 * axes.inside[2]
            ),
            advice,
            edits: from.into_iter().collect(),
            ..Finding::of("heading-wrong")
        })
    }
}

/// The text around the ratio of errors to their 1σ.
const ERRORS: &str = "errors are ";
const TIMES: &str = " times the 1σ of the filter; ";
/// The text before the cause to look at first.
const BEGIN: &str = "begin with ";

/// The advice if the estimate follows an error of a sensor.
fn slow(sensor: &Instrument) -> String {
    let name = &sensor.name;
    let follows = format!("the estimate follows a slow error of `{name}`");
    match sensor.bias {
        Some(Bias::Fixed) => format!("{follows}; declare its `bias` as a state with a `correlation_time`"),
        Some(Bias::Constant) => format!("{follows}, whose `bias` is a constant; give it a `correlation_time`"),
        Some(Bias::Walk) => format!("{follows}, more than its `bias` may change; raise the `random_walk` of `{name}.bias`"),
        Some(Bias::Correlated) => format!("{follows}, larger than its `bias` may be; raise the `sigma` of `{name}.bias`"),
        None => format!("{follows}; raise its `noise`, for its rows are not independent"),
    }
}

fn axes_of(score: &Score, what: Measures) -> Option<&Axes> {
    match what {
        Measures::Position => score.position.as_ref(),
        Measures::Velocity => score.velocity.as_ref(),
        Measures::Attitude => score.attitude_deg.as_ref(),
    }
}

/// The axis with the largest error for its 3σ.
fn worst_axis(axes: Option<&Axes>) -> Option<usize> {
    let axes = axes?;
    let ratio = |k: usize| axes.rms[k] / axes.three_sigma[k];
    (0..3)
        .filter(|k| ratio(*k).is_finite())
        .max_by(|a, b| ratio(*a).total_cmp(&ratio(*b)))
}

/// Merges findings that differ only in the size of the error.
fn alike(all: Vec<Finding>) -> Vec<Finding> {
    fn what(finding: &Finding) -> Option<&str> {
        let rest = finding.advice.strip_prefix(ERRORS)?;
        rest.split_once(TIMES).map(|(_, what)| what)
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

/// A heading with a constant error.
pub(super) fn constant_heading(score: &Score) -> Option<Finding> {
    let errors = score.attitude_deg.as_ref()?;
    let (mean, rms) = (errors.mean[2], errors.rms[2]);
    let is_told = mean.abs() > LEAST_HEADING && mean * mean > MOST_OF_HEADING * rms * rms;
    let is_too_much = score.nees_attitude.as_ref().is_some_and(is_large);
    (is_told && is_too_much).then(|| Finding {
        about: "heading".to_owned(),
        evidence: format!("the heading error is nearly constant, {mean:.1}° on average and {rms:.1}° RMS"),
        advice: if mean.abs() > MOUNTED {
            "so much is no mounting: look at the axes and signs of what tells the heading, and of the reference's attitude \
             (`navigation_rotation`, the order of a quaternion); `remove_mean_mounting` would hide it"
                .to_owned()
        } else {
            "look at what tells the heading: the `declination` or `bias` of a compass, the `mounting` of the inertial unit or of an \
             odometer, or whether the reference has an axis of its own (`[reference] remove_mean_mounting`)"
                .to_owned()
        },
        ..Finding::of("heading-constant")
    })
}

/// The body-axis offset as far as it is known, and the reference point that removes it \[m\].
fn known_arm(offset: &Offset, point: [f64; 3]) -> Option<([f64; 3], [f64; 3])> {
    // An undetermined axis keeps its declared value. Slow errors fit any arm for a while. On a level vehicle, a
    // vertical arm explains hardly any error by itself.
    let halves = || offset.halves.iter().zip(&offset.halves_sigma);
    // A half run whose offset is poorly determined contradicts nothing.
    let slack = |k: usize, sigma: f64| ALIKE * offset.body[k].abs() + 2.0 * sigma;
    let is_alike = |k: usize| halves().all(|(half, sigma)| (half[k] - offset.body[k]).abs() < slack(k, sigma[k]));
    let is_told = |k: usize| {
        let is_known = offset.sigma[k] < UNKNOWN && offset.body[k].abs() > 2.0 * offset.sigma[k];
        is_known && offset.own[k] > OWN && is_alike(k)
    };
    let off: [f64; 3] = core::array::from_fn(|k| if is_told(k) { -offset.body[k] } else { 0.0 });
    let is_known = |k: usize| off[k].abs() > LEAST_OFFSET.max(CERTAIN * offset.sigma[k]);
    let arm = core::array::from_fn(|k| point[k] + off[k]);
    (offset.explained > LEAST && (0..3).any(is_known)).then_some((off, arm))
}

fn metres(v: [f64; 3]) -> String {
    // 0.0 +: no minus before zero.
    v.map(|v| format!("{:.2}", 0.0 + math::round(100.0 * v) / 100.0)).join(", ")
}

/// A constant offset in body axes that explains the position errors.
fn offset_arm(offset: &Offset, point: [f64; 3]) -> Option<Finding> {
    let (off, arm) = known_arm(offset, point).filter(|_| offset.explained > MOST)?;
    Some(Finding {
        about: "reference".to_owned(),
        evidence: format!(
            "position error is explained to {:.0} % by an offset of [{}] m in body axes",
            100.0 * offset.explained,
            metres(off)
        ),
        advice: format!(
            "if the reference tells of a point there, give `reference.lever_arm = [{}]`; else look at the `lever_arm` of the sensors \
             of position",
            metres(arm)
        ),
        ..Finding::of("reference-arm")
    })
}

/// Outages with an end error above 3σ, if there are more of them than chance allows.
pub(super) fn bold_outages(drift: &[Drift]) -> Option<Finding> {
    let ratios = drift.iter().map(Drift::end_ratio).filter(|ratio| ratio.is_finite());
    let (all, bold) = ratios.fold((0, 0), |(all, bold), ratio| (all + 1, bold + u64::from(ratio > 3.0)));
    // χ² of two degrees of freedom exceeds 9 with probability exp(−9/2).
    let is_improbable = is_more_than(bold, all, math::exp(-4.5_f64), 1);
    is_improbable.then(|| Finding {
        about: "outages".to_owned(),
        evidence: format!("at the end of {bold} of {all} outages the error is more than 3σ of the filter"),
        advice: drifting(),
        ..Finding::of("outages-outside")
    })
}

/// The outage whose end error is largest in σ, if the largest of this number of outages exceeds what chance allows.
pub(super) fn far_outage(drift: &[Drift]) -> Option<Finding> {
    let known = drift.iter().filter(|d| d.end_ratio().is_finite());
    let all = known.clone().count() as f64;
    let worst = known.max_by(|a, b| a.end_ratio().total_cmp(&b.end_ratio()))?;
    // Bonferroni bound: the largest of n squares, each χ² of at most two degrees of freedom, exceeds x with probability
    // ≤ n exp(−x/2).
    let chance = all * math::exp(-0.5 * math::powi(worst.end_ratio(), 2));
    let moved = worst.moved.as_ref().filter(|moved| moved.sigmas > MOVED).map(|moved| {
        format!(
            "look first at `{}` at {:.1} s, which moved what it measures by {} of its 1σ, more than all others in that outage; then ",
            moved.sensor,
            moved.time,
            short(moved.sigmas)
        )
    });
    (chance < level(1)).then(|| Finding {
        about: "outages".to_owned(),
        evidence: format!(
            "at the end of the outage at {:.1} s the error is {} m, {} times the 1σ of the filter",
            worst.from,
            short(worst.end_horizontal),
            short(worst.end_ratio())
        ),
        advice: moved.unwrap_or_default() + &drifting(),
        ..Finding::of("outage-far")
    })
}

/// The causes of an error that grows faster than its 1σ.
fn drifting() -> String {
    "raise the noise of the process or the random walk of its biases (`fusion allan` measures both); a constraint that does not hold, \
     such as a false `zero_velocity`, does the same"
        .to_owned()
}
