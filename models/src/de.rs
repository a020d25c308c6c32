//! Reads specs by one set of functions for all of them.
//!
//! typetag reads a spec from an erased deserialiser. With the derive of serde alone, the compiler writes about fifty
//! functions for each type within the spec. [`DeserializeSpec`] derives the same `Deserialize`, but it hands a [`Thin`]
//! deserialiser to the code of serde. A spec of another crate may derive either.

use core::fmt::{self, Display};
use serde::de::{DeserializeSeed, Deserializer, EnumAccess, Error, Expected, MapAccess, SeqAccess, Unexpected, VariantAccess, Visitor};

pub use fusion_derive::DeserializeSpec;

/// Reads a value from a deserialiser, as the derive [`DeserializeSpec`] does.
///
/// # Errors
/// Those of the deserialiser and of the value.
pub fn read<'de, D: Deserializer<'de>, T>(deserializer: D, read: impl FnOnce(Thin<'_, 'de>) -> Result<T, Mistake>) -> Result<T, D::Error> {
    read(Thin(&mut Whole(Some(deserializer)))).map_err(Mistake::into_error)
}

/// A deserialiser without a type parameter: it forwards to any other.
pub struct Thin<'x, 'de>(&'x mut dyn Node<'de>);

/// Reads the value of a seed.
type Seed<'x, 'de> = &'x mut dyn FnMut(Thin<'_, 'de>) -> Result<(), Mistake>;

/// Receives the value that a deserialiser found.
type Receive<'x, 'de> = &'x mut dyn FnMut(Found<'_, 'de>) -> Result<(), Mistake>;

type Names = &'static [&'static str];

