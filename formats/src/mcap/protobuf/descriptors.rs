//! The types of protobuf, from a `FileDescriptorSet`. Its fields have the numbers of `descriptor.proto`.

use super::wire::{Content, Wire};
use std::collections::HashMap;
use std::sync::Arc;

/// The message types of a set, by their full names.
#[derive(Debug, Default)]
pub(super) struct Descriptors {
    messages: HashMap<String, Vec<Field>>,
    enumerations: HashMap<String, Arc<Vec<(i32, String)>>>,
}

/// A field of a message.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: u32,
    pub(super) is_repeated: bool,
    /// Whether a missing value differs from the default value.
    pub(super) has_presence: bool,
    pub(super) kind: Kind,
}

/// The type of a field.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    Scalar(Scalar),
    /// Names by number, in the order of the numbers.
    Enumeration(Arc<Vec<(i32, String)>>),
    Message(String),
    /// Bytes and groups.
    Unread,
}

/// A number or text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Double,
    Float,
    Int64,
    Uint64,
    Int32,
    Uint32,
    Zigzag,
    Fixed64,
    Sfixed64,
    Fixed32,
    Sfixed32,
    Text,
}

impl Field {
    /// The message type of the field.
    pub(super) fn message(&self) -> Option<&str> {
        match &self.kind {
            Kind::Message(name) => Some(name),
            _ => None,
        }
    }
}

impl Descriptors {
    /// `None` if the set is damaged.
    pub(super) fn parse(set: &[u8]) -> Option<Self> {
        let mut all = Self::default();
        // A type may be declared in a later file of the set.
        let mut unresolved = Vec::new();
        for_each(set, |number, content| match (number, content) {
            (1, Content::Bytes(file)) => all.file(file, &mut unresolved),
            _ => Some(()),
        })?;
        for (owner, fields) in unresolved {
            let fields = fields.into_iter().map(|raw| all.field(raw)).collect();
            all.messages.insert(owner, fields);
        }
        Some(all)
    }

    pub(super) fn fields(&self, name: &str) -> Option<&[Field]> {
        self.messages.get(name).map(Vec::as_slice)
    }

    fn file(&mut self, file: &[u8], unresolved: &mut Vec<(String, Vec<Raw>)>) -> Option<()> {
        let (mut package, mut is_proto3) = (String::new(), false);
        for_each(file, |number, content| {
            match (number, content) {
                (2, Content::Bytes(name)) => package = text(name),
                (12, Content::Bytes(syntax)) => is_proto3 = syntax == b"proto3",
                _ => {}
            }
            Some(())
        })?;
        for_each(file, |number, content| match (number, content) {
            (4, Content::Bytes(message)) => self.message(message, &package, is_proto3, unresolved),
            (5, Content::Bytes(enumeration)) => self.enumeration(enumeration, &package),
            _ => Some(()),
        })
    }

    fn message(&mut self, message: &[u8], scope: &str, is_proto3: bool, unresolved: &mut Vec<(String, Vec<Raw>)>) -> Option<()> {
        let (mut name, mut fields) = (String::new(), Vec::new());
        for_each(message, |number, content| {
            match (number, content) {
                (1, Content::Bytes(bytes)) => name = scoped(scope, bytes),
                (2, Content::Bytes(field)) => fields.push(Raw::read(field, is_proto3)?),
                _ => {}
            }
            Some(())
        })?;
        for_each(message, |number, content| match (number, content) {
            (3, Content::Bytes(inner)) => self.message(inner, &name, is_proto3, unresolved),
            (4, Content::Bytes(enumeration)) => self.enumeration(enumeration, &name),
            _ => Some(()),
        })?;
        unresolved.push((name, fields));
        Some(())
    }

    fn enumeration(&mut self, enumeration: &[u8], scope: &str) -> Option<()> {
        let (mut name, mut values) = (String::new(), Vec::new());
        for_each(enumeration, |number, content| {
            match (number, content) {
                (1, Content::Bytes(bytes)) => name = scoped(scope, bytes),
                (2, Content::Bytes(value)) => {
                    let (mut name, mut count) = (String::new(), 0);
                    for_each(value, |number, content| {
                        match (number, content) {
                            (1, Content::Bytes(bytes)) => name = text(bytes),
                            (2, Content::Varint(varint)) => count = varint as i32,
                            _ => {}
                        }
                        Some(())
                    })?;
                    values.push((count, name));
                }
                _ => {}
            }
            Some(())
        })?;
        values.sort_by_key(|(number, _)| *number);
        self.enumerations.insert(name, Arc::new(values));
        Some(())
    }

    fn field(&self, raw: Raw) -> Field {
        let of = raw.of.trim_start_matches('.');
        let kind = match raw.kind {
            1 => Kind::Scalar(Scalar::Double),
            2 => Kind::Scalar(Scalar::Float),
            3 => Kind::Scalar(Scalar::Int64),
            // A bool is 0 or 1.
            4 | 8 => Kind::Scalar(Scalar::Uint64),
            5 => Kind::Scalar(Scalar::Int32),
            6 => Kind::Scalar(Scalar::Fixed64),
            7 => Kind::Scalar(Scalar::Fixed32),
            9 => Kind::Scalar(Scalar::Text),
            13 => Kind::Scalar(Scalar::Uint32),
            15 => Kind::Scalar(Scalar::Sfixed32),
            16 => Kind::Scalar(Scalar::Sfixed64),
            17 | 18 => Kind::Scalar(Scalar::Zigzag),
            11 => Kind::Message(of.to_owned()),
            14 => Kind::Enumeration(self.enumerations.get(of).cloned().unwrap_or_default()),
            _ => Kind::Unread,
        };
        Field {
            name: raw.name,
            number: raw.number,
            is_repeated: raw.is_repeated,
            has_presence: raw.has_presence,
            kind,
        }
    }
}

/// A field before its type is looked up.
struct Raw {
    name: String,
    number: u32,
    is_repeated: bool,
    has_presence: bool,
    kind: u64,
    of: String,
}

impl Raw {
    fn read(field: &[u8], is_proto3: bool) -> Option<Self> {
        let mut raw = Self {
            name: String::new(),
            number: 0,
            is_repeated: false,
            has_presence: !is_proto3,
            kind: 0,
            of: String::new(),
        };
        for_each(field, |number, content| {
            match (number, content) {
                (1, Content::Bytes(name)) => raw.name = text(name),
                (3, Content::Varint(number)) => raw.number = u32::try_from(number).ok()?,
                (4, Content::Varint(label)) => raw.is_repeated = label == 3,
                (5, Content::Varint(kind)) => raw.kind = kind,
                (6, Content::Bytes(name)) => raw.of = text(name),
                // A field of a `oneof`; also an `optional` one of proto3.
                (9, _) => raw.has_presence = true,
                _ => {}
            }
            Some(())
        })?;
        Some(raw)
    }
}

/// Calls a function for each field; `None` if one is damaged.
fn for_each<'a>(message: &'a [u8], mut act: impl FnMut(u32, Content<'a>) -> Option<()>) -> Option<()> {
    let mut wire = Wire::new(message);
    while !wire.is_empty() {
        let (number, content) = wire.field()?;
        act(number, content)?;
    }
    Some(())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn scoped(scope: &str, name: &[u8]) -> String {
    let name = text(name);
    if scope.is_empty() { name } else { format!("{scope}.{name}") }
}
