//! What may pass for input: numbers that the instrument can measure and the vehicle can follow.
//!
//! Range   |x_c| above what the instrument measures is refused
//! Spike   |x_c − p_c| > max(a_c, 20 s_c) is suspect: p is the sample before, a the agility that the
//!         process declares, s the mean size of the changes between samples. The third of
//!         neighbouring suspects that are nearer to each other than to p is believed: then it was
//!         no spike. Only of samples that come at 20 Hz at least
//!
//! Frozen  all numbers are those of the sample before, more than ten times in a row, on a stream that
//!         repeats itself rarely
//!
//! Only the past is looked at, so that no sample waits for the next one.

use super::Discard;
use crate::model::Process;

/// A change is suspect above this many times the mean size of changes. Of Gaussian noise one change
/// in 10⁵⁵ is; road shocks of a car stay below 12 (measured on recorded drives).
const UNUSUAL: f64 = 20.0;
/// Changes that the mean is taken over.
const MEMORY: f64 = 64.0;
/// Changes that have to be known before any is suspect.
const LEAST: f64 = 8.0;
/// Samples from which is known how often the stream repeats itself.
const REPEATS_KNOWN: u32 = 256;
/// Of so many samples a stream that repeats itself rarely does so at most this often.
const FEW_REPEATS: u32 = 16;
/// Repetitions in a row after which an instrument is frozen.
const FROZEN: u32 = 10;
/// Samples that are usually further apart than this prove nothing about each other: a vehicle may have
/// changed its motion in between \[ns\].
const SLOWEST: i64 = 50_000_000;
/// Neighbouring suspects after which they are believed.
const WITNESSES: u32 = 3;

/// What the numbers of an input sample may be.
#[derive(Clone, Debug, Default)]
pub(super) struct Guard {
    /// The largest magnitude per number; empty where nothing is declared.
    pub(super) range: Vec<f64>,
    /// The latest sample that passed.
    passed: Vec<f64>,
    /// Mean size of the changes, per number, and how many there were.
    change: Vec<f64>,
    changes: f64,
    /// The latest suspect and how many there were one after the other.
    suspect: Vec<f64>,
    suspects: u32,
    /// The first samples, up to [`REPEATS_KNOWN`], and how many of them repeated the one before.
    first: u32,
    first_repeats: u32,
    /// Samples in a row that repeat the one before.
    repeats: u32,
}
crate::memory!(Guard { passed, change, changes, suspect, suspects, first, first_repeats, repeats; range });

impl Guard {
    /// Judges a sample of finite numbers, of a stream with one every `interval` nanoseconds; one that
    /// passes is remembered.
    pub(super) fn judge(&mut self, sample: &[f64], interval: i64, process: &dyn Process) -> Result<(), Discard> {
        let too_large = sample.iter().zip(&self.range).position(|(x, limit)| x.abs() > *limit);
        if let Some(column) = too_large {
            return Err(Discard::OutOfRange { column });
        }
        if self.is_frozen(sample) {
            return Err(Discard::Frozen);
        }
        let is_dense = interval <= SLOWEST;
        if let Some(column) = self.unusual(sample, process.agility()).filter(|_| is_dense) {
            let believed = self.is_confirmed(sample, column);
            self.suspects = if believed { self.suspects + 1 } else { 1 };
            self.suspect.clear();
            self.suspect.extend_from_slice(sample);
            if self.suspects < WITNESSES {
                return Err(Discard::Spike { column });
            }
        }
        self.remember(sample);
        Ok(())
    }

    /// Whether the instrument gives one sample again and again, which it did not use to.
    fn is_frozen(&mut self, sample: &[f64]) -> bool {
        let is_repeated = sample == self.passed;
        self.repeats = if is_repeated { self.repeats.saturating_add(1) } else { 0 };
        if self.first < REPEATS_KNOWN {
            self.first += 1;
            self.first_repeats += u32::from(is_repeated);
            return false;
        }
        self.first_repeats <= FEW_REPEATS && self.repeats > FROZEN
    }

    /// Whether a sample to come would pass as things are now; it is not remembered.
    pub(super) fn is_plausible(&self, sample: &[f64], process: &dyn Process) -> bool {
        let in_range = sample.iter().zip(&self.range).all(|(x, limit)| x.abs() <= *limit);
        let is_finite = sample.iter().all(|x| x.is_finite());
        is_finite && in_range && self.unusual(sample, process.agility()).is_none()
    }

    /// Forgets the samples: nothing that follows is their neighbour.
    pub(super) fn forget(&mut self) {
        // A frozen instrument is still to be recognised after the gap that it leaves.
        if self.repeats == 0 {
            self.passed.clear();
        }
        self.suspects = 0;
    }

    /// The first number that changes by more than it should.
    fn unusual(&self, sample: &[f64], agility: &[f64]) -> Option<usize> {
        if self.changes < LEAST {
            return None;
        }
        let changes = sample.iter().zip(&self.passed).map(|(x, p)| (x - p).abs());
        let limits = agility.iter().zip(&self.change).map(|(a, s)| a.max(UNUSUAL * s));
        changes.zip(limits).position(|(change, limit)| change > limit)
    }

    /// Whether the suspect before says the same of number `c`.
    fn is_confirmed(&self, sample: &[f64], c: usize) -> bool {
        self.suspects > 0 && (sample[c] - self.suspect[c]).abs() < 0.5 * (sample[c] - self.passed[c]).abs()
    }

    fn remember(&mut self, sample: &[f64]) {
        self.suspects = 0;
        if self.passed.len() == sample.len() {
            self.changes = (self.changes + 1.0).min(MEMORY);
            for ((mean, x), p) in self.change.iter_mut().zip(sample).zip(&self.passed) {
                *mean += ((x - p).abs() - *mean) / self.changes;
            }
        } else {
            self.change.resize(sample.len(), 0.0);
        }
        self.passed.clear();
        self.passed.extend_from_slice(sample);
    }
}
