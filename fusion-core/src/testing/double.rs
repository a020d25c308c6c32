//! Double-double arithmetic: an oracle of 32 digits for what doubles round.
//!
//! A number is the sum of two doubles that do not overlap (Dekker 1971).

use core::ops::{Add, Div, Mul, Sub};

/// high + low, low at most half a unit of the last place of high.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Double(f64, f64);

impl From<f64> for Double {
    fn from(value: f64) -> Self {
        Self(value, 0.0)
    }
}

impl From<Double> for f64 {
    fn from(value: Double) -> Self {
        value.0 + value.1
    }
}

/// a + b exactly.
fn sum(a: f64, b: f64) -> Double {
    let s = a + b;
    let t = s - a;
    Double(s, (a - (s - t)) + (b - t))
}

impl Add for Double {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let s = sum(self.0, other.0);
        sum(s.0, s.1 + self.1 + other.1)
    }
}

impl Sub for Double {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + Self(-other.0, -other.1)
    }
}

impl Mul for Double {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = self.0 * other.0;
        let rest = self.0.mul_add(other.0, -p);
        sum(p, rest + self.0 * other.1 + self.1 * other.0)
    }
}

impl Div for Double {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.0 / other.0;
        let rest = self - other * Self::from(first);
        let second = rest.0 / other.0;
        let rest = rest - other * Self::from(second);
        Self::from(first) + Self::from(second) + Self::from(rest.0 / other.0)
    }
}

#[test]
fn it_has_thirty_digits() {
    let third = Double::from(1.0) / Double::from(3.0);
    let off = third * Double::from(3.0) - Double::from(1.0);
    // 1e-31: a few roundings of 2⁻¹⁰⁶.
    assert!(f64::from(off).abs() < 1e-31);
    let tiny = Double::from(1.0) + Double::from(1e-25) - Double::from(1.0);
    assert!((f64::from(tiny) / 1e-25 - 1.0).abs() < 1e-6, "32 digits, of which 25 cancel");
}
