//! Frames of zstd: chunks, messages and whole files of bags.

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::io::{BufRead, Error, Read, Result};
use std::path::Path;

/// The first bytes of a frame (RFC 8878).
#[cfg(feature = "rosbag2")]
pub(crate) const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Whether the name of a file ends as those of packed files.
pub(crate) fn is_packed(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "zstd")
}

/// The content of frames that follow each other.
pub(crate) struct Frames<R: BufRead> {
    /// `None` after the last frame, or after an error.
    frame: Option<StreamingDecoder<R, FrameDecoder>>,
}

impl<R: BufRead> Frames<R> {
    /// # Errors
    /// The source does not begin with a sound frame.
    pub(crate) fn new(source: R) -> Result<Self> {
        let frame = StreamingDecoder::new(source).map_err(Error::other)?;
        Ok(Self { frame: Some(frame) })
    }
}

impl<R: BufRead> Read for Frames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        while let Some(mut frame) = self.frame.take() {
            let read = frame.read(buffer)?;
            if read > 0 || buffer.is_empty() {
                self.frame = Some(frame);
                return Ok(read);
            }
            let mut source = frame.into_inner();
            if !source.fill_buf()?.is_empty() {
                *self = Self::new(source)?;
            }
        }
        Ok(0)
    }
}
