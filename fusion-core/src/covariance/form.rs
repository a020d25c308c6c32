//! How P is stored: what a form of the covariance has to do.

use super::dense::Scratch;
use crate::linear::{BlockMatrix, Jacobian, Transition, padded};
use core::fmt::Debug;
use core::ops::Range;

/// How P is stored and kept positive.
///
/// A form has no state: P's numbers lie in `p`, [`Form::storage`] of them, and it may use
/// [`Workspace::extra`]. `n` is the dimension of the tangent space, `h` a measurement's Jacobian of
/// m rows, `w` the working memory. All zeros stand for P = 0. [`crate::testing::check_form`] holds
/// the laws.
pub trait Form: Debug + Send + Sync {
    /// Its name; two forms of one name store alike.
    fn name(&self) -> &'static str;

    /// Numbers that P takes.
    fn storage(&self, n: usize) -> usize;

    /// Numbers of [`Workspace::extra`] that it uses for measurements of up to `m` rows.
    fn workspace(&self, n: usize, m: usize) -> usize {
        let _ = (n, m);
        0
    }

    /// P_ij.
    fn element(&self, n: usize, p: &[f64], i: usize, j: usize) -> f64;

    /// Gives the axes `block` the covariance `value` (d×d, row by row) and forgets their correlation
    /// with the others.
    fn set_block(&self, n: usize, p: &mut [f64], block: Range<usize>, value: &[f64]);

    /// P ← D P D with D = √`factor` on `axes` and 1 elsewhere.
    fn scale(&self, n: usize, p: &mut [f64], axes: &[Range<usize>], factor: f64);

    /// P ← Φ(P + Q_before)Φᵀ + Q_after; false, and `p` as before, where a variance, or a noise on the
    /// diagonal, would overflow, be negative or not be a number.
    fn predict(&self, n: usize, p: &mut [f64], t: &Transition, w: &mut Workspace) -> bool;

    /// P ← J P Jᵀ.
    fn congruence(&self, n: usize, p: &mut [f64], j: &BlockMatrix, w: &mut Workspace);

    /// [`Workspace::hp`] ← HP and [`Workspace::hph`] ← HPHᵀ.
    fn project(&self, n: usize, p: &[f64], h: &Jacobian, w: &mut Workspace);

    /// P ← P given the measurement: R is `r` (m×m, row by row); `w` holds HP, HPHᵀ, S with its
    /// Cholesky factor, and the gain.
    fn condition(&self, n: usize, p: &mut [f64], h: &Jacobian, r: &[f64], w: &mut Workspace);
}

/// Working memory of a measurement's passage and of the kernels, sized once.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// Row length of `hp` and `kt`: n padded to a multiple of eight.
    pub ld: usize,
    /// H P, m rows of `ld`.
    pub hp: Vec<f64>,
    /// H P Hᵀ, m×m.
    pub hph: Vec<f64>,
    /// S = H P Hᵀ + R, m×m.
    pub s: Vec<f64>,
    /// Cholesky factor of S, lower, m×m.
    pub l: Vec<f64>,
    /// Kᵀ, m rows of `ld`.
    pub kt: Vec<f64>,
    /// What the form asked for.
    pub extra: Vec<f64>,
    pub(super) dense: Scratch,
}

impl Workspace {
    /// Memory for `n` states in `form` and measurements of up to `m` rows.
    #[must_use]
    pub fn new(form: &dyn Form, n: usize, m: usize) -> Self {
        let ld = padded(n);
        Self {
            ld,
            hp: vec![0.0; m * ld],
            hph: vec![0.0; m * m],
            s: vec![0.0; m * m],
            l: vec![0.0; m * m],
            kt: vec![0.0; m * ld],
            extra: vec![0.0; form.workspace(n, m)],
            dense: Scratch::new(n, m),
        }
    }
}
