//! The rules of a run, in the order in which their findings are reported: causes before effects.

use super::Finding;
use super::errors::{bold_outages, constant_heading, far_outage};
use super::facts::Facts;
use super::found::Found;
use fusion::run::Ignored;

/// A fact that a run may not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    /// The filter never started.
    NoStart,
    /// The filter started.
    Start,
    /// The rows are recorded: the axes, signs, units and stamps may be wrong.
    Recorded,
    /// There are errors against a reference.
    Reference,
    /// No earlier finding is a cause of errors.
    NoCause,
}

impl Need {
    fn is_met(self, facts: &Facts<'_>, found: &Found) -> bool {
        match self {
            Self::NoStart => facts.run.started.is_none(),
            Self::Start => facts.run.started.is_some(),
            Self::Recorded => facts.is_recorded,
            Self::Reference => facts.run.score.is_some(),
            Self::NoCause => found.causes().is_empty(),
        }
    }
}

/// How errors that follow from a finding refer to it.
#[derive(Clone, Copy, Debug)]
enum Blame {
    /// It is not a cause of errors.
    Nothing,
    /// By these words.
    Words(&'static str),
    /// By the subject of the finding.
    Subject,
}

impl Blame {
    fn words(self, finding: &Finding) -> Option<String> {
        match self {
            Self::Nothing => None,
            Self::Words(words) => Some(words.to_owned()),
            Self::Subject => Some(format!("`{}`", finding.about)),
        }
    }
}

/// Rules whose findings are found together.
struct RunRule {
    /// Their ids.
    ids: &'static [&'static str],
    /// The facts that they need.
    needs: &'static [Need],
    /// With a finding of one of these rules, these rules have nothing to add.
    unless: &'static [&'static str],
    blame: Blame,
    /// The findings. Test, words and edits of a rule are one function.
    find: fn(&Facts<'_>, &Found) -> Vec<Finding>,
}

/// The findings of all rules but the `ignored` ones: these are not causes of others either.
pub(super) fn apply(facts: &Facts<'_>, ignored: &Ignored) -> Vec<Finding> {
    let mut found = Found::default();
    for rule in RULES {
        if found.has(rule.unless) || !rule.needs.iter().all(|need| need.is_met(facts, &found)) {
            continue;
        }
        for finding in (rule.find)(facts, &found) {
            debug_assert!(
                rule.ids.contains(&finding.rule.as_str()),
                "{} is not of {:?}",
                finding.rule,
                rule.ids
            );
            if !ignored.has(&finding.rule) {
                found.add(rule.blame.words(&finding), finding);
            }
        }
    }
    found.finish()
}

/// The ids of all rules of a run.
#[cfg(test)]
pub(super) fn run_rules() -> impl Iterator<Item = &'static str> {
    RULES.iter().flat_map(|rule| rule.ids).copied()
}

/// Rules of a started filter that are no causes of errors.
const fn rule(ids: &'static [&'static str], find: fn(&Facts<'_>, &Found) -> Vec<Finding>) -> RunRule {
    RunRule {
        ids,
        needs: &[Need::Start],
        unless: &[],
        blame: Blame::Nothing,
        find,
    }
}

const fn cause(blame: Blame, ids: &'static [&'static str], find: fn(&Facts<'_>, &Found) -> Vec<Finding>) -> RunRule {
    RunRule { blame, ..rule(ids, find) }
}

impl RunRule {
    const fn needs(self, needs: &'static [Need]) -> Self {
        Self { needs, ..self }
    }

    const fn unless(self, unless: &'static [&'static str]) -> Self {
        Self { unless, ..self }
    }
}

fn one(finding: Option<Finding>) -> Vec<Finding> {
    finding.into_iter().collect()
}

/// All sensors are compared with the input: if it is wrong, nothing else is blamed.
const INPUT: &[&str] = &["wrong-input"];
const JUDGED: &[Need] = &[Need::Start, Need::Reference];
const LOGGED: &[Need] = &[Need::Start, Need::Reference, Need::Recorded, Need::NoCause];
const REFUSED: &[&str] = &["reacquired", "gate-rejects"];
const HEADINGS: &[&str] = &["heading-constant", "reference-heading", "heading-wrong"];

