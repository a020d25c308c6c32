//! The time that a filter takes.

use crate::rows::Row;
use fusion_core::runner::{Event, Halt, Observer, RunError, Runner};
use std::time::{Duration, Instant};

/// Times a filter while it is fed, less what those take who hear it.
///
/// Looking at the clock costs a good part of what it measures: one row in 16 is timed, picked so
/// that no period of the streams can favour some of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timing {
    fed: u32,
    timed: u32,
    filter: Duration,
}

/// Hears as another does, and times that.
struct Heard<'a> {
    observer: &'a mut dyn Observer,
    spent: Duration,
}

impl Timing {
    /// Feeds `row` to `runner`.
    ///
    /// # Errors
    /// Those of the runner.
    pub fn feed(&mut self, runner: &mut Runner, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        self.fed = self.fed.wrapping_add(1);
        if self.fed.wrapping_mul(0x9E37_79B9) >> 28 != 0 {
            return runner.feed(row, observer);
        }
        let mut heard = Heard {
            observer,
            spent: Duration::ZERO,
        };
        let clock = Instant::now();
        let fed = runner.feed(row, &mut heard);
        self.filter += clock.elapsed().saturating_sub(heard.spent);
        self.timed += 1;
        fed
    }

    /// Nanoseconds in the filter per epoch, of a run of so many.
    #[must_use]
    pub fn ns_per_epoch(&self, epochs: u64) -> f64 {
        let share = f64::from(self.timed.max(1)) / f64::from(self.fed.max(1));
        self.filter.as_nanos() as f64 / share / epochs.max(1) as f64
    }
}

impl Observer for Heard<'_> {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        let clock = Instant::now();
        let heard = self.observer.on(event);
        self.spent += clock.elapsed();
        heard
    }

    fn wants_steps(&self) -> bool {
        self.observer.wants_steps()
    }
}
