//! How the cells of a message are read: learnt once from the definition and the first message.

use super::cursor::{Cursor, Encoding, Short};
use super::definition::{Array, Definitions, Field, Kind, Number};
use super::program::Program;
use crate::messages::{Cells, LONGEST_ARRAY};
use crate::stamped::STAMPS;
use core::ops::Range;

/// Message types may be nested this deep. No message of ROS comes near.
const DEEPEST: usize = 16;
/// A plan has at most this number of steps. The longest usual message, a list of 64 states with 64 values, has 8 256.
const MOST_STEPS: usize = 1 << 16;
/// The type whose stamp is that of a message.
const HEADER: &str = "std_msgs/Header";

/// Reads one value, or an array, of a message.
#[derive(Clone, Debug)]
pub(super) enum Step {
    Number(Number),
    Time {
        is_duration: bool,
    },
    Text,
    /// A byte that CDR has in a message without fields.
    Filler,
    Numbers {
        of: Number,
        count: Array,
        shown: usize,
    },
    /// The steps of the elements with cells, and of any other element.
    Elements {
        count: Array,
        shown: Vec<Vec<Step>>,
        further: Vec<Step>,
    },
}

/// How a message, or an element of its list, becomes cells.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    encoding: Encoding,
    steps: Vec<Step>,
    columns: Vec<String>,
    /// The column of the stamp in the header.
    stamp: Option<usize>,
    /// The columns with cells, in order.
    selected: Vec<usize>,
    /// Reads these columns.
    program: Program,
}

impl Plan {
    /// Learns the columns of a type from its first message, or from the element at this place of a message.
    ///
    /// # Errors
    /// The message does not fit the definition.
    pub(crate) fn learn(definitions: &Definitions, name: &str, encoding: Encoding, message: &[u8], place: usize) -> Result<Self, String> {
        let mut cursor = Cursor::new(message, encoding)?;
        cursor.go_to(place);
        let mut learner = Learner {
            definitions,
            encoding,
            columns: STAMPS.map(str::to_owned).into(),
            left: MOST_STEPS,
        };
        let mut steps = Vec::new();
        learner.message(name, "", Some(&mut cursor), DEEPEST, &mut steps)?;
        let fields = definitions.fields(name).unwrap_or_default();
        let header = fields
            .iter()
            .find(|field| is_header(field))
            .map(|field| format!("{}.stamp", field.name));
        let columns = learner.columns;
        Ok(Self {
            encoding,
            stamp: header.and_then(|header| columns.iter().position(|column| *column == header)),
            program: Program::new(&steps, cursor.widest, || true),
            selected: (0..columns.len()).collect(),
            columns,
            steps,
        })
    }

    /// Selects the columns with cells: these, the stamps, and the stamp of the header. Returns them in order.
    pub(crate) fn select(&mut self, columns: &[usize]) -> &[usize] {
        let is_selected = |column: &usize| *column < STAMPS.len() || self.stamp == Some(*column) || columns.contains(column);
        self.selected = (0..self.columns.len()).filter(is_selected).collect();
        self.compile(self.program.widest);
        &self.selected
    }

    /// Makes the program for the selected columns.
    fn compile(&mut self, widest: usize) {
        let mut fields = STAMPS.len()..;
        let is_selected = || fields.next().is_some_and(|column| self.selected.binary_search(&column).is_ok());
        self.program = Program::new(&self.steps, widest, is_selected);
    }

    pub(crate) fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Adds the selected cells of a message, or of the element at this place of a message. `usual` is its stamp if it
    /// has no header.
    ///
    /// # Errors
    /// The message is too short.
    pub(crate) fn decode(&mut self, message: &[u8], place: usize, usual: i64, log_time: i64, cells: &mut Cells) -> Result<(), String> {
        let mut cursor = Cursor::new(message, self.encoding)?;
        cursor.go_to(place);
        if cursor.widest != self.program.widest {
            self.compile(cursor.widest);
        }
        cells.integer(usual);
        cells.integer(log_time);
        self.program.run(&mut cursor, cells).map_err(|Short| too_short(message))?;
        if let Some(stamp) = self.stamp_cell() {
            cells.copy(stamp, 0);
        }
        Ok(())
    }

    /// The place of the stamp of the header among the cells.
    fn stamp_cell(&self) -> Option<usize> {
        self.selected.binary_search(&self.stamp?).ok()
    }
}

