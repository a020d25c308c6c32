//! The Jacobian of a measurement.

use super::{BlockMatrix, padded};
use crate::state::{Layout, Manifold, Quantity, Signal, Slot, Tangent};
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;
use nalgebra::SMatrix;

/// The Jacobian of a measurement (or of the process's signals), written in blocks.
#[derive(Default)]
pub struct Jacobian {
    rows: usize,
    ld: usize,
    signal_dim: usize,
    h: Vec<f64>,
    by_signal: Vec<f64>,
    columns: Vec<(usize, usize)>,
    signals_used: bool,
}

impl fmt::Debug for Jacobian {
    /// Its size: an event that shows it is written for every measurement.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Jacobian({} rows)", self.rows)
    }
}

impl Clone for Jacobian {
    /// With the room of the original, so that a copy allocates nothing either.
    fn clone(&self) -> Self {
        let mut columns = Vec::with_capacity(self.columns.capacity());
        columns.extend_from_slice(&self.columns);
        Self {
            h: self.h.clone(),
            by_signal: self.by_signal.clone(),
            columns,
            ..*self
        }
    }
}

impl Jacobian {
    /// Room for up to `max_rows` rows over the tangent space of `layout`.
    #[must_use]
    pub fn new(layout: &Layout, max_rows: usize) -> Self {
        let ld = padded(layout.dim());
        let signal_dim = layout.signal_dim();
        Self {
            rows: max_rows,
            ld,
            signal_dim,
            h: vec![0.0; max_rows * ld],
            by_signal: vec![0.0; max_rows * signal_dim],
            // Elements of blocks may be apart.
            columns: Vec::with_capacity(layout.dim()),
            signals_used: false,
        }
    }

    /// Room for that of the signals of `layout`, which depend on the state alone.
    pub(crate) fn of_signals(layout: &Layout) -> Self {
        Self {
            signal_dim: 0,
            by_signal: Vec::new(),
            ..Self::new(layout, layout.signal_dim())
        }
    }

    /// Empties it for a model of `rows` rows (at most what it was made for).
    pub fn reset(&mut self, rows: usize) {
        debug_assert!(rows * self.ld <= self.h.len());
        self.rows = rows;
        self.h[..rows * self.ld].fill(0.0);
        self.by_signal[..rows * self.signal_dim].fill(0.0);
        self.columns.clear();
        self.signals_used = false;
    }

    /// Adds ∂h/∂`quantity`, its first row at `row`: a no-op where the quantity is fixed.
    ///
    /// Rows of `block` beyond the measurement's are left out: a model that uses the first two of
    /// three rows gives the whole block.
    #[inline]
    pub fn add<M, const R: usize, const C: usize>(&mut self, row: usize, quantity: &Quantity<M>, block: &SMatrix<f64, R, C>)
    where
        M: Tangent<C>,
    {
        match quantity {
            Quantity::Fixed(_) => {}
            Quantity::State(slot) => self.add_state(row, slot.tangent, block),
            Quantity::Signal(signal) => self.add_signal(row, signal, block),
        }
    }

    /// Adds ∂h/∂`slot`, its first row at `row`.
    pub fn add_slot<M, const R: usize, const C: usize>(&mut self, row: usize, slot: Slot<M>, block: &SMatrix<f64, R, C>)
    where
        M: Tangent<C>,
    {
        self.add_state(row, slot.tangent, block);
    }

    fn add_signal<M: Manifold, const R: usize, const C: usize>(&mut self, row: usize, signal: &Signal<M>, block: &SMatrix<f64, R, C>) {
        self.signals_used = true;
        for i in 0..R.min(self.rows - row) {
            for j in 0..C {
                self.by_signal[(row + i) * self.signal_dim + signal.tangent + j] += block[(i, j)];
            }
        }
    }

    #[inline]
    fn add_state<const R: usize, const C: usize>(&mut self, row: usize, col: usize, block: &SMatrix<f64, R, C>) {
        self.touch(col, C);
        for i in 0..R.min(self.rows - row) {
            let at = (row + i) * self.ld + col;
            for (j, h) in self.h[at..at + C].iter_mut().enumerate() {
                *h += block[(i, j)];
            }
        }
    }

