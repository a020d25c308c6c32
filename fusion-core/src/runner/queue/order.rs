//! Rows in order of their time of validity.

use crate::memory::{Memory, Tape};
use crate::runner::consumer::Consumer;
use crate::time::Time;
use alloc::collections::VecDeque;

/// A row for one of its consumers: when it is valid, and its number among the rows kept.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Entry {
    pub(crate) time: Time,
    pub(crate) consumer: Consumer,
    pub(crate) row: usize,
}
crate::memory!(Entry { time, consumer, row });

/// Entries by time of validity, then consumer, then arrival.
///
/// Sorted, not a heap: rows come nearly in order, and a row in order is put at the end at once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order(VecDeque<Entry>);

impl Memory for Order {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

/// Rows that wait at a time, unless they arrive late.
const ROOM: usize = 16;

impl Order {
    pub(crate) fn new() -> Self {
        Self(VecDeque::with_capacity(ROOM))
    }

    pub(crate) fn put(&mut self, entry: Entry) {
        let precedes = |other: &Entry| (other.time, other.consumer) <= (entry.time, entry.consumer);
        if self.0.back().is_none_or(precedes) {
            self.0.push_back(entry);
        } else {
            self.0.insert(self.0.partition_point(precedes), entry);
        }
    }

    /// The entries in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Entry> + Clone {
        self.0.iter()
    }

    /// The entry that comes first.
    pub(crate) fn first(&self) -> Option<&Entry> {
        self.0.front()
    }

    /// Takes the first entry.
    pub(crate) fn take(&mut self) -> Option<Entry> {
        self.0.pop_front()
    }
}
