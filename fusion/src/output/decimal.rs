//! Numbers as decimal text, rounded exactly: to the byte what `{:.N}` and `{:.Ne}` write, at a tenth of the time.
//!
//! With |x| = m 2^e, m < 2^53, the digits of x·10^p are the whole number m 5^p 2^(e+p). The bits that are shifted
//! out decide the rounding: nothing is lost before, and halves go to the even digit, as in `core::fmt`.
//! `core::fmt` writes numbers with more than 64 bits of digits or p > 27, and numbers that are not finite.

use std::io::Write;

/// 5^p for the powers that have their digits in 64 bits.
const FIVES: [u64; 28] = {
    let mut powers = [1; 28];
    let mut p = 1;
    while p < powers.len() {
        powers[p] = 5 * powers[p - 1];
        p += 1;
    }
    powers
};

/// 10^p in 64 bits.
const TENS: [u64; 20] = {
    let mut powers = [1; 20];
    let mut p = 1;
    while p < powers.len() {
        powers[p] = 10 * powers[p - 1];
        p += 1;
    }
    powers
};

/// The most decimals that are not left to `core::fmt`: with the digit before them they are fewer than 20, those of
/// 64 bits.
const MOST: usize = 17;

/// "00", "01", … "99".
const PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[b'0'; 2]; 100];
    let mut k = 0;
    while k < pairs.len() {
        pairs[k] = [b'0' + (k / 10) as u8, b'0' + (k % 10) as u8];
        k += 1;
    }
    pairs
};

/// Appends `x` with this number of decimals: `{x:.decimals$}`.
pub(super) fn fixed(out: &mut Vec<u8>, x: f64, decimals: usize) {
    let parts = Parts::of(x).filter(|_| decimals <= MOST);
    match parts.and_then(|parts| parts.times_ten_to(decimals)) {
        Some(digits) => {
            let mut text = Text::new();
            text.pointed(digits, decimals);
            text.sign(x);
            text.append_to(out);
        }
        None => by_fmt(write!(out, "{x:.decimals$}")),
    }
}

/// Appends `x` with one digit before the point, this number of decimals and an exponent: `{x:.decimals$e}`.
pub(super) fn scientific(out: &mut Vec<u8>, x: f64, decimals: usize) {
    let parts = Parts::of(x).filter(|_| decimals <= MOST);
    match parts.and_then(|parts| parts.significant(decimals)) {
        Some((digits, exponent)) => {
            let mut text = Text::new();
            text.digits(u64::from(exponent.unsigned_abs()), 1);
            if exponent < 0 {
                text.byte(b'-');
            }
            text.byte(b'e');
            text.pointed(digits, decimals);
            text.sign(x);
            text.append_to(out);
        }
        None => by_fmt(write!(out, "{x:.decimals$e}")),
    }
}

/// Writing into memory does not fail.
fn by_fmt(written: std::io::Result<()>) {
    debug_assert!(written.is_ok(), "memory takes what is written");
}

/// A number, written from its end to its beginning.
struct Text {
    bytes: [u8; LONGEST],
    start: usize,
}

/// Sign, 20 digits of 64 bits or more zeros, point, `e-`, three digits of an exponent.
const LONGEST: usize = 32;

impl Text {
    const fn new() -> Self {
        Self {
            bytes: [b'0'; LONGEST],
            start: LONGEST,
        }
    }

    fn byte(&mut self, byte: u8) {
        self.start -= 1;
        self.bytes[self.start] = byte;
    }

    /// A negative zero has its sign, as everything that is rounded to it.
    fn sign(&mut self, x: f64) {
        if x.is_sign_negative() {
            self.byte(b'-');
        }
    }

    /// `number` with so many digits at least.
    fn digits(&mut self, mut number: u64, least: usize) {
        let end = self.start;
        while number >= 10 {
            self.start -= 2;
            self.bytes[self.start..self.start + 2].copy_from_slice(&PAIRS[(number % 100) as usize]);
            number /= 100;
        }
        if number > 0 {
            self.byte(b'0' + number as u8);
        }
        // Zeros are there already.
        self.start = self.start.min(end - least);
    }

    /// `number` / 10^`decimals`.
    fn pointed(&mut self, number: u64, decimals: usize) {
        if decimals > 0 {
            self.digits(number % TENS[decimals], decimals);
            self.byte(b'.');
        }
        self.digits(number / TENS[decimals], 1);
    }

    fn append_to(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.bytes[self.start..]);
    }
}

/// |x| = m 2^e of a finite x.
#[derive(Clone, Copy, Debug)]
struct Parts {
    m: u64,
    e: i32,
}

impl Parts {
    fn of(x: f64) -> Option<Self> {
        let bits = x.to_bits();
        let (exponent, fraction) = ((bits >> 52) as i32 & 0x7ff, bits & ((1 << 52) - 1));
        match exponent {
            0x7ff => None,
            0 => Some(Self { m: fraction, e: -1074 }),
            _ => Some(Self {
                m: fraction | 1 << 52,
                e: exponent - 1075,
            }),
        }
    }