    pub(crate) fn add_element(&mut self, row: usize, col: usize, value: f64) {
        self.touch(col, 1);
        self.h[row * self.ld + col] += value;
    }

    pub(crate) fn add_signal_element(&mut self, row: usize, col: usize, value: f64) {
        self.signals_used = true;
        self.by_signal[row * self.signal_dim + col] += value;
    }

    fn touch(&mut self, col: usize, len: usize) {
        let end = col + len;
        if !self.columns.iter().any(|&(s, e)| s <= col && end <= e) {
            // Ranges are blocks or elements of blocks: where two meet, one contains the other.
            self.columns.retain(|&(s, e)| !(col <= s && e <= end));
            self.columns.push((col, end));
        }
    }

    /// Covers the columns `start` to `end`, merging what they meet.
    fn cover(&mut self, mut start: usize, mut end: usize) {
        loop {
            let before = self.columns.len();
            self.columns.retain(|&(s, e)| {
                let meets = s <= end && start <= e;
                if meets {
                    (start, end) = (start.min(s), end.max(e));
                }
                !meets
            });
            if self.columns.len() == before {
                break;
            }
        }
        self.columns.push((start, end));
    }

    /// H ← H M, for a complete H; `row` is working memory of a row.
    pub(crate) fn compose(&mut self, map: &BlockMatrix, row: &mut [f64]) {
        let n = row.len();
        for i in 0..self.rows {
            let h = &mut self.h[i * self.ld..i * self.ld + n];
            row.copy_from_slice(h);
            map.apply_transposed(row, h);
        }
        for &k in map.active() {
            if self.columns.iter().any(|&(s, e)| s <= k.into() && usize::from(k) < e) {
                for &(start, end) in map.ranges(k.into()) {
                    self.cover(start.into(), end.into());
                }
            }
        }
    }

    /// Sets a whole row of H.
    pub(crate) fn set_row(&mut self, row: usize, values: &[f64]) {
        self.cover(0, values.len());
        self.h[row * self.ld..row * self.ld + values.len()].copy_from_slice(values);
    }

    /// Takes columns of another H, as far as they were written in this one.
    pub(crate) fn copy_columns(&mut self, columns: Range<usize>, other: &Self) {
        for &(start, end) in &self.columns {
            let (from, to) = (start.max(columns.start), end.min(columns.end));
            for row in (0..self.rows).map(|i| i * self.ld).filter(|_| from < to) {
                self.h[row + from..row + to].copy_from_slice(&other.h[row + from..row + to]);
            }
        }
    }

    /// H ← H − `other`; both are complete and have as many rows.
    pub(crate) fn subtract(&mut self, other: &Self) {
        for &(start, end) in &other.columns {
            self.cover(start, end);
            for row in (0..self.rows).map(|i| i * self.ld) {
                let pairs = self.h[row + start..row + end].iter_mut().zip(&other.h[row + start..row + end]);
                pairs.for_each(|(h, o)| *h -= o);
            }
        }
    }

    /// Whether a signal's Jacobian is needed to complete this one.
    #[must_use]
    pub const fn needs_signals(&self) -> bool {
        self.signals_used
    }

    /// Applies the chain rule: H += ∂h/∂s · ∂s/∂x.
    pub fn chain(&mut self, signals: &Self) {
        if !self.signals_used {
            return;
        }
        for &(start, end) in &signals.columns {
            self.touch(start, end - start);
        }
        for i in 0..self.rows {
            for s in 0..self.signal_dim {
                let factor = self.by_signal[i * self.signal_dim + s];
                if factor == 0.0 {
                    continue;
                }
                for &(start, end) in &signals.columns {
                    for j in start..end {
                        self.h[i * self.ld + j] += factor * signals.h[s * self.ld + j];
                    }
                }
            }
        }
        self.signals_used = false;
    }

