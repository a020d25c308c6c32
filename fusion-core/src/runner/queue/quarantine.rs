//! Stamps that jump ahead: rows wait until enough rows confirm the jump.
//!
//! A row whose stamp is far ahead of all others waits, and so do the next rows that are as far ahead. The first row
//! that is not ahead refutes them. When 20 rows wait and one more comes, the jump is a gap, and all are used. If
//! several streams have rows, two of them must have jumped, or one must continue for as long as a row may be ahead.
//! The end of the log discards waiting rows.

use crate::memory::{Memory, Tape};
use crate::runner::Row;
use crate::runner::rows::Copied;
use crate::time::{Time, nanos};
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// Successive rows whose stamps are wrong, at most.
const LONGEST_RUN: usize = 20;

/// Holds back rows whose stamps are far ahead of all others.
#[derive(Clone, Debug)]
pub(crate) struct Quarantine {
    /// How far ahead a row may be \[ns\].
    longest: i64,
    /// The longest recent interval between rows \[ns\].
    usual: i64,
    /// The arrival of the latest row that is not in doubt.
    arrived: Option<Time>,
    /// The first stream that had a row, and whether others had, too.
    stream: Option<usize>,
    are_several: bool,
    /// In order of arrival.
    held: VecDeque<Copied>,
    spare: Vec<Copied>,
}

impl Memory for Quarantine {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.usual.remember(tape);
        self.arrived.remember(tape);
        self.stream.remember(tape);
        self.are_several.remember(tape);
        tape.pooled(&mut self.held, &mut self.spare);
    }
}

/// How to treat a row, and before it the waiting rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Admission {
    /// The row is used; waiting rows are discarded.
    Use,
    /// The row waits together with any other waiting rows.
    Wait,
    /// The waiting rows are used, and so is this row.
    Confirms,
    /// The row is another jump: the waiting rows are discarded, and this row waits.
    Replaces,
}

impl Quarantine {
    /// A quarantine for rows more than `longest` seconds ahead; infinite switches it off.
    pub(crate) fn new(longest: f64) -> Self {
        Self {
            longest: nanos(longest),
            usual: 0,
            arrived: None,
            stream: None,
            are_several: false,
            held: VecDeque::new(),
            spare: Vec::new(),
        }
    }

    /// How far ahead of the others, which are at `now`, a row may be \[ns\]. Rows that are always far apart do not
    /// jump.
    fn limit(&self) -> i64 {
        self.longest.max(self.usual.saturating_mul(3))
    }

    /// Whether a row is in doubt, the latest stamp of the others being `now`.
    pub(crate) fn doubts(&self, row: &Row<'_>, now: Time) -> bool {
        let passed = self.passed(row).unwrap_or(0);
        now != Time::MIN && row.time.nanos().saturating_sub(now.nanos()) > self.limit().saturating_add(passed)
    }

    /// The time from the arrival of the latest row that is not in doubt to the arrival of `row` \[ns\].
    fn passed(&self, row: &Row<'_>) -> Option<i64> {
        Some(row.arrival?.nanos().saturating_sub(self.arrived?.nanos()).max(0))
    }

    /// Judges a row by the latest stamp of the others, `now`.
    pub(crate) fn admit(&mut self, row: &Row<'_>, now: Time) -> Admission {
        if !self.doubts(row, now) {
            self.are_several |= *self.stream.get_or_insert(row.stream) != row.stream;
            if now != Time::MIN {
                let ahead = row.time.nanos().saturating_sub(now.nanos());
                self.usual = ahead.max(self.usual - self.usual / 8);
            }
            self.arrived = row.arrival;
            return Admission::Use;
        }
        let limit = self.limit().unsigned_abs();
        let is_apart = |held: &Copied| row.time.nanos().abs_diff(held.row().time.nanos()) > limit;
        if self.held.back().is_some_and(is_apart) {
            return Admission::Replaces;
        }
        match self.held.front() {
            Some(first) if self.goes_on(row, first) => {
                self.usual = first.row().time.nanos().saturating_sub(now.nanos());
                self.arrived = row.arrival;
                Admission::Confirms
            }
            _ => Admission::Wait,
        }
    }

    /// Whether the waiting rows and `row` are too many for a fault of the stamps.
    fn goes_on(&self, row: &Row<'_>, first: &Copied) -> bool {
        let has_lasted = || row.time.nanos().saturating_sub(first.row().time.nanos()) > self.limit();
        let others = || self.held.iter().any(|held| held.row().stream != row.stream);
        self.held.len() >= LONGEST_RUN && (!self.are_several || has_lasted() || others())
    }

    /// Holds a row back.
    pub(crate) fn hold(&mut self, row: &Row<'_>) {
        let mut held = self.spare.pop().unwrap_or_default();
        held.take(row);
        self.held.push_back(held);
    }

    /// Removes and returns the first waiting row.
    pub(crate) fn release(&mut self) -> Option<Copied> {
        self.held.pop_front()
    }

    /// Takes the memory of a row that has been released.
    pub(crate) fn give_back(&mut self, held: Copied) {
        self.spare.push(held);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Judges rows of these streams, stamped in hundredths of a second, after one row of each stream. Waiting rows
    /// are held.
    fn judged(rows: impl Iterator<Item = (usize, i64)>) -> Vec<Admission> {
        let mut quarantine = Quarantine::new(10.0);
        let mut now = Time::MIN;
        let mut judge = |(stream, centi): (usize, i64)| {
            let row = Row::new(stream, Time::from_nanos(centi * 10_000_000), &[]);
            let admission = quarantine.admit(&row, now);
            match admission {
                Admission::Wait => quarantine.hold(&row),
                Admission::Use => now = now.max(row.time),
                _ => {}
            }
            admission
        };
        judge((0, 0));
        judge((1, 0));
        rows.map(judge).collect()
    }

    #[test]
    fn a_stamp_may_be_ahead_by_the_time_that_has_passed_since_the_row_before() {
        let second = 1_000_000_000;
        let judged = |ahead: i64, passed: Option<i64>| {
            let mut quarantine = Quarantine::new(10.0);
            let row = |time: i64, arrival: Option<i64>| Row {
                arrival: arrival.map(|a| Time::from_nanos((5000 + a) * second)),
                ..Row::new(0, Time::from_nanos(time * second), &[])
            };
            assert_eq!(quarantine.admit(&row(0, Some(0)), Time::MIN), Admission::Use);
            quarantine.admit(&row(ahead, passed), Time::default())
        };
        // A tunnel of an hour, with the receiver switched off; without the clock, and with a clock that contradicts.
        assert_eq!(judged(3600, Some(3598)), Admission::Use);
        assert_eq!(judged(3600, None), Admission::Wait);
        assert_eq!(judged(3600, Some(1)), Admission::Wait);
        // The clock must not make a row doubtful that is not doubtful without it.
        assert_eq!(judged(9, Some(0)), Admission::Use);
    }

    #[test]
    fn of_several_streams_two_have_to_jump_or_one_for_long() {
        const HOUR: i64 = 360_000;
        let one = judged((1..2000).map(|k| (0, HOUR + k)));
        // 10 s of its rows, and one more.
        assert_eq!(one.iter().position(|a| *a == Admission::Confirms), Some(1001));
        let two = judged((1..100).map(|k| (usize::from(k == 7), HOUR + k)));
        assert_eq!(two.iter().position(|a| *a == Admission::Confirms), Some(20));
    }
}
