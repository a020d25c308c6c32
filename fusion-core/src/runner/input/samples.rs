//! Rows become samples over intervals.

use crate::memory::{Memory, Tape};
use crate::model::{Input, Preparation, Prepared};
use crate::time::Time;
use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// A sample of the process input and the interval that it covers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sample {
    pub(crate) start: Time,
    pub(crate) end: Time,
    values: Vec<f64>,
}
crate::memory!(Sample { start, end, values });

impl Sample {
    pub(crate) fn input(&self) -> Input<'_> {
        Input {
            sample: &self.values,
            interval: self.end.seconds_since(self.start),
        }
    }
}

/// Prepares samples, and holds them for the next run.
#[derive(Debug)]
pub(super) struct Samples {
    preparation: Option<Box<dyn Preparation>>,
    prepared: Prepared,
    /// Intervals whose samples are still being prepared.
    intervals: VecDeque<(Time, Time)>,
    /// Samples that are ready; the first may have been run over in part.
    ready: VecDeque<Sample>,
    spare: Vec<Sample>,
}

impl Memory for Samples {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(preparation) = &mut self.preparation {
            preparation.remember(tape);
        }
        self.intervals.remember(tape);
        tape.pooled(&mut self.ready, &mut self.spare);
    }
}

impl Samples {
    pub(super) fn new(preparation: Option<Box<dyn Preparation>>) -> Self {
        Self {
            preparation,
            prepared: Prepared::default(),
            intervals: VecDeque::with_capacity(4),
            ready: VecDeque::with_capacity(4),
            spare: Vec::new(),
        }
    }

    /// A row opens an interval. Earlier input does not count.
    pub(super) fn open(&mut self, values: &[f64]) {
        if let Some(preparation) = &mut self.preparation {
            preparation.take(0.0, values, &mut self.prepared);
        }
    }

    /// A row closes the interval between these times.
    pub(super) fn push(&mut self, from: Time, to: Time, values: &[f64]) {
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

    /// Removes and returns the first sample that is ready.
    pub(super) fn next(&mut self) -> Option<Sample> {
        self.ready.pop_front()
    }

    /// Takes the memory of a sample that has been run over.
    pub(super) fn give_back(&mut self, sample: Sample) {
        self.spare.push(sample);
    }
}
