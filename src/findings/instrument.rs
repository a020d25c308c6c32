//! What a sensor is, as far as advice depends on it: from its block, never from its name.

use crate::config::Node;
use crate::design::Design;
use crate::run::FinalState;
use fusion_models::block::Reading;
use fusion_models::registry::{self, Role};
use fusion_models::units::{Dimension, Dimensional, dim};

/// A sensor of a design.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Instrument {
    /// Its name.
    pub(super) name: String,
    /// The source or stage that it reads.
    pub(super) source: String,
    /// Whether it is a pseudo-measurement, which no instrument makes.
    pub(super) is_constraint: bool,
    /// What of the solution it measures directly; none of what is something else.
    pub(super) measures: Option<Measures>,
    /// Which axes of it: north, east, down, or roll, pitch, yaw.
    pub(super) axes: [bool; 3],
    /// Whether it has a gate of its own.
    pub(super) has_gate: bool,
    /// Its bias; none where its block has no bias.
    pub(super) bias: Option<Bias>,
}

/// What a design says of the bias of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bias {
    /// It is no state.
    Fixed,
    /// A state that is constant.
    Constant,
    /// A state that is a random walk.
    Walk,
    /// A state with a correlation time.
    Correlated,
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

impl Bias {
    /// Of the field `bias` of a sensor; whether it is a state of the filter.
    fn of(field: Option<&Node>, is_state: bool) -> Self {
        let is_set = |key: &str| field.is_some_and(|f| f.get(key).is_some());
        match is_state {
            false => Self::Fixed,
            true if is_set("correlation_time") => Self::Correlated,
            true if is_set("random_walk") => Self::Walk,
            true => Self::Constant,
        }
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
            let is_state = states.iter().any(|state| state.name == bias);
            let (reading, rows) = (sensor.block.model.reading(), sensor.block.model.noise());
            let measures = rows.first().copied().and_then(Measures::of);
            Self {
                name: sensor.name.clone(),
                source: sensor.block.common.source.clone(),
                is_constraint: matches!(reading, Reading::Constant(_)),
                measures,
                axes: axes(measures, rows.len(), &reading),
                has_gate: sensor.block.gate.is_some(),
                bias: has_bias(kind).then(|| Bias::of(sensor.node.get("bias"), is_state)),
            }
        });
        sensors.collect()
    }
}

/// The axes of the solution that so many rows of a reading tell of.
fn axes(measures: Option<Measures>, rows: usize, reading: &Reading) -> [bool; 3] {
    let is_vertical = reading.channels().iter().any(|c| ["depth", "height"].contains(&&*c.name));
    match (measures, rows) {
        (Some(Measures::Position), 1) if is_vertical => [false, false, true],
        (Some(Measures::Position), 2) => [true, true, false],
        (Some(Measures::Attitude), 1) => [false, false, true],
        _ => [true; 3],
    }
}
