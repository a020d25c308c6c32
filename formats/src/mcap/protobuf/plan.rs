//! How the fields of a message become cells: learnt once from the descriptors and the first message.

use super::descriptors::{Descriptors, Field, Kind, Scalar};
use super::wire::{Content, DAMAGED, Wire};
use crate::messages::{Cells, LONGEST_ARRAY};
use crate::stamped::{Decoder, STAMPS};
use core::ops::Range;
use std::sync::Arc;

/// Message types may be nested this deep.
const DEEPEST: usize = 16;
/// A message has at most this number of columns: that of the longest usual message of ROS, eight times.
const MOST_COLUMNS: usize = 1 << 16;

/// The messages of a topic, or the elements of a list.
pub(super) struct Plan {
    columns: Vec<String>,
    root: Node,
    /// Elements so far, of each list in the current message.
    counts: Vec<usize>,
}

/// The fields of a message, in the order of their numbers.
#[derive(Debug, Default)]
struct Node {
    fields: Vec<(u32, Target)>,
    /// The columns of values that a message without them has nevertheless.
    defaults: Vec<(usize, Leaf)>,
}

/// Where the values of a field go.
#[derive(Debug)]
enum Target {
    Cell(usize, Leaf),
    Message(Node),
    /// Nanoseconds of a time or duration.
    Time(usize),
    /// The elements of a list, and its number.
    List {
        elements: Vec<Target>,
        number: usize,
        packed: Option<Leaf>,
    },
}

/// A value with one cell.
#[derive(Clone, Debug)]
enum Leaf {
    Scalar(Scalar),
    Enumeration(Arc<Vec<(i32, String)>>),
}

impl Plan {
    /// Learns the columns of a type from its first message, or from the element at this place of a message.
    pub(super) fn learn(descriptors: &Descriptors, name: &str, message: &[u8], place: Range<usize>) -> Result<Self, String> {
        let message = message.get(place).ok_or(DAMAGED)?;
        let mut learner = Learner {
            descriptors,
            columns: STAMPS.map(str::to_owned).into(),
            lists: 0,
            path: Vec::new(),
        };
        let root = learner.message(name, "", Some(message))?;
        Ok(Self {
            columns: learner.columns,
            root,
            counts: vec![0; learner.lists],
        })
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
        self.counts.fill(0);
        let message = message.get(place).ok_or(DAMAGED)?;
        self.root.read(message, cells, &mut self.counts).ok_or(DAMAGED)?;
        Ok(())
    }
}

impl Node {
    fn read(&self, message: &[u8], cells: &mut Cells, counts: &mut [usize]) -> Option<()> {
        for (column, leaf) in &self.defaults {
            leaf.set_default(*column, cells);
        }
        let mut wire = Wire::new(message);
        // Fields usually come in the order of their numbers.
        let mut next = 0;
        while !wire.is_empty() {
            let (number, content) = wire.field()?;
            let is_next = |at: &usize| self.fields.get(*at).is_some_and(|(known, _)| *known == number);
            let at = [next, next + 1].into_iter().find(is_next);
            let Some(at) = at.or_else(|| self.fields.binary_search_by_key(&number, |(known, _)| *known).ok()) else {
                continue;
            };
            next = at;
            self.fields[at].1.read(content, cells, counts)?;
        }
        Some(())
    }
}

impl Target {
    fn read(&self, content: Content<'_>, cells: &mut Cells, counts: &mut [usize]) -> Option<()> {
        match (self, content) {
            (Self::Cell(column, leaf), content) => leaf.set(content, *column, cells)?,
            (Self::Message(node), Content::Bytes(inner)) => node.read(inner, cells, counts)?,
            (Self::Time(column), Content::Bytes(inner)) => {
                cells.integer(nanoseconds(inner)?);
                cells.move_last(*column);
            }
            (
                Self::List {
                    elements,
                    number,
                    packed: Some(leaf),
                },
                Content::Bytes(all),
            ) => {
                let mut wire = Wire::new(all);
                while !wire.is_empty() {
                    let content = leaf.unpack(&mut wire)?;
                    element(elements, *number, content, cells, counts)?;
                }
            }
            (Self::List { elements, number, .. }, content) => element(elements, *number, content, cells, counts)?,
            _ => return None,
        }
        Some(())
    }
}

