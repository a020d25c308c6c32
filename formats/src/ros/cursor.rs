//! The bytes of one message: serialised by ROS 1, or as CDR by ROS 2.
//!
//! CDR begins with four bytes, which give the order of the bytes of a number. Every number then starts at a multiple
//! of its size, or of four bytes in the second version of CDR. ROS 1 has little-endian numbers without gaps.

use super::definition::Number;
use crate::messages::Cells;

/// The bytes that begin a message of CDR.
const ENCAPSULATION: usize = 4;

/// How messages are serialised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ros1,
    Cdr,
}

/// The message ends too early.
#[derive(Debug)]
pub(super) struct Short;

/// The bytes of one message, read from the start.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Numbers start at a multiple of their size, or of this.
    pub(super) widest: usize,
    pub(super) order: Order,
    pub(super) encoding: Encoding,
}

impl<'a> Cursor<'a> {
    /// # Errors
    /// The kind of CDR is not one that messages of ROS 2 have.
    pub(super) fn new(bytes: &'a [u8], encoding: Encoding) -> Result<Self, String> {
        let (bytes, widest, order) = match (encoding, bytes) {
            (Encoding::Ros1, bytes) => (bytes, 1, Order::Little),
            (Encoding::Cdr, [0, kind @ (0 | 1 | 6 | 7), ..]) if bytes.len() >= ENCAPSULATION => {
                let order = if kind % 2 == 0 { Order::Big } else { Order::Little };
                (&bytes[ENCAPSULATION..], if *kind < 6 { 8 } else { 4 }, order)
            }
            (Encoding::Cdr, _) => return Err("this message is not plain CDR".to_owned()),
        };
        Ok(Self {
            bytes,
            at: 0,
            widest,
            order,
            encoding,
        })
    }

    pub(super) const fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The place of the next byte.
    pub(super) const fn place(&self) -> usize {
        self.at
    }

    /// Continues at a place that has been read before.
    pub(super) const fn go_to(&mut self, place: usize) {
        self.at = if place < self.bytes.len() { place } else { self.bytes.len() };
    }

    pub(super) fn skip(&mut self, count: usize) -> Result<(), Short> {
        self.take(count).map(|_| ())
    }

    /// Goes to the next place for a number of this size.
    pub(super) fn align(&mut self, size: usize) {
        let last = size.min(self.widest) - 1;
        self.at = ((self.at + last) & !last).min(self.bytes.len());
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], Short> {
        let taken = self.bytes.get(self.at..).and_then(|left| left.get(..count)).ok_or(Short)?;
        self.at += count;
        Ok(taken)
    }

    fn u32(&mut self) -> Result<u32, Short> {
        self.align(4);
        let bytes = self.take(4)?;
        self.order.u32(bytes, 0)
    }

    /// The length of an array or text: at most one element for each byte that is left.
    pub(super) fn length(&mut self) -> Result<usize, Short> {
        let length = self.u32()? as usize;
        if length > self.left() { Err(Short) } else { Ok(length) }
    }

    /// A text without the zero that ends it in CDR.
    pub(super) fn text(&mut self) -> Result<&'a [u8], Short> {
        let length = self.length()?;
        let text = self.take(length)?;
        Ok(match (self.encoding, text) {
            (Encoding::Cdr, [text @ .., 0]) => text,
            _ => text,
        })
    }

    /// A time or a duration as nanoseconds.
    pub(super) fn nanoseconds(&mut self, is_duration: bool) -> Result<i64, Short> {
        self.align(4);
        let bytes = self.take(8)?;
        self.order.nanoseconds(bytes, 0, self.encoding, is_duration)
    }
}

/// The order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

impl Order {
    /// The bytes of a number at this place, the least significant one first.
    #[inline]
    fn array<const N: usize>(self, bytes: &[u8], at: usize) -> Result<[u8; N], Short> {
        let mut bytes: [u8; N] = *bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(Short)?;
        if self == Self::Big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    #[inline]
    fn u32(self, bytes: &[u8], at: usize) -> Result<u32, Short> {
        self.array(bytes, at).map(u32::from_le_bytes)
    }

    /// Adds the number at this place to the cells.
    #[inline]
    pub(super) fn number(self, number: Number, bytes: &[u8], at: usize, cells: &mut Cells) -> Result<(), Short> {
        match number {
            Number::F64 => cells.number(f64::from_le_bytes(self.array(bytes, at)?)),
            Number::F32 => cells.number(f32::from_le_bytes(self.array(bytes, at)?).into()),
            Number::U8 => cells.integer(self.array::<1>(bytes, at)?[0].into()),
            Number::I8 => cells.integer(i8::from_le_bytes(self.array(bytes, at)?).into()),
            Number::U16 => cells.integer(u16::from_le_bytes(self.array(bytes, at)?).into()),
            Number::I16 => cells.integer(i16::from_le_bytes(self.array(bytes, at)?).into()),
            Number::U32 => cells.integer(self.u32(bytes, at)?.into()),
            Number::I32 => cells.integer(i32::from_le_bytes(self.array(bytes, at)?).into()),
            Number::U64 => cells.unsigned(u64::from_le_bytes(self.array(bytes, at)?)),
            Number::I64 => cells.integer(i64::from_le_bytes(self.array(bytes, at)?)),
        }
        Ok(())
    }

    /// Adds numbers of eight bytes with a fraction, which begin at this place.
    #[inline]
    pub(super) fn floats(self, count: usize, bytes: &[u8], at: usize, cells: &mut Cells) -> Result<(), Short> {
        let bytes = bytes.get(at..).and_then(|bytes| bytes.get(..8 * count)).ok_or(Short)?;
        let numbers = bytes.as_chunks::<8>().0.iter();
        match self {
            Self::Little => cells.numbers(numbers.map(|bytes| f64::from_le_bytes(*bytes))),
            Self::Big => cells.numbers(numbers.map(|bytes| f64::from_be_bytes(*bytes))),
        }
        Ok(())
    }

    /// Seconds and nanoseconds at this place as nanoseconds. The seconds of a time of ROS 1 have no sign, those of a
    /// duration do.
    pub(super) fn nanoseconds(self, bytes: &[u8], at: usize, encoding: Encoding, is_duration: bool) -> Result<i64, Short> {
        let (seconds, rest) = (self.u32(bytes, at)?, self.u32(bytes, at + 4)?);
        let signed = |number: u32| i64::from(number.cast_signed());
        let seconds = match (encoding, is_duration) {
            (Encoding::Ros1, false) => seconds.into(),
            _ => signed(seconds),
        };
        let rest = match (encoding, is_duration) {
            (Encoding::Ros1, true) => signed(rest),
            _ => rest.into(),
        };
        Ok(seconds * 1_000_000_000 + rest)
    }
}
