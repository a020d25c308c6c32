//! Smoothing: estimates that also use the data after their instant.
//!
//! The filter's steps are processed backwards. Each step is affine in the error. With x the estimate's error
//! in the canonical chart,
//!
//! ```text
//! prediction   x⁺ = Φ x + w                M = Φ
//! correction   x⁺ = J (x − K r), K = PHᵀS⁻¹   M = J (I − K H)
//! ```
//!
//! and an adjoint λ (n) with its covariance Λ (n×n) sums up the later data. Both are zero at the
//! end of the data. Over one step (the last terms only for a correction),
//!
//! ```text
//! λ ← Mᵀ λ − Hᵀ S⁻¹ r        Λ ← Mᵀ Λ M + Hᵀ S⁻¹ H
//! ```
//!
//! At any instant, with x̂ and P as the filter left them there, the smoothed estimate is
//! x̂ ⊞ (−P λ) with the covariance P − P Λ P. The state moves by the retraction of the filter's own
//! chart. The covariance moves with it if the chart requires this.
//!
//! This is the smoother of Bryson and Frazier in the form of Bierman 1973, applied to the error
//! state. The estimate's own error is zero before every correction, because the filter has moved the
//! state by K r. Where the chart has moved the covariance with the state, J moves λ and Λ back. The result is
//! numerically the same as with the smoother of Rauch, Tung and Striebel,
//! G = P⁺Φᵀ(P⁻)⁻¹, x_s = x̂⁺ ⊞ G (x_s ⊟ x̂⁻). There are three advantages. The smoother needs no
//! inverse of P⁻, which does not exist if a variance is zero. A step costs n products for each element of Φ and H
//! that differs from the identity, instead of n³ products. Process noise does not appear: growth of P
//! before an accepted measurement needs no record. Beliefs between two requested instants need no record either.
//!
//! Where a variance falls by more than 15 orders of magnitude, only the rounding of P is left of it.
//! The covariance may then have a negative variance, and
//! [`is_sound`](crate::belief::Belief::is_sound) returns false.
//!
//! A restarted filter has no information about earlier errors. So every start begins a new piece, and
//! each piece is smoothed separately. Φ and H are the filter's own, taken at its estimates.
//!
//! [`FixedInterval`] uses all data of a log, [`FixedLag`] the data up to a time after the estimate. Both linearise once, at
//! the filter's estimates. [`IteratedInterval`] linearises again at the smoothed states, until they do not change.

mod adjoint;
mod interval;
mod iterated;
mod lag;
mod link;
mod record;
mod tape;

pub use interval::{FixedInterval, Smoothed};
pub use iterated::{IteratedInterval, Iteration, Optimum, Replayed, Unsound};
pub use lag::FixedLag;
pub use link::Link;
pub use record::Unreadable;
pub use tape::{Shelf, Tape};

#[cfg(test)]
mod tests;
