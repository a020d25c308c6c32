//! Stamps that jump ahead: a row waits until a second one confirms it.

use super::rows::Row;
use crate::time::{Time, nanos};
use core::ops::Range;

/// Holds back a row whose stamp is far ahead of all others.
#[derive(Clone, Debug)]
pub(super) struct Quarantine {
    /// How far ahead a row may be \[ns\].
    pub(super) longest: i64,
    /// The longest that the rows have lately been apart \[ns\].
    usual: i64,
    held: Option<Held>,
}
crate::memory!(Quarantine { usual, held; longest });

/// A row that is held back.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    stream: usize,
    pub(super) time: Time,
    values: Vec<f64>,
    number: u64,
    disturbed: Vec<Range<usize>>,
}
crate::memory!(Held {
    stream,
    time,
    values,
    number,
    disturbed
});

impl Held {
    fn of(row: &Row<'_>) -> Self {
        Self {
            stream: row.stream,
            time: row.time,
            values: row.values.to_vec(),
            number: row.number,
            disturbed: row.disturbed.to_vec(),
        }
    }

    pub(super) fn row(&self) -> Row<'_> {
        Row {
            stream: self.stream,
            time: self.time,
            values: &self.values,
            number: self.number,
            disturbed: &self.disturbed,
        }
    }
}

/// What is to be done with a row.
#[derive(Debug)]
pub(super) enum Admission {
    /// Use it.
    Use,
    /// It waits.
    Wait,
    /// It confirms the one that waits: use that one, then this.
    Confirms(Held),
    /// It refutes the one that waits: discard that one, use this.
    Refutes(Held),
    /// It is another jump: the one that waits is discarded, this one waits.
    Replaces(Held),
}

impl Quarantine {
    /// A quarantine for rows more than `longest` seconds ahead; infinite: none.
    pub(super) fn new(longest: f64) -> Self {
        Self {
            longest: nanos(longest),
            usual: 0,
            held: None,
        }
    }

    /// Judges a row by the latest stamp of the others, `now`.
    pub(super) fn admit(&mut self, row: &Row<'_>, now: Time) -> Admission {
        let ahead = row.time.nanos().saturating_sub(now.nanos());
        // Rows that are always far apart do not jump.
        let limit = self.longest.max(self.usual.saturating_mul(3));
        if now == Time::MIN || ahead <= limit {
            if now != Time::MIN {
                self.usual = ahead.max(self.usual - self.usual / 8);
            }
            return self.held.take().map_or(Admission::Use, Admission::Refutes);
        }
        match self.held.take() {
            Some(held) if row.time.nanos().abs_diff(held.time.nanos()) <= limit.unsigned_abs() => {
                self.usual = held.time.nanos().saturating_sub(now.nanos());
                Admission::Confirms(held)
            }
            Some(held) => {
                self.held = Some(Held::of(row));
                Admission::Replaces(held)
            }
            None => {
                self.held = Some(Held::of(row));
                Admission::Wait
            }
        }
    }

    /// The row that is still held back at the end of the log.
    pub(super) fn finish(&mut self) -> Option<Held> {
        self.held.take()
    }
}
