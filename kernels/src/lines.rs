//! Numbers whose rows of eight begin where the processor's cache lines do.

use core::ops::{Deref, DerefMut};

/// A cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Line([f64; 8]);

/// A list of numbers, aligned to 64 bytes. It is read and written as a slice.
#[derive(Clone, Debug)]
pub struct Lines {
    lines: Vec<Line>,
    len: usize,
}

impl Lines {
    /// `len` zeros.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        Self {
            lines: vec![Line([0.0; 8]); len.div_ceil(8)],
            len,
        }
    }
}

impl Deref for Lines {
    type Target = [f64];

    #[inline]
    fn deref(&self) -> &[f64] {
        #[expect(unsafe_code, reason = "no safe view of a list of arrays keeps their alignment")]
        // SAFETY: a `Line` is eight numbers without padding, its size being its alignment, and there
        // are at least `len` of them in a row.
        unsafe {
            core::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len)
        }
    }
}

impl DerefMut for Lines {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        #[expect(unsafe_code, reason = "as above")]
        // SAFETY: as above, and the borrow is unique.
        unsafe {
            core::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len)
        }
    }
}
