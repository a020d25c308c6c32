//! The time since which innovations are larger than chance allows.

use fusion_core::time::Time;

/// Page's test of innovations. It sums ln p(twice the variance) − ln p(the filter's variance) from the minimum
/// of the sum.
///
/// Source: Page 1954, Biometrika 41, 100–115
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Page {
    pub(super) sum: f64,
    /// The first measurement since the sum was zero.
    pub(super) since: Option<Time>,
}

impl Page {
    /// The alarm limit of the sum. Independent innovations exceed it by chance once in exp(20) = 5e8 measurements.
    pub(super) const ALARM: f64 = 20.0;
    /// The largest contribution of one measurement: an alarm takes at least four.
    const MOST: f64 = Self::ALARM / 4.0;

    /// Adds a NIS of `rows` dimensions. Once the sum exceeds the alarm limit, returns the time since when innovations
    /// are too large.
    pub(super) fn hear(&mut self, time: Time, nis: f64, rows: f64) -> Option<Time> {
        // ln p(nis; 2σ²) − ln p(nis; σ²). `min` turns NaN into the largest contribution.
        let gain = (0.25 * nis - 0.5 * core::f64::consts::LN_2 * rows).min(Self::MOST);
        self.sum = (self.sum + gain).max(0.0);
        if self.sum > 0.0 {
            self.since.get_or_insert(time);
        } else {
            self.since = None;
        }
        self.since.filter(|_| self.sum > Self::ALARM)
    }
}

fusion_core::memory!(Page { sum, since });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn innovations_disagree_from_when_they_grow_and_never_by_one_of_them() {
        let found = |nis: &dyn Fn(u32) -> f64| {
            let mut page = Page::default();
            (0..400).find_map(|k| page.hear(Time::from_seconds(f64::from(k)), nis(k), 3.0))
        };
        // Three rows: the mean NIS of a consistent filter, and twice that from 200 s on.
        let consistent = |k: u32| [0.5, 2.0, 4.0, 5.5][(k % 4) as usize];
        assert_eq!(found(&consistent), None);
        let since = found(&|k| if k < 200 { consistent(k) } else { 2.0 * consistent(k) }).map(Time::seconds);
        // The first of four is small.
        assert!(since.is_some_and(|t| (200.0..205.0).contains(&t)), "{since:?}");
        for outlier in [1e6, f64::INFINITY, f64::NAN] {
            assert_eq!(found(&|k| if k == 200 { outlier } else { consistent(k) }), None);
        }
    }
}
