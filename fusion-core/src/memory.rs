//! The memory of a block, as bytes.
//!
//! Everything with a memory lists it once, in [`Memory::remember`]: the same line writes a number to a
//! [`Tape`] and reads it back, so that saving and restoring cannot drift apart. Limits, handles and other values
//! from the design are not memory: bytes are read into a block built from the same design.
//!
//! Bytes are little-endian, numbers with all their bits. A list is preceded by its length. Reading
//! trusts nothing: a length that the remaining bytes cannot hold, or a choice that does not exist, ends the
//! reading, and [`restore`] then restores the state before. The bytes contain no name, no type and no
//! checksum. Data kept longer than a process need their own header.

use crate::time::Time;
use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;
use nalgebra::{DVector, SMatrix, UnitQuaternion};
use smallvec::{Array, SmallVec};
use thiserror::Error;

/// Has a memory that can be saved and restored.
pub trait Memory {
    /// Passes everything that it remembers to `tape`, always in the same order.
    ///
    /// Reading may end in the middle. The rest then keeps its values, and nothing may be computed
    /// from it.
    fn remember(&mut self, tape: &mut Tape<'_>);

    /// Passes several items, without their number.
    #[doc(hidden)]
    fn remember_all(items: &mut [Self], tape: &mut Tape<'_>)
    where
        Self: Sized,
    {
        items.iter_mut().for_each(|item| item.remember(tape));
    }
}

/// The bytes do not hold the memory of the object that reads them.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the bytes do not hold this memory: {0}")]
pub struct Damaged(pub(crate) &'static str);

/// Bytes that are written or read.
#[derive(Debug)]
pub struct Tape<'a>(Side<'a>);

#[derive(Debug)]
enum Side<'a> {
    Writing(&'a mut Vec<u8>),
    Reading { rest: &'a [u8], error: Option<Damaged> },
}

/// Appends the contents of `memory` to `bytes`.
pub fn save<M: Memory + ?Sized>(memory: &mut M, bytes: &mut Vec<u8>) {
    memory.remember(&mut Tape(Side::Writing(bytes)));
}

/// Reads the bytes that [`save`] wrote. If `bytes` hold anything else, `memory` stays unchanged.
///
/// # Errors
/// [`Damaged`].
pub fn restore<M: Memory + ?Sized>(memory: &mut M, bytes: &[u8]) -> Result<(), Damaged> {
    let mut before = Vec::with_capacity(bytes.len());
    save(memory, &mut before);
    recall(memory, bytes).inspect_err(|_| {
        // The bytes that were just written can be read.
        let _ = recall(memory, &before);
    })
}

/// As [`restore`], for bytes that this process has written: after an error the caller must restore `memory` from
/// other bytes.
pub(crate) fn recall<M: Memory + ?Sized>(memory: &mut M, bytes: &[u8]) -> Result<(), Damaged> {
    let mut tape = Tape(Side::Reading { rest: bytes, error: None });
    memory.remember(&mut tape);
    match tape.0 {
        Side::Reading { error: Some(error), .. } => Err(error),
        Side::Reading { rest: [], .. } | Side::Writing(_) => Ok(()),
        Side::Reading { .. } => Err(Damaged("there are too many")),
    }
}

impl<'a> Tape<'a> {
    /// Whether it reads.
    #[must_use]
    pub const fn is_reading(&self) -> bool {
        matches!(self.0, Side::Reading { .. })
    }

    /// Whether all that was read so far is valid; always true while writing.
    #[must_use]
    pub const fn is_sound(&self) -> bool {
        matches!(self.0, Side::Writing(_) | Side::Reading { error: None, .. })
    }

    /// Ends the reading: the bytes are invalid.
    pub const fn refuse(&mut self, why: &'static str) {
        if let Side::Reading { error, .. } = &mut self.0
            && error.is_none()
        {
            *error = Some(Damaged(why));
        }
    }

    /// Writes `value`, or reads another value in its place. Returns `value` itself if nothing can be read.
    pub fn bytes<const N: usize>(&mut self, value: [u8; N]) -> [u8; N] {
        match &mut self.0 {
            Side::Writing(bytes) => bytes.extend_from_slice(&value),
            Side::Reading { rest, error: None } => match rest.split_first_chunk() {
                Some((read, after)) => {
                    *rest = after;
                    return *read;
                }
                None => self.refuse("they end too early"),
            },
            Side::Reading { .. } => {}
        }
        value
    }

    /// Numbers whose count the design gives.
    pub fn numbers(&mut self, numbers: &mut [f64]) {
        match &mut self.0 {
            Side::Writing(bytes) => {
                let from = bytes.len();
                bytes.resize(from + 8 * numbers.len(), 0);
                let (out, _) = bytes[from..].as_chunks_mut::<8>();
                out.iter_mut().zip(numbers).for_each(|(out, x)| *out = x.to_le_bytes());
            }
            Side::Reading { rest, error: None } => match rest.split_at_checked(8 * numbers.len()) {
                Some((read, after)) => {
                    *rest = after;
                    let (read, _) = read.as_chunks::<8>();
                    numbers.iter_mut().zip(read).for_each(|(x, read)| *x = f64::from_le_bytes(*read));
                }
                None => self.refuse("they end too early"),
            },
            Side::Reading { .. } => {}
        }
    }

    /// Bytes with their length. Writes `known`, or returns the bytes that were read, for a comparison
    /// with `known`.
    pub fn blob(&mut self, known: &[u8]) -> Option<&'a [u8]> {
        let length = self.length(known.len(), 1);
        match &mut self.0 {
            Side::Writing(bytes) => {
                bytes.extend_from_slice(known);
                None
            }
            Side::Reading { rest, error: None } => {
                let (read, after) = rest.split_at_checked(length)?;
                *rest = after;
                Some(read)
            }
            Side::Reading { .. } => None,
        }
    }

    /// Writes the length of a list whose items take `least` bytes each, or more. Or reads it and checks it
    /// against the remaining bytes; returns 0 if they cannot hold the list.
    pub fn length(&mut self, length: usize, least: usize) -> usize {
        // No memory holds that many items: reading would refuse a longer list.
        let written = u32::try_from(length).unwrap_or(u32::MAX);
        let read = u32::from_le_bytes(self.bytes(written.to_le_bytes())) as usize;
        let Side::Reading { rest, error } = &self.0 else { return length };
        match error {
            None if read.saturating_mul(least.max(1)) <= rest.len() => read,
            None => {
                self.refuse("a list is longer than they are");
                0
            }
            Some(_) => 0,
        }
    }

    /// One of the values in `of`, as its index.
    pub fn choice<T: Copy + PartialEq>(&mut self, value: &mut T, of: &[T]) {
        let place = of.iter().position(|v| v == value).unwrap_or(of.len());
        let [place] = self.bytes([place as u8]);
        match of.get(usize::from(place)) {
            Some(read) => *value = *read,
            None => self.refuse("a choice does not exist"),
        }
    }

    /// A list whose items own memory that can be reused. Surplus items go to
    /// `spare`, missing items come from `spare`.
    pub fn pooled<T: Memory + Default>(&mut self, list: &mut VecDeque<T>, spare: &mut Vec<T>) {
        let length = self.length(list.len(), 1);
        while list.len() > length {
            spare.extend(list.pop_back());
        }
        while list.len() < length {
            list.push_back(spare.pop().unwrap_or_default());
        }
        list.iter_mut().for_each(|item| item.remember(self));
    }
}

/// Writes [`Memory`] for a struct. First list the fields that are remembered, in order. After a
/// semicolon, list the other fields: the design gives them, or they hold nothing between two
/// calls. Every field must be listed.
///
/// ```
/// #[derive(Debug, Default)]
/// struct Clock {
///     period: f64,
///     ticks: u32,
///     last: Option<f64>,
/// }
/// fusion_core::memory!(Clock { ticks, last; period });
///
/// let mut bytes = Vec::new();
/// fusion_core::memory::save(&mut Clock { ticks: 3, ..Clock::default() }, &mut bytes);
/// let mut twin = Clock::default();
/// fusion_core::memory::restore(&mut twin, &bytes)?;
/// assert_eq!(twin.ticks, 3);
/// # Ok::<(), fusion_core::memory::Damaged>(())
/// ```
#[macro_export]
macro_rules! memory {
    ($type:ident { $($field:ident),* $(; $($constant:ident),+)? }) => {
        impl $crate::memory::Memory for $type {
            fn remember(&mut self, tape: &mut $crate::memory::Tape<'_>) {
                let Self { $($field,)* $($($constant: _,)+)? } = self;
                $($crate::memory::Memory::remember($field, tape);)*
                // Used even if no field is remembered.
                let _ = tape;
            }
        }
    };
}

/// Memory of numbers by their bytes.
macro_rules! by_bytes {
    ($($type:ty),*) => {
        $(impl Memory for $type {
            fn remember(&mut self, tape: &mut Tape<'_>) {
                *self = Self::from_le_bytes(tape.bytes(self.to_le_bytes()));
            }
        })*
    };
}

by_bytes!(u8, u16, u32, u64, i64, f32);

impl Memory for f64 {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        *self = Self::from_le_bytes(tape.bytes(self.to_le_bytes()));
    }

    fn remember_all(items: &mut [Self], tape: &mut Tape<'_>) {
        tape.numbers(items);
    }
}

impl Memory for usize {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut number = *self as u64;
        number.remember(tape);
        match Self::try_from(number) {
            Ok(number) => *self = number,
            Err(_) => tape.refuse("a number is too large for this machine"),
        }
    }
}

