//! The outcome of every row, for each of its consumers.

use super::{Entry, Listed, RunEnd, RunEvent, RunObserver, SectionObserver, Summary};
use fusion_core::filter::Verdict;
use fusion_core::memory::Memory;
use fusion_core::runner::{Discard, Event, Halt, Runner, StreamId};
use schemars::JsonSchema;
use serde::Serialize;

/// The outcomes of the rows of one consumer: the process, an initialiser, a stage or a sensor. Each row is in exactly
/// one of the counts after `rows`, and these counts add up to `rows`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ConsumerCounts {
    /// The consumer. If it has several inputs, with the input: `initial.fix (input 2)`.
    pub name: String,
    /// The stream that it reads.
    pub stream: String,
    /// Rows of the stream.
    pub rows: u64,
    /// Rows that were used. For a sensor: rows that corrected the estimate.
    pub used: u64,
    /// Rows that the sensor's gate rejected.
    pub rejected: u64,
    /// Rows without a value at the estimate, or that could not be used.
    pub unusable: u64,
    /// For an initialiser: rows that came when the filter was already running.
    pub not_needed: u64,
    /// Rows before `start` under `[run]`.
    pub before_run: u64,
    /// Rows after `stop` under `[run]`.
    pub after_run: u64,
    /// Rows not later than the row that started the filter.
    pub before_start: u64,
    /// Rows that came too late for the buffer.
    pub late: u64,
    /// Rows with a number that is not finite.
    pub not_finite: u64,
    /// Rows with a number outside the range of the instrument.
    pub out_of_range: u64,
    /// Rows with a number that differs from its neighbours by more than the vehicle can change.
    pub spikes: u64,
    /// Rows in which the instrument repeated one sample.
    pub frozen: u64,
    /// Rows of a sensor that was switched off.
    pub switched_off: u64,
    /// Rows with a stamp far ahead of all others.
    pub time_jumps: u64,
    /// Rows discarded for a reason that has no separate count yet.
    pub otherwise: u64,
}

impl ConsumerCounts {
    /// All counts of outcomes, with their names.
    #[must_use]
    pub const fn outcomes(&self) -> [(&'static str, u64); 15] {
        [
            ("used", self.used),
            ("rejected", self.rejected),
            ("unusable", self.unusable),
            ("not needed", self.not_needed),
            ("before the run", self.before_run),
            ("after the run", self.after_run),
            ("before the start", self.before_start),
            ("late", self.late),
            ("not finite", self.not_finite),
            ("out of range", self.out_of_range),
            ("spikes", self.spikes),
            ("frozen", self.frozen),
            ("switched off", self.switched_off),
            ("time jumps", self.time_jumps),
            ("otherwise", self.otherwise),
        ]
    }

    fn discard(&mut self, why: &Discard) {
        let count = match why {
            Discard::BeforeStart => &mut self.before_start,
            Discard::Late { .. } => &mut self.late,
            Discard::NotFinite => &mut self.not_finite,
            Discard::OutOfRange { .. } => &mut self.out_of_range,
            Discard::Spike { .. } => &mut self.spikes,
            Discard::Frozen => &mut self.frozen,
            Discard::SwitchedOff => &mut self.switched_off,
            Discard::TimeJump { .. } => &mut self.time_jumps,
            _ => &mut self.otherwise,
        };
        *count += 1;
    }

    fn judge(&mut self, verdict: &Verdict) {
        let count = match verdict {
            Verdict::Accepted | Verdict::Reacquired => &mut self.used,
            Verdict::Rejected => &mut self.rejected,
            Verdict::Undefined(_) | Verdict::Unusable => &mut self.unusable,
        };
        *count += 1;
    }
}

/// A consumer, or one input of several.
#[derive(Debug)]
struct Followed {
    consumer: String,
    input: usize,
    stream: StreamId,
    counts: ConsumerCounts,
}

fusion_core::memory!(Followed { counts; consumer, input, stream });
fusion_core::memory!(ConsumerCounts {
    rows,
    used,
    rejected,
    unusable,
    not_needed,
    before_run,
    after_run,
    before_start,
    late,
    not_finite,
    out_of_range,
    spikes,
    frozen,
    switched_off,
    time_jumps,
    otherwise;
    name,
    stream
});

/// Follows the rows to the consumers of the outermost filter.
#[derive(Debug)]
pub(crate) struct Consumers {
    /// First the consumers whose accepted rows cause no event, then the initialisers, then the sensors.
    followed: Box<[Followed]>,
    /// Index of the first initialiser.
    first_starter: usize,
    /// Index of the first sensor; sensors are in order of their numbers.
    first_sensor: usize,
    /// By stream: rows fed, rows before the run, rows after the run.
    fed: Box<[[u64; 3]]>,
}

impl Consumers {
    /// The consumers of `runner`.
    #[must_use]
    pub fn new(runner: &Runner) -> Self {
        let streams: Vec<&str> = runner.streams().map(|(name, _)| name).collect();
        let follow = |(name, input, stream): (&str, usize, StreamId)| Followed {
            consumer: name.to_owned(),
            input,
            stream,
            counts: ConsumerCounts {
                name: match input {
                    0 => name.to_owned(),
                    _ => format!("{name} (input {})", input + 1),
                },
                stream: streams.get(stream).copied().unwrap_or_default().to_owned(),
                ..ConsumerCounts::default()
            },
        };
        let sensors = runner.sensors().iter().map(|s| (s.name.as_str(), 0, s.port.stream));
        let mut followed: Vec<_> = runner.takers().map(follow).collect();
        let first_starter = followed.len();
        followed.extend(runner.starters().map(follow));
        let first_sensor = followed.len();
        followed.extend(sensors.map(follow));
        Self {
            followed: followed.into(),
            first_starter,
            first_sensor,
            fed: vec![[0; 3]; streams.len()].into(),
        }
    }

