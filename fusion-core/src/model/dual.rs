//! Dual numbers: a value and its derivative along one direction, by the rules of differentiation.
//!
//! (a + a′ε)(b + b′ε) = ab + (a′b + ab′)ε with ε² = 0, so f(a + a′ε) = f(a) + f′(a) a′ε.
//! Source: Griewank and Walther, *Evaluating Derivatives*, 2008, §3.1.

use crate::math;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};
use num_traits::{One, Zero};

/// A real number, or one that carries a derivative: the type parameter of [`ExactModel::h`](super::ExactModel::h).
///
/// A constant is `D::from(2.0)`, or the `f64` itself at the right of an operator. Angles are in radians.
pub trait Real:
    Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + 'static
    + From<f64>
    + Zero
    + One
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// The value, without a derivative.
    fn re(&self) -> f64;

    /// The number of value `value` and derivative `slope` × that of `self`: the chain rule, for a function that is not here.
    #[must_use]
    fn chain(self, value: f64, slope: f64) -> Self;

    /// The angle of the point (x, y), in −π … π, where `self` is y. The derivative is not finite at the origin.
    #[must_use]
    fn atan2(self, x: Self) -> Self;

    /// 1/x.
    #[must_use]
    fn recip(self) -> Self {
        let inverse = 1.0 / self.re();
        self.chain(inverse, -inverse * inverse)
    }

    /// The square root. The derivative is not finite at zero.
    #[must_use]
    fn sqrt(self) -> Self {
        let root = math::sqrt(self.re());
        self.chain(root, root * (1.0 / self.re()) * 0.5)
    }

    /// |x|; the derivative has the sign of x.
    #[must_use]
    fn abs(self) -> Self {
        self.chain(self.re().abs(), self.re().signum())
    }

    /// xⁿ.
    #[must_use]
    fn powi(self, n: i32) -> Self {
        let slope = if n == 0 { 0.0 } else { f64::from(n) * math::powi(self.re(), n - 1) };
        self.chain(math::powi(self.re(), n), slope)
    }

    /// xʸ for a constant y.
    #[must_use]
    fn powf(self, y: f64) -> Self {
        let slope = if y == 0.0 { 0.0 } else { y * math::powf(self.re(), y - 1.0) };
        self.chain(math::powf(self.re(), y), slope)
    }

    /// eˣ.
    #[must_use]
    fn exp(self) -> Self {
        let value = math::exp(self.re());
        self.chain(value, value)
    }

    /// eˣ − 1.
    #[must_use]
    fn exp_m1(self) -> Self {
        self.chain(math::exp_m1(self.re()), math::exp(self.re()))
    }

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self {
        self.chain(math::ln(self.re()), 1.0 / self.re())
    }

    /// The logarithm to the base 10.
    #[must_use]
    fn log10(self) -> Self {
        self.chain(math::log10(self.re()), 1.0 / (self.re() * core::f64::consts::LN_10))
    }

    /// (sin x, cos x).
    #[must_use]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = math::sin_cos(self.re());
        (self.chain(sin, cos), self.chain(cos, -sin))
    }

    /// sin x.
    #[must_use]
    fn sin(self) -> Self {
        self.sin_cos().0
    }

    /// cos x.
    #[must_use]
    fn cos(self) -> Self {
        self.sin_cos().1
    }

    /// tan x.
    #[must_use]
    fn tan(self) -> Self {
        let tan = math::tan(self.re());
        self.chain(tan, tan * tan + 1.0)
    }

    /// arcsin x. The derivative is not finite at −1 and 1.
    #[must_use]
    fn asin(self) -> Self {
        self.chain(math::asin(self.re()), 1.0 / math::sqrt(1.0 - self.re() * self.re()))
    }

    /// arccos x. The derivative is not finite at −1 and 1.
    #[must_use]
    fn acos(self) -> Self {
        self.chain(math::acos(self.re()), -1.0 / math::sqrt(1.0 - self.re() * self.re()))
    }

    /// arctan x.
    #[must_use]
    fn atan(self) -> Self {
        self.chain(math::atan(self.re()), 1.0 / (self.re() * self.re() + 1.0))
    }

    /// sinh x.
    #[must_use]
    fn sinh(self) -> Self {
        self.chain(math::sinh(self.re()), math::cosh(self.re()))
    }

    /// cosh x.
    #[must_use]
    fn cosh(self) -> Self {
        self.chain(math::cosh(self.re()), math::sinh(self.re()))
    }

    /// tanh x.
    #[must_use]
    fn tanh(self) -> Self {
        let tanh = math::tanh(self.re());
        self.chain(tanh, 1.0 - tanh * tanh)
    }
}

impl Real for f64 {
    #[inline]
    fn re(&self) -> f64 {
        *self
    }

    #[inline]
    fn chain(self, value: f64, _: f64) -> Self {
        value
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        math::atan2(self, x)
    }
}

