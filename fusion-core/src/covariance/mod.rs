//! The covariance, behind one seam.
//!
//! [`Covariance`] is a value: the numbers of P in the way its [`Form`] stores them. The estimator
//! predicts, projects and conditions it; everyone else reads and writes it by blocks of the
//! layout. Nothing outside a form knows how P is stored, so that a factored form needs no change
//! elsewhere.
//!
//! Letters: P covariance (n×n), Φ transition (n×n), Q process noise, H Jacobian (m×n),
//! S innovation covariance (m×m), K gain (n×m), R measurement noise (m×m).

mod array;
mod dense;
#[cfg(feature = "faer")]
mod faer;
mod form;
mod solve;
mod square_root;
mod udu;
mod upper;

use crate::math;
use alloc::vec::Vec;
pub(crate) use dense::axpy;
pub use dense::{Joseph, Standard};
pub use form::{Form, Workspace};
pub use fusion_kernels::{Kernel, Lines};
pub use solve::{cholesky, solve_lower, solve_rows};
pub use square_root::SquareRoot;
pub use udu::Udu;

use crate::custom::Custom;
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use crate::memory::{Memory, Tape};
use crate::state::{Block, Slot, Tangent};
use alloc::sync::Arc;
use core::ops::Range;
use nalgebra::SMatrix;

/// The forms that this crate has, and those of other crates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum FormKind {
    /// (I − KH)P(I − KH)ᵀ + KRKᵀ: positive for any gain.
    #[default]
    Joseph,
    /// (I − KH)P, the textbook form: exact for the optimal gain only.
    Standard,
    /// U D Uᵀ, by Bierman and Thornton: positive by construction, without square roots.
    Udu,
    /// S Sᵀ, by orthogonal transformations: positive by construction.
    SquareRoot,
    /// A form of another crate.
    Custom(&'static Custom<dyn Form>),
}

impl FormKind {
    const ALL: [Self; 4] = [Self::Joseph, Self::Standard, Self::Udu, Self::SquareRoot];

    /// The form of that name, if it is one of this crate.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.form().name() == name)
    }

    /// The form itself.
    #[must_use]
    pub fn form(self) -> Arc<dyn Form> {
        match self {
            Self::Joseph => Arc::new(Joseph),
            Self::Standard => Arc::new(Standard),
            Self::Udu => Arc::new(Udu),
            Self::SquareRoot => Arc::new(SquareRoot::default()),
            Self::Custom(custom) => (custom.make)(),
        }
    }
}

/// The covariance of the error of a belief, n×n, in the canonical chart.
#[derive(Clone, Debug)]
pub struct Covariance {
    n: usize,
    p: Lines,
    form: Arc<dyn Form>,
}

/// Equal where stored alike: the same form, the same bits.
impl PartialEq for Covariance {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.n == other.n && self.form.name() == other.form.name() && self.p.iter().zip(other.p.iter()).all(same)
    }
}

impl Memory for Covariance {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(&mut self.p);
    }
}

impl Covariance {
    /// The zero covariance of dimension `n`, stored in `form`.
    #[must_use]
    pub fn zeros(n: usize, form: Arc<dyn Form>) -> Self {
        Self {
            n,
            p: Lines::zeros(form.storage(n)),
            form,
        }
    }

    /// The same covariance, stored in `form`.
    #[must_use]
    pub fn stored_in(self, form: &Arc<dyn Form>) -> Self {
        if self.form.name() == form.name() {
            return self;
        }
        let mut other = Self::zeros(self.n, form.clone());
        other.set_whole(&self.to_dense());
        other
    }

