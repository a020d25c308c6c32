//! Functions of real numbers. All crates of the framework call these instead of the methods of `f64`.
//!
//! | feature | computed by | results |
//! |---|---|---|
//! | none | the library of the platform | the last digit may differ between platforms |
//! | `libm` | the crate `libm`, in Rust | the same bits on every platform |
//!
//! Angles are in radians. The square root and rounding are exact on every platform. The kernels of linear
//! algebra are not included: they differ by their lanes ([`Kernel`](crate::Kernel)).

use core::cmp::Ordering;
#[cfg(not(feature = "libm"))]
use platform as chosen;
#[cfg(feature = "libm")]
use portable as chosen;

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident($($x:ident),+) = $libm:ident;)+) => {
        $(
            $(#[$doc])*
            #[inline]
            #[must_use]
            pub fn $name($($x: f64),+) -> f64 {
                chosen::$name($($x),+)
            }
        )+

        #[cfg(any(not(feature = "libm"), test))]
        #[cfg_attr(not(test), expect(clippy::disallowed_methods, reason = "the one place for them"))]
        mod platform {
            $(
                #[inline]
                pub(super) fn $name($($x: f64),+) -> f64 {
                    f64::$name($($x),+)
                }
            )+

            #[inline]
            pub(super) fn sin_cos(x: f64) -> (f64, f64) {
                x.sin_cos()
            }

            #[inline]
            pub(super) fn powi(x: f64, n: i32) -> f64 {
                x.powi(n)
            }
        }

        #[cfg(any(feature = "libm", test))]
        mod portable {
            $(
                #[inline]
                pub(super) fn $name($($x: f64),+) -> f64 {
                    libm::$libm($($x),+)
                }
            )+

            #[inline]
            pub(super) fn sin_cos(x: f64) -> (f64, f64) {
                libm::sincos(x)
            }

            /// By repeated squaring: the same products on every platform.
            pub(super) fn powi(x: f64, n: i32) -> f64 {
                let (mut power, mut square, mut rest) = (1.0, x, n.unsigned_abs());
                while rest > 0 {
                    if rest % 2 == 1 {
                        power *= square;
                    }
                    square *= square;
                    rest /= 2;
                }
                if n < 0 { 1.0 / power } else { power }
            }
        }

        /// Each function by both, for the tests.
        #[cfg(test)]
        const BOTH: &[(&str, fn(f64) -> f64, fn(f64) -> f64)] = &[$(
            (stringify!($name), |x| functions!(@one platform $name x $($x),+), |x| functions!(@one portable $name x $($x),+)),
        )+];
    };
    (@one $by:ident $name:ident $value:ident $x:ident) => { $by::$name($value) };
    (@one $by:ident $name:ident $value:ident $x:ident, $y:ident) => { $by::$name($value, 0.75) };
}

functions! {
    /// sin x.
    sin(x) = sin;
    /// cos x.
    cos(x) = cos;
    /// tan x.
    tan(x) = tan;
    /// arcsin x, in −π/2 … π/2; NaN outside of −1 … 1.
    asin(x) = asin;
    /// arccos x, in 0 … π; NaN outside of −1 … 1.
    acos(x) = acos;
    /// arctan x, in −π/2 … π/2.
    atan(x) = atan;
    /// The angle of the point (x, y), in −π … π.
    atan2(y, x) = atan2;
    /// The square root; NaN below zero.
    sqrt(x) = sqrt;
    /// eˣ.
    exp(x) = exp;
    /// eˣ − 1, exact for small x.
    exp_m1(x) = expm1;
    /// 2ˣ.
    exp2(x) = exp2;
    /// sinh x.
    sinh(x) = sinh;
    /// cosh x.
    cosh(x) = cosh;
    /// tanh x.
    tanh(x) = tanh;
    /// artanh x; infinite at −1 and 1, NaN beyond.
    atanh(x) = atanh;
    /// The natural logarithm.
    ln(x) = log;
    /// ln(1 + x), exact for small x.
    ln_1p(x) = log1p;
    /// The logarithm to the base 10.
    log10(x) = log10;
    /// xʸ.
    powf(x, y) = pow;
    /// √(x² + y²).
    hypot(x, y) = hypot;
    /// The largest integer that is not above x.
    floor(x) = floor;
    /// The smallest integer that is not below x.
    ceil(x) = ceil;
    /// The nearest integer, halves away from zero.
    round(x) = round;
    /// The integer part.
    trunc(x) = trunc;
}

/// (sin x, cos x).
#[inline]
#[must_use]
pub fn sin_cos(x: f64) -> (f64, f64) {
    chosen::sin_cos(x)
}

