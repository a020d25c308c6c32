//! A message type of ROS as a schema of a log.

use super::{Definitions, Elements, Encoding, Plan, short_name};
use crate::messages::Cells;
use crate::stamped::{Decoder, Schema, Split, Unreadable};
use core::ops::Range;
use std::sync::Arc;

/// A message type of ROS.
struct RosSchema {
    definitions: Arc<Definitions>,
    name: String,
    encoding: Encoding,
}

/// The schema of a type with these definitions.
pub(crate) fn schema(name: &str, definitions: Result<Definitions, String>, encoding: Encoding) -> Box<dyn Schema> {
    match definitions {
        Ok(definitions) => Box::new(RosSchema {
            definitions: Arc::new(definitions),
            name: short_name(name),
            encoding,
        }),
        Err(why) => Box::new(Unreadable(why)),
    }
}

impl Schema for RosSchema {
    fn learn(&self, message: &[u8], place: Range<usize>) -> Result<Box<dyn Decoder>, String> {
        let plan = Plan::learn(&self.definitions, &self.name, self.encoding, message, place.start)?;
        Ok(Box::new(plan))
    }

    fn split(&self, list: &str) -> Result<Box<dyn Split>, String> {
        let elements = Elements::find(&self.definitions, &self.name, list, self.encoding)?;
        let of = Self {
            definitions: Arc::clone(&self.definitions),
            name: elements.name.clone(),
            encoding: self.encoding,
        };
        Ok(Box::new(List { elements, of }))
    }
}

impl Decoder for Plan {
    fn columns(&self) -> &[String] {
        self.columns()
    }

    fn select(&mut self, columns: &[usize]) -> Option<Vec<usize>> {
        Some(self.select(columns).to_vec())
    }

    fn decode(&mut self, message: &[u8], place: Range<usize>, usual: i64, log_time: i64, cells: &mut Cells) -> Result<(), String> {
        self.decode(message, place.start, usual, log_time, cells)
    }
}

/// The elements of a list of a message.
struct List {
    elements: Elements,
    of: RosSchema,
}

impl Split for List {
    fn schema(&self) -> (&dyn Schema, &str) {
        (&self.of, &self.of.name)
    }

    fn places(&self, message: &[u8], places: &mut Vec<Range<usize>>) -> Result<Option<i64>, String> {
        self.elements.places(message, places)
    }
}
