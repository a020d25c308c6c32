//! Messages of JSON. The first message of a topic defines its columns.
//!
//! A time of Foxglove, `{ "sec": 1, "nsec": 2 }`, is one number of nanoseconds. `true` is 1, `null` an empty cell.

use crate::messages::{Cells, LONGEST_ARRAY};
use crate::stamped::{Decoder, STAMPS, Schema, Split};
use core::fmt;
use core::ops::Range;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

/// Messages of JSON describe themselves.
pub(super) struct JsonSchema;

/// The columns of a topic.
struct Plan {
    columns: Vec<String>,
    root: Node,
}

/// Where a value goes.
#[derive(Debug)]
enum Node {
    Cell(usize),
    /// Nanoseconds of seconds and nanoseconds.
    Time(usize),
    Object(Vec<(String, Node)>),
    Array(Vec<Node>),
}

impl Schema for JsonSchema {
    fn learn(&self, message: &[u8], place: Range<usize>) -> Result<Box<dyn Decoder>, String> {
        let bytes = message.get(place).unwrap_or_default();
        let first: Value = serde_json::from_slice(bytes).map_err(|error| format!("its first message is not JSON: {error}"))?;
        let mut columns: Vec<String> = STAMPS.map(str::to_owned).into();
        let root = Node::of(&first, String::new(), &mut columns);
        Ok(Box::new(Plan { columns, root }))
    }

    fn split(&self, _list: &str) -> Result<Box<dyn Split>, String> {
        Err("lists in messages of JSON are not split".to_owned())
    }
}

impl Node {
    fn of(value: &Value, name: String, columns: &mut Vec<String>) -> Self {
        match value {
            Value::Object(fields) if fields.len() == 2 && fields.contains_key("sec") && fields.contains_key("nsec") => {
                columns.push(name);
                Self::Time(columns.len() - 1)
            }
            Value::Object(fields) => {
                let dot = if name.is_empty() { "" } else { "." };
                let fields = fields.iter().map(|(key, value)| {
                    let inner = Self::of(value, format!("{name}{dot}{key}"), columns);
                    (key.clone(), inner)
                });
                Self::Object(fields.collect())
            }
            Value::Array(elements) if elements.len() <= LONGEST_ARRAY => {
                let elements = elements.iter().enumerate();
                Self::Array(
                    elements
                        .map(|(k, value)| Self::of(value, format!("{name}[{k}]"), columns))
                        .collect(),
                )
            }
            Value::Array(_) => Self::Array(Vec::new()),
            _ => {
                columns.push(name);
                Self::Cell(columns.len() - 1)
            }
        }
    }
}

impl Decoder for Plan {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn decode(&mut self, message: &[u8], place: Range<usize>, usual: i64, log_time: i64, cells: &mut Cells) -> Result<(), String> {
        cells.integer(usual);
        cells.integer(log_time);
        cells.blanks(self.columns.len() - STAMPS.len());
        let mut json = serde_json::Deserializer::from_slice(message.get(place).unwrap_or_default());
        let root = Into { node: &self.root, cells };
        root.deserialize(&mut json)
            .map_err(|error| format!("this message cannot be read: {error}"))
    }
}

/// Writes one value into its cells.
struct Into<'a> {
    node: &'a Node,
    cells: &'a mut Cells,
}

impl Into<'_> {
    fn cell(&mut self, add: impl FnOnce(&mut Cells)) {
        if let Node::Cell(column) = self.node {
            add(self.cells);
            self.cells.move_last(*column);
        }
    }
}

impl<'de> DeserializeSeed<'de> for Into<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Into<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value of JSON")
    }

    fn visit_bool<E: Error>(mut self, is_true: bool) -> Result<(), E> {
        self.cell(|cells| cells.integer(is_true.into()));
        Ok(())
    }

    fn visit_i64<E: Error>(mut self, number: i64) -> Result<(), E> {
        self.cell(|cells| cells.integer(number));
        Ok(())
    }

    fn visit_u64<E: Error>(mut self, number: u64) -> Result<(), E> {
        self.cell(|cells| cells.unsigned(number));
        Ok(())
    }

    fn visit_f64<E: Error>(mut self, number: f64) -> Result<(), E> {
        self.cell(|cells| cells.number(number));
        Ok(())
    }

    fn visit_str<E: Error>(mut self, text: &str) -> Result<(), E> {
        self.cell(|cells| cells.text(text.as_bytes()));
        Ok(())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<(), A::Error> {
        if let Node::Array(elements) = self.node {
            for node in elements {
                let cells = &mut *self.cells;
                if all.next_element_seed(Into { node, cells })?.is_none() {
                    return Ok(());
                }
            }
        }
        while all.next_element::<IgnoredAny>()?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut all: A) -> Result<(), A::Error> {
        if let Node::Time(column) = self.node {
            let mut sum = 0_i64;
            while let Some(key) = all.next_key_seed(Key(&["sec", "nsec"]))? {
                match key {
                    Some(k) => sum = sum.saturating_add(all.next_value::<i64>()?.saturating_mul([1_000_000_000, 1][k])),
                    None => drop(all.next_value::<IgnoredAny>()?),
                }
            }
            self.cells.integer(sum);
            self.cells.move_last(*column);
            return Ok(());
        }
        let fields: &[(String, Node)] = if let Node::Object(fields) = self.node { fields } else { &[] };
        while let Some(key) = all.next_key_seed(Key(fields))? {
            match key {
                Some(k) => {
                    let cells = &mut *self.cells;
                    all.next_value_seed(Into { node: &fields[k].1, cells })?;
                }
                None => drop(all.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
}

/// Finds the number of a key.
struct Key<'a, T>(&'a [T]);

/// Has a key.
trait Keyed {
    fn key(&self) -> &str;
}

impl Keyed for (String, Node) {
    fn key(&self) -> &str {
        &self.0
    }
}

impl Keyed for &str {
    fn key(&self) -> &str {
        self
    }
}

impl<'de, T: Keyed> DeserializeSeed<'de> for Key<'_, T> {
    type Value = Option<usize>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<T: Keyed> Visitor<'_> for Key<'_, T> {
    type Value = Option<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        Ok(self.0.iter().position(|known| known.key() == text))
    }
}
