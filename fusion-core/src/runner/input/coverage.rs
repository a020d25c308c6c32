//! The time that the input covers: by its samples, and by coasting through a gap.

use crate::math;
use crate::time::Time;
use alloc::vec::Vec;

/// The latest row, the gap after it, and how long both may last.
#[derive(Clone, Debug, Default)]
pub(super) struct Coverage {
    pub(super) pace: Pace,
    /// The longest gap to coast through \[ns\].
    pub(super) longest_gap: i64,
    /// The latest row: where it ends, and its values.
    latest: Option<(Time, Vec<f64>)>,
    /// The time up to which the present gap has been coasted through.
    coasted: Option<Time>,
}
crate::memory!(Coverage { pace, latest, coasted; longest_gap });

impl Coverage {
    /// The latest row's values as they came.
    pub(super) fn latest(&self) -> Option<&[f64]> {
        self.latest.as_ref().map(|(_, values)| values.as_slice())
    }

    /// The end of the latest row: the beginning of a gap.
    pub(super) fn end(&self) -> Option<Time> {
        self.latest.as_ref().map(|(end, _)| *end)
    }

    /// The time up to which there is input or coasting.
    pub(super) fn covered(&self) -> Option<Time> {
        self.coasted.or(self.end())
    }

    /// Whether a gap is being coasted through.
    pub(super) const fn is_coasting(&self) -> bool {
        self.coasted.is_some()
    }

    /// Whether a row that ends at `time` comes after a gap, rows having come up to `reached`.
    pub(super) fn is_gap(&self, reached: Time, time: Time) -> bool {
        self.is_coasting() || time > reached.shifted(self.pace.longest())
    }

    /// Whether a gap that lasts until `time` is too long to coast through.
    pub(super) fn is_too_long(&self, time: Time) -> bool {
        self.end().is_some_and(|end| time > end.shifted(self.longest_gap))
    }

    /// The gap has been coasted through up to `time`.
    pub(super) const fn coast(&mut self, time: Time) {
        self.coasted = Some(time);
    }

    /// A gap is over.
    pub(super) const fn resume(&mut self) {
        self.coasted = None;
    }

    /// The latest row has these values and ends at `time`.
    pub(super) fn extend(&mut self, time: Time, values: &[f64]) {
        let (end, latest) = self.latest.get_or_insert_default();
        *end = time;
        latest.clear();
        latest.extend_from_slice(values);
    }

    /// Forgets the input: the next row counts as the first.
    pub(super) fn close(&mut self) {
        self.latest = None;
        self.coasted = None;
    }
}

/// The number of intervals of which the usual interval is the median.
const LEARNT: usize = 16;
/// One sample covers at most this number of usual intervals, unless a limit is declared.
const MOST_INTERVALS: i64 = 10;
/// A shorter interval is never a gap \[ns\]: stamps jitter.
const LEAST_GAP: i64 = 100_000_000;
/// The longest time that a sample covers before the usual interval is known \[ns\].
const UNKNOWN: i64 = 1_000_000_000;

/// How densely the rows come: the usual interval, learnt from them.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    /// The longest time that one sample covers, if it is declared \[ns\].
    pub(super) declared: Option<i64>,
    latest: [i64; LEARNT],
    count: usize,
    /// The median of the latest intervals, renewed when they have all been replaced \[ns\].
    pub(super) usual: i64,
}
crate::memory!(Pace { latest, count, usual; declared });

impl Default for Pace {
    fn default() -> Self {
        Self {
            declared: None,
            latest: [0; LEARNT],
            count: 0,
            usual: UNKNOWN / MOST_INTERVALS,
        }
    }
}

impl Pace {
    /// Takes the interval between two rows \[ns\].
    pub(super) fn learn(&mut self, interval: i64) {
        self.latest[self.count % LEARNT] = interval;
        self.count += 1;
        // At 4, 8 and 16 intervals, then whenever all are new.
        if self.count.is_multiple_of(LEARNT) || self.count == 4 || self.count == 8 {
            let known = &self.latest[..self.count.min(LEARNT)];
            self.usual = math::middle(known, i64::cmp).unwrap_or(self.usual);
        }
    }

    /// The longest time that one sample covers \[ns\].
    pub(super) fn longest(&self) -> i64 {
        let learnt = self.usual.saturating_mul(MOST_INTERVALS).max(LEAST_GAP);
        self.declared.unwrap_or(learnt)
    }
}
