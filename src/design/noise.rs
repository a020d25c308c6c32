//! `noise` of a sensor: declared, reported by its source, or both.

use fusion_models::units::{AnyQuantity, Dimension, Positive, UnitError, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};

/// The noise of a sensor.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpec {
    /// 1σ, one for all rows or one per row.
    pub sigma: Option<PerRow>,
    /// Adds the 1σ that the source reports, its channel `<channel>_sigma`, in quadrature.
    #[serde(default)]
    pub from_source: bool,
    /// Factor on the reported 1σ.
    pub scale: Option<Positive<dim::Ratio>>,
}

/// One quantity for all rows, or one per row.
#[derive(Clone, Debug)]
pub struct PerRow(Vec<AnyQuantity>);

impl PerRow {
    /// The SI values for rows of these dimensions.
    ///
    /// # Errors
    /// A wrong count or dimension, with the index of the culprit.
    pub fn resolve(&self, rows: &[Dimension]) -> Result<Vec<f64>, String> {
        if self.0.len() != 1 && self.0.len() != rows.len() {
            return Err(format!("one value or {} are wanted here, one per row of the residual", rows.len()));
        }
        let at = |i: usize| if self.0.len() == 1 { &self.0[0] } else { &self.0[i] };
        let values: Result<Vec<f64>, UnitError> = rows.iter().enumerate().map(|(i, d)| at(i).expect(*d)).collect();
        let values = values.map_err(|e| e.to_string())?;
        if let Some(negative) = values.iter().find(|v| **v < 0.0) {
            return Err(format!("{negative} is negative; a standard deviation of at least 0 is wanted here"));
        }
        Ok(values)
    }
}

impl<'de> Deserialize<'de> for PerRow {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Rows;
        impl<'de> Visitor<'de> for Rows {
            type Value = PerRow;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a quantity such as \"1.5 m\", or an array of them")
            }
            fn visit_f64<E: Error>(self, v: f64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_i64<E: Error>(self, v: i64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_u64<E: Error>(self, v: u64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_str<E: Error>(self, v: &str) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<PerRow, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(PerRow)
            }
        }
        deserializer.deserialize_any(Rows)
    }
}

impl JsonSchema for PerRow {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PerRow".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let one = generator.subschema_for::<AnyQuantity>();
        schemars::json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}
