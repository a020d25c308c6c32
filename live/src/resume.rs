//! The bytes of a source before a checkpoint, from which another reader continues.

use crate::decoder::{Decoded, Decoder};
use fusion::core::memory::{Memory, Tape};
use fusion::core::time::Time;

/// The first bytes of a link that are kept: the head of a file, with the names of its columns.
const HEAD: usize = 1 << 14;
/// The latest bytes that are kept: at least the latest rows of any format but those with large messages.
const TAIL: usize = 1 << 16;

/// The head and the latest bytes since the link was opened.
///
/// A reader that has read these gives the same rows from then on as the reader that has read all, if it can find its
/// place within them, as readers of lines and of framed messages do.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lately {
    head: Vec<u8>,
    tail: Vec<u8>,
    /// Bytes between the two that are not kept.
    left_out: u64,
    /// The last row that was decoded.
    last: Option<Last>,
}

/// A row.
#[derive(Clone, Debug, Default, PartialEq)]
struct Last {
    time: Time,
    number: u64,
    values: Vec<f64>,
}

fusion::core::memory!(Last { time, number, values });

impl Memory for Lately {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        for bytes in [&mut self.head, &mut self.tail] {
            let mut length = bytes.len();
            length.remember(tape);
            if tape.is_reading() {
                bytes.clear();
                bytes.resize(length.min(HEAD + 2 * TAIL), 0);
            }
            for byte in bytes.iter_mut() {
                [*byte] = tape.bytes([*byte]);
            }
        }
        self.left_out.remember(tape);
        self.last.remember(tape);
    }
}

impl Lately {
    /// Adds bytes.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        let room = HEAD.saturating_sub(self.head.len());
        let room = if self.tail.is_empty() && self.left_out == 0 { room } else { 0 };
        let (to_head, rest) = bytes.split_at(room.min(bytes.len()));
        self.head.extend_from_slice(to_head);
        self.tail.extend_from_slice(rest);
        if self.tail.len() > 2 * TAIL {
            let old = self.tail.len() - TAIL;
            self.tail.drain(..old);
            self.left_out += old as u64;
        }
    }

    /// Notes the last row that was decoded; its number is that of the whole link.
    pub(crate) fn row(&mut self, row: &Decoded) {
        let last = self.last.get_or_insert_default();
        (last.time, last.number) = (row.stamp.time, row.stamp.number);
        last.values.clone_from(&row.values);
    }

    /// Gives them to a reader that has read nothing, and sets the number of the rows that it has not read. Returns
    /// whether its last row is the same.
    pub(crate) fn feed(&self, decoder: &mut Decoder, number_before: &mut u64) -> bool {
        let mut last: Option<Decoded> = None;
        for bytes in [&self.head, &self.tail].into_iter().filter(|bytes| !bytes.is_empty()) {
            decoder.push(bytes, &mut |row| last = Some(row));
        }
        let (Some(known), Some(row)) = (&self.last, last) else {
            return self.last.is_none();
        };
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let is_same = known.time == row.stamp.time && bits(&known.values) == bits(&row.values);
        if is_same {
            *number_before = known.number.saturating_sub(row.stamp.number);
        }
        is_same
    }
}
