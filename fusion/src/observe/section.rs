//! A section of the result as a table for readers.

use super::Section;
use schemars::JsonSchema;
use serde::Serialize;

/// A section of the result that is a table. It is in summary.json, in the terminal and in the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct RunSection {
    /// Its name in summary.json, `snake_case`.
    pub name: String,
    /// The heading for readers.
    pub title: String,
    /// The columns.
    pub columns: Vec<SectionColumn>,
    /// The rows: a figure for each column. Without rows and notes the section is not shown.
    pub rows: Vec<Vec<Figure>>,
    /// Sentences below the table.
    pub notes: Vec<String>,
    /// Whether it is shown with all tables only, and not in the short result of a run.
    #[serde(skip)]
    pub is_detail: bool,
}

impl Section for RunSection {
    const NAME: &'static str = "sections";
    const MAY_REPEAT: bool = true;

    fn shown(&self) -> Option<RunSection> {
        Some(self.clone())
    }
}

/// A column of a [`RunSection`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SectionColumn {
    /// The heading.
    pub name: String,
    /// The SI unit of its numbers, such as `rad/s`: readers see the usual unit. Empty for texts, counts and pure numbers.
    pub unit: String,
}

/// A value in a [`RunSection`].
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Figure {
    /// Words.
    Text(String),
    /// A count.
    Count(u64),
    /// A number in the SI unit of its column; NaN is an empty cell.
    Number(f64),
}
