//! `only_with`: a sensor that is used only with another, its leader.

use super::{Named, SensorDesign};
use crate::config::{Diagnostic, Diagnostics, Node};
use fusion_core::gate::Recovery;
use fusion_models::units::{Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use std::fmt;
use std::iter::successors;

/// The leader of a sensor: a measurement is rejected if the leader's latest one was not used. The
/// leader's name alone, or a table.
#[derive(Clone, Debug)]
pub struct OnlyWithSpec {
    /// The sensor.
    pub sensor: String,
    /// How long the outcome of its measurement counts.
    pub memory: Positive<dim::Duration>,
}

/// As long as the pause after which a gate re-acquires its own sensor.
fn memory() -> Positive<dim::Duration> {
    Positive::try_from_si(Recovery::default().gap).unwrap_or_else(|_| unreachable!("the default pause is positive"))
}

/// The table.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Table {
    /// The leader.
    sensor: String,
    /// How long the outcome of that sensor's measurement counts; by default 10 s, as the pause
    /// after which gates re-acquire.
    #[serde(default = "memory")]
    memory: Positive<dim::Duration>,
}

impl<'de> Deserialize<'de> for OnlyWithSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable;
        impl<'de> Visitor<'de> for NameOrTable {
            type Value = OnlyWithSpec;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a sensor, a table `{ sensor = \"NAME\", memory = \"10 s\" }`, or `false` for none")
            }
            fn visit_str<E>(self, sensor: &str) -> Result<Self::Value, E> {
                let (sensor, memory) = (sensor.to_owned(), memory());
                Ok(OnlyWithSpec { sensor, memory })
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let Table { sensor, memory } = Table::deserialize(MapAccessDeserializer::new(map))?;
                Ok(OnlyWithSpec { sensor, memory })
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}

impl JsonSchema for OnlyWithSpec {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "OnlyWith".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let table = generator.subschema_for::<Table>();
        schemars::json_schema!({
            "description": "The leader of this sensor: a measurement is rejected if the leader's latest one was not used. Without effect if the leader is disabled. `false` takes away one that is inherited.",
            "anyOf": [{ "type": "string" }, { "type": "boolean", "const": false }, table]
        })
    }
}

fn leader(sensor: &Named<SensorDesign>) -> Option<&str> {
    sensor.block.common.only_with.as_ref().map(|o| o.sensor.as_str())
}

/// Checks that a leader is a sensor of the design, enabled or not, and that `only_with` is not
/// cyclic.
pub(super) fn check(root: &Node, sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    check_names(root, sensors, d);
    check_cycles(sensors, d);
}

fn check_names(root: &Node, sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    let declared = root.get("sensor").map_or(&[][..], Node::entries);
    let names: Vec<&str> = declared.iter().map(|s| s.key.as_str()).collect();
    for sensor in sensors {
        let Some(name) = leader(sensor).filter(|name| !names.contains(name)) else {
            continue;
        };
        let place = sensor.node.place_of("only_with");
        let unknown = Diagnostic::error(format!("no sensor is called `{name}`")).at(place);
        d.push(
            unknown
                .suggest(name, &names, "there are")
                .and_help("`only_with = false` removes it"),
        );
    }
}

/// Refuses a cyclic `only_with`.
fn check_cycles(sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    let next = |&at: &usize| leader(&sensors[at]).and_then(|name| sensors.iter().position(|s| s.name == name));
    for start in 0..sensors.len() {
        let onwards = successors(next(&start), |at| if *at == start { None } else { next(at) });
        let path: Vec<usize> = onwards.take(sensors.len()).collect();
        // Each cycle is reported once, where it is entered first in the file.
        if path.last() != Some(&start) || path.iter().any(|at| *at < start) {
            continue;
        }
        let names: Vec<String> = [start].iter().chain(&path).map(|&at| format!("`{}`", sensors[at].name)).collect();
        let place = sensors[start].node.place_of("only_with");
        let help = "a sensor is judged after the one that its `only_with` names: remove one of them";
        let message = format!("cyclic `only_with`: {}", names.join(", "));
        d.push(Diagnostic::error(message).at(place).help(help));
    }
}
