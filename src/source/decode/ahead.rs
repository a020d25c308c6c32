//! The rows of a format, with a look at the one after the row at hand.

use super::raw::{Cell, Malformed, RawRows};
use crate::rows::DataError;

/// Reads one row ahead where it is asked to.
pub(super) struct Ahead<R> {
    raw: R,
    /// A copy of the row at hand, while `raw` is at the one after it.
    held: Option<Held>,
}

struct Held {
    place: usize,
    cells: Vec<Copied>,
    /// What reading the row after it said.
    next: Result<bool, DataError>,
}

enum Copied {
    Text(Vec<u8>),
    Number(f64),
    Integer(i64),
}

impl<R: RawRows> Ahead<R> {
    pub(super) const fn new(raw: R) -> Self {
        Self { raw, held: None }
    }

    /// The row after the one at hand, which is sound; `None` where none can be read.
    pub(super) fn after(&mut self) -> Option<&R> {
        if self.held.is_none() {
            let copied = |column| match self.raw.cell(column) {
                Cell::Text(bytes) => Copied::Text(bytes.to_vec()),
                Cell::Number(number) => Copied::Number(number),
                Cell::Integer(number) => Copied::Integer(number),
            };
            self.held = Some(Held {
                place: self.raw.place(),
                cells: (0..self.raw.columns().len()).map(copied).collect(),
                next: self.raw.advance(),
            });
        }
        let is_there = self.held.as_ref().is_some_and(|held| held.next == Ok(true));
        is_there.then_some(&self.raw)
    }
}

impl<R: RawRows> RawRows for Ahead<R> {
    fn columns(&self) -> &[String] {
        self.raw.columns()
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        match self.held.take() {
            Some(held) => held.next,
            None => self.raw.advance(),
        }
    }

    fn place(&self) -> usize {
        self.held.as_ref().map_or_else(|| self.raw.place(), |held| held.place)
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let Some(held) = &self.held else {
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
        if self.held.is_some() { None } else { self.raw.malformed() }
    }
}
