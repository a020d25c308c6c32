//! The check of the input: numbers that the instrument can measure and the vehicle can follow.
//!
//! Range   |x_c| above the range of the instrument is rejected
//! Spike   |x_c − p_c| > l_c is suspect, l_c = max(a_c, 20 s_c): p is the sample before, a the agility that
//!         the process declares, s the mean size of the changes between samples. A suspect waits for at
//!         most two samples. If one of them is nearer to p than half the jump, the suspects before it
//!         were spikes; otherwise all are used. Only for samples that come at 20 Hz at least
//! Scale   s includes every change, also rejected ones, each up to l_c: frequent changes of the stream soon
//!         stop being suspect
//! Frozen  all numbers are those of the sample before, more than ten times in a row, on a stream that
//!         repeats itself rarely

use crate::runner::Discard;
use alloc::vec::Vec;

/// A change is suspect above this many times the mean size of changes. Of Gaussian noise one change
/// in 10⁵⁵ is; road shocks of a car stay below 12 (measured on recorded drives).
const UNUSUAL: f64 = 20.0;
/// Changes that the mean is taken over.
const MEMORY: f64 = 64.0;
/// Changes that have to be known before any is suspect.
const LEAST: f64 = 8.0;
/// The number of samples after which it is known how often the stream repeats itself.
const REPEATS_KNOWN: u32 = 256;
/// In that number of samples, a stream that repeats itself rarely does so at most this often.
const FEW_REPEATS: u32 = 16;
/// Repetitions in a row after which an instrument is frozen.
const FROZEN: u32 = 10;
/// Samples that are usually further apart than this prove nothing about each other: a vehicle may have
/// changed its motion in between \[ns\].
const SLOWEST: i64 = 50_000_000;
/// Samples that wait at most; if the next sample does not return either, they are believed.
const MOST_SUSPECTS: usize = 2;

/// The limits of the numbers of an input sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Guard {
    /// The largest magnitude per number; empty if nothing is declared.
    range: Vec<f64>,
    /// The change per number that the vehicle can make between two samples.
    agility: Vec<f64>,
    /// The latest sample that passed.
    passed: Vec<f64>,
    /// Mean size of the changes, per number, and how many there were.
    change: Vec<f64>,
    changes: f64,
    /// The number that makes the first waiting sample suspect, and the size of its change.
    column: usize,
    jump: f64,
    /// The first samples, up to [`REPEATS_KNOWN`], and how many of them repeated the one before.
    first: u32,
    first_repeats: u32,
    /// Samples in a row that repeat the one before.
    repeats: u32,
}
crate::memory!(Guard { passed, change, changes, column, jump, first, first_repeats, repeats; range, agility });

/// The decision about a sample, or about the waiting samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Judged {
    /// It passes.
    Passes,
    /// It waits for the next sample.
    Waits,
    /// The waiting samples pass; this sample is to be judged again.
    Confirms,
    /// The waiting samples were spikes; this sample is to be judged again.
    Refutes,
}

impl Guard {
    /// A guard of samples whose numbers the vehicle can change by `agility` from one to the next.
    pub(super) fn new(agility: &[f64]) -> Self {
        Self {
            agility: agility.to_vec(),
            ..Self::default()
        }
    }

    /// Sets the largest magnitude per number.
    pub(super) fn limit(&mut self, range: Vec<f64>) {
        self.range = range;
    }

    /// Rejects a sample that the instrument cannot have measured.
    pub(super) fn admit(&mut self, sample: &[f64]) -> Result<(), Discard> {
        let too_large = sample.iter().zip(&self.range).position(|(x, limit)| x.abs() > *limit);
        match too_large {
            Some(column) => Err(Discard::OutOfRange { column }),
            None if self.is_frozen(sample) => Err(Discard::Frozen),
            None => Ok(()),
        }
    }

    /// Judges a sample of finite numbers while `waiting` samples wait, of a stream with one sample every `interval`
    /// nanoseconds.
    pub(super) fn judge(&mut self, sample: &[f64], waiting: usize, interval: i64) -> Judged {
        if waiting == 0 {
            let unusual = self.unusual(sample).filter(|_| interval <= SLOWEST);
            let Some(column) = unusual else { return Judged::Passes };
            (self.column, self.jump) = (column, self.change(sample, column));
        } else if self.change(sample, self.column) < 0.5 * self.jump {
            return Judged::Refutes;
        } else if waiting >= MOST_SUSPECTS {
            return Judged::Confirms;
        }
        Judged::Waits
    }

    /// The reason why samples wait.
    pub(super) const fn suspicion(&self) -> Discard {
        Discard::Spike { column: self.column }
    }

    /// The change of number `c`.
    fn change(&self, sample: &[f64], c: usize) -> f64 {
        let pair = sample.get(c).zip(self.passed.get(c));
        pair.map_or(0.0, |(x, p)| (x - p).abs())
    }

    /// Whether the instrument repeats one sample, which it did rarely before.
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

    /// Whether a future sample would pass at present; the sample is not remembered.
    pub(super) fn is_plausible(&self, sample: &[f64]) -> bool {
        let in_range = sample.iter().zip(&self.range).all(|(x, limit)| x.abs() <= *limit);
        let is_finite = sample.iter().all(|x| x.is_finite());
        is_finite && in_range && self.unusual(sample).is_none()
    }

    /// Forgets the samples: no later sample is their neighbour.
    pub(super) fn forget(&mut self) {
        // A frozen instrument is still to be recognised after the gap that it leaves.
        if self.repeats == 0 {
            self.passed.clear();
        }
    }

    /// The number with the largest excess over its limit.
    fn unusual(&self, sample: &[f64]) -> Option<usize> {
        if self.changes < LEAST {
            return None;
        }
        let limits = self.agility.iter().zip(&self.change).map(|(a, s)| limit(*a, *s));
        let excess = limits.enumerate().map(|(c, limit)| (c, self.change(sample, c) / limit));
        let unusual = excess.filter(|(_, excess)| *excess > 1.0);
        unusual.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
    }

    /// A sample that is used.
    pub(super) fn pass(&mut self, sample: &[f64]) {
        self.learn(sample);
        self.passed.clear();
        self.passed.extend_from_slice(sample);
    }

    /// Learns how much the samples change, from a sample that may be rejected.
    pub(super) fn learn(&mut self, sample: &[f64]) {
        if self.passed.len() != sample.len() {
            self.change.resize(sample.len(), 0.0);
            return;
        }
        self.changes = (self.changes + 1.0).min(MEMORY);
        let is_known = self.changes > LEAST;
        let pairs = sample.iter().zip(&self.passed);
        for (c, (mean, (x, p))) in self.change.iter_mut().zip(pairs).enumerate() {
            let change = (x - p).abs();
            let most = self.agility.get(c).filter(|_| is_known).map_or(change, |a| limit(*a, *mean));
            *mean += (change.min(most) - *mean) / self.changes;
        }
    }
}

/// The change above which a sample is suspect, for the agility `a` and the mean size of changes `s`.
fn limit(a: f64, s: f64) -> f64 {
    a.max(UNUSUAL * s)
}
