//! Compares fixed parameters of sensors with the estimates of the design's own filter, with the parameters as states.
//!
//! First, one more run has all parameters as states (`search.rs`). Each starts from its declared value, with the σ of a
//! careful guess. A parameter that moves away is only a suspect, because several parameters may share one error. So
//! each suspect is tried alone. The suspect that makes the innovations most probable is reported (`course.rs`). The
//! search then corrects this parameter and looks for further mistakes.
//!
//! If the filter still does not follow its data, the search also tries errors that a linear filter cannot find. These
//! are quarter turns, a sign, another unit, another latency (`parameter.rs`).

mod course;
mod parameter;
mod search;
mod told;

pub(super) use search::{judge, untried};