    /// Dimension n.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.n
    }

    /// How it is stored.
    #[must_use]
    pub fn form(&self) -> &Arc<dyn Form> {
        &self.form
    }

    /// Variance of each axis of `block`, in its unit squared; as it is stored, even if it is negative.
    pub fn variances<'a>(&'a self, block: &Block) -> impl Iterator<Item = f64> + 'a {
        block.tangent_range().map(|i| self.form.element(self.n, &self.p, i, i))
    }

    /// Standard deviation of each axis of `block`; NaN if a variance is negative.
    pub fn sigmas<'a>(&'a self, block: &Block) -> impl Iterator<Item = f64> + 'a {
        self.variances(block).map(math::sqrt)
    }

    /// P_ij.
    pub(crate) fn element(&self, i: usize, j: usize) -> f64 {
        self.form.element(self.n, &self.p, i, j)
    }

    /// Variance of tangent axis `i`.
    pub(crate) fn variance(&self, i: usize) -> f64 {
        self.form.element(self.n, &self.p, i, i)
    }

    /// Covariance of all axes of `block`, d×d, row by row.
    #[must_use]
    pub fn block(&self, block: &Block) -> Vec<f64> {
        self.block_elements(block).collect()
    }

    /// Its elements.
    pub(crate) fn block_elements(&self, block: &Block) -> impl Iterator<Item = f64> {
        let axes = block.tangent_range();
        let pairs = axes.clone().flat_map(move |i| axes.clone().map(move |j| (i, j)));
        pairs.map(|(i, j)| self.element(i, j))
    }

    /// Covariance of the first D axes of `block`, which has no fewer.
    #[must_use]
    pub fn marginal<const D: usize>(&self, block: &Block) -> SMatrix<f64, D, D> {
        self.marginal_at(block.tangent)
    }

    /// Covariance of the D axes from the tangent offset `at` of a quantity's error, which
    /// [`Quantity::place`](crate::state::Quantity::place) returns.
    #[must_use]
    pub fn marginal_at<const D: usize>(&self, at: usize) -> SMatrix<f64, D, D> {
        let mut found = SMatrix::zeros();
        self.copy_to(at, at, &mut found);
        found
    }

    /// Writes R rows and C columns of P from the tangent offsets `row` and `column` on to `out`, in its
    /// place.
    pub fn copy_to<const R: usize, const C: usize>(&self, row: usize, column: usize, out: &mut SMatrix<f64, R, C>) {
        let Some(p) = self.form.whole(&self.p) else {
            *out = SMatrix::from_fn(|i, j| self.form.element(self.n, &self.p, row + i, column + j));
            return;
        };
        let ld = padded(self.n);
        for i in 0..R {
            let from = (row + i) * ld + column;
            // One check of the range for all of a row.
            let values = &p[from..from + C];
            (0..C).for_each(|j| out[(i, j)] = values[j]);
        }
    }

    /// Covariance of the error of `a` (rows) with the error of `b` (columns).
    #[must_use]
    pub fn between<A, B, const R: usize, const C: usize>(&self, a: Slot<A>, b: Slot<B>) -> SMatrix<f64, R, C>
    where
        A: Tangent<R>,
        B: Tangent<C>,
    {
        let mut found = SMatrix::zeros();
        self.copy_to(a.tangent, b.tangent, &mut found);
        found
    }

    /// Whether every variance is finite and not negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.form.is_sound(self.n, &self.p)
    }

    /// Whether it is a covariance up to rounding: sound, and no combination of states has a negative variance.
    pub(crate) fn is_positive(&self, w: &mut Workspace) -> bool {
        self.form.is_positive(self.n, &self.p, w)
    }

    /// The whole of it, n×n, row by row: for comparisons and pictures.
    #[must_use]
    pub fn to_dense(&self) -> Vec<f64> {
        self.elements().collect()
    }

    /// All elements, row by row.
    pub fn elements(&self) -> impl Iterator<Item = f64> {
        let n = self.n;
        (0..n * n).map(move |k| self.form.element(n, &self.p, k / n, k % n))
    }

    /// Gives `block` the covariance `value`, d×d, row by row, and removes its correlation with the other blocks.
    pub fn set_block(&mut self, block: &Block, value: &[f64]) {
        self.set_axes(block.tangent_range(), value);
    }

    /// As [`set_block`](Self::set_block), for the tangent axes `axes`.
    pub(crate) fn set_axes(&mut self, axes: Range<usize>, value: &[f64]) {
        self.form.set_block(self.n, &mut self.p, axes, value);
    }

    /// Gives the whole of it the values `value`, n×n, row by row.
    pub(crate) fn set_whole(&mut self, value: &[f64]) {
        self.set_axes(0..self.n, value);
    }

    /// Gives the axes of `block` these standard deviations, uncorrelated with each other and with
    /// everything else.
    pub fn set_sigmas(&mut self, block: &Block, sigma: &[f64]) {
        let d = block.kind.dim();
        let diagonal: Vec<f64> = (0..d * d)
            .map(|k| if k / d == k % d { sigma[k / d] * sigma[k / d] } else { 0.0 })
            .collect();
        self.set_block(block, &diagonal);
    }

    /// P ← D P D with D = √`factor` on `axes` and 1 elsewhere: variances there grow by `factor`,
    /// correlation coefficients stay.
    pub(crate) fn scale(&mut self, axes: &[Range<usize>], factor: f64) {
        self.form.scale(self.n, &mut self.p, axes, factor);
    }

    /// Takes the values of another of the same dimension and form, without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.p.copy_from_slice(&other.p);
    }

    /// P ← 0: no uncertainty, or no statement about it.
    pub(crate) fn clear(&mut self) {
        self.p.fill(0.0);
    }

    /// P ← Φ(P + Q_before)Φᵀ + Q_after; false, and P as before, where a variance would overflow, be
    /// negative or not be a number.
    pub(crate) fn predict(&mut self, t: &Transition, w: &mut Workspace) -> bool {
        self.form.predict(self.n, &mut self.p, t, w)
    }

    /// P ← J P Jᵀ.
    pub(crate) fn congruence(&mut self, j: &BlockMatrix, w: &mut Workspace) {
        self.form.congruence(self.n, &mut self.p, j, w);
    }

    /// HP and HPHᵀ into `w`.
    pub(crate) fn project(&self, h: &Jacobian, w: &mut Workspace) {
        self.form.project(self.n, &self.p, h, w);
    }

    /// Conditions P on a measurement that was projected and whose gain is in `w`.
    pub(crate) fn condition(&mut self, h: &Jacobian, r: &[f64], w: &mut Workspace) {
        self.form.condition(self.n, &mut self.p, h, r, w);
    }
}

