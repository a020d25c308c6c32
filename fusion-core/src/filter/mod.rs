//! The estimator: predict and update. The only place where gains, gates and corrections are
//! computed; it knows blocks and Jacobians, and no sensor.
//!
//! An update is four steps: *innovation* (residual, H, S), *gate* (and robust weight), *condition*
//! (gain, correction, covariance) and *apply* (the chart moves state and covariance). Innovation
//! and condition are the [`UpdateRule`]'s.

mod backend;
mod bank;
mod curvature;
mod earlier;
mod estimator;
mod fixes;
mod iterated;
mod kalman;
mod lateness;
mod outright;
mod own;
mod protect;
mod reacquire;
mod replay;
mod rule;
mod sigma;
mod starts;
mod step;
mod unscented;

pub use backend::{Backend, ChartKind, UpdateKind};
pub use bank::{Bank, BankLimits};
pub use estimator::{Estimator, FilterError, Observed, Rivals, Update, Verdict};
pub use iterated::Iterated;
pub use kalman::{Filter, Parts};
pub use lateness::Lateness;
pub use outright::Outright;
pub(crate) use replay::Replay;
pub use replay::SensorModel;
pub use rule::{Innovation, Problem, Single, UpdateRule};
pub use sigma::{SigmaPoints, SigmaSpread};
pub use step::{Cause, Offered, Step};
pub use unscented::Unscented;

#[cfg(test)]
pub(crate) mod tests;
