//! The rows that are kept until their last consumer has used them.

use crate::memory::{Memory, Tape};
use crate::runner::rows::Stored;
use crate::runner::{Row, StreamId};
use crate::time::Time;
use alloc::vec::Vec;

/// A row, and the number of consumers that still have to use it.
#[derive(Clone, Debug, Default)]
struct Slot {
    uses: u32,
    row: Stored,
}
crate::memory!(Slot { uses, row });

/// Rows in flight, reused: a row is freed when its last consumer has seen it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
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
    /// Keeps a copy of a row that arrives at `arrival`, and returns its number. No consumer holds it yet.
    pub(crate) fn put(&mut self, row: &Row<'_>, arrival: Time) -> usize {
        let at = self.free.pop().unwrap_or_else(|| {
            self.slots.push(Slot::default());
            self.slots.len() - 1
        });
        let slot = &mut self.slots[at];
        slot.row.take(row, arrival);
        slot.uses = 0;
        at
    }

    /// Whether row number `at` is in flight and has the width that `width` gives for its stream.
    pub(crate) fn holds(&self, at: usize, width: impl Fn(StreamId) -> Option<usize>) -> bool {
        let slot = self.slots.get(at).filter(|slot| slot.uses > 0);
        slot.is_some_and(|slot| width(slot.row.stream()) == Some(slot.row.values().len()))
    }

    pub(crate) fn get(&self, at: usize) -> &Stored {
        &self.slots[at].row
    }

    /// One more consumer holds a row.
    pub(crate) fn hold(&mut self, at: usize) {
        self.slots[at].uses += 1;
    }

    /// One consumer has used a row.
    pub(crate) fn release(&mut self, at: usize) {
        self.slots[at].uses -= 1;
        self.free_unused(at);
    }

    /// Frees a row that no consumer holds.
    pub(crate) fn free_unused(&mut self, at: usize) {
        if self.slots[at].uses == 0 {
            self.free.push(at);
        }
    }
}
