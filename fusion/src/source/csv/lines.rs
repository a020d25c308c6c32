//! Line numbers of a stream of bytes, and a limit to the length of a row.

use std::collections::VecDeque;
use std::io::{self, Read};

/// Passes bytes on and remembers the line ends that the CSV reader behind it has not reached yet.
///
/// The reader of records counts lines too, but gives a record the number of the blank lines and
/// comments before it. A row is held whole, so a row longer than [`LONGEST`] ends the file with an error.
///
/// Memory   eight bytes for each line end of one buffer
#[derive(Debug)]
pub(super) struct Lines<R> {
    inner: R,
    bytes: u64,
    ends: VecDeque<u64>,
    passed: usize,
    /// Where the latest record ended, or the latest blank line after it.
    row: u64,
    /// The position after the last byte that is not part of a line end.
    text: u64,
    /// There are no more bytes.
    has_ended: bool,
}

/// The largest number of bytes of a row, with the comments before it.
pub(super) const LONGEST: u64 = 16 << 20;

impl<R> Lines<R> {
    pub(super) const fn new(inner: R) -> Self {
        Self {
            inner,
            bytes: 0,
            ends: VecDeque::new(),
            passed: 0,
            row: 0,
            text: 0,
            has_ended: false,
        }
    }

    /// Whether the end of the file has been reached.
    pub(super) const fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// The line, from 1, of the byte before the `end`th; asked for in ascending order.
    pub(super) fn line(&mut self, end: u64) -> usize {
        while self.ends.front().is_some_and(|newline| newline + 1 < end) {
            self.ends.pop_front();
            self.passed += 1;
        }
        self.row = end;
        self.passed + 1
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // The reader behind reads more only when its buffer is used up, so the current row ends after this point.
        // It can only ask for the last of the earlier line ends.
        let old = self.ends.len().saturating_sub(1);
        self.ends.drain(..old);
        self.passed += old;
        if self.text <= self.row {
            self.row = self.bytes;
        } else if self.bytes - self.row > LONGEST {
            let message = format!("a row is longer than {} MiB", LONGEST >> 20);
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, message));
        }
        let read = self.inner.read(buffer)?;
        self.has_ended = read == 0;
        let is_text = |byte: &u8| !matches!(byte, b'\n' | b'\r');
        if let Some(last) = buffer.get(..read).unwrap_or_default().iter().rposition(is_text) {
            self.text = self.bytes + last as u64 + 1;
        }
        let ends = memchr::memchr_iter(b'\n', buffer.get(..read).unwrap_or_default());
        self.ends.extend(ends.map(|i| self.bytes + i as u64));
        self.bytes += read as u64;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads all in steps of a buffer, as a reader of records does; the most line ends that were remembered.
    fn drained(lines: &mut Lines<impl Read>) -> io::Result<usize> {
        let (mut buffer, mut most) = (vec![0; 1 << 16], 0);
        while lines.read(&mut buffer)? > 0 {
            most = most.max(lines.ends.len());
        }
        Ok(most)
    }

    #[test]
    fn blank_lines_take_no_memory_and_are_counted() {
        const BLANK: u64 = 1 << 21;
        let text = io::repeat(b'\n').take(BLANK).chain(&b"1,2\n"[..]);
        let mut lines = Lines::new(text);
        assert!(drained(&mut lines).unwrap() <= (1 << 16) + 1);
        assert_eq!(lines.line(BLANK + 4), BLANK as usize + 1);
    }

    #[test]
    fn a_row_without_end_is_refused_and_many_rows_are_not() {
        let error = drained(&mut Lines::new(io::repeat(b'1').take(2 * LONGEST))).unwrap_err();
        assert_eq!(error.to_string(), "a row is longer than 16 MiB");
        // Lines within quotation marks are one row: `line` is not called for its line ends.
        assert!(drained(&mut Lines::new(io::repeat(b'1').take(1).chain(io::repeat(b'\n').take(2 * LONGEST)))).is_err());
        let (mut lines, mut buffer, mut end) = (Lines::new(io::repeat(b'1').take(2 * LONGEST)), [0; 1024], 0);
        loop {
            let read = lines.read(&mut buffer).unwrap();
            end += read as u64;
            lines.line(end);
            if read == 0 {
                break;
            }
        }
        assert_eq!(end, 2 * LONGEST);
    }
}