fn too_short(message: &[u8]) -> String {
    format!("this message of {} bytes is shorter than its type", message.len())
}

fn is_header(field: &Field) -> bool {
    field.array == Array::One && field.kind == Kind::Message(HEADER.to_owned())
}

/// The elements of a list in a message, each of which becomes a row.
#[derive(Clone, Debug)]
pub(crate) struct Elements {
    encoding: Encoding,
    /// The type of an element.
    pub(crate) name: String,
    before: Vec<Step>,
    count: Array,
    each: Vec<Step>,
    /// Whether the message begins with a header.
    has_header: bool,
}

impl Elements {
    /// The list of messages with this name: `transforms`, or `a.b` if it is nested.
    ///
    /// # Errors
    /// There is no such list in the type.
    pub(crate) fn find(definitions: &Definitions, name: &str, list: &str, encoding: Encoding) -> Result<Self, String> {
        let mut learner = Learner {
            definitions,
            encoding,
            columns: Vec::new(),
            left: MOST_STEPS,
        };
        let (mut before, mut owner) = (Vec::new(), name);
        let mut path = list.split('.').peekable();
        while let Some(wanted) = path.next() {
            let fields = definitions.fields(owner).unwrap_or_default();
            let at = fields.iter().position(|field| field.name == wanted);
            let at = at.ok_or_else(|| format!("`{owner}` has no field `{wanted}`"))?;
            for field in &fields[..at] {
                learner.field(field, "", None, DEEPEST, &mut before)?;
            }
            match (&fields[at], path.peek()) {
                (
                    Field {
                        kind: Kind::Message(inner),
                        array: Array::One,
                        ..
                    },
                    Some(_),
                ) => owner = inner,
                (
                    Field {
                        kind: Kind::Message(inner),
                        array,
                        ..
                    },
                    None,
                ) if *array != Array::One => {
                    let mut each = Vec::new();
                    learner.message(inner, "", None, DEEPEST, &mut each)?;
                    return Ok(Self {
                        encoding,
                        name: inner.clone(),
                        before,
                        count: *array,
                        each,
                        has_header: definitions.fields(name).and_then(<[_]>::first).is_some_and(is_header),
                    });
                }
                _ => break,
            }
        }
        Err(format!("`{list}` is no list of messages"))
    }

    /// Writes the places of the elements of a message, and returns the stamp of its header, if it has one.
    ///
    /// # Errors
    /// The message is too short.
    pub(crate) fn places(&self, message: &[u8], places: &mut Vec<Range<usize>>) -> Result<Option<i64>, String> {
        places.clear();
        let mut cursor = Cursor::new(message, self.encoding)?;
        let stamp = self.stamp(&mut cursor);
        cursor.go_to(0);
        let mut read = || {
            skip(&self.before, &mut cursor)?;
            for _ in 0..count(self.count, &mut cursor)? {
                let from = cursor.place();
                skip(&self.each, &mut cursor)?;
                places.push(from..cursor.place());
            }
            Ok(())
        };
        read().map_err(|Short| too_short(message))?;
        Ok(stamp)
    }

    fn stamp(&self, cursor: &mut Cursor<'_>) -> Option<i64> {
        if !self.has_header {
            return None;
        }
        if self.encoding == Encoding::Ros1 {
            // The number of the message.
            cursor.skip(4).ok()?;
        }
        cursor.nanoseconds(false).ok()
    }
}

/// Makes the steps of a type. Without a message they make no cells.
struct Learner<'a> {
    definitions: &'a Definitions,
    encoding: Encoding,
    columns: Vec<String>,
    /// Steps that may still be made.
    left: usize,
}

