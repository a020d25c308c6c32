//! What a sensor is, as far as advice depends on it: from its block, never from its name.

use crate::design::Design;
use crate::run::FinalState;
use fusion_models::block::Reading;
use fusion_models::registry::{self, Role};
use fusion_models::units::{Dimension, Dimensional, dim};

/// A sensor of a design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Instrument {
    /// Its name.
    pub(super) name: String,
    /// The source or stage that it reads.
    pub(super) source: String,
    /// Whether it is a pseudo-measurement, which no instrument makes.
    pub(super) is_constraint: bool,
    /// What of the solution it measures directly; none of what is something else.
    pub(super) measures: Option<Measures>,
    /// Whether it is judged by a gate of its own, and not by that of another sensor or by none.
    pub(super) has_gate: bool,
    /// Whether its bias is a state; none where its block has no bias.
    pub(super) bias: Option<bool>,
}

/// A part of the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measures {
    Position,
    Velocity,
    Attitude,
}

impl Measures {
    pub(super) const ALL: [Self; 3] = [Self::Position, Self::Velocity, Self::Attitude];

    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
        }
    }

    /// That which has the dimension of a residual; a direction, of gravity or of the magnetic field, tells of attitude.
    fn of(dimension: Dimension) -> Option<Self> {
        let kinds = [
            (dim::Length::KIND, Self::Position),
            (dim::Speed::KIND, Self::Velocity),
            (dim::Angle::KIND, Self::Attitude),
            (dim::Acceleration::KIND, Self::Attitude),
            (dim::MagneticField::KIND, Self::Attitude),
        ];
        kinds
            .into_iter()
            .find(|(kind, _)| kind.dimension == dimension)
            .map(|(_, what)| what)
    }
}

impl Instrument {
    /// The sensors of a design, but for those inside stages; `states` are the parameters that it estimates.
    pub(super) fn of_design(design: &Design, states: &[FinalState]) -> Vec<Self> {
        let blocks = registry::all();
        let has_bias = |kind: &str| {
            let block = blocks.iter().find(|r| r.role == Role::Sensor && r.name == kind);
            block.is_some_and(|r| (r.schema)().pointer("/properties/bias").is_some())
        };
        let sensors = design.sensors.iter().map(|sensor| {
            let kind = sensor.node.get("type").and_then(|kind| kind.as_str()).unwrap_or_default();
            let bias = format!("{}.bias", sensor.name);
            Self {
                name: sensor.name.clone(),
                source: sensor.block.common.source.clone(),
                is_constraint: matches!(sensor.block.model.reading(), Reading::Constant(_)),
                measures: sensor.block.model.noise().first().copied().and_then(Measures::of),
                has_gate: sensor.block.gate.is_some() && sensor.block.common.only_with.is_none(),
                bias: has_bias(kind).then(|| states.iter().any(|state| state.name == bias)),
            }
        });
        sensors.collect()
    }
}