#[cfg(test)]
mod tests {
    mod accuracy;
    mod long_runs;

    use super::*;
    use crate::covariance::FormKind;
    use crate::filter::tests::declare;
    use crate::state::{Dynamics, LayoutBuilder, Scalar, Vector};
    use crate::testing::Lcg;

    #[test]
    fn numbers_are_read_by_block_and_covariances_compared_by_form_and_numbers() {
        let mut b = LayoutBuilder::new();
        let first = declare::<Scalar>(&mut b, "first", 0.0, &[1.0], Dynamics::Constant);
        let second = declare::<Vector<2>>(&mut b, "second", [0.0; 2].into(), &[1.0; 2], Dynamics::Constant);
        let third = declare::<Vector<2>>(&mut b, "third", [0.0; 2].into(), &[1.0; 2], Dynamics::Constant);
        let layout = b.finish();
        let mut random = Lcg::new(1);
        let a = nalgebra::DMatrix::from_fn(5, 5, |_, _| random.signed());
        let p = &a * a.transpose();
        let of = |kind: FormKind| {
            let mut c = Covariance::zeros(5, kind.form());
            c.set_whole(p.as_slice());
            c
        };
        let c = of(FormKind::Joseph);
        let blocks = layout.blocks();
        // 1e-15: stored as given, or as factors.
        let near = |found: f64, i: usize, j: usize| (found - p[(i, j)]).abs() < 1e-15;
        let block = c.block(&blocks[1]);
        assert!(
            block.len() == 4 && (0..4).all(|k| near(block[k], 1 + k / 2, 1 + k % 2)),
            "{block:?}"
        );
        let between = c.between::<_, _, 2, 2>(second, third);
        assert!((0..4).all(|k| near(between[(k / 2, k % 2)], 1 + k / 2, 3 + k % 2)), "{between}");
        assert!(near(c.between::<_, _, 1, 2>(first, second)[1], 0, 2));
        let mut other = c.clone();
        assert_eq!(c, other);
        other.scale(core::slice::from_ref(&(0..1)), 2.0);
        assert_ne!(c, other, "other numbers");
        assert_ne!(c, of(FormKind::Standard), "another form");
        assert_ne!(
            Covariance::zeros(5, FormKind::Joseph.form()),
            Covariance::zeros(4, FormKind::Joseph.form())
        );
    }
}
