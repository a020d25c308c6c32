//! The parameters to try as states, and their initial values.

use crate::frames::mistake::declared_offset;
use fusion::config::{Diagnostics, Node};
use fusion::design::{Design, Named, SensorDesign, parameters};
use fusion_core::math;
use fusion_models::units::{Axes, Duration, Vec3Of, dim};
use serde_json::Value as Json;
use std::f64::consts::PI;

/// The sign of a lever arm shorter than this does not matter \[m\].
pub(super) const SHORTEST: f64 = 0.1;
pub(super) const ARM: &str = "lever_arm";
const BIAS: &str = "bias";

/// A kind of parameter that is tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sort {
    /// The unit for display, as the schema writes it, and its value in SI.
    pub(super) unit: &'static str,
    pub(super) si: f64,
    /// 1σ of a careful guess, in this unit.
    pub(super) sigma: f64,
    /// The smallest error that matters, in this unit.
    pub(super) least: f64,
}

const fn sort(unit: &'static str, si: f64, sigma: f64, least: f64) -> Sort {
    Sort { unit, si, sigma, least }
}

/// Parameters that the construction and mounting of a sensor fix. Slow errors are not such parameters.
const SORTS: [Sort; 6] = [
    sort("deg", PI / 180.0, 10.0, 2.0),
    sort("%", 0.01, 10.0, 2.0),
    sort("s", 1.0, 0.3, 0.05),
    sort("m", 1.0, 1.0, 0.5),
    sort("uT", 1e-6, 10.0, 2.0),
    sort("m/s", 1.0, 0.5, 0.1),
];
/// The distance between two tracks is not a lever arm.
const GAUGE: Sort = sort("m", 1.0, 1.0, 0.1);
/// A speed error of 1 % is ten metres in a kilometre.
const SCALE: Sort = sort("%", 0.01, 10.0, 0.5);

/// The scale errors of a speed in another unit or with the other sign: the sign, knots and km/h read as m/s, m/s read
/// as knots and as km/h \[%\].
const SCALES: [f64; 5] = [-200.0, 94.384, 260.0, -48.556, -72.222];
/// Latencies to try, relative to the declared one \[s\].
const LATER: [f64; 4] = [0.5, -0.5, 1.5, -1.5];

/// A parameter that is tried as a state.
#[derive(Clone)]
pub(super) struct Tried<'a> {
    pub(super) sensor: &'a Named<SensorDesign>,
    pub(super) key: String,
    pub(super) sort: Sort,
    /// As it is declared, for TOML.
    pub(super) declared: String,
    /// 1σ at the start, in the unit of the sort.
    pub(super) sigma: f64,
    pub(super) is_rotation: bool,
    pub(super) is_state: bool,
    /// 1σ of the initial state for each axis. The initial value claims no better accuracy \[m\].
    pub(super) prior: [f64; 3],
    /// The delay that the source declares for its rows \[s\].
    pub(super) delay: f64,
    /// Other sensors that share this parameter.
    pub(super) shared_by: Vec<String>,
}

/// A value that a parameter starts from.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// For TOML.
    pub(super) initial: String,
    /// 1σ in the unit of the sort.
    pub(super) sigma: f64,
    /// The difference from the declaration.
    pub(super) is: Other,
}

/// The kind of a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Other {
    /// As declared.
    Nothing,
    /// The axes are turned about down, or forward, by this number of degrees.
    Turned(&'static str, f64),
    /// The numbers are too large by a factor; −1 for the other sign.
    Factor(f64),
    /// Another value.
    Value,
}

