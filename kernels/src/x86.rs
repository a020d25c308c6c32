//! AVX-512 and AVX2 with fused multiply-add.
#![expect(
    unsafe_code,
    reason = "intrinsics need the features of the processor, which `dispatch` enables in every function that names these types"
)]

use crate::lanes::{FIRST, Lanes};
use core::arch::x86_64::*;

/// One register of eight.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512d);

/// Two registers of four.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256d, __m256d);

// SAFETY of every block here: the type is named in functions with AVX-512F enabled only, and the
// pointers come from references to eight numbers.
impl Lanes for Avx512 {
    const TILES: usize = 3;
    const ROWS: usize = 8;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe { Self(_mm512_set1_pd(value)) }
    }
    #[inline(always)]
    fn load(from: &[f64; 8]) -> Self {
        unsafe { Self(_mm512_loadu_pd(from.as_ptr())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm512_add_pd(self.0, other.0)) }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { Self(_mm512_mul_pd(self.0, other.0)) }
    }
    #[inline(always)]
    fn mul_add(self, by: Self, to: Self) -> Self {
        unsafe { Self(_mm512_fmadd_pd(self.0, by.0, to.0)) }
    }
    #[inline(always)]
    fn mul_sub_from(self, by: Self, from: Self) -> Self {
        unsafe { Self(_mm512_fnmadd_pd(self.0, by.0, from.0)) }
    }
    #[inline(always)]
    fn sub_from(self, from: Self) -> Self {
        unsafe { Self(_mm512_sub_pd(from.0, self.0)) }
    }
    #[inline(always)]
    fn after(self, count: usize, first: Self) -> Self {
        unsafe { Self(_mm512_mask_blend_pd((1_u8 << count) - 1, self.0, first.0)) }
    }
    #[inline(always)]
    fn transpose(r: [Self; 8]) -> [Self; 8] {
        unsafe {
            let even = [
                _mm512_unpacklo_pd(r[0].0, r[1].0),
                _mm512_unpacklo_pd(r[2].0, r[3].0),
                _mm512_unpacklo_pd(r[4].0, r[5].0),
                _mm512_unpacklo_pd(r[6].0, r[7].0),
            ];
            let odd = [
                _mm512_unpackhi_pd(r[0].0, r[1].0),
                _mm512_unpackhi_pd(r[2].0, r[3].0),
                _mm512_unpackhi_pd(r[4].0, r[5].0),
                _mm512_unpackhi_pd(r[6].0, r[7].0),
            ];
            let [c0, c2, c4, c6] = pairs(even);
            let [c1, c3, c5, c7] = pairs(odd);
            [Self(c0), Self(c1), Self(c2), Self(c3), Self(c4), Self(c5), Self(c6), Self(c7)]
        }
    }
    #[inline(always)]
    fn sums(r: [Self; 8]) -> Self {
        unsafe {
            // Two rows: their sums of neighbours, by turns.
            let both = |a: Self, b: Self| _mm512_add_pd(_mm512_unpacklo_pd(a.0, b.0), _mm512_unpackhi_pd(a.0, b.0));
            let half = |a, b| _mm512_add_pd(_mm512_shuffle_f64x2::<0x88>(a, b), _mm512_shuffle_f64x2::<0xdd>(a, b));
            let low = half(both(r[0], r[1]), both(r[2], r[3]));
            let high = half(both(r[4], r[5]), both(r[6], r[7]));
            Self(half(low, high))
        }
    }
}

/// Pairs of four columns, by rows, into these columns.
#[inline(always)]
unsafe fn pairs(t: [__m512d; 4]) -> [__m512d; 4] {
    unsafe {
        let (a, b) = (_mm512_shuffle_f64x2::<0x88>(t[0], t[1]), _mm512_shuffle_f64x2::<0x88>(t[2], t[3]));
        let (c, d) = (_mm512_shuffle_f64x2::<0xdd>(t[0], t[1]), _mm512_shuffle_f64x2::<0xdd>(t[2], t[3]));
        [
            _mm512_shuffle_f64x2::<0x88>(a, b),
            _mm512_shuffle_f64x2::<0x88>(c, d),
            _mm512_shuffle_f64x2::<0xdd>(a, b),
            _mm512_shuffle_f64x2::<0xdd>(c, d),
        ]
    }
}

// SAFETY: as above, with AVX2 and FMA.
impl Lanes for Avx2 {
    const TILES: usize = 2;
    const ROWS: usize = 4;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe {
            let v = _mm256_set1_pd(value);
            Self(v, v)
        }
    }
    #[inline(always)]
    fn load(from: &[f64; 8]) -> Self {
        unsafe { Self(_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from.as_ptr().add(4))) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        unsafe {
            _mm256_storeu_pd(to.as_mut_ptr(), self.0);
            _mm256_storeu_pd(to.as_mut_ptr().add(4), self.1);
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
    }
    #[inline(always)]
    fn mul_add(self, by: Self, to: Self) -> Self {
        unsafe { Self(_mm256_fmadd_pd(self.0, by.0, to.0), _mm256_fmadd_pd(self.1, by.1, to.1)) }
    }
    #[inline(always)]
    fn mul_sub_from(self, by: Self, from: Self) -> Self {
        unsafe { Self(_mm256_fnmadd_pd(self.0, by.0, from.0), _mm256_fnmadd_pd(self.1, by.1, from.1)) }
    }
    #[inline(always)]
    fn sub_from(self, from: Self) -> Self {
        unsafe { Self(_mm256_sub_pd(from.0, self.0), _mm256_sub_pd(from.1, self.1)) }
    }
    #[inline(always)]
    fn after(self, count: usize, first: Self) -> Self {
        unsafe {
            let mask = FIRST[count].as_ptr().cast::<f64>();
            Self(
                _mm256_blendv_pd(self.0, first.0, _mm256_loadu_pd(mask)),
                _mm256_blendv_pd(self.1, first.1, _mm256_loadu_pd(mask.add(4))),
            )
        }
    }
    #[inline(always)]
    fn transpose(r: [Self; 8]) -> [Self; 8] {
        unsafe {
            let a = quarter([r[0].0, r[1].0, r[2].0, r[3].0]);
            let b = quarter([r[4].0, r[5].0, r[6].0, r[7].0]);
            let c = quarter([r[0].1, r[1].1, r[2].1, r[3].1]);
            let d = quarter([r[4].1, r[5].1, r[6].1, r[7].1]);
            [
                Self(a[0], b[0]),
                Self(a[1], b[1]),
                Self(a[2], b[2]),
                Self(a[3], b[3]),
                Self(c[0], d[0]),
                Self(c[1], d[1]),
                Self(c[2], d[2]),
                Self(c[3], d[3]),
            ]
        }
    }
}

/// A 4×4 transpose.
#[inline(always)]
unsafe fn quarter(r: [__m256d; 4]) -> [__m256d; 4] {
    unsafe {
        let (a, b) = (_mm256_unpacklo_pd(r[0], r[1]), _mm256_unpackhi_pd(r[0], r[1]));
        let (c, d) = (_mm256_unpacklo_pd(r[2], r[3]), _mm256_unpackhi_pd(r[2], r[3]));
        [
            _mm256_permute2f128_pd::<0x20>(a, c),
            _mm256_permute2f128_pd::<0x20>(b, d),
            _mm256_permute2f128_pd::<0x31>(a, c),
            _mm256_permute2f128_pd::<0x31>(b, d),
        ]
    }
}
