//! The input of the process: rows become samples over intervals.

use super::guard::{Guard, Judged};
use super::{Discard, InputLimits, Port};
use crate::memory::{Memory, Tape};
use crate::model::{Input, Preparation, Prepared, Process};
use crate::time::{Time, nanos};
use std::collections::VecDeque;

/// A sample of the process input and the interval that it covers.
#[derive(Clone, Debug, Default)]
pub(super) struct Sample {
    pub(super) start: Time,
    pub(super) end: Time,
    values: Vec<f64>,
}
crate::memory!(Sample { start, end, values });

impl Sample {
    pub(super) fn input(&self) -> Input<'_> {
        Input {
            sample: &self.values,
            interval: self.end.seconds_since(self.start),
        }
    }
}

/// Takes the rows of the input stream and holds the samples for the next run.
#[derive(Debug)]
pub(super) struct Intake {
    pub(super) port: Port,
    preparation: Option<Box<dyn Preparation>>,
    prepared: Prepared,
    guard: Guard,
    pace: Pace,
    /// The longest gap to coast through \[ns\].
    longest_gap: i64,
    /// The latest row: where it ends, and its values.
    latest: Option<(Time, Vec<f64>)>,
    /// Rows that wait for others to show whether they are spikes.
    suspects: VecDeque<Suspect>,
    /// The time up to which the present gap has been coasted through.
    coasted: Option<Time>,
    /// Intervals whose samples are still being prepared.
    intervals: VecDeque<(Time, Time)>,
    /// Samples that are ready; the first may have been run over in part.
    ready: VecDeque<Sample>,
    spare: Vec<Sample>,
}

impl Memory for Intake {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(preparation) = &mut self.preparation {
            preparation.remember(tape);
        }
        self.guard.remember(tape);
        self.pace.remember(tape);
        self.latest.remember(tape);
        self.suspects.remember(tape);
        self.coasted.remember(tape);
        self.intervals.remember(tape);
        tape.pooled(&mut self.ready, &mut self.spare);
    }
}

/// A row that waits, and the end of its sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Suspect {
    pub(super) time: Time,
    pub(super) row: usize,
}
crate::memory!(Suspect { time, row });

/// The effect of a row of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It opened the first interval.
    First,
    /// It closed an interval and opened the next one.
    Sample,
    /// It ends a gap that began at `since`: its sample begins at `start`. The time between has to be coasted through
    /// before [`Intake::resume`] takes the row.
    Resumes { since: Time, start: Time },
}

impl Intake {
    pub(super) fn new(port: Port, preparation: Option<Box<dyn Preparation>>) -> Self {
        let mut intake = Self {
            port,
            preparation,
            prepared: Prepared::default(),
            guard: Guard::default(),
            pace: Pace::default(),
            longest_gap: 0,
            latest: None,
            suspects: VecDeque::with_capacity(4),
            coasted: None,
            intervals: VecDeque::with_capacity(4),
            ready: VecDeque::with_capacity(4),
            spare: Vec::new(),
        };
        intake.limit(InputLimits::default());
        intake
    }

    pub(super) fn limit(&mut self, limits: InputLimits) {
        self.guard.range = limits.range;
        self.pace.declared = limits.longest_interval.map(nanos);
        self.longest_gap = nanos(limits.longest_gap);
    }

    /// The longest time that one sample covers \[ns\].
    pub(super) fn longest(&self) -> i64 {
        self.pace.longest()
    }

    /// Whether there is a row that opens an interval.
    pub(super) const fn is_open(&self) -> bool {
        self.latest.is_some()
    }

    /// The latest row's values as they came.
    pub(super) fn latest(&self) -> Option<&[f64]> {
        self.latest.as_ref().map(|(_, values)| values.as_slice())
    }

    /// The end of the latest row: the beginning of a gap.
    pub(super) fn end(&self) -> Option<Time> {
        self.latest.as_ref().map(|(end, _)| *end)
    }

    /// The time up to which there is input or coasting.
    fn covered(&self) -> Option<Time> {
        self.coasted.or(self.end())
    }

    /// The time up to which there are rows, used or not, or coasting.
    fn reached(&self) -> Option<Time> {
        self.suspects.back().map(|suspect| suspect.time).or(self.covered())
    }

    /// Whether a row that ends at `time` comes after a gap.
    pub(super) fn is_after_gap(&self, time: Time) -> bool {
        let is_late = |end: Time| self.coasted.is_some() || time > end.shifted(self.pace.longest());
        self.reached().is_some_and(is_late)
    }

    /// Checks whether the row `values` that ends at `time` is acceptable. Its numbers must be finite, and no row may
    /// wait before a gap.
    pub(super) fn admit(&mut self, time: Time, values: &[f64]) -> Result<(), Discard> {
        if let Some(now) = self.reached().filter(|now| time <= *now) {
            return Err(Discard::Late { now });
        }
        if self.is_after_gap(time) {
            self.guard.forget();
        }
        self.guard.admit(values)
    }

    /// Judges a row that was admitted by those before it.
    pub(super) fn judge(&mut self, values: &[f64], process: &dyn Process) -> Judged {
        self.guard.judge(values, self.suspects.len(), self.pace.usual, process)
    }

    /// The present row waits for others.
    pub(super) fn wait(&mut self, suspect: Suspect) {
        self.suspects.push_back(suspect);
    }