impl Tried<'_> {
    pub(super) fn is_arm(&self) -> bool {
        self.key == ARM
    }

    pub(super) fn name(&self) -> String {
        format!("{}.{}", self.sensor.name, self.key)
    }

    /// The assignments that make the parameter a state.
    pub(super) fn assignments(&self, start: &Start) -> Vec<String> {
        let (name, key, unit) = (&self.sensor.name, &self.key, self.sort.unit);
        let Start { initial, sigma, .. } = start;
        let own = format!("sensor.{name}.{key}={{ estimate = true, initial = {initial}, sigma = \"{sigma} {unit}\" }}");
        let others = self
            .shared_by
            .iter()
            .map(|other| format!("sensor.{other}.{key}={{ shared = {:?} }}", self.name()));
        [own].into_iter().chain(others).collect()
    }

    /// The entry for another sensor that shares this parameter.
    pub(super) fn shares(&self) -> String {
        format!("{} = {{ shared = {:?} }}", self.key, self.name())
    }

    /// Returns true if the sensor of `other` shares this parameter.
    pub(super) fn is_shared_by(&self, other: &Self) -> bool {
        self.key == other.key && self.shared_by.contains(&other.sensor.name)
    }

    /// One latency for all suspected sensors of its source, if this sensor is the first of them.
    pub(super) fn receiver(&self, suspects: &[&Self]) -> Option<Self> {
        let source = |tried: &Self| tried.sensor.node.get("source").and_then(Node::as_str).map(str::to_owned);
        let is_alike = |other: &&&Self| other.sort.unit == "s" && other.declared == self.declared && source(other) == source(self);
        let names: Vec<String> = suspects.iter().filter(is_alike).map(|other| other.sensor.name.clone()).collect();
        let (first, others) = names.split_first()?;
        (self.sort.unit == "s" && *first == self.sensor.name && !others.is_empty()).then(|| Self {
            shared_by: others.to_vec(),
            ..self.clone()
        })
    }

    /// Returns true if a different value is reported when all parameters are states. The sign of an arm is always
    /// reported.
    pub(super) fn is_judged(&self) -> bool {
        !self.is_state || self.key == BIAS
    }

    /// The start from the declared value.
    pub(super) fn start(&self) -> Start {
        Start {
            initial: self.declared.clone(),
            sigma: self.sigma,
            is: Other::Nothing,
        }
    }

    /// The factor of another unit, or of the other sign, that corresponds to a scale.
    pub(super) fn unit(&self, value: f64) -> Option<f64> {
        let factors = SCALES.map(|percent| 1.0 + percent / 100.0);
        let is = |factor: &f64| ((1.0 + value) / factor - 1.0).abs() < 0.05;
        factors.into_iter().find(is).filter(|_| self.key == "scale")
    }

    /// A start from a value in SI.
    pub(super) fn from(&self, value: f64) -> Start {
        Start {
            initial: format!("\"{} {}\"", value / self.sort.si, self.sort.unit),
            sigma: self.sigma,
            is: Other::Value,
        }
    }

    /// Starts far from the declared value, which a linear filter cannot reach from there.
    pub(super) fn far_starts(&self, declared: f64) -> Vec<Start> {
        let near = |initial: String, is| Start {
            initial,
            sigma: self.sort.sigma / 2.0,
            is,
        };
        match &self.key[..] {
            _ if self.is_rotation => {
                let Some([roll, pitch, yaw]) = rpy(&self.declared) else {
                    return Vec::new();
                };
                // A one-dimensional measurement cannot be turned: it has only a factor or a sign. A constraint has no
                // axes.
                let model = &self.sensor.block.model;
                if model.noise().len() < 2 || model.reading().channels().is_empty() {
                    return Vec::new();
                }
                let round = |angle: f64| if angle > 180.0 { angle - 360.0 } else { angle };
                let turned = |axis: &'static str, by: f64| {
                    let about = if axis == "down" {
                        [roll, pitch, round(yaw + by)]
                    } else {
                        [round(roll + by), pitch, yaw]
                    };
                    let words: Vec<String> = about.iter().map(|angle| format!("\"{angle} deg\"")).collect();
                    near(format!("[{}]", words.join(", ")), Other::Turned(axis, by))
                };
                [("down", 90.0), ("down", -90.0), ("down", 180.0), ("forward", 180.0)]
                    .map(|(axis, by)| turned(axis, by))
                    .into()
            }
            "scale" => SCALES
                .map(|percent| near(format!("\"{percent} %\""), Other::Factor(1.0 + percent / 100.0)))
                .into(),
            "time_offset" => {
                let undeclared = Some(0.0).filter(|_| declared.abs() > LATER[0]);
                let values = LATER.iter().map(|later| declared + later).chain(undeclared);
                values.map(|value| self.from(value)).collect()
            }
            "gauge" => [0.5, 1.5, 2.0].map(|factor| self.from(factor * declared)).into(),
            _ => Vec::new(),
        }
    }
}

/// Roll, pitch and yaw in degrees.
fn rpy(declared: &str) -> Option<[f64; 3]> {
    let (document, _) = fusion::config::Document::parse("declared", &format!("angles = {declared}\n"));
    let angles: Vec3Of<dim::Angle> = document.root().get("angles")?.read(&mut Diagnostics::new())?;
    // Rounds the conversion between degrees and radians, to remove 1e-15.
    Some(angles.si().map(|angle| math::round(angle * 180.0 / PI * 1e9) / 1e9))
}

/// All fixed parameters of the kinds to try.
pub(super) fn of_design(design: &Design) -> Vec<Tried<'_>> {
    design.sensors.iter().flat_map(|sensor| of_sensor(sensor, design)).collect()
}