/// x without its integer part, with the sign of x.
#[inline]
#[must_use]
pub fn fract(x: f64) -> f64 {
    x - trunc(x)
}

/// xⁿ.
#[inline]
#[must_use]
pub fn powi(x: f64, n: i32) -> f64 {
    chosen::powi(x, n)
}

/// x within \[least, most\]; NaN stays NaN. Unlike [`f64::clamp`] it cannot panic, so that no formatting of numbers is linked.
#[inline]
#[must_use]
pub fn clamp(x: f64, least: f64, most: f64) -> f64 {
    if x < least {
        least
    } else if x > most {
        most
    } else {
        x
    }
}

/// The value that would be in the middle of `values` in order, the upper one of two. For few values: the time grows with
/// the square of their number, and the large code of a sort is not linked.
#[must_use]
pub fn middle<T: Copy>(values: &[T], order: impl Fn(&T, &T) -> Ordering) -> Option<T> {
    let is_middle = |x: &T| {
        let below = values.iter().filter(|y| order(y, x).is_lt()).count();
        let equal = values.iter().filter(|y| order(y, x).is_eq()).count();
        (below..below + equal).contains(&(values.len() / 2))
    };
    values.iter().copied().find(is_middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_that_of_the_sorted_values() {
        let lists: [&[f64]; 6] = [
            &[],
            &[3.0],
            &[2.0, -1.0],
            &[5.0, 1.0, 5.0, 5.0],
            &[0.0, -0.0, 7.0],
            &[9.0, 8.0, f64::NAN, 7.0, 7.0],
        ];
        for list in lists {
            let mut sorted = list.to_vec();
            sorted.sort_by(f64::total_cmp);
            let expected = sorted.get(sorted.len() / 2).map(|v| v.to_bits());
            assert_eq!(middle(list, f64::total_cmp).map(f64::to_bits), expected, "{list:?}");
        }
    }

    #[test]
    fn clamp_is_that_of_the_standard_library() {
        for x in [-3.0, -1.0, -0.0, 0.0, 0.5, 1.0, 2.0, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(clamp(x, -1.0, 1.0).to_bits(), x.clamp(-1.0, 1.0).to_bits());
        }
        assert!(clamp(f64::NAN, -1.0, 1.0).is_nan());
    }

    /// Each library is within one unit in the last place of the exact value.
    #[test]
    fn both_libraries_agree_to_the_last_digits() {
        let values = [1e-9, 0.1, 0.5, 0.75, 0.9999, 1.0, 2.5, 6.1, 40.0];
        for (name, platform, portable) in BOTH {
            for x in values.into_iter().flat_map(|x| [x, -x]) {
                let (a, b) = (platform(x), portable(x));
                // The standard library computes artanh x from ln(1 + 2x / (1 − x)) and loses digits near −1.
                let bound = if *name == "atanh" { 1e-13 } else { 2.0 * f64::EPSILON };
                let is_same = a == b || a.is_nan() && b.is_nan() || (a - b).abs() <= bound * a.abs();
                assert!(is_same, "{name}({x}): {a:e} and {b:e}");
            }
        }
        for (x, n) in [(1.7, 0), (1.7, 7), (-0.3, 3), (2.5, -4), (0.0, 5)] {
            let (a, b) = (platform::powi(x, n), portable::powi(x, n));
            // A product of n numbers rounds n times.
            assert!(
                (a - b).abs() <= f64::from(n.abs()) * f64::EPSILON * a.abs(),
                "{x}^{n}: {a:e} and {b:e}"
            );
        }
        assert_eq!(platform::sin_cos(0.7), (platform::sin(0.7), platform::cos(0.7)));
        assert_eq!(portable::sin_cos(0.7), (portable::sin(0.7), portable::cos(0.7)));
    }

    /// The bits that every platform has to give. The tests of libm 0.2 keep it within 1 ulp of the exact values.
    #[test]
    fn the_portable_library_gives_these_bits() {
        let known: [(f64, u64); 4] = [
            (portable::sin(1.0), 0x3fea_ed54_8f09_0cee),
            (portable::exp(1.0), 0x4005_bf0a_8b14_576a),
            (portable::atan2(1.0, 2.0), 0x3fdd_ac67_0561_bb4f),
            (portable::powf(2.0, 0.5), 0x3ff6_a09e_667f_3bcd),
        ];
        for (value, bits) in known {
            assert_eq!(value.to_bits(), bits, "{value:e} is {:#x}", value.to_bits());
        }
    }
}
