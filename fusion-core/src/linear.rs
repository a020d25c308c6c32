//! Sparse linear maps on the tangent space: Φ, chart changes, Jacobians H.
//!
//! Models write small dense blocks; the pattern of blocks is learnt from what they write and
//! then stays, so that later calls allocate nothing and the kernels touch only what is there.

use crate::state::{Layout, Manifold, Quantity, Signal, Slot, Tangent};
use nalgebra::{SMatrix, SVector};

/// Row length of a padded matrix of `n` columns: the next multiple of 8 doubles.
#[must_use]
pub const fn padded(n: usize) -> usize {
    n.div_ceil(8) * 8
}

/// A square block-sparse map, identity where nothing is written.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    n: usize,
    ld: usize,
    data: Vec<f64>,
    /// Per row, the ranges of columns that may be non-zero besides the identity.
    rows: Vec<Vec<(u16, u16)>>,
    /// The same for the first 64 columns, a bit each: a block known already costs one test.
    known: Vec<u64>,
    /// Rows that have ranges, and those that have none, in order.
    active: Vec<u16>,
    rest: Vec<u16>,
    /// Columns that active rows read, in order.
    columns: Vec<u16>,
    /// What active rows read, row after row, and where each row ends.
    elements: Vec<Element>,
    ends: Vec<usize>,
}

/// An element of an active row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    at: u32,
    /// Where the row of its column starts in a padded matrix.
    pub(crate) padded: u32,
    /// The same in a matrix of [`BlockMatrix::columns`] rows, as wide as there are active rows,
    /// evenly.
    pub(crate) compact: u32,
}

impl Element {
    /// Its column, of a matrix whose padded rows are as long as those it was made for.
    const fn column(&self, ld: usize) -> usize {
        self.padded as usize / ld
    }
}

impl BlockMatrix {
    /// out ← M v.
    pub(crate) fn apply(&self, v: &[f64], out: &mut [f64]) {
        out.copy_from_slice(v);
        for (&i, elements) in self.active.iter().zip(self.elements()) {
            out[usize::from(i)] = elements.iter().map(|e| self.value(e) * v[e.column(self.ld)]).sum();
        }
    }

    /// The identity on `n` dimensions.
    #[must_use]
    pub fn identity(n: usize) -> Self {
        let ld = padded(n);
        let mut m = Self {
            n,
            ld,
            data: vec![0.0; n * ld],
            rows: vec![Vec::new(); n],
            known: vec![0; n],
            active: Vec::new(),
            rest: (0..n as u16).collect(),
            columns: Vec::new(),
            elements: Vec::new(),
            ends: Vec::new(),
        };
        m.reset();
        // Rows without ranges are never written: their ones stay.
        (0..n).for_each(|i| m.data[i * ld + i] = 1.0);
        m
    }