fn of_sensor<'a>(sensor: &'a Named<SensorDesign>, design: &Design) -> Vec<Tried<'a>> {
    let source = sensor.node.get("source").and_then(Node::as_str).unwrap_or_default();
    let source = design.sources.iter().find(|s| s.name == source);
    let delay = source.map_or(0.0, |source| delay(&source.node, sensor));
    let has_source = source.is_some();
    let mut keys = parameters(&sensor.node);
    let is_known = |keys: &[(String, Json)], key: &str| keys.iter().any(|(k, _)| k == key);
    // Without a separate declination, a declination error looks like a bias.
    let is_bias_tried = sensor.node.get("type").and_then(Node::as_str) == Some("heading") && !is_known(&keys, "declination");
    if let Some((_, schema)) = keys.iter().find(|(key, _)| key == BIAS && is_bias_tried).cloned() {
        // The coefficients of the deviation are angles like the bias.
        keys.extend(["deviation.sin", "deviation.cos"].map(|key| (key.to_owned(), schema.clone())));
    }
    let of = |(key, schema): (String, Json)| {
        let sigma = with(&schema, &|schema| schema["properties"].get("sigma").cloned())?;
        let example = with(&sigma, &|schema| schema["examples"][0].as_str().map(str::to_owned).map(Json::from))?;
        let (_, unit) = example.as_str()?.rsplit_once(' ')?;
        let unit = if unit == "km/h" { "m/s" } else { unit };
        let sort = *SORTS.iter().find(|sort| sort.unit == unit)?;
        let sort = match &key[..] {
            "gauge" => GAUGE,
            "scale" => SCALE,
            _ => sort,
        };
        let has_axes = with(&sigma, &|schema| schema.get("minItems").cloned()).is_some();
        let node = sensor.node.at(&key);
        // Some parameters that are already states are also tried from far away: the sign of an arm, quarter turns,
        // units and signs.
        let is_state = node.is_some_and(is_state);
        let is_rotation = has_axes && sort.unit == "deg";
        let is_wide = key == ARM || key == "scale" || key == BIAS && is_bias_tried || is_rotation;
        let constant = match node.map(|node| (node, node.get("initial"))) {
            Some((_, Some(initial))) if is_wide || !is_state => Some(initial),
            Some((_, Some(_))) => return None,
            Some((node, None)) if node.get("shared").is_some() => return None,
            Some((node, None)) => Some(node),
            None => None,
        };
        if is_state && key == ARM && length(constant) < SHORTEST {
            return None;
        }
        let zero = || if has_axes { "[0, 0, 0]" } else { "0" }.to_owned();
        // A slow error of a length or a speed, such as the bias of a range, is not a fixed parameter. The output of a
        // stage has no latency, and an arm only if one is declared. For a barometer, airflow around a pitching vehicle
        // changes the pressure as an arm does.
        let is_in_air = sensor.node.get("type").and_then(Node::as_str) == Some("barometer");
        let is_meant = match sort.unit {
            "m" => key == "gauge" || key == ARM && (has_source && !is_in_air || length(constant) >= SHORTEST),
            "m/s" => key == "current",
            "s" => has_source,
            _ => true,
        };
        is_meant.then(|| Tried {
            sensor,
            declared: constant.map_or_else(zero, Node::inline),
            sigma: if key == ARM {
                2.0 * length(constant).max(sort.sigma / 2.0)
            } else {
                sort.sigma
            },
            is_rotation,
            is_state,
            prior: node.filter(|_| is_state && key == ARM).map_or([0.0; 3], prior),
            delay,
            shared_by: Vec::new(),
            key,
            sort,
        })
    };
    keys.into_iter().filter_map(of).collect()
}

/// The delay that a source declares for the stamps of a sensor's rows: stamp time minus time of validity \[s\].
fn delay(source: &Node, sensor: &Named<SensorDesign>) -> f64 {
    let reading = sensor.block.model.reading();
    let latency = reading
        .channels()
        .first()
        .and_then(|c| source.at(&format!("channels.{}.latency", c.name)));
    let latency: Option<Duration> = latency.and_then(|node| node.read(&mut Diagnostics::new()));
    latency.map_or(0.0, Duration::si) - declared_offset(source)
}

/// Returns true if the parameter is estimated.
fn is_state(node: &Node) -> bool {
    node.get("estimate").is_some_and(|e| e.inline() == "true")
}

/// Initial 1σ of an arm that is a state \[m\].
fn prior(node: &Node) -> [f64; 3] {
    let sigma: Option<Axes<dim::Length>> = node.get("sigma").and_then(|n| n.read(&mut Diagnostics::new()));
    sigma.map_or([0.0; 3], Axes::si)
}

/// The length of a declared arm \[m\].
fn length(arm: Option<&Node>) -> f64 {
    let arm: Option<Vec3Of<dim::Length>> = arm.and_then(|n| n.read(&mut Diagnostics::new()));
    arm.map_or(0.0, |arm| math::sqrt(arm.si().iter().map(|l| l * l).sum::<f64>()))
}

/// The first result of `read` within a schema.
fn with(schema: &Json, read: &dyn Fn(&Json) -> Option<Json>) -> Option<Json> {
    read(schema).or_else(|| match schema {
        Json::Object(fields) => fields.values().find_map(|field| with(field, read)),
        Json::Array(items) => items.iter().find_map(|item| with(item, read)),
        _ => None,
    })
}
