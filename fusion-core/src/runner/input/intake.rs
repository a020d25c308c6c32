//! The input of the process: checks its rows, and makes samples of them.

use super::coverage::Coverage;
use super::expectation::Expectation;
use super::guard::{Guard, Judged};
use super::samples::{Sample, Samples};
use super::window::{Mean, Window};
use crate::memory::{Memory, Tape};
use crate::model::{Input, Process};
use crate::runner::rows::Stored;
use crate::runner::{Discard, InputLimits, Port, RowId};
use crate::time::{Time, nanos};
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::ops::Range;

/// A row of the input: its identity, the end of its sample, and the numbers that the process reads.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reading {
    pub(crate) time: Time,
    pub(crate) id: RowId,
    values: Vec<f64>,
}
crate::memory!(Reading { time, id, values });

/// The effect of a row of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    /// It opened the first interval.
    First,
    /// It closed an interval and opened the next one.
    Sample,
    /// It ends a gap that began at `since`: its sample begins at `start`. The time between has to be coasted through
    /// before [`Intake::resume`] takes the row.
    Resumes { since: Time, start: Time },
}

/// The next step through a silence of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Silence {
    /// The waiting rows are spikes: no row comes that could confirm them.
    Settles,
    /// The process coasts to this time.
    Coasts(Time),
    /// The gap is too long to coast through, at this time.
    Stops(Time),
}

/// Takes the rows of the input stream and holds the samples for the next run. Without a stream it is always empty.
#[derive(Debug)]
pub(crate) struct Intake {
    port: Option<Port>,
    /// The numbers of a sample that are rates.
    rates: Range<usize>,
    guard: Guard,
    coverage: Coverage,
    /// Rows that wait for others to show whether they are spikes.
    suspects: VecDeque<Reading>,
    spare: Vec<Reading>,
    samples: Samples,
    /// The latest input, for sensors whose time offset is estimated; kept only if there are any.
    window: Window,
    keeps_window: bool,
    /// The input as it was expected, for gaps and for sensors that read its signals.
    expectation: Expectation,
}

impl Memory for Intake {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(port) = &self.port {
            self.guard.remember(tape);
            self.coverage.remember(tape);
            tape.pooled(&mut self.suspects, &mut self.spare);
            self.samples.remember(tape);
            if tape.is_reading() && self.suspects.iter().any(|suspect| suspect.values.len() != port.columns.len()) {
                tape.refuse("a row of the input has another width");
            }
        }
        self.window.remember(tape);
        self.expectation.remember(tape);
    }
}

/// Declarations, before the first row.
impl Intake {
    /// The input of a process that time alone moves.
    pub(crate) fn none() -> Self {
        Self {
            port: None,
            rates: 0..0,
            guard: Guard::default(),
            coverage: Coverage::default(),
            suspects: VecDeque::new(),
            spare: Vec::new(),
            samples: Samples::new(None),
            window: Window::default(),
            keeps_window: false,
            expectation: Expectation::default(),
        }
    }

    /// The input of `process`, read at `port`.
    pub(crate) fn new(port: Port, process: &dyn Process) -> Self {
        let reading = || Reading {
            values: Vec::with_capacity(port.columns.len()),
            ..Reading::default()
        };
        let mut intake = Self {
            rates: process.rates(),
            guard: Guard::new(process.agility()),
            suspects: VecDeque::with_capacity(4),
            // The row at hand and two suspects, and one more row while the runner looks ahead.
            spare: core::iter::repeat_with(reading).take(4).collect(),
            samples: Samples::new(process.preparation()),
            ..Self::none()
        };
        intake.port = Some(port);
        intake.limit(InputLimits::default());
        intake
    }

    /// Sets the limits of the rows.
    pub(crate) fn limit(&mut self, limits: InputLimits) {
        self.guard.limit(limits.range);
        self.coverage.pace.declared = limits.longest_interval.map(nanos);
        self.coverage.longest_gap = nanos(limits.longest_gap);
    }

