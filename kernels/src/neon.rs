//! NEON, which every 64-bit ARM processor has.
#![expect(unsafe_code, reason = "intrinsics; loads and stores take pointers")]

use crate::lanes::{FIRST, Lanes};
use core::arch::aarch64::*;

/// Four registers of two.
#[derive(Clone, Copy)]
pub(crate) struct Neon([float64x2_t; 4]);

impl Neon {
    #[inline(always)]
    fn with(mut self, other: Self, f: impl Fn(float64x2_t, float64x2_t) -> float64x2_t) -> Self {
        for k in 0..4 {
            self.0[k] = f(self.0[k], other.0[k]);
        }
        self
    }
}

// SAFETY of every block here: the architecture has NEON, and pointers come from references to eight
// numbers.
impl Lanes for Neon {
    const TILES: usize = 2;
    const ROWS: usize = 4;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe { Self([vdupq_n_f64(value); 4]) }
    }
    #[inline(always)]
    fn load(from: &[f64; 8]) -> Self {
        let mut out = Self::splat(0.0);
        for k in 0..4 {
            out.0[k] = unsafe { vld1q_f64(from.as_ptr().add(2 * k)) };
        }
        out
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        for k in 0..4 {
            unsafe { vst1q_f64(to.as_mut_ptr().add(2 * k), self.0[k]) };
        }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| unsafe { vaddq_f64(a, b) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| unsafe { vmulq_f64(a, b) })
    }
    #[inline(always)]
    fn mul_add(mut self, by: Self, to: Self) -> Self {
        for k in 0..4 {
            self.0[k] = unsafe { vfmaq_f64(to.0[k], self.0[k], by.0[k]) };
        }
        self
    }
    #[inline(always)]
    fn mul_sub_from(mut self, by: Self, from: Self) -> Self {
        for k in 0..4 {
            self.0[k] = unsafe { vfmsq_f64(from.0[k], self.0[k], by.0[k]) };
        }
        self
    }
    #[inline(always)]
    fn sub_from(self, from: Self) -> Self {
        self.with(from, |a, b| unsafe { vsubq_f64(b, a) })
    }
    #[inline(always)]
    fn after(mut self, count: usize, first: Self) -> Self {
        for k in 0..4 {
            self.0[k] = unsafe { vbslq_f64(vld1q_u64(FIRST[count].as_ptr().add(2 * k)), first.0[k], self.0[k]) };
        }
        self
    }
    #[inline(always)]
    fn transpose(rows: [Self; 8]) -> [Self; 8] {
        let mut out = rows;
        for i in 0..4 {
            for j in 0..4 {
                let (a, b) = (rows[2 * i].0[j], rows[2 * i + 1].0[j]);
                out[2 * j].0[i] = unsafe { vzip1q_f64(a, b) };
                out[2 * j + 1].0[i] = unsafe { vzip2q_f64(a, b) };
            }
        }
        out
    }
}
