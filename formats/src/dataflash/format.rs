//! The format of a message, as a message `FMT` defines it.

use crate::messages::Cells;

/// A type of one letter.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Letter {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
    /// A whole number of this many parts of one: hundredths, or 1e-7 deg.
    Parts(Whole, f64),
    Text(usize),
    /// 32 numbers of 16 bits.
    Array,
}

/// The whole number behind parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whole {
    I16,
    U16,
    I32,
    U32,
}

/// Numbers of an array.
const ARRAY: usize = 32;

impl Letter {
    fn of(letter: u8) -> Option<Self> {
        Some(match letter {
            b'b' | b'M' => Self::I8,
            b'B' => Self::U8,
            b'h' => Self::I16,
            b'H' => Self::U16,
            b'i' => Self::I32,
            b'I' => Self::U32,
            b'q' => Self::I64,
            b'Q' => Self::U64,
            b'g' => Self::F16,
            b'f' => Self::F32,
            b'd' => Self::F64,
            b'c' => Self::Parts(Whole::I16, 1e2),
            b'C' => Self::Parts(Whole::U16, 1e2),
            b'e' => Self::Parts(Whole::I32, 1e2),
            b'E' => Self::Parts(Whole::U32, 1e2),
            b'L' => Self::Parts(Whole::I32, 1e7),
            b'n' => Self::Text(4),
            b'N' => Self::Text(16),
            b'Z' => Self::Text(64),
            b'a' => Self::Array,
            _ => return None,
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 | Self::Parts(Whole::I16 | Whole::U16, _) => 2,
            Self::I32 | Self::U32 | Self::F32 | Self::Parts(Whole::I32 | Whole::U32, _) => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Text(length) => length,
            Self::Array => 2 * ARRAY,
        }
    }
}

/// The format of a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Format {
    pub(super) name: String,
    /// Bytes of a message with its header.
    pub(super) length: usize,
    fields: Vec<Field>,
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq)]
struct Field {
    name: String,
    /// Its place after the header.
    at: usize,
    letter: Letter,
}

impl Format {
    /// The format of the messages that define formats.
    pub(super) fn of_formats() -> Self {
        let fields = [("Type", 0, Letter::U8), ("Length", 1, Letter::U8), ("Name", 2, Letter::Text(4))];
        let texts = [("Format", 6, Letter::Text(16)), ("Columns", 22, Letter::Text(64))];
        Self {
            name: "FMT".to_owned(),
            length: 89,
            fields: fields
                .into_iter()
                .chain(texts)
                .map(|(name, at, letter)| Field {
                    name: name.to_owned(),
                    at,
                    letter,
                })
                .collect(),
        }
    }

    /// The type that a message `FMT` defines, and its format; `None` if it contradicts itself.
    pub(super) fn defined(content: &[u8]) -> Option<(u8, Self)> {
        let text = |range: core::ops::Range<usize>| core::str::from_utf8(text(content.get(range)?)).ok();
        let (kind, length) = (*content.first()?, usize::from(*content.get(1)?));
        let (name, letters, columns) = (text(2..6)?, text(6..22)?, text(22..86)?);
        let mut at = 0;
        let mut fields = Vec::new();
        let mut names = columns.split(',');
        for letter in letters.bytes() {
            let letter = Letter::of(letter)?;
            fields.push(Field {
                name: names.next().filter(|name| !name.is_empty())?.trim().to_owned(),
                at,
                letter,
            });
            at += letter.size();
        }
        let is_sound = !name.is_empty() && at + super::HEADER <= length;
        is_sound.then(|| {
            let name = name.to_owned();
            (kind, Self { name, length, fields })
        })
    }

    /// The columns, the stamp first.
    pub(super) fn columns(&self) -> Vec<String> {
        self.ordered()
            .flat_map(|(_, field)| match field.letter {
                Letter::Array => (0..ARRAY).map(|k| format!("{}[{k}]", field.name)).collect(),
                _ => vec![field.name.clone()],
            })
            .collect()
    }

