//! Whether a periodic event still occurs.

use super::Limits;
use crate::memory::{Memory, Tape};
use crate::time::Time;

/// Pauses beyond this number of periods are not learnt in full: the sensor was absent.
const LONGEST: f64 = 4.0;
/// The number of pauses of which the period is the mean.
const MEMORY: f64 = 16.0;

/// Learns the period of a sensor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pulse {
    last: Option<Time>,
    period: f64,
}
crate::memory!(Pulse { last, period });

impl Pulse {
    /// Notes one event.
    pub(super) fn beat(&mut self, time: Time) {
        if let Some(last) = self.last {
            let pause = time.seconds_since(last);
            if pause <= 0.0 {
                return;
            }
            self.period = if self.period > 0.0 {
                self.period + (pause.min(LONGEST * self.period) - self.period) / MEMORY
            } else {
                pause
            };
        }
        self.last = Some(time);
    }

    /// The pause before `time` is not caused by the sensor.
    pub(super) fn restart(&mut self, time: Time) {
        self.last = self.last.map(|_| time);
    }

    /// Its mean period \[s\]; 0 until two events have come.
    pub(super) const fn period(&self) -> f64 {
        self.period
    }

    /// Whether nothing has come for too long.
    pub(super) fn is_silent(&self, now: Time, limits: &Limits) -> bool {
        let allowed = self.pause(limits);
        self.period > 0.0 && self.last.is_some_and(|last| now.seconds_since(last) > allowed)
    }

    /// The longest pause that does not count as silence \[s\].
    pub(super) const fn pause(&self, limits: &Limits) -> f64 {
        limits.silent.max(limits.silent_periods * self.period)
    }
}

impl Pulse {
    /// Whether an event has come lately: within `time` \[s\], or within this number of periods.
    pub(super) fn is_fresh(&self, now: Time, time: f64, periods: f64) -> bool {
        let lately = time.max(periods * self.period);
        self.last.is_some_and(|last| now.seconds_since(last) <= lately)
    }
}

/// A condition that is still reported for a while after it has ceased.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held(Option<Time>);

impl Memory for Held {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

impl Held {
    /// Hears whether the condition holds now.
    pub(super) fn hear(&mut self, now: Time, holds: bool) {
        if holds {
            self.0 = Some(now);
        }
    }

    /// Whether the condition is reported.
    pub(super) fn is_told(&self, now: Time, limits: &Limits) -> bool {
        self.0.is_some_and(|last| now.seconds_since(last) <= limits.hold)
    }
}
