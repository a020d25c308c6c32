//! Sections of the result that other crates make.

use super::{Filters, RunObserver};
use crate::design::Design;
use serde::Serialize;

/// A part of the result that an observer of another crate makes: a table. It is in summary.json, in the terminal and in
/// the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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

/// A column of a [`RunSection`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SectionColumn {
    /// The heading.
    pub name: String,
    /// The SI unit of its numbers, such as `rad/s`: readers see the usual unit. Empty for texts, counts and pure numbers.
    pub unit: String,
}

/// A value in a [`RunSection`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Figure {
    /// Words.
    Text(String),
    /// A count.
    Count(u64),
    /// A number in the SI unit of its column; NaN is an empty cell.
    Number(f64),
}

/// An observer that makes a section at the end of a run. It is not asked in campaigns.
pub trait SectionObserver: RunObserver {
    /// The section.
    fn finish(self: Box<Self>) -> RunSection;
}

/// Makes the observer of a section. At the start of a run, every maker of a linked crate is called.
///
/// ```
/// use fusion::observe::{RunEvent, RunObserver, RunSection, SectionMaker, SectionObserver};
/// use fusion::core::runner::Halt;
///
/// struct Rows(u64);
///
/// impl RunObserver for Rows {
///     fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
///         self.0 += u64::from(matches!(event, RunEvent::Row(_)));
///         Ok(())
///     }
/// }
///
/// impl SectionObserver for Rows {
///     fn finish(self: Box<Self>) -> RunSection {
///         let notes = vec![format!("{} rows went to the filter.", self.0)];
///         RunSection { name: "rows".to_owned(), title: "Rows".to_owned(), notes, ..RunSection::default() }
///     }
/// }
///
/// fusion::inventory::submit! {
///     SectionMaker { name: "rows", make: |_design, _filters| Some(Box::new(Rows(0))) }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SectionMaker {
    /// Sections are in the order of these names.
    pub name: &'static str,
    /// Makes the observer; `None` if the section has no meaning for the design.
    pub make: fn(&Design, &Filters) -> Option<Box<dyn SectionObserver>>,
}

crate::inventory::collect!(SectionMaker);

/// The observers of all linked crates.
pub(crate) fn sections(design: &Design, filters: &Filters) -> Vec<Box<dyn SectionObserver>> {
    let mut all: Vec<_> = crate::inventory::iter::<SectionMaker>.into_iter().collect();
    all.sort_by_key(|maker| maker.name);
    all.into_iter().filter_map(|maker| (maker.make)(design, filters)).collect()
}
