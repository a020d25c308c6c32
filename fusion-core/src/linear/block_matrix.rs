//! A square block-sparse map: Φ, and changes of chart.

use super::padded;
use super::pattern::{Element, Pattern};
use crate::memory::{Memory, Tape};
use crate::state::{Slot, Tangent};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;
use fusion_kernels::{Lines, Plan, Reach};
use nalgebra::SMatrix;

/// A square block-sparse map, identity where nothing is written.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    n: usize,
    ld: usize,
    /// Its transpose, row by row: the kernels read Φ along columns.
    data: Lines,
    /// Shared by all copies until one of them learns more: most copies are records of a step.
    pattern: Arc<Pattern>,
    /// The blocks that a step writes.
    script: Script,
}

/// The blocks that a step writes, in order. A step that writes the same blocks as the step before need not
/// restore zeros, nor look up the pattern.
#[derive(Clone, Debug, Default)]
struct Script {
    blocks: Vec<Written>,
    /// How many of them are written in this step; the others hold what the step before wrote.
    done: usize,
    is_kept: bool,
}

/// A block that was written: its row and column, its rows and columns, 16 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Written(u64);

impl Written {
    #[inline(always)]
    const fn new(row: usize, column: usize, rows: usize, columns: usize) -> Self {
        Self(row as u64 | (column as u64) << 16 | (rows as u64) << 32 | (columns as u64) << 48)
    }

    fn rows(self) -> Range<usize> {
        let first = self.0 as u16;
        first.into()..(first + (self.0 >> 32) as u16).into()
    }

    fn columns(self) -> Range<usize> {
        let first = (self.0 >> 16) as u16;
        first.into()..(first + (self.0 >> 48) as u16).into()
    }

    fn elements(self) -> impl Iterator<Item = (usize, usize)> {
        self.rows().flat_map(move |i| self.columns().map(move |j| (i, j)))
    }
}

/// The memory of a map between two steps is its pattern. Sums run along the pattern, so it decides the
/// last bit.
impl Memory for BlockMatrix {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let Some(read) = tape.blob(self.pattern.written()) else { return };
        if read == self.pattern.written() {
            return;
        }
        let (numbers, rest) = read.as_chunks::<2>();
        let numbers: Vec<u16> = numbers.iter().map(|n| u16::from_le_bytes(*n)).collect();
        let (blocks, more) = numbers.as_chunks::<3>();
        let fits = |[row, start, end]: &[u16; 3]| start < end && usize::from(*row.max(&(end - 1))) < self.n;
        if rest.is_empty() && more.is_empty() && blocks.iter().all(fits) {
            self.relearn(blocks);
        } else {
            tape.refuse("a matrix is smaller than its pattern");
        }
    }
}

impl BlockMatrix {
    /// out ← M v.
    pub(crate) fn apply(&self, v: &[f64], out: &mut [f64]) {
        out.copy_from_slice(v);
        for (&i, elements) in self.pattern.rows() {
            out[usize::from(i)] = elements.iter().map(|e| self.value(e) * v[usize::from(e.column)]).sum();
        }
    }

    /// out ← Mᵀ v.
    pub(super) fn apply_transposed(&self, v: &[f64], out: &mut [f64]) {
        out.copy_from_slice(v);
        for &k in self.active() {
            out[usize::from(k)] = 0.0;
        }
        for (&k, elements) in self.pattern.rows() {
            let factor = v[usize::from(k)];
            for element in elements {
                out[usize::from(element.column)] += factor * self.value(element);
            }
        }
    }

