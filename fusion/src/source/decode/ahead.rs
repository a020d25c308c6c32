//! The rows of a format, with a lookahead beyond the current row.

use super::raw::{Cell, Malformed, RawRows};
use crate::rows::DataError;
use std::collections::VecDeque;

/// Reads rows ahead on request.
pub(super) struct Ahead<R> {
    raw: R,
    /// Copies of the current row and of the rows after it, while `raw` is at the row after these.
    held: VecDeque<Held>,
    /// The row looked at: its number after the current row.
    at: usize,
}

struct Held {
    place: usize,
    cells: Vec<Copied>,
    malformed: Option<Malformed>,
    /// The result of reading the next row.
    next: Result<bool, DataError>,
}

enum Copied {
    Text(Vec<u8>),
    Number(f64),
    Integer(i64),
}

impl<R: RawRows> Ahead<R> {
    pub(super) const fn new(raw: R) -> Self {
        Self {
            raw,
            held: VecDeque::new(),
            at: 0,
        }
    }

    /// Looks at the row `after` rows ahead; returns false, and to the current row, if there is no such row.
    pub(super) fn look(&mut self, after: usize) -> bool {
        self.at = 0;
        while self.held.len() < after {
            if self.held.back().is_some_and(|held| held.next != Ok(true)) {
                return false;
            }
            let copied = |column| match self.raw.cell(column) {
                Cell::Text(bytes) => Copied::Text(bytes.to_vec()),
                Cell::Number(number) => Copied::Number(number),
                Cell::Integer(number) => Copied::Integer(number),
            };
            let malformed = self.raw.malformed();
            let columns = if malformed.is_some() { 0 } else { self.raw.columns().len() };
            self.held.push_back(Held {
                place: self.raw.place(),
                cells: (0..columns).map(copied).collect(),
                malformed,
                next: self.raw.advance(),
            });
        }
        if after > 0 && self.held[after - 1].next != Ok(true) {
            return false;
        }
        self.at = after;
        true
    }

    /// The row looked at, if it is held; otherwise `raw` is at it.
    #[inline]
    fn held(&self) -> Option<&Held> {
        self.held.get(self.at)
    }
}

impl<R: RawRows> RawRows for Ahead<R> {
    fn columns(&self) -> &[String] {
        self.raw.columns()
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.at = 0;
        match self.held.pop_front() {
            Some(held) => held.next,
            None => self.raw.advance(),
        }
    }

    fn place(&self) -> usize {
        self.held().map_or_else(|| self.raw.place(), |held| held.place)
    }

    fn counted(&self) -> &'static str {
        self.raw.counted()
    }

    #[inline]
    fn cell(&self, column: usize) -> Cell<'_> {
        let Some(held) = self.held() else {
            return self.raw.cell(column);
        };
        match held.cells.get(column) {
            Some(Copied::Text(bytes)) => Cell::Text(bytes),
            Some(Copied::Number(number)) => Cell::Number(*number),
            Some(Copied::Integer(number)) => Cell::Integer(*number),
            None => Cell::Text(&[]),
        }
    }

    fn malformed(&self) -> Option<Malformed> {
        match self.held() {
            Some(held) => held.malformed.clone(),
            None => self.raw.malformed(),
        }
    }
}
