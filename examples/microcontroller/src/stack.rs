//! How deep the stack has been: a part of it is filled with a pattern at first, and what is left of that is counted.

use core::hint::black_box;
use core::ptr;

const PATTERN: u32 = 0xa5a5_5a5a;
const WORDS: usize = 16 * 1024;
/// The frame of the function that fills, which must not fill itself.
const MARGIN: usize = 64;

/// A part of the stack below the caller.
pub struct Painted {
    top: *const u32,
}

impl Painted {
    #[inline(never)]
    pub fn new() -> Self {
        let here = black_box(0_u32);
        let top = (&raw const here).wrapping_sub(MARGIN);
        for k in 1..=WORDS {
            // SAFETY: the boards have megabytes of memory below the stack pointer, which nothing uses.
            unsafe { ptr::write_volatile(top.wrapping_sub(k).cast_mut(), PATTERN) }
        }
        Self { top }
    }

    /// The bytes that were used since, or all that were painted.
    #[inline(never)]
    pub fn used(&self) -> usize {
        let is_left = |k: &usize| {
            // SAFETY: as above.
            unsafe { ptr::read_volatile(self.top.wrapping_sub(*k)) == PATTERN }
        };
        let left = (1..=WORDS).rev().take_while(is_left).count();
        (WORDS - left + MARGIN) * size_of::<u32>()
    }
}
