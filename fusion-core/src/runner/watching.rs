//! The runner's own health: every event passes its monitor on the way to the observer.

use super::{Event, Halt, Observer, StreamId};
use crate::health::{Monitor, Sign, State};
use crate::time::Time;

/// Lets a monitor hear every event first, and reports the changes of the health.
pub(super) struct Watch<'a, 'b> {
    monitor: &'a mut Monitor,
    observer: &'b mut dyn Observer,
}

impl<'a, 'b> Watch<'a, 'b> {
    pub(super) fn new(monitor: &'a mut Monitor, observer: &'b mut dyn Observer) -> Self {
        Self { monitor, observer }
    }

    /// Notes a row of `stream`.
    pub(super) fn beat(&mut self, stream: StreamId, stamp: Time) {
        self.monitor.row(stream, stamp);
    }
}

impl Observer for Watch<'_, '_> {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        let has_changed = event.sign().is_some_and(|sign| self.monitor.hear(sign));
        self.observer.on(event)?;
        if has_changed {
            let health = self.monitor.health();
            self.observer.on(&Event::Health { health })?;
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        self.observer.wants_steps()
    }

    fn health(&self) -> Option<State> {
        Some(self.monitor.health().state)
    }
}

impl Event<'_> {
    /// The sign of it for a monitor, if it says something about the health.
    pub(crate) fn sign(&self) -> Option<Sign<'_>> {
        Some(match self {
            Self::Started { belief, rivals } => Sign::Started { belief, rivals: *rivals },
            Self::Estimate { belief } => Sign::Estimate(belief),
            Self::Updated { sensor, update, time, .. } => Sign::Updated {
                sensor: *sensor,
                update,
                time: *time,
            },
            Self::Coasting { since, time } => Sign::Coasting {
                since: *since,
                time: *time,
            },
            Self::Resumed { time, .. } => Sign::Resumed(*time),
            Self::Stopped { time, .. } => Sign::Stopped(*time),
            Self::GaveUp { time, .. } => Sign::GaveUp(*time),
            Self::Ahead { stream, .. } => Sign::Ahead(*stream),
            Self::Failed { .. } => Sign::Failed,
            Self::Taken { .. }
            | Self::Discarded { .. }
            | Self::Current { .. }
            | Self::Step(_)
            | Self::Health { .. }
            | Self::Nested { .. } => return None,
        })
    }
}
