//! The types of messages, from the table `messages.txt` and from the dialects of other crates.
//!
//! ```text
//! ID NAME field …        a line that begins with blanks continues the one before it
//! lat:I4[degE7]          name, type and bytes, unit: I signed, U unsigned, R real, C text
//! q:R4x4                 an array of this length
//! +                      the fields after it are extensions
//! ```
//!
//! A frame has the fields with the most bytes first, and the extensions last, as they are declared. The seed of the
//! checksum is made of the names and types, so that both ends of a link agree on them.
//!
//! Source    `messages.py` makes the table of the dialects `ardupilotmega` and `common` of pymavlink 2.4.50

use super::frame::{checksum, crc};
use crate::messages::Cells;
use fusion::core::math;
use std::collections::BTreeMap;
use std::sync::OnceLock;

const TABLE: &str = include_str!("messages.txt");
/// Bytes of the longest content of a frame.
const LONGEST: usize = 255;

/// Further message types, declared as the lines of `messages.txt` are. A type with the number of a known one replaces
/// it.
///
/// ```
/// use fusion_formats::mavlink::{Dialect, Message};
///
/// fusion::inventory::submit! { Dialect("12345 DEPTH time_boot_ms:U4[ms] depth:R4[m] + sigma:R4[m]") }
///
/// assert!(Message::named("DEPTH").is_some());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dialect(pub &'static str);

fusion::inventory::collect!(Dialect);

/// A type of messages.
#[derive(Clone, Debug)]
pub struct Message {
    /// Its number.
    pub id: u32,
    /// Its name, such as `HIGHRES_IMU`.
    pub name: &'static str,
    pub(super) fields: Vec<Field>,
    /// Bytes of its content.
    pub(super) length: usize,
    /// The byte that its checksum ends with, `CRC_EXTRA`.
    pub(super) seed: u8,
}

/// A field of a message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    pub(super) name: &'static str,
    pub(super) unit: Option<&'static str>,
    pub(super) form: Form,
    /// The elements of an array.
    pub(super) count: Option<usize>,
    /// Where it begins in the content.
    at: usize,
}

/// The type of a number, with its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Signed(usize),
    Unsigned(usize),
    Real(usize),
    /// A text of this length; an array of texts does not exist.
    Text,
}

/// All types by number.
///
/// # Errors
/// The line of a dialect that cannot be read.
pub(super) fn all() -> Result<&'static BTreeMap<u32, Message>, String> {
    static ALL: OnceLock<Result<BTreeMap<u32, Message>, String>> = OnceLock::new();
    let read = || {
        let further = fusion::inventory::iter::<Dialect>.into_iter().map(|dialect| dialect.0);
        let mut all = BTreeMap::new();
        for table in core::iter::once(TABLE).chain(further) {
            for words in lines(table) {
                let wrong = || format!("the definition of a MAVLink message `{}` cannot be read", words.join(" "));
                let message = Message::read(&words).ok_or_else(wrong)?;
                all.insert(message.id, message);
            }
        }
        Ok(all)
    };
    ALL.get_or_init(read).as_ref().map_err(String::clone)
}

/// The words of each definition.
fn lines(table: &'static str) -> Vec<Vec<&'static str>> {
    let mut lines: Vec<Vec<&'static str>> = Vec::new();
    for line in table.lines() {
        let words = line.split_whitespace();
        match lines.last_mut().filter(|_| line.starts_with(' ')) {
            Some(last) => last.extend(words),
            None => lines.push(words.collect()),
        }
    }
    lines.retain(|words| !words.is_empty());
    lines
}

impl Message {
    /// The type with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        all().ok()?.values().find(|message| message.name == name)
    }

    fn read(words: &[&'static str]) -> Option<Self> {
        let (&[id, name], words) = words.split_first_chunk()?;
        let base = words.iter().position(|word| *word == "+").unwrap_or(words.len());
        let fields = words.iter().filter(|word| **word != "+").map(|word| Field::read(word));
        let mut fields: Vec<Field> = fields.collect::<Option<_>>()?;
        let mut order: Vec<usize> = (0..fields.len()).collect();
        order[..base].sort_by_key(|k| core::cmp::Reverse(fields[*k].form.size()));
        let mut length = 0;
        for k in &order {
            fields[*k].at = length;
            length += fields[*k].size();
        }
        let mut sum = crc(format!("{name} ").as_bytes());
        for field in order[..base].iter().map(|k| &fields[*k]) {
            sum.add(format!("{} {} ", field.form.name(), field.name).as_bytes());
            // An array has at most 255 elements: see the length below.
            sum.add(field.count.map(|count| count as u8).as_slice());
        }
        let [low, high] = sum.bytes();
        let id = id.parse().ok().filter(|id| *id < 1 << 24)?;
        (length <= LONGEST).then_some(Self {
            id,
            name,
            fields,
            length,
            seed: low ^ high,
        })
    }

    /// A whole number of a message.
    pub(super) fn whole(&self, field: usize, content: &[u8]) -> u64 {
        self.fields[field].bits(content, 0)
    }

    /// A frame of MAVLink 2 with these fields; the others are zero. Numbers of whole fields are rounded, and those out
    /// of range are the nearest possible ones.
    ///
    /// # Errors
    /// The message has no such field, or fewer elements.
    pub fn frame(&self, from: &Sender, fields: &[(&str, &[f64])]) -> Result<Vec<u8>, String> {
        let mut content = vec![0; self.length];
        for (name, values) in fields {
            let field = self.fields.iter().find(|field| field.name == *name);
            let field = field.filter(|field| values.len() <= field.count.unwrap_or(1));
            let field = field.ok_or_else(|| format!("`{}` has no field `{name}` of {} numbers", self.name, values.len()))?;
            for (k, value) in values.iter().enumerate() {
                field.put(&mut content, k, *value);
            }
        }
        // Zeros at the end are left out, but the first byte stays.
        let used = content.iter().rposition(|byte| *byte != 0).unwrap_or(0) + 1;
        content.truncate(used);
        let [low, middle, high, _] = self.id.to_le_bytes();
        let head = [
            super::frame::V2,
            content.len() as u8,
            0,
            0,
            from.sequence,
            from.system,
            from.component,
        ];
        let mut frame = [&head[..], &[low, middle, high], &content].concat();
        let sum = checksum(&frame, self.seed);
        frame.extend(sum);
        Ok(frame)
    }
}

/// The sender of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender {
    /// The number of its system.
    pub system: u8,
    /// The number of its component.
    pub component: u8,
    /// Counts the frames of this sender.
    pub sequence: u8,
}