impl Learner<'_> {
    fn message(
        &mut self,
        name: &str,
        prefix: &str,
        mut cursor: Option<&mut Cursor<'_>>,
        depth: usize,
        steps: &mut Vec<Step>,
    ) -> Result<(), String> {
        let definitions = self.definitions;
        let fields = definitions.fields(name).ok_or_else(|| format!("`{name}` is not defined"))?;
        let depth = depth.checked_sub(1).ok_or("its types are nested too deep")?;
        if fields.is_empty() && self.encoding == Encoding::Cdr {
            return self.single(Step::Filler, "", cursor, steps);
        }
        for field in fields {
            self.field(field, prefix, cursor.as_deref_mut(), depth, steps)?;
        }
        Ok(())
    }

    fn field(
        &mut self,
        field: &Field,
        prefix: &str,
        mut cursor: Option<&mut Cursor<'_>>,
        depth: usize,
        steps: &mut Vec<Step>,
    ) -> Result<(), String> {
        let name = format!("{prefix}{}", field.name);
        if field.array == Array::One {
            return self.value(&field.kind, &name, cursor, depth, steps);
        }
        let short = |Short| "its first message is shorter than its type".to_owned();
        let length = match &mut cursor {
            Some(cursor) => count(field.array, cursor).map_err(short)?,
            None => 0,
        };
        let shown = if length > LONGEST_ARRAY { 0 } else { length };
        self.spend(1 + shown)?;
        if let Kind::Number(of) = field.kind {
            if let Some(cursor) = cursor {
                skip_numbers(of, length, cursor).map_err(short)?;
                self.columns.extend((0..shown).map(|k| format!("{name}[{k}]")));
            }
            let count = field.array;
            steps.push(Step::Numbers { of, count, shown });
            return Ok(());
        }
        let (mut further, mut parts) = (Vec::new(), Vec::with_capacity(shown));
        self.value(&field.kind, "", None, depth, &mut further)?;
        if let Some(cursor) = cursor {
            for k in 0..shown {
                let mut steps = Vec::new();
                self.value(&field.kind, &format!("{name}[{k}]"), Some(&mut *cursor), depth, &mut steps)?;
                parts.push(steps);
            }
            for _ in shown..length {
                skip(&further, cursor).map_err(short)?;
            }
        }
        steps.push(Step::Elements {
            count: field.array,
            shown: parts,
            further,
        });
        Ok(())
    }

    fn value(
        &mut self,
        kind: &Kind,
        name: &str,
        cursor: Option<&mut Cursor<'_>>,
        depth: usize,
        steps: &mut Vec<Step>,
    ) -> Result<(), String> {
        let step = match kind {
            Kind::Message(inner) => return self.message(inner, &format!("{name}."), cursor, depth, steps),
            Kind::Number(number) => Step::Number(*number),
            Kind::Time => Step::Time { is_duration: false },
            Kind::Duration => Step::Time { is_duration: true },
            Kind::Text => Step::Text,
        };
        self.single(step, name, cursor, steps)
    }

    fn single(&mut self, step: Step, name: &str, cursor: Option<&mut Cursor<'_>>, steps: &mut Vec<Step>) -> Result<(), String> {
        self.spend(1)?;
        if let Some(cursor) = cursor {
            skip(core::slice::from_ref(&step), cursor).map_err(|Short| "its first message is shorter than its type")?;
            if !matches!(step, Step::Filler) {
                self.columns.push(name.to_owned());
            }
        }
        steps.push(step);
        Ok(())
    }

    fn spend(&mut self, steps: usize) -> Result<(), String> {
        let left = self.left.checked_sub(steps);
        self.left = left.ok_or_else(|| format!("its type has more than {MOST_STEPS} values"))?;
        Ok(())
    }
}

/// The number of elements of an array: at most one for each byte that is left.
pub(super) fn count(array: Array, cursor: &mut Cursor<'_>) -> Result<usize, Short> {
    match array {
        Array::One => Ok(1),
        Array::Fixed(count) if count > cursor.left() => Err(Short),
        Array::Fixed(count) => Ok(count),
        Array::Any => cursor.length(),
    }
}

fn skip_numbers(of: Number, length: usize, cursor: &mut Cursor<'_>) -> Result<(), Short> {
    if length == 0 {
        return Ok(());
    }
    cursor.align(of.size());
    cursor.skip(length * of.size())
}

/// Goes past the values of these steps.
fn skip(steps: &[Step], cursor: &mut Cursor<'_>) -> Result<(), Short> {
    for step in steps {
        match step {
            Step::Number(number) => skip_numbers(*number, 1, cursor)?,
            Step::Time { .. } => skip_numbers(Number::U32, 2, cursor)?,
            Step::Text => cursor.text().map(|_| ())?,
            Step::Filler => cursor.skip(1)?,
            Step::Numbers { of, count: array, .. } => {
                let length = count(*array, cursor)?;
                skip_numbers(*of, length, cursor)?;
            }
            Step::Elements { count: array, further, .. } => {
                for _ in 0..count(*array, cursor)? {
                    skip(further, cursor)?;
                }
            }
        }
    }
    Ok(())
}
