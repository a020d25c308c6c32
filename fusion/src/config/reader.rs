//! The serde deserialiser of a node, which reports the node it was at when it failed.
//!
//! A block, `{ type = "nis", probability = 0.99 }`, is presented as `{ nis = { probability = 0.99 } }`:
//! the externally tagged form, which typetag reads without buffering and serde as an enum. A map is
//! read as a block if the target type is [`Nested`](fusion_models::block::Nested).
//!
//! A struct is read only from a table, although serde would accept an array with its fields in order.

use fusion_models::block::NESTED;
use serde::de::value::BorrowedStrDeserializer;
use serde::de::{DeserializeSeed, Deserializer, EnumAccess, MapAccess, SeqAccess, VariantAccess, Visitor};

use super::diagnostic::Place;
use super::document::{Entry, Node, Value};
use super::fault::Fault;
use super::read::{Attempt, Blame, TYPE};

/// Deserialises one node.
#[derive(Clone, Copy)]
pub(super) struct Reader<'r, 'a> {
    node: &'a Node,
    attempt: &'r Attempt<'a>,
    /// Set if `type` is already read and is no longer a field.
    typed: bool,
    /// Whether a map is a block.
    block: bool,
}

impl<'r, 'a> Reader<'r, 'a> {
    pub(super) fn new(node: &'a Node, attempt: &'r Attempt<'a>) -> Self {
        Self {
            node,
            attempt,
            typed: false,
            block: false,
        }
    }

    /// Reads the type of `seed`. Errors after reading, such as those of `serde(try_from)`, also refer to this
    /// node.
    fn read<S: DeserializeSeed<'a>>(self, seed: S) -> Result<S::Value, Fault> {
        seed.deserialize(self).map_err(|fault| self.blame(fault))
    }

    fn blame(self, fault: Fault) -> Fault {
        let place = match fault {
            Fault::MissingField(_) | Fault::MissingType { .. } => &self.node.name,
            _ => &self.node.place,
        };
        self.attempt.blame(Blame {
            node: self.node,
            place,
            moved: &[],
            fault,
        })
    }

    fn entries(self) -> impl Iterator<Item = &'a Entry> {
        let Self { attempt, typed, .. } = self;
        let seen = move |entry: &&Entry| {
            let is_hidden = attempt.hides(&entry.node);
            !(is_hidden || typed && entry.key == TYPE)
        };
        self.node.entries().iter().filter(seen)
    }

    fn visit<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::String(text) if !self.typed => visitor.visit_borrowed_str(text),
            Value::Integer(number) => visitor.visit_i64(*number),
            Value::Float(number) => visitor.visit_f64(*number),
            Value::Boolean(flag) => visitor.visit_bool(*flag),
            Value::Datetime(instant) => visitor.visit_string(instant.to_string()),
            Value::Array(nodes) => visitor.visit_seq(Elements {
                nodes: nodes.iter(),
                attempt: self.attempt,
            }),
            Value::Table { .. } | Value::String(_) => visitor.visit_map(Fields {
                entries: self.entries(),
                value: None,
                moved: self.node.moved(),
                attempt: self.attempt,
            }),
        }
    }

    /// The name of the type and its fields; `None` if this cannot be a block or an enum.
    fn tagged(self) -> Option<Tagged<'r, 'a>> {
        let (name, place) = match (&self.node.value, self.node.get(TYPE)) {
            (Value::String(name), _) => (name.as_str(), &self.node.place),
            (Value::Table { .. }, Some(named)) => (named.as_str().unwrap_or(""), &named.place),
            (Value::Table { .. }, None) => ("", &self.node.name),
            _ => return None,
        };
        let content = Self {
            typed: true,
            block: false,
            ..self
        };
        Some(Tagged { name, place, content })
    }
}

impl<'a> Deserializer<'a> for Reader<'_, 'a> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.visit(visitor).map_err(|fault| self.blame(fault))
    }

    fn deserialize_map<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.tagged().filter(|_| self.block) {
            Some(tagged) => visitor.visit_map(tagged).map_err(|fault| self.blame(fault)),
            None => self.deserialize_any(visitor),
        }
    }

    fn deserialize_enum<V: Visitor<'a>>(self, _: &'static str, names: &'static [&'static str], visitor: V) -> Result<V::Value, Fault> {
        match self.tagged() {
            Some(tagged) => visitor.visit_enum(tagged).map_err(|fault| self.blame(fault)),
            None => self.visit(visitor).map_err(|fault| self.blame(fault.among(names))),
        }
    }

    fn deserialize_option<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self).map_err(|fault| self.blame(fault))
    }

    fn deserialize_newtype_struct<V: Visitor<'a>>(self, name: &'static str, visitor: V) -> Result<V::Value, Fault> {
        let inner = Self {
            block: self.block || name == NESTED,
            ..self
        };
        visitor.visit_newtype_struct(inner).map_err(|fault| self.blame(fault))
    }

    fn deserialize_struct<V: Visitor<'a>>(self, _: &'static str, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Fault> {
        match &self.node.value {
            Value::Array(_) => Err(self.blame(Fault::ArrayForTable { fields })),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_unit<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.entries().next() {
            Some(entry) => {
                let field = entry.key.clone();
                let fault = Fault::UnknownField { field, known: &[] };
                Err(self.attempt.blame(Blame {
                    node: &entry.node,
                    place: &entry.node.name,
                    moved: self.node.moved(),
                    fault,
                }))
            }
            None if self.typed => visitor.visit_unit(),
            None => self.deserialize_any(visitor),
        }
    }

    fn deserialize_unit_struct<V: Visitor<'a>>(self, _: &'static str, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_unit(visitor)
    }

    serde::forward_to_deserialize_any! {
        <V: Visitor<'a>>
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf seq tuple
        tuple_struct identifier ignored_any
    }
}

