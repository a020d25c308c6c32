//! Which elements of a square map may differ from the identity.

use super::padded;
use alloc::vec::Vec;
use fusion_kernels::{Plan, Reach};

/// An element of an active row: where its value lies, and its column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    pub(super) at: u32,
    pub(super) column: u16,
}

/// The elements that may differ from the identity, and how the kernels go through them.
#[derive(Clone, Debug)]
pub(crate) struct Pattern {
    /// Per row, the ranges of columns that may differ from the identity.
    rows: Vec<Vec<(u16, u16)>>,
    /// The same for the first 64 columns, a bit each: a block known already costs one test.
    known: Vec<u64>,
    /// Rows that have ranges, in order.
    active: Vec<u16>,
    /// The elements that active rows read, row after row, and where each row ends.
    elements: Vec<Element>,
    ends: Vec<usize>,
    plan: Plan,
    reach: Reach,
    /// `rows` in one list, as it is remembered: row, start, end.
    written: Vec<u8>,
}

impl Pattern {
    /// The pattern of the identity on `n` dimensions.
    pub(super) fn new(n: usize) -> Self {
        let rows = vec![Vec::new(); n];
        Self {
            plan: Plan::new(&rows),
            reach: Reach::new(&rows),
            rows,
            known: vec![0; n],
            active: Vec::new(),
            elements: Vec::new(),
            ends: Vec::new(),
            written: Vec::new(),
        }
    }

    /// Whether one test finds that the columns from `col` on may differ in `row`.
    #[inline]
    pub(super) fn knows(&self, row: usize, col: usize, len: usize) -> bool {
        col + len <= 64 && {
            let bits = (u64::MAX >> (64 - len)) << col;
            self.known[row] & bits == bits
        }
    }

    /// Whether the columns from `col` on may differ in `row`.
    pub(super) fn has(&self, row: usize, col: usize, len: usize) -> bool {
        let (start, end) = (col as u16, (col + len) as u16);
        self.rows[row].iter().any(|&(s, e)| s <= start && end <= e)
    }

    /// In each of these rows, the columns from a start to an end may differ. All are learnt together: each time, the plans
    /// are made anew.
    pub(super) fn learn(&mut self, more: impl IntoIterator<Item = [u16; 3]>) {
        for [row, start, end] in more {
            self.add(row.into(), start, end);
        }
        self.list();
        self.plan = Plan::new(&self.rows);
        self.reach = Reach::new(&self.rows);
    }

    fn add(&mut self, row: usize, start: u16, end: u16) {
        let ranges = &mut self.rows[row];
        let place = ranges.partition_point(|range| *range < (start, end));
        ranges.insert(place, (start, end));
        // Merge neighbours and overlaps: one pass of contiguous columns per run.
        let mut merged: Vec<(u16, u16)> = Vec::with_capacity(ranges.len());
        for &(s, e) in ranges.iter() {
            match merged.last_mut() {
                Some(last) if s <= last.1 => last.1 = last.1.max(e),
                _ => merged.push((s, e)),
            }
        }
        *ranges = merged;
        (start..end.min(64)).for_each(|k| self.known[row] |= 1 << k);
    }

    /// Lists the rows that have ranges, and their elements.
    fn list(&mut self) {
        let n = self.rows.len();
        self.active = (0..n as u16).filter(|&i| !self.rows[usize::from(i)].is_empty()).collect();
        let ranges = || self.rows.iter().flatten();
        // Lists as long as they have to be: a pattern is learnt once.
        self.elements = Vec::with_capacity(ranges().map(|(start, end)| usize::from(end - start)).sum::<usize>() + self.active.len());
        self.ends = Vec::with_capacity(self.active.len());
        self.written = Vec::with_capacity(6 * ranges().count());
        for &i in &self.active {
            let ranges = &self.rows[usize::from(i)];
            let listed = ranges.iter().flat_map(|&(start, end)| start..end);
            // The diagonal element of the identity comes last if it is not in a range.
            let own = (!ranges.iter().any(|&(start, end)| start <= i && i < end)).then_some(i);
            let element = |column: u16| Element {
                at: u32::from(column) * padded(n) as u32 + u32::from(i),
                column,
            };
            self.elements.extend(listed.chain(own).map(element));
            self.ends.push(self.elements.len());
            let numbers = ranges.iter().flat_map(|&(start, end)| [i, start, end]);
            self.written.extend(numbers.flat_map(u16::to_le_bytes));
        }
    }

    /// The ranges of columns that row `i` may read in addition to the identity.
    pub(super) fn ranges(&self, i: usize) -> &[(u16, u16)] {
        &self.rows[i]
    }

    /// Rows that have ranges, in order.
    pub(super) fn active(&self) -> &[u16] {
        &self.active
    }

    /// Rows that have ranges, each with the elements that it reads.
    pub(super) fn rows(&self) -> impl Iterator<Item = (&u16, &[Element])> {
        let mut start = 0;
        self.active.iter().zip(&self.ends).map(move |(i, &end)| {
            let row = &self.elements[start..end];
            start = end;
            (i, row)
        })
    }

    /// All elements, row after row.
    pub(super) fn elements(&self) -> &[Element] {
        &self.elements
    }

    pub(super) const fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(super) const fn reach(&self) -> &Reach {
        &self.reach
    }

    /// The ranges as they are remembered.
    pub(super) fn written(&self) -> &[u8] {
        &self.written
    }
}
