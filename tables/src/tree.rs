//! The tree: a page of sections, a section of tables, a table of typed cells.

use super::number::{NONE, fixed, significant};
use super::unit::Unit;
use fusion::provenance::Provenance;
use fusion::score::{Consistency, ConsistencyVerdict};
use fusion_core::time::Time;

/// A displayed result.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// The subject, in a line; may be empty.
    pub title: String,
    /// The input of the result; for several runs, the common input.
    pub provenance: Provenance,
    /// Warnings for the reader, one sentence each. A command prints these on stderr.
    pub warnings: Vec<String>,
    /// The content, in reading order.
    pub sections: Vec<Section>,
}

/// Tables on one subject.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The subject; may be empty.
    pub title: String,
    /// The tables; those without rows are not shown.
    pub tables: Vec<Table>,
    /// Sentences below the tables.
    pub notes: Vec<String>,
}

impl Section {
    /// A section with these tables.
    #[must_use]
    pub fn new(title: impl Into<String>, tables: impl IntoIterator<Item = Table>) -> Self {
        Self {
            title: title.into(),
            tables: tables.into_iter().filter(|t| !t.rows.is_empty()).collect(),
            notes: Vec::new(),
        }
    }

    /// Adds a sentence below the tables.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// Returns true if there is nothing to show.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tables.is_empty() && self.notes.is_empty()
    }
}

/// Rows of cells below named columns.
///
/// A unit is written once: next to the name of the column or, if the rows differ, next to the name of the row.
#[derive(Clone, Debug)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<TableRow>,
}

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The heading. A table without headings is a list of names and values.
    pub name: String,
    /// The unit of its real numbers; `None` if the row gives the unit.
    pub unit: Option<Unit>,
    /// True if it holds words, which are left-aligned and may be wrapped.
    pub is_text: bool,
}

impl Column {
    /// A column of words.
    #[must_use]
    pub fn text(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: None,
            is_text: true,
        }
    }

    /// A column of numbers in the unit of their row, or of counts, shares and bands, which have no unit.
    #[must_use]
    pub fn number(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: None,
            is_text: false,
        }
    }

    /// A column of numbers in one unit.
    #[must_use]
    pub fn with_unit(name: impl Into<String>, unit: Unit) -> Self {
        Self {
            unit: Some(unit),
            ..Self::number(name)
        }
    }

    /// Its name with its unit.
    #[must_use]
    pub fn heading(&self) -> String {
        self.unit.as_ref().map_or_else(|| self.name.clone(), |u| u.beside(&self.name))
    }
}

/// A row.
#[derive(Clone, Debug)]
pub struct TableRow {
    /// The unit of its real numbers, if its columns have no unit.
    pub unit: Unit,
    /// A cell per column.
    pub cells: Vec<Cell>,
}

/// A value, with the rule for its digits.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// No content.
    Empty,
    /// Words.
    Text(String),
    /// A count.
    Count(u64),
    /// A real number in the unit that [`Unit::of`] expects: four significant digits.
    Real(f64),
    /// A real number with this number of decimals.
    Fixed(f64, usize),
    /// A time of the run, or a duration \[s\]: to the tenth of a second.
    Seconds(f64),
    /// A pure number, for any unit of its row: with two decimals.
    Ratio(f64),
    /// A share, where 1 is the whole: in percent.
    Share(f64),
    /// The two limits of a band.
    Band(f64, f64),
    /// The comparison of errors with their covariance.
    Verdict(ConsistencyVerdict),
    /// A mean NEES or NIS over its degrees of freedom, with its verdict.
    Judged(Consistency),
}

impl Cell {
    /// Words.
    #[must_use]
    pub fn text(words: impl Into<String>) -> Self {
        Self::Text(words.into())
    }

    /// A real number, or an empty cell.
    #[must_use]
    pub fn real(value: Option<f64>) -> Self {
        value.map_or(Self::Empty, Self::Real)
    }

    /// A count, or an empty cell.
    #[must_use]
    pub fn count(count: Option<u64>) -> Self {
        count.map_or(Self::Empty, Self::Count)
    }

    /// A verdict, or an empty cell.
    #[must_use]
    pub fn verdict(verdict: Option<ConsistencyVerdict>) -> Self {
        verdict.map_or(Self::Empty, Self::Verdict)
    }

    /// A time of the run.
    #[must_use]
    pub fn time(time: Time) -> Self {
        Self::Seconds(time.seconds())
    }

    /// The verdict in it, if there is one.
    #[must_use]
    pub fn judgement(&self) -> Option<ConsistencyVerdict> {
        match self {
            Self::Verdict(v) => Some(*v),
            Self::Judged(c) => c.verdict(),
            _ => None,
        }
    }

