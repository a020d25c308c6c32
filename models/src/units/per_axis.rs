//! One quantity, or one per axis.
//!
//! [`Axes`] if the type fixes number and dimension of the axes, [`PerAxis`] if the block around it decides them,
//! [`Vec3Of`] if one number cannot represent all axes.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};

use super::any::AnyQuantity;
use super::dimension::Dimension;
use super::error::UnitError;
use super::quantity::{Dimensional, Quantity, Range, range};

/// The written form: one quantity for every axis, or an array with one per axis.
#[derive(Clone, Debug, PartialEq)]
pub enum PerAxis<Q = AnyQuantity> {
    /// One quantity for all axes.
    Same(Q),
    /// One quantity for each axis.
    Each(Vec<Q>),
}

impl<Q> PerAxis<Q> {
    /// The number of written quantities.
    #[must_use]
    pub fn written(&self) -> usize {
        match self {
            Self::Same(_) => 1,
            Self::Each(each) => each.len(),
        }
    }
}

impl PerAxis {
    /// The SI values for axes of these dimensions, each within the range `R`.
    ///
    /// # Errors
    /// A wrong number of quantities, text that is not a quantity, another dimension, or a value out of range.
    pub fn si<R: Range>(&self, axes: &[Dimension]) -> Result<Vec<f64>, UnitError> {
        match self {
            Self::Same(one) => axes.iter().map(|dimension| one.within::<R>(*dimension)).collect(),
            Self::Each(each) if each.len() == axes.len() => elements::<R>(each, axes),
            Self::Each(each) => Err(UnitError::count(each.len(), axes, true)),
        }
    }

    /// The same for a quantity with a direction: a single quantity is then valid for one axis only.
    ///
    /// # Errors
    /// As [`si`](Self::si).
    pub fn directed<R: Range>(&self, axes: &[Dimension]) -> Result<Vec<f64>, UnitError> {
        match self.written() {
            given if given == axes.len() => self.si::<R>(axes),
            given => Err(UnitError::count(given, axes, false)),
        }
    }
}

fn elements<R: Range>(each: &[AnyQuantity], axes: &[Dimension]) -> Result<Vec<f64>, UnitError> {
    let one = |(index, (q, d)): (usize, (&AnyQuantity, &Dimension))| {
        q.within::<R>(*d).map_err(|why| UnitError::Element { index, why: Box::new(why) })
    };
    each.iter().zip(axes).enumerate().map(one).collect()
}

/// Reads a [`PerAxis`]; `array` describes the expected array.
struct PerAxisVisitor<Q> {
    array: fn(&mut fmt::Formatter<'_>) -> fmt::Result,
    quantity: PhantomData<Q>,
}

impl<'de, Q: Deserialize<'de>> Visitor<'de> for PerAxisVisitor<Q> {
    type Value = PerAxis<Q>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.array)(f)
    }

    fn visit_f64<E: Error>(self, si: f64) -> Result<Self::Value, E> {
        Q::deserialize(si.into_deserializer()).map(PerAxis::Same)
    }

    fn visit_i64<E: Error>(self, si: i64) -> Result<Self::Value, E> {
        Q::deserialize(si.into_deserializer()).map(PerAxis::Same)
    }

    fn visit_u64<E: Error>(self, si: u64) -> Result<Self::Value, E> {
        Q::deserialize(si.into_deserializer()).map(PerAxis::Same)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        Q::deserialize(text.into_deserializer()).map(PerAxis::Same)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(seq)).map(PerAxis::Each)
    }
}

impl<'de> Deserialize<'de> for PerAxis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PerAxisVisitor {
            array: |f| f.write_str("a number in SI, text with a unit, e.g. \"0.5 m\", or an array of them, one per axis"),
            quantity: PhantomData,
        })
    }
}

