//! The properties of a sensor that advice depends on. They come from its block, never from its name.

use fusion::config::Node;
use fusion::design::{Design, Named, SensorDesign};
use fusion::run::FinalState;
use fusion_models::block::Reading;
use fusion_models::registry::{self, Role};
use fusion_models::units::{Dimension, Dimensional, dim, range};

/// A sensor of a design.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Instrument {
    /// Its name.
    pub(super) name: String,
    /// The source or stage that it reads.
    pub(super) source: String,
    /// Whether it is a pseudo-measurement, which no instrument makes.
    pub(super) is_constraint: bool,
    /// The part of the solution that it measures directly; `None` if it measures something else.
    pub(super) measures: Option<Measures>,
    /// The measured axes: north, east, down, or roll, pitch, yaw.
    pub(super) axes: [bool; 3],
    /// Whether the sensor has a gate.
    pub(super) has_gate: bool,
    /// Whether it measures a horizontal position: a two-condition gate judges nothing else.
    pub(super) has_horizontal_position: bool,
    /// Whether its gate has a recovery, which can be forbidden.
    pub(super) has_recovery: bool,
    /// The limits of the detector that decides when it holds; empty if it has no such stage.
    pub(super) limits: Vec<String>,
    /// The leader: the sensor is used only together with it.
    pub(super) leader: Option<String>,
    /// Its bias; `None` if its block has no bias.
    pub(super) bias: Option<Bias>,
    /// The properties of its rows that may be wrong.
    pub(super) channels: &'static [&'static str],
    /// The other parameters of its block that may be wrong, fixed or estimated.
    pub(super) parameters: Vec<String>,
    /// The declared 1σ of its rows \[SI\]; empty if its file reports it.
    pub(super) noise: Vec<f64>,
    /// The key of its 1σ; `None` if its file reports it.
    pub(super) noise_key: Option<String>,
    /// The 1σ that its source may report; `None` if the sensor already uses it, or cannot use it.
    pub(super) reports: Option<Reports>,
}

/// The 1σ that a source may report, as the design declares it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Reports {
    /// The channel of the source that would report it.
    pub(super) channel: String,
    /// The numbers of that channel.
    pub(super) width: usize,
    /// Whether the source declares it.
    pub(super) is_declared: bool,
    /// The 1σ that the sensor has instead, as it is written.
    pub(super) sigma: String,
}

/// How a design declares the bias of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bias {
    /// The bias is not a state.
    Fixed,
    /// A constant state.
    Constant,
    /// A random-walk state.
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

    /// The part with the dimension of this residual. A direction (of gravity or of the magnetic field) measures
    /// attitude.
    pub(super) fn of(dimension: Dimension) -> Option<Self> {
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
    /// From the field `bias` of a sensor; `is_state`: the bias is a state of the filter.
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
    /// The sensors of a design, except those inside stages. `states` are the parameters that the run estimated.
    pub(super) fn of_design(design: &Design, states: &[FinalState]) -> Vec<Self> {
        let blocks = registry::all();
        let schema = |role: Role, node: Option<&Node>| {
            let kind = node.and_then(|node| node.get("type")).and_then(|kind| kind.as_str());
            let block = blocks.iter().find(|r| r.role == role && Some(r.name) == kind);
            block.map_or(serde_json::Value::Null, |r| fusion::schema::block(r))
        };
        let sensors = design.sensors.iter().map(|sensor| {
            let own = schema(Role::Sensor, Some(&sensor.node));
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
                has_horizontal_position: rows.len() > 1 && rows[..2].iter().all(|row| *row == dim::Length::KIND.dimension),
                has_recovery: schema(Role::Gate, sensor.node.get("gate"))
                    .pointer("/properties/recovery")
                    .is_some(),
                limits: limits(design, &sensor.block.common.source),
                bias: own.pointer("/properties/bias").map(|_| Bias::of(sensor.node.get("bias"), is_state)),
                leader: sensor.block.common.only_with.as_ref().map(|leader| leader.sensor.clone()),
                channels: if rows.len() > 1 {
                    &["axes", "signs", "units"]
                } else {
                    &["sign", "unit"]
                },
                parameters: parameters(&own),
                noise: declared_noise(sensor, &rows),
                noise_key: noise_key(sensor),
                reports: reports(design, sensor),
            }
        });
        sensors.collect()
    }

    /// A list of the properties that may be wrong, other than the noise.
    pub(super) fn parts(&self) -> String {
        self.parts_but("")
    }

    /// The same list without the parameter that the finding already names.
    pub(super) fn parts_but(&self, told: &str) -> String {
        let parameters = self.parameters.iter().filter(|name| *name != told).map(|name| format!("`{name}`"));
        let channels = self.channels.iter().filter(|_| !self.is_constraint).map(|part| (*part).to_owned());
        let parts: Vec<String> = ["time stamps".to_owned()].into_iter().chain(channels).chain(parameters).collect();
        listed(&parts)
    }

    /// Returns true if it reports when a constraint holds, instead of the measurement of an instrument.
    pub(super) fn is_detected(&self) -> bool {
        self.is_constraint || !self.limits.is_empty()
    }

    /// Whether this sensor and another one are parts of one instrument.
    pub(super) fn is_of_one_with(&self, other: &Self) -> bool {
        let leads = |a: &Self, b: &Self| b.leader.as_ref() == Some(&a.name);
        self.source == other.source || leads(self, other) || leads(other, self)
    }
}

