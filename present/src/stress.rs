//! A design under its catalogue of faults.

use crate::Shown;
use fusion_judge::stress::{CaseResult, CaseVerdict, Stress};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Page, Section, Table};

impl Shown<'_, Stress> {
    /// As it is shown: a row for each case.
    #[must_use]
    pub fn page(&self) -> Page {
        let failed = self.failures();
        let mut warnings = Vec::new();
        if failed > 0 {
            warnings.push(format!(
                "{failed} of {} cases failed: the filter was wrong, or gave no estimate, for longer than its recovery time \
                 while its health was good",
                self.rows.len()
            ));
        }
        if !self.is_free {
            warnings.push(
                "the faults meet a declared fault, or the end of the log before the filter has had its recovery time: what is silent \
                 already is not disturbed, and what ends too soon cannot fail; another moment is given by `at` under [stress]"
                    .to_owned(),
            );
        }
        for row in &self.rows {
            if let Some(why) = &row.outcome.stopped {
                warnings.push(format!("{} on {}: the run stopped: {why}", row.case.fault, row.case.on));
            }
        }
        let at = Cell::time(self.at).shown(&Unit::none());
        let (pairs, singles): (Vec<&CaseResult>, Vec<&CaseResult>) = self.rows.iter().partition(|r| r.case.sets.len() > 1);
        let alone = core::iter::once(&self.undisturbed).chain(singles.iter().copied());
        Page {
            provenance: self.provenance.clone(),
            title: format!("{}, under {} faults from {at} s on", self.description, self.rows.len()),
            warnings,
            sections: vec![
                self.explained(Section::new("One fault at a time", [outcomes(alone)])),
                Section::new("Two faults", [outcomes(pairs.iter().copied())]),
                Section::new("Sizes", [sizes(&singles)]),
            ],
        }
    }

    fn explained(&self, section: Section) -> Section {
        let reference = if self.has_reference {
            "the reference"
        } else {
            "the undisturbed run"
        };
        let section = section.note(format!(
            "worst: the largest error against {reference} that the undisturbed run does not have, in σ of the filter; \
             of \"none\" its own. position: the largest error. survived: within 3σ at the end of the watch, \
             however large it is. recovered: from the end of the fault until the error is within \
             3σ for good. health: the worst state, and when it was no longer good. FAILED: beyond 3σ, or no estimate, for \
             longer than the recovery time while the health was good; and how long in all."
        ));
        let is_known = self
            .rows
            .iter()
            .any(|r| matches!(r.verdict(), Some(CaseVerdict::Known | CaseVerdict::Passed)));
        let section = if is_known {
            section.note("known: it fails, as the design says. passes now: the design says that it fails.")
        } else {
            section
        };
        let section = if self.rows.iter().any(|r| r.verdict() == Some(CaseVerdict::NoClock)) {
            section.note(
                "no clock: no stream has a row any more, so the filter does not know that time goes on, and says nothing; whoever uses \
                 its estimate has to look at the age of it.",
            )
        } else {
            section
        };
        match self.unfit.as_slice() {
            [] => section,
            unfit => section.note(format!("On no stream of this design: {}.", unfit.join(", "))),
        }
    }
}

fn outcomes<'a>(rows: impl Iterator<Item = &'a CaseResult>) -> Table {
    let mut t = Table::new([
        Column::text("fault"),
        Column::text("on"),
        Column::text("survived"),
        Column::with_unit("worst", Unit::shown("σ")),
        Column::with_unit("position", Unit::of_si("m")),
        Column::with_unit("recovered", Unit::of_si("s")),
        Column::text("health"),
        Column::with_unit("after", Unit::of_si("s")),
        Column::text(""),
    ]);
    for row in rows {
        let (case, outcome) = (&row.case, &row.outcome);
        let said = outcome.health.as_ref();
        t.row([
            Cell::text(&case.fault),
            Cell::text(&case.on),
            match (case.sets.is_empty(), outcome.survived) {
                (true, _) => Cell::Empty,
                (_, true) => Cell::text("yes"),
                (_, false) => Cell::text("no"),
            },
            outcome.worst.as_ref().map_or(Cell::Empty, |(ratio, _)| decimal(*ratio)),
            outcome.metres.map_or(Cell::Empty, decimal),
            outcome
                .recovered
                .filter(|_| !case.sets.is_empty())
                .map_or(Cell::Empty, Cell::Seconds),
            Cell::text(said.map_or("good", |said| said.state.word())),
            said.map_or(Cell::Empty, |said| Cell::Seconds(said.after)),
            row.verdict().map_or(Cell::Empty, |verdict| judged(verdict, outcome.unsaid)),
        ]);
    }
    t
}

/// The verdict. For a failed filter it also has the time \[s\] for which the filter was wrong while its health was
/// good, independent of its later health and errors.
fn judged(verdict: CaseVerdict, unsaid: f64) -> Cell {
    let word = verdict.word();
    if verdict == CaseVerdict::Failed && unsaid > 0.0 {
        Cell::text(format!("{word} {unsaid:.1} s"))
    } else {
        Cell::text(word)
    }
}

/// To a tenth; large ones with four digits.
fn decimal(value: f64) -> Cell {
    if value < 1e5 { Cell::Fixed(value, 1) } else { Cell::Real(value) }
}

/// How large the faults are that have a size.
fn sizes(rows: &[&CaseResult]) -> Table {
    let mut t = Table::new(["fault", "on", "size"].map(Column::text));
    for CaseResult { case, .. } in rows.iter().filter(|r| !r.case.size.is_empty()) {
        t.row([&case.fault, &case.on, &case.size].map(Cell::text));
    }
    t
}
