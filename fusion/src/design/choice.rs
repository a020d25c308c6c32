//! A value of `[filter]` by its name: one of the framework, or one that another crate registers.

use core::fmt;
use core::marker::PhantomData;
use fusion_core::chart::Chart;
use fusion_core::covariance::Form;
use fusion_core::custom::Custom;
use fusion_core::filter::UpdateRule;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, VariantAccess, Visitor};
use std::borrow::Cow;
use std::sync::LazyLock;

/// Charts.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum ChartSpec {
    /// Additive error of roll, pitch, yaw.
    AdditiveEuler,
    /// Additive error of the quaternion's components, normalised.
    AdditiveQuaternion,
    /// Attitude error in body axes.
    Body,
    /// Attitude error in navigation axes.
    Navigation,
    /// Attitude (or heading), velocity and position as one element of SE₂(3) (or SE(2)), the error on
    /// its left: χ = Exp(ξ) χ̂.
    RightInvariant,
    /// The same, the error on its right: χ = χ̂ Exp(ξ).
    LeftInvariant,
}

/// Updates.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum UpdateSpec {
    /// Linearised once, at the prediction.
    Single,
    /// Linearised again where the correction leads: Gauss-Newton with step control.
    Iterated,
    /// Sigma points, for the prediction too.
    Unscented,
    /// The measurement replaces the state, without a covariance: the latest value of each instrument.
    Outright,
}

/// Covariance forms.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum FormSpec {
    /// (I − KH)P(I − KH)ᵀ + KRKᵀ.
    Joseph,
    /// (I − KH)P.
    Standard,
    /// U D Uᵀ by Bierman and Thornton: positive for every ratio of the noises.
    Udu,
    /// S Sᵀ by orthogonal transformations: positive for every ratio of the noises.
    SquareRoot,
}

/// A part of the backend that another crate brings: in a design that is read where the crate is linked, `[filter]`
/// takes its name.
///
/// ```
/// use fusion::core::{chart::Body, custom::Custom};
/// use fusion::design::BackendPart;
/// use std::sync::Arc;
///
/// fusion::inventory::submit! {
///     BackendPart::Chart(Custom { name: "mine", about: "The body chart, by another name.", make: || Arc::new(Body) })
/// }
///
/// assert_eq!(fusion::design::FilterSpec::table_of("mine").unwrap(), "filter={ chart = \"mine\" }");
/// ```
#[derive(Debug)]
pub enum BackendPart {
    /// For `filter.chart`.
    Chart(Custom<dyn Chart>),
    /// For `filter.update`.
    Update(Custom<dyn UpdateRule>),
    /// For `filter.form`.
    Form(Custom<dyn Form>),
}

crate::inventory::collect!(BackendPart);

/// A kind of part, with the framework's own values beside which it is named.
pub trait Part: 'static {
    /// The framework's own values.
    type BuiltIn: Copy + fmt::Debug + DeserializeOwned + JsonSchema;

    /// The part, if it is of this kind.
    fn of(part: &'static BackendPart) -> Option<&'static Custom<Self>>;

    /// Every word, in the order of the schema.
    fn words() -> &'static [&'static str];
}

macro_rules! part {
    ($kind:ident, $part:ty, $built_in:ty) => {
        impl Part for $part {
            type BuiltIn = $built_in;

            fn of(part: &'static BackendPart) -> Option<&'static Custom<Self>> {
                match part {
                    BackendPart::$kind(custom) => Some(custom),
                    _ => None,
                }
            }

            fn words() -> &'static [&'static str] {
                // Made once; serde wants words that live as long as the program in its errors.
                static WORDS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
                    let words = words(&schemars::schema_for!(Choice<$part>));
                    words.into_iter().map(|word| &*word.leak()).collect()
                });
                &WORDS
            }
        }
    };
}
part!(Chart, dyn Chart, ChartSpec);
part!(Update, dyn UpdateRule, UpdateSpec);
part!(Form, dyn Form, FormSpec);

/// Those that other crates register, by name.
fn registered<T: Part + ?Sized>() -> Vec<&'static Custom<T>> {
    let mut all: Vec<_> = crate::inventory::iter::<BackendPart>.into_iter().filter_map(T::of).collect();
    all.sort_by_key(|custom| custom.name);
    all
}

/// A name of a part that another one has too, among those of other crates or of the framework; neither could be chosen.
pub(super) fn duplicate() -> Option<&'static str> {
    fn of<T: Part + ?Sized>() -> Option<&'static str> {
        let words = T::words();
        words
            .iter()
            .copied()
            .find(|word| words.iter().filter(|other| *other == word).count() > 1)
    }
    of::<dyn Chart>().or_else(of::<dyn UpdateRule>).or_else(of::<dyn Form>)
}

/// Every word of the schema of an enumeration.
pub(super) fn words(schema: &Schema) -> Vec<String> {
    let variants = schema.get("oneOf").and_then(|v| v.as_array()).into_iter().flatten();
    variants.filter_map(|v| v.get("const")?.as_str()).map(str::to_owned).collect()
}

/// One of the framework's own values, or a part `T` of another crate. Both are written as a word.
#[derive(Debug)]
pub enum Choice<T: Part + ?Sized> {
    /// One of the framework.
    BuiltIn(T::BuiltIn),
    /// One of another crate.
    Custom(&'static Custom<T>),
}

// Written out, because a derive would ask `T` for the same traits.
impl<T: Part + ?Sized> Clone for Choice<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: Part + ?Sized> Copy for Choice<T> {}

impl<T: Part + ?Sized> Choice<T> {
    /// The value of that name. The framework's own come first: no crate replaces them.
    fn named(word: &str) -> Option<Self> {
        let text: StrDeserializer<'_, serde::de::value::Error> = word.into_deserializer();
        let custom = || registered::<T>().into_iter().find(|custom| custom.name == word);
        let built_in = T::BuiltIn::deserialize(text).map(Self::BuiltIn).ok();
        built_in.or_else(|| custom().map(Self::Custom))
    }
}

impl<'de, T: Part + ?Sized> Deserialize<'de> for Choice<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_enum("", T::words(), Pick(PhantomData))
    }
}

/// Reads the word of a [`Choice`].
struct Pick<T: ?Sized>(PhantomData<T>);

impl<'de, T: Part + ?Sized> Visitor<'de> for Pick<T> {
    type Value = Choice<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name")
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<Self::Value, E> {
        Choice::named(word).ok_or_else(|| E::unknown_variant(word, T::words()))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<Self::Value, A::Error> {
        let (choice, rest) = data.variant_seed(self)?;
        rest.unit_variant()?;
        Ok(choice)
    }
}

impl<'de, T: Part + ?Sized> DeserializeSeed<'de> for Pick<T> {
    type Value = Choice<T>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

/// The schema of the framework's own values, with those of the linked crates.
impl<T: Part + ?Sized> JsonSchema for Choice<T> {
    fn schema_name() -> Cow<'static, str> {
        T::BuiltIn::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = T::BuiltIn::json_schema(generator);
        if let Some(all) = schema.get_mut("oneOf").and_then(|v| v.as_array_mut()) {
            for custom in registered::<T>() {
                all.push(json_schema!({ "description": custom.about, "type": "string", "const": custom.name }).into());
            }
        }
        schema
    }
}
