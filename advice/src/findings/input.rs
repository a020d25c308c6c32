//! Findings about the process input, and about gaps of sources.

use super::facts::Facts;
use super::instrument::{Instrument, Measures};
use super::sensors::{disagrees_from, rejected_share};
use super::{CHECK, FAR, Finding, is_large, ratio};
use fusion::observe::SensorStatistics;
use fusion::score::Consistency;
use fusion_tables::short;

/// More input samples out of range are more than a blow or two.
const BLOWS: u64 = 4;
/// A larger share of input samples outside the declared range is more than a blow or two.
const BEYOND: f64 = 1e-3;
/// A stretch without rows is reported if it is longer than this number of intervals of its source and of seconds.
const GAP: (f64, f64) = (10.0, 3.0);

impl Facts<'_> {
    /// If all sensors disagree by far, the fault is in the process input: all are compared with it.
    pub(super) fn all_disagree(&self) -> Option<Finding> {
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
        Some(wrong_input(format!(
            "no sensor agrees with the estimate: NIS of {}",
            each.join(", ")
        )))
    }

    /// The same if every gate rejects often, for at least three sensors that do not share one source.
    pub(super) fn all_refused(&self) -> Option<Finding> {
        let gated: Vec<(&Instrument, &SensorStatistics)> = self.sensors().filter(|(i, _)| i.has_gate && !i.is_constraint).collect();
        let each: Option<Vec<String>> = gated
            .iter()
            .map(|(_, s)| Some(format!("`{}` {:.0} %", s.name, 100.0 * rejected_share(s)?)))
            .collect();
        let have_one_source = gated.iter().all(|(i, _)| i.source == gated[0].0.source);
        let each = each.filter(|each| each.len() >= 3 && !have_one_source)?;
        let mut finding = wrong_input(format!("every gate rejects measurements: {}", each.join(", ")));
        let open = self.instruments.iter().filter(|i| !i.has_gate && !i.is_detected());
        let open: Vec<&Instrument> = open.collect();
        let first = gated.iter().map(|(_, s)| *s);
        let first = first.min_by(|a, b| disagrees_from(a).total_cmp(&disagrees_from(b)));
        // The estimate follows a sensor without a gate, right or wrong. Among the others, the first to disagree may be
        // the only wrong sensor.
        if let [open] = open.as_slice() {
            let name = &open.name;
            finding.advice = format!(
                "the estimate follows `{name}`, which has no gate: run once with `sensor.{name}.enabled = false`; if the others agree then, \
                 look at its {}; if not, {}",
                open.parts(),
                finding.advice
            );
        } else if let Some(first) = first.filter(|s| s.disagrees_from.is_some()) {
            finding.advice += &format!(
                "; if both are right, run once with `sensor.{}.enabled = false`, which was the first to disagree, from {:.1} s on",
                first.name,
                disagrees_from(first)
            );
        }
        Some(finding)
    }

    /// Logs that are damaged or cut off, each once with its sources.
    pub(super) fn damaged_logs(&self) -> Vec<Finding> {
        let mut logs: Vec<(&str, Vec<String>)> = Vec::new();
        for source in self.run.sources {
            let Some(damage) = source.report.damage() else { continue };
            // Sources of one log have the same damage.
            let name = format!("`{}`", source.name);
            match logs.iter_mut().find(|(known, _)| *known == damage) {
                Some((_, sources)) => sources.push(name),
                None => logs.push((damage, vec![name])),
            }
        }
        let advice = "copy or download the log again. If there is no better copy, the rows that could be read are used, and the lost ones \
                      are a gap";
        let found = logs.into_iter().map(|(damage, sources)| Finding {
            about: sources[0].trim_matches('`').to_owned(),
            evidence: format!("the log of {} is damaged: {damage}", sources.join(", ")),
            advice: advice.to_owned(),
            ..Finding::of("log-damaged")
        });
        found.collect()
    }

    /// Samples of the input that its declared range excludes.
    pub(super) fn beyond_range(&self) -> Option<Finding> {
        let process = self.process()?;
        let (beyond, rows) = (process.out_of_range, process.rows);
        (beyond > BLOWS && beyond as f64 > BEYOND * rows as f64).then(|| Finding {
            about: "process".to_owned(),
            evidence: format!(
                "{beyond} of {rows} samples of `{}` are outside the declared range and were not used",
                process.stream
            ),
            advice:
                "the vehicle moves more than `process.input.range` allows: widen it if the unit measures so much, else take a unit that \
                     does"
                    .to_owned(),
            ..Finding::of("input-range")
        })
    }

    /// Input samples that were treated as spikes.
    pub(super) fn spikes(&self) -> Option<Finding> {
        let stream = self.undisturbed_input()?;
        let process = self.run.consumers.iter().find(|c| c.name == "process" && c.spikes > 0)?;
        Some(Finding {
            about: "process".to_owned(),
            evidence: format!("{} samples of `{stream}` were taken for spikes and not used", process.spikes),
            advice: "if the unit has no such faults, the vehicle moves faster than `process.agility` says: raise its `acceleration` and \
                     `angular_rate`"
                .to_owned(),
            ..Finding::of("input-spikes")
        })
    }

    /// Gaps of the input that no fault explains.
    pub(super) fn coasted(&self) -> Option<Finding> {
        let (stream, coasted) = (self.undisturbed_input()?, self.run.coasted);
        (coasted > 0.0).then(|| Finding {
            about: "process".to_owned(),
            evidence: format!("`{stream}` had no usable sample for {coasted:.2} s, and the filter coasted"),
            advice: "look for rows of the unit that are missing or were not used; `process.agility` says what the vehicle may do meanwhile"
                .to_owned(),
            ..Finding::of("input-gap")
        })
    }

    /// Sources of sensors with long gaps that no fault, declared outage or declared restart explains.
    pub(super) fn gaps(&self) -> impl Iterator<Item = Finding> {
        let restart_after = self.restart_after;
        let separates = move |gap: f64| restart_after.is_some_and(|silence| gap > silence);
        let has_outages = self.run.score.is_some_and(|score| !score.drift.is_empty());
        let is_read = |name: &str| self.instruments.iter().any(|i| i.source == name);
        let sources = self.run.sources.iter();
        let sources = sources.filter(move |s| !has_outages && s.report.disturbed.is_empty() && is_read(&s.name));
        sources.filter_map(move |source| {
            let (at, gap) = source.report.longest_gap?;
            let rate = source.report.mean_rate()?;
            (gap > GAP.1 && gap * rate > GAP.0 && !separates(gap)).then(|| Finding {
                about: source.name.clone(),
                evidence: format!("`{}` has no row for {gap:.1} s at {:.1} s", source.name, at.seconds()),
                advice: "look at the drift there".to_owned(),
                ..Finding::of("row-gap")
            })
        })
    }
}

/// The advice if all sensors disagree.
fn wrong_input(evidence: String) -> Finding {
    Finding {
        about: "process".to_owned(),
        evidence,
        advice: format!(
            "they all are compared with what drives the process: look first at the axes, signs and units of its input ({CHECK} \
             compares it with the others), then at the start"
        ),
        ..Finding::of("wrong-input")
    }
}
