//! A manifold: directions, the points of the unit sphere.
//!
//! Stored     a unit vector u, 3 numbers
//! Tangent    δ, 2 turns \[rad\] along the columns of B(u) = R(u) [e_x e_y], R(u) the shortest turn from e_z to u
//! ⊞          u ⊞ δ = cos|δ| u + sin|δ|/|δ| B(u) δ, the great circle
//! ⊟          a ⊟ b = θ/sin θ B(b)ᵀ a, θ the angle between them; not unique for opposite directions
//! Valid      away from u = −e_z, where R is not unique
//! Source     Hertzberg, Wagner, Frese, Schröder 2013, Integrating generic sensor fusion algorithms with sound state
//!            representations through encapsulation of manifolds, §3.6

use fusion::core::state::{AxisUnit, Kind, Manifold, Space, Tangent};
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// The run-time half of the manifold.
static DIRECTION: Space = Space {
    name: "direction",
    labels: &["x", "y", "z"],
    origin: &[0.0, 0.0, 1.0],
    axes: &[AxisUnit::Radian, AxisUnit::Radian],
    plus: |x, delta| Direction::write(&moved(&Direction::read(x), &Vector2::new(delta[0], delta[1])), x),
    minus: |a, b, out| out.copy_from_slice(difference(&Direction::read(a), &Direction::read(b)).as_slice()),
    jacobian: |x, delta, out| {
        let j = jacobian(&Direction::read(x), &Vector2::new(delta[0], delta[1]));
        out.copy_from_slice(j.transpose().as_slice());
    },
    is_sane: |x| (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0).abs() < 1e-6,
};

/// A direction: the compile-time half.
#[derive(Clone, Copy, Debug)]
pub enum Direction {}

impl Direction {
    /// For the laws.
    pub const SPACE: &'static Space = &DIRECTION;
}

impl Manifold for Direction {
    type Value = Vector3<f64>;
    const KIND: Kind = Kind::Custom(&DIRECTION);
    fn read(s: &[f64]) -> Vector3<f64> {
        Vector3::new(s[0], s[1], s[2])
    }
    fn write(v: &Vector3<f64>, s: &mut [f64]) {
        s[..3].copy_from_slice(v.as_slice());
    }
}
impl Tangent<2> for Direction {}

/// B(u).
#[must_use]
pub fn basis(u: &Vector3<f64>) -> Matrix3x2<f64> {
    let a = -1.0 / (1.0 + u.z).max(1e-12);
    Matrix3x2::new(1.0 + a * u.x * u.x, a * u.x * u.y, a * u.x * u.y, 1.0 + a * u.y * u.y, -u.x, -u.y)
}

/// sin θ / θ.
fn sinc(angle: f64) -> f64 {
    // Below it, the next term of the series is less than an ulp.
    if angle < 1e-4 {
        1.0 - angle * angle / 6.0
    } else {
        angle.sin() / angle
    }
}

fn moved(u: &Vector3<f64>, delta: &Vector2<f64>) -> Vector3<f64> {
    let angle = delta.norm();
    (u * angle.cos() + basis(u) * delta * sinc(angle)).normalize()
}

fn difference(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector2<f64> {
    let angle = b.cross(a).norm().atan2(b.dot(a));
    basis(b).transpose() * a / sinc(angle).max(1e-12)
}

/// The derivative of u ⊞ δ by δ, in the tangent space of u ⊞ δ.
fn jacobian(u: &Vector3<f64>, delta: &Vector2<f64>) -> Matrix2<f64> {
    let (angle, b) = (delta.norm(), basis(u));
    // (cos θ − sin θ / θ) / θ², and its limit −1/3.
    let curl = if angle < 1e-4 {
        -1.0 / 3.0
    } else {
        (angle.cos() - sinc(angle)) / (angle * angle)
    };
    let by_delta = (b - u * delta.transpose()) * sinc(angle) + b * delta * delta.transpose() * curl;
    basis(&moved(u, delta)).transpose() * by_delta
}
