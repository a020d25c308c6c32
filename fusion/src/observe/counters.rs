//! Counts of a run: its epochs, the use of its input, unused rows.

use super::{Entry, Keyed, RunEnd, RunEvent, RunObserver, Section, SectionObserver, Summary};
use fusion_core::memory::Memory;
use fusion_core::runner::{Discard, Event, Halt};
use schemars::JsonSchema;
use serde::Serialize;

/// The name of the process as a consumer.
const PROCESS: &str = "process";

/// The estimates of a run, and the samples of its process input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Counts {
    /// Time for which rows are held back, so that late rows are used in order of time \[s\]. The estimate on the
    /// vehicle is this old. 0 if rows are used as they arrive.
    pub held_back: f64,
    /// Estimates made.
    pub epochs: u64,
    /// Samples of the process input that were rejected: spikes, out of range, frozen, not finite, or stamped far
    /// ahead.
    pub refused_samples: u64,
    /// How long the filter coasted without process input \[s\].
    pub coasted: f64,
    /// Input samples that were taken for spikes; the counts by consumer have them too, except for one of many runs.
    #[serde(skip)]
    pub spikes: u64,
}

impl Section for Counts {
    const NAME: &'static str = "counts";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![
            ("held_back", &self.held_back),
            ("epochs", &self.epochs),
            ("refused_samples", &self.refused_samples),
            ("coasted", &self.coasted),
        ]
    }
}

impl Summary {
    /// The estimates, and the samples of the process input.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.get().copied().unwrap_or_default()
    }

    /// Rows that came too late or had no number, by consumer.
    #[must_use]
    pub fn unused_rows(&self) -> &[(String, u64)] {
        self.get::<UnusedRows>().map_or(&[], |unused| &unused.by_consumer)
    }
}

/// Counts the estimates of the outermost filter, and the samples of its process input.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counters {
    /// Without the time of the present gap.
    counts: Counts,
    /// The length of the present gap so far \[s\].
    gap: f64,
}

fusion_core::memory!(Counters { counts, gap });
fusion_core::memory!(Counts { epochs, refused_samples, coasted, spikes; held_back });

impl RunObserver for Counters {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { filter, .. } => self.counts.epochs += u64::from(filter.is_outermost()),
            RunEvent::Filter { filter, event } if filter.is_outermost() => match event {
                Event::Discarded {
                    why: Discard::BeforeStart | Discard::Late { .. },
                    ..
                } => {}
                Event::Discarded { consumer, why, .. } if *consumer == PROCESS => {
                    self.counts.spikes += u64::from(matches!(why, Discard::Spike { .. }));
                    self.counts.refused_samples += 1;
                }
                Event::Coasting { since, time } => self.gap = time.seconds_since(*since),
                Event::Resumed { since, time } | Event::Stopped { since, time } => {
                    self.counts.coasted += time.seconds_since(*since);
                    self.gap = 0.0;
                }
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }
}

impl SectionObserver for Counters {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let runner = &end.assembly.runner;
        let counts = Counts {
            held_back: if runner.rewinds().is_some() { 0.0 } else { runner.lag() },
            coasted: self.counts.coasted + self.gap,
            ..self.counts
        };
        Ok(counts.into())
    }
}

/// Rows that came too late or held NaN, of all filters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct UnusedRows {
    /// By consumer: `stage.consumer` inside a stage.
    pub by_consumer: Vec<(String, u64)>,
}

fusion_core::memory!(UnusedRows { by_consumer });

impl Section for UnusedRows {
    const NAME: &'static str = "unused_rows";
}

impl RunObserver for UnusedRows {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else { return Ok(()) };
        if let Event::Discarded { consumer, why, .. } = event
            && !matches!(why, Discard::BeforeStart | Discard::SwitchedOff)
        {
            let consumer = filter.named(consumer);
            match self.by_consumer.iter_mut().find(|(name, _)| *name == consumer) {
                Some((_, count)) => *count += 1,
                None => self.by_consumer.push((consumer, 1)),
            }
        }
        Ok(())
    }
}

impl SectionObserver for UnusedRows {
    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok((*self).into())
    }
}
