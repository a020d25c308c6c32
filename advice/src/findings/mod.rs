//! Advice on the next step, which follows from the statistics of a run.
//!
//! ```text
//! design ──▶ what each sensor is (instrument or constraint, what it measures, whether its bias can be a state)
//!                                                          │
//! summary ─▶ faults, gates, NIS, NEES, gaps ───────────────┴──▶ findings, the first to look at first
//! ```
//!
//! Each finding names its evidence in figures and the setting to change. Causes come before effects: a sensor that
//! disagrees is reported before the errors against the reference, which follow from it. If several causes are possible,
//! a recorded log is first compared with itself (`fusion check --data`). Errors against the reference outrank
//! innovations: innovations are small, too, if the estimate follows a slow error of a sensor. A constraint has no
//! instrument: its bias is not reported, and neither is a constraint that holds better than declared.
//!
//! Advice names only settings that the block has. If the wrong sensor is not clear, the advice is a run that decides
//! it: a run without the first sensor that disagreed, or without the sensor that has no gate.
//!
//! Source   Bar-Shalom, Li, Kirubarajan 2001, §5.4: the meaning of a mean NEES or NIS outside its band
//! Not here proof of correctness: a run without findings proves nothing if its data do not excite the vehicle enough

mod errors;
mod instrument;
mod moved;
mod sensors;
mod stamps;
#[cfg(test)]
mod tests;

use self::instrument::{Instrument, Measures};
use self::sensors::{disagrees_from, rejected_share};
use self::stamps::Stamps;
use fusion::config::Edit;
use fusion::design::Design;
use fusion::observe::SensorStatistics;
use fusion::run::{FinalState, Finding, Ignored, Summary};
use fusion::score::{Consistency, Score, Verdict};
use fusion_core::filter::ChartKind;
use fusion_tables::{Unit, short};

fusion::inventory::submit! {
    fusion::run::Advisor {
        name: "fusion",
        rules: crate::rules::ALL,
        advise: findings,
    }
}

/// The command that compares a log with itself.
const CHECK: &str = "`fusion check DESIGN --data DIR`";
/// A mean statistic over its degrees of freedom above this is worth a change: errors are then √1.5 = 1.22 times their
/// 1σ.
const LARGE: f64 = 1.5;
/// No noise explains a larger mean: all innovations are √50 = 7 times their 1σ.
const FAR: f64 = 50.0;
/// A parameter is not identifiable if its final 1σ is more than this share of its initial 1σ.
const LEARNT: f64 = 0.9;
/// Above this 1σ of an angle, its sine and cosine are not linear within the 1σ \[rad\].
const POOR: f64 = 1.0;
/// Above this initial 1σ of an angle, the error of one linearisation is worth a look: at 3σ its cosine is wrong by a
/// tenth \[rad\].
const UNCERTAIN: f64 = 8.0 * core::f64::consts::PI / 180.0;
/// A start after this share of the log is reported: no alignment needs so long, and the log before it is unused.
const LATE: f64 = 0.25;
/// Two headings that differ by more are different headings, not a better estimate of one heading. Health uses the same
/// limit \[rad\].
const ANOTHER: f64 = 15.0 * core::f64::consts::PI / 180.0;
/// More input samples out of range are more than a blow or two.
const BLOWS: u64 = 4;
/// A larger share of input samples outside the declared range is more than a blow or two.
const BEYOND: f64 = 1e-3;
/// A stretch without rows is reported if it is longer than this number of intervals of its source and of seconds.
const GAP: (f64, f64) = (10.0, 3.0);