/// All rules of a run.
const RULES: &[RunRule] = &[
    rule(&["log-damaged"], |f, _| f.damaged_logs()).needs(&[]),
    rule(&["never-started"], |f, _| one(f.never_started())).needs(&[Need::NoStart]),
    rule(&["lost"], |f, _| one(f.lost())),
    rule(&["late-start"], |f, _| one(f.late_start())),
    cause(Blame::Words("the range of the input"), &["input-range"], |f, _| {
        one(f.beyond_range())
    }),
    cause(Blame::Words("the faults"), &["fault-used"], |f, _| one(f.disturbed())).needs(JUDGED),
    cause(Blame::Words("the input"), INPUT, |f, _| {
        one(f.all_disagree().or_else(|| f.all_refused()))
    }),
    cause(Blame::Words("the start"), &["poor-start"], |f, _| one(f.poor_start())),
    cause(Blame::Words("the spikes"), &["input-spikes"], |f, _| {
        one(f.spikes().filter(|_| f.has_large_errors()))
    }),
    cause(Blame::Subject, &["parameter-far"], |f, _| {
        one(f
            .far_parameter()
            .filter(|(is_of_input, _)| *is_of_input)
            .map(|(_, finding)| finding))
    })
    .unless(INPUT),
    cause(
        Blame::Subject,
        &["first-to-disagree"],
        |f, _| one(f.first_to_disagree(&f.refused())),
    )
    .unless(INPUT),
    cause(Blame::Subject, REFUSED, |f, _| f.refused()).unless(INPUT),
    cause(Blame::Subject, &["parameter-far"], |f, _| {
        one(f
            .far_parameter()
            .filter(|(is_of_input, _)| !is_of_input)
            .map(|(_, finding)| finding))
    })
    .unless(INPUT),
    cause(Blame::Subject, &["never-held"], |f, _| one(f.never_held())),
    cause(Blame::Subject, &["nis-large"], |f, _| f.of_each_sensor(Facts::large)),
    cause(Blame::Subject, &["parameter-moved"], |f, found| {
        f.moved(|name| found.is_about(&["nis-large", "reacquired", "gate-rejects", "first-to-disagree"], name))
    })
    .unless(INPUT),
    cause(Blame::Subject, &["innovations-repeat"], |f, _| f.counted()),
    rule(&["heading-undecided"], |f, _| one(f.undecided())),
    rule(&["heading-changed"], |f, _| one(f.changed())),
    rule(&["heading-constant"], |f, _| one(f.run.score.and_then(constant_heading))).needs(JUDGED),
    rule(&["reference-heading"], |f, _| one(f.wrong_reference()))
        .needs(&[Need::Start, Need::Reference, Need::Recorded])
        .unless(HEADINGS),
    rule(&["heading-wrong"], |f, _| one(f.wrong_heading()))
        .needs(JUDGED)
        .unless(HEADINGS),
    rule(&["reference-latency"], |f, _| one(f.wrong_latency())).needs(LOGGED),
    rule(&["reference-late"], |f, _| {
        f.late_reference().into_iter().map(|(_, finding)| finding).collect()
    })
    .needs(LOGGED)
    .unless(&["reference-latency"]),
    // Wrong time stamps look like a lever arm.
    rule(&["reference-arm"], |f, _| one(f.wrong_arm()))
        .needs(LOGGED)
        .unless(&["reference-latency", "reference-late"]),
    rule(&["nees-large", "nees-small"], |f, found| f.all_errors(found)).needs(JUDGED),
    rule(&["attitude-outside"], |f, found| {
        one(f.attitude_outside(found.causes(), found.has(HEADINGS)))
    })
    .needs(JUDGED),
    rule(&["outages-outside"], |f, _| {
        one(f.run.score.and_then(|score| bold_outages(&score.drift)))
    })
    .needs(JUDGED),
    rule(&["outage-far"], |f, _| one(f.run.score.and_then(|score| far_outage(&score.drift))))
        .needs(JUDGED)
        .unless(&["outages-outside"]),
    rule(&["uncertain-start"], |f, _| one(f.uncertain_start())),
    rule(&["nis-small"], |f, found| f.of_each_sensor_but(found, Facts::small)),
    rule(&["innovations-last"], |f, found| f.of_each_sensor_but(found, Facts::lasting)),
    rule(&["nis-beyond-chance"], |f, _| one(f.beyond_chance())).needs(&[Need::Start, Need::Recorded]),
    rule(&["parameter-unlearnt"], |f, _| one(f.unlearnt())),
    rule(&["input-spikes"], |f, _| one(f.spikes().filter(|_| !f.has_large_errors()))),
    rule(&["input-gap"], |f, _| one(f.coasted())),
    rule(&["row-gap"], |f, _| f.gaps().collect()),
];