    /// Dimension.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.n
    }

    /// Back to the identity, the learnt pattern kept.
    pub fn reset(&mut self) {
        for element in &self.elements {
            self.data[element.at as usize] = 0.0;
        }
        for &i in &self.active {
            self.data[i as usize * (self.ld + 1)] = 1.0;
        }
    }

    /// Sets the block at (`row`, `col`), identity included: a diagonal block of I + FΔt is given
    /// whole.
    pub fn set<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.set_at(row.tangent, col.tangent, block);
    }

    /// Sets the block whose first element is at (`row`, `col`) of the tangent space.
    pub(crate) fn set_at<const R: usize, const C: usize>(&mut self, row: usize, col: usize, block: &SMatrix<f64, R, C>) {
        for i in 0..R {
            self.mark(row + i, col, C);
            let at = (row + i) * self.ld + col;
            for (j, out) in self.data[at..at + C].iter_mut().enumerate() {
                *out = block[(i, j)];
            }
        }
    }

    /// Sets a whole row.
    pub(crate) fn set_row(&mut self, row: usize, values: &[f64]) {
        self.mark(row, 0, values.len());
        self.data[row * self.ld..row * self.ld + values.len()].copy_from_slice(values);
    }

    /// Sets one element.
    pub(crate) fn set_element(&mut self, row: usize, col: usize, value: f64) {
        self.mark(row, col, 1);
        self.data[row * self.ld + col] = value;
    }

    #[inline]
    fn mark(&mut self, row: usize, col: usize, len: usize) {
        let known = col + len <= 64 && {
            let bits = (u64::MAX >> (64 - len)) << col;
            self.known[row] & bits == bits
        };
        if !known {
            self.learn(row, col, len);
        }
    }

    #[cold]
    fn learn(&mut self, row: usize, col: usize, len: usize) {
        let ranges = &mut self.rows[row];
        let (start, end) = (col as u16, (col + len) as u16);
        if ranges.iter().any(|&(s, e)| s <= start && end <= e) {
            return;
        }
        ranges.push((start, end));
        ranges.sort_unstable();
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
        let is_active = |i: &u16| !self.rows[*i as usize].is_empty();
        (self.active, self.rest) = (0..self.n as u16).partition(is_active);
        let lists = |i: u16, k: u16| self.rows[i as usize].iter().any(|&(s, e)| s <= k && k < e);
        self.columns = (0..self.n as u16)
            .filter(|&k| self.active.iter().any(|&i| i == k || lists(i, k)))
            .collect();
        self.elements.clear();
        self.ends.clear();
        let (ld, width) = (self.ld as u32, self.active.len().next_multiple_of(2));
        for &i in &self.active {
            let listed = self.columns.iter().enumerate().filter(|&(_, &k)| lists(i, k));
            // The one of the identity comes last where it is not in a range.
            let own = self.columns.iter().enumerate().filter(|&(_, &k)| k == i && !lists(i, i));
            let element = |(place, &k): (usize, &u16)| Element {
                at: u32::from(i) * ld + u32::from(k),
                padded: u32::from(k) * ld,
                compact: (place * width) as u32,
            };
            self.elements.extend(listed.chain(own).map(element));
            self.ends.push(self.elements.len());
        }
    }

    /// One element.
    #[must_use]
    pub fn get(&self, row: usize, col: usize) -> f64 {
        self.data[row * self.ld + col]
    }

    #[cfg(test)]
    pub(crate) fn row(&self, i: usize) -> (&[f64], &[(u16, u16)]) {
        (&self.data[i * self.ld..(i + 1) * self.ld], &self.rows[i])
    }

    /// The elements that differ from those of the identity: row, column, and by how much.
    pub(crate) fn changes(&self) -> impl Iterator<Item = (u16, u16, f64)> {
        let rows = self.active.iter().zip(self.elements());
        rows.flat_map(move |(&i, elements)| {
            elements.iter().filter_map(move |element| {
                let column = (element.at as usize - usize::from(i) * self.ld) as u16;
                let change = self.value(element) - f64::from(u8::from(column == i));
                (change != 0.0).then_some((i, column, change))
            })
        })
    }

    /// The active rows of M x into `out`, of an `x` that is zero from `end` on.
    pub(crate) fn active_rows(&self, x: &[f64], end: usize, out: &mut [f64]) {
        for &i in &self.active {
            let i = usize::from(i);
            let (row, mut sum, mut own) = (&self.data[i * self.ld..], 0.0, x[i]);
            for &(s, e) in &self.rows[i] {
                let (s, e) = (usize::from(s), usize::from(e));
                if s <= i && i < e {
                    own = 0.0;
                }
                let e = e.min(end).max(s);
                sum += dot(&row[s..e], &x[s..e]);
            }
            out[i] = sum + own;
        }
    }

    /// Rows that may differ from the identity, in order.
    pub(crate) fn active(&self) -> &[u16] {
        &self.active
    }

    /// Rows of the identity, in order.
    pub(crate) fn rest(&self) -> &[u16] {
        &self.rest
    }

    /// Columns that active rows read, in order.
    pub(crate) fn columns(&self) -> &[u16] {
        &self.columns
    }

    /// What active rows read, row by row.
    pub(crate) fn elements(&self) -> impl Iterator<Item = &[Element]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let row = &self.elements[start..end];
            start = end;
            row
        })
    }

    /// The value of an element.
    pub(crate) fn value(&self, element: &Element) -> f64 {
        self.data[element.at as usize]
    }
}

