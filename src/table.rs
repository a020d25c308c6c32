//! Aligned columns of at most [`WIDTH`] characters, and numbers as people read them.

use fusion_core::filter::Backend;
use std::fmt;

/// Characters in a line at most.
pub const WIDTH: usize = 100;
/// Between two columns.
const GAP: &str = "  ";
/// A last column narrower than this is not worth wrapping.
const NARROW: usize = 24;
/// Where the text of such a column begins, on lines of its own.
const BELOW: usize = 8;

/// On which side a column's cells end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

/// Rows of cells under a header; the last column is wrapped where a line would exceed [`WIDTH`].
#[derive(Clone, Debug)]
pub struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// With these columns; `>` before a title aligns its cells to the right.
    #[must_use]
    pub fn new(titles: &[&str]) -> Self {
        let column = |title: &&str| match title.strip_prefix('>') {
            Some(title) => (title.to_owned(), Align::Right),
            None => ((*title).to_owned(), Align::Left),
        };
        Self {
            columns: titles.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; cells that are missing are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.columns.len(), String::new());
        self.rows.push(cells);
    }

    /// Whether it has no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn widths(&self) -> Vec<usize> {
        let width = |k: usize| {
            self.rows
                .iter()
                .map(|r| length(&r[k]))
                .chain([length(&self.columns[k].0)])
                .max()
                .unwrap_or(0)
        };
        (0..self.columns.len()).map(width).collect()
    }

    fn line(&self, f: &mut fmt::Formatter<'_>, cells: &[String], widths: &[usize]) -> fmt::Result {
        let (Some(last), Some((_, align))) = (cells.last(), self.columns.last()) else {
            return Ok(());
        };
        let mut line = String::new();
        for ((cell, width), (_, align)) in cells.iter().zip(widths).zip(&self.columns).take(cells.len() - 1) {
            line.push_str(GAP);
            line.push_str(&padded(cell, *width, *align));
        }
        let before = length(&line) + GAP.len();
        if *align == Align::Right {
            line.push_str(GAP);
            line.push_str(&padded(last, widths[cells.len() - 1], *align));
            return writeln!(f, "{}", line.trim_end());
        }
        let room = WIDTH.saturating_sub(before);
        // A column that has become too narrow to read goes below the others.
        let is_below = room < NARROW && length(last) > room;
        let (hang, room) = if is_below { (BELOW, WIDTH - BELOW) } else { (before, room) };
        if is_below {
            writeln!(f, "{}", line.trim_end())?;
        }
        for (k, part) in wrapped(last, room).iter().enumerate() {
            let start = if k == 0 && !is_below {
                format!("{line}{GAP}")
            } else {
                " ".repeat(hang)
            };
            writeln!(f, "{}", format!("{start}{part}").trim_end())?;
        }
        Ok(())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let titles: Vec<String> = self.columns.iter().map(|(title, _)| title.clone()).collect();
        if titles.iter().any(|t| !t.is_empty()) {
            self.line(f, &titles, &widths)?;
        }
        self.rows.iter().try_for_each(|row| self.line(f, row, &widths))
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

fn padded(cell: &str, width: usize, align: Align) -> String {
    match align {
        Align::Left => format!("{cell:<width$}"),
        Align::Right => format!("{cell:>width$}"),
    }
}

/// `text` in lines of at most `width` characters, broken at blanks; its own line breaks are kept.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for paragraph in text.split('\n') {
        let mut line: String = paragraph.chars().take_while(|c| *c == ' ').collect();
        let indent = line.len();
        for word in paragraph.split_whitespace() {
            if length(&line) > indent {
                if length(&line) + 1 + length(word) > width {
                    lines.push(core::mem::replace(&mut line, " ".repeat(indent)));
                } else {
                    line.push(' ');
                }
            }
            line.push_str(word);
        }
        lines.push(line);
    }
    lines
}

/// Four significant digits.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-3..1e6).contains(&size) {
        fixed(value, decimals(size))
    } else {
        format!("{value:.3e}")
    }
}

pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    // Adding zero takes the sign off a negative one.
    let rounded = format!("{:.decimals$}", value + 0.0);
    if rounded.trim_matches(['-', '0', '.']).is_empty() {
        rounded.trim_start_matches('-').to_owned()
    } else {
        rounded
    }
}

/// Decimals that give a number of this size four significant digits.
pub(crate) fn decimals(size: f64) -> usize {
    if size > 0.0 && size.is_finite() {
        (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        0
    }
}

/// Equal numbers as one, others as a list.
#[must_use]
pub fn numbers(values: &[f64]) -> String {
    match values {
        [] => String::new(),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => short(*first),
        _ => values.iter().map(|v| short(*v)).collect::<Vec<_>>().join(", "),
    }
}

/// Four significant digits at most, without trailing zeros.
#[must_use]
pub fn short(value: f64) -> String {
    let text = number(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The factor and the unit in which people read something counted in `unit`: degrees for radians,
/// pascals by their name.
#[must_use]
pub fn readable(unit: &str) -> (f64, String) {
    match unit.strip_prefix("rad") {
        Some(rest) => (1_f64.to_degrees(), format!("deg{rest}")),
        None if unit == "kg/m/s^2" => (1.0, "Pa".to_owned()),
        None => (1.0, unit.to_owned()),
    }
}

/// The backend in the words of TOML: `body / single / joseph`.
#[must_use]
pub fn backend_name(backend: &Backend) -> String {
    let words = [
        format!("{:?}", backend.chart),
        format!("{:?}", backend.update),
        format!("{:?}", backend.form),
    ];
    words.map(|word| snake(&word)).join(" / ")
}

fn snake(word: &str) -> String {
    let mut out = String::new();
    for c in word.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// A count, or an empty cell where it is not known.
pub(crate) fn count_cell(count: Option<u64>) -> String {
    count.map_or_else(String::new, |n| n.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_the_last_one_is_wrapped() {
        let mut t = Table::new(&["name", ">rows", "note"]);
        t.row(["imu", "12000", "σ"]);
        t.row(["gnss", "9", &"word ".repeat(20)]);
        let line = "word ".repeat(17);
        let expected = format!(
            "  name   rows  note\n  imu   12000  σ\n  gnss      9  {}\n               word word word\n",
            line.trim_end()
        );
        assert_eq!(t.to_string(), expected);
        assert!(t.to_string().lines().all(|l| l.chars().count() <= WIDTH));
    }

    #[test]
    fn a_column_too_narrow_to_read_goes_below() {
        let mut t = Table::new(&["", ""]);
        t.row(["a".repeat(80), "b ".repeat(15)]);
        assert_eq!(
            t.to_string(),
            format!("  {}\n        {}\n", "a".repeat(80), "b ".repeat(15).trim_end())
        );
    }

    #[test]
    fn numbers_keep_four_digits() {
        let cases = [
            (0.0, "0"),
            (-0.000_000_1, "-1.000e-7"),
            (12.3456, "12.35"),
            (-0.012_345, "-0.01235"),
            (98765.4, "98765"),
            (1.5e6, "1.500e6"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(
            (fixed(-0.0001, 2).as_str(), short(2.5).as_str(), numbers(&[2.0; 3]).as_str()),
            ("0.00", "2.5", "2")
        );
    }

    #[test]
    fn angles_are_read_in_degrees() {
        assert_eq!(readable("rad/s").1, "deg/s");
        assert_eq!(readable("m"), (1.0, "m".to_owned()));
    }

    #[test]
    fn a_backend_is_spelt_as_in_toml() {
        assert_eq!(backend_name(&Backend::EKF), "additive_euler / single / joseph");
    }
}