/// Reads the next element of a list, if it has cells.
fn element(elements: &[Target], number: usize, content: Content<'_>, cells: &mut Cells, counts: &mut [usize]) -> Option<()> {
    let k = counts[number];
    counts[number] += 1;
    elements.get(k).map_or(Some(()), |element| element.read(content, cells, counts))
}

/// A `google.protobuf.Timestamp` or `Duration`.
fn nanoseconds(message: &[u8]) -> Option<i64> {
    let mut wire = Wire::new(message);
    let mut sum = 0_i64;
    while !wire.is_empty() {
        match wire.field()? {
            (1, Content::Varint(seconds)) => sum = sum.checked_add((seconds as i64).checked_mul(1_000_000_000)?)?,
            (2, Content::Varint(rest)) => sum = sum.checked_add(rest as i64)?,
            _ => {}
        }
    }
    Some(sum)
}

impl Leaf {
    fn set(&self, content: Content<'_>, column: usize, cells: &mut Cells) -> Option<()> {
        match (self, content) {
            (Self::Scalar(Scalar::Double), Content::Eight(bits)) => cells.number(f64::from_bits(bits)),
            (Self::Scalar(Scalar::Float), Content::Four(bits)) => cells.number(f32::from_bits(bits).into()),
            (Self::Scalar(Scalar::Text), Content::Bytes(text)) => cells.text(text),
            (Self::Scalar(Scalar::Int64), Content::Varint(bits)) => cells.integer(bits as i64),
            (Self::Scalar(Scalar::Uint64), Content::Varint(bits)) => cells.unsigned(bits),
            (Self::Scalar(Scalar::Int32), Content::Varint(bits)) => cells.integer((bits as i32).into()),
            (Self::Scalar(Scalar::Uint32), Content::Varint(bits)) => cells.integer((bits as u32).into()),
            (Self::Scalar(Scalar::Zigzag), Content::Varint(bits)) => cells.integer((bits >> 1) as i64 ^ -((bits & 1) as i64)),
            (Self::Scalar(Scalar::Fixed64), Content::Eight(bits)) => cells.unsigned(bits),
            (Self::Scalar(Scalar::Sfixed64), Content::Eight(bits)) => cells.integer(bits as i64),
            (Self::Scalar(Scalar::Fixed32), Content::Four(bits)) => cells.integer(bits.into()),
            (Self::Scalar(Scalar::Sfixed32), Content::Four(bits)) => cells.integer((bits as i32).into()),
            (Self::Enumeration(names), Content::Varint(bits)) => {
                let number = bits as i32;
                match names.binary_search_by_key(&number, |(known, _)| *known) {
                    Ok(at) => cells.text(names[at].1.as_bytes()),
                    Err(_) => cells.integer(number.into()),
                }
            }
            _ => return None,
        }
        cells.move_last(column);
        Some(())
    }

    fn set_default(&self, column: usize, cells: &mut Cells) {
        let mut zeros = Wire::new(&[0; 8]);
        // An empty text is an empty cell.
        if let (false, Some(zero)) = (matches!(self, Self::Scalar(Scalar::Text)), self.unpack(&mut zeros)) {
            let _ = self.set(zero, column, cells);
        }
    }

    /// The next value of a packed list.
    fn unpack<'a>(&self, wire: &mut Wire<'a>) -> Option<Content<'a>> {
        use Scalar::{Double, Fixed32, Fixed64, Float, Sfixed32, Sfixed64};
        Some(match self {
            Self::Scalar(Double | Fixed64 | Sfixed64) => Content::Eight(wire.eight()?),
            Self::Scalar(Float | Fixed32 | Sfixed32) => Content::Four(wire.four()?),
            _ => Content::Varint(wire.varint()?),
        })
    }
}

/// Makes the columns of a type.
struct Learner<'a> {
    descriptors: &'a Descriptors,
    columns: Vec<String>,
    lists: usize,
    /// The types around the current one.
    path: Vec<String>,
}