/// `time stamps, axes, signs, units and `lever_arm``.
pub(super) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The limits of a stage that decide whether it emits a row; empty if there is no such stage.
fn limits(design: &Design, stage: &str) -> Vec<String> {
    let fields = design.stages.iter().filter(|s| s.name == stage).flat_map(|s| s.node.entries());
    let is_limit = |key: &str| !["type", "source", "rate", "test_rate"].contains(&key);
    let limits = fields.filter(|field| is_limit(&field.key));
    limits.map(|field| format!("`stage.{stage}.{}`", field.key)).collect()
}

/// The measurement parameters of a sensor: possible states, tables of them, and other quantities. The bias is excluded:
/// it is handled separately.
fn parameters(schema: &serde_json::Value) -> Vec<String> {
    fn may_be_state(field: &serde_json::Value) -> bool {
        let choices = field["anyOf"].as_array();
        choices.is_some_and(|choices| choices.iter().any(|c| c["properties"]["estimate"].is_object()))
    }
    let Some(fields) = schema["properties"].as_object() else {
        return Vec::new();
    };
    let is_one = |field: &serde_json::Value| {
        let table = field["$ref"].as_str().and_then(|r| schema.pointer(r.strip_prefix('#')?));
        let has_one = table
            .and_then(|t| t["properties"].as_object())
            .is_some_and(|t| t.values().any(may_be_state));
        may_be_state(field) || has_one || field["examples"].is_array()
    };
    let named = fields.iter().filter(|(name, field)| *name != "bias" && is_one(field));
    named.map(|(name, _)| name.clone()).collect()
}

/// The settings of an inertial process that define how fast its errors grow between measurements, the most specific
/// first; empty for other processes.
pub(super) fn growth(process: &Node) -> Vec<String> {
    let kind = process.get("type").and_then(|kind| kind.as_str());
    let blocks = registry::all();
    let block = blocks.iter().find(|r| r.role == Role::Process && Some(r.name) == kind);
    let schema = block.map_or(serde_json::Value::Null, |r| fusion::schema::block(r));
    let has = |part: &str, key: &str| {
        let field = &schema["properties"][part];
        let table = field["$ref"].as_str().and_then(|r| schema.pointer(r.strip_prefix('#')?));
        table.unwrap_or(field)["properties"][key].is_object()
    };
    let settings = [
        ("accelerometer", "vibration"),
        ("gyro", "scale_noise"),
        ("gyro", "noise"),
        ("accelerometer", "noise"),
    ];
    let own = settings.into_iter().filter(|(part, key)| has(part, key));
    own.map(|(part, key)| format!("`process.{part}.{key}`")).collect()
}

/// The input biases that are constant states.
pub(super) fn constant_biases(process: &Node) -> Vec<String> {
    let is_constant = |part: &str| {
        let bias = process.get(part).and_then(|node| node.get("bias"));
        bias.is_some_and(|bias| bias.get("estimate").is_some() && Bias::of(Some(bias), true) == Bias::Constant)
    };
    let parts = ["gyro", "accelerometer"].into_iter().filter(|part| is_constant(part));
    parts.map(|part| format!("`process.{part}.bias`")).collect()
}

/// The declared 1σ of each row of a sensor \[SI\]; empty if its rows report their own.
fn declared_noise(sensor: &Named<SensorDesign>, rows: &[Dimension]) -> Vec<f64> {
    let noise = &sensor.block.common.noise;
    let sigma = noise.sigma.as_ref().filter(|_| !noise.from_source);
    sigma.and_then(|sigma| sigma.si::<range::Positive>(rows).ok()).unwrap_or_default()
}

/// The key of the 1σ of a sensor, unless its rows report their own.
fn noise_key(sensor: &Named<SensorDesign>) -> Option<String> {
    let noise = sensor.node.get("noise").filter(|_| !sensor.block.common.noise.from_source)?;
    let key = if noise.get("sigma").is_some() { "noise.sigma" } else { "noise" };
    Some(format!("sensor.{}.{key}", sensor.name))
}

/// The 1σ that the source of a sensor may report and that the sensor does not use.
fn reports(design: &Design, sensor: &Named<SensorDesign>) -> Option<Reports> {
    let noise = &sensor.block.common.noise;
    let channel = sensor.block.model.reported_sigma().filter(|_| !noise.from_source)?;
    let source = design.sources.iter().find(|s| s.name == sensor.block.common.source)?;
    let written = sensor.node.get("noise")?;
    Some(Reports {
        is_declared: source.node.at(&format!("channels.{}", channel.name)).is_some(),
        width: channel.width,
        channel: channel.name.to_string(),
        sigma: written.get("sigma").unwrap_or(written).inline(),
    })
}

/// The axes of the solution that a reading with this number of rows measures.
fn axes(measures: Option<Measures>, rows: usize, reading: &Reading) -> [bool; 3] {
    let is_vertical = reading.channels().iter().any(|c| ["depth", "height"].contains(&&*c.name));
    match (measures, rows) {
        (Some(Measures::Position), 1) if is_vertical => [false, false, true],
        (Some(Measures::Position), 2) => [true, true, false],
        (Some(Measures::Attitude), 1) => [false, false, true],
        _ => [true; 3],
    }
}
