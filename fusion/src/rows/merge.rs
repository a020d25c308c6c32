//! The rows of several sources in order of their stamps.

use super::{Row, RowStream, SourceError, Stamp};
use thiserror::Error;

/// A source failed while it was read.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{error}")]
pub struct Failed {
    /// The number of the source among the merged sources.
    pub index: usize,
    /// The error.
    pub error: SourceError,
}

#[derive(Debug)]
struct Head {
    source: Box<dyn RowStream>,
    /// The stamp of the row at hand; `None` at the end.
    stamp: Option<Stamp>,
    values: Vec<f64>,
}

/// Merges sources by time, holding one row of each; rows of one stamp come in the order of
/// their sources.
#[derive(Debug)]
pub struct Merged {
    heads: Vec<Head>,
    /// Sources whose row at hand has been handed out, or not yet been read.
    stale: std::ops::Range<usize>,
}

impl Merged {
    /// Nothing is read yet.
    #[must_use]
    pub fn new(sources: Vec<Box<dyn RowStream>>) -> Self {
        let heads: Vec<Head> = sources
            .into_iter()
            .map(|source| Head {
                source,
                stamp: None,
                values: Vec::new(),
            })
            .collect();
        Self {
            stale: 0..heads.len(),
            heads,
        }
    }

    /// The next row.
    ///
    /// # Errors
    /// Where a source fails; the others can be read on.
    #[expect(clippy::should_implement_trait, reason = "a row is lent, which an iterator cannot do")]
    pub fn next(&mut self) -> Result<Option<Row<'_>>, Failed> {
        for source in self.stale.by_ref() {
            let head = &mut self.heads[source];
            head.stamp = None;
            head.stamp = head
                .source
                .next(&mut head.values)
                .map_err(|error| Failed { index: source, error })?;
        }
        // Few sources: a scan is faster than a heap, and keeps their order at equal stamps.
        let heads = self.heads.iter().enumerate();
        let first = heads
            .filter_map(|(i, head)| Some((head.stamp?, i)))
            .min_by_key(|(stamp, i)| (stamp.arrival, *i));
        let Some((Stamp { time, number, .. }, source)) = first else {
            return Ok(None);
        };
        self.stale = source..source + 1;
        let head = &self.heads[source];
        Ok(Some(Row {
            stream: source,
            time,
            number,
            values: &head.values,
            disturbed: head.source.disturbed(),
            arrival: None,
        }))
    }

    /// The sources, for their reports.
    pub fn sources(&self) -> impl Iterator<Item = &dyn RowStream> {
        self.heads.iter().map(|head| &*head.source)
    }
}

#[cfg(test)]
mod tests {
    use super::super::stream::testing::listed;
    use super::*;

    fn drain(merged: &mut Merged) -> Vec<Result<(usize, f64), usize>> {
        let mut seen = Vec::new();
        loop {
            match merged.next() {
                Ok(Some(row)) => seen.push(Ok((row.stream, row.values[0]))),
                Ok(None) => return seen,
                Err(failed) => seen.push(Err(failed.index)),
            }
        }
    }

    fn rows(rows: &[(f64, f64)]) -> Box<dyn RowStream> {
        listed(rows.iter().copied().map(Ok).collect())
    }

    #[test]
    fn rows_come_by_time_and_at_equal_stamps_by_source() {
        let mut merged = Merged::new(vec![
            rows(&[(2.0, 1.0), (2.0, 2.0), (5.0, 3.0)]),
            rows(&[]),
            rows(&[(1.0, 4.0), (2.0, 5.0)]),
        ]);
        assert_eq!(
            drain(&mut merged),
            [Ok((2, 4.0)), Ok((0, 1.0)), Ok((0, 2.0)), Ok((2, 5.0)), Ok((0, 3.0))]
        );
        assert_eq!(merged.sources().map(|s| s.report().used).collect::<Vec<_>>(), [3, 0, 2]);
        assert_eq!(drain(&mut merged), []);
    }

    #[test]
    fn a_failure_names_its_source_and_the_others_go_on() {
        let broken = listed(vec![Ok((1.0, 1.0)), Err("torn")]);
        let mut merged = Merged::new(vec![broken, rows(&[(1.0, 2.0), (3.0, 3.0)])]);
        assert_eq!(drain(&mut merged), [Ok((0, 1.0)), Err(0), Ok((1, 2.0)), Ok((1, 3.0))]);
    }
}
