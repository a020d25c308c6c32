//! Logs whose records are in chunks: bags of ROS 1, and MCAP.

use crate::bytes::Bytes;
use crate::messages::Broken;

/// The chunk that is read.
#[derive(Default)]
pub(crate) struct Chunk {
    /// Its records, unpacked.
    pub(crate) records: Vec<u8>,
    /// The place of its next record.
    next: usize,
    /// The damage after its records.
    pub(crate) broken: Option<Broken>,
    /// No record follows this chunk.
    pub(crate) has_ended: bool,
}

impl Chunk {
    /// Begins another chunk.
    pub(crate) fn begin(&mut self) {
        self.records.clear();
        (self.next, self.broken) = (0, None);
    }
}

/// How the records of a format are written.
pub(crate) trait Layout {
    /// A record that a reader of messages needs.
    type Entry;

    /// The record at the front of the rest of a chunk, if it is needed, and its length. The content of a message
    /// replaces that of `message`.
    ///
    /// # Errors
    /// It is damaged.
    fn in_chunk(rest: &[u8], message: &mut Vec<u8>) -> Result<(Option<Self::Entry>, usize), &'static str>;

    /// The next record outside of chunks, if it is needed. A chunk is put into `chunk`.
    ///
    /// # Errors
    /// The file is cut off or damaged.
    fn top(&mut self, bytes: &mut Bytes, chunk: &mut Chunk, message: &mut Vec<u8>) -> Result<Option<Self::Entry>, Broken>;
}

/// The records of a file.
pub(crate) struct Records<L> {
    bytes: Bytes,
    chunk: Chunk,
    layout: L,
}

impl<L: Layout> Records<L> {
    /// The records after the mark of the file.
    pub(crate) fn new(bytes: Bytes, layout: L) -> Self {
        Self {
            bytes,
            chunk: Chunk::default(),
            layout,
        }
    }

    /// The next record that is needed. The content of a message replaces that of `message`.
    ///
    /// # Errors
    /// The file is cut off or damaged.
    pub(crate) fn next(&mut self, message: &mut Vec<u8>) -> Result<Option<L::Entry>, Broken> {
        loop {
            let rest = &self.chunk.records[self.chunk.next..];
            if !rest.is_empty() {
                let (entry, length) = L::in_chunk(rest, message).map_err(|why| self.damage(why))?;
                self.chunk.next += length;
                match entry {
                    Some(entry) => return Ok(Some(entry)),
                    None => continue,
                }
            }
            if let Some(broken) = self.chunk.broken.take() {
                self.chunk.has_ended = true;
                return Err(broken);
            }
            if self.chunk.has_ended {
                return Ok(None);
            }
            if let Some(entry) = self.layout.top(&mut self.bytes, &mut self.chunk, message)? {
                return Ok(Some(entry));
            }
        }
    }

    /// A damage inside of the current chunk, or after it.
    fn damage(&mut self, why: &str) -> Broken {
        let after = self.chunk.broken.take();
        self.chunk.begin();
        self.chunk.has_ended = true;
        let inside = || Broken::at(self.bytes.at(), format!("a record of the chunk before is damaged: {why}"));
        after.unwrap_or_else(inside)
    }
}