/// The kind of value that a type asks for.
#[derive(Clone, Copy)]
enum Hint {
    Any,
    Option,
    Unit,
    UnitStruct(&'static str),
    Newtype(&'static str),
    Map,
    Struct(&'static str, Names),
    Enum(&'static str, Names),
}

/// The value that a deserialiser found.
enum Found<'x, 'de> {
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(&'x str),
    Borrowed(&'de str),
    Unit,
    Some(Thin<'x, 'de>),
    Newtype(Thin<'x, 'de>),
    Seq(Elements<'x, 'de>),
    Map(Entries<'x, 'de>),
    Enum(Variant<'x, 'de>),
}

impl<'de> Found<'_, 'de> {
    fn visit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        match self {
            Self::Bool(flag) => visitor.visit_bool(flag),
            Self::Integer(number) => visitor.visit_i64(number),
            Self::Float(number) => visitor.visit_f64(number),
            Self::Text(text) => visitor.visit_str(text),
            Self::Borrowed(text) => visitor.visit_borrowed_str(text),
            Self::Unit => visitor.visit_unit(),
            Self::Some(inner) => visitor.visit_some(inner),
            Self::Newtype(inner) => visitor.visit_newtype_struct(inner),
            Self::Seq(elements) => visitor.visit_seq(elements),
            Self::Map(entries) => visitor.visit_map(entries),
            Self::Enum(variant) => visitor.visit_enum(variant),
        }
    }
}

/// A deserialiser, once.
trait Node<'de> {
    fn read(&mut self, hint: Hint, receive: Receive<'_, 'de>) -> Result<(), Mistake>;
}

struct Whole<D>(Option<D>);

impl<'de, D: Deserializer<'de>> Node<'de> for Whole<D> {
    fn read(&mut self, hint: Hint, receive: Receive<'_, 'de>) -> Result<(), Mistake> {
        let deserializer = once(&mut self.0)?;
        let receiver = Receiver(receive);
        let read = match hint {
            Hint::Any => deserializer.deserialize_any(receiver),
            Hint::Option => deserializer.deserialize_option(receiver),
            Hint::Unit => deserializer.deserialize_unit(receiver),
            Hint::UnitStruct(name) => deserializer.deserialize_unit_struct(name, receiver),
            Hint::Newtype(name) => deserializer.deserialize_newtype_struct(name, receiver),
            Hint::Map => deserializer.deserialize_map(receiver),
            Hint::Struct(name, fields) => deserializer.deserialize_struct(name, fields, receiver),
            Hint::Enum(name, variants) => deserializer.deserialize_enum(name, variants, receiver),
        };
        read.map_err(Mistake::custom)
    }
}

/// Takes the value that is for one use only.
fn once<T>(from: &mut Option<T>) -> Result<T, Mistake> {
    from.take().ok_or_else(|| Mistake::custom("a value was read twice"))
}

/// The one visitor that other deserialisers see.
struct Receiver<'x, 'de>(Receive<'x, 'de>);

impl<'de> Receiver<'_, 'de> {
    fn take<E: Error>(self, found: Found<'_, 'de>) -> Result<(), E> {
        (self.0)(found).map_err(Mistake::into_error)
    }
}

impl<'de> Visitor<'de> for Receiver<'_, 'de> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<(), E> {
        self.take(Found::Bool(flag))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<(), E> {
        self.take(Found::Integer(number))
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<(), E> {
        let whole = i64::try_from(number).map_err(|_| E::invalid_value(Unexpected::Unsigned(number), &"a smaller number"))?;
        self.take(Found::Integer(whole))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<(), E> {
        self.take(Found::Float(number))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        self.take(Found::Text(text))
    }

    fn visit_borrowed_str<E: Error>(self, text: &'de str) -> Result<(), E> {
        self.take(Found::Borrowed(text))
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.take(Found::Unit)
    }

    fn visit_none<E: Error>(self) -> Result<(), E> {
        self.take(Found::Unit)
    }

    fn visit_some<D: Deserializer<'de>>(self, inner: D) -> Result<(), D::Error> {
        self.take(Found::Some(Thin(&mut Whole(Some(inner)))))
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, inner: D) -> Result<(), D::Error> {
        self.take(Found::Newtype(Thin(&mut Whole(Some(inner)))))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        self.take(Found::Seq(Elements(&mut elements)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<(), A::Error> {
        self.take(Found::Map(Entries(&mut entries)))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, named: A) -> Result<(), A::Error> {
        self.take(Found::Enum(Variant(&mut Choice {
            named: Some(named),
            content: None,
        })))
    }
}

/// Reads by a visitor of any type.
fn visited<'de, V: Visitor<'de>>(from: Thin<'_, 'de>, hint: Hint, visitor: V) -> Result<V::Value, Mistake> {
    received(visitor, |receive| from.0.read(hint, receive))
}

/// Gives a visitor the value that `read`, a function without a type parameter, hands over.
fn received<'de, V: Visitor<'de>>(visitor: V, read: impl FnOnce(Receive<'_, 'de>) -> Result<(), Mistake>) -> Result<V::Value, Mistake> {
    let (mut visitor, mut value) = (Some(visitor), None);
    read(&mut |found| {
        value = Some(found.visit(once(&mut visitor)?)?);
        Ok(())
    })?;
    once(&mut value)
}

impl<'de> Deserializer<'de> for Thin<'_, 'de> {
    type Error = Mistake;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Any, visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Option, visitor)
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Unit, visitor)
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::UnitStruct(name), visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, name: &'static str, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Newtype(name), visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Map, visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(self, name: &'static str, fields: Names, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Struct(name, fields), visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(self, name: &'static str, variants: Names, visitor: V) -> Result<V::Value, Mistake> {
        visited(self, Hint::Enum(name, variants), visitor)
    }

    // Every value of TOML has a type.
    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf seq tuple tuple_struct
        identifier ignored_any
    }
}

/// Reads the value of a seed by a function without a type parameter.
fn sown<'de, S: DeserializeSeed<'de>>(
    seed: S,
    read: impl FnOnce(Seed<'_, 'de>) -> Result<(), Mistake>,
) -> Result<Option<S::Value>, Mistake> {
    let (mut seed, mut value) = (Some(seed), None);
    read(&mut |from| {
        value = Some(once(&mut seed)?.deserialize(from)?);
        Ok(())
    })?;
    Ok(value)
}

/// The one seed that other deserialisers see.
struct Sown<'x, 'de>(Seed<'x, 'de>);

impl<'de> DeserializeSeed<'de> for Sown<'_, 'de> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        (self.0)(Thin(&mut Whole(Some(from)))).map_err(Mistake::into_error)
    }
}

trait List<'de> {
    fn element(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake>;
}

impl<'de, A: SeqAccess<'de>> List<'de> for A {
    fn element(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake> {
        self.next_element_seed(Sown(seed)).map(drop).map_err(Mistake::custom)
    }
}

struct Elements<'x, 'de>(&'x mut dyn List<'de>);

impl<'de> SeqAccess<'de> for Elements<'_, 'de> {
    type Error = Mistake;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Mistake> {
        sown(seed, |seed| self.0.element(seed))
    }
}

