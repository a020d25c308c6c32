//! How P is stored: the interface of a form of the covariance.

use super::dense::Scratch;
use super::upper;
use crate::Printed;
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use crate::printed::role;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::mem::MaybeUninit;
use core::ops::Range;
use fusion_kernels::{Kernel, Lines};

/// Variances beyond this have overflowed, or are about to.
pub(super) const LARGEST: f64 = 1e300;

/// How negative an eigenvalue of the correlation coefficients counts as rounding of a P that is
/// stored whole: ten thousand roundings of an element.
const TOLERATED: f64 = 1e-12;

/// How P is stored and kept positive.
///
/// A form has no state: `p` contains P's [`Form::storage`] numbers, and the form may use
/// [`Workspace::extra`]. `n` is the dimension of the tangent space, `h` a measurement's Jacobian of
/// m rows, `w` the working memory. All zeros mean P = 0. [`crate::testing::check_form`] contains
/// the laws.
pub trait Form: Printed + Send + Sync {
    /// Its name; two forms with the same name store P in the same way.
    fn name(&self) -> &'static str;

    /// Numbers that P takes.
    fn storage(&self, n: usize) -> usize;

    /// Numbers of [`Workspace::extra`] that it uses for measurements of up to `m` rows.
    fn workspace(&self, n: usize, m: usize) -> usize {
        let _ = (n, m);
        0
    }

    /// Numbers of memory without contents that it needs besides; for the forms of this crate.
    #[doc(hidden)]
    fn stack(&self, n: usize, m: usize) -> usize {
        let _ = (n, m);
        0
    }

    /// P_ij.
    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64;

    /// P itself, if it is stored whole: row by row, each [padded](crate::linear::padded).
    fn whole<'p>(&self, p: &'p [f64]) -> Option<&'p [f64]> {
        let _ = p;
        None
    }

    /// Gives the axes `block` the covariance `value` (d×d, row by row) and forgets their correlation
    /// with the others.
    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]);

    /// P ← D P D with D = √`factor` on `axes` and 1 elsewhere.
    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64);

    /// P ← Φ(P + Q_before)Φᵀ + Q_after. Returns false and leaves `p` unchanged if a variance, or a noise on the
    /// diagonal, would overflow, be negative or be NaN.
    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool;

    /// P ← J P Jᵀ.
    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace);

    /// [`Workspace::hp`] ← HP and [`Workspace::hph`] ← HPHᵀ.
    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace);

    /// P ← P given the measurement: R is `r` (m×m, row by row); `w` holds HP, HPHᵀ, S with its
    /// Cholesky factor, and the gain.
    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace);

    /// Whether every variance is finite and not negative.
    fn is_sound(&self, n: usize, p: &[f64]) -> bool {
        (0..n).all(|i| {
            let variance = self.element(n, p, i, i);
            variance.is_finite() && variance >= 0.0
        })
    }

    /// Whether P is a covariance: every variance is finite, and no combination of states has a negative variance
    /// beyond rounding. By default P is factored for this check; a factored form need not do it.
    fn is_positive(&self, n: usize, p: &[f64], w: &mut Workspace) -> bool {
        self.is_sound(n, p) && on_trial(self, n, p, w)
    }
}

role!(Form);

/// Whether P with its variances a little larger can be factored. (A pivot of P itself may be far
/// below zero although an eigenvalue is negative by rounding only.)
pub(super) fn on_trial<F: Form + ?Sized>(form: &F, n: usize, p: &[f64], w: &mut Workspace) -> bool {
    let (ld, a) = (padded(n), w.dense.matrix());
    for i in 0..n {
        (0..i).for_each(|j| a[i * ld + j] = form.element(n, p, i, j));
        a[i * ld + i] = form.element(n, p, i, i) * (1.0 + TOLERATED);
    }
    upper::factor(n, a, 0..n) <= 0.0
}

/// Working memory of a measurement's passage and of the kernels, sized once.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// The kernel that computes. By default it is the fastest that the processor supports.
    pub kernel: Kernel,
    /// Row length of `hp` and `kt`: n padded to a multiple of eight.
    pub ld: usize,
    /// H P, m rows of `ld`; conditioning may overwrite it.
    pub hp: Lines,
    /// H P Hᵀ, m×m.
    pub hph: Vec<f64>,
    /// S = H P Hᵀ + R, m×m.
    pub s: Vec<f64>,
    /// Cholesky factor of S, lower, m×m.
    pub l: Vec<f64>,
    /// Kᵀ, m rows of `ld`.
    pub(super) kt: Lines,
    /// L⁻¹HP, as long as `kt` is the optimal gain.
    pub(super) u: Lines,
    /// Whether `kt` is the optimal gain for the matrices in this workspace.
    is_optimal: bool,
    /// Memory for the form: [`Form::workspace`] numbers.
    pub extra: Lines,
    /// Uninitialised memory for the form: [`Form::stack`] numbers.
    pub(super) stack: Vec<MaybeUninit<f64>>,
    pub(super) dense: Scratch,
}

impl Workspace {
    /// Memory for `n` states in `form` and measurements of up to `m` rows.
    #[must_use]
    pub fn new(form: &dyn Form, n: usize, m: usize) -> Self {
        let ld = padded(n);
        Self {
            kernel: Kernel::default(),
            ld,
            hp: Lines::zeros(m * ld),
            hph: vec![0.0; m * m],
            s: vec![0.0; m * m],
            l: vec![0.0; m * m],
            kt: Lines::zeros(m * ld),
            u: Lines::zeros(m * ld),
            is_optimal: false,
            extra: Lines::zeros(form.workspace(n, m)),
            stack: vec![MaybeUninit::new(0.0); form.stack(n, m)],
            dense: Scratch::new(n, m),
        }
    }

    /// K = PHᵀS⁻¹ for m rows, by solving with the factor of S.
    pub fn gain(&mut self, m: usize) {
        let used = m * self.ld;
        let (u, kt) = (&mut self.u[..used], &mut self.kt[..used]);
        self.kernel.gain(&self.l, m, &self.hp, u, kt, self.ld);
        self.is_optimal = true;
    }

    /// Kᵀ, m rows of `ld`.
    #[must_use]
    pub fn kt(&self) -> &[f64] {
        &self.kt
    }

    /// Mutable Kᵀ, for a gain that is not the optimal one.
    pub fn kt_mut(&mut self) -> &mut [f64] {
        self.is_optimal = false;
        &mut self.kt
    }

    /// H, P or R has changed.
    pub(crate) const fn forget_gain(&mut self) {
        self.is_optimal = false;
    }

    /// Returns whether the gain is optimal, and clears the flag: the caller changes P next.
    pub(super) const fn take_optimal(&mut self) -> bool {
        core::mem::replace(&mut self.is_optimal, false)
    }
}
