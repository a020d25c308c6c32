//! Empties lines that are not rows: comments, and lines before a header.

use crate::source::file::BUFFER;
use std::io::{self, Read};

/// Passes on all line ends, so that lines keep their numbers, and the text of the lines that are not dropped. Dropped
/// lines are the first few lines and the lines that begin with a mark.
#[derive(Debug)]
pub(super) struct Dropped<R> {
    inner: R,
    chunk: Vec<u8>,
    /// The converted chunk; `passed` bytes of it have been passed on.
    ready: Vec<u8>,
    passed: usize,
    /// The mark of comments; empty if there are no comments.
    mark: Vec<u8>,
    drops: Drops,
    line: Line,
}

/// The lines dropped in addition to comments: the first `before` lines, then, after one kept line, `after` lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Drops {
    pub(super) before: usize,
    pub(super) after: usize,
}

impl Drops {
    pub(super) const fn first(before: usize) -> Self {
        Self { before, after: 0 }
    }
}

/// The state of the line that is being read.
#[derive(Clone, Copy, Debug)]
enum Line {
    /// This number of its bytes match the mark.
    Begun(usize),
    /// The line is empty so far, except for a carriage return.
    Blank,
    Kept,
    Dropped,
}

impl<R> Dropped<R> {
    /// Drops these lines, and those that begin with `mark`, if it is not empty.
    pub(super) fn new(inner: R, mark: &str, drops: Drops) -> Self {
        let mut dropped = Self {
            inner,
            chunk: vec![0; BUFFER],
            ready: Vec::with_capacity(BUFFER),
            passed: 0,
            mark: mark.as_bytes().to_vec(),
            drops,
            line: Line::Kept,
        };
        dropped.line = dropped.first();
        dropped
    }

    /// The state of a line before its first byte.
    const fn first(&self) -> Line {
        match (self.drops.before, self.mark.is_empty()) {
            (0, true) => Line::Blank,
            (0, false) => Line::Begun(0),
            _ => Line::Dropped,
        }
    }

    fn take(&mut self, byte: u8) {
        if let Line::Begun(matched) = self.line {
            if self.mark[matched] == byte {
                let matched = matched + 1;
                self.line = if matched == self.mark.len() {
                    Line::Dropped
                } else {
                    Line::Begun(matched)
                };
                return;
            }
            self.keep(matched);
        }
        if byte == b'\n' {
            match self.line {
                // This was the kept line; the lines to drop after it follow.
                Line::Kept if self.drops.before == 0 => self.drops = Drops::first(self.drops.after),
                _ => self.drops.before = self.drops.before.saturating_sub(1),
            }
            self.line = self.first();
            self.ready.push(byte);
        } else if !matches!(self.line, Line::Dropped) {
            if byte != b'\r' {
                self.line = Line::Kept;
            }
            self.ready.push(byte);
        }
    }

    /// Keeps the line, with the bytes that matched the mark.
    fn keep(&mut self, matched: usize) {
        self.ready.extend_from_slice(&self.mark[..matched]);
        self.line = if matched == 0 { Line::Blank } else { Line::Kept };
    }
}

impl<R: Read> Read for Dropped<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.passed == self.ready.len() {
            self.ready.clear();
            self.passed = 0;
            let mut chunk = core::mem::take(&mut self.chunk);
            let read = self.inner.read(&mut chunk);
            for byte in chunk.iter().take(*read.as_ref().unwrap_or(&0)) {
                self.take(*byte);
            }
            self.chunk = chunk;
            if read? == 0 {
                // The last line may end within a mark.
                if let Line::Begun(matched) = self.line {
                    self.keep(matched);
                }
                if self.ready.is_empty() {
                    return Ok(0);
                }
            }
        }
        let rest = &self.ready[self.passed..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.passed += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(text: &str, mark: &str, before: usize) -> String {
        left_of(text, mark, Drops::first(before))
    }

    fn left_of(text: &str, mark: &str, drops: Drops) -> String {
        let mut dropped = Dropped::new(text.as_bytes(), mark, drops);
        let (mut left, mut bytes) = (Vec::new(), [0; 3]);
        loop {
            let read = dropped.read(&mut bytes).unwrap();
            if read == 0 {
                return String::from_utf8(left).unwrap();
            }
            left.extend_from_slice(&bytes[..read]);
        }
    }

    #[test]
    fn lines_are_made_empty_and_keep_their_numbers() {
        assert_eq!(left("// a\nt,v\n//\n1,/2\n/3\n/", "//", 0), "\nt,v\n\n1,/2\n/3\n/");
        assert_eq!(left("\"a\n// b\nt\n1\n// c", "//", 2), "\n\nt\n1\n");
        assert_eq!(left("a\nb\nc", "", 1), "\nb\nc");
        assert_eq!(left("a\nb", "", 5), "\n");
        assert_eq!(left("é1\né\n", "é1", 0), "\né\n");
    }

    #[test]
    fn lines_below_that_of_the_names_are_dropped_whatever_they_hold() {
        let drops = Drops { before: 1, after: 2 };
        assert_eq!(
            left_of("x\n\r\n# c\nt,v\ns,\"m\n\n1,2\n3,4\n", "#", drops),
            "\n\r\n\nt,v\n\n\n1,2\n3,4\n"
        );
    }
}
