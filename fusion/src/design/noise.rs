//! `noise` of a sensor: declared, reported by its source, or both.
//!
//! Most noises are one number: `noise = "5 cm/s"` is `noise = { sigma = "5 cm/s" }`, and so is an
//! array with one per row.

use std::borrow::Cow;
use std::fmt;

use fusion_models::units::{PerAxis, Positive, dim};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};

/// The noise of a sensor: as written, its 1σ, or a table.
#[derive(Clone, Debug, Default)]
pub struct NoiseSpec {
    /// 1σ, one for all rows or one per row.
    pub sigma: Option<PerAxis>,
    /// Adds the 1σ that the source reports, its channel `<channel>_sigma`, in quadrature.
    pub from_source: bool,
    /// Factor on the reported 1σ.
    pub scale: Option<Positive<dim::Ratio>>,
}

/// The table.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoiseTable {
    /// 1σ, one for all rows or one per row.
    sigma: Option<PerAxis>,
    /// Adds the 1σ that the source reports, its channel `<channel>_sigma`, in quadrature.
    #[serde(default)]
    from_source: bool,
    /// Factor on the reported 1σ.
    scale: Option<Positive<dim::Ratio>>,
}

impl From<PerAxis> for NoiseSpec {
    fn from(sigma: PerAxis) -> Self {
        Self {
            sigma: Some(sigma),
            ..Self::default()
        }
    }
}

struct NoiseVisitor;

impl<'de> Visitor<'de> for NoiseVisitor {
    type Value = NoiseSpec;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a standard deviation such as \"5 cm\", an array of one per axis, `{ sigma = … }` or `{ from_source = true }`")
    }

    fn visit_f64<E: Error>(self, si: f64) -> Result<NoiseSpec, E> {
        PerAxis::deserialize(si.into_deserializer()).map(Into::into)
    }

    fn visit_i64<E: Error>(self, si: i64) -> Result<NoiseSpec, E> {
        PerAxis::deserialize(si.into_deserializer()).map(Into::into)
    }

    fn visit_u64<E: Error>(self, si: u64) -> Result<NoiseSpec, E> {
        PerAxis::deserialize(si.into_deserializer()).map(Into::into)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<NoiseSpec, E> {
        PerAxis::deserialize(text.into_deserializer()).map(Into::into)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<NoiseSpec, A::Error> {
        PerAxis::deserialize(SeqAccessDeserializer::new(seq)).map(Into::into)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<NoiseSpec, A::Error> {
        let table = NoiseTable::deserialize(MapAccessDeserializer::new(map))?;
        let NoiseTable { sigma, from_source, scale } = table;
        Ok(NoiseSpec { sigma, from_source, scale })
    }
}

impl<'de> Deserialize<'de> for NoiseSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NoiseVisitor)
    }
}

impl JsonSchema for NoiseSpec {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Noise".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let sigma = generator.subschema_for::<PerAxis>();
        let table = generator.subschema_for::<NoiseTable>();
        json_schema!({ "description": "The noise of a sensor: its 1σ, one for all rows or an array of one per row; or a table such as `{ sigma = \"5 cm\" }`.", "anyOf": [sigma, table] })
    }
}