    /// The identity on `n` dimensions.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let ld = padded(n);
        let mut m = Self {
            n,
            ld,
            data: Lines::zeros(n * ld),
            pattern: Arc::new(Pattern::new(n)),
            script: Script::default(),
        };
        m.reset();
        // Rows without ranges are never written: their ones stay.
        (0..n).for_each(|i| m.data[i * ld + i] = 1.0);
        m
    }

    /// Its pattern, for a map that [takes turns](Self::exchange) with this one.
    pub(crate) fn pattern(&self) -> Arc<Pattern> {
        Arc::clone(&self.pattern)
    }

    /// Becomes the identity, and exchanges its pattern: two maps that are never used together have one memory.
    pub(crate) fn exchange(&mut self, pattern: &mut Arc<Pattern>) {
        self.reset();
        core::mem::swap(&mut self.pattern, pattern);
    }

    /// Dimension.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.n
    }

    /// Back to the identity, the learnt pattern kept.
    pub fn reset(&mut self) {
        self.script.is_kept = false;
        self.script.blocks.clear();
        for element in self.pattern.elements() {
            self.data[element.at as usize] = 0.0;
        }
        for &i in self.pattern.active() {
            self.data[i as usize * (self.ld + 1)] = 1.0;
        }
    }

    /// The same for a step that most likely writes the blocks of the step before. Until
    /// [`BlockMatrix::finish`], the blocks keep their old values.
    pub(crate) fn restart(&mut self) {
        if !self.script.is_kept {
            self.reset();
            self.script.is_kept = true;
        }
        self.script.done = 0;
    }

    /// The step is written: all other blocks return to the identity.
    #[inline]
    pub(crate) fn finish(&mut self) {
        if self.script.done < self.script.blocks.len() {
            self.forget_unwritten();
        }
    }

    /// Sets the block at (`row`, `col`), identity included: a diagonal block of I + FΔt is given
    /// whole.
    #[inline(always)]
    pub fn set<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.set_at(row.tangent, col.tangent, block);
    }

    /// Sets the block whose first element is at (`row`, `col`) of the tangent space.
    #[cfg_attr(not(target_pointer_width = "32"), inline(always))]
    pub(crate) fn set_at<const R: usize, const C: usize>(&mut self, row: usize, col: usize, block: &SMatrix<f64, R, C>) {
        self.announce(Written::new(row, col, R, C));
        self.data.put(col * self.ld + row, self.ld, &block.data.0);
    }

    /// Sets a whole row.
    pub(crate) fn set_row(&mut self, row: usize, values: &[f64]) {
        self.announce(Written::new(row, 0, 1, values.len()));
        for (k, value) in values.iter().enumerate() {
            self.data[k * self.ld + row] = *value;
        }
    }

    /// Sets one element.
    #[inline]
    pub(crate) fn set_element(&mut self, row: usize, col: usize, value: f64) {
        self.announce(Written::new(row, col, 1, 1));
        self.data[col * self.ld + row] = value;
    }

    /// A block will be written.
    #[inline(always)]
    fn announce(&mut self, block: Written) {
        // Where no script is kept there is no block in it.
        if self.script.blocks.get(self.script.done) != Some(&block) {
            return self.depart(block);
        }
        self.script.done += 1;
    }

    /// A block that the step before has not written, or not as this one in order.
    #[cold]
    #[inline(never)]
    fn depart(&mut self, block: Written) {
        if self.script.is_kept {
            self.forget_unwritten();
            self.script.blocks.push(block);
            self.script.done += 1;
        }
        let columns = block.columns();
        let is_known = |i| {
            let (pattern, start, len) = (&self.pattern, columns.start, columns.len());
            pattern.knows(i, start, len) || pattern.has(i, start, len)
        };
        if !block.rows().all(is_known) {
            let row = |i: usize| [i as u16, columns.start as u16, columns.end as u16];
            Arc::make_mut(&mut self.pattern).learn(block.rows().map(row));
        }
    }

    /// Makes those blocks of the script the identity again that this step has not written.
    #[cold]
    fn forget_unwritten(&mut self) {
        let (written, others) = self.script.blocks.split_at(self.script.done);
        for (i, j) in others.iter().flat_map(|block| block.elements()) {
            if !written
                .iter()
                .any(|block| block.rows().contains(&i) && block.columns().contains(&j))
            {
                self.data[j * self.ld + i] = f64::from(u8::from(i == j));
            }
        }
        self.script.blocks.truncate(self.script.done);
    }

    /// The identity, with this pattern and no other.
    fn relearn(&mut self, pattern: &[[u16; 3]]) {
        *self = Self::identity(self.n);
        Arc::make_mut(&mut self.pattern).learn(pattern.iter().copied());
    }

    /// One element.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f64 {
        self.data[col * self.ld + row]
    }

    /// The ranges of columns that row `i` may read in addition to the identity.
    pub(crate) fn ranges(&self, i: usize) -> &[(u16, u16)] {
        self.pattern.ranges(i)
    }

    /// The elements that differ from the identity: row, column, difference.
    pub fn changes(&self) -> impl Iterator<Item = (u16, u16, f64)> {
        let rows = self.pattern.rows();
        rows.flat_map(move |(&i, elements)| {
            elements.iter().filter_map(move |element| {
                let change = self.value(element) - f64::from(u8::from(element.column == i));
                (change != 0.0).then_some((i, element.column, change))
            })
        })
    }

    /// Rows that may differ from the identity, in order.
    pub(crate) fn active(&self) -> &[u16] {
        self.pattern.active()
    }

    /// Its transpose in padded rows, and how the kernels go through it.
    pub(crate) fn transposed(&self) -> (&[f64], &Plan) {
        (&self.data, self.pattern.plan())
    }

    /// The same, and how the kernels go through it with a factor.
    pub(crate) fn reached(&self) -> (&[f64], &Reach) {
        (&self.data, self.pattern.reach())
    }

    /// The value of an element.
    fn value(&self, element: &Element) -> f64 {
        self.data[element.at as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Matrix2x3, Matrix3};

    #[test]
    fn a_reset_map_is_the_identity_and_keeps_its_pattern() {
        let mut m = BlockMatrix::identity(6);
        m.set_at(0, 3, &Matrix3::from_element(2.0));
        m.set_at(3, 3, &Matrix3::from_element(5.0));
        m.set_element(5, 0, 7.0);
        let pattern = m.ranges(5).to_vec();
        assert_eq!(pattern, [(0, 1), (3, 6)]);
        m.reset();
        for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
            assert_eq!(m.get(i, j), f64::from(u8::from(i == j)));
        }
        assert_eq!(m.ranges(5), pattern);
    }

    #[test]
    fn a_step_that_writes_other_blocks_than_the_one_before_leaves_nothing_of_it() {
        let steps: [&[(usize, usize)]; 9] = [
            &[(0, 0), (0, 3)],
            &[(0, 0), (0, 3)],
            &[(0, 3)],
            &[(0, 0), (1, 1), (3, 3)],
            &[(0, 0), (3, 3)],
            &[(3, 3), (0, 0), (2, 1)],
            &[(2, 1), (0, 0)],
            &[],
            &[(0, 0), (0, 3)],
        ];
        let mut m = BlockMatrix::identity(6);
        for (number, step) in steps.into_iter().enumerate() {
            let mut fresh = BlockMatrix::identity(6);
            m.restart();
            for (k, &(i, j)) in step.iter().enumerate() {
                let block = Matrix3::from_element((10 * number + k) as f64 + 2.0);
                m.set_at(i, j, &block);
                fresh.set_at(i, j, &block);
            }
            m.finish();
            for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
                assert_eq!(m.get(i, j), fresh.get(i, j), "step {number}, element ({i}, {j})");
            }
        }
    }

    #[test]
    fn products_read_what_was_set_and_the_ones_of_those_rows_and_nothing_else() {
        let mut m = BlockMatrix::identity(6);
        m.set_at(0, 3, &Matrix2x3::from_element(2.0));
        m.set_element(5, 0, 7.0);
        assert_eq!(m.active(), [0, 1, 5]);
        let place = |e: &Element| {
            assert_eq!(usize::from(e.column), e.at as usize / m.ld);
            (e.at as usize % m.ld, e.at as usize / m.ld)
        };
        let read: Vec<Vec<_>> = m.pattern.rows().map(|(_, row)| row.iter().map(place).collect()).collect();
        let wanted = [
            &[(0, 3), (0, 4), (0, 5), (0, 0)][..],
            &[(1, 3), (1, 4), (1, 5), (1, 1)],
            &[(5, 0), (5, 5)],
        ];
        assert_eq!(read, wanted);
    }

    #[test]
    fn touching_ranges_merge_into_one() {
        let mut m = BlockMatrix::identity(8);
        m.set_at(0, 3, &Matrix1::new(1.0));
        m.set_at(0, 0, &Matrix1::new(1.0));
        m.set_at(0, 1, &nalgebra::RowVector2::new(1.0, 1.0));
        assert_eq!(m.ranges(0), [(0, 4)]);
    }
}
