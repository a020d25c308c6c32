//! Numbers whose rows of eight begin where the processor's cache lines do.

use alloc::vec::Vec;
use core::ops::{Deref, DerefMut};

/// A cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Line([f64; 8]);

/// A list of numbers, aligned to 64 bytes. It is read and written as a slice.
#[derive(Clone, Debug, Default)]
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

    /// Writes a block of a matrix whose rows are `ld` long: its rows, one after the other, the first from
    /// `at` on.
    ///
    /// # Panics
    /// Where the matrix ends before the block.
    #[inline(always)]
    pub fn put<const R: usize, const C: usize>(&mut self, at: usize, ld: usize, block: &[[f64; C]; R]) {
        let end = at.saturating_add(ld.saturating_mul(R.saturating_sub(1))).saturating_add(C);
        assert!(end <= self.len, "a block ends behind its matrix");
        let first = self.lines.as_mut_ptr().cast::<f64>();
        for (i, row) in block.iter().enumerate() {
            #[expect(unsafe_code, reason = "one test for a block, not one for each of its rows")]
            // SAFETY: row i ends at `at + i ld + C`, which is not behind `end`, and that not behind the
            // `len` numbers that there are; the borrow is unique.
            unsafe {
                first.add(at + i * ld).cast::<[f64; C]>().write(*row);
            }
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
