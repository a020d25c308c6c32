//! What feeds a run.

use super::{Row, SourceReport};
use crate::config::Diagnostics;
use core::fmt::Debug;
use core::ops::Range;
use serde::Serialize;

/// The rows of all streams of an assembly in order of their stamps, recorded or simulated.
pub trait Feed: Debug {
    /// The next row, of a stream of the assembly.
    ///
    /// # Errors
    /// What is wrong with the data.
    fn next(&mut self) -> Result<Option<Row<'_>>, Diagnostics>;

    /// The true state at the last row of the reference, in the layout of the filter; only a simulated
    /// world knows it.
    fn truth(&self) -> Option<&[f64]> {
        None
    }

    /// Whether a block of that state was drawn, and may be scored.
    fn is_drawn(&self, _block: &str) -> bool {
        false
    }

    /// Which numbers of which streams declared faults may change.
    fn disturbable(&self) -> Vec<(usize, Range<usize>)>;

    /// What each source delivered.
    fn statistics(&self) -> Vec<SourceStatistics>;
}

/// What a source delivered.
#[derive(Clone, Debug, Serialize)]
pub struct SourceStatistics {
    /// The source.
    pub name: String,
    /// Rows read.
    pub rows: u64,
    /// Rows delivered.
    pub used: u64,
    /// Rows left out, by reason.
    pub skipped: Vec<(String, u64)>,
    /// All of its report.
    #[serde(skip)]
    pub report: SourceReport,
}

impl SourceStatistics {
    /// Of a source by its report.
    #[must_use]
    pub fn new(name: &str, report: &SourceReport) -> Self {
        Self {
            name: name.to_owned(),
            rows: report.rows,
            used: report.used,
            skipped: report.skipped.iter().map(|s| (s.reason.clone(), s.count)).collect(),
            report: report.clone(),
        }
    }
}
