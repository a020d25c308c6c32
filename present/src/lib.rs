//! Results as people read them: pages of tables ([`Shown`]), and the report with plots ([`report`]).
//!
//! `summary.json` is not drawn from a page: it is the data themselves, in SI and full precision, with keys that
//! programs rely on.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod brief;
mod budget;
pub mod campaign;
pub mod comparison;
mod control;
mod drawn;
pub mod health;
mod judged;
pub mod report;
pub mod run;
mod section;
mod sensors;
mod stress;
mod trajectory;

pub use sensors::residual_rows;

/// A result with the pages that are made of it.
///
/// ```
/// let summary = fusion::run::Summary::default();
/// assert!(fusion_present::Shown(&summary).to_string().contains("never"));
/// ```
#[derive(Debug)]
pub struct Shown<'a, T>(pub &'a T);

impl<T> Clone for Shown<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shown<'_, T> {}

impl<T> core::ops::Deref for Shown<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0
    }
}
