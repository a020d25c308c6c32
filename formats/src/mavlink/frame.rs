//! The frames of MAVLink 1 and 2, and their checksum.
//!
//! ```text
//! FE length sequence system component id                                    content checksum
//! FD length flags flags sequence system component id id id                  content checksum [signature]
//! ```

use super::definition::Message;
use core::ops::Range;
use std::collections::BTreeMap;

/// The first byte of a frame.
const V1: u8 = 0xfe;
pub(super) const V2: u8 = 0xfd;
/// Bytes before the content.
const HEAD_1: usize = 6;
const HEAD_2: usize = 10;
/// Bytes after the content.
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
/// The flag of a frame with a signature. A frame with another flag of its byte cannot be read.
const SIGNED: u8 = 1;

/// The kind of the bytes at a place.
#[derive(Clone, Debug)]
pub(super) enum Frame {
    /// A message whose checksum is right.
    Sound(Sound),
    /// A frame of this length, of a type that is not known, or with a wrong checksum.
    Doubtful { id: u32, is_known: bool, length: usize },
    /// This many bytes are needed to decide.
    Short(usize),
    /// Nothing that is known.
    Other,
}

/// A message whose checksum is right.
#[derive(Clone, Debug)]
pub(super) struct Sound {
    pub(super) message: &'static Message,
    /// System and component.
    pub(super) sender: (u8, u8),
    pub(super) content: Range<usize>,
    pub(super) length: usize,
}

/// Whether a frame begins with this byte.
pub(super) const fn is_mark(byte: u8) -> bool {
    matches!(byte, V1 | V2)
}

/// Finds the frame at the start of these bytes.
pub(super) fn of(ahead: &[u8], all: &'static BTreeMap<u32, Message>) -> Frame {
    let (id, sender, content, rest) = match *ahead {
        [V1, length, _, system, component, id, ..] => (u32::from(id), (system, component), HEAD_1..HEAD_1 + usize::from(length), 0),
        [V2, _, flags, ..] if flags & !SIGNED != 0 => return Frame::Other,
        [V2, length, flags, _, _, system, component, low, middle, high, ..] => {
            let id = u32::from_le_bytes([low, middle, high, 0]);
            let rest = if flags & SIGNED == 0 { 0 } else { SIGNATURE };
            (id, (system, component), HEAD_2..HEAD_2 + usize::from(length), rest)
        }
        [V1, ..] => return Frame::Short(HEAD_1),
        [V2, ..] => return Frame::Short(HEAD_2),
        [] => return Frame::Short(1),
        _ => return Frame::Other,
    };
    let length = content.end + CHECKSUM + rest;
    let Some(frame) = ahead.get(..length) else {
        return Frame::Short(length);
    };
    match all.get(&id) {
        Some(message) if frame[content.end..].starts_with(&checksum(&frame[..content.end], message.seed)) => Frame::Sound(Sound {
            message,
            sender,
            content,
            length,
        }),
        known => Frame::Doubtful {
            id,
            is_known: known.is_some(),
            length,
        },
    }
}

/// The checksum of a frame up to the end of its content: without the mark, and with the seed of its type.
pub(super) fn checksum(frame: &[u8], seed: u8) -> [u8; CHECKSUM] {
    let mut sum = crc(&frame[1..]);
    sum.add(&[seed]);
    sum.bytes()
}

/// The cyclic redundancy check CRC-16/MCRF4XX.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crc(u16);

/// The check of these bytes.
pub(super) fn crc(bytes: &[u8]) -> Crc {
    let mut sum = Crc(0xffff);
    sum.add(bytes);
    sum
}

impl Crc {
    pub(super) fn add(&mut self, bytes: &[u8]) {
        const POLYNOMIAL: u16 = 0x8408;
        self.0 = bytes.iter().fold(self.0, |sum, byte| {
            (0..8).fold(sum ^ u16::from(*byte), |sum, _| {
                sum >> 1 ^ if sum & 1 == 1 { POLYNOMIAL } else { 0 }
            })
        });
    }

    pub(super) const fn bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_matches_its_catalogue() {
        // CRC-16/MCRF4XX in the catalogue of G. Cook.
        assert_eq!(crc(b"123456789").bytes(), 0x6f91_u16.to_le_bytes());
    }
}
