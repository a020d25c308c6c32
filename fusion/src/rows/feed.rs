//! What feeds a run.

use super::{Row, SourceReport};
use crate::config::Diagnostics;
use crate::solution::Solution;
use core::fmt::Debug;
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
use fusion_models::sim::Record;
use nalgebra::UnitQuaternion;
use serde::Serialize;

/// The filter that is fed, as a world sees it that is steered by what its vehicle knows.
pub trait Aboard {
    /// Where the vehicle believes to be `now`, from all rows that have been fed: what is held back is
    /// used, the rest predicted. None while there is no estimate of both.
    fn pose(&mut self, now: Time) -> Option<Pose>;
}

/// A place and an attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Of the body origin.
    pub position: Geodetic,
    /// q_nb.
    pub attitude: UnitQuaternion<f64>,
}

fusion_core::memory!(Pose { position, attitude });

impl Pose {
    /// That of a solution which has both.
    #[must_use]
    pub fn of(solution: &Solution) -> Option<Self> {
        let ((position, _), (attitude, _)) = solution.position.zip(solution.attitude)?;
        Some(Self { position, attitude })
    }
}

/// No filter: a vehicle that it is to steer stands still.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Aboard for Nobody {
    fn pose(&mut self, _: Time) -> Option<Pose> {
        None
    }
}

/// The rows of all streams of an assembly in order of their stamps, recorded or simulated.
pub trait Feed: Debug {
    /// The next row, of a stream of the assembly; all rows before it have been fed to the filter `aboard`.
    ///
    /// # Errors
    /// What is wrong with the data.
    fn next(&mut self, aboard: &mut dyn Aboard) -> Result<Option<Row<'_>>, Diagnostics>;

    /// The share of the data that has been read, where the data have an end that is known.
    fn share(&self) -> Option<f64> {
        None
    }

    /// How well a vehicle was steered, where there is one.
    fn record(&self) -> Option<Record> {
        None
    }

    /// The true state at the last row of the reference, in the layout of the filter; only a simulated
    /// world knows it.
    fn truth(&self) -> Option<&[f64]> {
        None
    }

    /// Whether a block of that state was drawn, and may be scored.
    fn is_drawn(&self, _block: &str) -> bool {
        false
    }

    /// Which numbers of which streams declared faults may change.
    fn disturbable(&self) -> Vec<(usize, Range<usize>)>;

    /// What each source delivered.
    fn statistics(&self) -> Vec<SourceStatistics>;
}

/// What a source delivered.
#[derive(Clone, Debug, Serialize)]
pub struct SourceStatistics {
    /// The source.
    pub name: String,
    /// Rows read.
    pub rows: u64,
    /// Rows delivered.
    pub used: u64,
    /// Rows left out, by reason.
    pub skipped: Vec<(String, u64)>,
    /// All of its report.
    #[serde(skip)]
    pub report: SourceReport,
}

impl SourceStatistics {
    /// Of a source by its report.
    #[must_use]
    pub fn new(name: &str, report: &SourceReport) -> Self {
        Self {
            name: name.to_owned(),
            rows: report.rows,
            used: report.used,
            skipped: report.skipped.iter().map(|s| (s.reason.clone(), s.count)).collect(),
            report: report.clone(),
        }
    }
}