impl Learner<'_> {
    /// The fields of a message; `bytes` is the first one, if it is known.
    fn message(&mut self, name: &str, prefix: &str, bytes: Option<&[u8]>) -> Result<Node, String> {
        let descriptors = self.descriptors;
        let fields = descriptors.fields(name).ok_or_else(|| format!("`{name}` is not described"))?;
        if self.path.len() == DEEPEST {
            return Err("its types are nested too deep".to_owned());
        }
        self.path.push(name.to_owned());
        let mut node = Node::default();
        for field in fields {
            let name = format!("{prefix}{}", field.name);
            let target = if field.is_repeated {
                self.list(field, &name, bytes)?
            } else {
                let inner = bytes.map(|bytes| contents(bytes, field.number)).unwrap_or_default().pop();
                self.single(field, &name, inner, !field.has_presence, &mut node.defaults)?
            };
            node.fields.extend(target.map(|target| (field.number, target)));
        }
        node.fields.sort_by_key(|(number, _)| *number);
        self.path.pop();
        if self.columns.len() > MOST_COLUMNS {
            return Err(format!("its type has more than {MOST_COLUMNS} values"));
        }
        Ok(node)
    }

    fn single(
        &mut self,
        field: &Field,
        name: &str,
        inner: Option<Content<'_>>,
        has_default: bool,
        defaults: &mut Vec<(usize, Leaf)>,
    ) -> Result<Option<Target>, String> {
        let column = self.columns.len();
        let leaf = match &field.kind {
            Kind::Unread => return Ok(None),
            Kind::Message(of) if of == "google.protobuf.Timestamp" || of == "google.protobuf.Duration" => {
                self.columns.push(name.to_owned());
                return Ok(Some(Target::Time(column)));
            }
            Kind::Message(of) => {
                let inner = match inner {
                    Some(Content::Bytes(inner)) => Some(inner),
                    // A type that contains itself ends where the first message ends.
                    _ if self.path.contains(of) => return Ok(None),
                    _ => None,
                };
                return Ok(Some(Target::Message(self.message(of, &format!("{name}."), inner)?)));
            }
            Kind::Scalar(scalar) => Leaf::Scalar(*scalar),
            Kind::Enumeration(names) => Leaf::Enumeration(Arc::clone(names)),
        };
        self.columns.push(name.to_owned());
        if has_default {
            defaults.push((column, leaf.clone()));
        }
        Ok(Some(Target::Cell(column, leaf)))
    }

    fn list(&mut self, field: &Field, name: &str, bytes: Option<&[u8]>) -> Result<Option<Target>, String> {
        let mut found = bytes.map(|bytes| contents(bytes, field.number)).unwrap_or_default();
        let packed = match &field.kind {
            Kind::Scalar(Scalar::Text) | Kind::Message(_) | Kind::Unread => None,
            Kind::Scalar(scalar) => Some(Leaf::Scalar(*scalar)),
            Kind::Enumeration(names) => Some(Leaf::Enumeration(Arc::clone(names))),
        };
        if let Some(leaf) = &packed {
            found = unpacked(&found, leaf).ok_or(DAMAGED)?;
        }
        let number = self.lists;
        self.lists += 1;
        let mut elements = Vec::new();
        if found.len() <= LONGEST_ARRAY {
            for (k, content) in found.into_iter().enumerate() {
                elements.extend(self.single(field, &format!("{name}[{k}]"), Some(content), false, &mut Vec::new())?);
            }
        }
        Ok(Some(Target::List { elements, number, packed }))
    }
}

/// The values of a list of numbers, some of them packed.
fn unpacked<'a>(found: &[Content<'a>], leaf: &Leaf) -> Option<Vec<Content<'a>>> {
    let mut all = Vec::new();
    for content in found {
        let Content::Bytes(packed) = content else {
            all.push(*content);
            continue;
        };
        let mut wire = Wire::new(packed);
        while !wire.is_empty() {
            all.push(leaf.unpack(&mut wire)?);
        }
    }
    Some(all)
}

/// The contents of a field; those before a damage.
fn contents(message: &[u8], number: u32) -> Vec<Content<'_>> {
    let mut wire = Wire::new(message);
    let mut found = Vec::new();
    while !wire.is_empty() {
        match wire.field() {
            Some((known, content)) if known == number => found.push(content),
            Some(_) => {}
            None => break,
        }
    }
    found
}
