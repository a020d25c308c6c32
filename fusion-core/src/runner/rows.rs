//! A row: as it is fed, and as a part of the runner keeps it.

use super::{RowId, StreamId};
use crate::time::Time;
use alloc::vec::Vec;
use core::ops::Range;

/// A row as it is fed.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The stream.
    pub stream: StreamId,
    /// Its stamp.
    pub time: Time,
    /// Its numbers; their count is the width of the stream.
    pub values: &'a [f64],
    /// Its number within its source, for messages: a line, a message's index.
    pub number: u64,
    /// Ranges of `values` that declared faults have changed.
    pub disturbed: &'a [Range<usize>],
    /// When it arrived, by a monotonic clock of any origin; `None` without such a clock. It confirms a stamp far ahead,
    /// and changes nothing else.
    pub arrival: Option<Time>,
}

impl<'a> Row<'a> {
    /// A row without a number that no fault has changed.
    #[must_use]
    pub const fn new(stream: StreamId, time: Time, values: &'a [f64]) -> Self {
        Self {
            stream,
            time,
            values,
            number: 0,
            disturbed: &[],
            arrival: None,
        }
    }
}

/// A copy of a row, in memory that is used again. It does not keep the arrival.
#[derive(Clone, Debug, Default)]
pub(super) struct Copied {
    stream: StreamId,
    time: Time,
    values: Vec<f64>,
    number: u64,
    disturbed: Vec<Range<usize>>,
}
crate::memory!(Copied {
    stream,
    time,
    values,
    number,
    disturbed
});

impl Copied {
    /// Becomes a copy of `row`.
    pub(super) fn take(&mut self, row: &Row<'_>) {
        (self.stream, self.time, self.number) = (row.stream, row.time, row.number);
        self.values.clear();
        self.values.extend_from_slice(row.values);
        self.disturbed.clear();
        self.disturbed.extend_from_slice(row.disturbed);
    }

    pub(super) fn row(&self) -> Row<'_> {
        Row {
            stream: self.stream,
            time: self.time,
            values: &self.values,
            number: self.number,
            disturbed: &self.disturbed,
            arrival: None,
        }
    }
}

/// A row that its consumers have not all used yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Stored {
    values: Vec<f64>,
    disturbed: Vec<Range<usize>>,
    id: RowId,
}
crate::memory!(Stored { values, disturbed, id });

impl Stored {
    /// Becomes a copy of `row`, which arrives at `arrival`.
    pub(super) fn take(&mut self, row: &Row<'_>, arrival: Time) {
        self.values.clear();
        self.values.extend_from_slice(row.values);
        self.disturbed.clear();
        self.disturbed.extend_from_slice(row.disturbed);
        self.id = RowId::of(row, arrival, &[]);
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(super) const fn stream(&self) -> StreamId {
        self.id.stream
    }

    pub(super) const fn stamp(&self) -> Time {
        self.id.stamp
    }

    /// Its identity for a consumer that reads `columns`; without columns, for any consumer.
    pub(super) fn id(&self, columns: &[usize]) -> RowId {
        RowId {
            disturbed: is_disturbed(&self.disturbed, columns),
            ..self.id
        }
    }
}

/// Whether one of `ranges` contains one of `columns`; without columns, whether there is any range.
fn is_disturbed(ranges: &[Range<usize>], columns: &[usize]) -> bool {
    ranges
        .iter()
        .any(|range| columns.is_empty() || columns.iter().any(|c| range.contains(c)))
}

impl RowId {
    /// The identity of a row that arrives at `arrival`, for a consumer that reads `columns`; without columns, for any
    /// consumer.
    pub(super) fn of(row: &Row<'_>, arrival: Time, columns: &[usize]) -> Self {
        Self {
            stream: row.stream,
            number: row.number,
            stamp: row.time,
            arrival,
            disturbed: is_disturbed(row.disturbed, columns),
        }
    }
}
