//! The time that a filter takes.

use crate::rows::Row;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt, Observer, RunError, Runner};
use std::time::{Duration, Instant};

/// Times a filter while it is fed, less what those take who hear it.
///
/// Looking at the clock costs a good part of what it measures: one row in 16 is timed, picked so
/// that no period of the streams can favour some of them; where a late row may be a long way back, all are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timing {
    fed: u32,
    timed: u32,
    filter: Duration,
    longest: Duration,
}

/// Hears as another does, and times that.
struct Heard<'a> {
    observer: &'a mut dyn Observer,
    spent: Duration,
}

impl Memory for Timing {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.fed.remember(tape);
        self.timed.remember(tape);
        for duration in [&mut self.filter, &mut self.longest] {
            let mut nanos = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
            nanos.remember(tape);
            *duration = Duration::from_nanos(nanos);
        }
    }
}

impl Timing {
    /// Feeds `row` to `runner`.
    ///
    /// # Errors
    /// Those of the runner.
    pub fn feed(&mut self, runner: &mut Runner, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), RunError> {
        self.fed = self.fed.wrapping_add(1);
        let may_go_back = !core::ptr::eq(runner.newest(), runner);
        if !may_go_back && self.fed.wrapping_mul(0x9E37_79B9) >> 28 != 0 {
            return runner.feed(row, observer);
        }
        let mut heard = Heard {
            observer,
            spent: Duration::ZERO,
        };
        let clock = Instant::now();
        let fed = runner.feed(row, &mut heard);
        let spent = clock.elapsed().saturating_sub(heard.spent);
        self.filter += spent;
        self.longest = self.longest.max(spent);
        self.timed += 1;
        fed
    }

    /// The longest that a row took \[s\], of those that were timed.
    #[must_use]
    pub fn longest(&self) -> f64 {
        self.longest.as_secs_f64()
    }

    /// Nanoseconds in the filter per epoch, of a run of so many.
    #[must_use]
    pub(crate) fn ns_per_epoch(&self, epochs: u64) -> f64 {
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
