//! The discrete transition: Φ and the process noise.

use super::BlockMatrix;
use crate::state::{Layout, Manifold, Slot, Tangent};
use alloc::vec::Vec;
use nalgebra::{SMatrix, SVector};

/// Room for the axes with bounded noise: those of an attitude and of one more vector.
const BOUNDED: usize = 6;

/// Noise of an axis, at most `most` and what lifts its variance to `bound`: `value`, and `per` times the variances of the
/// axes `of`.
#[derive(Clone, Debug)]
struct Bounded {
    axis: u16,
    value: f64,
    per: f64,
    of: core::ops::Range<u16>,
    most: f64,
    bound: f64,
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
    /// Noise added after Φ as far as the variance stays below a bound.
    bounded: Vec<Bounded>,
}

impl Transition {
    /// The identity without noise.
    #[must_use]
    pub fn new(layout: &Layout) -> Self {
        let n = layout.dim();
        Self {
            phi: BlockMatrix::identity(n),
            before: NoiseBlocks::with_room(BEFORE * n),
            after: NoiseBlocks::with_room(AFTER * n),
            bounded: Vec::with_capacity(n.min(BOUNDED)),
        }
    }

    /// Back to the identity without noise; the learnt pattern is kept.
    pub fn reset(&mut self) {
        self.phi.reset();
        self.forget_noise();
    }

    /// The same for a step that most likely writes the blocks that the step before has written: they stay
    /// until [`Transition::finish`] makes those the identity that were not written again.
    pub(crate) fn restart(&mut self) {
        self.phi.restart();
        self.forget_noise();
    }

    fn forget_noise(&mut self) {
        self.before.entries.clear();
        self.after.entries.clear();
        self.bounded.clear();
    }

    /// Sets the block ∂row/∂col of Φ (whole, with its identity on the diagonal).
    #[inline(always)]
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

    /// Adds `variance` to the noise after Φ, per axis of `slot`, but lifts the variance of
    /// the axis to `bound` at most: for an error that is known not to grow for ever.
    pub fn noise_up_to<A, const R: usize>(&mut self, slot: Slot<A>, variance: &SVector<f64, R>, bound: &SVector<f64, R>)
    where
        A: Tangent<R>,
    {
        for k in 0..R {
            self.bounded.push(Bounded {
                axis: (slot.tangent + k) as u16,
                value: variance[k],
                per: 0.0,
                of: 0..0,
                most: variance[k],
                bound: bound[k],
            });
        }
    }

    /// Lowers the bounded noise on axis `k` of `slot` to `per` times the mean square of the first `axes` axes of
    /// `by`. `square` is the mean square of their values; their variances are added. For an error that grows with
    /// an uncertain quantity.
    pub fn noise_in_proportion<A, B>(&mut self, slot: Slot<A>, k: usize, per: f64, square: f64, by: Slot<B>, axes: usize)
    where
        A: Manifold,
        B: Manifold,
    {
        let axis = (slot.tangent + k) as u16;
        if let Some(bounded) = self.bounded.iter_mut().rfind(|b| b.axis == axis) {
            (bounded.value, bounded.per) = (per * square, per);
            bounded.of = by.tangent as u16..(by.tangent + axes) as u16;
        }
    }

    /// A step is written whole.
    #[inline]
    pub(crate) fn finish(&mut self) {
        self.phi.finish();
    }

    /// Turns the bounded noise into noise; `variance` returns the variance of an axis before the step.
    #[inline]
    pub(crate) fn settle(&mut self, variance: impl Fn(usize) -> f64) {
        for b in &self.bounded {
            let (room, of) = ((b.bound - variance(b.axis.into())).max(0.0), b.of.clone());
            let q = b.value + b.per * of.map(|axis| variance(axis.into())).sum::<f64>();
            self.after.entries.push((b.axis, b.axis, q.min(b.most).min(room)));
        }
        self.bounded.clear();
    }

    /// The noise added before Φ, element by element (row, column, value), both triangles; elements may
    /// repeat and then add up.
    pub fn noise_before(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.before.entries.iter().map(|&(i, j, v)| (i.into(), j.into(), v))
    }