    /// The outcomes of the rows, in this order: process, stages, initialisers, sensors.
    fn counts(self) -> Vec<ConsumerCounts> {
        let Self {
            followed,
            first_starter,
            first_sensor,
            fed,
        } = self;
        let finish = |(number, Followed { stream, mut counts, .. }): (usize, Followed)| {
            let [inside, before, after] = fed[stream];
            (counts.before_run, counts.after_run) = (before, after);
            let known = |c: &ConsumerCounts| c.outcomes().into_iter().map(|(_, n)| n).sum::<u64>();
            counts.rows = inside + before + after;
            let others = counts.rows.saturating_sub(known(&counts));
            if number < first_starter {
                // An accepted row causes no event: every row that was not discarded was used.
                counts.used = others;
            } else if number < first_sensor {
                // A row that comes when the filter runs does not reach an initialiser.
                counts.not_needed = others;
            } else if counts.rows == 0 {
                // The rows that a stage emits are not fed.
                counts.rows = known(&counts);
            }
            counts
        };
        followed.into_iter().enumerate().map(finish).collect()
    }
}

impl Listed for ConsumerCounts {
    const NAME: &'static str = "consumers";
}

impl SectionObserver for Consumers {
    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok(self.counts().into())
    }
}

impl Summary {
    /// The outcome of every row, by consumer; empty for one of many runs.
    #[must_use]
    pub fn consumers(&self) -> &[ConsumerCounts] {
        self.list()
    }
}

fusion_core::memory!(Consumers { followed, fed; first_starter, first_sensor });

impl RunObserver for Consumers {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => self.fed[row.stream][0] += 1,
            RunEvent::Outside { row, is_after } => self.fed[row.stream][1 + usize::from(*is_after)] += 1,
            RunEvent::Filter { filter, event } if filter.is_outermost() => match event {
                Event::Updated { sensor, update, .. } => self.followed[self.first_sensor + sensor].counts.judge(&update.verdict),
                Event::Taken { initialiser, input } => {
                    let is_it = |f: &&mut Followed| f.input == *input && f.consumer == *initialiser;
                    let starters = &mut self.followed[self.first_starter..self.first_sensor];
                    if let Some(followed) = starters.iter_mut().find(is_it) {
                        followed.counts.used += 1;
                    }
                }
                Event::Discarded {
                    consumer, input, row, why, ..
                } => {
                    let is_it = |f: &&mut Followed| f.stream == row.stream && f.input == *input && f.consumer == *consumer;
                    if let Some(followed) = self.followed.iter_mut().find(is_it) {
                        followed.counts.discard(why);
                    }
                }
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }
}
