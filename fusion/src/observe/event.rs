//! What is told of a run.

use super::Heard;
use crate::rows::Row;
use crate::score::{EpochError, ReferenceEpoch};
use crate::solution::Solved;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::Belief;

/// What observers of a run hear.
#[derive(Debug)]
#[non_exhaustive]
pub enum RunEvent<'a> {
    /// A row goes to the filter; the events that it causes follow.
    Row(&'a Row<'a>),
    /// A row does not go to the filter: it is stamped before or after the time that is run.
    Outside {
        /// The row.
        row: &'a Row<'a>,
        /// Whether it is after.
        is_after: bool,
    },
    /// The estimate of an epoch, after every measurement that is valid at that time was used.
    Estimate {
        /// Whose estimate it is.
        filter: &'a Heard,
        /// Position, velocity and attitude; looking at them costs what reading them costs, once.
        solution: &'a Solved<'a>,
        /// The whole of it.
        belief: &'a Belief,
    },
    /// Anything else that a filter tells.
    Filter {
        /// The filter that tells it.
        filter: &'a Heard,
        /// What it tells; never an estimate, never nested.
        event: &'a Event<'a>,
    },
    /// An epoch of the reference, once the estimates of a filter have come as far, in order of time.
    Reference {
        /// The filter that has.
        filter: &'a Heard,
        /// The epoch.
        epoch: &'a ReferenceEpoch,
        /// Its error there; none before the first estimate and after the last.
        error: Option<&'a EpochError>,
    },
    /// The estimate of an epoch whose true state is known.
    Truth {
        /// Whose estimate it is.
        filter: &'a Heard,
        /// The estimate.
        belief: &'a Belief,
        /// The true state, in the layout of the filter.
        truth: &'a [f64],
    },
}

/// Hears what is told of a run; it knows nothing of the others who hear it.
pub trait RunObserver {
    /// Called for every event, in order.
    ///
    /// # Errors
    /// Where it cannot go on: the run stops at once with this error.
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt>;

    /// What it has heard so far, as far as it matters later, for a checkpoint of the run; none of one that
    /// cannot go on from it.
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        None
    }

    /// Its memory is about to be saved: what it has written so far is put where it outlives the process.
    ///
    /// # Errors
    /// Where it cannot.
    fn flush(&mut self) -> Result<(), Halt> {
        Ok(())
    }

    /// Its memory was restored: what was written after it is taken back.
    ///
    /// # Errors
    /// Where what was written before is not there any more.
    fn resume(&mut self) -> Result<(), Halt> {
        Ok(())
    }

    /// Whether it needs the steps of the filters: [`Event::Step`].
    fn wants_steps(&self) -> bool {
        false
    }
}