    /// The text of the cell in `unit`.
    #[must_use]
    pub fn shown(&self, unit: &Unit) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Text(text) => text.clone(),
            Self::Count(n) => n.to_string(),
            Self::Real(v) => significant(unit.of(*v)),
            Self::Fixed(v, decimals) => fixed(unit.of(*v), *decimals),
            Self::Seconds(t) => fixed(*t, 1),
            Self::Ratio(v) => fixed(*v, 2),
            Self::Share(s) if s.is_finite() => format!("{} %", fixed(100.0 * s, 1)),
            Self::Share(_) => NONE.to_owned(),
            Self::Band(low, high) => format!("{} … {}", significant(unit.of(*low)), significant(unit.of(*high))),
            Self::Verdict(v) => v.word().to_owned(),
            Self::Judged(c) => match c.verdict() {
                Some(v) => format!("{} {}", significant(c.over_expected()), v.word()),
                None => significant(c.over_expected()),
            },
        }
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Self {
        Self::text(words)
    }
}

impl From<String> for Cell {
    fn from(words: String) -> Self {
        Self::Text(words)
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

impl Table {
    /// A table with these columns.
    #[must_use]
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self {
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
        }
    }

    /// Names and values, without a heading.
    #[must_use]
    pub fn list() -> Self {
        Self::new([Column::text(""), Column::text("")])
    }

    /// Adds a row; cells that are missing are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<Cell>>) {
        self.row_in(Unit::none(), cells);
    }

    /// Adds a row with its unit.
    pub fn row_in(&mut self, unit: Unit, cells: impl IntoIterator<Item = impl Into<Cell>>) {
        let mut cells: Vec<Cell> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.columns.len(), Cell::Empty);
        self.rows.push(TableRow { unit, cells });
    }

    /// The columns that are not empty, with their indices.
    pub fn columns(&self) -> impl Iterator<Item = (usize, &Column)> {
        let holds = |k: usize| self.rows.iter().any(|r| r.cells[k] != Cell::Empty);
        self.columns.iter().enumerate().filter(move |(k, _)| holds(*k))
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[TableRow] {
        &self.rows
    }

    /// Returns true if it has no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns true if it is a list of names and values.
    #[must_use]
    pub fn is_list(&self) -> bool {
        self.columns.iter().all(|c| c.name.is_empty())
    }

    /// The unit of the cells of `row` in column `column`.
    #[must_use]
    pub fn unit<'a>(&'a self, row: &'a TableRow, column: usize) -> &'a Unit {
        self.columns[column].unit.as_ref().unwrap_or(&row.unit)
    }

    /// The text of a cell. It includes the unit if the unit is shown nowhere else: for the name of a row, and for a
    /// value of a list.
    #[must_use]
    pub fn shown(&self, row: &TableRow, column: usize) -> String {
        let text = row.cells[column].shown(self.unit(row, column));
        match (self.is_list(), column) {
            (true, 1) => format!("{text} {}", row.unit.symbol()).trim_end().to_owned(),
            (false, 0) => row.unit.beside(&text),
            _ => text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_shown_in_the_unit_of_their_column_or_else_of_their_row() {
        let mut t = Table::new([
            Column::text("what"),
            Column::number("RMS"),
            Column::with_unit("at", Unit::of_si("s")),
            Column::number("inside"),
            Column::text("never"),
            Column::number("lag 1"),
        ]);
        let cells = [
            Cell::text("yaw"),
            Cell::Real(core::f64::consts::PI),
            Cell::Real(2.0),
            Cell::Share(0.9973),
            Cell::Empty,
            Cell::Ratio(-0.4),
        ];
        t.row_in(Unit::of_si("rad"), cells);
        let shown: Vec<String> = t.columns().map(|(k, _)| t.shown(&t.rows()[0], k)).collect();
        assert_eq!(shown, ["yaw [deg]", "180.0", "2.000", "99.7 %", "-0.40"]);
        let headings: Vec<String> = t.columns().map(|(_, c)| c.heading()).collect();
        assert_eq!(
            headings,
            ["what", "RMS", "at [s]", "inside", "lag 1"],
            "a column without content is not there"
        );
    }

    #[test]
    fn a_list_has_the_unit_after_the_value() {
        let mut t = Table::list();
        t.row_in(Unit::of_si("s"), [Cell::text("started"), Cell::Fixed(60.9, 3)]);
        assert_eq!(t.shown(&t.rows()[0], 0), "started");
        assert_eq!(t.shown(&t.rows()[0], 1), "60.900 s");
    }

    #[test]
    fn nothing_is_said_of_what_is_not_a_number() {
        let unknown = Consistency {
            mean: f64::NAN,
            dof: 3,
            count: 2,
            independent: 2.0,
            band: (1.0, 5.0),
        };
        let shown = [Cell::Judged(unknown), Cell::Share(f64::NAN), Cell::Real(f64::NAN)].map(|c| c.shown(&Unit::none()));
        assert_eq!(shown, ["–", "–", "–"]);
        assert_eq!(Cell::Judged(unknown).judgement(), None);
    }
}
