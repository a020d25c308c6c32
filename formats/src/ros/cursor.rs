//! The bytes of one message: serialised by ROS 1, or as CDR by ROS 2.
//!
//! CDR begins with four bytes, which give the order of the bytes of a number. Every number then starts at a multiple
//! of its size, or of four bytes in the second version of CDR. ROS 1 has little-endian numbers without gaps.

use super::definition::Number;

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
    widest: usize,
    is_big_endian: bool,
    pub(super) encoding: Encoding,
}

impl<'a> Cursor<'a> {
    /// # Errors
    /// The kind of CDR is not one that messages of ROS 2 have.
    pub(super) fn new(bytes: &'a [u8], encoding: Encoding) -> Result<Self, String> {
        let (bytes, widest, is_big_endian) = match (encoding, bytes) {
            (Encoding::Ros1, bytes) => (bytes, 1, false),
            (Encoding::Cdr, [0, kind @ (0 | 1 | 6 | 7), ..]) if bytes.len() >= ENCAPSULATION => {
                (&bytes[ENCAPSULATION..], if *kind < 6 { 8 } else { 4 }, kind % 2 == 0)
            }
            (Encoding::Cdr, _) => return Err("this message is not plain CDR".to_owned()),
        };
        Ok(Self {
            bytes,
            at: 0,
            widest,
            is_big_endian,
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

    fn take(&mut self, count: usize) -> Result<&'a [u8], Short> {
        let taken = self.bytes.get(self.at..).and_then(|left| left.get(..count)).ok_or(Short)?;
        self.at += count;
        Ok(taken)
    }

    #[inline]
    fn array<const N: usize>(&mut self) -> Result<[u8; N], Short> {
        self.align(N);
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_| Short)?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    #[inline]
    pub(super) fn number(&mut self, number: Number) -> Result<Value, Short> {
        Ok(match number {
            Number::U8 => Value::Integer(self.array::<1>()?[0].into()),
            Number::I8 => Value::Integer(i8::from_le_bytes(self.array()?).into()),
            Number::U16 => Value::Integer(u16::from_le_bytes(self.array()?).into()),
            Number::I16 => Value::Integer(i16::from_le_bytes(self.array()?).into()),
            Number::U32 => Value::Integer(self.u32()?.into()),
            Number::I32 => Value::Integer(self.i32()?.into()),
            Number::U64 => Value::Unsigned(u64::from_le_bytes(self.array()?)),
            Number::I64 => Value::Integer(i64::from_le_bytes(self.array()?)),
            Number::F32 => Value::Float(f32::from_le_bytes(self.array()?).into()),
            Number::F64 => Value::Float(f64::from_le_bytes(self.array()?)),
        })
    }

    pub(super) fn u32(&mut self) -> Result<u32, Short> {
        self.array().map(u32::from_le_bytes)
    }

    fn i32(&mut self) -> Result<i32, Short> {
        self.array().map(i32::from_le_bytes)
    }

    /// The next numbers of eight bytes with a fraction, if they are little-endian as usual: most cells of messages are
    /// elements of covariances.
    pub(super) fn floats(&mut self, count: usize) -> Result<Option<impl Iterator<Item = f64> + use<'a>>, Short> {
        if self.is_big_endian || count == 0 {
            return Ok(None);
        }
        self.align(8);
        let (numbers, _) = self.take(count * 8)?.as_chunks();
        Ok(Some(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes))))
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

    /// Seconds and nanoseconds as nanoseconds. The seconds of a time of ROS 1 have no sign, those of a duration do.
    pub(super) fn nanoseconds(&mut self, is_duration: bool) -> Result<i64, Short> {
        let seconds: i64 = match (self.encoding, is_duration) {
            (Encoding::Ros1, false) => self.u32()?.into(),
            _ => self.i32()?.into(),
        };
        let rest: i64 = match (self.encoding, is_duration) {
            (Encoding::Ros1, true) => self.i32()?.into(),
            _ => self.u32()?.into(),
        };
        Ok(seconds * 1_000_000_000 + rest)
    }
}

/// A number of a message.
pub(super) enum Value {
    Integer(i64),
    Unsigned(u64),
    Float(f64),
}