    /// The number of the field of each column.
    pub(super) fn fields_of_columns(&self) -> Vec<usize> {
        let count = |field: &Field| if field.letter == Letter::Array { ARRAY } else { 1 };
        self.ordered()
            .flat_map(|(k, field)| core::iter::repeat_n(k, count(field)))
            .collect()
    }

    /// The fields with their numbers, the stamp first.
    fn ordered(&self) -> impl Iterator<Item = (usize, &Field)> {
        let is_stamp = |(_, field): &(usize, &Field)| field.name == super::STAMP;
        let all = || self.fields.iter().enumerate();
        all().filter(is_stamp).chain(all().filter(move |field| !is_stamp(field)))
    }

    /// Whether a field is stored with its own divisor.
    pub(super) fn has_divisor(&self, field: usize) -> bool {
        matches!(self.fields[field].letter, Letter::Parts(..))
    }

    /// The number of a field.
    pub(super) fn field(&self, name: &str) -> Option<usize> {
        self.fields.iter().position(|field| field.name == name)
    }

    /// The text of a field.
    pub(super) fn text<'a>(&self, field: usize, content: &'a [u8]) -> Option<&'a str> {
        let Field { at, letter, .. } = self.fields.get(field)?;
        core::str::from_utf8(text(content.get(*at..at + letter.size())?)).ok()
    }

    /// The bytes of a field.
    pub(super) fn bytes<'a>(&self, field: usize, content: &'a [u8]) -> Option<&'a [u8]> {
        let Field { at, letter, .. } = self.fields.get(field)?;
        content.get(*at..at + letter.size())
    }

    /// Adds the cells of a message.
    pub(super) fn decode(&self, content: &[u8], cells: &mut Cells) {
        for (_, Field { at, letter, .. }) in self.ordered() {
            match content.get(*at..at + letter.size()) {
                Some(bytes) => add(*letter, bytes, cells),
                None => return,
            }
        }
    }
}

/// The bytes before the first zero.
fn text(bytes: &[u8]) -> &[u8] {
    bytes.split(|byte| *byte == 0).next().unwrap_or_default()
}

/// The bytes of a number; they have its length.
fn of<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().unwrap_or([0; N])
}

fn add(letter: Letter, bytes: &[u8], cells: &mut Cells) {
    match letter {
        Letter::I8 => cells.integer(i8::from_le_bytes(of(bytes)).into()),
        Letter::U8 => cells.integer(bytes[0].into()),
        Letter::I16 => cells.integer(i16::from_le_bytes(of(bytes)).into()),
        Letter::U16 => cells.integer(u16::from_le_bytes(of(bytes)).into()),
        Letter::I32 => cells.integer(i32::from_le_bytes(of(bytes)).into()),
        Letter::U32 => cells.integer(u32::from_le_bytes(of(bytes)).into()),
        Letter::I64 => cells.integer(i64::from_le_bytes(of(bytes))),
        Letter::U64 => cells.unsigned(u64::from_le_bytes(of(bytes))),
        Letter::F16 => cells.number(half(u16::from_le_bytes(of(bytes)))),
        Letter::F32 => cells.number(f32::from_le_bytes(of(bytes)).into()),
        Letter::F64 => cells.number(f64::from_le_bytes(of(bytes))),
        Letter::Parts(whole, parts) => cells.number(whole.of(bytes) / parts),
        Letter::Text(_) => cells.text(text(bytes)),
        Letter::Array => bytes
            .chunks_exact(2)
            .for_each(|pair| cells.integer(i16::from_le_bytes(of(pair)).into())),
    }
}

impl Whole {
    fn of(self, bytes: &[u8]) -> f64 {
        match self {
            Self::I16 => i16::from_le_bytes(of(bytes)).into(),
            Self::U16 => u16::from_le_bytes(of(bytes)).into(),
            Self::I32 => i32::from_le_bytes(of(bytes)).into(),
            Self::U32 => u32::from_le_bytes(of(bytes)).into(),
        }
    }
}

/// A number of IEEE 754 with 16 bits: one bit of sign, 5 of the exponent, 10 of the fraction.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * fusion::core::math::powi(2.0, -24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * fusion::core::math::powi(2.0, exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}