    /// Rows in use.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// One element of H.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f64 {
        self.h[row * self.ld + col]
    }

    /// Whether one of these columns of H was written.
    #[must_use]
    pub(crate) fn touches(&self, columns: &Range<usize>) -> bool {
        self.columns.iter().any(|(start, end)| *start < columns.end && columns.start < *end)
    }

    /// Whether a column of H is not zero.
    #[must_use]
    pub fn sees(&self, column: usize) -> bool {
        self.touches(&(column..column + 1)) && (0..self.rows).any(|row| self.get(row, column) != 0.0)
    }

    /// One row of H, padded.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.h[i * self.ld..(i + 1) * self.ld]
    }

    /// Its rows, one after the other, padded.
    pub(crate) fn padded_rows(&self) -> &[f64] {
        &self.h[..self.rows * self.ld]
    }

    /// Ranges of columns that may be non-zero; they do not overlap.
    #[must_use]
    pub fn columns(&self) -> &[(usize, usize)] {
        &self.columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SignalsOut;
    use crate::state::{Dynamics, LayoutBuilder, Position, Scalar, Vector};
    use nalgebra::{Matrix1, Matrix2x3, Matrix3, Vector3};

    fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Slot<M> {
        crate::filter::tests::declare(b, name, initial, &vec![1.0; M::KIND.dim()], Dynamics::Process)
    }

    #[test]
    fn rows_beyond_the_measurement_are_left_out_and_blocks_add_up() {
        let mut b = LayoutBuilder::new();
        let (position, bias) = (
            declare::<Position>(&mut b, "position", Vector3::zeros()),
            declare::<Scalar>(&mut b, "bias", 0.0),
        );
        let mut h = Jacobian::new(&b.finish(), 2);
        h.reset(2);
        for _ in 0..2 {
            h.add(0, &Quantity::State(position), &Matrix3::identity());
        }
        h.add(1, &Quantity::State(bias), &Vector3::new(4.0, 5.0, 6.0));
        h.add(0, &Quantity::<Scalar>::Fixed(1.0), &Matrix1::new(9.0));
        assert_eq!(h.row(0)[..4], [2.0, 0.0, 0.0, 0.0]);
        assert_eq!(h.row(1)[..4], [0.0, 2.0, 0.0, 4.0]);
        assert_eq!(h.columns(), [(0, 3), (3, 4)]);
    }

    #[test]
    fn signals_follow_the_chain_rule() {
        let mut b = LayoutBuilder::new();
        let (position, bias) = (
            declare::<Position>(&mut b, "position", Vector3::zeros()),
            declare::<Scalar>(&mut b, "bias", 0.0),
        );
        let rate = b.signal::<Vector<3>>("rate").unwrap();
        let layout = b.finish();
        let (mut signals, mut values) = (Jacobian::new(&layout, 3), [0.0; 3]);
        signals.reset(3);
        let mut out = SignalsOut::new(&mut values, Some(&mut signals));
        let by_position = Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
        out.add(rate, position, &by_position);
        out.add(rate, bias, &Vector3::new(-1.0, 0.5, 2.0));
        let by_rate = Matrix2x3::new(1.0, 0.0, 2.0, 0.0, -3.0, 1.0);
        let mut h = Jacobian::new(&layout, 2);
        h.reset(2);
        h.add(0, &Quantity::State(bias), &nalgebra::Vector2::new(10.0, 20.0));
        h.add(0, &Quantity::Signal(rate), &by_rate);
        assert!(h.needs_signals());
        h.chain(&signals);
        assert_eq!(h.columns(), [(3, 4), (0, 3)]);
        let (p, s) = (by_rate * by_position, by_rate * Vector3::new(-1.0, 0.5, 2.0));
        for i in 0..2 {
            // Small whole numbers: exact.
            assert_eq!(h.row(i)[..4], [p[(i, 0)], p[(i, 1)], p[(i, 2)], 10.0 * (i + 1) as f64 + s[i]]);
        }
    }
}
