//! The runner: owns time order.
//!
//! Rows of any number of streams come in; consumers (the process input, sensors, stages,
//! initialisers) see them in order of *validity*. A consumer may declare that its rows are valid
//! earlier than stamped; rows are held back just long enough that every order of arrival within
//! the buffer gives bit for bit the result of time order.
//!
//! An input sample is valid over the interval that ends at its stamp. A measurement inside that
//! interval waits for the sample and then splits it.

mod consumer;
mod driver;
mod event;
mod input;
mod nested;
mod parts;
mod queue;
mod rows;
mod scheduler;
mod watching;

pub use driver::{RewindNeeds, Rewinds, Runner};
pub use event::{Discard, Event, Halt, Observer, Observers, RowId};
pub use nested::{Nested, Outlet};
pub use parts::{Emitter, Initialiser, InitialiserUnit, InputLimits, Noise, Offset, Port, Sensor, Stage, StageUnit, Switch, Tested};
pub use rows::Row;

use thiserror::Error;

pub use crate::stream::StreamId;

/// A row does not have the width its stream was declared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a row of {wanted} numbers is expected here, this one has {found}")]
pub struct WrongWidth {
    /// Numbers declared.
    pub wanted: usize,
    /// Numbers given.
    pub found: usize,
}

/// Why a row could not be fed, or the run not go on.
#[derive(Debug, Error)]
pub enum RunError {
    /// The row has another width than its stream. It is not used, and nothing has changed.
    #[error(transparent)]
    Width(#[from] WrongWidth),
    /// An observer could not go on.
    #[error("{0}")]
    Observer(Halt),
}

impl From<Halt> for RunError {
    fn from(halt: Halt) -> Self {
        Self::Observer(halt)
    }
}

#[cfg(test)]
mod gap_tests;
#[cfg(test)]
mod offset_tests;
#[cfg(test)]
mod recording_tests;
#[cfg(test)]
mod switch_tests;
#[cfg(test)]
mod tests;