/// a·b, four products at a time.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// The discrete transition over one step: Φ and the process noise, in the canonical chart.
#[derive(Clone, Debug)]
pub struct Transition {
    /// Φ = ∂(x⁺ ⊟ x̂⁺)/∂(x ⊟ x̂).
    pub phi: BlockMatrix,
    /// Noise added before Φ: P⁺ = Φ(P + Q_before)Φᵀ + Q_after.
    pub(crate) before: NoiseBlocks,
    /// Noise added after Φ.
    pub(crate) after: NoiseBlocks,
    /// Noise added after Φ as far as the variance stays below a bound: axis, variance, bound.
    bounded: Vec<(u16, f64, f64)>,
}

impl Transition {
    /// The identity without noise.
    #[must_use]
    pub fn new(layout: &Layout) -> Self {
        let n = layout.dim();
        Self {
            phi: BlockMatrix::identity(n),
            before: NoiseBlocks::with_room(n),
            after: NoiseBlocks::with_room(n),
            bounded: Vec::with_capacity(n),
        }
    }

    /// Back to the identity without noise; the learnt pattern is kept.
    pub fn reset(&mut self) {
        self.phi.reset();
        self.before.entries.clear();
        self.after.entries.clear();
        self.bounded.clear();
    }

    /// Sets the block ∂row/∂col of Φ (whole, with its identity on the diagonal).
    pub fn set<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.phi.set(row, col, block);
    }

    /// Adds `block` to the discrete process noise at (`row`, `col`), both triangles, after Φ.
    pub fn noise<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.after.add(row.tangent, col.tangent, block, 1.0);
    }

    /// Adds `variance` to the noise after Φ, per axis of `slot`, but no more than lifts the variance of
    /// the axis to `bound`: for an error that is known not to grow for ever.
    pub fn noise_up_to<A, const R: usize>(&mut self, slot: Slot<A>, variance: &SVector<f64, R>, bound: &SVector<f64, R>)
    where
        A: Tangent<R>,
    {
        for k in 0..R {
            self.bounded.push(((slot.tangent + k) as u16, variance[k], bound[k]));
        }
    }

    /// Turns the bounded noise into noise; `variance` tells that of an axis before the step.
    pub(crate) fn settle(&mut self, variance: impl Fn(usize) -> f64) {
        for &(axis, q, bound) in &self.bounded {
            let room = (bound - variance(axis.into())).max(0.0);
            self.after.entries.push((axis, axis, q.min(room)));
        }
        self.bounded.clear();
    }

    /// The noise added before Φ, element by element (row, column, value), both triangles; elements may
    /// repeat and then add up.
    pub fn noise_before(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.before.entries.iter().map(|&(i, j, v)| (i.into(), j.into(), v))
    }

    /// The same of the noise added after Φ.
    pub fn noise_after(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.after.entries.iter().map(|&(i, j, v)| (i.into(), j.into(), v))
    }

    /// Adds half of `block` before Φ and half after it: the trapezoidal rule
    /// Q_d = ½(ΦQΦᵀ + Q) for Q = G Q_c Gᵀ Δt (spec: ½(ΦGQ_cGᵀΦᵀ + GQ_cGᵀ)Δt).
    pub fn noise_trapezoid<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.before.add(row.tangent, col.tangent, block, 0.5);
        self.after.add(row.tangent, col.tangent, block, 0.5);
    }
}

/// Noise as a list of elements of the symmetric Q.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseBlocks {
    pub(crate) entries: Vec<(u16, u16, f64)>,
}

impl NoiseBlocks {
    /// Room for a full Q of dimension `n`: which of its elements are zero changes from step to step.
    fn with_room(n: usize) -> Self {
        Self {
            entries: Vec::with_capacity(n * n),
        }
    }

