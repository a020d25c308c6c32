//! Dimensions: powers of the base units, in halves, so that 1/√Hz has a dimension too.

use std::fmt;

/// Dimensions whose SI unit has a better-known name, with twice their exponents.
const NAMED: [(&str, [i8; 6]); 2] = [("T", [0, 2, -4, -2, 0, 0]), ("Pa", [-2, 2, -4, 0, 0, 0])];
/// Base units, in the order of the exponents.
const BASES: [&str; 6] = ["m", "kg", "s", "A", "K", "rad"];

/// Twice the largest exponent, 8: no quantity has a larger exponent, and no unit text may have one.
pub(super) const LARGEST: i8 = 16;

/// Powers of metre, kilogram, second, ampere, kelvin and radian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension {
    /// Twice the exponent of each base unit.
    halves: [i8; 6],
}

impl Dimension {
    /// A pure number.
    pub const NONE: Self = Self::from_halves([0; 6]);

    /// From twice the exponents of m, kg, s, A, K, rad: acceleration is `[2, 0, -4, 0, 0, 0]`.
    #[must_use]
    pub const fn from_halves(halves: [i8; 6]) -> Self {
        Self { halves }
    }

    /// The dimension of a product; `None` if an exponent is beyond 8.
    #[must_use]
    pub fn times(self, other: Self) -> Option<Self> {
        let mut halves = self.halves;
        for (own, more) in halves.iter_mut().zip(other.halves) {
            *own = own.checked_add(more).filter(is_reasonable)?;
        }
        Some(Self { halves })
    }

    /// The dimension raised to `halves / 2`; `None` if the result is not a multiple of one half, or beyond 8.
    #[must_use]
    pub fn power(self, halves: i8) -> Option<Self> {
        let mut powers = self.halves;
        for own in &mut powers {
            let product = own.checked_mul(halves)?;
            *own = (product % 2 == 0).then_some(product / 2).filter(is_reasonable)?;
        }
        Some(Self { halves: powers })
    }

    /// Returns true if this is the dimension of a pure number.
    #[must_use]
    pub fn is_none(self) -> bool {
        self == Self::NONE
    }

    /// The name of a quantity of this dimension, for messages.
    #[must_use]
    pub fn kind(self) -> QuantityKind {
        let named = super::quantity::KINDS.iter().find(|kind| kind.dimension == self);
        named.copied().unwrap_or(QuantityKind {
            dimension: self,
            name: "a quantity",
            symbol: "",
            example: "",
        })
    }
}

fn is_reasonable(halves: &i8) -> bool {
    halves.unsigned_abs() <= LARGEST.unsigned_abs()
}

/// The SI unit: `m/s^2`, `rad/s/sqrt(s)`; the parser reads it back as the same dimension.
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((symbol, _)) = NAMED.iter().find(|(_, halves)| *halves == self.halves) {
            return f.write_str(symbol);
        }
        let powers = || BASES.into_iter().zip(self.halves);
        let mut separator = "";
        for (base, halves) in powers().filter(|(_, halves)| *halves > 0) {
            write_power(f, separator, base, halves)?;
            separator = "*";
        }
        if separator.is_empty() {
            f.write_str("1")?;
        }
        for (base, halves) in powers().filter(|(_, halves)| *halves < 0) {
            write_power(f, "/", base, halves.saturating_neg())?;
        }
        Ok(())
    }
}

/// Writes `base^(halves / 2)`, a half power as a root, each factor after `separator`.
fn write_power(f: &mut fmt::Formatter<'_>, separator: &str, base: &str, halves: i8) -> fmt::Result {
    let root_separator = if halves > 1 && separator.is_empty() { "*" } else { separator };
    match halves / 2 {
        0 => {}
        1 => write!(f, "{separator}{base}")?,
        whole => write!(f, "{separator}{base}^{whole}")?,
    }
    if halves % 2 == 1 {
        write!(f, "{root_separator}sqrt({base})")
    } else {
        Ok(())
    }
}

/// A dimension with its words in error messages and schemas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuantityKind {
    /// The dimension that these words describe.
    pub dimension: Dimension,
    /// With its article: `a length`.
    pub name: &'static str,
    /// The SI unit; empty if the dimension has no separate name.
    pub symbol: &'static str,
    /// An example for TOML, without quotes; empty without an example.
    pub example: &'static str,
}

/// `a length [m]`.
impl fmt::Display for QuantityKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.symbol {
            "" => write!(f, "{} [{}]", self.name, self.dimension),
            symbol => write!(f, "{} [{symbol}]", self.name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse_unit;
    use super::*;

    #[test]
    fn half_powers_print_as_roots() {
        let print = |halves| Dimension::from_halves(halves).to_string();
        assert_eq!(print([2, 0, -5, 0, 0, 0]), "m/s^2/sqrt(s)");
        assert_eq!(print([0, 0, -1, 0, 0, 2]), "rad/sqrt(s)");
        assert_eq!(print([3, 2, 0, 0, 0, 0]), "m*sqrt(m)*kg");
        assert_eq!(print([0; 6]), "1");
    }

    #[test]
    fn what_is_printed_parses_to_the_same_dimension() {
        for base in 0..BASES.len() {
            for halves in [-LARGEST, -7, -3, -1, 1, 2, 3, 4, 5, LARGEST] {
                let mut powers = [1, -2, 0, 0, 3, -5];
                powers[base] = halves;
                let dimension = Dimension::from_halves(powers);
                assert_eq!(parse_unit(&dimension.to_string()), Ok((1.0, dimension)));
            }
        }
    }

    #[test]
    fn a_root_that_is_no_half_power_is_refused() {
        let root_of_metre = Dimension::from_halves([1, 0, 0, 0, 0, 0]);
        assert_eq!(root_of_metre.power(1), None);
        assert_eq!(root_of_metre.power(2), Some(root_of_metre));
    }
}
