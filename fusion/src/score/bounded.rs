//! Summaries of series of any length, in memory of fixed size.
//!
//! | | kept of a short series | of a longer one |
//! |---|---|---|
//! | [`Thinned`] | every value | every second one, every fourth, … |
//! | [`Quantiles`] | every value | how many there are in bins of 1/4096 of the value |
//!
//! Means and their correlation: [`Series`](super::Series).

use fusion_core::math;
use fusion_core::memory::{Memory, Tape};

/// Up to this number all values are kept: 44 minutes at 100 Hz.
pub(super) const KEPT: usize = 1 << 18;
/// Up to this number all whole rows are kept.
const ROWS: usize = 1 << 16;

/// Every n-th row of a series; n doubles when the memory is full.
#[derive(Clone, Debug)]
pub(super) struct Thinned<T> {
    rows: Vec<T>,
    stride: u64,
    seen: u64,
}

impl<T> Default for Thinned<T> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            stride: 1,
            seen: 0,
        }
    }
}

impl<T: Memory + Default> Memory for Thinned<T> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.rows.remember(tape);
        self.stride.remember(tape);
        self.seen.remember(tape);
        if self.stride == 0 || self.rows.len() > ROWS {
            tape.refuse("a thinned series has another size");
        }
    }
}

impl<T> Thinned<T> {
    /// Adds the next row.
    pub(super) fn push(&mut self, row: T) {
        if self.seen.is_multiple_of(self.stride) {
            if self.rows.len() == ROWS {
                let mut index = 0_u64;
                self.rows.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            // The number of kept rows is even: the next row is the first with the doubled stride.
            self.rows.push(row);
        }
        self.seen += 1;
    }

    /// The kept rows.
    pub(super) fn rows(&self) -> &[T] {
        &self.rows
    }
}

/// The distribution of non-negative values.
#[derive(Clone, Debug, Default)]
pub(crate) struct Quantiles {
    /// All values, while there are few.
    values: Vec<f64>,
    /// Otherwise the number of values in each bin, in order.
    bins: Vec<(u32, u64)>,
}

fusion_core::memory!(Quantiles { values, bins });

/// The bits of a number that are ignored: the first twelve bits of the mantissa remain.
const BLURRED: u32 = 40;

impl Quantiles {
    /// Adds a value.
    pub(crate) fn add(&mut self, value: f64) {
        if self.bins.is_empty() && self.values.len() < KEPT {
            self.values.push(value);
            return;
        }
        for value in core::mem::take(&mut self.values) {
            self.count(value);
        }
        self.count(value);
    }

    fn count(&mut self, value: f64) {
        let bin = bin(value);
        match self.bins.binary_search_by_key(&bin, |(bin, _)| *bin) {
            Ok(at) => self.bins[at].1 += 1,
            Err(at) => self.bins.insert(at, (bin, 1)),
        }
    }

    /// Values so far.
    pub(crate) fn len(&self) -> usize {
        self.values.len() + self.bins.iter().map(|(_, count)| *count as usize).sum::<usize>()
    }

    /// The quantile: this share of all values does not exceed it.
    pub(crate) fn within(&mut self, share: f64) -> Option<f64> {
        let count = self.len() as f64;
        self.at((math::ceil(share * count) as usize).saturating_sub(1))
    }

    /// The value of this rank in sorted order: exact, or the middle of its bin.
    pub(crate) fn at(&mut self, rank: usize) -> Option<f64> {
        self.values.sort_unstable_by(f64::total_cmp);
        let mut before = 0;
        let mut bins = self.bins.iter();
        let binned = bins.find(|(_, count)| {
            before += *count as usize;
            before > rank
        });
        binned.map(|(bin, _)| middle(*bin)).or_else(|| self.values.get(rank).copied())
    }
}

/// Bins have the same width relative to the value. Values below 2^-40 count as 0, values above 2^40 as infinite. So the
/// bins cover at most 80 factors of two.
fn bin(value: f64) -> u32 {
    const LIMIT: f64 = (1_u64 << 40) as f64;
    let shown = match value {
        v if v < 1.0 / LIMIT => 0.0,
        v if v > LIMIT => f64::INFINITY,
        v => v,
    };
    (shown.to_bits() >> BLURRED) as u32
}

fn middle(bin: u32) -> f64 {
    let least = f64::from_bits(u64::from(bin) << BLURRED);
    if least == 0.0 || !least.is_finite() {
        return least;
    }
    f64::from_bits(u64::from(bin) << BLURRED | 1 << (BLURRED - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_have_their_quantiles_and_many_those_of_a_histogram() {
        // A permutation: 7919 is prime, and does not divide any of the counts.
        for count in [1, 10, KEPT, KEPT + 1, 3 * KEPT] {
            let mut quantiles = Quantiles::default();
            (0..count).for_each(|k| quantiles.add((k * 7919 % count) as f64 * 1e-3));
            assert_eq!(quantiles.len(), count);
            for rank in [0, count / 2, count * 95 / 100, count - 1] {
                let (found, exact) = (quantiles.at(rank).unwrap(), rank as f64 * 1e-3);
                // Half a bin, and zero if all values are kept.
                let tolerance = if count > KEPT { exact / 8192.0 } else { 0.0 };
                assert!((found - exact).abs() <= tolerance, "{found} for {exact} of {count}");
            }
            assert_eq!(quantiles.at(count), None);
        }
    }

    #[test]
    fn no_value_is_lost_and_bins_are_limited() {
        let mut quantiles = Quantiles::default();
        (0..KEPT).for_each(|_| quantiles.add(1.0));
        for value in [f64::INFINITY, f64::NAN, 0.0, 1e-300, f64::MAX] {
            quantiles.add(value);
        }
        assert_eq!((quantiles.at(0), quantiles.at(1)), (Some(0.0), Some(0.0)));
        assert_eq!(quantiles.at(KEPT + 2), Some(f64::INFINITY));
        assert!(quantiles.at(KEPT + 4).unwrap().is_nan(), "after all others");
        assert!(quantiles.values.capacity() == 0 && quantiles.bins.len() == 4);
    }

    #[test]
    fn a_long_series_of_rows_is_thinned_evenly() {
        let mut thinned = Thinned::default();
        let count = 5 * ROWS as u64 + 3;
        (0..count).for_each(|k| thinned.push(k));
        let expected: Vec<u64> = (0..count).step_by(8).collect();
        assert_eq!(thinned.rows(), expected);
    }
}
