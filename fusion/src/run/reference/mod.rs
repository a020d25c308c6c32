//! The reference of a run: read ahead from recorded sources, or along with simulated rows.

mod read;

pub(super) use read::{Scored, check};

use crate::assembly::Assembly;
use crate::config::Diagnostics;
use crate::design::{ConvergedSpec, Design, TrajectorySpec};
use crate::rows::{Row, RowStream};
use crate::score::{Comparison, Limits, Outage, ReferenceEpoch, Rules, TrajectoryRules, differentiate};
use fusion_core::runner::StreamId;
use fusion_core::state::{Dynamics, Layout, StateRole};
use fusion_core::time::Time;
use nalgebra::Vector3;

/// Where the reference epochs of a run come from.
#[derive(Debug)]
pub(super) enum Reference {
    /// The run has no reference.
    None,
    /// Epochs read before the run, in order of time, and the points of their sources in body axes \[m\].
    Ahead(Vec<ReferenceEpoch>, Vec<Vector3<f64>>),
    /// Rows of a stream among those of the run.
    Along(StreamId, Box<Scored>),
}

impl Reference {
    /// The reference of a simulated world.
    pub(super) fn simulated(assembly: &Assembly) -> Self {
        let mut streams = assembly.streams.iter().enumerate();
        let found = streams.find(|(_, stream)| stream.name == crate::world::REFERENCE);
        found.map_or(Self::None, |(id, layout)| Self::Along(id, Box::new(Scored::exact(layout))))
    }

    /// Reads a recorded source to its end, and adds it to those that were read before.
    pub(super) fn add(&mut self, scored: &Scored, source: &mut dyn RowStream) -> Result<(), Diagnostics> {
        let (mut epochs, mut points) = match core::mem::replace(self, Self::None) {
            Self::Ahead(epochs, points) => (epochs, points),
            Self::None | Self::Along(..) => (Vec::new(), Vec::new()),
        };
        epochs.extend(read_all(scored, points.len(), source)?);
        epochs.sort_by_key(|e| e.time);
        points.push(scored.point());
        *self = Self::Ahead(epochs, points);
        Ok(())
    }

    /// The epochs of a row of the run; `None` if the row is not from the reference.
    pub(super) fn epochs(&self, row: &Row<'_>) -> Option<Vec<ReferenceEpoch>> {
        match self {
            Self::Along(stream, scored) if *stream == row.stream => Some(scored.epochs(row.time, row.values)),
            _ => None,
        }
    }

    /// Returns true if there is nothing to score against.
    pub(super) const fn is_empty(&self) -> bool {
        match self {
            Self::None => true,
            Self::Ahead(epochs, _) => epochs.is_empty(),
            Self::Along(..) => false,
        }
    }

    /// How a design is scored against it; the drift is reported for each of the `outages`.
    ///
    /// The trajectory of one of many runs is compared only if the design asks for it: a campaign has too many to read.
    pub(super) fn rules(&self, design: &Design, layout: &Layout, outages: &[Outage], is_one_of_many: bool) -> Rules {
        let spec = design.reference.as_ref().map(|r| &r.block);
        Rules {
            from: spec.and_then(|s| s.from).map(|t| Time::from_seconds(t.si())),
            nees_from: spec.and_then(|s| s.nees_from).map(|t| Time::from_seconds(t.si())),
            converged: spec.and_then(|s| s.converged.as_ref()).map(limits),
            remove_mean_mounting: spec.is_some_and(|s| s.remove_mean_mounting),
            outages: outages.to_vec(),
            episodes: spec.and_then(|s| s.episodes.clone()),
            slowest: slowest(layout),
            trajectory: trajectory(spec.and_then(|s| s.trajectory.as_ref()), is_one_of_many),
        }
    }

    /// The comparison of estimates with the reference, if there is a reference. It takes the epochs that were read
    /// ahead. A simulated truth is at the body origin.
    pub(super) fn comparison(&mut self) -> Option<Comparison> {
        match self {
            Self::None => None,
            Self::Along(..) => Some(Comparison::new(Vector3::zeros(), [])),
            Self::Ahead(epochs, points) => Some(Comparison::of_points(core::mem::take(points), core::mem::take(epochs))),
        }
    }
}

/// The epochs of the source with this number, in order of time.
fn read_all(scored: &Scored, number: usize, source: &mut dyn RowStream) -> Result<Vec<ReferenceEpoch>, Diagnostics> {
    let (mut found, mut values) = (Vec::new(), Vec::new());
    loop {
        match source.next(&mut values) {
            Ok(Some(stamp)) => found.extend(scored.epochs(stamp.time, &values)),
            Ok(None) => break,
            Err(error) => {
                let mut d = Diagnostics::new();
                scored.node().into_iter().for_each(|node| d.extend(error.diagnostics(node)));
                return Err(d);
            }
        }
    }
    found.sort_by_key(|e| e.time);
    found.iter_mut().for_each(|epoch| epoch.source = number);
    if let Some(slope) = scored.slope() {
        differentiate(&mut found, slope.half_window as usize, slope.max_span.si());
    }
    Ok(found)
}

/// The longest correlation times of slow errors in metres, metres per second and radians \[s\].
fn slowest(layout: &Layout) -> [f64; 3] {
    let slow = layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic);
    let times = slow.filter_map(|b| match b.dynamics {
        Dynamics::GaussMarkov { tau, .. } => Some((b.unit, tau)),
        _ => None,
    });
    let longest = |unit: &str| {
        times
            .clone()
            .filter(|(of, _)| *of == unit)
            .fold(0.0, |longest: f64, (_, tau)| longest.max(tau))
    };
    ["m", "m/s", "rad"].map(longest)
}

/// How the trajectory is compared.
fn trajectory(spec: Option<&TrajectorySpec>, is_one_of_many: bool) -> Option<TrajectoryRules> {
    let declared = |s: &TrajectorySpec| TrajectoryRules {
        align: s.align,
        distances: s.distances.iter().map(|distance| distance.si()).collect(),
        pairs: s.pairs,
    };
    spec.map(declared).or_else(|| (!is_one_of_many).then(TrajectoryRules::default))
}

/// The declared limits in SI units.
fn limits(spec: &ConvergedSpec) -> Limits {
    Limits {
        position: spec.position.map(|limit| limit.si()),
        velocity: spec.velocity.map(|limit| limit.si()),
        heading: spec.heading.map(|limit| limit.si()),
        by: spec.by.map(|t| Time::from_seconds(t.si())),
    }
}
