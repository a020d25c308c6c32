//! The mean of the input about a time: how fast the state moved then.
//!
//! The rate of the state is taken under an input averaged over [`WINDOW`] about the time of validity, as far after it
//! as before. A single sample is mostly noise; its square would count as information about τ. A mean over the past
//! alone is not enough: it contains the noise that is in the velocity too, and τ̂ would be wrong by q/E[a²] for white
//! acceleration noise of density q. The half after the time of validity gives the opposite error, and the two halves
//! cancel.

use crate::memory::{Memory, Tape};
use crate::model::Input;
use crate::time::{Time, nanos};
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::ops::Range;

/// Over how long the input is averaged \[s\].
const WINDOW: f64 = 0.1;
/// Rows of the input that are kept at least, however long they are.
const FEWEST: usize = 4;

/// A row of the input: mean rates over an interval.
#[derive(Clone, Debug, Default)]
struct Interval {
    start: Time,
    end: Time,
    values: Vec<f64>,
}
crate::memory!(Interval { start, end, values });

/// The outcome of an average.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mean {
    /// Rows up to this time were looked for.
    pub(crate) looked: Time,
    /// Whether there is input about that time.
    pub(crate) is_known: bool,
}

impl Mean {
    /// The mean of no input, which a process without input needs.
    pub(super) const NONE: Self = Self {
        looked: Time::MIN,
        is_known: true,
    };
}

/// The latest rows of the input, and their mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    rows: VecDeque<Interval>,
    spare: Vec<Interval>,
    /// A row that is still to come.
    coming: Vec<f64>,
    /// The input under which the rate is taken.
    sample: Vec<f64>,
    interval: f64,
}

impl Memory for Window {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.pooled(&mut self.rows, &mut self.spare);
    }
}

impl Window {
    /// Keeps a row that ends at `end`. It begins at `start`, or where the row before ends.
    pub(super) fn keep(&mut self, start: Option<Time>, end: Time, values: &[f64]) {
        let before = || self.rows.back().map_or(end, |last| last.end);
        let start = start.unwrap_or_else(before);
        let mut row = self.spare.pop().unwrap_or_default();
        (row.start, row.end) = (start, end);
        row.values.clear();
        row.values.extend_from_slice(values);
        self.rows.push_back(row);
        // Samples may wait for their neighbours before they are run over.
        let oldest = end.shifted(nanos(-3.0 * WINDOW));
        while self.rows.len() > FEWEST && self.rows.front().is_some_and(|row| row.end < oldest) {
            self.spare.extend(self.rows.pop_front());
        }
    }

    /// Averages the `rates` of the input about `time`. Rows that are `coming` are certainly present up to `certain`;
    /// `read` reads their numbers, and returns whether they are plausible. The numbers that are not rates are those of
    /// `held`, or of the latest row.
    pub(super) fn average<'a>(
        &mut self,
        time: Time,
        held: Option<Input<'_>>,
        rates: &Range<usize>,
        certain: Time,
        coming: impl Iterator<Item = (Time, &'a [f64])> + Clone,
        read: impl Fn(&[f64], &mut Vec<f64>) -> bool,
    ) -> Mean {
        let Some(newest) = self.rows.back() else {
            return Mean {
                is_known: false,
                ..Mean::NONE
            };
        };
        let held = held.unwrap_or(Input::held(&newest.values));
        let newest = newest.end;
        self.sample.clear();
        self.sample.extend_from_slice(held.sample);
        self.interval = held.interval;
        let half = time.shifted(nanos(0.5 * WINDOW));
        let mut from = newest;
        let coming = coming
            .filter(move |(to, _)| *to > newest)
            .take_while(move |(to, _)| core::mem::replace(&mut from, *to) < half);
        let last = coming.clone().last().map_or(newest, |(to, _)| to);
        let end = last.min(half).max(time);
        let start = end.shifted(nanos(-WINDOW));
        let (sample, mut total) = (&mut self.sample, 0.0);
        let mut add = |from: Time, to: Time, values: &[f64]| {
            let weight = to.min(end).seconds_since(from.max(start));
            if weight > 0.0 {
                if total == 0.0 {
                    sample[rates.clone()].fill(0.0);
                }
                total += weight;
                rates.clone().for_each(|k| sample[k] += weight * values[k]);
            }
        };
        self.rows.iter().for_each(|row| add(row.start, row.end, &row.values));
        let mut from = newest;
        for (to, row) in coming {
            if read(row, &mut self.coming) {
                add(from, to, &self.coming);
            }
            from = to;
        }
        if total > 0.0 {
            sample[rates.clone()].iter_mut().for_each(|mean| *mean /= total);
        }
        Mean {
            looked: if last < half { certain } else { last },
            is_known: total > 0.0,
        }
    }

    /// The input as averaged last.
    pub(super) fn mean(&self) -> Input<'_> {
        Input {
            sample: &self.sample,
            interval: self.interval,
        }
    }
}