    /// m 2^e 10^p rounded to a whole number, halves to even; `None` where it has more than 64 bits or p is too large.
    fn times_ten_to(self, p: usize) -> Option<u64> {
        let product = u128::from(self.m) * u128::from(*FIVES.get(p)?);
        let shift = self.e + p as i32;
        if shift >= 0 {
            let fits = shift as u32 <= product.leading_zeros();
            return fits.then(|| u64::try_from(product << shift).ok())?;
        }
        let out = shift.unsigned_abs();
        if out >= u128::BITS {
            // Below 2^116 2^-128.
            return Some(0);
        }
        let (kept, half) = (product >> out, 1_u128 << (out - 1));
        let left = product & (half | (half - 1));
        let is_up = left > half || left == half && kept & 1 == 1;
        u64::try_from(kept + u128::from(is_up)).ok()
    }

    /// As many digits as `decimals` and one, and the exponent of ten of the first.
    fn significant(self, decimals: usize) -> Option<(u64, i32)> {
        if self.m == 0 {
            return Some((0, 0));
        }
        // ⌊b log₁₀ 2⌋ of |x| in 2^b … 2^(b+1), exact: no b log₁₀ 2 of a double lies within 1e-6 of a whole number but 0.
        let b = i64::from(self.e + 63 - self.m.leading_zeros() as i32);
        let least = ((b * 1_292_913_986) >> 32) as i32;
        let at = |exponent: i32| self.times_ten_to(usize::try_from(decimals as i32 - exponent).ok()?);
        let found = at(least)?;
        if found < TENS[decimals + 1] {
            return Some((found, least));
        }
        // The next power of ten lies below |x|, or is what it rounds to.
        Some((at(least + 1)?, least + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn both(x: f64, decimals: usize) -> Result<(), TestCaseError> {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        fixed(&mut a, x, decimals);
        scientific(&mut b, x, decimals);
        let text = |bytes| String::from_utf8(bytes).unwrap();
        prop_assert_eq!(text(a), format!("{x:.decimals$}"), "{:?}", x);
        prop_assert_eq!(text(b), format!("{x:.decimals$e}"), "{:?}", x);
        Ok(())
    }

    /// A generator that needs no time: a step of xorshift64*.
    struct Bits(u64);

    impl Bits {
        fn next(&mut self) -> u64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
        }

        fn below(&mut self, n: u64) -> u64 {
            ((self.next() >> 32) * n) >> 32
        }
    }

    /// Of any size that a state may have, with the decimals that the files have.
    #[test]
    fn random_numbers_are_written_as_the_standard_library_does() {
        let mut bits = Bits(0x9E37_79B9_7F4A_7C15);
        for _ in 0..1_000_000 {
            let exponent = bits.below(100) as i32 - 60;
            let x = (bits.next() as i64 as f64) * 2_f64.powi(exponent - 20);
            both(x, bits.below(12) as usize).unwrap();
        }
    }

    /// A number of few bits has a decimal expansion that ends: cut before its last digit, it is a tie, or near one.
    #[test]
    fn ties_go_to_the_even_digit() {
        let mut bits = Bits(7);
        let mut ties = 0;
        for _ in 0..1_000_000 {
            let (halvings, whole) = (1 + bits.below(17) as i32, bits.below(1 << 20));
            let odd = (2 * whole + 1) as f64 * 2_f64.powi(-halvings);
            // With one decimal less than it has, the digit left out is 5.
            both(odd, halvings as usize - 1).unwrap();
            both(-odd, halvings as usize - 1).unwrap();
            let near = f64::from_bits(odd.to_bits() + bits.below(3) - 1);
            both(near, halvings as usize - 1).unwrap();
            // Of scientific notation too: as many digits as there are, less one.
            let text = format!("{odd:e}");
            let decimals = text.split('e').next().map_or(0, |m| m.len().saturating_sub(2));
            both(odd, decimals.saturating_sub(1)).unwrap();
            ties += u32::from(decimals > 0);
        }
        assert!(ties > 900_000);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200_000))]

        /// Not-a-number, infinite, subnormal and zero among them.
        #[test]
        fn any_bits_are_written_as_the_standard_library_does(bits in any::<u64>(), decimals in 0..20_usize) {
            both(f64::from_bits(bits), decimals)?;
        }
    }

    #[test]
    fn the_edges_of_the_range_are_written_as_the_standard_library_does() {
        let powers = (-30..=30).map(|k| 10_f64.powi(k)).chain((-1074..=1023).map(|k| 2_f64.powi(k)));
        let edges = [
            0.0,
            f64::MIN_POSITIVE,
            f64::MAX,
            f64::INFINITY,
            f64::NAN,
            0.5,
            1.5,
            2.5,
            9.5,
            0.95,
            99.995,
            1e15 + 0.5,
        ];
        for x in edges.into_iter().chain(powers) {
            for near in [x, x.next_up(), x.next_down()].into_iter().flat_map(|x| [x, -x]) {
                (0..=25).for_each(|decimals| both(near, decimals).unwrap());
            }
        }
    }
}
