//! The records of an MCAP file: one byte for the kind, eight for the length, then the content.

use crate::bytes::{Bytes, MOST_BYTES, take_counted, take_u32};
use crate::chunks::{self, Chunk, Layout};
use crate::messages::Broken;
use crate::unpack::unpack;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0f;
const FOOTER: u8 = 0x02;

/// A record that a reader of messages needs.
pub(super) enum Entry {
    Schema {
        number: u16,
        name: String,
        encoding: String,
        data: Vec<u8>,
    },
    Channel {
        number: u16,
        schema: u16,
        topic: String,
        encoding: String,
    },
    Message {
        channel: u16,
        log_time: i64,
    },
}

/// The records of a file.
pub(super) type Records = chunks::Records<Mcap>;

/// How the records of MCAP are written.
pub(super) struct Mcap {
    record: Vec<u8>,
    /// The file may end after any record: its sender was stopped.
    is_open_ended: bool,
}

/// The records of a file; or of bytes that arrive, which may end after any record.
///
/// # Errors
/// The file does not begin as MCAP does.
pub(super) fn open(mut bytes: Bytes, is_open_ended: bool) -> Result<Records, String> {
    let magic = bytes.array().map_err(|broken| broken.message)?;
    if magic != Some(MAGIC) {
        return Err("this file does not begin as MCAP does".to_owned());
    }
    let record = Vec::new();
    Ok(Records::new(bytes, Mcap { record, is_open_ended }))
}

impl Layout for Mcap {
    type Entry = Entry;

    fn in_chunk(rest: &[u8], message: &mut Vec<u8>) -> Result<(Option<Entry>, usize), &'static str> {
        let mut bytes = rest;
        let (kind, left) = bytes.split_first().ok_or("it has no kind")?;
        bytes = left;
        let length = take_u64(&mut bytes).and_then(|length| usize::try_from(length).ok());
        let content = length.and_then(|length| bytes.get(..length)).ok_or("it is cut off")?;
        let length = rest.len() - bytes.len() + content.len();
        match kind {
            &(SCHEMA | CHANNEL | MESSAGE) => {
                let entry = entry(*kind, content, message).ok_or("it is shorter than its fields")?;
                Ok((Some(entry), length))
            }
            _ => Ok((None, length)),
        }
    }

    fn top(&mut self, bytes: &mut Bytes, chunk: &mut Chunk, message: &mut Vec<u8>) -> Result<Option<Entry>, Broken> {
        let from = bytes.at();
        let cut = || Broken::at(from, "the file is cut off");
        let Some([kind, length @ ..]) = bytes.array::<9>()? else {
            chunk.has_ended = self.is_open_ended && bytes.at() == from;
            return if chunk.has_ended { Ok(None) } else { Err(cut()) };
        };
        let length = u64::from_le_bytes(length);
        match kind {
            DATA_END | FOOTER => chunk.has_ended = true,
            CHUNK => self.read_chunk((bytes, chunk), from, length)?,
            SCHEMA | CHANNEL | MESSAGE => {
                bytes.read(length, &mut self.record)?;
                if (self.record.len() as u64) < length {
                    return Err(cut());
                }
                let entry = entry(kind, &self.record, message);
                if entry.is_none() {
                    chunk.lose(from, "a record is shorter than its fields");
                }
                return Ok(entry);
            }
            _ if !bytes.skip(length)? => return Err(cut()),
            _ => {}
        }
        Ok(None)
    }
}

impl Mcap {
    /// Reads a chunk. The records before a damage in it are used.
    fn read_chunk(&mut self, (bytes, chunk): (&mut Bytes, &mut Chunk), from: u64, length: u64) -> Result<(), Broken> {
        bytes.read(length, &mut self.record)?;
        chunk.begin(from);
        if (self.record.len() as u64) < length {
            chunk.broken = Some(Broken::at(from, "the file is cut off"));
        }
        let Some(head) = Head::read(&self.record) else {
            chunk.lost = Some("the head of a chunk is damaged".to_owned());
            return Ok(());
        };
        if head.unpacked > MOST_BYTES {
            chunk.lost = Some(format!("a chunk of {} bytes is beyond {MOST_BYTES}", head.unpacked));
            return Ok(());
        }
        let read = match head.packing {
            b"" => Ok(()),
            packing => unpack(&String::from_utf8_lossy(packing), head.records, head.unpacked, &mut chunk.records),
        };
        let records = if head.packing.is_empty() { head.records } else { &chunk.records };
        if let Err(why) = read {
            chunk.lost = Some(why);
        } else if chunk.broken.is_none() && head.check != 0 && crc32fast::hash(records) != head.check {
            chunk.lose(from, "a chunk does not have its check sum");
        } else if head.packing.is_empty() {
            let place = head.from..head.from + head.records.len();
            chunk.take(&mut self.record, place);
        }
        Ok(())
    }
}

/// The head of a chunk.
struct Head<'a> {
    unpacked: u64,
    check: u32,
    packing: &'a [u8],
    /// As many bytes as there are, and their place in the record.
    records: &'a [u8],
    from: usize,
}

impl<'a> Head<'a> {
    fn read(record: &'a [u8]) -> Option<Self> {
        // The times of the first and of the last message.
        let mut rest = record.get(16..)?;
        let unpacked = take_u64(&mut rest)?;
        let check = take_u32(&mut rest)?;
        let packing = take_counted(&mut rest)?;
        let packed = usize::try_from(take_u64(&mut rest)?).ok()?;
        let records = &rest[..packed.min(rest.len())];
        Some(Self {
            unpacked,
            check,
            packing,
            records,
            from: record.len() - rest.len(),
        })
    }
}

fn take_u64(bytes: &mut &[u8]) -> Option<u64> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(u64::from_le_bytes(*first))
}

fn take_u16(bytes: &mut &[u8]) -> Option<u16> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(u16::from_le_bytes(*first))
}

/// A schema, channel or message.
fn entry(kind: u8, mut content: &[u8], message: &mut Vec<u8>) -> Option<Entry> {
    let bytes = &mut content;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let number = take_u16(bytes)?;
    Some(match kind {
        SCHEMA => Entry::Schema {
            number,
            name: text(take_counted(bytes)?),
            encoding: text(take_counted(bytes)?),
            data: take_counted(bytes)?.to_vec(),
        },
        CHANNEL => Entry::Channel {
            number,
            schema: take_u16(bytes)?,
            topic: text(take_counted(bytes)?),
            encoding: text(take_counted(bytes)?),
        },
        _ => {
            let _sequence = take_u32(bytes)?;
            let log_time = take_u64(bytes)?;
            let _publish_time = take_u64(bytes)?;
            message.clear();
            message.extend_from_slice(bytes);
            Entry::Message {
                channel: number,
                log_time: i64::try_from(log_time).unwrap_or(i64::MAX),
            }
        }
    })
}
