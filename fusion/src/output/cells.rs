//! A table of text, written cell by cell.

use super::{Digits, EstimateCells, decimal};
use core::fmt::Display;
use std::io::{self, Write};

/// Text is handed on in pieces of about this size.
const PIECE: usize = 32 << 10;

/// Writes rows with the number of cells of the first row; a cell that would break its row is quoted (RFC 4180).
#[derive(Debug)]
pub struct Cells<W: Write> {
    out: W,
    /// The buffered text: complete rows, and the current row.
    text: Vec<u8>,
    /// Cells of the current row, and of the first row.
    begun: usize,
    width: Option<usize>,
}

impl<W: Write> Cells<W> {
    /// Writes into `out`.
    pub fn new(out: W) -> Self {
        Self {
            out,
            text: Vec::with_capacity(PIECE + PIECE / 8),
            begun: 0,
            width: None,
        }
    }

    /// Begins a cell, and returns the position of its text.
    fn begin(&mut self) -> usize {
        if self.begun > 0 {
            self.text.push(b',');
        }
        self.begun += 1;
        self.text.len()
    }

    /// A cell as it is formatted: `format_args!("{x:.3}")`, a name.
    pub fn put(&mut self, content: impl Display) -> io::Result<()> {
        let start = self.begin();
        write!(self.text, "{content}")?;
        let breaks = |byte: &u8| matches!(byte, b',' | b'"' | b'\n' | b'\r');
        if self.text[start..].iter().any(breaks) {
            let content = self.text.split_off(start);
            self.text.push(b'"');
            for byte in content {
                self.text.extend(core::iter::repeat_n(byte, if byte == b'"' { 2 } else { 1 }));
            }
            self.text.push(b'"');
        }
        Ok(())
    }

    /// A cell of text.
    pub fn text(&mut self, text: &str) -> io::Result<()> {
        self.put(text)
    }

    /// A number with this number of decimals.
    pub(crate) fn fixed(&mut self, number: f64, decimals: usize) {
        self.begin();
        decimal::fixed(&mut self.text, number, decimals);
    }

    /// A number with one digit before the point, this number of decimals, and an exponent of ten.
    pub(crate) fn scientific(&mut self, number: f64, decimals: usize) {
        self.begin();
        decimal::scientific(&mut self.text, number, decimals);
    }

    /// This number of empty cells.
    pub(crate) fn empty(&mut self, cells: usize) {
        (0..cells).for_each(|_| {
            self.begin();
        });
    }

    /// A cell that may be empty.
    pub fn maybe(&mut self, content: Option<impl Display>) -> io::Result<()> {
        match content {
            Some(content) => self.put(content),
            None => self.text(""),
        }
    }

    /// Cells of text.
    pub fn texts<'a>(&mut self, texts: impl IntoIterator<Item = &'a str>) -> io::Result<()> {
        texts.into_iter().try_for_each(|text| self.text(text))
    }

    /// The number of cells of the current row.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.begun
    }

    /// Ends the row.
    pub fn end(&mut self) -> io::Result<()> {
        let cells = core::mem::take(&mut self.begun);
        let width = *self.width.get_or_insert(cells);
        if cells != width {
            return Err(io::Error::other(format!("a row has {cells} cells, the first has {width}")));
        }
        self.text.push(b'\n');
        if self.text.len() >= PIECE {
            self.pass_on()?;
        }
        Ok(())
    }

    /// Hands on the buffered text.
    fn pass_on(&mut self) -> io::Result<()> {
        // Text that could not be written is not tried again.
        let written = self.out.write_all(&self.text);
        self.text.clear();
        written
    }

    /// Writes the buffered text.
    pub fn flush(&mut self) -> io::Result<()> {
        self.pass_on()?;
        self.out.flush()
    }

    /// The writer; it does not have the buffered text yet.
    pub(crate) fn sink(&self) -> &W {
        &self.out
    }

    /// Writes the buffered text, and returns the writer.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        Ok(self.out)
    }
}

impl<W: Write> EstimateCells for Cells<W> {
    fn number(&mut self, value: f64, digits: Digits) {
        self.begin();
        digits.write(value, &mut self.text);
    }

    fn empty(&mut self, cells: usize) {
        Self::empty(self, cells);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_a_comma_stays_one_cell_and_numbers_are_as_formatted() {
        let mut bytes = Vec::new();
        let mut cells = Cells::new(&mut bytes);
        cells.texts(["t_s", "roof, left", "an \"odd\" name"]).unwrap();
        cells.end().unwrap();
        cells.put(format_args!("{:.3e}", 1234.5)).unwrap();
        cells.maybe(None::<f64>).unwrap();
        cells.put(-7).unwrap();
        cells.end().unwrap();
        cells.fixed(0.125, 2);
        cells.scientific(-1234.5, 3);
        cells.empty(1);
        cells.end().unwrap();
        cells.flush().unwrap();
        let expected = "t_s,\"roof, left\",\"an \"\"odd\"\" name\"\n1.234e3,,-7\n0.12,-1.234e3,\n";
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }

    #[test]
    fn a_row_of_another_width_than_the_header_is_an_error() {
        let mut cells = Cells::new(Vec::new());
        cells.texts(["a", "b"]).unwrap();
        cells.end().unwrap();
        cells.put(1).unwrap();
        assert!(cells.end().is_err());
    }
}
