//! The times at which the sources of a simulated run have rows.

use fusion_core::Time;
use fusion_core::time::nanos;

/// A source of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Imu,
    Odometry,
    TrackSpeeds,
    /// A ship, and its instrument.
    Ship(usize, usize),
    Sensor(usize),
    Reference,
    Control,
}

/// When a source has its next row.
#[derive(Clone, Debug)]
struct Clock {
    source: Source,
    rate: f64,
    start: i64,
    count: u64,
    next: Time,
}

impl Clock {
    /// Counted, not added up: the millionth instant is as exact as the first.
    fn set(&mut self, count: u64) {
        self.count = count;
        self.next = Time::from_nanos(self.start).shifted(nanos(count as f64 / self.rate));
    }
}

/// The clocks of all sources, and the source with the next row.
#[derive(Clone, Debug, Default)]
pub(super) struct Clocks {
    all: Vec<Clock>,
    /// The index of the clock whose row comes next.
    due: usize,
}

impl Clocks {
    /// Adds a source with `rate` rows per second, the first at `start` \[ns\].
    pub(super) fn add(&mut self, source: Source, rate: f64, start: i64) {
        self.all.push(Clock {
            source,
            rate,
            start,
            count: 0,
            next: Time::from_nanos(start),
        });
        self.look();
    }

    /// The source of the next row, and its instant. If several are due at the same instant, the source added first.
    pub(super) fn due(&self) -> Option<(Source, Time)> {
        self.all.get(self.due).map(|clock| (clock.source, clock.next))
    }

    /// The row of `source` has come: its next row is due.
    pub(super) fn tick(&mut self, source: Source) {
        self.change(source, |clock| clock.set(clock.count + 1));
    }

    /// The rows of `source` are counted from `start` on \[ns\].
    pub(super) fn restart(&mut self, source: Source, start: i64) {
        self.change(source, |clock| {
            clock.start = start;
            clock.set(clock.count);
        });
    }

    /// Changes the clock of `source`, and finds the clock that is due next.
    fn change(&mut self, source: Source, change: impl FnOnce(&mut Clock)) {
        if let Some(clock) = self.all.iter_mut().find(|clock| clock.source == source) {
            change(clock);
        }
        self.look();
    }

    fn look(&mut self) {
        let clocks = self.all.iter().enumerate();
        self.due = clocks.min_by_key(|(_, clock)| clock.next).map_or(0, |(number, _)| number);
    }

    /// About how many rows of `source`, or of all others, come within `seconds`.
    pub(super) fn rows(&self, source: Source, seconds: f64) -> [f64; 2] {
        let of = |is_it: bool| self.all.iter().filter(move |clock| (clock.source == source) == is_it);
        [true, false].map(|is_it| of(is_it).map(|clock| 1.0 + clock.rate * seconds).sum())
    }
}