trait Table<'de> {
    fn key(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake>;
    fn value(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake>;
}

impl<'de, A: MapAccess<'de>> Table<'de> for A {
    fn key(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake> {
        self.next_key_seed(Sown(seed)).map(drop).map_err(Mistake::custom)
    }

    fn value(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake> {
        self.next_value_seed(Sown(seed)).map_err(Mistake::custom)
    }
}

struct Entries<'x, 'de>(&'x mut dyn Table<'de>);

impl<'de> MapAccess<'de> for Entries<'_, 'de> {
    type Error = Mistake;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Mistake> {
        sown(seed, |seed| self.0.key(seed))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Mistake> {
        once(&mut sown(seed, |seed| self.0.value(seed))?)
    }
}

/// The name of a variant, then its content.
trait Tagged<'de> {
    fn name(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake>;
    fn unit(&mut self) -> Result<(), Mistake>;
    fn newtype(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake>;
    fn tuple(&mut self, length: usize, receive: Receive<'_, 'de>) -> Result<(), Mistake>;
    fn fields(&mut self, fields: Names, receive: Receive<'_, 'de>) -> Result<(), Mistake>;
}

struct Choice<'de, A: EnumAccess<'de>> {
    named: Option<A>,
    content: Option<A::Variant>,
}

impl<'de, A: EnumAccess<'de>> Tagged<'de> for Choice<'de, A> {
    fn name(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake> {
        let ((), content) = once(&mut self.named)?.variant_seed(Sown(seed)).map_err(Mistake::custom)?;
        self.content = Some(content);
        Ok(())
    }

    fn unit(&mut self) -> Result<(), Mistake> {
        once(&mut self.content)?.unit_variant().map_err(Mistake::custom)
    }

    fn newtype(&mut self, seed: Seed<'_, 'de>) -> Result<(), Mistake> {
        let content = once(&mut self.content)?;
        content.newtype_variant_seed(Sown(seed)).map_err(Mistake::custom)
    }

    fn tuple(&mut self, length: usize, receive: Receive<'_, 'de>) -> Result<(), Mistake> {
        let content = once(&mut self.content)?;
        content.tuple_variant(length, Receiver(receive)).map_err(Mistake::custom)
    }

    fn fields(&mut self, fields: Names, receive: Receive<'_, 'de>) -> Result<(), Mistake> {
        let content = once(&mut self.content)?;
        content.struct_variant(fields, Receiver(receive)).map_err(Mistake::custom)
    }
}

struct Variant<'x, 'de>(&'x mut dyn Tagged<'de>);

impl<'de> EnumAccess<'de> for Variant<'_, 'de> {
    type Error = Mistake;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self), Mistake> {
        let name = once(&mut sown(seed, |seed| self.0.name(seed))?)?;
        Ok((name, self))
    }
}

impl<'de> VariantAccess<'de> for Variant<'_, 'de> {
    type Error = Mistake;

    fn unit_variant(self) -> Result<(), Mistake> {
        self.0.unit()
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Mistake> {
        once(&mut sown(seed, |seed| self.0.newtype(seed))?)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Mistake> {
        received(visitor, |receive| self.0.tuple(length, receive))
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: Names, visitor: V) -> Result<V::Value, Mistake> {
        received(visitor, |receive| self.0.fields(fields, receive))
    }
}

/// A mistake in a value, by its kind, as serde reports it.
#[derive(Clone, Debug)]
pub enum Mistake {
    /// A sentence.
    Said(String),
    /// Another type than expected, or another value of this type.
    Unexpected {
        /// Whether the type is right.
        is_value: bool,
        /// The value that was there.
        found: Instead,
        /// The value that serde expected.
        wanted: String,
    },
    /// Another number of elements than expected.
    Length(usize, String),
    /// A field that does not exist, and those that do.
    UnknownField(String, Names),
    /// A variant that does not exist, and those that do.
    UnknownVariant(String, Names),
    /// A field is missing.
    MissingField(&'static str),
    /// A field is there twice.
    DuplicateField(&'static str),
}

/// The value instead of the expected one: [`Unexpected`] with its own text.
#[derive(Clone, Debug)]
pub enum Instead {
    /// A flag.
    Bool(bool),
    /// An integer.
    Integer(i64),
    /// A number.
    Float(f64),
    /// A text.
    Text(String),
    /// An array.
    Seq,
    /// A table.
    Map,
    /// Something else.
    Other(String),
}

impl Instead {
    fn of(unexpected: Unexpected<'_>) -> Self {
        match unexpected {
            Unexpected::Bool(flag) => Self::Bool(flag),
            Unexpected::Signed(number) => Self::Integer(number),
            Unexpected::Float(number) => Self::Float(number),
            Unexpected::Str(text) => Self::Text(text.to_owned()),
            Unexpected::Seq => Self::Seq,
            Unexpected::Map => Self::Map,
            other => Self::Other(other.to_string()),
        }
    }

    fn unexpected(&self) -> Unexpected<'_> {
        match self {
            Self::Bool(flag) => Unexpected::Bool(*flag),
            Self::Integer(number) => Unexpected::Signed(*number),
            Self::Float(number) => Unexpected::Float(*number),
            Self::Text(text) => Unexpected::Str(text),
            Self::Seq => Unexpected::Seq,
            Self::Map => Unexpected::Map,
            Self::Other(text) => Unexpected::Other(text),
        }
    }
}

impl Mistake {
    fn unexpected(is_value: bool, found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::Unexpected {
            is_value,
            found: Instead::of(found),
            wanted: wanted.to_string(),
        }
    }

    fn into_error<E: Error>(self) -> E {
        match self {
            Self::Said(sentence) => E::custom(sentence),
            Self::Unexpected { is_value, found, wanted } => {
                let invalid = if is_value { E::invalid_value } else { E::invalid_type };
                invalid(found.unexpected(), &wanted.as_str())
            }
            Self::Length(length, wanted) => E::invalid_length(length, &wanted.as_str()),
            Self::UnknownField(field, known) => E::unknown_field(&field, known),
            Self::UnknownVariant(variant, known) => E::unknown_variant(&variant, known),
            Self::MissingField(field) => E::missing_field(field),
            Self::DuplicateField(field) => E::duplicate_field(field),
        }
    }
}

impl Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let error: serde::de::value::Error = self.clone().into_error();
        error.fmt(f)
    }
}

impl core::error::Error for Mistake {}

impl Error for Mistake {
    fn custom<T: Display>(sentence: T) -> Self {
        Self::Said(sentence.to_string())
    }

    fn invalid_type(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::unexpected(false, found, wanted)
    }

    fn invalid_value(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::unexpected(true, found, wanted)
    }

    fn invalid_length(length: usize, wanted: &dyn Expected) -> Self {
        Self::Length(length, wanted.to_string())
    }

    fn unknown_field(field: &str, known: Names) -> Self {
        Self::UnknownField(field.to_owned(), known)
    }

    fn unknown_variant(variant: &str, known: Names) -> Self {
        Self::UnknownVariant(variant.to_owned(), known)
    }

    fn missing_field(field: &'static str) -> Self {
        Self::MissingField(field)
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::DuplicateField(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use serde::de::DeserializeOwned;

    /// The fields of both derives.
    macro_rules! both {
        ($($derived:ident: $by:path,)*) => { $(
            #[derive(Debug, $by)]
            #[serde(deny_unknown_fields)]
            #[allow(dead_code, reason = "read through `Debug`")]
            struct $derived {
                word: Word,
                #[serde(default = "two")]
                number: f64,
                pair: Option<(i8, u16)>,
                #[serde(default)]
                flags: Vec<bool>,
                text: Option<String>,
                #[serde(default)]
                none: (),
            }
        )* };
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code, reason = "read through `Debug`")]
    enum Word {
        Plain,
        Wrapped(Vec<u8>),
        Two(i64, f64),
        Named { depth: Option<f64> },
    }

    fn two() -> f64 {
        2.0
    }

    both! { Thinly: DeserializeSpec, Plainly: Deserialize, }

    fn read<T: DeserializeOwned + fmt::Debug>(text: &str, name: &str) -> String {
        // A table without places: serde alone decides about the message.
        let read = toml::from_str::<toml::Value>(text).map(T::deserialize);
        match read.unwrap() {
            Ok(value) => format!("{value:?}").replace(name, "T"),
            // toml adds a line with the key at each step on the way up.
            Err(error) => error.to_string().lines().next().unwrap_or_default().replace(name, "T"),
        }
    }

    #[test]
    fn values_and_mistakes_are_those_of_serde() {
        for text in [
            "word = \"plain\"",
            "word.wrapped = [1, 2]\nnumber = 3\nflags = [true]",
            "word.two = [-1, 2.5]\npair = [-8, 65535]\ntext = \"é\"",
            "word.named = {}\nnumber = -0.5",
            "word.named = { depth = 3 }",
            "word.other = 1",
            "word = \"other\"",
            "word = 3",
            "number = 1",
            "word = \"plain\"\nnumber = \"one\"",
            "word = \"plain\"\nnumbre = 1",
            "word = \"plain\"\npair = [1]",
            "word = \"plain\"\npair = [1, 70000]",
            "word = \"plain\"\npair = [300, 7]",
            "word = \"plain\"\nflags = [1]",
            "word = \"plain\"\nflags = true",
            "word = \"plain\"\ntext = 2020-01-01",
            "word.wrapped = {}",
        ] {
            assert_eq!(read::<Thinly>(text, "Thinly"), read::<Plainly>(text, "Plainly"), "{text}");
        }
    }
}
