//! One quantity per axis.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};

use super::quantity::{Dimensional, Quantity, QuantityVisitor, Range, range};

/// `N` quantities: an array of exactly `N`, or one quantity that holds for every axis.
pub struct Axes<D, R = range::Finite, const N: usize = 3>([Quantity<D, R>; N]);

/// Three quantities, all of them written: a lever arm has no scalar form.
pub struct Vec3Of<D, R = range::Finite>([Quantity<D, R>; 3]);

/// What both have in common with a plain array.
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
        deserializer.deserialize_any(AxesVisitor(PhantomData)).map(Self)
    }
}

impl<'de, D: Dimensional, R: Range> Deserialize<'de> for Vec3Of<D, R> {
    fn deserialize<A: Deserializer<'de>>(deserializer: A) -> Result<Self, A::Error> {
        deserializer.deserialize_any(ArrayVisitor(PhantomData)).map(Self)
    }
}

/// Reads an array of exactly `N`.
struct ArrayVisitor<D, R, const N: usize>(PhantomData<(D, R)>);

impl<'de, D: Dimensional, R: Range, const N: usize> Visitor<'de> for ArrayVisitor<D, R, N> {
    type Value = [Quantity<D, R>; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an array of {N}, each {}, e.g. {:?}", D::KIND, D::KIND.example)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        let axes = Vec::<Quantity<D, R>>::deserialize(SeqAccessDeserializer::new(seq))?;
        let length = axes.len();
        axes.try_into().map_err(|_| A::Error::invalid_length(length, &self))
    }
}

/// Reads an array of exactly `N`, or one quantity for all.
struct AxesVisitor<D, R, const N: usize>(PhantomData<(D, R)>);

impl<D: Dimensional, R: Range, const N: usize> AxesVisitor<D, R, N> {
    const ONE: QuantityVisitor<D, R> = QuantityVisitor(PhantomData);
}

impl<'de, D: Dimensional, R: Range, const N: usize> Visitor<'de> for AxesVisitor<D, R, N> {
    type Value = [Quantity<D, R>; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, e.g. {:?}, or an array of {N}", D::KIND, D::KIND.example)
    }

    fn visit_f64<E: Error>(self, si: f64) -> Result<Self::Value, E> {
        Self::ONE.visit_f64(si).map(|one| [one; N])
    }

    fn visit_i64<E: Error>(self, si: i64) -> Result<Self::Value, E> {
        Self::ONE.visit_i64(si).map(|one| [one; N])
    }

    fn visit_u64<E: Error>(self, si: u64) -> Result<Self::Value, E> {
        Self::ONE.visit_u64(si).map(|one| [one; N])
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        Self::ONE.visit_str(text).map(|one| [one; N])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        ArrayVisitor(PhantomData).visit_seq(seq)
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
            r#"invalid length 2, expected an array of 3, each a length [m], e.g. "0.5 m""#
        );
        assert_eq!(
            read::<Vec3Of<dim::Length>>("[1, 2, 3, 4]").unwrap_err(),
            r#"invalid length 4, expected an array of 3, each a length [m], e.g. "0.5 m""#
        );
        assert_eq!(
            read::<Vec3Of<dim::Length>>("1").unwrap_err(),
            r#"invalid type: integer `1`, expected an array of 3, each a length [m], e.g. "0.5 m""#
        );
        assert_eq!(
            read::<Axes<dim::Length>>("true").unwrap_err(),
            r#"invalid type: boolean `true`, expected a length [m], e.g. "0.5 m", or an array of 3"#
        );
    }

    #[test]
    fn the_range_holds_for_each_axis() {
        let error = read::<Axes<dim::Length, range::Positive>>("[1, 0, 1]").unwrap_err();
        assert_eq!(error, Positive::<dim::Length>::try_from_si(0.0).unwrap_err().to_string());
    }
}
