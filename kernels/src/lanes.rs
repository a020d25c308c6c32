//! Eight numbers at a time, with the best instructions of the processor.

/// Eight numbers for parallel arithmetic.
///
/// Only [`crate::dispatch`] names a type with intrinsics, in functions that have the processor features enabled. The
/// methods of the type are inlined there.
pub(crate) trait Lanes: Copy {
    /// Tiles of eight columns that are computed at once for three rows: as many as the registers hold.
    const TILES: usize;
    /// Rows of one tile that are computed at once.
    const ROWS: usize;
    fn splat(value: f64) -> Self;
    fn load(from: &[f64; 8]) -> Self;
    fn store(self, to: &mut [f64; 8]);
    fn add(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// self · by + to.
    fn mul_add(self, by: Self, to: Self) -> Self;
    /// from − self · by.
    fn mul_sub_from(self, by: Self, from: Self) -> Self;
    /// from − self.
    fn sub_from(self, from: Self) -> Self;
    /// The first `count` lanes of `first`, then those of `self`; `count` is below 8.
    fn after(self, count: usize, first: Self) -> Self;
    /// Exchanges rows and columns.
    fn transpose(rows: [Self; 8]) -> [Self; 8];
    /// For each row, the sum of its lanes: ((0 + 1) + (2 + 3)) + ((4 + 5) + (6 + 7)).
    #[inline(always)]
    fn sums(rows: [Self; 8]) -> Self {
        let t = Self::transpose(rows);
        let (low, high) = (t[0].add(t[1]).add(t[2].add(t[3])), t[4].add(t[5]).add(t[6].add(t[7])));
        low.add(high)
    }
}

/// rows · columns, or the largest number on overflow. No slice is that long. A product that wraps around would let a
/// short slice pass the check.
#[inline(always)]
pub(crate) const fn size(rows: usize, columns: usize) -> usize {
    rows.saturating_mul(columns)
}

/// `slice[at..at + N]`, checked in builds with debug assertions only.
///
/// # Safety
/// The slice has at least `at + N` elements.
#[expect(
    unsafe_code,
    reason = "bounds are checked once per product: in its inner loops they cost as much as the arithmetic"
)]
#[inline(always)]
pub(crate) unsafe fn some<T, const N: usize>(slice: &[T], at: usize) -> &[T; N] {
    debug_assert!(at + N <= slice.len());
    // SAFETY: as the caller promises.
    unsafe { &*slice.as_ptr().add(at).cast() }
}

/// The same, mutable.
///
/// # Safety
/// As for [`some`].
#[expect(unsafe_code, reason = "as above")]
#[inline(always)]
pub(crate) unsafe fn some_mut<T, const N: usize>(slice: &mut [T], at: usize) -> &mut [T; N] {
    debug_assert!(at + N <= slice.len());
    // SAFETY: as the caller promises.
    unsafe { &mut *slice.as_mut_ptr().add(at).cast() }
}

/// Plain numbers for every processor, without fused multiply-add.
#[derive(Clone, Copy)]
pub(crate) struct Plain([f64; 8]);

impl Plain {
    #[inline(always)]
    fn with(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for k in 0..8 {
            self.0[k] = f(self.0[k], other.0[k]);
        }
        self
    }
}

impl Lanes for Plain {
    const TILES: usize = 1;
    const ROWS: usize = 4;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn load(from: &[f64; 8]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        *to = self.0;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
    #[inline(always)]
    fn mul_add(self, by: Self, to: Self) -> Self {
        self.mul(by).add(to)
    }
    #[inline(always)]
    fn mul_sub_from(self, by: Self, from: Self) -> Self {
        self.mul(by).sub_from(from)
    }
    #[inline(always)]
    fn sub_from(self, from: Self) -> Self {
        self.with(from, |a, b| b - a)
    }
    #[inline(always)]
    fn after(mut self, count: usize, first: Self) -> Self {
        for k in 0..8 {
            if k < count {
                self.0[k] = first.0[k];
            }
        }
        self
    }
    #[inline(always)]
    fn transpose(rows: [Self; 8]) -> [Self; 8] {
        let mut out = rows;
        for i in 0..8 {
            for j in 0..8 {
                out[j].0[i] = rows[i].0[j];
            }
        }
        out
    }
}

/// For each count, the lanes that come from the first operand: a lane has all bits set or none.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub(crate) static FIRST: [[u64; 8]; 8] = {
    let mut masks = [[0; 8]; 8];
    let mut count = 0;
    while count < 8 {
        let mut k = 0;
        while k < count {
            masks[count][k] = u64::MAX;
            k += 1;
        }
        count += 1;
    }
    masks
};
