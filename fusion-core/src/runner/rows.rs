//! Rows in flight, and the queue that orders them.

use super::StreamId;
use crate::runner::RowId;
use crate::time::Time;
use core::ops::Range;
use std::collections::VecDeque;

/// A row as it is fed.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The stream.
    pub stream: StreamId,
    /// Its stamp.
    pub time: Time,
    /// Its numbers, as many as the stream is wide.
    pub values: &'a [f64],
    /// Its number within its source, for messages: a line, a message's index.
    pub number: u64,
    /// Ranges of `values` that declared faults have changed.
    pub disturbed: &'a [Range<usize>],
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
        }
    }
}

/// Who takes a row. Of one time of validity they are served in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Consumer {
    Input,
    /// Unit, input.
    Initialiser(usize, usize),
    /// Unit, input.
    Stage(usize, usize),
    /// Finds out when a row of a sensor with an estimated offset is valid: its number.
    Aim(usize),
    /// Rank, number.
    Sensor(usize, usize),
}

impl Consumer {
    /// Which of its inputs it takes the row at.
    pub(super) const fn input(self) -> usize {
        match self {
            Self::Initialiser(_, input) | Self::Stage(_, input) => input,
            Self::Input | Self::Aim(_) | Self::Sensor(..) => 0,
        }
    }
}

/// An entry of the reorder queue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) time: Time,
    pub(super) consumer: Consumer,
    pub(super) row: usize,
}

/// Entries by time of validity, then consumer, then arrival.
///
/// Sorted, not a heap: rows come nearly in order, and one in order is put at the end at once.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue(VecDeque<Entry>);

impl Queue {
    pub(super) fn new() -> Self {
        Self(VecDeque::with_capacity(64))
    }

    pub(super) fn put(&mut self, entry: Entry) {
        let precedes = |other: &Entry| (other.time, other.consumer) <= (entry.time, entry.consumer);
        if self.0.back().is_none_or(precedes) {
            self.0.push_back(entry);
        } else {
            self.0.insert(self.0.partition_point(precedes), entry);
        }
    }

    /// The entries in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Entry> {
        self.0.iter()
    }

    /// The entry that comes first.
    pub(super) fn first(&self) -> Option<&Entry> {
        self.0.front()
    }

    /// Takes the first entry.
    pub(super) fn take(&mut self) -> Option<Entry> {
        self.0.pop_front()
    }
}

/// One row in flight.
#[derive(Clone, Debug)]
pub(super) struct Slot {
    pub(super) values: Vec<f64>,
    disturbed: Vec<Range<usize>>,
    id: RowId,
    uses: u32,
}

impl Slot {
    pub(super) const fn stamp(&self) -> Time {
        self.id.stamp
    }

    /// Its identity for a consumer that reads `columns`, or does not say which.
    pub(super) fn id(&self, columns: &[usize]) -> RowId {
        RowId {
            disturbed: is_disturbed(&self.disturbed, columns),
            ..self.id
        }
    }
}

/// Whether one of `ranges` holds one of `columns`, or any at all where they are not said.
fn is_disturbed(ranges: &[Range<usize>], columns: &[usize]) -> bool {
    ranges
        .iter()
        .any(|range| columns.is_empty() || columns.iter().any(|c| range.contains(c)))
}

impl RowId {
    /// Of a row that arrives at `arrival`, for a consumer that reads `columns`, or does not say which.
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

/// Rows in flight, reused: a row is freed when its last consumer has seen it.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    slots: Vec<Slot>,
    free: Vec<usize>,
}

impl Rows {
    pub(super) fn put(&mut self, row: &Row<'_>, arrival: Time) -> usize {
        let id = RowId::of(row, arrival, &[]);
        let at = self.free.pop().unwrap_or_else(|| {
            self.slots.push(Slot {
                values: Vec::new(),
                disturbed: Vec::new(),
                id,
                uses: 0,
            });
            self.slots.len() - 1
        });
        let slot = &mut self.slots[at];
        slot.values.clear();
        slot.values.extend_from_slice(row.values);
        slot.disturbed.clear();
        slot.disturbed.extend_from_slice(row.disturbed);
        slot.id = id;
        slot.uses = 0;
        at
    }

    pub(super) fn get(&self, at: usize) -> &Slot {
        &self.slots[at]
    }

    pub(super) fn hold(&mut self, at: usize) {
        self.slots[at].uses += 1;
    }

    pub(super) fn release(&mut self, at: usize) {
        self.slots[at].uses -= 1;
        self.free_unused(at);
    }

    /// Frees a row that nobody holds.
    pub(super) fn free_unused(&mut self, at: usize) {
        if self.slots[at].uses == 0 {
            self.free.push(at);
        }
    }
}
