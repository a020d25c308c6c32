//! Findings about the start, and about the headings that are possible.

use super::facts::Facts;
use super::instrument::{Instrument, Measures};
use super::{CHECK, Finding, is_large};
use fusion::config::Edit;
use fusion_tables::short;

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

impl Facts<'_> {
    /// A log with rows in all of its sources, in which no filter was started.
    pub(super) fn never_started(&self) -> Option<Finding> {
        let is_simulated = !self.is_recorded;
        let has_rows = is_simulated || self.run.sources.iter().all(|s| s.rows > 0) && !self.run.sources.is_empty();
        let waits = self.run.waiting.iter().map(|(name, what)| format!("`{name}` waits for {what}"));
        let waits: Vec<String> = waits.collect();
        let waits = if waits.is_empty() {
            String::new()
        } else {
            format!(": {}", waits.join("; "))
        };
        let advice = if is_simulated {
            "look at the limits of its `[initial]` blocks: this mission never meets their conditions, or not for long enough".to_owned()
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

    /// A start so late that most figures do not describe the log.
    pub(super) fn late_start(&self) -> Option<Finding> {
        let (at, wait) = (self.run.started?, self.run.late_start?);
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
    pub(super) fn poor_start(&self) -> Option<Finding> {
        let (name, sigma) = self.run.start_angle.filter(|(_, sigma)| *sigma > POOR)?;
        let is_found = self.nees(Measures::Attitude).is_some_and(|c| !is_large(c));
        // An invariant chart covers only the attitude or heading that the process moves.
        let is_moved = self.run.parameters.iter().all(|p| p.name != *name);
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
    pub(super) fn uncertain_start(&self) -> Option<Finding> {
        let known = self.run.start_angle;
        let (name, sigma) = known.filter(|(_, sigma)| (UNCERTAIN..=POOR).contains(sigma))?;
        let is_moved = self.run.parameters.iter().all(|p| p.name != *name);
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

    /// Several headings that are still possible at the end.
    pub(super) fn undecided(&self) -> Option<Finding> {
        let own = self.run.health?;
        let last = own.transitions.last().filter(|_| own.further_transitions == 0)?;
        let start = self.run.start_angle;
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
    pub(super) fn changed(&self) -> Option<Finding> {
        let own = self.run.health?;
        let from = self.run.started?;
        let mut changes = self.run.hypotheses?.changes.iter().rev();
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
}
