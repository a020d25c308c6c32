//! The traits a model implements. A model knows no estimator, no covariance and no state index.

mod dual;
mod exact;
pub mod literal;
mod measurement;
mod process;

pub use dual::Real;
pub use exact::{Exact, ExactModel, ExactView};
pub use fusion_derive::Literal;
pub use literal::Literal;
pub use measurement::{Measurement, Size, Undefined};
pub use process::{Gap, Input, LastInput, Order, Preparation, Prepared, Process, SignalBuffer, SignalsOut};
