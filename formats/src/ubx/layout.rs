//! The fields of messages, from the table `messages.txt`.
//!
//! ```text
//! NAME CLASS+ID field …          a line that begins with blanks continues the one before it
//! lon:I4*1e-7[deg]               name, type and bytes, scale, unit
//! +lon:I1*1e-9                   a part that is added to a field before it
//! X1(fixOk:1,3,carrSoln:2)       bits from the lowest one; a number without a name is reserved
//! _4                             reserved bytes
//! ```

use super::clock::STAMP;
use crate::messages::Cells;

const TABLE: &str = include_str!("messages.txt");

/// The fields of a message.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) name: &'static str,
    pub(super) columns: Vec<String>,
    units: Vec<Option<&'static str>>,
    fields: Vec<Field>,
    length: usize,
}

/// The value of a column.
#[derive(Clone, Debug)]
struct Field {
    main: Part,
    /// Digits that are added.
    fine: Option<Part>,
}

/// A number in a message.
#[derive(Clone, Copy, Debug)]
struct Part {
    at: usize,
    size: usize,
    form: Form,
    /// As the table writes it: 1 for whole numbers.
    scale: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Signed,
    Unsigned,
    Real,
    /// Bits from this one on, this many.
    Bits(usize, usize),
}

/// All messages, with their class and their number.
pub(super) fn all() -> Vec<([u8; 2], Layout)> {
    let mut lines: Vec<(&'static str, Vec<&'static str>)> = Vec::new();
    for line in TABLE.lines() {
        let mut words = line.split_whitespace();
        match (line.starts_with(' '), lines.last_mut()) {
            (true, Some((_, fields))) => fields.extend(words),
            _ => lines.extend(words.next().map(|name| (name, words.collect()))),
        }
    }
    lines.into_iter().filter_map(|(name, fields)| layout(name, &fields)).collect()
}

/// One message; `None` if the table is wrong, which a test excludes.
fn layout(name: &'static str, words: &[&'static str]) -> Option<([u8; 2], Layout)> {
    let (id, words) = words.split_first()?;
    let id = u16::from_str_radix(id, 16).ok()?.to_be_bytes();
    let mut layout = Layout {
        name,
        columns: vec![STAMP.to_owned()],
        units: vec![None],
        fields: Vec::new(),
        length: 0,
    };
    for word in words {
        layout.add(word)?;
    }
    Some((id, layout))
}

impl Layout {
    fn add(&mut self, word: &'static str) -> Option<()> {
        let at = self.length;
        if let Some(reserved) = word.strip_prefix('_') {
            self.length += reserved.parse::<usize>().ok()?;
            return Some(());
        }
        if let Some((size, bits)) = word.strip_prefix('X').and_then(|word| word.split_once('(')) {
            let size: usize = size.parse().ok()?;
            self.length += size;
            let mut from = 0;
            for bit in bits.strip_suffix(')')?.split(',') {
                let (name, count) = bit.split_once(':').map_or((None, bit), |(name, count)| (Some(name), count));
                let count: usize = count.parse().ok()?;
                if let Some(name) = name {
                    let form = Form::Bits(from, count);
                    let scale = 1.0;
                    self.column(name, None, Part { at, size, form, scale });
                }
                from += count;
            }
            return Some(());
        }
        let (name, rest) = word.split_once(':')?;
        let (rest, unit) = rest
            .split_once('[')
            .map_or((rest, None), |(rest, unit)| (rest, unit.strip_suffix(']')));
        let (form, scale) = rest.split_once('*').unwrap_or((rest, "1"));
        let (letter, size) = form.split_at_checked(1)?;
        let form = match letter {
            "I" => Form::Signed,
            "U" => Form::Unsigned,
            "R" => Form::Real,
            _ => return None,
        };
        let (size, scale) = (size.parse().ok()?, scale.parse().ok()?);
        self.length += size;
        let part = Part { at, size, form, scale };
        match name.strip_prefix('+') {
            None => self.column(name, unit, part),
            Some(name) => {
                let of = self.columns.iter().position(|column| column == name)?;
                self.fields.get_mut(of.checked_sub(1)?)?.fine = Some(part);
            }
        }
        Some(())
    }

    fn column(&mut self, name: &str, unit: Option<&'static str>, main: Part) {
        self.columns.push(name.to_owned());
        self.units.push(unit);
        self.fields.push(Field { main, fine: None });
    }

    /// Bytes of a message with all fields.
    pub(super) const fn length(&self) -> usize {
        self.length
    }

    /// A column with its unit.
    pub(super) fn label(&self, column: usize) -> Option<String> {
        let unit = (*self.units.get(column)?)?;
        let name = match self.columns[column].as_str() {
            // With its vertical part, it is not the speed of an odometer.
            "speed" => "speed_total",
            name => name,
        };
        Some(format!("{name} [{unit}]"))
    }

    /// A whole number of a message.
    pub(super) fn whole(&self, name: &str, content: &[u8]) -> Option<i64> {
        let column = self.columns.iter().position(|column| column == name)?;
        self.fields.get(column.checked_sub(1)?)?.main.whole(content)
    }

    /// Adds the cells of a message after its stamp. Older receivers do not have the last fields.
    pub(super) fn decode(&self, content: &[u8], cells: &mut Cells) {
        for Field { main, fine } in &self.fields {
            if main.form == Form::Real {
                match main.real(content) {
                    Some(real) => cells.number(real),
                    None => return,
                }
                continue;
            }
            let Some(whole) = main.whole(content) else { return };
            let fine = fine.and_then(|part| Some(part.scaled(part.whole(content)?)));
            match fine {
                None if main.scale == 1.0 => cells.integer(whole),
                _ => cells.number(main.scaled(whole) + fine.unwrap_or(0.0)),
            }
        }
    }
}

impl Part {
    fn bytes<'a>(&self, content: &'a [u8]) -> Option<&'a [u8]> {
        content.get(self.at..self.at + self.size)
    }

    fn whole(&self, content: &[u8]) -> Option<i64> {
        let bytes = self.bytes(content)?;
        let raw = bytes.iter().rev().fold(0_i64, |sum, byte| sum << 8 | i64::from(*byte));
        Some(match self.form {
            Form::Bits(from, count) => raw >> from & ((1 << count) - 1),
            Form::Signed => {
                let unused = 64 - 8 * self.size;
                raw << unused >> unused
            }
            _ => raw,
        })
    }

    fn real(&self, content: &[u8]) -> Option<f64> {
        match *self.bytes(content)? {
            [a, b, c, d] => Some(f32::from_le_bytes([a, b, c, d]).into()),
            _ => None,
        }
    }

    /// Divided by a whole number, a decimal fraction is exact to the last digit.
    fn scaled(&self, whole: i64) -> f64 {
        let parts = fusion::core::math::round(1.0 / self.scale);
        whole as f64 / parts
    }
}
