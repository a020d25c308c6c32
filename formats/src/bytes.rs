//! The bytes of a log, with the place of the next one.

use crate::messages::Broken;
#[cfg(feature = "mcap")]
use crate::zstd;
#[cfg(feature = "mcap")]
use fusion::rows::DataError;
use fusion::rows::SourceError;
use fusion::source::{DataFile, OpenContext};
use std::io::Read;

/// A record or a chunk has at most this number of bytes, packed and unpacked. Recorders begin a new chunk after some
/// megabytes; an image has a few tens of them.
pub(crate) const MOST_BYTES: u64 = 256 << 20;
/// Memory for a record grows by at most this number of bytes before they are read.
const STEP: usize = 1 << 20;

/// The bytes of a log.
pub(crate) struct Bytes {
    file: Box<dyn Read + Send>,
    at: u64,
}

impl Bytes {
    /// # Errors
    /// The file cannot be opened.
    pub(crate) fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let bytes = file.bytes(context)?;
        #[cfg(feature = "mcap")]
        let bytes = if context.arriving.is_none() && zstd::is_packed(file.path()) {
            unpacked(file, bytes)?
        } else {
            bytes
        };
        Ok(Self { file: bytes, at: 0 })
    }

    /// The number of bytes that were read.
    pub(crate) const fn at(&self) -> u64 {
        self.at
    }

    /// Reads `count` bytes into a buffer, or as many as there are.
    ///
    /// # Errors
    /// The count is beyond [`MOST_BYTES`], or the file cannot be read.
    pub(crate) fn read(&mut self, count: u64, buffer: &mut Vec<u8>) -> Result<(), Broken> {
        let all = usize::try_from(count).ok().filter(|_| count <= MOST_BYTES);
        let all = all.ok_or_else(|| Broken::at(self.at, format!("a record of {count} bytes is beyond {MOST_BYTES}")))?;
        let mut done = 0;
        while done < all {
            // Bytes of the record before are overwritten: they are not set to zero again.
            let to = all.min(buffer.len().max(done + STEP));
            buffer.resize(buffer.len().max(to), 0);
            let read = self.fill(&mut buffer[done..to])?;
            done += read;
            if read == 0 {
                break;
            }
        }
        buffer.truncate(done);
        Ok(())
    }

    /// Fills a buffer as far as there are bytes, and returns their number.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, Broken> {
        let mut done = 0;
        while done < buffer.len() {
            match self.file.read(&mut buffer[done..]) {
                Ok(0) => break,
                Ok(read) => {
                    done += read;
                    self.at += read as u64;
                }
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(Broken::at(self.at, error.to_string())),
            }
        }
        Ok(done)
    }

    /// Reads exactly this number of bytes; `None` if the file ends before.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub(crate) fn array<const N: usize>(&mut self) -> Result<Option<[u8; N]>, Broken> {
        let mut bytes = [0; N];
        Ok((self.fill(&mut bytes)? == N).then_some(bytes))
    }

    /// Goes past bytes, or to the end of the file. Returns whether all were there.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn skip(&mut self, count: u64) -> Result<bool, Broken> {
        let skipped = std::io::copy(&mut self.file.by_ref().take(count), &mut std::io::sink());
        let skipped = skipped.map_err(|error| Broken::at(self.at, error.to_string()))?;
        self.at += skipped;
        Ok(skipped == count)
    }
}

/// The content of a packed file with these bytes.
#[cfg(feature = "mcap")]
fn unpacked(file: &DataFile, bytes: Box<dyn Read + Send>) -> Result<Box<dyn Read + Send>, DataError> {
    match zstd::Frames::new(std::io::BufReader::new(bytes)) {
        Ok(frames) => Ok(Box::new(frames)),
        Err(error) => Err(DataError::new(file.name(), format!("this packed file cannot be unpacked: {error}"))),
    }
}

/// Takes a number of little-endian bytes off the front.
pub(crate) fn take_u32(bytes: &mut &[u8]) -> Option<u32> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(u32::from_le_bytes(*first))
}

/// Takes bytes off the front, with their number before them.
pub(crate) fn take_counted<'a>(bytes: &mut &'a [u8]) -> Option<&'a [u8]> {
    let count = take_u32(bytes)? as usize;
    let (taken, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(taken)
}