/// The findings of a run of `design` by all rules but the `ignored` ones; empty if the run is consistent.
#[must_use]
pub fn findings(design: &Design, summary: &Summary, ignored: &Ignored) -> Vec<Finding> {
    if summary.start().started.is_none() {
        let finding = never_started(design, summary).filter(|f| !ignored.has(&f.rule));
        return finding.into_iter().collect();
    }
    let instruments = Instrument::of_design(design, summary.parameters());
    let constant_biases = instrument::constant_biases(&design.process.node);
    let growth = instrument::growth(&design.process.node);
    let reference = design.reference.as_ref().map(|r| &r.block);
    let has_sigma = |k: usize| reference.is_some_and(|r| r.sources().iter().any(|(_, part)| part.sigma.each()[k].is_some()));
    let stamps = Stamps::of_design(design, summary.parameters());
    let judged = Judged {
        instruments: &instruments,
        summary,
        is_recorded: design.simulation.is_none(),
        point: reference.map_or([0.0; 3], |r| r.point()),
        is_exact: [0, 1, 2].map(|k| !has_sigma(k)),
        linearises_once: design.filter.linearises_once(),
        is_invariant: matches!(design.filter.backend().chart, ChartKind::Invariant(..)),
        stamps: &stamps,
        constant_biases: &constant_biases,
        restart_after: design.run.restart_after.map(|silence| silence.si()),
        growth: &growth,
        ignored,
    };
    judged.findings()
}

/// A log with rows in all of its sources, in which no filter was started.
fn never_started(design: &Design, summary: &Summary) -> Option<Finding> {
    let is_simulated = design.simulation.is_some();
    let has_rows = is_simulated || summary.sources().iter().all(|s| s.rows > 0) && !summary.sources().is_empty();
    let waits = summary
        .start()
        .waiting
        .iter()
        .map(|(name, what)| format!("`{name}` waits for {what}"));
    let waits: Vec<String> = waits.collect();
    let waits = if waits.is_empty() {
        String::new()
    } else {
        format!(": {}", waits.join("; "))
    };
    let advice = if is_simulated {
        "look at the limits of its `[initial]` blocks: what they wait for never comes in this mission, or not for so long".to_owned()
    } else {
        format!(
            "look at the axes, signs and units of what it waits for ({CHECK} compares them), then at the limits of its `[initial]` blocks"
        )
    };
    has_rows.then(|| Finding {
        about: "start".to_owned(),
        evidence: format!("the filter never started, though all sources have rows{waits}"),
        advice,
        ..Finding::of("never-started")
    })
}

/// A run and the properties of its sensors.
#[derive(Clone, Copy)]
struct Judged<'a> {
    instruments: &'a [Instrument],
    summary: &'a Summary,
    /// Whether the rows are recorded, not simulated.
    is_recorded: bool,
    /// The declared point of the reference \[m\].
    point: [f64; 3],
    /// Whether position, velocity, attitude of the reference are declared as exact.
    is_exact: [bool; 3],
    /// Whether the filter has one estimate and linearises each measurement only there.
    linearises_once: bool,
    /// Whether it uses an invariant chart.
    is_invariant: bool,
    /// The channels that the reference shares with sensors, and the clock of the input.
    stamps: &'a Stamps,
    /// The input biases that are constant states.
    constant_biases: &'a [String],
    /// The silence that separates one recording from the next \[s\].
    restart_after: Option<f64>,
    /// The settings of the process that define how fast its errors grow.
    growth: &'a [String],
    /// The rules that are not applied: their findings are not causes of others either.
    ignored: &'a Ignored,
}