impl Memory for bool {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.choice(self, &[false, true]);
    }
}

impl Memory for Time {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut nanos = self.nanos();
        nanos.remember(tape);
        *self = Self::from_nanos(nanos);
    }
}

impl Memory for Range<usize> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.start.remember(tape);
        self.end.remember(tape);
    }
}

impl<const R: usize, const C: usize> Memory for SMatrix<f64, R, C> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(self.as_mut_slice());
    }
}

impl Memory for UnitQuaternion<f64> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.as_mut_unchecked().coords.remember(tape);
    }
}

/// The design gives the length.
impl Memory for DVector<f64> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(self.as_mut_slice());
    }
}

impl Memory for String {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let Some(read) = tape.blob(self.as_bytes()) else { return };
        match core::str::from_utf8(read) {
            Ok(read) if read == self => {}
            Ok(read) => *self = read.to_owned(),
            Err(_) => tape.refuse("a text is none"),
        }
    }
}

impl<T: Memory, const N: usize> Memory for [T; N] {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        T::remember_all(self, tape);
    }
}

impl<T: Memory> Memory for [T] {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        T::remember_all(self, tape);
    }
}

impl<T: Memory + ?Sized> Memory for Box<T> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        (**self).remember(tape);
    }
}

impl<T: Memory + Default> Memory for Option<T> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut is_some = self.is_some();
        is_some.remember(tape);
        if is_some {
            self.get_or_insert_default().remember(tape);
        } else {
            *self = None;
        }
    }
}

