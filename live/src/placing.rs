//! The time of the rows of a link.

use crate::relation::Relation;
use fusion::core::memory::{Memory, Tape};
use fusion::core::time::Time;
use fusion::design::LinkClock;

/// The largest rate between the clock of arrivals and that of the filter.
const DRIFT: f64 = 1e-4;

/// The time of the filter from that of arrivals.
#[derive(Clone, Debug)]
pub(crate) struct Base {
    /// GPS time at the time zero of the filter \[ns\], if it is known.
    zero: Option<i64>,
    /// Otherwise the relation of stamps to arrivals.
    learnt: Relation,
}

fusion::core::memory!(Base { learnt; zero });

impl Base {
    /// With GPS time at the time zero of the filter; without it, the relation is learnt from rows with their own stamps.
    pub(crate) fn new(zero: Option<i64>) -> Self {
        Self {
            zero,
            learnt: Relation::new(DRIFT),
        }
    }

    /// The time of the filter at an arrival; `None` before it is known.
    pub(crate) fn time_at(&self, arrival: i64) -> Option<i64> {
        match self.zero {
            Some(zero) => Some(arrival.saturating_sub(zero)),
            None => self.learnt.stamp_at(arrival),
        }
    }

    pub(crate) fn forget(&mut self) {
        self.learnt.forget();
    }
}

/// The time of the rows of one source.
#[derive(Clone, Debug)]
pub(crate) struct Placing {
    clock: LinkClock,
    relation: Relation,
    /// The last time that was given.
    last: Option<i64>,
    /// Rows without a time: the clocks were not related yet.
    pub(crate) unplaced: u64,
}

impl Memory for Placing {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.relation.remember(tape);
        self.last.remember(tape);
        self.unplaced.remember(tape);
    }
}

impl Placing {
    pub(crate) fn new(clock: LinkClock, drift: Option<f64>) -> Self {
        Self {
            clock,
            relation: Relation::new(drift.unwrap_or(DRIFT)),
            last: None,
            unplaced: 0,
        }
    }

    /// The time of a row with this stamp, which arrived then \[ns\].
    pub(crate) fn place(&mut self, stamp: Time, arrival: i64, base: &mut Base) -> Option<Time> {
        let time = match self.clock {
            LinkClock::Own => {
                base.learnt.add(stamp.nanos(), arrival);
                return Some(stamp);
            }
            LinkClock::Related => {
                let jumps = self.relation.jumps();
                self.relation.add(stamp.nanos(), arrival);
                if self.relation.jumps() > jumps {
                    self.last = None;
                }
                base.time_at(stamp.nanos().saturating_add(self.relation.offset(stamp.nanos())))
            }
            LinkClock::Arrival => base.time_at(arrival),
        };
        let Some(time) = time else {
            self.unplaced += 1;
            return None;
        };
        // The envelope moves a little: rows keep their order.
        let time = self.last.map_or(time, |last| time.max(last.saturating_add(1)));
        self.last = Some(time);
        Some(Time::from_nanos(time))
    }

    /// The relation of its clock to that of arrivals, if its rows are placed by it.
    pub(crate) fn relation(&self) -> Option<&Relation> {
        (self.clock == LinkClock::Related).then_some(&self.relation)
    }

    pub(crate) fn forget(&mut self) {
        self.relation.forget();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::core::testing::Lcg;

    const S: i64 = 1_000_000_000;

    /// Places rows at 100 Hz of a unit whose clock counts from its start, and which arrive with a delay; after 50 s its
    /// clock is set to zero. Returns the largest error \[ns\] of the rows of the given seconds.
    fn worst(clock: LinkClock, base: &mut Base, seconds: core::ops::Range<i64>) -> i64 {
        let mut placing = Placing::new(clock, None);
        let mut random = Lcg::new(11);
        let mut worst = 0;
        for k in 0..10_000_i64 {
            let sure = 1000 * S + k * S / 100;
            let stamp = if k < 5000 { k * S / 100 + 77 * S } else { (k - 5000) * S / 100 };
            let arrival = sure + (random.unit() * 0.004 * S as f64) as i64;
            let placed = placing.place(Time::from_nanos(stamp), arrival, base).unwrap();
            if seconds.contains(&(k / 100)) {
                worst = worst.max((placed.nanos() - sure).abs());
            }
        }
        worst
    }

    #[test]
    fn rows_of_an_own_clock_are_placed_on_that_of_arrivals_before_and_after_its_reset() {
        let mut base = Base::new(Some(0));
        for seconds in [5..50, 55..100] {
            // 1 ms: in its first seconds the envelope follows few points, of delays that are even in 0 to 4 ms.
            let found = worst(LinkClock::Related, &mut base, seconds.clone());
            assert!(found < 1_000_000, "{seconds:?}: {found} ns");
            let found = worst(LinkClock::Arrival, &mut base, seconds);
            assert!((3_900_000..=4_000_000).contains(&found), "{found} ns: the delay itself");
        }
    }

    #[test]
    fn rows_have_no_time_before_the_clocks_are_related() {
        let mut base = Base::new(None);
        let mut arrival = Placing::new(LinkClock::Arrival, None);
        assert_eq!(arrival.place(Time::MIN, 5 * S, &mut base), None);
        assert_eq!(arrival.unplaced, 1);
        // A source with its own stamps gives the time of the filter.
        Placing::new(LinkClock::Own, None).place(Time::from_nanos(3 * S), 9 * S, &mut base);
        assert_eq!(arrival.place(Time::MIN, 10 * S, &mut base), Some(Time::from_nanos(4 * S)));
        // Rows of one arrival keep their order.
        assert_eq!(arrival.place(Time::MIN, 10 * S, &mut base), Some(Time::from_nanos(4 * S + 1)));
    }
}
