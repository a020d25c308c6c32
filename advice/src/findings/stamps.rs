//! Channels that the reference shares with a sensor because both read one instrument, and the clock of the input.
//!
//! Two channels that read the same rows of an instrument have the same latency and the same point on the vehicle.

use super::instrument::Measures;
use fusion::config::Node;
use fusion::design::Design;
use fusion::run::FinalState;
use fusion_models::block::Reading;
use fusion_models::param::ParamSpec;
use fusion_models::units::{self, Dimensional, dim};

/// The latency of a sensor, by its design and its estimated offset.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Delay {
    pub(super) sensor: String,
    /// The state of its offset; `None` if it is fixed.
    pub(super) state: Option<String>,
    /// Latency of its channel and offset, and the 1σ of the offset \[s\].
    pub(super) seconds: f64,
    pub(super) sigma: f64,
}

/// A channel of one instrument, read by a sensor and by the reference.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Common {
    pub(super) delay: Delay,
    pub(super) what: Measures,
    /// The channel of the reference, as `source.withheld.channels.velocity`, and its latency \[s\].
    pub(super) channel: String,
    pub(super) latency: f64,
    /// The estimated lever arm of the sensor and its 1σ \[m\]; `None` if it is not a state.
    pub(super) arm: Option<([f64; 3], [f64; 3])>,
}

/// The time stamps of a design.
#[derive(Clone, Debug, Default)]
pub(super) struct Stamps {
    pub(super) common: Vec<Common>,
    /// The latencies of the sensors of position.
    pub(super) of_position: Vec<Delay>,
    /// The source of the process input, and the offset of its stamps \[s\].
    pub(super) input: Option<(String, f64)>,
}

impl Stamps {
    /// From a design; `states` are its estimated parameters.
    pub(super) fn of_design(design: &Design, states: &[FinalState]) -> Self {
        let source = |name: &str| design.sources.iter().find(|s| s.name == name).map(|s| &s.node);
        let state = |name: &str| states.iter().find(|s| s.name == name);
        let mut all = Self::default();
        let input = design.process.node.get("source").and_then(Node::as_str);
        all.input = input.and_then(|name| Some((name.to_owned(), seconds(source(name)?.at("time.offset")))));
        let judges = design.reference.as_ref().map_or_else(Vec::new, |r| r.block.sources());
        for sensor in &design.sensors {
            let model = &sensor.block.model;
            let what = model.noise().first().copied().and_then(Measures::of);
            let is_constraint = matches!(model.reading(), Reading::Constant(_));
            let Some((what, own)) = what.zip(source(&sensor.block.common.source)).filter(|_| !is_constraint) else {
                continue;
            };
            let (fixed, offset) = match &sensor.block.common.time_offset {
                ParamSpec::Fixed(value) => (value.si(), None),
                ParamSpec::Estimated(_) => (0.0, state(&format!("{}.time_offset", sensor.name))),
                ParamSpec::Shared(name) => (0.0, state(name)),
            };
            let delay = |channel: &str| Delay {
                sensor: sensor.name.clone(),
                state: offset.map(|s| s.name.clone()),
                seconds: fixed + offset.map_or(0.0, |s| s.value[0]) + seconds(own.at(&format!("channels.{channel}.latency"))),
                sigma: offset.map_or(0.0, |s| s.sigma[0]),
            };
            let arm = sensor
                .node
                .get("lever_arm")
                .and_then(|arm| match arm.get("shared").and_then(Node::as_str) {
                    Some(name) => state(name),
                    None => state(&format!("{}.lever_arm", sensor.name)),
                });
            let arm = arm.and_then(|s| Some((s.value.as_slice().try_into().ok()?, s.sigma.as_slice().try_into().ok()?)));
            let reading = model.reading();
            let Some(channel) = reading.channels().first().map(|c| c.name.to_string()) else {
                continue;
            };
            if what == Measures::Position {
                all.of_position.push(delay(&channel));
            }
            for (name, _) in &judges {
                let path = format!("channels.{channel}");
                if let Some(judge) = source(name).filter(|judge| is_one(own, judge, &path)) {
                    all.common.push(Common {
                        delay: delay(&channel),
                        what,
                        channel: format!("source.{name}.{path}"),
                        latency: seconds(judge.at(&format!("{path}.latency"))),
                        arm,
                    });
                }
            }
        }
        all
    }
}

/// Whether two sources read a channel from the same columns of one file, with one clock.
pub(super) fn is_one(a: &Node, b: &Node, channel: &str) -> bool {
    let same = |path: &str| a.at(path).map(Node::inline) == b.at(path).map(Node::inline);
    let keys = ["columns", "column", "latitude", "north", "ecef", "utm"];
    let first = keys.iter().map(|key| format!("{channel}.{key}")).find(|path| a.at(path).is_some());
    a.get("path").is_some() && same("path") && same("time") && first.is_some_and(|path| same(&path))
}

/// A time as it is written; 0 if it is missing.
pub(super) fn seconds(node: Option<&Node>) -> f64 {
    let text = node.map(|node| node.as_str().map_or_else(|| node.inline(), str::to_owned));
    let time = text.and_then(|text| units::parse(&text).ok());
    let is_time = |dimension| dimension == dim::Duration::KIND.dimension || dimension == units::Dimension::NONE;
    time.filter(|(_, dimension)| is_time(*dimension))
        .map_or(0.0, |(seconds, _)| seconds)
}