    /// Sets whether the latest rows are kept for [`Intake::average`].
    pub(crate) const fn keep_window(&mut self, is_kept: bool) {
        self.keeps_window = is_kept;
    }

    /// Its stream, and the columns that it reads.
    pub(crate) const fn port(&self) -> Option<&Port> {
        self.port.as_ref()
    }
}

/// How far it is.
impl Intake {
    /// The longest time that one sample covers \[ns\].
    pub(crate) fn longest(&self) -> i64 {
        self.coverage.pace.longest()
    }

    /// The latest row's values as they came. `None` if no row opens an interval.
    pub(crate) fn latest(&self) -> Option<&[f64]> {
        self.coverage.latest()
    }

    /// The end of the latest row: the beginning of a gap.
    pub(crate) fn end(&self) -> Option<Time> {
        self.coverage.end()
    }

    /// Whether a gap is being coasted through.
    pub(crate) const fn is_coasting(&self) -> bool {
        self.coverage.is_coasting()
    }

    /// The time up to which there are rows, used or not, or coasting.
    fn reached(&self) -> Option<Time> {
        self.suspects.back().map(|suspect| suspect.time).or(self.coverage.covered())
    }

    /// Whether a row that ends at `time` comes after a gap.
    pub(crate) fn is_after_gap(&self, time: Time) -> bool {
        self.reached().is_some_and(|reached| self.coverage.is_gap(reached, time))
    }

    /// The next step because of a silence of the input, if it is due before `until`.
    pub(crate) fn silence(&self, until: Time) -> Option<Silence> {
        let to = self.reached()?.shifted(self.longest());
        (to < until).then(|| {
            if !self.suspects.is_empty() {
                Silence::Settles
            } else if self.coverage.is_too_long(to) {
                Silence::Stops(to)
            } else {
                Silence::Coasts(to)
            }
        })
    }
}

/// Rows come in.
impl Intake {
    /// Reads a row that ends at `time`, lent until it is [given back](Intake::give_back).
    pub(crate) fn read(&mut self, time: Time, row: &Stored) -> Reading {
        let mut reading = self.spare.pop().unwrap_or_default();
        if let Some(port) = &self.port {
            (reading.time, reading.id) = (time, row.id(&port.columns));
            port.gather(row.values(), &mut reading.values);
        }
        reading
    }

    /// Takes the memory of a row.
    pub(crate) fn give_back(&mut self, reading: Reading) {
        self.spare.push(reading);
    }

    /// Checks whether a row is acceptable. No row may wait before a gap.
    pub(crate) fn admit(&mut self, reading: &Reading) -> Result<(), Discard> {
        let Reading { time, values, .. } = reading;
        if !values.iter().all(|v| v.is_finite()) {
            return Err(Discard::NotFinite);
        }
        if let Some(now) = self.reached().filter(|now| time <= now) {
            return Err(Discard::Late { now });
        }
        if self.is_after_gap(*time) {
            self.guard.forget();
        }
        self.guard.admit(values)
    }

    /// Judges a row that was admitted by those before it.
    pub(crate) fn judge(&mut self, reading: &Reading) -> Judged {
        self.guard.judge(&reading.values, self.suspects.len(), self.coverage.pace.usual)
    }

    /// A row waits for others to show whether it is a spike.
    pub(crate) fn wait(&mut self, suspect: Reading) {
        self.suspects.push_back(suspect);
    }

    /// Removes the first waiting row. Returns it with the reason why it waited.
    pub(crate) fn settle(&mut self) -> Option<(Reading, Discard)> {
        let suspect = self.suspects.pop_front()?;
        Some((suspect, self.guard.suspicion()))
    }

    /// Learns from a row that was a spike.
    pub(crate) fn refuse(&mut self, reading: &Reading) {
        self.guard.learn(&reading.values);
    }

