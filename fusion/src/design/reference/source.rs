//! The sources of a reference, and the channels of each that count.

use super::sigma::SigmaSpec;
use core::fmt;
use fusion_models::units::{Positive, Quantity, Vec3Of, dim};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use std::borrow::Cow;

/// The quantities that a run can be scored against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceChannel {
    /// Latitude, longitude and height.
    Position,
    /// Latitude and longitude: the height is not judged.
    HorizontalPosition,
    /// Height above the ellipsoid.
    Height,
    /// Depth below the water's surface, down positive.
    Depth,
    /// Velocity, north east down.
    Velocity,
    /// Attitude.
    Attitude,
}

impl ReferenceChannel {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Position,
        Self::HorizontalPosition,
        Self::Height,
        Self::Depth,
        Self::Velocity,
        Self::Attitude,
    ];

    /// As in a design.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::HorizontalPosition => "horizontal_position",
            Self::Height => "height",
            Self::Depth => "depth",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
        }
    }
}

/// The channels of a source that count, and their lever arm and accuracy.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferencePart {
    /// Which of its channels count; all without it.
    pub channels: Option<Vec<ReferenceChannel>>,
    /// The reference's point in body axes, from the body origin: position and velocity of the estimate are moved
    /// there.
    #[serde(default)]
    pub lever_arm: Vec3Of<dim::Length>,
    /// Height of the water's surface above the ellipsoid, if it has a `depth`; 0 by default.
    pub surface: Option<Quantity<dim::Length>>,
    /// 1σ of the reference's own errors, which NEES and the share inside 3σ add to that of the filter; exact
    /// without it.
    #[serde(default)]
    pub sigma: SigmaSpec,
    /// Derives a missing reference velocity from its positions.
    pub velocity_from_position: Option<DifferentiateSpec>,
}

impl ReferencePart {
    /// Whether its positions may count.
    pub(super) fn may_have_position(&self) -> bool {
        let is_place = |c: &ReferenceChannel| matches!(c, ReferenceChannel::Position | ReferenceChannel::HorizontalPosition);
        self.channels.as_ref().is_none_or(|all| all.iter().any(is_place))
    }
}

/// The slope of a cubic fitted to neighbouring positions.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DifferentiateSpec {
    /// Epochs on either side of each.
    pub half_window: u32,
    /// Epochs whose neighbours span more get no velocity.
    pub max_span: Positive<dim::Duration>,
}

/// One source, or several, each with its table.
#[derive(Clone, Debug)]
pub enum ReferenceSources {
    /// Its name; its other fields are next to it in the same table.
    One(String),
    /// Each by its name.
    Each(Vec<(String, ReferencePart)>),
}

impl ReferenceSources {
    /// Whether it is one source, named by a string.
    #[must_use]
    pub const fn is_one(&self) -> bool {
        matches!(self, Self::One(_))
    }

    /// Their names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let (one, each) = match self {
            Self::One(name) => (Some(name), &[][..]),
            Self::Each(parts) => (None, &parts[..]),
        };
        one.into_iter().chain(each.iter().map(|(name, _)| name)).map(String::as_str)
    }

    /// Whether a source of this name is among them.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.names().any(|own| own == name)
    }
}

impl fmt::Display for ReferenceSources {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let quoted: Vec<String> = self.names().map(|name| format!("`{name}`")).collect();
        f.write_str(&quoted.join(", "))
    }
}

struct SourcesVisitor;

impl<'de> Deserialize<'de> for ReferenceSources {
    fn deserialize<T: Deserializer<'de>>(deserializer: T) -> Result<Self, T::Error> {
        deserializer.deserialize_any(SourcesVisitor)
    }
}

impl<'de> Visitor<'de> for SourcesVisitor {
    type Value = ReferenceSources;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a source, or a table for each, [reference.source.NAME]")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
        Ok(ReferenceSources::One(name.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut parts = Vec::new();
        while let Some(entry) = map.next_entry()? {
            parts.push(entry);
        }
        if parts.is_empty() {
            return Err(A::Error::custom("no source is named here: write [reference.source.NAME]"));
        }
        Ok(ReferenceSources::Each(parts))
    }
}

impl JsonSchema for ReferenceSources {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "ReferenceSources".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let part = generator.subschema_for::<ReferencePart>();
        json_schema!({ "anyOf": [{ "type": "string" }, { "type": "object", "additionalProperties": part, "minProperties": 1 }] })
    }
}

#[cfg(test)]
mod tests {
    use super::super::ReferenceSpec;

    fn read(text: &str) -> Result<ReferenceSpec, String> {
        toml::from_str(text).map_err(|e: toml::de::Error| e.message().to_owned())
    }

    #[test]
    fn a_source_is_named_or_each_of_several_has_its_table() {
        let one = read("source = 'truth'\nlever_arm = [1, 2, 3]").unwrap();
        assert_eq!((one.sources()[0].0, one.point()), ("truth", [1.0, 2.0, 3.0]));
        let two = "[source.mocap]\nchannels = ['attitude']\nlever_arm = [9, 9, 9]\n[source.rtk]\nlever_arm = ['1 m', 0, 0]";
        let two = read(two).unwrap();
        // The point is that of the position.
        assert_eq!((two.source.to_string().as_str(), two.point()), ("`mocap`, `rtk`", [1.0, 0.0, 0.0]));
        assert!(read("[source]").unwrap_err().contains("no source is named"));
        assert!(read("source = { rtk = { channels = ['heading'] } }").is_err());
        assert!(read("source = 7").unwrap_err().contains("the name of a source"));
    }
}