    /// The waiting rows, in order.
    pub(super) const fn suspects(&self) -> &VecDeque<Suspect> {
        &self.suspects
    }

    /// Removes the first waiting row. Returns it with the reason why it waited.
    pub(super) fn settle(&mut self) -> Option<(Suspect, Discard)> {
        let suspect = self.suspects.pop_front()?;
        Some((suspect, self.guard.suspicion()))
    }

    /// Learns from a row that was a spike.
    pub(super) fn refuse(&mut self, values: &[f64], process: &dyn Process) {
        self.guard.learn(values, process);
    }

    /// Takes the row `values`, which ends at `time` and has passed.
    pub(super) fn take(&mut self, time: Time, values: &[f64], process: &dyn Process) -> Taken {
        let is_gap = self
            .end()
            .is_some_and(|end| self.coasted.is_some() || time > end.shifted(self.pace.longest()));
        self.guard.pass(values, process);
        let Some(end) = self.end() else {
            // The first row closes an interval of unknown length: it only opens the next one.
            self.open(time, values);
            return Taken::First;
        };
        self.pace.learn(time.nanos().saturating_sub(end.nanos()));
        if !is_gap {
            self.push(end, time, values);
            return Taken::Sample;
        }
        let start = time.shifted(-self.pace.usual).max(self.covered().unwrap_or(end));
        Taken::Resumes { since: end, start }
    }

    /// Takes the row that ends a gap: its sample covers `start` to `time`.
    pub(super) fn resume(&mut self, start: Time, time: Time, values: &[f64]) {
        self.coasted = None;
        self.open(start, values);
        self.push(start, time, values);
    }

    /// Whether a row that is still to come may be looked at.
    pub(super) fn is_plausible(&self, values: &[f64], process: &dyn Process) -> bool {
        self.guard.is_plausible(values, process)
    }

    /// Forgets the input: the next row counts as the first.
    pub(super) fn close(&mut self) {
        self.latest = None;
        self.coasted = None;
    }

    /// Takes a row that opens an interval at `time`. Earlier input does not count.
    fn open(&mut self, time: Time, values: &[f64]) {
        let (end, latest) = self.latest.get_or_insert_default();
        *end = time;
        latest.clear();
        latest.extend_from_slice(values);
        if let Some(preparation) = &mut self.preparation {
            preparation.take(0.0, values, &mut self.prepared);
        }
    }

    /// The sample of an interval.
    fn push(&mut self, from: Time, to: Time, values: &[f64]) {
        let (end, latest) = self.latest.get_or_insert_default();
        *end = to;
        latest.clear();
        latest.extend_from_slice(values);
        self.intervals.push_back((from, to));
        match &mut self.preparation {
            None => self.prepared.push(values, &[]),
            Some(preparation) => preparation.take(to.seconds_since(from), values, &mut self.prepared),
        }
        self.make_ready();
    }

    /// No row follows, or no row for a while.
    pub(super) fn finish(&mut self) {
        if let Some(preparation) = &mut self.preparation {
            preparation.finish(&mut self.prepared);
        }
        self.make_ready();
    }

    /// The end of the next step through a gap. The step is due when a later row is processed.
    pub(super) fn coasting_due(&self) -> Option<Time> {
        self.reached().map(|reached| reached.shifted(self.pace.longest()))
    }

    /// Notes that the gap has been coasted through up to `time`.
    pub(super) const fn coast(&mut self, time: Time) {
        self.coasted = Some(time);
    }

    /// Whether a gap is being coasted through.
    pub(super) const fn is_coasting(&self) -> bool {
        self.coasted.is_some()
    }

    /// Whether a gap that lasts until `time` is too long to coast through.
    pub(super) fn is_lost(&self, time: Time) -> bool {
        self.end().is_some_and(|end| time > end.shifted(self.longest_gap))
    }

    fn make_ready(&mut self) {
        for values in self.prepared.samples() {
            let Some((start, end)) = self.intervals.pop_front() else { break };
            let mut sample = self.spare.pop().unwrap_or_default();
            (sample.start, sample.end) = (start, end);
            sample.values.clear();
            sample.values.extend_from_slice(values);
            self.ready.push_back(sample);
        }
        self.prepared.clear();
    }

    /// The next sample to run over, lent until it is [given back](Intake::give_back).
    pub(super) fn next(&mut self) -> Option<Sample> {
        self.ready.pop_front()
    }

    /// Takes the memory of a sample that has been run over.
    pub(super) fn give_back(&mut self, sample: Sample) {
        self.spare.push(sample);
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
struct Pace {
    declared: Option<i64>,
    latest: [i64; LEARNT],
    count: usize,
    /// The median of the latest intervals, renewed when they have all been replaced \[ns\].
    usual: i64,
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
    fn learn(&mut self, interval: i64) {
        self.latest[self.count % LEARNT] = interval;
        self.count += 1;
        // At 4, 8 and 16 intervals, then whenever all are new.
        if self.count.is_multiple_of(LEARNT) || self.count == 4 || self.count == 8 {
            let mut known = self.latest;
            let known = &mut known[..self.count.min(LEARNT)];
            known.sort_unstable();
            self.usual = known[known.len() / 2];
        }
    }

    /// The longest time that one sample covers \[ns\].
    fn longest(&self) -> i64 {
        let learnt = self.usual.saturating_mul(MOST_INTERVALS).max(LEAST_GAP);
        self.declared.unwrap_or(learnt)
    }
}
