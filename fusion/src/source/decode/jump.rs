//! Stamps that jump ahead: accepted if none of the next rows goes back.

use fusion_core::time::{Time, nanos};

/// A jump is longer than this many times the longest recent interval.
const INTERVALS: i64 = 10;
/// The limit of a jump while no interval is known yet \[ns\].
const FIRST: i64 = 1_000_000_000;

/// The largest number of consecutive rows with wrong stamps.
pub(super) const LONGEST_RUN: usize = 20;

/// Distinguishes wrong stamps from a gap, by the rows after them.
#[derive(Clone, Debug)]
pub(super) struct Jumps {
    declared: Option<i64>,
    /// The longest recent interval \[ns\]; 0 if unknown.
    interval: i64,
}

/// The evidence of the rows after a jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum After {
    /// The stamp of the first row that goes back, or of the last row looked at, and how many rows later it comes.
    Stamp(i64, usize),
    /// No readable row follows.
    Nothing,
}

impl Jumps {
    /// With the declared limit and the nominal interval, both in seconds.
    pub(super) fn new(declared: Option<f64>, nominal: Option<f64>) -> Self {
        Self {
            declared: declared.map(nanos),
            interval: nominal.map_or(0, nanos),
        }
    }

    fn limit(&self) -> i64 {
        let learnt = if self.interval > 0 {
            self.interval.saturating_mul(INTERVALS)
        } else {
            FIRST
        };
        self.declared.unwrap_or(learnt)
    }

    /// Returns true if a stamp has to be confirmed: the stamp of the first row, or a stamp that jumps.
    pub(super) fn is_in_doubt(&self, last: Option<i64>, stamp: i64) -> bool {
        last.is_none_or(|last| stamp.saturating_sub(last) > self.limit())
    }

    /// Returns true if a later stamp shows that the stamp in doubt is wrong. After a gap, later stamps are near it;
    /// after a wrong stamp, they go back.
    pub(super) fn goes_back(&self, last: Option<i64>, stamp: i64, next: i64) -> bool {
        match last {
            None => stamp.saturating_sub(next) > self.limit(),
            Some(last) => next.saturating_sub(last) < stamp.saturating_sub(next),
        }
    }

    /// Why a stamp in doubt is wrong; `None` if the rows after it confirm it.
    pub(super) fn refute(&self, last: Option<i64>, stamp: i64, after: After) -> Option<String> {
        let time = Time::from_nanos;
        let ahead = |last| time(stamp).seconds_since(time(last));
        match (last, after) {
            (_, After::Stamp(next, later)) => self.goes_back(last, stamp, next).then(|| {
                let which = match last {
                    None => format!("the first stamp is {}", time(stamp)),
                    Some(last) => format!("{} is {:.3} s after the row before", time(stamp), ahead(last)),
                };
                let row = match later {
                    1 => "the next row goes".to_owned(),
                    later => format!("{later} rows later the stamps go"),
                };
                format!("{which}, and {row} back to {}", time(next))
            }),
            // With two rows only, it is unknown which one is wrong.
            (Some(last), After::Nothing) if self.declared.is_some() || self.interval > 0 => Some(format!(
                "{} is {:.3} s after the row before, and no row after it confirms that",
                time(stamp),
                ahead(last)
            )),
            _ => None,
        }
    }

    /// Learns an interval between rows in order. A gap raises the recent interval at most tenfold, and for about
    /// twenty rows.
    pub(super) fn took(&mut self, interval: i64) {
        let known = self.interval;
        let longest = if known > 0 { known.saturating_mul(INTERVALS) } else { i64::MAX };
        self.interval = (known - known / 10).max(interval.min(longest));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    /// The stamps used, of stamps in seconds.
    fn used(mut jumps: Jumps, stamps: &[i64]) -> Vec<i64> {
        let (mut last, mut used) = (None, Vec::new());
        for (k, stamp) in stamps.iter().enumerate() {
            let later = || (1..=LONGEST_RUN).map_while(|n| Some(After::Stamp(stamps.get(k + n)? * S, n)));
            let goes_back = |after: &After| matches!(after, After::Stamp(next, _) if jumps.goes_back(last, stamp * S, *next));
            let after = later().find(goes_back).or(later().last()).unwrap_or(After::Nothing);
            if jumps.is_in_doubt(last, stamp * S) && jumps.refute(last, stamp * S, after).is_some() {
                continue;
            }
            if let Some(last) = last {
                jumps.took(stamp * S - last);
            }
            last = Some(stamp * S);
            used.push(*stamp);
        }
        used
    }

    fn learnt() -> Jumps {
        Jumps::new(None, None)
    }

    #[test]
    fn one_wrong_stamp_is_left_out_wherever_it_stands() {
        let rows: Vec<i64> = (0..40).collect();
        for wrong in 0..rows.len() {
            let mut stamps = rows.clone();
            stamps[wrong] += 3600;
            let right: Vec<i64> = rows.iter().copied().filter(|k| *k != wrong as i64).collect();
            assert_eq!(used(learnt(), &stamps), right, "row {wrong}");
        }
    }

    #[test]
    fn a_run_of_up_to_twenty_wrong_stamps_costs_those_rows_alone() {
        let rows: Vec<i64> = (0..100).collect();
        for (from, length) in [(0, 1), (0, 20), (50, 2), (50, 7), (50, 20)] {
            let wrong = from..from + length;
            let mut stamps = rows.clone();
            stamps[wrong.clone()].iter_mut().for_each(|stamp| *stamp += 3600);
            let right: Vec<i64> = rows.iter().copied().filter(|k| !wrong.contains(&(*k as usize))).collect();
            assert_eq!(used(learnt(), &stamps), right, "{wrong:?}");
        }
    }

    #[test]
    fn a_gap_is_confirmed_by_the_rows_after_it() {
        let stamps: Vec<i64> = (0..20).chain(3600..3620).collect();
        assert_eq!(used(learnt(), &stamps), stamps);
        // A wrong stamp soon after a gap is still found.
        let mut spoilt = stamps.clone();
        spoilt[25] += 3600;
        let right: Vec<i64> = stamps.iter().copied().filter(|t| *t != 3605).collect();
        assert_eq!(used(learnt(), &spoilt), right);
    }

    #[test]
    fn rows_that_are_hours_apart_are_used() {
        for stamps in [&[5][..], &[0, 3600], &[0, 3600, 7200, 90_000, 93_600]] {
            assert_eq!(used(learnt(), stamps), stamps);
        }
    }

    #[test]
    fn a_declared_limit_comes_before_the_learnt_one() {
        let stamps = [0, 1, 2, 9, 3, 4, 5];
        assert_eq!(used(learnt(), &stamps), stamps, "ten intervals are no jump");
        assert_eq!(used(Jumps::new(Some(5.0), None), &stamps), [0, 1, 2, 3, 4, 5]);
    }
}
