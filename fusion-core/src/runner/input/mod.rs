//! The input of the process: the samples that carry the filter from one time to the next.
//!
//! Rows are checked, and become samples over the intervals that end at their stamps. One sample covers a limited time.
//! After that the input is silent: the process coasts in steps of that length, or stops. Steps are on a grid that
//! begins at the latest sample, so they do not depend on the order of arrival. The input also keeps an expectation of
//! the next sample, and the mean of its latest rows. It knows no queue, no sensor and no estimator.

mod coverage;
mod expectation;
mod guard;
mod intake;
mod samples;
#[cfg(test)]
mod tests;
mod window;

pub(super) use guard::Judged;
pub(super) use intake::{Intake, Reading, Silence, Taken};
pub(super) use samples::Sample;
