//! Counts of a run: its start, its epochs, unused rows, failures.

use super::{Heard, RunEvent, RunObserver};
use fusion_core::belief::Belief;
use fusion_core::memory::Memory;
use fusion_core::runner::{Discard, Event, Halt};
use fusion_core::state::StateRole;

/// The name of the process as a consumer.
const PROCESS: &str = "process";
/// The maximum number of failures whose reason is kept.
const REASONS: usize = 10;

/// Counts the events of a run.
#[derive(Clone, Debug, Default)]
pub struct Counters {
    /// When the filter started \[s\].
    pub started: Option<f64>,
    /// The attitude or angle with the largest 1σ at the start, and this 1σ \[rad\].
    pub start_angle: Option<(String, f64)>,
    /// The number of estimates.
    pub epochs: u64,
    /// Rows that came too late or held NaN, by consumer: `stage.consumer` inside a stage.
    pub unused_rows: Vec<(String, u64)>,
    /// Samples of the input that were rejected as spikes.
    pub spikes: u64,
    /// Samples of the input that were rejected for any of these reasons: spike, out of range, frozen, not finite,
    /// stamped far ahead.
    pub refused: u64,
    /// The length of all gaps of the input that have ended \[s\].
    coasted: f64,
    /// The length of the present gap so far \[s\].
    gap: f64,
    /// Why a filter could not continue: the first ten reasons.
    pub failures: Vec<String>,
    /// The number of further failures.
    pub further_failures: u64,
}

impl Counters {
    /// How long the filter coasted without input \[s\].
    #[must_use]
    pub fn coasted(&self) -> f64 {
        self.coasted + self.gap
    }

    /// Counts a sample of the input that was not used.
    fn refuse(&mut self, why: &Discard) {
        self.spikes += u64::from(matches!(why, Discard::Spike { .. }));
        self.refused += u64::from(!matches!(why, Discard::Late { .. }));
    }

    fn not_used(&mut self, consumer: String) {
        match self.unused_rows.iter_mut().find(|(name, _)| *name == consumer) {
            Some((_, count)) => *count += 1,
            None => self.unused_rows.push((consumer, 1)),
        }
    }
}

/// The attitude or angle with the largest 1σ.
fn least_known(filter: &Heard, belief: &Belief) -> Option<(String, f64)> {
    let angles = filter
        .layout
        .blocks()
        .iter()
        // The pose of a ship is unknown until its own sensor measures it; that sensor then measures all of it at once.
        .filter(|b| b.role != StateRole::Nuisance)
        .filter(|b| b.kind.is_orientation() || b.unit == "rad");
    let known = angles.map(|b| (b.name.clone(), belief.covariance.sigmas(b).fold(0.0, f64::max)));
    known.max_by(|a, b| a.1.total_cmp(&b.1))
}

fusion_core::memory!(Counters {
    started,
    start_angle,
    epochs,
    unused_rows,
    spikes,
    refused,
    coasted,
    gap,
    failures,
    further_failures
});

impl RunObserver for Counters {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { filter, .. } => self.epochs += u64::from(filter.is_outermost()),
            RunEvent::Filter { filter, event } => match event {
                Event::Started { belief, .. } if filter.is_outermost() => {
                    self.started = Some(belief.time.seconds());
                    self.start_angle = least_known(filter, belief);
                }
                Event::Discarded {
                    why: Discard::BeforeStart, ..
                } => {}
                Event::Discarded { consumer, why, .. } => {
                    if filter.is_outermost() && *consumer == PROCESS {
                        self.refuse(why);
                    }
                    self.not_used(filter.named(consumer));
                }
                Event::Coasting { since, time } if filter.is_outermost() => self.gap = time.seconds_since(*since),
                Event::Resumed { since, time } | Event::Stopped { since, time } if filter.is_outermost() => {
                    self.coasted += time.seconds_since(*since);
                    self.gap = 0.0;
                }
                Event::Failed { .. } if self.failures.len() >= REASONS => self.further_failures += 1,
                Event::Failed { error } => {
                    let why = error.to_string();
                    let stage = filter.stages.join(".");
                    self.failures.push(if stage.is_empty() { why } else { format!("{stage}: {why}") });
                }
                _ => {}
            },
            RunEvent::Row(_) | RunEvent::Outside { .. } | RunEvent::Reference { .. } | RunEvent::Truth { .. } => {}
        }
        Ok(())
    }
}
