//! The error budget of a design.

use crate::Shown;
use fusion_core::math;
use fusion_judge::budget::{Budget, Split, StateBudget};
use fusion_tables::{Cell, Column, Page, Section, Table, Unit};

/// Shares below this are not listed; the picture and the file have them.
const LISTED: f64 = 0.01;

impl Shown<'_, Budget> {
    /// The tables: errors, the source that helps most, shares, and the limits of the budget.
    #[must_use]
    pub fn page(&self) -> Page {
        let mut sections = vec![self.errors(), self.spend()];
        sections.extend(self.at());
        sections.extend([self.shares(), self.limits()]);
        Page {
            title: self.0.description.clone(),
            provenance: self.0.provenance.clone(),
            warnings: Vec::new(),
            sections,
        }
    }

    fn errors(&self) -> Section {
        let mut t = Table::new([
            Column::text("error"),
            Column::number("σ at the end"),
            Column::number("by the filter"),
            Column::number("σ over the run"),
            Column::number("by the filter"),
        ]);
        for state in &self.0.states {
            let of = |split: &Split| [Cell::Real(split.sigma()), Cell::Real(math::sqrt(split.filter))];
            let cells = of(&state.end).into_iter().chain(of(&state.rms));
            t.row_in(Unit::of_si(state.unit), [Cell::text(state.name())].into_iter().chain(cells));
        }
        Section::new("Errors, 1σ", [t]).note(
            "Errors of the simulated world through the gains of one run; `by the filter` is what the filter reports of itself. σ over the \
             run is the root of the mean variance.",
        )
    }

    fn spend(&self) -> Section {
        let mut t = Table::new([
            Column::text("error"),
            Column::text("half as large"),
            Column::number("σ at the end"),
            Column::number("then"),
            Column::number("σ over the run"),
            Column::number("then"),
        ]);
        for state in &self.0.states {
            let Some(source) = state.rms.largest() else { continue };
            let of = |split: &Split| [Cell::Real(split.sigma()), Cell::Real(split.halved(source))];
            self.row(&mut t, (state, source), of(&state.end).into_iter().chain(of(&state.rms)));
        }
        Section::new("Best improvement", [t])
            .note("One source half as large, all others and all gains as they are. A filter whose noise is then declared anew gains more.")
    }

    /// The shares at the times that were asked for.
    fn at(&self) -> Option<Section> {
        let mut t = Table::new([
            Column::text("error"),
            Column::text("source"),
            Column::with_unit("at", Unit::of_si("s")),
            Column::number("σ"),
            Column::number("share"),
        ]);
        for state in &self.0.states {
            for (source, split) in by_share(state, &self.0.sources)
                .into_iter()
                .flat_map(|source| state.at.iter().map(move |split| (source, split)))
            {
                let cells = [
                    Cell::Seconds(split.time),
                    Cell::Real(split.sigma_of(source)),
                    Cell::Share(split.share(source)),
                ];
                self.row(&mut t, (state, source), cells.into_iter());
            }
        }
        (!t.is_empty()).then(|| Section::new("Shares at the declared times", [t]))
    }

    fn shares(&self) -> Section {
        let mut t = Table::new([
            Column::text("error"),
            Column::text("source"),
            Column::number("σ at the end"),
            Column::number("share"),
            Column::number("σ over the run"),
            Column::number("share"),
        ]);
        for state in &self.0.states {
            for source in by_share(state, &self.0.sources) {
                let of = |split: &Split| [Cell::Real(split.sigma_of(source)), Cell::Share(split.share(source))];
                self.row(&mut t, (state, source), of(&state.end).into_iter().chain(of(&state.rms)));
            }
        }
        Section::new("Shares of the variance", [t]).note("Shares below 1 % are not listed.")
    }

    /// Adds a row on an error and one of its sources.
    fn row(&self, table: &mut Table, (state, source): (&StateBudget, usize), cells: impl Iterator<Item = Cell>) {
        let words = [Cell::text(state.name()), Cell::text(&self.0.sources[source])];
        table.row_in(Unit::of_si(state.unit), words.into_iter().chain(cells));
    }

    fn limits(&self) -> Section {
        let mut t = Table::new([Column::text("sensor"), Column::number("used"), Column::number("rejected")]);
        for rows in &self.0.rows {
            t.row([Cell::text(&rows.name), Cell::Count(rows.used), Cell::Count(rows.rejected)]);
        }
        let rejected: u64 = self.0.rows.iter().map(|rows| rows.rejected).sum();
        let gates = format!(
            "Gates are outside of the budget: {rejected} measurements of this run were rejected, and their gain is 0. In another run the gates \
             may reject others."
        );
        let section = Section::new("Limits", [t]).note(gates);
        self.0
            .outside
            .iter()
            .fold(section, |section, what| section.note(format!("Outside of the budget: {what}.")))
    }
}

/// The sources with a share worth a line, the largest first.
fn by_share(state: &StateBudget, sources: &[String]) -> Vec<usize> {
    let share = |source: usize| f64::max(state.end.share(source), state.rms.share(source));
    let mut all: Vec<usize> = (0..sources.len()).filter(|source| share(*source) >= LISTED).collect();
    all.sort_by(|a, b| state.rms.share(*b).total_cmp(&state.rms.share(*a)));
    all
}
