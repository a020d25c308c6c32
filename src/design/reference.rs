//! `[reference]`: what a run is scored against.

use crate::score::trajectory::{Alignment, Pairs};
use core::fmt;
use core::marker::PhantomData;
use fusion_models::fault::Windows;
use fusion_models::units::{Axes, Dimensional, Duration, Positive, Vec3Of, dim, range};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;

/// What a run is scored against; never fused.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSpec {
    /// The source with a `position` channel and, where it has them, `velocity` and `attitude`.
    pub source: String,
    /// Errors and innovations count from this time on.
    #[serde(default)]
    pub from: Option<Duration>,
    /// NEES counts from this time on, where that is later: after the start has settled.
    #[serde(default)]
    pub nees_from: Option<Duration>,
    /// Times that are scored apart from all others: stretches in which more is wrong than the filter is told.
    #[serde(default)]
    pub episodes: Option<Windows>,
    /// The errors that a run stays within once it has converged; it is told which runs have, and how soon.
    #[serde(default, deserialize_with = "ConvergedSpec::with_a_limit")]
    pub converged: Option<ConvergedSpec>,
    /// How the trajectory as a whole is compared: absolute and relative errors (ATE, RPE).
    #[serde(default)]
    pub trajectory: Option<TrajectorySpec>,
    /// The reference's point in body axes, from the body origin: position and velocity of the
    /// estimate are moved there.
    #[serde(default)]
    pub lever_arm: Vec3Of<dim::Length>,
    /// 1σ of the reference's own errors, which NEES and the share inside 3σ add to that of the
    /// filter; exact without it.
    #[serde(default)]
    pub sigma: SigmaSpec,
    /// Takes the mean rotation between the two bodies out of the attitude errors.
    #[serde(default)]
    pub remove_mean_mounting: bool,
    /// Derives a missing reference velocity from its positions.
    #[serde(default)]
    pub velocity_from_position: Option<DifferentiateSpec>,
}

/// How the trajectory as a whole is compared, as the tool evo does.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectorySpec {
    /// What is taken out of the absolute error that is shown: `none`, `yaw` with the position, or `se3`, any turn
    /// and the position. `yaw` by default; summary.json has all three.
    #[serde(default)]
    pub align: Alignment,
    /// Distances along the way over which relative errors are told; by default the two largest powers of ten \[m\]
    /// that the way holds five times.
    #[serde(default)]
    pub distances: Vec<Positive<dim::Length>>,
    /// Pairs of poses that are compared over them: `consecutive`, or `all`, which overlap.
    #[serde(default)]
    pub pairs: Pairs,
}

/// Limits of the errors of a run that has converged, at least one. Every epoch from the start of the filter on
/// counts, and no mounting is taken out.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConvergedSpec {
    /// From this time on the errors must stay within the limits to the end of the run; without it, at the end.
    pub by: Option<Duration>,
    /// Of the length of the position error.
    pub position: Option<Positive<dim::Length>>,
    /// Of the length of the velocity error.
    pub velocity: Option<Positive<dim::Speed>>,
    /// Of the heading error, the turn about the vertical between the two attitudes.
    pub heading: Option<Positive<dim::Angle>>,
}

impl ConvergedSpec {
    fn with_a_limit<'de, T: Deserializer<'de>>(deserializer: T) -> Result<Option<Self>, T::Error> {
        let spec = Self::deserialize(deserializer)?;
        if spec.position.is_none() && spec.velocity.is_none() && spec.heading.is_none() {
            return Err(T::Error::custom("needs a limit: `position`, `velocity` or `heading`"));
        }
        Ok(Some(spec))
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
    fn converged_without_a_limit_would_be_every_run() {
        let read = |converged: &str| toml::from_str::<ReferenceSpec>(&format!("source = 'truth'\n{converged}"));
        let limits = read("converged = { by = '10 s', position = '5 m' }").unwrap().converged.unwrap();
        assert_eq!((limits.by.unwrap().si(), limits.position.unwrap().si()), (10.0, 5.0));
        assert!(read("converged = { by = '10 s' }").unwrap_err().message().contains("needs a limit"));
        assert!(read("converged = { heading = '5 m' }").is_err() && read("").unwrap().converged.is_none());
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
