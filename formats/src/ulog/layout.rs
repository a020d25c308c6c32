//! The formats of a log, flattened to the numbers of a message.

use crate::messages::{Cells, LONGEST_ARRAY};
use std::collections::HashMap;

/// Deepest nesting of formats. The messages of PX4 nest three times.
const DEEPEST: usize = 8;
/// Bytes of the longest message: its length is a number of 16 bits.
const LONGEST: usize = u16::MAX as usize;

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
    /// A text of this number of bytes.
    Text(usize),
}

impl Scalar {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Self::I8,
            "uint8_t" => Self::U8,
            "int16_t" => Self::I16,
            "uint16_t" => Self::U16,
            "int32_t" => Self::I32,
            "uint32_t" => Self::U32,
            "int64_t" => Self::I64,
            "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            "bool" => Self::Bool,
            "char" => Self::Text(1),
            _ => return None,
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Bool => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Text(length) => length,
        }
    }
}

/// The fields of each format, as its definition has them: `float[3] gyro_rad`.
#[derive(Debug, Default)]
pub(super) struct Formats(HashMap<String, String>);

impl Formats {
    /// Adds a definition: `NAME:TYPE FIELD;TYPE FIELD;`.
    pub(super) fn define(&mut self, definition: &str) -> Option<()> {
        let (name, fields) = definition.split_once(':')?;
        self.0.insert(name.to_owned(), fields.to_owned());
        Some(())
    }

    /// The numbers of a message of this format.
    pub(super) fn layout(&self, format: &str) -> Result<Layout, String> {
        let mut found = Flattened::default();
        self.flatten(format, "", DEEPEST, &mut found)?;
        let Flattened {
            mut columns, size, last, ..
        } = found;
        // The first column has the stamps.
        if let Some(stamp) = columns.iter().position(|(name, ..)| name == "timestamp") {
            columns[..=stamp].rotate_right(1);
        }
        Ok(Layout {
            cells: columns.iter().map(|(_, offset, scalar)| (*offset, *scalar)).collect(),
            names: columns.into_iter().map(|(name, ..)| name).collect(),
            shortest: last,
            longest: size,
        })
    }

    fn flatten(&self, format: &str, prefix: &str, depth: usize, to: &mut Flattened) -> Result<(), String> {
        let fields = self.0.get(format).ok_or_else(|| format!("no format `{format}` is defined"))?;
        if depth == 0 {
            return Err(format!("the format `{format}` is nested too deeply"));
        }
        for field in fields.split(';').filter(|field| !field.is_empty()) {
            let wrong = || format!("`{field}` is no field of a format");
            let (of, name) = field.trim().split_once(' ').ok_or_else(wrong)?;
            let (of, count) = match of.split_once('[') {
                None => (of, None),
                Some((of, count)) => (of, Some(count.trim_end_matches(']').parse::<usize>().map_err(|_| wrong())?)),
            };
            let scalar = match (Scalar::of(of), count) {
                (Some(Scalar::Text(_)), Some(length)) => {
                    to.add(format!("{prefix}{name}"), Scalar::Text(length))?;
                    continue;
                }
                (scalar, _) => scalar,
            };
            if let (Some(scalar), true) = (
                scalar,
                name.starts_with("_padding") || count.is_some_and(|count| count > LONGEST_ARRAY),
            ) {
                to.pass(scalar.size().saturating_mul(count.unwrap_or(1)), name.starts_with("_padding"))?;
                continue;
            }
            for k in 0..count.unwrap_or(1) {
                let name = match count {
                    None => format!("{prefix}{name}"),
                    Some(_) => format!("{prefix}{name}[{k}]"),
                };
                match scalar {
                    Some(scalar) => to.add(name, scalar)?,
                    None => self.flatten(of, &format!("{name}."), depth - 1, to)?,
                }
            }
        }
        Ok(())
    }
}

/// The numbers of a message so far.
#[derive(Default)]
struct Flattened {
    columns: Vec<(String, usize, Scalar)>,
    size: usize,
    /// Its size without padding at its end.
    last: usize,
    /// Fields and parts seen so far.
    steps: usize,
}

impl Flattened {
    fn add(&mut self, name: String, scalar: Scalar) -> Result<(), String> {
        self.columns.push((name, self.size, scalar));
        self.pass(scalar.size(), false)
    }

    /// Passes over bytes.
    fn pass(&mut self, size: usize, is_padding: bool) -> Result<(), String> {
        self.size = self.size.saturating_add(size);
        self.steps += 1;
        if !is_padding {
            self.last = self.size;
        }
        if self.size > LONGEST || self.steps > LONGEST {
            return Err("its format is longer than any message".to_owned());
        }
        Ok(())
    }
}

/// The numbers of a message.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) names: Vec<String>,
    /// Their places after the number of the message.
    cells: Vec<(usize, Scalar)>,
    /// Bytes without and with the padding at the end.
    shortest: usize,
    longest: usize,
}

impl Layout {
    /// Whether a message may have this length.
    pub(super) fn is_length(&self, length: usize) -> bool {
        (self.shortest..=self.longest).contains(&length)
    }

    /// Adds the cells of a message.
    pub(super) fn decode(&self, bytes: &[u8], cells: &mut Cells) {
        for (offset, scalar) in &self.cells {
            let Some(bytes) = bytes.get(*offset..offset + scalar.size()) else {
                return;
            };
            add(*scalar, bytes, cells);
        }
    }
}

fn add(scalar: Scalar, bytes: &[u8], cells: &mut Cells) {
    /// The bytes of a number; they have its length.
    fn of<const N: usize>(bytes: &[u8]) -> [u8; N] {
        bytes.try_into().unwrap_or([0; N])
    }
    match scalar {
        Scalar::I8 => cells.integer(i8::from_le_bytes(of(bytes)).into()),
        Scalar::U8 | Scalar::Bool => cells.integer(bytes[0].into()),
        Scalar::I16 => cells.integer(i16::from_le_bytes(of(bytes)).into()),
        Scalar::U16 => cells.integer(u16::from_le_bytes(of(bytes)).into()),
        Scalar::I32 => cells.integer(i32::from_le_bytes(of(bytes)).into()),
        Scalar::U32 => cells.integer(u32::from_le_bytes(of(bytes)).into()),
        Scalar::I64 => cells.integer(i64::from_le_bytes(of(bytes))),
        Scalar::U64 => cells.unsigned(u64::from_le_bytes(of(bytes))),
        Scalar::F32 => cells.number(f32::from_le_bytes(of(bytes)).into()),
        Scalar::F64 => cells.number(f64::from_le_bytes(of(bytes))),
        Scalar::Text(_) => cells.text(bytes.split(|byte| *byte == 0).next().unwrap_or_default()),
    }
}
