//! The source of the rows of a run.

use super::{Row, SourceReport};
use crate::config::Diagnostics;
use crate::solution::Solution;
use core::fmt::Debug;
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::health::Health;
use fusion_core::memory::Memory;
use fusion_core::time::Time;
use fusion_models::sim::Record;
use nalgebra::UnitQuaternion;
use schemars::JsonSchema;
use serde::Serialize;

/// The filter, as seen by a simulated world whose vehicle steers by the estimate.
pub trait Aboard {
    /// The estimated pose at `now`, from all rows fed so far: held-back rows are used, and the rest is predicted.
    /// `None` without an estimate of both position and attitude.
    fn pose(&mut self, now: Time) -> Option<Pose>;

    /// The whole solution at `now`, in the same way; `None` before the filter has started.
    fn solution(&mut self, _now: Time) -> Option<Solution> {
        None
    }

    /// The conditions that the filter still waits for before it can start, in words.
    fn waits_for(&self) -> Vec<String> {
        Vec::new()
    }

    /// The health of the filter.
    fn health(&self) -> Option<&Health> {
        None
    }
}

/// A place and an attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position of the body origin.
    pub position: Geodetic,
    /// q_nb.
    pub attitude: UnitQuaternion<f64>,
}

fusion_core::memory!(Pose { position, attitude });

impl Pose {
    /// The pose of a solution that has both position and attitude.
    #[must_use]
    pub fn of(solution: &Solution) -> Option<Self> {
        let ((position, _), (attitude, _)) = solution.position.zip(solution.attitude)?;
        Some(Self { position, attitude })
    }
}

/// No filter: a vehicle without a filter stands still.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Aboard for Nobody {
    fn pose(&mut self, _: Time) -> Option<Pose> {
        None
    }
}

/// The rows of all streams of an assembly in order of their stamps, recorded or simulated.
pub trait Feed: Debug {
    /// The next row of any stream of the assembly; all earlier rows have been fed to the filter `aboard`.
    ///
    /// # Errors
    /// The data are invalid.
    fn next(&mut self, aboard: &mut dyn Aboard) -> Result<Option<Row<'_>>, Diagnostics>;

    /// The share of the data that has been read, if the end of the data is known.
    fn share(&self) -> Option<f64> {
        None
    }

    /// Its memory for a checkpoint, if it resumes by that memory. Any other feed starts again from its first row.
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        None
    }

    /// How well a vehicle was steered, if there is a vehicle.
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

    /// The statistics of each source.
    fn statistics(&self) -> Vec<SourceStatistics>;
}

/// The statistics of a source.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SourceStatistics {
    /// The source.
    pub name: String,
    /// Rows read.
    pub rows: u64,
    /// Rows delivered.
    pub used: u64,
    /// Rows left out, by reason.
    pub skipped: Vec<(String, u64)>,
    /// The full report.
    #[serde(skip)]
    pub report: SourceReport,
}

impl SourceStatistics {
    /// Makes the statistics of a source from its report.
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
