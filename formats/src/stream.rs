//! The bytes of a log, with a look ahead.

use crate::messages::Broken;
use fusion::rows::SourceError;
use fusion::source::{DataFile, OpenContext};
use std::io::{ErrorKind, Read};

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 16;

/// Reads a file forward. The next bytes can be looked at before they are consumed.
pub(crate) struct Stream {
    source: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    /// The bytes of the buffer that are not consumed.
    from: usize,
    to: usize,
    /// The place of `from` in the file.
    at: u64,
    has_ended: bool,
}

impl Stream {
    pub(crate) fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        Ok(Self::of(file.bytes(context)?))
    }

    pub(crate) fn of(source: Box<dyn Read + Send>) -> Self {
        Self {
            source,
            buffer: Vec::new(),
            from: 0,
            to: 0,
            at: 0,
            has_ended: false,
        }
    }

    /// The number of bytes consumed so far.
    pub(crate) const fn at(&self) -> u64 {
        self.at
    }

    /// The bytes that have been read and are not consumed.
    pub(crate) fn ahead(&self) -> &[u8] {
        &self.buffer[self.from..self.to]
    }

    /// Reads until `count` bytes are ahead, or to the end of the file, and returns all bytes ahead.
    pub(crate) fn fill(&mut self, count: usize) -> Result<&[u8], Broken> {
        while self.to - self.from < count && !self.has_ended {
            self.read(count)?;
        }
        Ok(self.ahead())
    }

    fn read(&mut self, count: usize) -> Result<(), Broken> {
        self.buffer.copy_within(self.from..self.to, 0);
        (self.from, self.to) = (0, self.to - self.from);
        let wanted = count.max(self.to) + BLOCK;
        if self.buffer.len() < wanted {
            self.buffer.resize(wanted, 0);
        }
        match self.source.read(&mut self.buffer[self.to..]) {
            Ok(0) => self.has_ended = true,
            Ok(read) => self.to += read,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => {
                self.has_ended = true;
                return Err(Broken::at(self.at + self.to as u64, error.to_string()));
            }
        }
        Ok(())
    }

    /// Consumes bytes that are ahead.
    pub(crate) fn consume(&mut self, count: usize) {
        debug_assert!(count <= self.to - self.from, "only bytes ahead are consumed");
        self.from += count;
        self.at += count as u64;
    }

    /// Skips bytes, at most to the end of the file.
    pub(crate) fn skip(&mut self, mut count: u64) -> Result<(), Broken> {
        while count > 0 {
            let here = self.fill(1)?.len().min(usize::try_from(count).unwrap_or(usize::MAX));
            if here == 0 {
                break;
            }
            self.consume(here);
            count -= here as u64;
        }
        Ok(())
    }
}
