//! A small seeded generator, so that a law fails again where it failed.

/// Knuth's 64-bit linear congruential generator (MMIX constants), upper half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lcg(u64);

impl Lcg {
    /// From a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed ^ 0x9e37_79b9_7f4a_7c15)
    }

    /// Uniform in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as f64 / f64::from(1_u32 << 31) - 1.0
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        0.5 * (self.signed() + 1.0)
    }

    /// Near enough to normal: the sum of twelve uniform numbers.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}
