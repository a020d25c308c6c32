//! Rows in flight, and the queue that orders them.

use super::StreamId;
use crate::memory::{Memory, Tape};
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

/// The consumer of a row. At one time of validity, consumers are served in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Consumer {
    #[default]
    Input,
    /// Unit, input.
    Initialiser(usize, usize),
    /// Unit, input.
    Stage(usize, usize),
    /// Finds the time of validity of a row, for a sensor with an estimated offset: its number.
    Aim(usize),
    /// Rank, number.
    Sensor(usize, usize),
}

impl Consumer {
    /// Whether it does not need rows once the filter runs.
    pub(super) const fn is_initialiser(self) -> bool {
        matches!(self, Self::Initialiser(..))
    }

    /// Served after all others of its time.
    pub(super) const LAST: Self = Self::Sensor(usize::MAX, usize::MAX);

    /// Which of its inputs it takes the row at.
    pub(super) const fn input(self) -> usize {
        match self {
            Self::Initialiser(_, input) | Self::Stage(_, input) => input,
            Self::Input | Self::Aim(_) | Self::Sensor(..) => 0,
        }
    }
}

impl Memory for Consumer {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let (mut kind, mut of, mut input) = match *self {
            Self::Input => (0_u8, 0, 0),
            Self::Initialiser(unit, input) => (1, unit, input),
            Self::Stage(unit, input) => (2, unit, input),
            Self::Aim(sensor) => (3, sensor, 0),
            Self::Sensor(rank, sensor) => (4, sensor, rank),
        };
        kind.remember(tape);
        of.remember(tape);
        input.remember(tape);
        *self = match kind {
            0 => Self::Input,
            1 => Self::Initialiser(of, input),
            2 => Self::Stage(of, input),
            3 => Self::Aim(of),
            4 => Self::Sensor(input, of),
            _ => return tape.refuse("a consumer does not exist"),
        };
    }
}

/// An entry of the reorder queue.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Entry {
    pub(super) time: Time,
    pub(super) consumer: Consumer,
    pub(super) row: usize,
}
crate::memory!(Entry { time, consumer, row });

/// Entries by time of validity, then consumer, then arrival.
///
/// Sorted, not a heap: rows come nearly in order, and a row in order is put at the end at once.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue(VecDeque<Entry>);

impl Memory for Queue {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

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
#[derive(Clone, Debug, Default)]
pub(super) struct Slot {
    pub(super) values: Vec<f64>,
    disturbed: Vec<Range<usize>>,
    id: RowId,
    uses: u32,
}
crate::memory!(Slot {
    uses,
    values,
    disturbed,
    id
});

impl Slot {
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

/// Rows in flight, reused: a row is freed when its last consumer has seen it.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    slots: Vec<Slot>,
    free: Vec<usize>,
}

/// Rows in flight keep their places; free rows are not saved.
impl Memory for Rows {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let used = self.slots.iter().rposition(|slot| slot.uses > 0).map_or(0, |last| last + 1);
        let used = tape.length(used, 1);
        if self.slots.len() < used {
            self.slots.resize_with(used, Slot::default);
        }
        let (slots, rest) = self.slots.split_at_mut(used);
        for slot in slots {
            let mut is_used = slot.uses > 0;
            is_used.remember(tape);
            if is_used {
                slot.remember(tape);
            } else {
                slot.uses = 0;
            }
        }
        if tape.is_reading() {
            rest.iter_mut().for_each(|slot| slot.uses = 0);
            self.free.clear();
            let is_free = |(at, slot): (usize, &Slot)| (slot.uses == 0).then_some(at);
            self.free.extend(self.slots.iter().enumerate().rev().filter_map(is_free));
        }
    }
}

impl Rows {
    pub(super) fn put(&mut self, row: &Row<'_>, arrival: Time) -> usize {
        let id = RowId::of(row, arrival, &[]);
        let at = self.free.pop().unwrap_or_else(|| {
            self.slots.push(Slot::default());
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

    /// Whether row number `at` is in flight and has the width that `width` gives for its stream.
    pub(super) fn holds(&self, at: usize, width: impl Fn(StreamId) -> Option<usize>) -> bool {
        let slot = self.slots.get(at).filter(|slot| slot.uses > 0);
        slot.is_some_and(|slot| width(slot.id.stream) == Some(slot.values.len()))
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

    /// Frees a row that no consumer holds.
    pub(super) fn free_unused(&mut self, at: usize) {
        if self.slots[at].uses == 0 {
            self.free.push(at);
        }
    }
}
