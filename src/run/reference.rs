//! The reference of a run: read ahead from a recorded source, or along with simulated rows.

use crate::assembly::{Assembly, StreamLayout};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, ReferenceSpec, SourceDesign};
use crate::rows::{Row, RowStream};
use crate::score::{Comparison, ReferenceEpoch, Rules, differentiate};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::StreamId;
use fusion_core::state::{Attitude, Manifold};
use fusion_core::time::Time;
use nalgebra::Vector3;

/// Channels that a run can be scored against.
const SCORED: [&str; 3] = ["position", "velocity", "attitude"];

/// Where the reference epochs of a run come from.
#[derive(Debug)]
pub(super) enum Reference {
    /// There is none.
    None,
    /// Read before the run, in order of time.
    Ahead(Vec<ReferenceEpoch>),
    /// Rows of a stream of this layout among those of the run.
    Along(StreamId, StreamLayout),
}

impl Reference {
    /// That of a simulated world.
    pub(super) fn simulated(assembly: &Assembly) -> Self {
        let mut streams = assembly.streams.iter().enumerate();
        let found = streams.find(|(_, stream)| stream.name == crate::world::REFERENCE);
        found.map_or(Self::None, |(id, layout)| Self::Along(id, layout.clone()))
    }

    /// Reads a recorded source to its end.
    pub(super) fn read(named: &Named<SourceDesign>, source: &mut dyn RowStream, spec: &ReferenceSpec) -> Result<Self, Diagnostics> {
        let layout = StreamLayout::provided(&named.name, source.channels());
        if !layout.channels.iter().any(|c| SCORED.contains(&c.name.as_str())) {
            let message = format!("the reference `{}` has no channel to be scored against", named.name);
            let help = "give it a `position`, a `velocity` or an `attitude`";
            return Err(Diagnostic::error(message).at(named.node.name_place()).help(help).into());
        }
        let (mut found, mut values) = (Vec::new(), Vec::new());
        loop {
            match source.next(&mut values) {
                Ok(Some(stamp)) => found.extend(epochs(stamp.time, &values, &layout)),
                Ok(None) => break,
                Err(error) => {
                    let mut d = Diagnostics::new();
                    d.extend(error.diagnostics(&named.node));
                    return Err(d);
                }
            }
        }
        found.sort_by_key(|e| e.time);
        if let Some(slope) = &spec.velocity_from_position {
            differentiate(&mut found, slope.half_window as usize, slope.max_span.si());
        }
        Ok(Self::Ahead(found))
    }

    /// The epochs of a row of the run; `None` where it is no row of the reference.
    pub(super) fn epochs(&self, row: &Row<'_>) -> Option<Vec<ReferenceEpoch>> {
        match self {
            Self::Along(stream, layout) if *stream == row.stream => Some(epochs(row.time, row.values, layout)),
            _ => None,
        }
    }

    /// Whether there is nothing to be scored against.
    pub(super) fn is_empty(&self) -> bool {
        match self {
            Self::None => true,
            Self::Ahead(epochs) => epochs.is_empty(),
            Self::Along(..) => false,
        }
    }

    /// How a design is scored against it; `outages` are those whose drift is told.
    pub(super) fn rules(&self, design: &Design, outages: &[(Time, Time)]) -> Rules {
        let spec = design.reference.as_ref().map(|r| &r.block);
        Rules {
            from: spec.and_then(|s| s.from).map(|t| Time::from_seconds(t.si())),
            remove_mean_mounting: spec.is_some_and(|s| s.remove_mean_mounting),
            windows: outages.to_vec(),
        }
    }

    /// What compares estimates with it; what was read ahead goes there.
    pub(super) fn comparison(&mut self, design: &Design) -> Comparison {
        let spec = design.reference.as_ref().map(|r| &r.block);
        let lever_arm = spec.map_or_else(Vector3::zeros, |s| s.lever_arm.si().into());
        let ahead = match self {
            Self::Ahead(epochs) => core::mem::take(epochs),
            Self::None | Self::Along(..) => Vec::new(),
        };
        Comparison::new(lever_arm, ahead)
    }
}

/// The reference epochs of a row: one for each time at which some of its channels are valid.
fn epochs(time: Time, row: &[f64], layout: &StreamLayout) -> Vec<ReferenceEpoch> {
    let mut epochs: Vec<ReferenceEpoch> = Vec::with_capacity(1);
    for channel in &layout.channels {
        let values = &row[channel.offset..channel.offset + channel.width];
        if !values.iter().all(|v| v.is_finite()) {
            continue;
        }
        let valid = time.shifted(-channel.delay);
        let at = epochs.iter().position(|e| e.time == valid).unwrap_or_else(|| {
            epochs.push(ReferenceEpoch {
                time: valid,
                position: None,
                velocity: None,
                attitude: None,
            });
            epochs.len() - 1
        });
        match channel.name.as_str() {
            "position" => epochs[at].position = Some(Geodetic::read(values)),
            "velocity" => epochs[at].velocity = Some(Vector3::new(values[0], values[1], values[2])),
            "attitude" => epochs[at].attitude = Some(Attitude::read(values)),
            _ => {}
        }
    }
    epochs.retain(|e| e.position.is_some() || e.velocity.is_some() || e.attitude.is_some());
    epochs
}