/// The elements of an array.
struct Elements<'r, 'a> {
    nodes: std::slice::Iter<'a, Node>,
    attempt: &'r Attempt<'a>,
}

impl<'a> SeqAccess<'a> for Elements<'_, 'a> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<Option<S::Value>, Fault> {
        let attempt = self.attempt;
        let next = self.nodes.find(|node| !attempt.hides(node));
        next.map(|node| Reader::new(node, attempt).read(seed)).transpose()
    }
}

/// The fields of a table.
struct Fields<'r, 'a, I> {
    entries: I,
    /// The value whose key was read last.
    value: Option<&'a Node>,
    moved: &'a [String],
    attempt: &'r Attempt<'a>,
}

impl<'a, I: Iterator<Item = &'a Entry>> MapAccess<'a> for Fields<'_, 'a, I> {
    type Error = Fault;

    fn next_key_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<Option<S::Value>, Fault> {
        let Some(Entry { key, node }) = self.entries.next() else {
            return Ok(None);
        };
        self.value = Some(node);
        let word = Word {
            text: key,
            node,
            place: &node.name,
            moved: self.moved,
            attempt: self.attempt,
        };
        seed.deserialize(word).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        let asked_too_early = || Fault::Said("a value was asked for before its key".to_owned());
        let node = self.value.take().ok_or_else(asked_too_early)?;
        Reader::new(node, self.attempt).read(seed)
    }
}

/// Deserialises a key, or the name of a type.
struct Word<'r, 'a> {
    /// Empty where a `type` is missing.
    text: &'a str,
    /// The node to hide if the word is wrong.
    node: &'a Node,
    place: &'a Place,
    /// Fields to suggest although they are read elsewhere.
    moved: &'a [String],
    attempt: &'r Attempt<'a>,
}

impl Word<'_, '_> {
    fn blame(&self, fault: Fault) -> Fault {
        let fault = match fault {
            Fault::UnknownVariant { known, .. } if self.text.is_empty() => Fault::MissingType { known },
            other => other,
        };
        self.attempt.blame(Blame {
            node: self.node,
            place: self.place,
            moved: self.moved,
            fault,
        })
    }
}

impl<'a> Deserializer<'a> for Word<'_, 'a> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_borrowed_str(self.text).map_err(|fault| self.blame(fault))
    }

    fn deserialize_enum<V: Visitor<'a>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let text = BorrowedStrDeserializer::new(self.text);
        text.deserialize_enum(name, variants, visitor)
            .map_err(|fault: Fault| self.blame(fault))
    }

    fn deserialize_newtype_struct<V: Visitor<'a>>(self, _: &'static str, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    serde::forward_to_deserialize_any! {
        <V: Visitor<'a>>
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option
        unit unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// A block or an enum: the name of its type, then its fields.
struct Tagged<'r, 'a> {
    /// Empty if the `type` is missing.
    name: &'a str,
    place: &'a Place,
    content: Reader<'r, 'a>,
}

impl<'r, 'a> Tagged<'r, 'a> {
    fn word(&self) -> Word<'r, 'a> {
        Word {
            text: self.name,
            node: self.content.node,
            place: self.place,
            moved: &[],
            attempt: self.content.attempt,
        }
    }
}

impl<'a> MapAccess<'a> for Tagged<'_, 'a> {
    type Error = Fault;

    fn next_key_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<Option<S::Value>, Fault> {
        seed.deserialize(self.word()).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        self.content.read(seed)
    }
}

impl<'a> EnumAccess<'a> for Tagged<'_, 'a> {
    type Error = Fault;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'a>>(self, seed: S) -> Result<(S::Value, Self), Fault> {
        Ok((seed.deserialize(self.word())?, self))
    }
}

impl<'a> VariantAccess<'a> for Tagged<'_, 'a> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        serde::Deserialize::deserialize(self.content)
    }

    fn newtype_variant_seed<S: DeserializeSeed<'a>>(self, seed: S) -> Result<S::Value, Fault> {
        self.content.read(seed)
    }

    fn tuple_variant<V: Visitor<'a>>(self, _: usize, visitor: V) -> Result<V::Value, Fault> {
        self.content.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'a>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Fault> {
        self.content.deserialize_struct("", fields, visitor)
    }
}
