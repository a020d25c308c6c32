//! Smoothing: what the data after an instant say of the state there.
//!
//! The filter's steps are run through backwards. Each one is affine in the error: with x the error
//! of the estimate in the canonical chart,
//!
//! ```text
//! prediction   x⁺ = Φ x + w                M = Φ
//! correction   x⁺ = J (x − K r), K = PHᵀS⁻¹   M = J (I − K H)
//! ```
//!
//! and what comes later is summed up in an adjoint λ (n) and its covariance Λ (n×n), both zero at the
//! end of the data. Over one step, with the last term of a correction only,
//!
//! ```text
//! λ ← Mᵀ λ − Hᵀ S⁻¹ r        Λ ← Mᵀ Λ M + Hᵀ S⁻¹ H
//! ```
//!
//! At any instant, with x̂ and P as the filter left them there, the smoothed estimate is
//! x̂ ⊞ (−P λ) with the covariance P − P Λ P. The state moves by the retraction of the filter's own
//! chart, and the covariance with it where the chart says so.
//!
//! This is the smoother of Bryson and Frazier in the form of Bierman 1973, carried to the error
//! state: the estimate's own error is zero before every correction, because the filter has moved the
//! state by K r; where the chart has moved the covariance with it, J moves λ and Λ back. It gives the
//! same numbers as that of Rauch, Tung and Striebel,
//! G = P⁺Φᵀ(P⁻)⁻¹, x_s = x̂⁺ ⊞ G (x_s ⊟ x̂⁻), and was chosen over it for three reasons. There is no
//! inverse of P⁻, which has none where a variance is zero. A step costs as many products as Φ and H
//! have elements besides the identity, times n, instead of n³. Process noise does not appear: what
//! makes P grow before a measurement is believed needs no record, nor do the beliefs between two
//! instants that are asked for.
//!
//! Where a variance falls by more than 15 orders of magnitude, rounding of P takes the place of what is
//! left of it; the covariance may then have a negative variance, and
//! [`is_sound`](crate::state::Belief::is_sound) says so.
//!
//! A filter that starts anew knows nothing of the errors before: every start begins another piece, and
//! pieces are smoothed each by itself. Φ and H are those of the filter, taken at its own estimates.
//!
//! [`FixedInterval`] uses all data of a log, [`FixedLag`] those up to a time after the estimate.

mod adjoint;
mod interval;
mod lag;
mod link;
mod record;
mod tape;

pub use interval::{FixedInterval, Smoothed};
pub use lag::FixedLag;
pub use link::Link;
pub use record::Unreadable;
pub use tape::{Shelf, Tape};

#[cfg(test)]
mod tests;
