//! The frames of a stream of UBX, NMEA and RTCM 3, and their checksums.

use crate::nmea;
use memchr::memchr;

/// The kind of the bytes at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame {
    /// A message of u-blox: its class and number, and its length with header and checksum. The checksum may be wrong.
    Ubx { id: [u8; 2], length: usize, is_sound: bool },
    /// A line of NMEA with this length.
    Nmea(usize),
    /// A message of RTCM 3 with this length.
    Rtcm(usize),
    /// This many bytes are needed to decide.
    Short(usize),
    /// Nothing that is known.
    Other,
}

/// Bytes before the content of a message of u-blox: its mark, class, number and length.
pub(super) const HEADER: usize = 6;
/// Bytes of its checksum.
pub(super) const CHECKSUM: usize = 2;

/// Finds the frame at the start of these bytes.
pub(super) fn of(ahead: &[u8]) -> Frame {
    match *ahead {
        [0xb5, 0x62, class, number, low, high, ..] => {
            let length = HEADER + usize::from(u16::from_le_bytes([low, high])) + CHECKSUM;
            match ahead.get(..length) {
                None => Frame::Short(length),
                Some(frame) => {
                    let (content, told) = frame[2..].split_at(length - 2 - CHECKSUM);
                    let id = [class, number];
                    let is_sound = fletcher(content) == told;
                    Frame::Ubx { id, length, is_sound }
                }
            }
        }
        [0xb5] | [0xb5, 0x62, ..] => Frame::Short(HEADER),
        [b'$', ..] => match memchr(b'\n', &ahead[..ahead.len().min(nmea::LONGEST)]) {
            Some(end) if ahead[..end].is_ascii() => Frame::Nmea(end + 1),
            None if ahead.len() < nmea::LONGEST => Frame::Short(nmea::LONGEST),
            _ => Frame::Other,
        },
        [0xd3, high, low, ..] if high < 4 => {
            let length = 3 + usize::from(u16::from_be_bytes([high, low])) + 3;
            match ahead.get(..length) {
                None => Frame::Short(length),
                // The checksum of a message with its checksum is zero.
                Some(frame) if crc24q(frame) == 0 => Frame::Rtcm(length),
                Some(_) => Frame::Other,
            }
        }
        [0xd3] => Frame::Short(3),
        _ => Frame::Other,
    }
}

/// The checksum of Fletcher with 8 bits.
fn fletcher(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0_u8], |[a, b], byte| {
        let a = byte.wrapping_add(a);
        [a, b.wrapping_add(a)]
    })
}

/// The cyclic redundancy check CRC-24Q.
fn crc24q(bytes: &[u8]) -> u32 {
    const POLYNOMIAL: u32 = 0x186_4cfb;
    bytes.iter().fold(0, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte) << 16, |sum, _| {
            let shifted = sum << 1;
            if shifted >> 24 & 1 == 1 { shifted ^ POLYNOMIAL } else { shifted }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_match_those_of_the_standards() {
        // The request of UBX-MON-VER, and the station of RTCM 10403.3, 1005.
        assert_eq!(fletcher(&[0x0a, 0x04, 0, 0]), [0x0e, 0x34]);
        let station = [
            0xd3, 0x00, 0x13, 0x3e, 0xd7, 0xd3, 0x02, 0x02, 0x98, 0x0e, 0xde, 0xef, 0x34, 0xb4, 0xbd, 0x62, 0xac, 0x09, 0x41, 0x98, 0x6f,
            0x33, 0x36, 0x0b, 0x98,
        ];
        assert_eq!(of(&station), Frame::Rtcm(25));
        let mut wrong = station;
        wrong[9] ^= 4;
        assert_eq!(of(&wrong), Frame::Other);
        assert_eq!(of(&station[..20]), Frame::Short(25));
    }
}