    pub(crate) fn element(&mut self, row: usize, col: usize, value: f64) {
        if value != 0.0 {
            self.entries.push((row as u16, col as u16, value));
        }
    }

    pub(crate) fn diagonal(&mut self, i: usize, value: f64) {
        self.entries.push((i as u16, i as u16, value));
    }

    fn add<const R: usize, const C: usize>(&mut self, row: usize, col: usize, block: &SMatrix<f64, R, C>, scale: f64) {
        for i in 0..R {
            for j in 0..C {
                let value = block[(i, j)] * scale;
                if value != 0.0 {
                    self.entries.push(((row + i) as u16, (col + j) as u16, value));
                    if row != col {
                        self.entries.push(((col + j) as u16, (row + i) as u16, value));
                    }
                }
            }
        }
    }
}

/// The Jacobian of a measurement (or of the process's signals), written in blocks.
#[derive(Debug)]
pub struct Jacobian {
    rows: usize,
    ld: usize,
    signal_dim: usize,
    h: Vec<f64>,
    by_signal: Vec<f64>,
    columns: Vec<(usize, usize)>,
    signals_used: bool,
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
            columns: Vec::with_capacity(layout.blocks().len()),
            signals_used: false,
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

    fn add_state<const R: usize, const C: usize>(&mut self, row: usize, col: usize, block: &SMatrix<f64, R, C>) {
        self.touch(col, C);
        for i in 0..R.min(self.rows - row) {
            let at = (row + i) * self.ld + col;
            for j in 0..C {
                self.h[at + j] += block[(i, j)];
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
            for &k in map.active() {
                h[usize::from(k)] = 0.0;
            }
            for (&k, elements) in map.active().iter().zip(map.elements()) {
                let factor = row[usize::from(k)];
                for element in elements {
                    h[element.column(map.ld)] += factor * map.value(element);
                }
            }
        }
        for &k in map.active() {
            if self.columns.iter().any(|&(s, e)| s <= k.into() && usize::from(k) < e) {
                for &(start, end) in &map.rows[usize::from(k)] {
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

    /// One row of H, padded.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.h[i * self.ld..(i + 1) * self.ld]
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
    use crate::state::{Declaration, Dynamics, LayoutBuilder, Position, Scalar, StateRole, Vector};
    use nalgebra::{Matrix1, Matrix2x3, Matrix3, Vector3};

    fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Slot<M> {
        let (name, owner, sigma) = (name.to_owned(), String::new(), vec![1.0; M::KIND.dim()]);
        b.declare::<M>(Declaration {
            name,
            owner,
            unit: "",
            initial,
            sigma,
            role: StateRole::Kinematic,
            dynamics: Dynamics::Process,
        })
        .unwrap()
    }

    #[test]
    fn a_reset_map_is_the_identity_and_keeps_its_pattern() {
        let mut m = BlockMatrix::identity(6);
        m.set_at(0, 3, &Matrix3::from_element(2.0));
        m.set_at(3, 3, &Matrix3::from_element(5.0));
        m.set_element(5, 0, 7.0);
        let pattern = m.row(5).1.to_vec();
        assert_eq!(pattern, [(0, 1), (3, 6)]);
        m.reset();
        for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
            assert_eq!(m.get(i, j), f64::from(u8::from(i == j)));
        }
        assert_eq!(m.row(5).1, pattern);
    }

    #[test]
    fn products_read_what_was_set_and_the_ones_of_those_rows_and_nothing_else() {
        let mut m = BlockMatrix::identity(6);
        m.set_at(0, 3, &Matrix2x3::from_element(2.0));
        m.set_element(5, 0, 7.0);
        assert_eq!((m.active(), m.columns()), (&[0, 1, 5][..], &[0, 1, 3, 4, 5][..]));
        let place = |e: &Element| (e.at as usize / m.ld, e.at as usize % m.ld);
        let read: Vec<Vec<_>> = m.elements().map(|row| row.iter().map(place).collect()).collect();
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
        assert_eq!(m.row(0).1, [(0, 4)]);
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