    /// Takes a row that has passed.
    pub(crate) fn take(&mut self, reading: &Reading) -> Taken {
        let Reading { time, values, .. } = reading;
        self.guard.pass(values);
        let taken = self.use_row(*time, values);
        if self.keeps_window {
            let start = match taken {
                Taken::First => Some(*time),
                Taken::Sample => None,
                Taken::Resumes { start, .. } => Some(start),
            };
            self.window.keep(start, *time, values);
        }
        taken
    }

    fn use_row(&mut self, time: Time, values: &[f64]) -> Taken {
        let Some(end) = self.end() else {
            // The first row closes an interval of unknown length: it only opens the next one.
            self.open(time, values);
            return Taken::First;
        };
        let is_gap = self.coverage.is_gap(end, time);
        self.coverage.pace.learn(time.nanos().saturating_sub(end.nanos()));
        if !is_gap {
            self.push(end, time, values);
            return Taken::Sample;
        }
        // Samples before a gap predict nothing after it.
        self.expectation.forget();
        let start = time.shifted(-self.coverage.pace.usual).max(self.coverage.covered().unwrap_or(end));
        Taken::Resumes { since: end, start }
    }

    /// Takes the row that ends a gap: its sample begins at `start`.
    pub(crate) fn resume(&mut self, start: Time, reading: &Reading) {
        self.coverage.resume();
        self.open(start, &reading.values);
        self.push(start, reading.time, &reading.values);
    }

    fn open(&mut self, time: Time, values: &[f64]) {
        self.coverage.extend(time, values);
        self.samples.open(values);
    }

    fn push(&mut self, from: Time, to: Time, values: &[f64]) {
        self.coverage.extend(to, values);
        self.samples.push(from, to, values);
    }

    /// The gap is coasted through up to `time`. A sample that the preparation held back for a neighbour will get none.
    pub(crate) fn coast(&mut self, time: Time) {
        self.samples.finish();
        self.coverage.coast(time);
    }

    /// No row follows.
    pub(crate) fn finish(&mut self) {
        self.samples.finish();
    }

    /// Forgets the input: the next row counts as the first.
    pub(crate) fn close(&mut self) {
        self.coverage.close();
    }
}

/// Samples go out.
impl Intake {
    /// The next sample to run over, lent until it is [taken back](Intake::take_back).
    pub(crate) fn next(&mut self) -> Option<Sample> {
        self.samples.next()
    }

    /// Takes the memory of a sample that has been run over.
    pub(crate) fn take_back(&mut self, sample: Sample) {
        self.samples.give_back(sample);
    }

    /// Notes a new current sample.
    pub(crate) fn expect(&mut self, sample: &Sample) {
        self.expectation.take(sample.end, &sample.input(), &self.rates);
    }

    /// The current sample as it was expected; `None` before the second sample, and in a gap.
    pub(crate) fn expected(&self) -> Option<Input<'_>> {
        if self.is_coasting() { None } else { self.expectation.input() }
    }

    /// The expected sample after the current one, for the beginning of a gap; `None` before the second sample.
    pub(crate) fn expected_next(&mut self) -> Option<Input<'_>> {
        self.expectation.next(&self.rates)
    }

    /// Averages the input about `time`. `held` is the current sample. `coming` are the rows that are still to be taken
    /// and valid up to the time `certain`, from which later rows may be missing.
    pub(crate) fn average<'a>(
        &mut self,
        time: Time,
        held: Option<Input<'_>>,
        certain: Time,
        coming: impl Iterator<Item = (Time, &'a [f64])> + Clone,
    ) -> Mean {
        let Some(port) = &self.port else { return Mean::NONE };
        let guard = &self.guard;
        let read = |row: &[f64], values: &mut Vec<f64>| {
            port.gather(row, values);
            guard.is_plausible(values)
        };
        self.window.average(time, held, &self.rates, certain, coming, read)
    }

    /// The input as averaged last.
    pub(crate) fn mean(&self) -> Input<'_> {
        self.window.mean()
    }
}