/// A value and its derivative along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Dual {
    value: f64,
    pub(super) slope: f64,
}

impl Dual {
    /// Zero, with the derivative 1: the direction itself.
    pub(super) const EPSILON: Self = Self { value: 0.0, slope: 1.0 };
}

impl Real for Dual {
    #[inline]
    fn re(&self) -> f64 {
        self.value
    }

    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        Self {
            value,
            slope: self.slope * slope,
        }
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        Self {
            value: math::atan2(self.value, x.value),
            slope: (self.slope * x.value - x.slope * self.value) / (x.value * x.value + self.value * self.value),
        }
    }
}

impl From<f64> for Dual {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }
}

impl Neg for Dual {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            slope: -self.slope,
        }
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline]
    fn add(self, b: Self) -> Self {
        Self {
            value: self.value + b.value,
            slope: self.slope + b.slope,
        }
    }
}

impl Sub for Dual {
    type Output = Self;
    #[inline]
    fn sub(self, b: Self) -> Self {
        Self {
            value: self.value - b.value,
            slope: self.slope - b.slope,
        }
    }
}

impl Mul for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, b: Self) -> Self {
        Self {
            value: self.value * b.value,
            slope: self.slope * b.value + b.slope * self.value,
        }
    }
}

impl Div for Dual {
    type Output = Self;
    #[inline]
    fn div(self, b: Self) -> Self {
        let inverse = 1.0 / b.value;
        Self {
            value: self.value / b.value,
            slope: (self.slope * b.value - b.slope * self.value) * inverse * inverse,
        }
    }
}

/// The operators with a constant at the right, and those that assign.
macro_rules! operators {
    ($($operator:ident $f:ident $assign:ident $g:ident;)+) => {$(
        impl $operator<f64> for Dual {
            type Output = Self;
            #[inline]
            fn $f(self, b: f64) -> Self {
                $operator::$f(self, Self::from(b))
            }
        }

        impl $assign for Dual {
            #[inline]
            fn $g(&mut self, b: Self) {
                *self = $operator::$f(*self, b);
            }
        }
    )+};
}

operators! {
    Add add AddAssign add_assign;
    Sub sub SubAssign sub_assign;
    Mul mul MulAssign mul_assign;
    Div div DivAssign div_assign;
}

impl Zero for Dual {
    fn zero() -> Self {
        Self::from(0.0)
    }

    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for Dual {
    fn one() -> Self {
        Self::from(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f, and its derivative by the rules and by central differences.
    fn agrees(name: &str, x: f64, f: impl Fn(Dual) -> Dual) {
        let at = |value, slope| f(Dual { value, slope });
        let step = 1e-5;
        let difference = (at(x + step, 0.0).value - at(x - step, 0.0).value) / (2.0 * step);
        let slope = at(x, 1.0).slope;
        // The difference is off by step² × the third derivative, here below 1e2, and by rounding / step.
        assert!(
            (slope - difference).abs() < 1e-8 * difference.abs().max(1.0),
            "{name}: {slope}, by differences {difference}"
        );
    }

    #[test]
    fn derivatives_agree_with_differences() {
        type Function = fn(Dual) -> Dual;
        let cases: &[(&str, Function)] = &[
            ("recip", Real::recip),
            ("sqrt", Real::sqrt),
            ("abs", Real::abs),
            ("powi", |x| x.powi(-3)),
            ("powf", |x| x.powf(2.5)),
            ("exp", Real::exp),
            ("exp_m1", Real::exp_m1),
            ("ln", Real::ln),
            ("log10", Real::log10),
            ("sin", Real::sin),
            ("cos", Real::cos),
            ("tan", Real::tan),
            ("asin", Real::asin),
            ("acos", Real::acos),
            ("atan", Real::atan),
            ("sinh", Real::sinh),
            ("cosh", Real::cosh),
            ("tanh", Real::tanh),
            ("atan2 of y", |y| Real::atan2(y, Dual::from(-0.4))),
            ("atan2 of x", |x| Real::atan2(Dual::from(-0.4), x)),
            ("product", |x| (x * 2.0 - 1.0) * Real::sin(x)),
            ("quotient", |x| Real::sin(x) / (x * x + 3.0)),
            ("difference", |x| -(x - x * x) / 2.0),
        ];
        for (name, f) in cases {
            agrees(name, 0.7, f);
        }
    }

    #[test]
    fn an_angle_has_a_derivative_straight_ahead_and_a_constant_none() {
        assert_eq!(Real::atan2(Dual::EPSILON + 2.0, Dual::from(0.0)).slope, 0.0);
        assert_eq!(Real::atan2(Dual::from(2.0), Dual::EPSILON).slope, -0.5);
        assert_eq!(Real::powi(Dual::EPSILON, 0).slope, 0.0);
        assert_eq!(Real::sqrt(Dual::from(4.0)), Dual::from(2.0));
    }
}