    /// The noise added after Φ, in the same form as [`noise_before`](Self::noise_before).
    pub fn noise_after(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.after.entries.iter().map(|&(i, j, v)| (i.into(), j.into(), v))
    }

    /// Adds half of `block` before Φ and half after it: the trapezoidal rule
    /// Q_d = ½(ΦQΦᵀ + Q) for Q = G Q_c Gᵀ Δt.
    pub fn noise_trapezoid<A, B, const R: usize, const C: usize>(&mut self, row: Slot<A>, col: Slot<B>, block: &SMatrix<f64, R, C>)
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        self.before.add(row.tangent, col.tangent, block, 0.5);
        self.after.add(row.tangent, col.tangent, block, 0.5);
    }

    /// As [`noise_trapezoid`](Self::noise_trapezoid), for noise that is independent per axis of `slot`: a diagonal
    /// block.
    #[inline]
    pub fn noise_trapezoid_of_axes<A, const R: usize>(&mut self, slot: Slot<A>, variance: &SVector<f64, R>)
    where
        A: Tangent<R>,
    {
        let half = variance * 0.5;
        self.before.axes(slot.tangent, &half);
        self.after.axes(slot.tangent, &half);
    }
}

/// Elements of noise for each axis, before Φ and after it: a block of three axes has nine. After Φ, the blocks' own
/// dynamics and the growth of a rejected motion are added.
pub(crate) const BEFORE: usize = 2;
const AFTER: usize = 4;

/// Noise as a list of elements of the symmetric Q.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseBlocks {
    pub(crate) entries: Vec<(u16, u16, f64)>,
}

impl NoiseBlocks {
    /// Room for the elements that most processes write: which of them are zero changes from step to step. A process
    /// with more of them takes more memory in its first step.
    fn with_room(elements: usize) -> Self {
        Self {
            entries: Vec::with_capacity(elements),
        }
    }

    #[inline]
    pub(crate) fn element(&mut self, row: usize, col: usize, value: f64) {
        if value != 0.0 {
            self.entries.push((row as u16, col as u16, value));
        }
    }

    #[inline]
    pub(crate) fn diagonal(&mut self, i: usize, value: f64) {
        self.entries.push((i as u16, i as u16, value));
    }

    #[inline]
    fn axes<const R: usize>(&mut self, first: usize, variances: &SVector<f64, R>) {
        let entry = |k: usize| ((first + k) as u16, (first + k) as u16, variances[k]);
        if variances.iter().all(|v| *v != 0.0) {
            self.entries.extend_from_slice(&core::array::from_fn::<_, R, _>(entry));
        } else {
            self.entries.extend((0..R).map(entry).filter(|(.., v)| *v != 0.0));
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::declare;
    use crate::state::{Dynamics, LayoutBuilder, Scalar, Vector};
    use nalgebra::Vector1;

    #[test]
    fn noise_in_proportion_follows_value_and_variance_up_to_its_most_and_its_bound() {
        let mut b = LayoutBuilder::new();
        let heading = declare::<Scalar>(&mut b, "heading", 0.0, &[1.0], Dynamics::Process);
        let velocity = declare::<Vector<2>>(&mut b, "velocity", [0.0; 2].into(), &[1.0; 2], Dynamics::Process);
        let mut transition = Transition::new(&b.finish());
        let mut noise = |square: f64, variances: [f64; 3]| {
            transition.reset();
            transition.noise_up_to(heading, &Vector1::new(3.0), &Vector1::new(10.0));
            transition.noise_in_proportion(heading, 0, 0.5, square, velocity, 2);
            transition.settle(|axis| variances[axis]);
            let told: Vec<_> = transition.noise_after().collect();
            assert_eq!((told.len(), told[0].0, told[0].1), (1, 0, 0));
            told[0].2
        };
        // Halves of whole numbers: exact.
        assert_eq!(noise(0.0, [1.0, 0.0, 0.0]), 0.0);
        assert_eq!(noise(1.0, [1.0, 2.0, 1.0]), 2.0);
        assert_eq!(noise(100.0, [1.0, 0.0, 0.0]), 3.0);
        assert_eq!(noise(0.0, [9.0, 50.0, 0.0]), 1.0);
    }
}
