//! Converts text with runs of blanks between fields into text with one blank between fields.

use crate::source::file::BUFFER;
use std::io::{self, Read};

/// Drops the blanks before and after fields, and keeps one blank between fields; tabs count as blanks. Line ends
/// and blanks within quotation marks stay.
#[derive(Debug)]
pub(super) struct Blanks<R> {
    inner: R,
    chunk: Vec<u8>,
    /// The converted chunk; `passed` bytes of it have been passed on.
    ready: Vec<u8>,
    passed: usize,
    state: Line,
}

/// The state within a line.
#[derive(Debug, Default)]
struct Line {
    has_fields: bool,
    /// Blanks came after the last byte of a field.
    is_between: bool,
    is_quoted: bool,
}

impl<R> Blanks<R> {
    pub(super) fn new(inner: R) -> Self {
        Self {
            inner,
            chunk: vec![0; BUFFER],
            ready: Vec::with_capacity(BUFFER),
            passed: 0,
            state: Line::default(),
        }
    }
}

impl Line {
    fn squeeze(&mut self, byte: u8, out: &mut Vec<u8>) {
        match byte {
            b' ' | b'\t' if !self.is_quoted => {
                self.is_between = true;
                return;
            }
            b'\n' | b'\r' => {
                *self = Self::default();
                out.push(byte);
                return;
            }
            b'"' => self.is_quoted = !self.is_quoted,
            _ => {}
        }
        if self.is_between && self.has_fields {
            out.push(b' ');
        }
        (self.is_between, self.has_fields) = (false, true);
        out.push(byte);
    }
}

impl<R: Read> Read for Blanks<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.passed == self.ready.len() {
            let read = self.inner.read(&mut self.chunk)?;
            if read == 0 {
                return Ok(0);
            }
            self.passed = 0;
            self.ready.clear();
            for byte in self.chunk.iter().take(read) {
                self.state.squeeze(*byte, &mut self.ready);
            }
        }
        let rest = self.ready.get(self.passed..).unwrap_or_default();
        let read = rest.len().min(out.len());
        for (out, byte) in out.iter_mut().zip(rest) {
            *out = *byte;
        }
        self.passed += read;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that gives a few bytes at a time.
    struct Drip<'a>(&'a [u8], usize);

    impl Read for Drip<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let length = out.len().min(self.1);
            self.0.read(out.get_mut(..length).unwrap_or_default())
        }
    }

    #[test]
    fn runs_of_blanks_become_one_wherever_a_read_ends() {
        let text = "  t   v\t w  \r\n1 \t 2 \"a  b\"\n\n \t\n3  4   5";
        for bytes in [1, 2, 3, 1000] {
            let mut squeezed = String::new();
            Blanks::new(Drip(text.as_bytes(), bytes)).read_to_string(&mut squeezed).unwrap();
            assert_eq!(squeezed, "t v w\r\n1 2 \"a  b\"\n\n\n3 4 5", "{bytes} at a time");
        }
    }
}
