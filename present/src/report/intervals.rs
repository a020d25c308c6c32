//! From one measurement of a sensor to the next: the series, and how often each length comes.

use super::trace::Trace;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};

/// Bins per factor of ten: neighbours are a tenth apart.
const PER_DECADE: f64 = 24.0;
/// The shortest interval that is counted apart \[s\], and the factors of ten above it.
const LEAST: f64 = 1e-3;
const DECADES: usize = 8;
/// A sensor is drawn if its longest interval exceeds its usual interval by this factor; other sensors are regular.
const IRREGULAR: f64 = 1.5;

/// Intervals of one sensor.
#[derive(Clone, Debug)]
pub(super) struct Intervals {
    last: Option<f64>,
    longest: f64,
    /// Measurements per length, each bin being a 24th of a factor of ten wide.
    counts: Vec<u64>,
    /// The series.
    pub series: Trace,
}

/// A bar of the histogram.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub(super) struct Bar {
    /// The shortest interval in it \[s\].
    pub from: f64,
    /// The longest \[s\].
    pub to: f64,
    /// How many there are.
    pub count: u64,
}

impl Memory for Intervals {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.last.remember(tape);
        self.longest.remember(tape);
        self.counts.as_mut_slice().remember(tape);
        self.series.remember(tape);
    }
}

impl Intervals {
    pub(super) fn new(buckets: usize) -> Self {
        Self {
            last: None,
            longest: 0.0,
            counts: vec![0; DECADES * PER_DECADE as usize],
            series: Trace::new(1, buckets),
        }
    }

    /// A measurement is valid at `t` \[s\]; those that are not after the one before are passed over.
    pub(super) fn add(&mut self, t: f64) {
        let Some(last) = self.last.filter(|last| t > *last) else {
            self.last = Some(self.last.map_or(t, |last| last.max(t)));
            return;
        };
        let interval = t - last;
        self.last = Some(t);
        self.longest = self.longest.max(interval);
        self.series.push(t, &[interval]);
        let bin = bin(interval).min(self.counts.len() - 1);
        self.counts[bin] += 1;
    }

    /// Returns true if the intervals are irregular, and so are drawn.
    pub(super) fn is_irregular(&self) -> bool {
        let all: u64 = self.counts.iter().sum();
        let mut seen = 0;
        let middle = self.counts.iter().position(|count| {
            seen += count;
            2 * seen >= all
        });
        all > 1 && middle.is_some_and(|bin| self.longest > IRREGULAR * edge(bin + 1))
    }

    /// The histogram, from its first bar to its last.
    pub(super) fn bars(&self) -> Vec<Bar> {
        let used = |count: &u64| *count > 0;
        let Some((first, last)) = self.counts.iter().position(used).zip(self.counts.iter().rposition(used)) else {
            return Vec::new();
        };
        let bars = self.counts[first..=last].iter().zip(first..);
        bars.map(|(count, k)| Bar {
            from: edge(k),
            to: edge(k + 1),
            count: *count,
        })
        .collect()
    }
}

/// The bin of an interval; an interval shorter than the first bin belongs to the first bin.
fn bin(interval: f64) -> usize {
    // Adds a thousandth of a bin: an interval on an edge, for example one second, belongs above it despite rounding.
    (math::log10(interval / LEAST) * PER_DECADE + 1e-3).max(0.0) as usize
}

/// Where a bin begins \[s\].
fn edge(bin: usize) -> f64 {
    LEAST * math::powf(10_f64, bin as f64 / PER_DECADE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_interval_is_counted_in_its_bar() {
        let mut intervals = Intervals::new(64);
        let mut t = 0.0;
        for step in [0.0, 1.0, 1.0, 1.04, 2.0, 5.0, -3.0, 3.5] {
            t += step;
            intervals.add(t);
        }
        // A step back does not count: the last interval is half a second, from the latest time before it.
        let bars: Vec<_> = intervals.bars().into_iter().filter(|b| b.count > 0).collect();
        let counted: Vec<u64> = bars.iter().map(|b| b.count).collect();
        assert_eq!(counted, [1, 3, 1, 1]);
        for (bar, interval) in bars.iter().zip([0.5, 1.0, 2.0, 5.0]) {
            // Rounding of a power of ten.
            assert!(bar.from <= interval * (1.0 + 1e-4) && interval < bar.to, "{bar:?}");
            assert!((bar.to / bar.from - 10_f64.powf(1.0 / 24.0)).abs() < 1e-12);
        }
        assert!(intervals.is_irregular());
    }

    #[test]
    fn a_regular_sensor_is_not_drawn() {
        let mut intervals = Intervals::new(64);
        (0..100).for_each(|k| intervals.add(0.1 * f64::from(k)));
        assert!(!intervals.is_irregular());
        intervals.add(10.2);
        assert!(intervals.is_irregular(), "two rows are missing");
    }
}
