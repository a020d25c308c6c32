//! Selects the kernel.

use crate::congruence::{self, Plan, Product};
use crate::factor::{self, Reach, Shape};
use crate::lanes::{Lanes, Plain};
use crate::sigma;
use crate::update;

/// The instructions for a filter's arithmetic. A value exists only for a kernel that this processor supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    all(target_arch = "x86_64", not(feature = "std")),
    expect(dead_code, reason = "without `std`, nothing tells what this processor supports")
)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "aarch64")]
    Neon,
}

/// The best kernel of this processor.
impl Default for Kernel {
    fn default() -> Self {
        Self::here().last().unwrap_or(Self::PORTABLE)
    }
}

impl Kernel {
    /// Without fused multiply-add: the same bits on every machine.
    pub const PORTABLE: Self = Self(Kind::Portable);

    /// The kernels that this processor can run, the best one last.
    pub fn here() -> impl Iterator<Item = Self> {
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let more = [
            (Kind::Avx2, is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")),
            (Kind::Avx512, is_x86_feature_detected!("avx512f")),
        ];
        #[cfg(target_arch = "aarch64")]
        let more = [(Kind::Neon, true)];
        #[cfg(not(any(all(target_arch = "x86_64", feature = "std"), target_arch = "aarch64")))]
        let more: [(Kind, bool); 0] = [];
        let more = more.into_iter().filter_map(|(kind, is_here)| is_here.then_some(Self(kind)));
        core::iter::once(Self::PORTABLE).chain(more)
    }

    /// The kernel of this name, if this processor can run it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::here().find(|kernel| kernel.name() == name)
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => "avx512",
            #[cfg(target_arch = "aarch64")]
            Kind::Neon => "neon",
        }
    }
}

/// A method for each operation, which runs it on the lanes of the kernel.
macro_rules! operations {
    ($($(#[$doc:meta])* $module:ident::$name:ident($($arg:ident: $type:ty),* $(,)?);)*) => {
        impl Kernel {
            $(
                $(#[$doc])*
                #[inline]
                pub fn $name(self, $($arg: $type),*) {
                    #[inline(always)]
                    fn on<L: Lanes>($($arg: $type),*) {
                        $module::$name::<L>($($arg),*);
                    }
                    #[cfg(target_arch = "x86_64")]
                    #[target_feature(enable = "avx512f")]
                    fn avx512($($arg: $type),*) {
                        on::<crate::x86::Avx512>($($arg),*);
                    }
                    #[cfg(target_arch = "x86_64")]
                    #[target_feature(enable = "avx2,fma")]
                    fn avx2($($arg: $type),*) {
                        on::<crate::x86::Avx2>($($arg),*);
                    }
                    #[inline(never)]
                    fn portable($($arg: $type),*) {
                        on::<Plain>($($arg),*);
                    }
                    match self.0 {
                        Kind::Portable => portable($($arg),*),
                        #[cfg(target_arch = "x86_64")]
                        #[expect(unsafe_code, reason = "a call of a function that needs features of the processor")]
                        // SAFETY: a kernel of this kind is made by `here` only, where they are detected.
                        Kind::Avx512 => unsafe { avx512($($arg),*) },
                        #[cfg(target_arch = "x86_64")]
                        #[expect(unsafe_code, reason = "a call of a function that needs features of the processor")]
                        // SAFETY: as above.
                        Kind::Avx2 => unsafe { avx2($($arg),*) },
                        #[cfg(target_arch = "aarch64")]
                        Kind::Neon => on::<crate::neon::Neon>($($arg),*),
                    }
                }
            )*
        }
    };
}

operations! {
    /// The product ΦPΦᵀ into `w`; `phi` is Φᵀ, row by row, with the row length of P.
    congruence::product(plan: &Plan, phi: &[f64], p: &[f64], w: &mut Product);
    /// P ← the product in `w`.
    congruence::place(plan: &Plan, w: &Product, p: &mut [f64]);
    /// out ← HP for `rows` rows; H is zero outside `columns`.
    update::project(rows: usize, h: &[f64], columns: &[(usize, usize)], p: &[f64], out: &mut [f64], ld: usize);
    /// out ← XHᵀ, m×m, row by row, for a symmetric result; X and H have m rows.
    update::inner(m: usize, h: &[f64], x: &[f64], out: &mut [f64], ld: usize);
    /// U ← L⁻¹X and K ← L⁻ᵀU with m rows; L is lower, m×m, row by row.
    update::gain(l: &[f64], m: usize, x: &[f64], u: &mut [f64], k: &mut [f64], ld: usize);
    /// P ← P − UᵀU, where U has m rows; P stays symmetric to the bit.
    update::downdate(n: usize, u: &[f64], m: usize, p: &mut [f64]);
    /// P ← P − DᵀK − KᵀD, with m rows each; P stays symmetric to the bit.
    update::refine(n: usize, d: &[f64], k: &[f64], m: usize, p: &mut [f64]);
    /// X ← X − RY for m rows; R is m×m, row by row.
    update::subtract(r: &[f64], m: usize, y: &[f64], x: &mut [f64], ld: usize);
    /// out ← ΦF for a factor F; `phi` is Φᵀ, row by row, in rows with the length of the columns of F.
    factor::through(reach: &Reach, phi: &[f64], f: &[f64], out: &mut [f64]);
    /// sums ← Σ_k w_k c_k ∘ c_k over the first `len` columns.
    factor::squares(len: usize, columns: &[f64], weights: &[f64], sums: &mut [f64]);
    /// U, with a unit diagonal, followed by D, from an array and its weights; `s` has space for one column.
    factor::orthogonalise(shape: Shape, columns: &mut [f64], weights: &[f64], factor: &mut [f64], s: &mut [f64]);
    /// S, with a positive diagonal, from an array whose weights are 1.
    factor::reflect(shape: Shape, columns: &mut [f64], root: &mut [f64], s: &mut [f64]);
    /// out ← HF for a factor F and `rows` rows; H is zero outside `read`.
    factor::along(n: usize, rows: usize, h: &[f64], read: &[(usize, usize)], f: &[f64], out: &mut [f64]);
    /// Updates U, followed by D, by a row h with noise variance r; `f` = Uᵀh. Afterwards the content of `f` and of
    /// `lambda`, a padded row, is working memory.
    factor::weigh(n: usize, r: f64, f: &mut [f64], factor: &mut [f64], lambda: &mut [f64]);
    /// Updates S by a row h with noise variance r; `f` = Sᵀh. `scales` is working memory of two padded rows.
    factor::rotate(n: usize, r: f64, f: &[f64], root: &mut [f64], scales: &mut [f64]);
    /// Rows of `l` ← columns of the lower L with P = L Lᵀ; a column is zero if only rounding remains of its variance.
    sigma::root(n: usize, p: &[f64], l: &mut [f64]);
    /// P ← P + w Σ x xᵀ over `count` padded rows of n numbers; P stays symmetric to the bit.
    sigma::outer(n: usize, count: usize, x: &[f64], w: f64, p: &mut [f64]);
}
