//! A table of text, written cell by cell.

use core::fmt::Display;
use std::io::{self, Write};

/// Writes rows of as many cells as the first has; a cell that would break its row is quoted.
#[derive(Debug)]
pub(crate) struct Cells<W: Write> {
    out: csv::Writer<W>,
    /// The cell being made.
    cell: Vec<u8>,
}

impl<W: Write> Cells<W> {
    pub(crate) fn new(out: W) -> Self {
        Self {
            out: csv::Writer::from_writer(out),
            cell: Vec::with_capacity(32),
        }
    }

    /// A cell as it is formatted: `format_args!("{x:.3}")`, a name.
    pub(crate) fn put(&mut self, content: impl Display) -> io::Result<()> {
        self.cell.clear();
        write!(self.cell, "{content}")?;
        Ok(self.out.write_field(&self.cell)?)
    }

    /// A cell of text.
    pub(crate) fn text(&mut self, text: &str) -> io::Result<()> {
        Ok(self.out.write_field(text)?)
    }

    /// A cell where there may be nothing to say.
    pub(crate) fn maybe(&mut self, content: Option<impl Display>) -> io::Result<()> {
        match content {
            Some(content) => self.put(content),
            None => self.text(""),
        }
    }

    /// Cells of text.
    pub(crate) fn texts<'a>(&mut self, texts: impl IntoIterator<Item = &'a str>) -> io::Result<()> {
        texts.into_iter().try_for_each(|text| self.text(text))
    }

    /// Ends the row.
    pub(crate) fn end(&mut self) -> io::Result<()> {
        Ok(self.out.write_record(None::<&[u8]>)?)
    }

    /// Writes what is held back.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// What is written to; what is held back is not there yet.
    pub(crate) fn sink(&self) -> &W {
        self.out.get_ref()
    }

    /// Writes what is held back, and returns what was written to.
    pub(crate) fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        self.out.into_inner().map_err(|error| io::Error::other(error.to_string()))
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
        cells.flush().unwrap();
        drop(cells);
        let expected = "t_s,\"roof, left\",\"an \"\"odd\"\" name\"\n1.234e3,,-7\n";
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
