//! The kinds of state block: storage, tangent space, ⊞ and ⊟.
//!
//! The tangent coordinates below are the *canonical chart*: every model gives its Jacobians in
//! them, for every backend.
//!
//! | kind | storage | tangent | x ⊞ δ |
//! |---|---|---|---|
//! | [`Geodetic`] | latitude, longitude \[rad\], height \[m\] | δr NED at x \[m\] | radii of curvature, spec of WGS-84 |
//! | [`Position`] | Cartesian, 3 \[m\] | 3 \[m\] | x + δ |
//! | [`Velocity`] | 3 \[m/s\] | 3 \[m/s\] | x + δ |
//! | [`Attitude`] | quaternion w x y z (`q_nb`) | δφ_b \[rad\] | q ⊗ Exp(δφ_b) |
//! | [`Scalar`] | 1 | 1 | x + δ |
//! | [`Angle`] | 1 \[rad\] | 1 \[rad\] | wrap(x + δ) to (−π, π] |
//! | [`Vector`] | N | N | x + δ |
//! | [`Space`], of another crate | its own | its own | its own |

use super::space::{AxisUnit, Space};
use crate::geometry::{so3, wgs84};
use nalgebra::{Quaternion, SVector, UnitQuaternion, Vector3};

/// No position on or about the earth is farther away \[m\]: more than twice the distance of the moon.
const FARTHEST: f64 = 1e9;

/// The velocity of light \[m/s\].
const LIGHT: f64 = 299_792_458.0;

/// The run-time name of a manifold, by which the estimator treats a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Geodetic position with its error in metres north, east, down.
    Geodetic,
    /// Cartesian position in metres.
    Position,
    /// Velocity in metres per second.
    Velocity,
    /// Attitude quaternion, body to navigation.
    Attitude,
    /// One real number.
    Scalar,
    /// One angle, wrapped to (−π, π].
    Angle,
    /// `n` real numbers.
    Vector(usize),
    /// A manifold of another crate.
    Custom(&'static Space),
}

impl Kind {
    /// Numbers stored.
    #[must_use]
    pub const fn storage(self) -> usize {
        match self {
            Self::Geodetic | Self::Position | Self::Velocity => 3,
            Self::Attitude => 4,
            Self::Scalar | Self::Angle => 1,
            Self::Vector(n) => n,
            Self::Custom(space) => space.origin.len(),
        }
    }

    /// Dimension of the tangent space: the block's share of the covariance.
    #[must_use]
    pub const fn dim(self) -> usize {
        match self {
            Self::Attitude => 3,
            Self::Custom(space) => space.axes.len(),
            other => other.storage(),
        }
    }

    /// Its name: `geodetic`, `position` and so on.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Geodetic => "geodetic",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
            Self::Scalar => "scalar",
            Self::Angle => "angle",
            Self::Vector(_) => "vector",
            Self::Custom(space) => space.name,
        }
    }

    /// The unit of axis `k` of the tangent space, as far as the manifold gives it: a scalar or a vector may have any.
    #[must_use]
    pub fn axis(self, k: usize) -> AxisUnit {
        match self {
            Self::Geodetic | Self::Position => AxisUnit::Metre,
            Self::Velocity => AxisUnit::MetrePerSecond,
            Self::Attitude | Self::Angle => AxisUnit::Radian,
            Self::Scalar | Self::Vector(_) => AxisUnit::Other,
            Self::Custom(space) => space.axes.get(k).copied().unwrap_or(AxisUnit::Other),
        }
    }

    /// Whether the block is an orientation: an attitude, an angle, or a custom manifold with at most three axes that
    /// are all turns.
    #[must_use]
    pub fn is_orientation(self) -> bool {
        match self {
            Self::Attitude | Self::Angle => true,
            Self::Custom(space) => space.is_orientation(),
            _ => false,
        }
    }

    /// Whether x ⊞ δ = x + δ: every stored number is a coordinate.
    #[must_use]
    pub const fn is_linear(self) -> bool {
        matches!(self, Self::Position | Self::Velocity | Self::Scalar | Self::Vector(_))
    }

    /// Writes a sane value to storage: 0, the identity, or the origin of a custom manifold.
    pub fn write_origin(self, x: &mut [f64]) {
        match self {
            Self::Attitude => Attitude::write(&UnitQuaternion::identity(), x),
            Self::Custom(space) => x.copy_from_slice(space.origin),
            _ => x.fill(0.0),
        }
    }

    /// Whether `x` in storage can be a value: finite, a position within 10⁹ m of the earth and a
    /// latitude no further than a pole, a velocity below the velocity of light, a quaternion of length one.
    /// A custom manifold says it by itself.
    #[must_use]
    pub fn is_sane(self, x: &[f64]) -> bool {
        let is_below = x.iter().enumerate().all(|(k, v)| v.abs() <= self.limit(k));
        is_below
            && match self {
                Self::Attitude => is_rotation(x),
                Self::Custom(space) => (space.is_sane)(x),
                _ => true,
            }
    }

    /// The largest size that number `k` of its storage can have.
    pub(super) const fn limit(self, k: usize) -> f64 {
        match (self, k) {
            // An ulp or two beyond the pole, from rounding, is the pole.
            (Self::Geodetic, 0) => core::f64::consts::FRAC_PI_2 + 1e-12,
            (Self::Geodetic, 2) | (Self::Position, _) => FARTHEST,
            (Self::Velocity, _) => LIGHT,
            _ => f64::MAX,
        }
    }

    /// x ← x ⊞ δ, `x` in storage and `delta` in tangent coordinates.
    #[inline]
    pub fn plus(self, x: &mut [f64], delta: &[f64]) {
        match self {
            Self::Geodetic => {
                let moved = Geodetic::read(x).offset(&Vector3::from_column_slice(&delta[..3]));
                Geodetic::write(&moved, x);
            }
            Self::Attitude => {
                let mut q = Attitude::read(x) * so3::exp(&Vector3::from_column_slice(&delta[..3]));
                q.renormalize();
                Attitude::write(&q, x);
            }
            Self::Angle => x[0] = wrap(x[0] + delta[0]),
            Self::Custom(space) => (space.plus)(&mut x[..space.origin.len()], &delta[..space.axes.len()]),
            _ => x.iter_mut().zip(delta).for_each(|(x, d)| *x += d),
        }
    }

    /// out ← a ⊟ b, so that b ⊞ out = a.
    pub fn minus(self, a: &[f64], b: &[f64], out: &mut [f64]) {
        match self {
            Self::Geodetic => {
                let d = Geodetic::read(a).difference(&Geodetic::read(b));
                out[..3].copy_from_slice(d.as_slice());
            }
            Self::Attitude => {
                let d = so3::log(&(Attitude::read(b).inverse() * Attitude::read(a)));
                out[..3].copy_from_slice(d.as_slice());
            }
            Self::Angle => out[0] = wrap(a[0] - b[0]),
            Self::Custom(space) => (space.minus)(a, b, &mut out[..space.axes.len()]),
            _ => {
                for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
                    *o = a - b;
                }
            }
        }
    }
}

