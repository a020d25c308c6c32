//! The arithmetic of a covariance, by the vector instructions that the processor has.
//!
//! A [`Kernel`] is chosen once, when a filter is built. AVX-512, AVX2 and NEON perform the same
//! operations in the same order on every element and agree to the bit; the portable one has no fused
//! multiply-add and agrees to rounding.
//!
//! Matrices are symmetric n×n, row by row, rows padded with zeros to a multiple of eight numbers;
//! [`Lines`] puts them where cache lines begin. A slice that is too short for its dimensions panics.
//!
//! This is the only crate with `unsafe`: intrinsics of processors, calls of functions that need them, and
//! the view of aligned memory as a slice.

#![cfg_attr(not(feature = "std"), no_std)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![expect(
    clippy::needless_range_loop,
    reason = "plain loops are unrolled into registers; closures lose the features of the processor"
)]

#[cfg_attr(not(feature = "std"), macro_use)]
extern crate alloc;

#[cfg(not(any(feature = "std", feature = "libm")))]
compile_error!("without the feature `std` there are no functions of real numbers: add the feature `libm`");

mod congruence;
mod dispatch;
mod factor;
mod lanes;
mod lines;
pub mod math;
#[cfg(target_arch = "aarch64")]
mod neon;
mod sigma;
mod update;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use congruence::{Plan, Product};
pub use dispatch::Kernel;
pub use factor::{Reach, Shape};
pub use lines::Lines;
