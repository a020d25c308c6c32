//! Counts of verdicts, and intervals of their shares.

use super::Judged;
use fusion_core::math;

/// A count, and the number of cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// The count.
    pub count: usize,
    /// The number of cases.
    pub of: usize,
}

impl Count {
    /// The share; NaN without a case.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.count as f64 / self.of as f64
    }

    /// The 95 % interval of the share; `None` without a case.
    #[must_use]
    pub fn interval(&self) -> Option<(f64, f64)> {
        wilson(self.count, self.of)
    }
}

/// The 95 % interval of a share, from `count` in `of` cases: Wilson 1927. `None` without a case.
#[must_use]
pub fn wilson(count: usize, of: usize) -> Option<(f64, f64)> {
    const Z: f64 = 1.959_964;
    let n = of as f64;
    let (p, z2) = (count as f64 / n, Z * Z);
    let half = Z * math::sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n));
    let at = |sign: f64| ((p + z2 / (2.0 * n) + sign * half) / (1.0 + z2 / n)).clamp(0.0, 1.0);
    (of > 0).then(|| (at(-1.0), at(1.0)))
}

/// The verdicts of many cases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// The number of cases.
    pub cases: usize,
    /// Recovered.
    pub recovered: Count,
    /// False goods.
    pub false_good: Count,
    /// False alarms.
    pub false_alarm: Count,
    /// Late to be good, of those that recovered.
    pub late_good: Count,
}

impl<'a> FromIterator<&'a Judged> for Counts {
    fn from_iter<I: IntoIterator<Item = &'a Judged>>(judged: I) -> Self {
        let mut counts = Self::default();
        let add = |to: &mut Count, is_so: bool| {
            to.of += 1;
            to.count += usize::from(is_so);
        };
        for judged in judged {
            counts.cases += 1;
            add(&mut counts.recovered, judged.recovered);
            add(&mut counts.false_good, judged.false_good);
            add(&mut counts.false_alarm, judged.false_alarm);
            if judged.recovered {
                add(&mut counts.late_good, judged.late_good);
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_that_of_the_textbook() {
        let near = |found: Option<(f64, f64)>, low: f64, high: f64| {
            let (a, b) = found.unwrap();
            // Three digits are given.
            assert!((a - low).abs() < 5e-4 && (b - high).abs() < 5e-4, "{a} {b}");
        };
        // Newcombe 1998, table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
        near(wilson(81, 263), 0.2553, 0.3662);
        near(wilson(15, 148), 0.0624, 0.1605);
        near(wilson(0, 20), 0.0, 0.1611);
        near(wilson(1, 29), 0.0061, 0.1718);
        assert_eq!(wilson(0, 0), None);
    }

    #[test]
    fn only_what_has_recovered_can_be_late_to_say_so() {
        let judged = |recovered, late_good| Judged {
            recovered,
            late_good,
            ..Judged::default()
        };
        let cases = [judged(true, true), judged(true, false), judged(false, false)];
        let counts: Counts = cases.iter().collect();
        assert_eq!(
            (counts.cases, counts.recovered, counts.late_good),
            (3, Count { count: 2, of: 3 }, Count { count: 1, of: 2 })
        );
    }
}