impl Field {
    fn read(word: &'static str) -> Option<Self> {
        let (name, rest) = word.split_once(':')?;
        let (rest, unit) = match rest.split_once('[') {
            Some((rest, unit)) => (rest, Some(unit.strip_suffix(']')?)),
            None => (rest, None),
        };
        let (form, count) = match rest.split_once('x') {
            Some((form, count)) => (form, Some(count.parse().ok().filter(|count| *count <= LONGEST)?)),
            None => (rest, None),
        };
        Some(Self {
            name,
            unit,
            form: Form::read(form)?,
            count,
            at: 0,
        })
    }

    fn size(&self) -> usize {
        self.form.size() * self.count.unwrap_or(1)
    }

    /// The bits of an element. Zeros at the end of a content may be left out.
    fn bits(&self, content: &[u8], element: usize) -> u64 {
        let size = self.form.size();
        let from = self.at + element * size;
        let bytes = (from..from + size).rev().map(|k| content.get(k).copied().unwrap_or(0));
        bytes.fold(0, |bits, byte| bits << 8 | u64::from(byte))
    }

    /// Adds the cell of an element, or of a text.
    pub(super) fn decode(&self, content: &[u8], element: usize, cells: &mut Cells) {
        let bits = self.bits(content, element);
        match self.form {
            Form::Unsigned(_) => cells.unsigned(bits),
            Form::Signed(size) => {
                let unused = 64 - 8 * size;
                cells.integer((bits << unused) as i64 >> unused);
            }
            Form::Real(4) => cells.number(f32::from_bits(bits as u32).into()),
            Form::Real(_) => cells.number(f64::from_bits(bits)),
            Form::Text => {
                let text = content.get(self.at..).unwrap_or_default();
                let text = &text[..text.len().min(self.size())];
                cells.text(text.split(|byte| *byte == 0).next().unwrap_or_default());
            }
        }
    }

    /// Writes an element.
    fn put(&self, content: &mut [u8], element: usize, value: f64) {
        let whole = math::round(value);
        // A conversion to a whole number ends at the bounds of its type.
        let bits = match self.form {
            Form::Real(4) => u64::from((value as f32).to_bits()),
            Form::Real(_) => value.to_bits(),
            Form::Signed(1) => i64::from(whole as i8) as u64,
            Form::Signed(2) => i64::from(whole as i16) as u64,
            Form::Signed(4) => i64::from(whole as i32) as u64,
            Form::Signed(_) => whole as i64 as u64,
            Form::Unsigned(1) | Form::Text => u64::from(whole as u8),
            Form::Unsigned(2) => u64::from(whole as u16),
            Form::Unsigned(4) => u64::from(whole as u32),
            Form::Unsigned(_) => whole as u64,
        };
        let size = self.form.size();
        let from = self.at + element * size;
        content[from..from + size].copy_from_slice(&bits.to_le_bytes()[..size]);
    }
}

impl Form {
    fn read(word: &str) -> Option<Self> {
        let (letter, size) = word.split_at_checked(1)?;
        let size: Option<usize> = size.parse().ok();
        match (letter, size) {
            ("C", None) => Some(Self::Text),
            ("I", Some(size @ (1 | 2 | 4 | 8))) => Some(Self::Signed(size)),
            ("U", Some(size @ (1 | 2 | 4 | 8))) => Some(Self::Unsigned(size)),
            ("R", Some(size @ (4 | 8))) => Some(Self::Real(size)),
            _ => None,
        }
    }

    /// Bytes of an element.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Real(size) => size,
            Self::Text => 1,
        }
    }

    /// Its name in C, of which the seed is made.
    fn name(self) -> String {
        match self {
            Self::Signed(size) => format!("int{}_t", 8 * size),
            Self::Unsigned(size) => format!("uint{}_t", 8 * size),
            Self::Real(4) => "float".to_owned(),
            Self::Real(_) => "double".to_owned(),
            Self::Text => "char".to_owned(),
        }
    }
}