impl JsonSchema for PerAxis {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "PerAxis".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<AnyQuantity>();
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

/// `N` quantities: an array of exactly `N`, or one quantity for every axis.
pub struct Axes<D, R = range::Finite, const N: usize = 3>([Quantity<D, R>; N]);

/// Three quantities, all of them written: a lever arm has no scalar form.
pub struct Vec3Of<D, R = range::Finite>([Quantity<D, R>; 3]);

/// The common part of both types and a plain array.
macro_rules! array_traits {
    ($Array:ident, $N:tt $(, $size:ident)?) => {
        impl<D, R $(, const $size: usize)?> $Array<D, R $(, $size)?> {
            /// The values in SI units.
            #[must_use]
            pub fn si(self) -> [f64; $N] {
                self.0.map(Quantity::si)
            }
        }

        impl<D, R $(, const $size: usize)?> From<[Quantity<D, R>; $N]> for $Array<D, R $(, $size)?> {
            fn from(axes: [Quantity<D, R>; $N]) -> Self {
                Self(axes)
            }
        }

        impl<D, R $(, const $size: usize)?> Clone for $Array<D, R $(, $size)?> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<D, R $(, const $size: usize)?> Copy for $Array<D, R $(, $size)?> {}

        impl<D, R $(, const $size: usize)?> PartialEq for $Array<D, R $(, $size)?> {
            fn eq(&self, other: &Self) -> bool {
                self.0 == other.0
            }
        }

        impl<D: Dimensional, R $(, const $size: usize)?> fmt::Debug for $Array<D, R $(, $size)?> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Debug::fmt(&self.0, f)
            }
        }

        impl<D, R $(, const $size: usize)?> Default for $Array<D, R $(, $size)?>
        where
            Quantity<D, R>: Default,
        {
            fn default() -> Self {
                Self([Quantity::default(); $N])
            }
        }

        impl<D, R $(, const $size: usize)?> Serialize for $Array<D, R $(, $size)?> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_seq(&self.0)
            }
        }
    };
}
array_traits!(Axes, N, N);
array_traits!(Vec3Of, 3);

impl<'de, D: Dimensional, R: Range, const N: usize> Deserialize<'de> for Axes<D, R, N> {
    fn deserialize<A: Deserializer<'de>>(deserializer: A) -> Result<Self, A::Error> {
        let written = deserializer.deserialize_any(PerAxisVisitor {
            array: |f| write!(f, "{}, e.g. {:?}, or an array of {N}", D::KIND, D::KIND.example),
            quantity: PhantomData,
        })?;
        match written {
            PerAxis::Same(one) => Ok(Self([one; N])),
            PerAxis::Each(each) => exactly(each).map(Self),
        }
    }
}

impl<'de, D: Dimensional, R: Range> Deserialize<'de> for Vec3Of<D, R> {
    fn deserialize<A: Deserializer<'de>>(deserializer: A) -> Result<Self, A::Error> {
        deserializer.deserialize_any(ArrayVisitor(PhantomData)).map(Self)
    }
}

/// Converts the written quantities to an array of `N`.
fn exactly<D: Dimensional, R: Range, E: Error, const N: usize>(each: Vec<Quantity<D, R>>) -> Result<[Quantity<D, R>; N], E> {
    let length = each.len();
    each.try_into()
        .map_err(|_| E::invalid_length(length, &ArrayVisitor::<D, R, N>(PhantomData)))
}

/// Reads an array of exactly `N`.
struct ArrayVisitor<D, R, const N: usize>(PhantomData<(D, R)>);

impl<'de, D: Dimensional, R: Range, const N: usize> Visitor<'de> for ArrayVisitor<D, R, N> {
    type Value = [Quantity<D, R>; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an array of {N}, each {}, e.g. {:?}", D::KIND, [D::KIND.example; N])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(seq)).and_then(exactly)
    }
}

impl<D: Dimensional, R: Range, const N: usize> JsonSchema for Axes<D, R, N> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Axes{N}Of{}", Quantity::<D, R>::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<Quantity<D, R>>();
        json_schema!({ "anyOf": [one, array_schema(&one, N)] })
    }
}

impl<D: Dimensional, R: Range> JsonSchema for Vec3Of<D, R> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Vec3Of{}", Quantity::<D, R>::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        array_schema(&generator.subschema_for::<Quantity<D, R>>(), 3)
    }
}

