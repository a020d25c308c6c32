//! Stamps that jump ahead: believed when a second row confirms them.

use fusion_core::time::{Time, nanos};

/// A jump is longer than this many of the longest recent intervals.
const INTERVALS: i64 = 10;
/// A jump where no interval is known yet \[ns\].
const FIRST: i64 = 1_000_000_000;

/// Tells a wrong stamp from a gap, by the row after it.
#[derive(Clone, Debug)]
pub(super) struct Jumps {
    declared: Option<i64>,
    /// The longest recent interval \[ns\]; 0 where none is known.
    interval: i64,
}

/// What the row after a jump says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum After {
    /// Its stamp.
    Stamp(i64),
    /// There is none, or it cannot be read.
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

    /// Whether a stamp has to be confirmed: that of the first row, and one that jumps.
    pub(super) fn is_in_doubt(&self, last: Option<i64>, stamp: i64) -> bool {
        last.is_none_or(|last| stamp.saturating_sub(last) > self.limit())
    }

    /// Why a stamp in doubt is wrong; `None` where the row after it confirms it. A row after a gap
    /// is followed by one at about its time; one with a wrong stamp by one that goes back.
    pub(super) fn refute(&self, last: Option<i64>, stamp: i64, after: After) -> Option<String> {
        let time = Time::from_nanos;
        let step = |from: i64, to: i64| time(to).seconds_since(time(from));
        match (last, after) {
            (None, After::Stamp(next)) if stamp.saturating_sub(next) > self.limit() => Some(format!(
                "the first stamp is {}, and the next row goes back to {}",
                time(stamp),
                time(next)
            )),
            (Some(last), After::Stamp(next)) if next.saturating_sub(last) < stamp.saturating_sub(next) => Some(format!(
                "{} is {:.3} s after the row before, and the next row goes back to {}",
                time(stamp),
                step(last, stamp),
                time(next)
            )),
            // Of two rows alone, none is known to be wrong.
            (Some(last), After::Nothing) if self.declared.is_some() || self.interval > 0 => Some(format!(
                "{} is {:.3} s after the row before, and no row after it confirms that",
                time(stamp),
                step(last, stamp)
            )),
            _ => None,
        }
    }

    /// An interval of rows in order. A gap raises what counts as recent tenfold at most, and for
    /// about twenty rows.
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

    /// Of stamps in seconds: those that are used.
    fn used(mut jumps: Jumps, stamps: &[i64]) -> Vec<i64> {
        let (mut last, mut used) = (None, Vec::new());
        for (k, stamp) in stamps.iter().enumerate() {
            let after = stamps.get(k + 1).map_or(After::Nothing, |s| After::Stamp(s * S));
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
    fn a_gap_is_confirmed_by_the_row_after_it() {
        let stamps: Vec<i64> = (0..20).chain(3600..3620).collect();
        assert_eq!(used(learnt(), &stamps), stamps);
        // A wrong stamp soon after a gap is none the less one.
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
