//! Messages of protobuf by the descriptors in the file.
//!
//! All fields of the type are columns. A list has columns for as many elements as the first message has. A field that is missing
//! has its default value if the type gives it no presence, as in proto3, and otherwise an empty cell. The value of an
//! enumeration is its name, and a `google.protobuf.Timestamp` or `Duration` one number of nanoseconds.
//!
//! The walk over the bytes is written here: values go from the bytes into the cells, and nothing is allocated.
//!
//! Not read   fields of the type `bytes`, groups, extensions

mod descriptors;
mod plan;
#[cfg(test)]
mod tests;
mod wire;

use crate::stamped::{Decoder, Schema, Split, Unreadable};
use core::ops::Range;
use descriptors::Descriptors;
use plan::Plan;
use std::sync::Arc;
use wire::{Content, Wire};

/// A message type of protobuf.
struct ProtobufSchema {
    descriptors: Arc<Descriptors>,
    name: String,
}

/// The schema of a type by a `FileDescriptorSet`.
pub(super) fn schema(name: &str, set: &[u8]) -> Box<dyn Schema> {
    match Descriptors::parse(set) {
        Some(descriptors) => Box::new(ProtobufSchema {
            descriptors: Arc::new(descriptors),
            name: name.to_owned(),
        }),
        None => Box::new(Unreadable("its descriptors are damaged".to_owned())),
    }
}

impl Schema for ProtobufSchema {
    fn learn(&self, message: &[u8], place: Range<usize>) -> Result<Box<dyn Decoder>, String> {
        Ok(Box::new(Plan::learn(&self.descriptors, &self.name, message, place)?))
    }

    fn split(&self, list: &str) -> Result<Box<dyn Split>, String> {
        let (mut numbers, mut owner) = (Vec::new(), self.name.as_str());
        let mut path = list.split('.').peekable();
        while let Some(wanted) = path.next() {
            let fields = self.descriptors.fields(owner).unwrap_or_default();
            let field = fields.iter().find(|field| field.name == wanted);
            let field = field.ok_or_else(|| format!("`{owner}` has no field `{wanted}`"))?;
            numbers.push(field.number);
            match (field.message(), path.peek()) {
                (Some(inner), Some(_)) if !field.is_repeated => owner = inner,
                (Some(inner), None) if field.is_repeated => {
                    let of = Self {
                        descriptors: Arc::clone(&self.descriptors),
                        name: inner.to_owned(),
                    };
                    return Ok(Box::new(List { numbers, of }));
                }
                _ => break,
            }
        }
        Err(format!("`{list}` is no list of messages"))
    }
}

/// The elements of a list of a message.
struct List {
    /// The numbers of the fields on the way to the list, and its own.
    numbers: Vec<u32>,
    of: ProtobufSchema,
}

impl Split for List {
    fn schema(&self) -> (&dyn Schema, &str) {
        (&self.of, &self.of.name)
    }

    fn places(&self, message: &[u8], places: &mut Vec<Range<usize>>) -> Result<Option<i64>, String> {
        places.clear();
        find(&self.numbers, message, 0, places).ok_or(wire::DAMAGED)?;
        Ok(None)
    }
}

/// Writes the places of the elements of a list. These bytes begin at `offset`.
fn find(numbers: &[u32], bytes: &[u8], offset: usize, places: &mut Vec<Range<usize>>) -> Option<()> {
    let (first, rest) = numbers.split_first()?;
    let mut wire = Wire::new(bytes);
    while !wire.is_empty() {
        let (number, content) = wire.field()?;
        if let (true, Content::Bytes(inner)) = (number == *first, content) {
            let from = wire.at() - inner.len();
            match rest {
                [] => places.push(offset + from..offset + wire.at()),
                rest => find(rest, inner, offset + from, places)?,
            }
        }
    }
    Some(())
}
