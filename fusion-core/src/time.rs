//! Time as integer nanoseconds.
//!
//! Every instant inside the framework is an `i64` count of nanoseconds from an epoch the log
//! chooses. Integers compare exactly, so the order of events never depends on rounding, and a
//! sum of steps is the step of the sum.

use crate::math;
use core::fmt;

/// An instant, in nanoseconds from the epoch of the log.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Time(i64);

impl Time {
    /// The earliest representable instant.
    pub const MIN: Self = Self(i64::MIN);
    /// The latest representable instant.
    pub const MAX: Self = Self(i64::MAX);

    /// From nanoseconds.
    #[must_use]
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// From the seconds of a stamp that comes from outside, rounded to the nearest nanosecond; `None`
    /// where they are not finite, or beyond the 292 years that can be counted.
    #[must_use]
    pub fn checked_from_seconds(seconds: f64) -> Option<Self> {
        let nanos = math::round(seconds * 1e9);
        // 2⁶³, which a float holds and an i64 does not; NaN is not below it.
        (nanos.abs() < i64::MAX as f64).then_some(Self(nanos as i64))
    }

    /// Converts trusted seconds, such as a constant, rounded to the nearest nanosecond. Out-of-range
    /// values saturate and NaN is 0.
    #[must_use]
    pub fn from_seconds(seconds: f64) -> Self {
        Self(math::round(seconds * 1e9) as i64)
    }

    /// Nanoseconds from the epoch.
    #[must_use]
    #[inline]
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Seconds from the epoch (exact to a nanosecond for |t| < 50 days).
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// `self − earlier` in seconds; the difference is taken in integers first.
    #[must_use]
    #[inline]
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// This instant moved by `nanos`, saturating.
    #[must_use]
    #[inline]
    pub const fn shifted(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }
}

impl fmt::Debug for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} s", self.seconds())
    }
}

/// Seconds as a whole number of nanoseconds, rounded.
#[must_use]
pub fn nanos(seconds: f64) -> i64 {
    Time::from_seconds(seconds).nanos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_steps_of_ten_milliseconds_are_ten_seconds_exactly() {
        let mut t = Time::default();
        for _ in 0..1000 {
            t = t.shifted(nanos(0.01));
        }
        assert_eq!(t, Time::from_seconds(10.0));
    }

    #[test]
    fn what_is_no_time_makes_no_stamp() {
        for seconds in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 9.3e9, -9.3e9, 1e300] {
            assert_eq!(Time::checked_from_seconds(seconds), None, "{seconds}");
        }
        for seconds in [0.0, -0.25, 1_752_003_258.5, 9.2e9, -9.2e9] {
            assert_eq!(Time::checked_from_seconds(seconds), Some(Time::from_seconds(seconds)), "{seconds}");
        }
    }

    #[test]
    fn differences_keep_the_nanosecond_far_from_the_epoch() {
        let a = Time::from_nanos(1_752_003_258_000_000_001);
        let b = Time::from_nanos(1_752_003_258_000_000_000);
        assert_eq!(a.seconds_since(b), 1e-9);
    }
}
