//! Manifolds of other crates: their description for the estimator.

use core::fmt;

/// The unit of one axis of a tangent space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisUnit {
    /// A displacement \[m\].
    Metre,
    /// A change of velocity \[m/s\].
    MetrePerSecond,
    /// A turn \[rad\].
    Radian,
    /// Any other unit, or none.
    Other,
}

/// A manifold that another crate defines: its storage, its tangent space, ⊞ and ⊟.
///
/// A static of this type is the run-time half of a manifold. [`Manifold`](super::Manifold) is the other half: its
/// `KIND` is [`Kind::Custom`](super::Kind::Custom) of the static. [`crate::testing::check_space`] holds the laws.
///
/// ```
/// use fusion_core::state::{AxisUnit, Kind, Space};
///
/// /// A number above zero, stored as it is; its error is relative: x ⊞ δ = x exp(δ).
/// static SCALE: Space = Space {
///     name: "scale",
///     labels: &[""],
///     origin: &[1.0],
///     axes: &[AxisUnit::Other],
///     plus: |x, delta| x[0] *= delta[0].exp(),
///     minus: |a, b, out| out[0] = (a[0] / b[0]).ln(),
///     jacobian: |_, _, out| out[0] = 1.0,
///     is_sane: |x| x[0] > 0.0 && x[0].is_finite(),
/// };
/// fusion_core::testing::check_space(&SCALE, &[2.0], &[0.3]).unwrap();
/// assert_eq!(Kind::Custom(&SCALE).dim(), 1);
/// ```
#[derive(Clone, Copy)]
pub struct Space {
    /// Its name, unique among all manifolds: `snake_case`.
    pub name: &'static str,
    /// The names of the stored numbers, as they end the names of columns. The only number of a block may be `""`.
    pub labels: &'static [&'static str],
    /// A value that is sane, in storage: as many numbers as there are labels.
    pub origin: &'static [f64],
    /// The unit of each axis of the tangent space: their count is its dimension, at most [`Space::MOST_AXES`].
    pub axes: &'static [AxisUnit],
    /// x ← x ⊞ δ: `x` in storage, δ in tangent coordinates. The value stays sane if δ is finite.
    pub plus: fn(&mut [f64], &[f64]),
    /// out ← a ⊟ b, so that b ⊞ out = a: `a` and `b` in storage, `out` in tangent coordinates.
    pub minus: fn(&[f64], &[f64], &mut [f64]),
    /// J(x, δ), dim × dim, row by row: (x ⊞ (δ + ε)) ⊟ (x ⊞ δ) = J ε for a small ε.
    pub jacobian: fn(&[f64], &[f64], &mut [f64]),
    /// Whether numbers in storage are a value.
    pub is_sane: fn(&[f64]) -> bool,
}

impl Space {
    /// The most axes that a tangent space can have.
    pub const MOST_AXES: usize = 9;

    /// Whether every axis is a turn, and there are at most three: the block is an orientation.
    #[must_use]
    pub fn is_orientation(&self) -> bool {
        self.axes.len() <= 3 && self.axes.iter().all(|unit| *unit == AxisUnit::Radian)
    }
}

/// Two of one name are the same manifold.
impl PartialEq for Space {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.labels == other.labels && self.axes == other.axes
    }
}

impl Eq for Space {}

impl fmt::Debug for Space {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
