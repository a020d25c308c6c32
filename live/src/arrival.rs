//! The clock of arrivals.

use fusion::source::table::unix_of_gps;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// 1980-01-06, the start of GPS time, in Unix time \[ns\].
const GPS_START: i64 = 315_964_800_000_000_000;

/// GPS time of this computer \[ns\]: its system clock at the start, carried on by its monotonic clock. So it never jumps
/// and never goes back while the program runs.
#[derive(Clone, Copy, Debug)]
pub struct ArrivalClock {
    begun: Instant,
    zero: i64,
}

impl ArrivalClock {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self {
            begun: Instant::now(),
            zero: gps_of_unix(i64::try_from(unix.as_nanos()).unwrap_or(i64::MAX)),
        }
    }

    /// GPS time now \[ns\].
    #[must_use]
    pub fn now(&self) -> i64 {
        self.at(Instant::now())
    }

    /// GPS time at an instant of the monotonic clock \[ns\].
    #[must_use]
    pub fn at(&self, instant: Instant) -> i64 {
        let passed = instant.saturating_duration_since(self.begun).as_nanos();
        self.zero.saturating_add(i64::try_from(passed).unwrap_or(i64::MAX))
    }

    /// GPS time less Unix time at the start: the leap seconds \[ns\].
    #[must_use]
    pub fn ahead_of_unix(&self) -> i64 {
        self.zero - unix_of_gps(self.zero)
    }
}

/// GPS time \[ns\] of Unix time \[ns\], with leap seconds.
fn gps_of_unix(unix: i64) -> i64 {
    let guess = unix - GPS_START;
    // Leap seconds change by one at most between the two times.
    let first = guess + (unix - unix_of_gps(guess));
    first + (unix - unix_of_gps(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gps_time_of_a_date_has_the_leap_seconds_of_that_date() {
        // 2026-01-01T00:00:00Z: 18 leap seconds since 1980.
        let unix = 1_767_225_600_000_000_000;
        assert_eq!(gps_of_unix(unix) - (unix - GPS_START), 18_000_000_000);
        // 1990-06-01: six.
        let unix = 644_198_400_000_000_000;
        assert_eq!(gps_of_unix(unix) - (unix - GPS_START), 6_000_000_000);
    }

    #[test]
    fn it_goes_with_the_monotonic_clock() {
        let clock = ArrivalClock::start();
        let later = clock.begun + std::time::Duration::from_millis(1500);
        assert_eq!(clock.at(later) - clock.zero, 1_500_000_000);
        assert_eq!(clock.ahead_of_unix() % 1_000_000_000, 0);
    }
}
