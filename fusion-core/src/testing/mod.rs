//! Law suites: the conditions that every chart, model, gate and loss must satisfy.
//!
//! A law is a function that returns `Err` with a sentence naming the block, the element and the
//! numbers that disagree. A test applies the laws to every registered block; a block added later
//! is then tested without anyone writing that test.
//!
//! Numeric derivatives are central differences at three step sizes, extrapolated in pairs
//! (Richardson). The difference of the two extrapolations bounds their truncation and rounding, and so
//! gives the tolerance of the comparison. If that bound is coarse, the law fails; it does not
//! pass unnoticed.
//! The step depends on the block's kind: 1 m of position, 0.01 rad of attitude, see [`step`].

mod chart;
mod coasting;
#[cfg(test)]
pub(crate) mod double;
mod form;
mod measurement;
mod memory;
mod numeric;
mod policy;
mod process;
mod random;

pub use chart::{check_chart, check_kind, check_reset, check_space};
pub use coasting::check_coasting;
#[cfg(test)]
pub(crate) use form::scalars;
pub use form::{check_form, check_update_rule};
pub use measurement::check_measurement;
pub use memory::check_memory;
pub use numeric::step;
pub use policy::{check_gate, check_loss};
pub use process::check_process;
pub use random::Lcg;
