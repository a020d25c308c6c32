//! The events of a run.

use super::Heard;
use crate::rows::Row;
use crate::score::{EpochError, ReferenceEpoch};
use crate::solution::Solved;
use fusion_core::belief::Belief;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};

/// An event for the observers of a run.
#[derive(Debug)]
#[non_exhaustive]
pub enum RunEvent<'a> {
    /// A row goes to the filter; the events that it causes follow.
    Row(&'a Row<'a>),
    /// A row does not go to the filter: its stamp is before or after the run.
    Outside {
        /// The row.
        row: &'a Row<'a>,
        /// True if the row is after the run.
        is_after: bool,
    },
    /// The estimate of an epoch, after every measurement that is valid at that time was used.
    Estimate {
        /// The filter of the estimate.
        filter: &'a Heard,
        /// Position, velocity and attitude. They are computed once, at the first access.
        solution: &'a Solved<'a>,
        /// The whole estimate.
        belief: &'a Belief,
    },
    /// Any other event of a filter.
    Filter {
        /// The filter that reports the event.
        filter: &'a Heard,
        /// The event; never an estimate, never nested.
        event: &'a Event<'a>,
    },
    /// An epoch of the reference, in order of time, once the estimates of a filter have reached it.
    Reference {
        /// The filter whose estimates have reached it.
        filter: &'a Heard,
        /// The epoch.
        epoch: &'a ReferenceEpoch,
        /// The filter's error there; `None` before the first estimate and after the last.
        error: Option<&'a EpochError>,
    },
    /// The estimate of an epoch whose true state is known.
    Truth {
        /// The filter of the estimate.
        filter: &'a Heard,
        /// The estimate.
        belief: &'a Belief,
        /// The true state, in the layout of the filter.
        truth: &'a [f64],
    },
}

/// Hears the events of a run; it is independent of all other observers.
pub trait RunObserver {
    /// Called for every event, in order.
    ///
    /// # Errors
    /// An observer that cannot continue: the run stops at once with this error.
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt>;

    /// The observer's memory for a checkpoint of the run: all that it still needs from earlier events. `None` if the
    /// observer cannot resume.
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        None
    }

    /// Called before the memory is saved: writes all output so far to where it survives the end of the process.
    ///
    /// # Errors
    /// An observer that cannot write.
    fn flush(&mut self) -> Result<(), Halt> {
        Ok(())
    }

    /// Called after the memory was restored: removes the output that was written after the checkpoint.
    ///
    /// # Errors
    /// The earlier output is no longer there.
    fn resume(&mut self) -> Result<(), Halt> {
        Ok(())
    }

    /// Returns true if it needs the steps of the filters: [`Event::Step`].
    fn wants_steps(&self) -> bool {
        false
    }
}