impl<T: Memory + Default> Memory for Vec<T> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let length = tape.length(self.len(), 1);
        self.resize_with(length, T::default);
        T::remember_all(self, tape);
    }
}

impl<T: Memory + Default> Memory for VecDeque<T> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let length = tape.length(self.len(), 1);
        self.resize_with(length, T::default);
        let (first, second) = self.as_mut_slices();
        T::remember_all(first, tape);
        T::remember_all(second, tape);
    }
}

impl<A: Array<Item: Memory + Default>> Memory for SmallVec<A> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let length = tape.length(self.len(), 1);
        self.resize_with(length, A::Item::default);
        A::Item::remember_all(self, tape);
    }
}

/// Memory of tuples.
macro_rules! by_parts {
    ($($name:ident),+) => {
        impl<$($name: Memory),+> Memory for ($($name,)+) {
            #[expect(non_snake_case, reason = "the names of the types")]
            fn remember(&mut self, tape: &mut Tape<'_>) {
                let ($($name,)+) = self;
                $($name.remember(tape);)+
            }
        }
    };
}

by_parts!(A, B);
by_parts!(A, B, C);
by_parts!(A, B, C, D);

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, Default, PartialEq)]
    struct Inner {
        names: Vec<f64>,
        text: String,
        last: Option<(Time, [f64; 2])>,
        limit: f64,
    }
    crate::memory!(Inner { names, text, last; limit });

    #[derive(Clone, Debug, Default, PartialEq)]
    struct Outer {
        count: usize,
        rows: VecDeque<Inner>,
        few: SmallVec<[u16; 2]>,
        is_on: bool,
        q: UnitQuaternion<f64>,
    }
    crate::memory!(Outer {
        count,
        rows,
        few,
        is_on,
        q
    });

    fn outer() -> Outer {
        let inner = |k: usize| Inner {
            names: (0..k).map(|i| 1.0 / (i as f64 - 1.0)).collect(),
            text: "σ".repeat(k),
            last: (k > 1).then_some((Time::from_nanos(-5), [0.1, -0.0])),
            limit: 0.0,
        };
        Outer {
            count: 7,
            rows: (0..4).map(inner).collect(),
            few: (0..5).collect(),
            is_on: true,
            q: UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
        }
    }

    fn bytes_of(outer: &mut Outer) -> Vec<u8> {
        let mut bytes = Vec::new();
        save(outer, &mut bytes);
        bytes
    }

    #[test]
    fn what_is_written_is_read_bit_for_bit_and_constants_stay() {
        let bytes = bytes_of(&mut outer());
        let mut twin = Outer::default();
        twin.rows.resize(
            9,
            Inner {
                limit: 2.0,
                ..Inner::default()
            },
        );
        restore(&mut twin, &bytes).unwrap();
        assert_eq!(twin.rows.len(), 4);
        assert!(twin.rows.iter().all(|row| row.limit == 2.0));
        twin.rows.iter_mut().for_each(|row| row.limit = 0.0);
        assert_eq!(twin, outer());
        assert_eq!(bytes_of(&mut twin), bytes);
    }

    #[test]
    fn bytes_that_end_early_or_late_change_nothing() {
        let mut bytes = bytes_of(&mut outer());
        let mut twin = outer();
        (twin.count, twin.few[0]) = (1, 9);
        let before = twin.clone();
        for end in 0..bytes.len() {
            restore(&mut twin, &bytes[..end]).unwrap_err();
            assert_eq!(twin, before, "{end} bytes");
        }
        bytes.push(0);
        assert_eq!(restore(&mut twin, &bytes), Err(Damaged("there are too many")));
        assert_eq!(twin, before);
    }

    #[test]
    fn a_length_beyond_the_bytes_reserves_nothing() {
        let bytes = [0xff, 0xff, 0xff, 0xff, 1, 2, 3];
        let mut list: Vec<Inner> = Vec::new();
        assert_eq!(recall(&mut list, &bytes), Err(Damaged("a list is longer than they are")));
        assert_eq!(list.capacity(), 0);
    }

    #[test]
    fn any_bytes_at_all_are_read_without_a_panic() {
        let mut random = crate::testing::Lcg::new(5);
        let whole = bytes_of(&mut outer());
        for _ in 0..20_000 {
            let mut bytes = whole.clone();
            for _ in 0..4 {
                let at = (random.unit() * bytes.len() as f64) as usize;
                bytes[at] = (random.unit() * 256.0) as u8;
            }
            let _ = restore(&mut outer(), &bytes);
        }
    }
}
