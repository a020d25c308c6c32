//! 1σ of a reference's own errors: declared, or reported by its source.

use core::fmt;
use core::marker::PhantomData;
use fusion_models::units::{Axes, Dimensional, Positive, dim, range};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;

/// 1σ of a reference's own errors.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SigmaSpec {
    /// Of its position, north east down.
    position: Option<OwnSigma<dim::Length>>,
    /// Of its velocity, north east down.
    velocity: Option<OwnSigma<dim::Speed>>,
    /// Of its attitude, about the axes of its body.
    attitude: Option<OwnSigma<dim::Angle>>,
}

/// Where the 1σ of one of them comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SigmaOf {
    /// Per axis, SI.
    Declared([f64; 3]),
    /// The channel `<channel>_sigma` of the source, times `scale`.
    Source {
        /// Factor on what is reported.
        scale: f64,
    },
}

impl SigmaSpec {
    /// Of position, velocity, attitude.
    #[must_use]
    pub fn each(&self) -> [Option<SigmaOf>; 3] {
        [
            self.position.as_ref().map(|s| s.0),
            self.velocity.as_ref().map(|s| s.0),
            self.attitude.as_ref().map(|s| s.0),
        ]
    }
}

/// One 1σ, or one per axis, or `{ from_source = true }`.
#[derive(Clone, Debug)]
struct OwnSigma<D>(SigmaOf, PhantomData<D>);

/// The table form.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Reported {
    /// Takes the 1σ that the source reports, its channel `<channel>_sigma`; `true`.
    from_source: bool,
    /// Factor on the reported 1σ.
    scale: Option<Positive<dim::Ratio>>,
}

impl<'de, D: Dimensional> Deserialize<'de> for OwnSigma<D> {
    fn deserialize<T: Deserializer<'de>>(deserializer: T) -> Result<Self, T::Error> {
        deserializer.deserialize_any(SigmaVisitor(PhantomData))
    }
}

struct SigmaVisitor<D>(PhantomData<D>);

impl<D: Dimensional> SigmaVisitor<D> {
    fn declared<'de, T: Deserializer<'de>>(deserializer: T) -> Result<OwnSigma<D>, T::Error> {
        let axes = Axes::<D, range::NonNegative>::deserialize(deserializer)?;
        Ok(OwnSigma(SigmaOf::Declared(axes.si()), PhantomData))
    }
}

impl<'de, D: Dimensional> Visitor<'de> for SigmaVisitor<D> {
    type Value = OwnSigma<D>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, three of them, or {{ from_source = true }}", D::KIND)
    }

    fn visit_f64<E: Error>(self, v: f64) -> Result<Self::Value, E> {
        Self::declared(v.into_deserializer())
    }

    fn visit_i64<E: Error>(self, v: i64) -> Result<Self::Value, E> {
        Self::declared(v.into_deserializer())
    }

    fn visit_u64<E: Error>(self, v: u64) -> Result<Self::Value, E> {
        Self::declared(v.into_deserializer())
    }

    fn visit_str<E: Error>(self, v: &str) -> Result<Self::Value, E> {
        Self::declared(v.into_deserializer())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        Self::declared(SeqAccessDeserializer::new(seq))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let reported = Reported::deserialize(MapAccessDeserializer::new(map))?;
        if !reported.from_source {
            return Err(A::Error::custom("`from_source` is `true` or left out; write the 1σ instead"));
        }
        let scale = reported.scale.map_or(1.0, |s| s.si());
        Ok(OwnSigma(SigmaOf::Source { scale }, PhantomData))
    }
}

impl<D: Dimensional> JsonSchema for OwnSigma<D> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("OwnSigmaOf{}", D::KIND.symbol).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let declared = generator.subschema_for::<Axes<D, range::NonNegative>>();
        let reported = Reported::json_schema(generator);
        json_schema!({ "anyOf": [declared, reported] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sigma(text: &str) -> Result<[Option<SigmaOf>; 3], String> {
        let read = toml::from_str::<SigmaSpec>(text);
        read.map(|s| s.each()).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn a_reference_declares_its_own_sigma_or_takes_it_from_its_source() {
        let text = "position = '2 cm'\nvelocity = { from_source = true, scale = 2 }\nattitude = ['1 deg', 0, 0]";
        let degree = 1_f64.to_radians();
        let expected = [
            SigmaOf::Declared([0.02; 3]),
            SigmaOf::Source { scale: 2.0 },
            SigmaOf::Declared([degree, 0.0, 0.0]),
        ];
        assert_eq!(sigma(text), Ok(expected.map(Some)));
        assert_eq!(sigma(""), Ok([None; 3]));
    }

    #[test]
    fn a_sigma_of_another_dimension_or_sign_is_refused() {
        for wrong in [
            "position = '2 deg'",
            "velocity = -1",
            "velocity = { from_source = false }",
            "heading = 1",
        ] {
            assert!(sigma(wrong).is_err(), "{wrong}");
        }
    }
}
