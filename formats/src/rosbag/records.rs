//! The records of a bag: a header of named fields, then data, each with its length before it.

use crate::bytes::{Bytes, MOST_BYTES, take_counted, take_u32};
use crate::chunks::{self, Chunk, Layout};
use crate::messages::Broken;
use crate::unpack::unpack;

const MAGIC: [u8; 13] = *b"#ROSBAG V2.0\n";
const MESSAGE: u8 = 0x02;
const BAG: u8 = 0x03;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;
/// A header has the names of a few fields, and at most one topic.
const LONGEST_HEADER: u32 = 1 << 20;

/// A record that a reader of messages needs.
pub(super) enum Entry {
    Connection {
        number: u32,
        topic: String,
        message_type: String,
        definition: String,
    },
    Message {
        connection: u32,
        log_time: i64,
    },
}

/// The records of a bag.
pub(super) type Records = chunks::Records<Bag>;

/// How the records of a bag are written.
#[derive(Default)]
pub(super) struct Bag {
    header: Vec<u8>,
    data: Vec<u8>,
    /// The place of the index, which follows the chunks.
    index: u64,
}

/// The records of a file.
///
/// # Errors
/// The file does not begin as a bag does.
pub(super) fn open(mut bytes: Bytes) -> Result<Records, String> {
    let magic = bytes.array().map_err(|broken| broken.message)?;
    if magic != Some(MAGIC) {
        return Err("this file does not begin as a bag of ROS 1 of version 2.0 does".to_owned());
    }
    Ok(Records::new(bytes, Bag::default()))
}

impl Layout for Bag {
    type Entry = Entry;

    fn in_chunk(rest: &[u8], message: &mut Vec<u8>) -> Result<(Option<Entry>, usize), &'static str> {
        let mut bytes = rest;
        let header = take_counted(&mut bytes).ok_or("it is cut off")?;
        let data = take_counted(&mut bytes).ok_or("it is cut off")?;
        let fields = Fields::read(header).ok_or("its header is damaged")?;
        Ok((entry(&fields, data, message)?, rest.len() - bytes.len()))
    }

    fn top(&mut self, bytes: &mut Bytes, chunk: &mut Chunk, message: &mut Vec<u8>) -> Result<Option<Entry>, Broken> {
        let from = bytes.at();
        let cut = || Broken::at(from, "the file is cut off");
        let Some(length) = bytes.array()?.map(u32::from_le_bytes) else {
            chunk.has_ended = true;
            let is_whole = bytes.at() == from && from >= self.index;
            return if is_whole { Ok(None) } else { Err(cut()) };
        };
        if length > LONGEST_HEADER {
            return Err(Broken::at(from, format!("the header of a record has {length} bytes")));
        }
        bytes.read(length.into(), &mut self.header)?;
        let length = bytes.array()?.map(u32::from_le_bytes).ok_or_else(cut)?;
        let skipped = |bytes: &mut Bytes| if bytes.skip(length.into())? { Ok(None) } else { Err(cut()) };
        let Some(fields) = Fields::read(&self.header) else {
            chunk.lose(from, "the header of a record is damaged");
            return skipped(bytes);
        };
        match fields.kind {
            BAG => self.index = fields.index,
            CHUNK | CONNECTION | MESSAGE => {}
            _ => return skipped(bytes),
        }
        bytes.read(length.into(), &mut self.data)?;
        let is_cut = self.data.len() < length as usize;
        if fields.kind != CHUNK {
            if is_cut {
                return Err(cut());
            }
            let entry = entry(&fields, &self.data, message);
            return entry.or_else(|why| {
                chunk.lose(from, why);
                Ok(None)
            });
        }
        chunk.begin(from);
        let read = match fields.packing {
            b"none" => {
                core::mem::swap(&mut chunk.records, &mut self.data);
                Ok(())
            }
            _ if u64::from(fields.size) > MOST_BYTES => Err(format!("a chunk of {} bytes is beyond {MOST_BYTES}", fields.size)),
            packing => unpack(
                &String::from_utf8_lossy(packing),
                &self.data,
                fields.size.into(),
                &mut chunk.records,
            ),
        };
        chunk.broken = is_cut.then(cut);
        chunk.lost = read.err();
        Ok(None)
    }
}

/// The fields of a header that are needed.
#[derive(Default)]
struct Fields<'a> {
    kind: u8,
    connection: u32,
    time: i64,
    packing: &'a [u8],
    size: u32,
    index: u64,
    topic: &'a [u8],
    message_type: &'a [u8],
    definition: &'a [u8],
}

impl<'a> Fields<'a> {
    fn read(mut header: &'a [u8]) -> Option<Self> {
        let mut all = Self::default();
        while !header.is_empty() {
            let field = take_counted(&mut header)?;
            let end = field.iter().position(|byte| *byte == b'=')?;
            let (name, value) = (&field[..end], &field[end + 1..]);
            let number = || value.try_into().ok().map(u32::from_le_bytes);
            match name {
                b"op" => all.kind = *value.first()?,
                b"conn" => all.connection = number()?,
                b"size" => all.size = number()?,
                b"index_pos" => all.index = u64::from_le_bytes(value.try_into().ok()?),
                b"time" => {
                    let mut value = value;
                    let (seconds, rest) = (take_u32(&mut value)?, take_u32(&mut value)?);
                    all.time = i64::from(seconds) * 1_000_000_000 + i64::from(rest);
                }
                b"compression" => all.packing = value,
                b"topic" => all.topic = value,
                b"type" => all.message_type = value,
                b"message_definition" => all.definition = value,
                _ => {}
            }
        }
        Some(all)
    }
}

/// A connection or message, if it is one.
///
/// # Errors
/// It is damaged.
fn entry(fields: &Fields<'_>, data: &[u8], message: &mut Vec<u8>) -> Result<Option<Entry>, &'static str> {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ok(match fields.kind {
        MESSAGE => {
            message.clear();
            message.extend_from_slice(data);
            Some(Entry::Message {
                connection: fields.connection,
                log_time: fields.time,
            })
        }
        CONNECTION => {
            let about = Fields::read(data).ok_or("a connection is damaged")?;
            Some(Entry::Connection {
                number: fields.connection,
                topic: text(fields.topic),
                message_type: text(about.message_type),
                definition: text(about.definition),
            })
        }
        _ => None,
    })
}
