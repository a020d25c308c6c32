//! The runner's own health: every event passes its monitor on the way to the observer.

use super::{Event, Halt, Observer, Row, RunError, Runner, StreamId};
use crate::health::{Health, Limits, Monitor, Sign, State, Watched};
use crate::time::Time;

/// Lets a monitor hear every event first, and reports the changes of the health.
pub(super) struct Watch<'a, 'b> {
    monitor: &'a mut Monitor,
    observer: &'b mut dyn Observer,
}

impl Watch<'_, '_> {
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

impl Runner {
    /// Sets the limits by which the health is judged; to be called before the first row.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// The limits by which the health is judged.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// The health of the filter, by the newest belief.
    #[must_use]
    pub fn health(&self) -> &Health {
        static UNKNOWN: Health = Health::UNKNOWN;
        self.newest().monitor.as_ref().map_or(&UNKNOWN, |monitor| monitor.health())
    }

    /// Takes a row and processes everything it completes.
    ///
    /// # Errors
    /// A row of the wrong width, which changes nothing; an observer that cannot continue.
    pub fn feed(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        let from = self.released;
        self.watched(observer, |runner, watch| {
            if !runner.quarantine.doubts(row, runner.watermark) {
                watch.beat(row.stream, row.time);
            }
            runner.take_row(row, watch)
        })?;
        let settled = self.released;
        match &mut self.rewind {
            Some(rewind) => Ok(rewind.feed(row, from, settled, observer)?),
            None => Ok(()),
        }
    }

    /// Processes everything that has been held back: the end of the log.
    ///
    /// # Errors
    /// An observer that cannot continue.
    pub fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.watched(observer, |runner, watch| runner.take_end(watch))?;
        match &mut self.rewind {
            Some(rewind) => rewind.finish(observer),
            None => Ok(()),
        }
    }

    /// Does `work` while the monitor hears. Meanwhile the runner has no monitor, because it may look ahead.
    pub(super) fn watched<T>(&mut self, observer: &mut dyn Observer, work: impl FnOnce(&mut Self, &mut Watch<'_, '_>) -> T) -> T {
        let mut monitor = self.monitor.take().unwrap_or_else(|| Box::new(self.new_monitor()));
        let monitored = &mut *monitor;
        let done = work(
            self,
            &mut Watch {
                monitor: monitored,
                observer,
            },
        );
        self.monitor = Some(monitor);
        done
    }

    pub(super) fn new_monitor(&self) -> Monitor {
        let is_outside = |stream| self.stages.iter().all(|s| s.output != stream);
        let sensors = self.sensors.iter().map(|s| Watched {
            rows: s.model.size().residual,
            is_outside: is_outside(s.port.stream),
        });
        let is_read = |stream: &usize| {
            let mut inputs = self.stages.iter().flat_map(|s| &s.inputs);
            inputs.any(|port| port.stream == *stream)
        };
        let is_heard = |stream: &usize| self.sensors.iter().any(|s| s.port.stream == *stream);
        let is_input = |stream: &usize| self.input.as_ref().is_some_and(|input| input.port.stream == *stream);
        let silent = (0..self.streams.len()).filter(|s| is_outside(*s) && is_read(s) && !is_heard(s) && !is_input(s));
        let limits = if self.estimator.keeps_covariance() {
            self.limits
        } else {
            self.limits.without_sigma()
        };
        Monitor::new(limits, self.estimator.layout(), sensors, silent)
    }
}
