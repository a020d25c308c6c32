//! Ellipses of 3σ in the horizontal plane.

use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::math;
use nalgebra::{Matrix2, Matrix3, SymmetricEigen, Vector2};

/// Corners of the polygon of an ellipse.
const CORNERS: usize = 36;

/// The ellipses of a path. One is drawn where it does not overlap with the one before it.
#[derive(Debug, Default)]
pub(super) struct Ellipses {
    last: Option<(Geodetic, f64)>,
}

impl Ellipses {
    /// The corners of the ellipse of 3σ at a place, as latitudes and longitudes \[rad\]; `None` if it overlaps with the
    /// one before it. `covariance` is in metres north, east, down.
    pub(super) fn next(&mut self, place: &Geodetic, covariance: &Matrix3<f64>) -> Option<Vec<(f64, f64)>> {
        let plane: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(plane);
        let axes = eigenvalues.map(|variance| 3.0 * math::sqrt(variance.max(0.0)));
        let (north, east) = place.metres_per_radian();
        let radius = axes.max();
        if let Some((last, before)) = &self.last {
            let apart = math::hypot(north * (place.lat - last.lat), east * (place.lon - last.lon));
            if apart < radius + before {
                return None;
            }
        }
        self.last = Some((*place, radius));
        let corner = |k: usize| {
            let (sine, cosine) = math::sin_cos(core::f64::consts::TAU * (k % CORNERS) as f64 / CORNERS as f64);
            let metres = eigenvectors * Vector2::new(axes.x * cosine, axes.y * sine);
            (place.lat + metres.x / north, place.lon + metres.y / east)
        };
        // A ring counter-clockwise, seen with east to the right, as RFC 7946 wants it. The last corner is the first.
        let is_clockwise = eigenvectors.determinant() > 0.0;
        let order = |k: usize| if is_clockwise { CORNERS - k } else { k };
        Some((0..=CORNERS).map(|k| corner(order(k))).collect())
    }
}
