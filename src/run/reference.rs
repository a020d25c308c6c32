//! The reference of a run: read ahead from a recorded source, or along with simulated rows.

use crate::assembly::{Assembly, StreamLayout};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{ConvergedSpec, Design, Named, ReferenceSpec, SigmaOf, SourceDesign, TrajectorySpec};
use crate::rows::{Row, RowStream};
use crate::score::{Comparison, Limits, Outage, ReferenceEpoch, Rules, TrajectoryRules, differentiate};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::StreamId;
use fusion_core::state::{Attitude, Manifold};
use fusion_core::time::Time;
use fusion_models::units::{Dimension, Dimensional, dim};
use nalgebra::Vector3;

/// Channels that a run can be scored against.
const SCORED: [&str; 3] = ["position", "velocity", "attitude"];
/// Dimension of the 1σ of each.
const DIMENSIONS: [Dimension; 3] = [dim::Length::KIND.dimension, dim::Speed::KIND.dimension, dim::Angle::KIND.dimension];

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
    pub(super) fn read(
        named: &Named<SourceDesign>,
        source: &mut dyn RowStream,
        reference: &Named<ReferenceSpec>,
    ) -> Result<Self, Diagnostics> {
        let layout = StreamLayout::provided(&named.name, source.channels());
        if !layout.channels.iter().any(|c| SCORED.contains(&c.name.as_str())) {
            let message = format!("the reference `{}` has no channel to be scored against", named.name);
            let help = "give it a `position`, a `velocity` or an `attitude`";
            return Err(Diagnostic::error(message).at(named.node.name_place()).help(help).into());
        }
        let sigmas = sigmas(reference, &layout)?;
        let (mut found, mut values) = (Vec::new(), Vec::new());
        loop {
            match source.next(&mut values) {
                Ok(Some(stamp)) => found.extend(epochs(stamp.time, &values, &layout, &sigmas)),
                Ok(None) => break,
                Err(error) => {
                    let mut d = Diagnostics::new();
                    d.extend(error.diagnostics(&named.node));
                    return Err(d);
                }
            }
        }
        found.sort_by_key(|e| e.time);
        if let Some(slope) = &reference.block.velocity_from_position {
            differentiate(&mut found, slope.half_window as usize, slope.max_span.si());
        }
        Ok(Self::Ahead(found))
    }

    /// The epochs of a row of the run; `None` where it is no row of the reference.
    pub(super) fn epochs(&self, row: &Row<'_>) -> Option<Vec<ReferenceEpoch>> {
        match self {
            Self::Along(stream, layout) if *stream == row.stream => Some(epochs(row.time, row.values, layout, &EXACT)),
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
    ///
    /// The trajectory of one of many runs is compared only if the design asks for it: nobody reads so many.
    pub(super) fn rules(&self, design: &Design, outages: &[Outage], is_one_of_many: bool) -> Rules {
        let spec = design.reference.as_ref().map(|r| &r.block);
        Rules {
            from: spec.and_then(|s| s.from).map(|t| Time::from_seconds(t.si())),
            nees_from: spec.and_then(|s| s.nees_from).map(|t| Time::from_seconds(t.si())),
            converged: spec.and_then(|s| s.converged.as_ref()).map(limits),
            remove_mean_mounting: spec.is_some_and(|s| s.remove_mean_mounting),
            outages: outages.to_vec(),
            episodes: spec.and_then(|s| s.episodes.clone()),
            trajectory: trajectory(spec.and_then(|s| s.trajectory.as_ref()), is_one_of_many),
        }
    }

    /// What compares estimates with it, if there is one; what was read ahead goes there. A simulated truth is
    /// that of the body origin.
    pub(super) fn comparison(&mut self, design: &Design) -> Option<Comparison> {
        let epochs = match self {
            Self::None => return None,
            Self::Along(..) => return Some(Comparison::new(Vector3::zeros(), [])),
            Self::Ahead(epochs) => epochs,
        };
        let spec = design.reference.as_ref().map(|r| &r.block);
        let lever_arm = spec.map_or_else(Vector3::zeros, |s| s.lever_arm.si().into());
        Some(Comparison::new(lever_arm, core::mem::take(epochs)))
    }
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

/// Where the 1σ of a reference's own error comes from, for each of [`SCORED`].
#[derive(Clone, Copy, Debug)]
enum SigmaFrom {
    /// The design, per axis.
    Declared(Vector3<f64>),
    /// Three numbers of a row from here on, times a factor.
    Row(usize, f64),
}

impl SigmaFrom {
    fn read(self, row: &[f64]) -> Vector3<f64> {
        match self {
            Self::Declared(sigma) => sigma,
            Self::Row(at, scale) => Vector3::new(row[at], row[at + 1], row[at + 2]) * scale,
        }
    }
}

/// Where the 1σ of a recorded reference come from, as `reference` says of its stream `layout`.
fn sigmas(reference: &Named<ReferenceSpec>, layout: &StreamLayout) -> Result<[SigmaFrom; 3], Diagnostics> {
    let declared = reference.block.sigma.each();
    let mut found = [SigmaFrom::Declared(Vector3::zeros()); 3];
    let mut d = Diagnostics::new();
    for ((from, sigma), (name, dimension)) in found.iter_mut().zip(declared).zip(SCORED.into_iter().zip(DIMENSIONS)) {
        *from = match sigma {
            None => continue,
            Some(SigmaOf::Declared(sigma)) => SigmaFrom::Declared(sigma.into()),
            Some(SigmaOf::Source { scale }) => {
                let wanted = format!("{name}_sigma");
                let column = layout.channels.iter().find(|c| c.name == wanted);
                let Some(column) = column.filter(|c| c.width == 3 && c.dimension == dimension) else {
                    let message = format!(
                        "the reference `{}` has no channel `{wanted}` of three numbers in {dimension}",
                        layout.name
                    );
                    let help = format!(
                        "add `{wanted} = {{ columns = […], unit = … }}` under [source.{}.channels]",
                        layout.name
                    );
                    d.push(
                        Diagnostic::error(message)
                            .at(reference.node.place_of(&format!("sigma.{name}")))
                            .help(help),
                    );
                    continue;
                };
                SigmaFrom::Row(column.offset, scale)
            }
        };
    }
    d.unless_errors(found)
}

/// The 1σ of a simulated truth.
const EXACT: [SigmaFrom; 3] = [SigmaFrom::Declared(Vector3::new(0.0, 0.0, 0.0)); 3];

/// The reference epochs of a row: one for each time at which some of its channels are valid. A
/// channel of which a number, or its own 1σ, is not finite has no value.
fn epochs(time: Time, row: &[f64], layout: &StreamLayout, sigmas: &[SigmaFrom; 3]) -> Vec<ReferenceEpoch> {
    let mut epochs: Vec<ReferenceEpoch> = Vec::with_capacity(1);
    for channel in &layout.channels {
        let values = &row[channel.offset..channel.offset + channel.width];
        let Some(scored) = SCORED.iter().position(|name| *name == channel.name) else {
            continue;
        };
        let sigma = sigmas[scored].read(row);
        if !values.iter().chain(&sigma).all(|v| v.is_finite()) {
            continue;
        }
        let valid = time.shifted(-channel.delay);
        let at = epochs.iter().position(|e| e.time == valid).unwrap_or_else(|| {
            epochs.push(ReferenceEpoch {
                time: valid,
                ..ReferenceEpoch::default()
            });
            epochs.len() - 1
        });
        let epoch = &mut epochs[at];
        match scored {
            0 => (epoch.position, epoch.sigma.position) = (Some(Geodetic::read(values)), sigma),
            1 => (epoch.velocity, epoch.sigma.velocity) = (Some(Vector3::new(values[0], values[1], values[2])), sigma),
            _ => (epoch.attitude, epoch.sigma.attitude) = (Some(Attitude::read(values)), sigma),
        }
    }
    epochs
}
