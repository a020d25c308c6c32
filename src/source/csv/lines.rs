//! Line numbers of a stream of bytes.

use std::collections::VecDeque;
use std::io::{self, Read};

/// Passes bytes on and remembers where the lines end that the reader behind has not reached yet.
///
/// The reader of records counts lines too, but gives a record the number of the blank lines and
/// comments before it.
#[derive(Debug)]
pub(super) struct Lines<R> {
    inner: R,
    bytes: u64,
    ends: VecDeque<u64>,
    passed: usize,
}

impl<R> Lines<R> {
    pub(super) const fn new(inner: R) -> Self {
        Self {
            inner,
            bytes: 0,
            ends: VecDeque::new(),
            passed: 0,
        }
    }

    /// The line, from 1, of the byte before the `end`th; asked for in ascending order.
    pub(super) fn line(&mut self, end: u64) -> usize {
        while self.ends.front().is_some_and(|newline| newline + 1 < end) {
            self.ends.pop_front();
            self.passed += 1;
        }
        self.passed + 1
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        let ends = memchr::memchr_iter(b'\n', buffer.get(..read).unwrap_or_default());
        self.ends.extend(ends.map(|i| self.bytes + i as u64));
        self.bytes += read as u64;
        Ok(read)
    }
}
