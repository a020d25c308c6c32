//! Logs whose records are in chunks: bags of ROS 1, and MCAP.

use crate::bytes::Bytes;
use crate::damage::Damage;
use crate::messages::Broken;
use core::ops::Range;

/// The chunk that is read.
#[derive(Default)]
pub(crate) struct Chunk {
    /// Its records, unpacked.
    pub(crate) records: Vec<u8>,
    /// The place of its next record.
    next: usize,
    /// Its place in the file.
    from: u64,
    /// The damage after its records, if the next chunk can be read.
    pub(crate) lost: Option<String>,
    /// The damage after its records, if nothing more can be read.
    pub(crate) broken: Option<Broken>,
    /// No record follows this chunk.
    pub(crate) has_ended: bool,
}

impl Chunk {
    /// Begins another chunk at this place of the file.
    pub(crate) fn begin(&mut self, from: u64) {
        self.records.clear();
        (self.next, self.from, self.lost, self.broken) = (0, from, None, None);
    }

    /// Takes records that are not packed out of the record of the chunk, where they have this place.
    pub(crate) fn take(&mut self, record: &mut Vec<u8>, place: Range<usize>) {
        core::mem::swap(&mut self.records, record);
        self.records.truncate(place.end);
        self.next = place.start;
    }

    /// Passes over a record at this place of the file.
    pub(crate) fn lose(&mut self, from: u64, why: &str) {
        self.begin(from);
        self.lost = Some(why.to_owned());
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

    /// The next record outside of chunks, if it is needed. A chunk is put into `chunk`, and so is a record that is passed
    /// over.
    ///
    /// # Errors
    /// The file is cut off, or the next record cannot be found.
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

    /// The next record that is needed. The content of a message replaces that of `message`. Damaged chunks are passed over,
    /// and counted.
    ///
    /// # Errors
    /// The file is cut off, or so damaged that nothing more can be read.
    pub(crate) fn next(&mut self, message: &mut Vec<u8>, damage: &mut Damage) -> Result<Option<L::Entry>, Broken> {
        loop {
            let chunk = &mut self.chunk;
            let rest = &chunk.records[chunk.next..];
            if !rest.is_empty() {
                match L::in_chunk(rest, message) {
                    Ok((entry, length)) => {
                        chunk.next += length;
                        match entry {
                            Some(entry) => return Ok(Some(entry)),
                            None => continue,
                        }
                    }
                    Err(why) => {
                        chunk.next = chunk.records.len();
                        chunk.lost.get_or_insert_with(|| format!("a record of a chunk is damaged: {why}"));
                    }
                }
            }
            if let Some(broken) = chunk.broken.take() {
                chunk.has_ended = true;
                return Err(damage.before(broken));
            }
            if let Some(why) = chunk.lost.take() {
                damage.lose(chunk.from, self.bytes.at(), why);
            }
            if chunk.has_ended {
                return Ok(None);
            }
            let entry = self.layout.top(&mut self.bytes, chunk, message);
            if let Some(entry) = entry.map_err(|broken| damage.before(broken))? {
                return Ok(Some(entry));
            }
        }
    }
}
