//! The latest measurement of each sensor, for outputs.

use crate::output::SensorNow;
use fusion::core::filter::Verdict;
use fusion::core::memory;
use fusion::core::memory::{Memory, Tape};
use fusion::core::runner::{Event, Halt};
use fusion::observe::{RunEvent, RunObserver};
use std::sync::{Arc, Mutex, PoisonError};

/// The sensors of the filter, shared with the feed that sends them.
pub(crate) type Sensors = Arc<Mutex<Vec<SensorNow>>>;

/// Observes the measurements of the outermost filter.
#[derive(Debug, Default)]
pub struct Watch {
    pub(crate) sensors: Sensors,
}

memory!(SensorNow {
    time,
    used,
    rejected,
    is_used,
    nis,
    residual,
    sigma
});

impl Memory for Watch {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut sensors = self.sensors.lock().unwrap_or_else(PoisonError::into_inner);
        sensors.remember(tape);
    }
}

impl RunObserver for Watch {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, .. },
        } = event
        else {
            return Ok(());
        };
        if !filter.is_outermost() {
            return Ok(());
        }
        let mut sensors = self.sensors.lock().unwrap_or_else(PoisonError::into_inner);
        if sensors.len() <= *sensor {
            sensors.resize_with(filter.sensors.len().max(sensor + 1), SensorNow::default);
        }
        let now = &mut sensors[*sensor];
        now.is_used = matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired);
        let count = if now.is_used { &mut now.used } else { &mut now.rejected };
        *count += 1;
        now.time = Some(*time);
        now.nis = Some(update.nis).filter(|nis| nis.is_finite());
        now.residual.clear();
        now.residual.extend_from_slice(update.residual);
        now.sigma.clear();
        now.sigma.extend_from_slice(update.innovation_sigma);
        Ok(())
    }

    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }
}