impl Judged<'_> {
    fn applies(&self, rule: &str) -> bool {
        !self.ignored.has(rule)
    }

    /// The finding, unless its rule is ignored.
    fn kept(&self, finding: Option<Finding>) -> Option<Finding> {
        finding.filter(|f| self.applies(&f.rule))
    }

    fn findings(&self) -> Vec<Finding> {
        let late = self.late_start();
        let (ill, refused_in_a_row) = self.lost().filter(|(f, _)| self.applies(&f.rule)).unzip();
        let refused_in_a_row = refused_in_a_row.flatten();
        let beyond = self.kept(self.beyond_range());
        let disturbed = self.kept(self.disturbed());
        let input = self.kept(self.all_disagree().or_else(|| self.all_refused()));
        let start = self.kept(self.poor_start());
        let (spikes, few_spikes) = match self.spikes().filter(|(_, f)| self.applies(&f.rule)) {
            Some((true, spikes)) => (Some(spikes), None),
            Some((false, spikes)) => (None, Some(spikes)),
            None => (None, None),
        };
        let far = self.far_parameter().filter(|(_, f)| input.is_none() && self.applies(&f.rule));
        let (input_far, far) = match far {
            Some((true, far)) => (Some(far), None),
            Some((false, far)) => (None, Some(far)),
            None => (None, None),
        };
        let refused = if input.is_some() { Vec::new() } else { self.refused() };
        let first = self.kept(self.first_to_disagree(&refused));
        let never_held = self.kept(self.never_held());
        let counted = self.counted();
        let large: Vec<Finding> = self.sensors().filter_map(|(i, s)| self.kept(self.large(i, s))).collect();
        let is_told = |name: &str| [&large, &refused].into_iter().flatten().chain(&first).any(|f| f.about == name);
        let moved = if input.is_some() { Vec::new() } else { self.moved(is_told) };
        // The causes of errors, in the words that refer to them.
        let mut causes: Vec<String> = Vec::new();
        causes.extend(beyond.iter().map(|_| "the range of the input".to_owned()));
        causes.extend(disturbed.iter().map(|_| "the faults".to_owned()));
        causes.extend(input.iter().map(|_| "the input".to_owned()));
        causes.extend(start.iter().map(|_| "the start".to_owned()));
        causes.extend(spikes.iter().map(|_| "the spikes".to_owned()));
        let told = input_far
            .iter()
            .chain(&first)
            .chain(&refused)
            .chain(&far)
            .chain(&never_held)
            .chain(&large)
            .chain(&moved)
            .chain(&counted);
        for about in told.map(|f| format!("`{}`", f.about)) {
            if !causes.contains(&about) {
                causes.push(about);
            }
        }
        let errors = self.all_errors(&causes);
        // A small NIS means nothing for a sensor whose gate rejected good measurements: only those that agree were
        // counted.
        let is_told = |name: &str| counted.iter().any(|f| f.about == name) || refused_in_a_row.as_deref() == Some(name);
        let rest = || self.sensors().filter(|(i, _)| !is_told(&i.name));
        ill.into_iter()
            .chain(late)
            .chain(beyond)
            .chain(disturbed)
            .chain(input)
            .chain(start)
            .chain(spikes)
            .chain(input_far)
            .chain(first)
            .chain(refused)
            .chain(far)
            .chain(never_held)
            .chain(large)
            .chain(moved)
            .chain(counted.iter().cloned())
            .chain(self.undecided())
            .chain(self.changed())
            .chain(errors)
            .chain(self.uncertain_start())
            .chain(rest().filter_map(|(i, s)| self.small(i, s)))
            .chain(rest().filter_map(|(i, s)| self.lasting(i, s)))
            .chain(self.beyond_chance())
            .chain(self.unlearnt())
            .chain(few_spikes)
            .chain(self.coasted())
            .chain(self.gaps())
            .filter(|finding| self.applies(&finding.rule))
            .collect()
    }

    /// The sensors with their statistics.
    fn sensors(&self) -> impl Iterator<Item = (&Instrument, &SensorStatistics)> {
        let of = |i: &Instrument| self.summary.sensors().iter().find(|s| s.name == i.name);
        self.instruments.iter().filter_map(move |i| Some((i, of(i)?)))
    }

    /// The instruments that measure a part of the solution, with their NIS.
    fn measuring(&self, what: Measures) -> impl Iterator<Item = (&Instrument, &Consistency)> {
        let of = move |i: &Instrument| i.measures == Some(what) && !i.is_constraint;
        self.sensors()
            .filter(move |(i, _)| of(i))
            .filter_map(|(i, s)| Some((i, s.nis.as_ref()?)))
    }

    /// The NEES of the part that a sensor measures.
    fn nees(&self, what: Measures) -> Option<&Consistency> {
        nees_of(self.summary.score()?, what)
    }

    /// If all sensors disagree by far, the fault is in the process input: all are compared with it.
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
        Some(wrong_input(format!(
            "no sensor agrees with the estimate: NIS of {}",
            each.join(", ")
        )))
    }

    /// The same if every gate rejects often, for at least three sensors that do not share one source.
    fn all_refused(&self) -> Option<Finding> {
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

    /// Samples of the input that its declared range excludes.
    fn beyond_range(&self) -> Option<Finding> {
        let process = self.summary.consumers().iter().find(|c| c.name == "process")?;
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

    /// A parameter that moved further from its initial value than its initial 1σ allows, and is still there at the end.
    /// The flag says whether it belongs to the input.
    fn far_parameter(&self) -> Option<(bool, Finding)> {
        let own = self.summary.health().iter().find(|h| h.filter.is_empty())?;
        let mut reasons = own.transitions.last().filter(|_| own.further_transitions == 0)?.reasons.iter();
        let name = &reasons.find(|r| r.reason == "calibration")?.of;
        let sensor = self
            .instruments
            .iter()
            .find(|i| name.strip_prefix(i.name.as_str()).is_some_and(|rest| rest.starts_with('.')));
        let parts = match sensor {
            Some(sensor) => {
                let key = name.rsplit('.').next().unwrap_or_default();
                format!("the {} of `{}`", sensor.parts_but(key), sensor.name)
            }
            None => "the axes, signs and units of the input of the process".to_owned(),
        };
        let finding = Finding {
            about: name.clone(),
            evidence: format!("`{name}` has gone far from its initial value, for the `sigma` that it began with"),
            advice: format!("look at {parts}; if they are right, `{name}` is worse known than declared: widen its `sigma`"),
            ..Finding::of("parameter-far")
        };
        Some((sensor.is_none(), finding))
    }

    /// Several headings that are still possible at the end.
    fn undecided(&self) -> Option<Finding> {
        let own = self.summary.health().iter().find(|h| h.filter.is_empty())?;
        let last = own.transitions.last().filter(|_| own.further_transitions == 0)?;
        let start = self.summary.start().start_angle.as_ref();
        last.reasons.iter().any(|r| r.reason == "undecided").then(|| Finding {
            about: start.map_or_else(|| "filter.bank".to_owned(), |(name, _)| name.clone()),
            evidence: "several headings are still possible at the end".to_owned(),
            advice:
                "the data do not decide between them; what is shown is one, and its 1σ knows nothing of the others: give a better start (a \
                     smaller `sigma`) or a sensor that differs between them, as a compass or a velocity ahead does"
                    .to_owned(),
            ..Finding::of("heading-undecided")
        })
    }

    /// A heading that the bank showed for a large part of the run and then replaced by another one.
    fn changed(&self) -> Option<Finding> {
        let own = self.summary.health().iter().find(|h| h.filter.is_empty())?;
        let from = self.summary.start().started?;
        let mut changes = self.summary.hypotheses()?.changes.iter().rev();
        let (change, angle) = changes.find_map(|c| Some((c, c.angle.filter(|angle| *angle > ANOTHER)?)))?;
        let (time, angle) = (change.time, angle.to_degrees());
        (time - from > LATE * (own.until - from)).then(|| Finding {
            about: "filter.bank".to_owned(),
            evidence: format!("at {time:.1} s another heading is shown than until then, {angle:.0}° away"),
            advice: "it fits the measurements much better by then, and either what was shown before is wrong or what is shown since: data that \
                     hardly tell the headings apart decide by small errors of the model; compare both with what is known of the log, and give \
                     a better start or a sensor that differs between them, as a compass or a velocity ahead does"
                .to_owned(),
            ..Finding::of("heading-changed")
        })
    }

    /// A start so late that most figures do not describe the log.
    fn late_start(&self) -> Option<Finding> {
        let (at, wait) = (self.summary.start().started?, self.summary.late_start()?);
        let other = if self.is_recorded {
            format!("look at the axes, signs and units of what it waited for ({CHECK} compares them), then ")
        } else {
            String::new()
        };
        (wait.share() > LATE).then(|| Finding {
            about: "start".to_owned(),
            evidence: format!("the filter started at {at:.1} s; {}", wait),
            advice: format!(
                "the figures are of the rest alone: {other}at the limits of its `[initial]` blocks, or take one that needs less"
            ),
            ..Finding::of("late-start")
        })
    }

    /// An initial σ so large that one linearisation does not reach the truth, if no statistic shows that it did.
    fn poor_start(&self) -> Option<Finding> {
        let (name, sigma) = self.summary.start().start_angle.as_ref().filter(|(_, sigma)| *sigma > POOR)?;
        let is_found = self.nees(Measures::Attitude).is_some_and(|c| !is_large(c));
        // An invariant chart covers only the attitude or heading that the process moves.
        let is_moved = self.summary.parameters().iter().all(|p| p.name != *name);
        let chart = if is_moved {
            ", with `filter.chart = \"right_invariant\"`"
        } else {
            ""
        };
        // If only the process has the angle, no sensor is linearised in it.
        let again = if is_moved || name.contains('.') {
            format!(", or linearise again (`filter.update = \"iterated\"`{chart})")
        } else {
            String::new()
        };
        // An inertial unit measures the direction of its acceleration. In dead reckoning with an unknown speed, astern
        // fits as well as ahead.
        let astern = if self.growth.is_empty() {
            "; where nothing tells the sign of the speed ahead, neither the one estimate nor several decide between a heading and its \
             opposite: compare the course with the way the nose points, or give a sensor of the speed ahead"
        } else {
            ""
        };
        (self.linearises_once && !is_found).then(|| Finding {
            about: name.clone(),
            evidence: format!("the filter starts with a 1σ of {:.0}° of `{name}`", sigma.to_degrees()),
            advice: format!(
                "linearised once, there, it may settle at a wrong angle with a small 1σ: give a better start (`[initial]`), or try several \
                 (`filter.bank.headings = 8`){again}{astern}"
            ),
            edits: vec![Edit::set("filter.bank.headings", "8")],
            ..Finding::of("poor-start")
        })
    }

    /// A heading with a large initial σ, if the attitude is much worse than the filter says. Also an unobserved heading
    /// that these coordinates make seem observed.
    fn uncertain_start(&self) -> Option<Finding> {
        let known = self.summary.start().start_angle.as_ref();
        let (name, sigma) = known.filter(|(_, sigma)| (UNCERTAIN..=POOR).contains(sigma))?;
        let is_moved = self.summary.parameters().iter().all(|p| p.name != *name);
        let is_inertial = !self.growth.is_empty();
        // Course and position also make the heading observable; a height does not.
        let is_level = |i: &&Instrument| !i.is_constraint && i.measures.is_some() && (i.axes[0] || i.axes[1]);
        let is_told = self.instruments.iter().any(|i| is_level(&i));
        let why = match self.nees(Measures::Attitude).filter(|c| is_large(c)) {
            Some(nees) => format!("NEES attitude is {} of {}", short(nees.mean), nees.dof),
            None if is_inertial && !is_told => "no sensor gives a heading".to_owned(),
            None => return None,
        };
        // A measurement of the heading is nonlinear in it: linearise it again. Without one, the other measurements must
        // not make the heading seem observed.
        let is_measured = |i: &Instrument| i.measures == Some(Measures::Attitude) && !i.is_constraint;
        let other = if self.instruments.iter().any(is_measured) {
            "`filter.backend = \"iekf\"`, which linearises again"
        } else if is_inertial {
            "`filter.backend = \"invariant\"` with `process.discretisation = \"exact\"`"
        } else {
            "`filter.backend = \"invariant\"`"
        };
        (self.linearises_once && !self.is_invariant && is_moved).then(|| Finding {
            about: name.clone(),
            evidence: format!("the filter starts with a 1σ of {:.0}° of `{name}`, and {why}", sigma.to_degrees()),
            advice: format!(
                "linearised once, in these coordinates, such a heading may be taken for better known than it is: if nothing else is \
                 found wrong, try {other}"
            ),
            ..Finding::of("uncertain-start")
        })
    }

    /// The stream of the process input, if no fault disturbs it.
    fn undisturbed_input(&self) -> Option<&str> {
        let process = self.summary.consumers().iter().find(|c| c.name == "process")?;
        let has_faults = |s: &fusion::run::SourceStatistics| s.name == process.stream && !s.report.disturbed.is_empty();
        let is_declared = self.summary.faults().iter().any(|fault| fault.stream == process.stream);
        (!is_declared && !self.summary.sources().iter().any(has_faults)).then_some(&process.stream)
    }

    /// Input samples that were treated as spikes. The flag says whether the estimate is worse than its covariance.
    fn spikes(&self) -> Option<(bool, Finding)> {
        let stream = self.undisturbed_input()?;
        let process = self.summary.consumers().iter().find(|c| c.name == "process" && c.spikes > 0)?;
        let is_harmful = Measures::ALL.into_iter().filter_map(|what| self.nees(what)).any(is_large);
        let finding = Finding {
            about: "process".to_owned(),
            evidence: format!("{} samples of `{stream}` were taken for spikes and not used", process.spikes),
            advice: "if the unit has no such faults, the vehicle moves faster than `process.agility` says: raise its `acceleration` and \
                     `angular_rate`"
                .to_owned(),
            ..Finding::of("input-spikes")
        };
        Some((is_harmful, finding))
    }

    /// Gaps of the input that no fault explains.
    fn coasted(&self) -> Option<Finding> {
        let (stream, coasted) = (self.undisturbed_input()?, self.summary.counts().coasted);
        (coasted > 0.0).then(|| Finding {
            about: "process".to_owned(),
            evidence: format!("`{stream}` had no usable sample for {coasted:.2} s, and the filter coasted"),
            advice: "look for rows of the unit that are missing or were not used; `process.agility` says what the vehicle may do meanwhile"
                .to_owned(),
            ..Finding::of("input-gap")
        })
    }

    /// Parameters that are not identifiable: none of their 1σ decreased.
    fn unlearnt(&self) -> Option<Finding> {
        let unlearnt = || self.summary.parameters().iter().filter(|p| is_unlearnt(p));
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
            ..Finding::of("parameter-unlearnt")
        })
    }

    /// Sources of sensors with long gaps that no fault, declared outage or declared restart explains.
    fn gaps(&self) -> impl Iterator<Item = Finding> {
        let restart_after = self.restart_after;
        let separates = move |gap: f64| restart_after.is_some_and(|silence| gap > silence);
        let has_outages = self.summary.score().is_some_and(|score| !score.drift.is_empty());
        let is_read = |name: &str| self.instruments.iter().any(|i| i.source == name);
        let sources = self.summary.sources().iter();
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

fn nees_of(score: &Score, what: Measures) -> Option<&Consistency> {
    match what {
        Measures::Position => score.nees_position.as_ref(),
        Measures::Velocity => score.nees_velocity.as_ref(),
        Measures::Attitude => score.nees_attitude.as_ref(),
    }
}

/// Returns true if the 1σ of a parameter decreased on no axis.
fn is_unlearnt(p: &FinalState) -> bool {
    let mut axes = p.start_sigma.iter().zip(&p.sigma).filter(|(start, _)| **start > 0.0).peekable();
    axes.peek().is_some() && axes.all(|(start, end)| *end >= LEARNT * start)
}

/// Returns true if errors are larger than expected by enough to need a change.
fn is_large(c: &Consistency) -> bool {
    c.verdict() == Some(Verdict::Overconfident) && ratio(c) > LARGE
}

/// The mean over its expected value.
fn ratio(c: &Consistency) -> f64 {
    c.mean / c.dof as f64
}
