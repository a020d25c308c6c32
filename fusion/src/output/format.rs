//! Further formats of the estimates, for maps and other programs.

use super::{Origin, OutputFile};
use crate::solution::Solution;
use crate::source::table::unix_of_gps;
use core::fmt::Debug;
use fusion_core::belief::Belief;
use fusion_core::health::State;
use fusion_core::state::Layout;
use fusion_core::time::Time;
use std::io;

/// A format of the estimates of the outermost filter, in addition to the CSV files. A crate registers it, and
/// `fusion run --out DIR --also NAME` writes it: `estimates.ENDING`, and `smoothed.ENDING` if estimates are smoothed.
///
/// ```
/// use fusion::core::belief::Belief;
/// use fusion::output::{EstimateFormat, EstimateSink, OutputFile};
/// use fusion::solution::Solution;
/// use std::io::{self, Write};
///
/// #[derive(Debug)]
/// struct Heights(OutputFile);
///
/// impl EstimateSink for Heights {
///     fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
///         match &solution.position {
///             Some((place, _)) => writeln!(self.0, "{:.3}", place.height),
///             None => Ok(()),
///         }
///     }
///
///     fn finish(self: Box<Self>) -> io::Result<OutputFile> {
///         Ok(self.0)
///     }
/// }
///
/// fusion::inventory::submit! {
///     EstimateFormat {
///         name: "heights",
///         ending: "txt",
///         about: "the height of each epoch in metres",
///         begin: |file, _about| Ok(Box::new(Heights(file))),
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct EstimateFormat {
    /// Its name.
    pub name: &'static str,
    /// The ending of its files, without the dot.
    pub ending: &'static str,
    /// Its content, in a few words.
    pub about: &'static str,
    /// Begins a file.
    ///
    /// # Errors
    /// The errors of the file.
    pub begin: fn(OutputFile, &EstimateAbout<'_>) -> io::Result<Box<dyn EstimateSink>>,
}

crate::inventory::collect!(EstimateFormat);

impl EstimateFormat {
    /// All formats that are linked, by name.
    #[must_use]
    pub fn all() -> Vec<&'static Self> {
        let mut all: Vec<_> = crate::inventory::iter::<Self>.into_iter().collect();
        all.sort_by_key(|format| format.name);
        all
    }
}

/// The facts about a run that a format may need.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct EstimateAbout<'a> {
    /// The states.
    pub layout: &'a Layout,
    /// Where local coordinates start.
    pub origin: Origin,
    /// The time of the log as a date.
    pub clock: EstimateClock,
}

/// The time of the log as a date.
#[derive(Clone, Copy, Debug, Default)]
pub struct EstimateClock {
    /// GPS time at time zero \[ns\]; `None` if no source declares it.
    pub time_zero: Option<i64>,
}

impl EstimateClock {
    /// Nanoseconds of GPS time; `None` if the date is not known.
    #[must_use]
    pub fn gps_nanos(self, time: Time) -> Option<i64> {
        self.time_zero.map(|zero| zero.saturating_add(time.nanos()))
    }

    /// Nanoseconds since 1970-01-01 UTC, without leap seconds; the time of the log if its date is not known.
    #[must_use]
    pub fn unix_nanos(self, time: Time) -> i64 {
        self.gps_nanos(time).map_or(time.nanos(), unix_of_gps)
    }
}

/// Writes the estimates of one file.
pub trait EstimateSink: Debug {
    /// Writes one estimate. Times increase.
    ///
    /// # Errors
    /// The errors of the file.
    fn write(&mut self, solution: &Solution, belief: &Belief) -> io::Result<()>;

    /// The health of the filter has changed. A reason is its word and a text that names the sensor or state. Smoothed
    /// estimates have no health.
    ///
    /// # Errors
    /// The errors of the file.
    fn health(&mut self, _time: Time, _state: State, _reasons: &[(&str, String)]) -> io::Result<()> {
        Ok(())
    }

    /// Writes the end, and returns the file.
    ///
    /// # Errors
    /// The errors of the file.
    fn finish(self: Box<Self>) -> io::Result<OutputFile>;
}
