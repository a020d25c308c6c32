//! The outcomes of a sensor's measurements.

use super::consistency::{Normalised, Rejections, Share};
use super::intervals::Intervals;
use super::recording::{BUCKETS, POINTS};
use super::trace::{Samples, Trace};
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::math;
use nalgebra::Vector3;

/// The outcomes of a sensor's measurements.
#[derive(Clone, Debug)]
pub(super) struct SensorTrack {
    pub name: String,
    /// The gate's statistic, if it is different from the NIS.
    pub own_statistic: bool,
    pub gated: bool,
    /// Residual rows that are kept.
    pub rows: usize,
    /// Whether it measures a place.
    pub is_place: bool,
    /// NIS of the used, NIS of the rejected, statistic, threshold, mode (1 denied); then, of
    /// every row in SI, the innovation of the accepted, that of the rejected and reacquired, its 3σ,
    /// and the smallest error that the gate would have refused.
    pub updates: Trace,
    /// North, east, down of the fixes: used, rejected.
    pub fixes: [Samples<3>; 2],
    /// How far fixes lie from the estimate before them over the ground \[m\]: used, rejected.
    pub apart: Trace,
    /// From one measurement to the next.
    pub intervals: Intervals,
    /// How many judged NIS are within the band of a consistent filter.
    pub nis: Share,
    /// The innovations of the accepted, per row that is kept.
    pub normalised: Box<[Normalised]>,
    /// The rejections of the gate.
    pub rejections: Rejections,
}

fusion_core::memory!(SensorTrack {
    own_statistic,
    gated,
    updates,
    fixes,
    apart,
    intervals,
    nis,
    normalised,
    rejections;
    name,
    rows,
    is_place
});

impl SensorTrack {
    /// Channels of the updates before those of the rows.
    pub(super) const JUDGED: usize = 5;
    /// A sensor with more residual rows is no vector in space: its rows are not kept.
    const ROWS: usize = 3;

    pub(super) fn new(name: &str, residual: usize) -> Self {
        let rows = if residual <= Self::ROWS { residual } else { 0 };
        Self {
            name: name.to_owned(),
            own_statistic: false,
            gated: false,
            rows,
            is_place: false,
            updates: Trace::new(Self::JUDGED + 4 * rows, BUCKETS),
            fixes: [Samples::new(POINTS), Samples::new(POINTS)],
            apart: Trace::new(2, BUCKETS),
            intervals: Intervals::new(BUCKETS),
            nis: Share::default(),
            normalised: vec![Normalised::new(); rows].into(),
            rejections: Rejections::default(),
        }
    }

    /// A measurement at `t` \[s\], which lies at `ned` if it is a fix.
    pub(super) fn judged(&mut self, t: f64, ned: Option<Vector3<f64>>, update: &Update<'_>) {
        let rejected = update.verdict == Verdict::Rejected;
        let kind = match update.verdict {
            Verdict::Accepted => Some(0),
            // Reacquired against the estimate, it is as far off as the rejected before it.
            Verdict::Rejected | Verdict::Reacquired => Some(1),
            Verdict::Undefined(_) | Verdict::Unusable => None,
        };
        let differs = (update.statistic - update.nis).abs() > 1e-9 * update.nis.abs();
        self.own_statistic |= differs;
        self.gated |= update.threshold.is_finite() || update.mode == Mode::Denied;
        self.rejections.add(update);
        if kind.is_some() {
            self.nis.add(update.nis, update.residual.len());
        }
        let pick = |chosen: bool| if chosen && update.nis.is_finite() { update.nis } else { f64::NAN };
        let denied = f64::from(u8::from(update.mode == Mode::Denied));
        let mut row = [f64::NAN; Self::JUDGED + 4 * Self::ROWS];
        row[..Self::JUDGED].copy_from_slice(&[
            pick(!rejected),
            pick(rejected),
            finite(update.statistic),
            finite(update.threshold),
            denied,
        ]);
        for (i, (r, sigma)) in update.residual.iter().zip(update.innovation_sigma).take(self.rows).enumerate() {
            let own = |kind: usize| Self::JUDGED + kind * self.rows + i;
            if let Some(kind) = kind {
                row[own(kind)] = *r;
            }
            if kind == Some(0) {
                self.normalised[i].add(r / sigma);
            }
            row[own(2)] = 3.0 * sigma;
            row[own(3)] = update.power.get(i).copied().map_or(f64::NAN, finite);
        }
        self.updates.push(t, &row[..self.updates.channels()]);
        self.intervals.add(t);
        if let Some(ned) = ned {
            let over_ground = |k: usize| update.residual.get(k).copied().unwrap_or(0.0);
            let apart = math::hypot(over_ground(0), over_ground(1));
            let mut row = [f64::NAN; 2];
            row[usize::from(kind != Some(0))] = finite(apart);
            self.apart.push(t, &row);
            self.fixes[usize::from(rejected)].push(t, ned.into());
        }
    }
}

fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::NAN }
}
