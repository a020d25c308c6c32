//! The input of the process: rows become samples over intervals.

use super::Port;
use crate::model::{Input, Preparation, Prepared};
use crate::time::Time;
use std::collections::VecDeque;

/// A sample of the process input and the interval that it covers.
#[derive(Clone, Debug, Default)]
pub(super) struct Sample {
    pub(super) start: Time,
    pub(super) end: Time,
    values: Vec<f64>,
}

impl Sample {
    pub(super) fn input(&self) -> Input<'_> {
        Input {
            sample: &self.values,
            interval: self.end.seconds_since(self.start),
        }
    }
}

/// Takes the rows of the input stream and holds the samples ready that are to be run over.
#[derive(Clone, Debug)]
pub(super) struct Intake {
    pub(super) port: Port,
    preparation: Option<Box<dyn Preparation>>,
    prepared: Prepared,
    /// The latest row: where it ends, and its values.
    latest: Option<(Time, Vec<f64>)>,
    /// Intervals whose samples are still being prepared.
    intervals: VecDeque<(Time, Time)>,
    /// Samples that are ready; the first may have been run over in part.
    ready: VecDeque<Sample>,
    spare: Vec<Sample>,
}

/// What a row of the input did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// It opened the first interval.
    First,
    /// It closed one and opened the next.
    Sample,
    /// It does not come after this one and was not taken.
    After(Time),
}

impl Intake {
    pub(super) fn new(port: Port, preparation: Option<Box<dyn Preparation>>) -> Self {
        Self {
            port,
            preparation,
            prepared: Prepared::default(),
            latest: None,
            intervals: VecDeque::with_capacity(4),
            ready: VecDeque::with_capacity(4),
            spare: Vec::new(),
        }
    }

    /// Whether there is a row that opens an interval.
    pub(super) const fn is_open(&self) -> bool {
        self.latest.is_some()
    }

    /// The latest row's values as they came.
    pub(super) fn latest(&self) -> Option<&[f64]> {
        self.latest.as_ref().map(|(_, values)| values.as_slice())
    }

    /// Takes the row `values` that ends at `time`.
    pub(super) fn take(&mut self, time: Time, values: &[f64]) -> Taken {
        let Some((end, latest)) = &mut self.latest else {
            // The first row closes an interval of unknown length: it only opens the next one.
            self.latest = Some((time, values.to_vec()));
            if let Some(preparation) = &mut self.preparation {
                preparation.take(0.0, values, &mut self.prepared);
            }
            return Taken::First;
        };
        if time <= *end {
            return Taken::After(*end);
        }
        let interval = (*end, time);
        *end = time;
        latest.clear();
        latest.extend_from_slice(values);
        self.intervals.push_back(interval);
        match &mut self.preparation {
            None => self.prepared.push(values, &[]),
            Some(preparation) => preparation.take(time.seconds_since(interval.0), values, &mut self.prepared),
        }
        self.make_ready();
        Taken::Sample
    }

    /// No row follows.
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

    /// The sample to be run over next, lent until it is [given back](Intake::give_back).
    pub(super) fn next(&mut self) -> Option<Sample> {
        self.ready.pop_front()
    }

    /// Takes the memory of a sample that has been run over.
    pub(super) fn give_back(&mut self, sample: Sample) {
        self.spare.push(sample);
    }
}