fn array_schema(one: &Schema, length: usize) -> Schema {
    json_schema!({ "type": "array", "items": one, "minItems": length, "maxItems": length })
}

#[cfg(test)]
mod tests {
    use super::super::{Positive, dim};
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    struct One<T> {
        x: T,
    }

    fn read<T: for<'de> Deserialize<'de>>(value: &str) -> Result<T, String> {
        let read = toml::from_str::<One<T>>(&format!("x = {value}"));
        read.map(|one| one.x).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn a_scalar_holds_for_every_axis() {
        assert_eq!(read::<Axes<dim::Length>>("'5 cm'").unwrap().si(), [0.05; 3]);
        assert_eq!(read::<Axes<dim::Length, range::Finite, 2>>("1").unwrap().si(), [1.0; 2]);
    }

    #[test]
    fn an_array_gives_each_axis_its_own_unit() {
        let arm = "['5 cm', 0, -1.5]";
        assert_eq!(read::<Axes<dim::Length>>(arm).unwrap().si(), [0.05, 0.0, -1.5]);
        assert_eq!(read::<Vec3Of<dim::Length>>(arm).unwrap().si(), [0.05, 0.0, -1.5]);
    }

    #[test]
    fn a_wrong_shape_names_the_right_one() {
        assert_eq!(
            read::<Axes<dim::Length>>("[1, 2]").unwrap_err(),
            r#"invalid length 2, expected an array of 3, each a length [m], e.g. ["0.5 m", "0.5 m", "0.5 m"]"#
        );
        assert_eq!(
            read::<Vec3Of<dim::Length>>("[1, 2, 3, 4]").unwrap_err(),
            r#"invalid length 4, expected an array of 3, each a length [m], e.g. ["0.5 m", "0.5 m", "0.5 m"]"#
        );
        assert_eq!(
            read::<Vec3Of<dim::Length>>("1").unwrap_err(),
            r#"invalid type: integer `1`, expected an array of 3, each a length [m], e.g. ["0.5 m", "0.5 m", "0.5 m"]"#
        );
        assert_eq!(
            read::<Axes<dim::Length>>("true").unwrap_err(),
            r#"invalid type: boolean `true`, expected a length [m], e.g. "0.5 m", or an array of 3"#
        );
    }

    #[test]
    fn where_the_block_decides_the_axes_number_dimension_and_range_are_checked_then() {
        let (metre, rad) = (dim::Length::KIND.dimension, dim::Angle::KIND.dimension);
        let said = |value: &str, axes: &[Dimension]| {
            let read = read::<PerAxis>(value).unwrap().si::<range::NonNegative>(axes);
            read.map_err(|e| e.to_string())
        };
        assert_eq!(said("'5 cm'", &[metre; 3]), Ok(vec![0.05; 3]));
        assert_eq!(said("['5 cm', 2]", &[metre, rad]), Ok(vec![0.05, 2.0]));
        assert_eq!(
            said("[2]", &[metre; 3]).unwrap_err(),
            r#"3 values, or one for all, are expected here, e.g. ["0.5 m", "0.5 m", "0.5 m"], not 1"#
        );
        assert!(said("2", &[]).unwrap().is_empty());
        let wrong = said("['5 cm', '2 m']", &[metre, rad]).unwrap_err();
        assert_eq!(wrong, r#""2 m" is a length [m]; an angle [rad] is expected here, e.g. "5 deg""#);
        let negative = said("['5 cm', '-2 deg']", &[metre, rad]).unwrap_err();
        assert_eq!(
            negative,
            r#""-2 deg" is out of range; an angle [rad] of at least 0 is expected here, e.g. "5 deg""#
        );
    }

    #[test]
    fn the_range_holds_for_each_axis() {
        let error = read::<Axes<dim::Length, range::Positive>>("[1, 0, 1]").unwrap_err();
        assert_eq!(error, Positive::<dim::Length>::try_from_si(0.0).unwrap_err().to_string());
    }
}
