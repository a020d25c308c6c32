//! Observers that make the sections of the result: of this crate and of others.
//!
//! ```text
//! RunStart ─▶ makers ─▶ observers ◀─ events         what is known at the start
//!                           │ share: the figures that other sections need
//! RunEnd ───────────────────┴─▶ finish ─▶ sections   what is known at the end
//! ```

use super::{Entry, FilterScore, Filters, Heard, RunEvent, RunObserver, Summary, Timing, Wait};
use crate::assembly::Assembly;
use crate::design::Design;
use crate::rows::Feed;
use crate::score::{Outage, Rules};
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::Halt;
use fusion_core::time::Time;

/// The facts that are known at the start of a run.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct RunStart<'a> {
    /// The design.
    pub design: &'a Design,
    /// The filter that is run.
    pub assembly: &'a Assembly,
    /// The filters that are observed.
    pub filters: &'a Filters,
    /// True for one of the many runs of a campaign, which needs fewer sections.
    pub is_one_of_many: bool,
    pub(crate) rows: &'a dyn Feed,
    /// The declared outages of the outermost filter.
    pub(crate) outages: &'a [Outage],
    /// How each filter is scored, by its number; empty without a reference.
    pub(crate) rules: &'a [Rules],
}

impl RunStart<'_> {
    /// Innovations and errors count from this time on; `None` for the whole run.
    pub(crate) fn counts_from(&self) -> Option<Time> {
        let reference = self.design.reference.as_ref()?;
        reference.block.from.map(|t| Time::from_seconds(t.si()))
    }

    /// The score of `filter`; `None` without a reference.
    pub(crate) fn score(&self, filter: &Heard) -> Option<FilterScore> {
        self.score_by(filter, self.rules.get(filter.number)?.clone())
    }

    /// The score of `filter` without the drift in each outage; `None` without a reference.
    pub(crate) fn score_without_outages(&self, filter: &Heard) -> Option<FilterScore> {
        let rules = self.rules.get(filter.number)?.clone();
        self.score_by(
            filter,
            Rules {
                outages: Vec::new(),
                ..rules
            },
        )
    }

    fn score_by(&self, filter: &Heard, rules: Rules) -> Option<FilterScore> {
        let is_drawn = |block: &str| filter.is_outermost() && self.rows.is_drawn(block);
        Some(FilterScore::new(filter, rules, is_drawn))
    }
}

/// Figures of one observer that other sections need.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Shared {
    /// When each filter was aligned \[s\], by its number; `None` if it never was.
    pub aligned: Vec<Option<f64>>,
    /// When the outermost filter started \[s\]; `None` if it never did.
    pub started: Option<f64>,
}

/// The facts that are known at the end of a run.
#[derive(Debug)]
#[non_exhaustive]
pub struct RunEnd<'a> {
    /// The design.
    pub design: &'a Design,
    /// The filter, with its last estimate.
    pub assembly: &'a Assembly,
    /// The seed that replaces the design's.
    pub seed: Option<u64>,
    /// The wait of the outermost filter before its first start; `None` if it never started.
    pub waited: Option<Wait>,
    /// The figures that observers share.
    pub shared: Shared,
    /// The sections of the current estimates, of a filter that goes back for late rows.
    pub current: Option<Summary>,
    pub(crate) rows: &'a dyn Feed,
    pub(crate) timing: &'a Timing,
}

impl<'a> RunEnd<'a> {
    /// The end of a run whose observers have not ended yet.
    pub(crate) fn new(
        (design, seed): (&'a Design, Option<u64>),
        assembly: &'a Assembly,
        (rows, timing): (&'a dyn Feed, &'a Timing),
    ) -> Self {
        Self {
            design,
            assembly,
            seed,
            waited: None,
            shared: Shared::default(),
            current: None,
            rows,
            timing,
        }
    }
}

/// An observer that makes a section at the end of a run.
pub trait SectionObserver: RunObserver {
    /// Shares the figures that other sections need. It is called before any section is made.
    fn share(&self, _shared: &mut Shared) {}

    /// The section.
    ///
    /// # Errors
    /// An observer that cannot continue.
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt>;
}

/// Makes the observer of a section. At the start of a run, every maker of a linked crate is called. In a campaign no
/// maker is called.
///
/// The section may be a table, as here, or any type that is a [`Section`](super::Section).
///
/// ```
/// use fusion::observe::{Entry, RunEnd, RunEvent, RunObserver, RunSection, SectionMaker, SectionObserver};
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
///     fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<Entry, Halt> {
///         let notes = vec![format!("{} rows went to the filter.", self.0)];
///         Ok(RunSection { name: "rows".to_owned(), title: "Rows".to_owned(), notes, ..RunSection::default() }.into())
///     }
/// }
///
/// fusion::inventory::submit! {
///     SectionMaker { name: "rows", make: |_start| Some(Box::new(Rows(0))) }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SectionMaker {
    /// Sections are in the order of these names.
    pub name: &'static str,
    /// Makes the observer; `None` if the section has no meaning for the design.
    pub make: fn(&RunStart<'_>) -> Option<Box<dyn SectionObserver>>,
}

crate::inventory::collect!(SectionMaker);

/// The observers of all linked crates.
pub(crate) fn linked(start: &RunStart<'_>) -> Vec<Box<dyn SectionObserver>> {
    let mut all: Vec<_> = crate::inventory::iter::<SectionMaker>.into_iter().collect();
    all.sort_by_key(|maker| maker.name);
    all.into_iter().filter_map(|maker| (maker.make)(start)).collect()
}

/// Makes a section at the end, without events.
pub(crate) struct AtEnd<F>(F);

/// The observer of a section that needs no event.
pub(crate) fn at_end<'a, E: Into<Entry> + 'a>(make: impl FnOnce(&RunEnd<'_>) -> E + 'a) -> Box<dyn SectionObserver + 'a> {
    Box::new(AtEnd(make))
}

/// Returns `observer`. Without one, returns an observer that makes `section`.
pub(crate) fn made_or<'a>(observer: Option<impl SectionObserver + 'a>, section: impl Into<Entry> + 'a) -> Box<dyn SectionObserver + 'a> {
    match observer {
        Some(observer) => Box::new(observer),
        None => at_end(|_| section),
    }
}

impl<F> Memory for AtEnd<F> {
    fn remember(&mut self, _: &mut Tape<'_>) {}
}

impl<F> RunObserver for AtEnd<F> {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, _: &RunEvent<'_>) -> Result<(), Halt> {
        Ok(())
    }
}

impl<E: Into<Entry>, F: FnOnce(&RunEnd<'_>) -> E> SectionObserver for AtEnd<F> {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok((self.0)(end).into())
    }
}
