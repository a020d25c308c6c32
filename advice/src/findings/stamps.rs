//! Channels that the reference shares with a sensor because both read one instrument, and the clock of the input.
//!
//! Two channels that read the same rows of an instrument have the same latency and the same point on the vehicle.

use super::facts::Facts;
use super::instrument::Measures;
use super::level::sigmas;
use super::{Finding, is_large};
use fusion::config::{Edit, Node};
use fusion::design::Design;
use fusion::run::FinalState;
use fusion::score::Offset;
use fusion_models::block::Reading;
use fusion_models::param::ParamSpec;
use fusion_models::units::{self, Dimensional, dim};

/// Smaller differences of a latency \[s\] and of a point \[m\] are not reported: the centre of an antenna is hardly
/// better known.
const LEAST_LATENCY: f64 = 0.01;
const LEAST_ARM: f64 = 0.02;
/// A time offset agrees with that of the reference if they differ by less than this share. The motion differs where
/// each was found.
const ALIKE: f64 = 0.25;

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

impl Facts<'_> {
    /// A reference that reads a sensor's instrument without the latency of that sensor, if errors are too large.
    pub(super) fn late_reference(&self) -> Vec<(Measures, Finding)> {
        let told = self.stamps.common.iter().filter(|c| {
            let off = (c.delay.seconds - c.latency).abs();
            let is_far = off > LEAST_LATENCY.max(sigmas(self.stamps.common.len()) * c.delay.sigma);
            // A row cannot be stamped before it is measured: then another clock is wrong.
            is_far && c.delay.seconds > 0.0 && self.nees(c.what).is_some_and(is_large)
        });
        let latency = |c: &Common| Edit::set(format!("{}.latency", c.channel), format!("\"{:.3} s\"", c.delay.seconds));
        let finding = |c: &Common| Finding {
            about: "reference".to_owned(),
            evidence: format!(
                "the reference reads the {} of the instrument of `{}`, which is late by {:.3} s{}, with a latency of {} s",
                c.what.word(),
                c.delay.sensor,
                c.delay.seconds,
                c.delay
                    .state
                    .as_ref()
                    .map_or(String::new(), |name| format!(" (by its state `{name}`)")),
                fusion_tables::short(c.latency)
            ),
            advice: format!("{}, for its rows are as late", latency(c)),
            edits: vec![latency(c)],
            ..Finding::of("reference-late")
        };
        let mut all: Vec<(Measures, Finding)> = told.map(|c| (c.what, finding(c))).collect();
        all.dedup();
        all
    }

    /// A reference that reads a sensor's instrument with a point that differs from the estimated lever arm.
    pub(super) fn other_arm(&self) -> Option<Finding> {
        let (point, differs_by) = (self.point, sigmas(3 * self.stamps.common.len()));
        let differs =
            |(arm, sigma): &([f64; 3], [f64; 3])| (0..3).any(|k| (arm[k] - point[k]).abs() > LEAST_ARM.max(differs_by * sigma[k]));
        let found = self.stamps.common.iter().filter(|c| c.what == Measures::Position);
        let (common, (arm, sigma)) = found.filter_map(|c| Some((c, c.arm?))).find(|(_, arm)| differs(arm))?;
        let listed = |v: [f64; 3]| v.map(|v| format!("{v:.3}")).join(", ");
        let edit = Edit::set("reference.lever_arm", format!("[{}]", listed(arm)));
        Some(Finding {
            about: "reference".to_owned(),
            evidence: format!(
                "the reference reads the positions of the instrument of `{}`, whose `lever_arm` is found at [{}] m, 1σ [{}] m, but is \
                 compared at [{}] m",
                common.delay.sensor,
                listed(arm),
                listed(sigma),
                listed(point)
            ),
            advice: format!("it is one point: {edit}, or, if the other was measured, give it to the sensor with `estimate = false`"),
            edits: vec![edit],
            ..Finding::of("reference-arm")
        })
    }

    /// The positions of the reference and of all sensors are early by the same time: then the process input is late.
    pub(super) fn late_input(&self, offset: &Offset) -> Option<(String, Edit)> {
        let is_alike = |d: &Delay| d.state.is_some() && (d.seconds - offset.latency).abs() < ALIKE * offset.latency.abs();
        let (first, all) = (self.stamps.of_position.first()?, &self.stamps.of_position);
        let (source, now) = self.stamps.input.as_ref().filter(|_| all.iter().all(is_alike))?;
        let state = first.state.as_deref().unwrap_or_default();
        let edit = Edit::set(format!("source.{source}.time.offset"), format!("\"{:.3} s\"", now + first.seconds));
        let advice = format!(
            "so is `{state}`, {:.3} s, and nothing is stamped before it is measured: the clock of the process input is late by as much; \
             {edit}, {:.3} s less than now, and make the `time_offset` of each sensor larger by as much",
            first.seconds, -first.seconds
        );
        Some((advice, edit))
    }
}
