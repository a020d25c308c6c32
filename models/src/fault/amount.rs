//! One quantity, or one per axis, whose dimension the channel decides.

use crate::block::BuildError;
use crate::units::{AnyQuantity, Dimension};
use core::fmt;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};
use std::borrow::Cow;

/// A quantity for every axis, or an array with one per axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Amounts(Vec<AnyQuantity>);

impl Amounts {
    /// Values in SI for `width` axes; one quantity holds for all of them.
    ///
    /// # Errors
    /// Where one has another dimension, or there is a wrong number of them; `field` is to blame.
    pub fn expect(&self, field: &str, width: usize, dimension: Dimension) -> Result<Vec<f64>, BuildError> {
        let values = self.0.iter().map(|q| q.expect(dimension));
        let values: Vec<f64> = values.collect::<Result<_, _>>().map_err(|e| BuildError::at(field, e.to_string()))?;
        match values[..] {
            [one] => Ok(vec![one; width]),
            _ if values.len() == width => Ok(values),
            _ => Err(BuildError::at(field, wrong_number(values.len(), width))),
        }
    }

    /// How many are written.
    #[must_use]
    pub fn written(&self) -> usize {
        self.0.len()
    }
}

/// What is said of a wrong number of them.
pub(super) fn wrong_number(given: usize, wanted: usize) -> String {
    format!("one quantity per axis is wanted: {wanted}, not {given}")
}

impl<'de> Deserialize<'de> for Amounts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;

        impl<'de> Visitor<'de> for OneOrMany {
            type Value = Amounts;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number in SI, text with a unit, or an array of them")
            }

            fn visit_f64<E: Error>(self, v: f64) -> Result<Amounts, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| Amounts(vec![q]))
            }

            fn visit_i64<E: Error>(self, v: i64) -> Result<Amounts, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| Amounts(vec![q]))
            }

            fn visit_str<E: Error>(self, v: &str) -> Result<Amounts, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| Amounts(vec![q]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Amounts, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Amounts)
            }
        }

        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Amounts {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Amounts".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<AnyQuantity>();
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}