/// Whether a quaternion is of length one: 1e-3 is what first-order integration leaves before it is
/// normalised.
#[inline]
pub(super) fn is_rotation(q: &[f64]) -> bool {
    (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0).abs() < 1e-3
}

pub use so3::wrap_angle as wrap;

/// A kind of block at compile time: the type parameter of a [`crate::Slot`].
pub trait Manifold: Sized + 'static {
    /// The value a model reads.
    type Value: Clone + core::fmt::Debug + Send + Sync;
    /// Its run-time name.
    const KIND: Kind;
    /// The value in `storage`.
    fn read(storage: &[f64]) -> Self::Value;
    /// Writes the value into `storage`.
    fn write(value: &Self::Value, storage: &mut [f64]);
}

/// States at compile time that the tangent space of a [`Manifold`] has `D` dimensions.
pub trait Tangent<const D: usize>: Manifold {}

pub use wgs84::Geodetic;

impl Manifold for Geodetic {
    type Value = Self;
    const KIND: Kind = Kind::Geodetic;
    #[inline]
    fn read(s: &[f64]) -> Self {
        Self {
            lat: s[0],
            lon: s[1],
            height: s[2],
        }
    }
    #[inline]
    fn write(v: &Self, s: &mut [f64]) {
        s[..3].copy_from_slice(&[v.lat, v.lon, v.height]);
    }
}
impl Tangent<3> for Geodetic {}

macro_rules! vector_kind {
    ($(#[$doc:meta])* $name:ident, $kind:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub enum $name {}
        impl Manifold for $name {
            type Value = Vector3<f64>;
            const KIND: Kind = $kind;
            #[inline]
            fn read(s: &[f64]) -> Vector3<f64> {
                Vector3::new(s[0], s[1], s[2])
            }
            #[inline]
            fn write(v: &Vector3<f64>, s: &mut [f64]) {
                s[..3].copy_from_slice(v.as_slice());
            }
        }
        impl Tangent<3> for $name {}
    };
}
vector_kind!(
    /// Cartesian position \[m\].
    Position,
    Kind::Position
);
vector_kind!(
    /// Velocity \[m/s\].
    Velocity,
    Kind::Velocity
);

/// Attitude: the unit quaternion `q_nb`, body to navigation.
#[derive(Clone, Copy, Debug)]
pub enum Attitude {}

impl Manifold for Attitude {
    type Value = UnitQuaternion<f64>;
    const KIND: Kind = Kind::Attitude;
    #[inline]
    fn read(s: &[f64]) -> UnitQuaternion<f64> {
        UnitQuaternion::new_unchecked(Quaternion::new(s[0], s[1], s[2], s[3]))
    }
    #[inline]
    fn write(q: &UnitQuaternion<f64>, s: &mut [f64]) {
        s[..4].copy_from_slice(&[q.w, q.i, q.j, q.k]);
    }
}
impl Tangent<3> for Attitude {}

macro_rules! scalar_kind {
    ($(#[$doc:meta])* $name:ident, $kind:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub enum $name {}
        impl Manifold for $name {
            type Value = f64;
            const KIND: Kind = $kind;
            #[inline]
            fn read(s: &[f64]) -> f64 {
                s[0]
            }
            #[inline]
            fn write(v: &f64, s: &mut [f64]) {
                s[0] = *v;
            }
        }
        impl Tangent<1> for $name {}
    };
}
scalar_kind!(
    /// One real number.
    Scalar,
    Kind::Scalar
);
scalar_kind!(
    /// One angle \[rad\].
    Angle,
    Kind::Angle
);

/// `N` real numbers.
#[derive(Clone, Copy, Debug)]
pub enum Vector<const N: usize> {}

impl<const N: usize> Manifold for Vector<N> {
    type Value = SVector<f64, N>;
    const KIND: Kind = Kind::Vector(N);
    #[inline]
    fn read(s: &[f64]) -> SVector<f64, N> {
        SVector::from_column_slice(&s[..N])
    }
    #[inline]
    fn write(v: &SVector<f64, N>, s: &mut [f64]) {
        s[..N].copy_from_slice(v.as_slice());
    }
}
impl<const N: usize> Tangent<N> for Vector<N> {}
