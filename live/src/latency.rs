//! How long rows take from their arrival to the estimate.

use fusion::core::math;

/// Cells for each doubling.
const PER_OCTAVE: usize = 8;
/// From one nanosecond to about 18 minutes.
const CELLS: usize = 40 * PER_OCTAVE;

/// A histogram of latencies, with cells that are a twelfth wide: of fixed size.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Latency {
    cells: Vec<u64>,
    count: u64,
    most: i64,
}

impl Latency {
    /// Adds a latency \[ns\].
    pub(crate) fn add(&mut self, nanos: i64) {
        let nanos = nanos.max(1);
        if self.cells.is_empty() {
            self.cells.resize(CELLS, 0);
        }
        let octave = nanos.ilog2() as usize;
        let within = ((nanos >> octave.saturating_sub(3)) as usize) % PER_OCTAVE;
        let within = if octave < 3 { 0 } else { within };
        self.cells[(octave * PER_OCTAVE + within).min(CELLS - 1)] += 1;
        self.count += 1;
        self.most = self.most.max(nanos);
    }

    /// The number of latencies.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The largest latency \[s\].
    #[must_use]
    pub const fn most(&self) -> f64 {
        self.most as f64 * 1e-9
    }

    /// The latency \[s\] below which this share of all lies: the upper bound of its cell. `None` without any.
    #[must_use]
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let wanted = math::ceil(share * self.count as f64).max(1.0) as u64;
        let mut so_far = 0;
        self.cells().find_map(|(upper, count)| {
            so_far += count;
            (so_far >= wanted).then(|| upper.min(self.most()))
        })
    }

    /// The cells: the upper bound of each \[s\], and the number of latencies in it.
    pub fn cells(&self) -> impl Iterator<Item = (f64, u64)> {
        self.cells.iter().enumerate().map(|(k, count)| {
            let (octave, within) = (k / PER_OCTAVE, k % PER_OCTAVE);
            let upper = ((1_u64 << octave) as f64) * (1.0 + (within + 1) as f64 / PER_OCTAVE as f64);
            (upper * 1e-9, *count)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_the_width_of_a_cell() {
        let mut latency = Latency::default();
        assert_eq!(latency.quantile(0.5), None);
        (1..=100_000).for_each(|k| latency.add(k * 100));
        for share in [0.001, 0.1, 0.5, 0.9, 0.999] {
            let (found, sure) = (latency.quantile(share).unwrap(), share * 0.01);
            // A cell is an eighth of an octave's start wide.
            assert!(found >= sure && found <= sure * 1.126, "{share}: {found} for {sure}");
        }
        assert_eq!(latency.most(), 0.01);
        assert_eq!(latency.cells().map(|(_, count)| count).sum::<u64>(), 100_000);
    }
}
