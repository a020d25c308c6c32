//! Rotation of the Earth and of the local level frame, resolved in north-east-down.
//!
//! Earth rate      `w_ie_n = Ω [cos φ, 0, −sin φ]`
//! Transport rate  `w_en_n = [vE/(RN+h), −vN/(RM+h), −vE tan φ/(RN+h)]`
//! Units           rad/s, from φ \[rad\], h \[m\] and `v_eb_n` \[m/s\]
//! Valid           everywhere; within 6 m of a pole tan φ is held at 1e6
//! Source          Groves 2013, eqs. 2.123 and 5.44

use fusion_core::geometry::so3::wrap_angle;
use fusion_core::geometry::wgs84::{EARTH_RATE, ECCENTRICITY_SQUARED, Geodetic, Radii, divisible_cos, sin_cos_latitude};
use fusion_core::math;
use nalgebra::{Matrix3, Vector3};

use super::gravity::Gravity;

/// Speed of light in vacuum \[m/s\].
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// The largest difference of latitude \[rad\] that counts as small: 6 km.
const NEAR: f64 = 1e-3;

/// All properties of the Earth at one point that navigation equations need, from one sine and cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalEarth {
    /// sin φ.
    pub sin_lat: f64,
    /// cos φ, held at or above 1e-6 in size so that it divides.
    pub cos_lat: f64,
    /// RM + h \[m\]: metres per radian of latitude.
    pub meridian: f64,
    /// RN + h \[m\]: metres per radian of longitude, over cos φ.
    pub normal: f64,
    /// Height h \[m\].
    pub height: f64,
    /// 1/(RM + h) \[1/m\]: most uses of the radii divide by them.
    pub per_meridian: f64,
    /// 1/(RN + h) \[1/m\].
    pub per_normal: f64,
    /// 1/cos φ.
    pub per_cos: f64,
}

impl LocalEarth {
    /// Evaluates the ellipsoid at a position.
    #[inline(always)]
    #[must_use]
    pub fn at(position: &Geodetic) -> Self {
        let (sin_lat, cos_lat) = sin_cos_latitude(position.lat);
        Self::of(sin_lat, divisible_cos(cos_lat), position.height)
    }

    #[inline]
    fn of(sin_lat: f64, cos_lat: f64, height: f64) -> Self {
        let sin2 = sin_lat * sin_lat;
        let (r, per) = (Radii::of_sin_squared(sin2), Radii::reciprocals(sin2, height));
        Self {
            sin_lat,
            cos_lat,
            meridian: r.meridian + height,
            normal: r.normal + height,
            height,
            per_meridian: per.meridian,
            per_normal: per.normal,
            per_cos: 1.0 / cos_lat,
        }
    }

    /// Evaluates the ellipsoid at another position near this one. A latitude that differs by less than 1e-3 rad needs
    /// no sine.
    #[inline]
    #[must_use]
    pub fn near(&self, position: &Geodetic, here: &Geodetic) -> Self {
        let d = position.lat - here.lat;
        if d.abs() > NEAR || self.cos_lat.abs() < NEAR {
            return Self::at(position);
        }
        // The neglected terms are below 1e-18: d⁶/720 of the cosine, d⁷/5040 of the sine.
        let d2 = d * d;
        let versine = d2 * (0.5 - d2 * (1.0 / 24.0));
        let sin = d * (1.0 - d2 * (1.0 / 6.0 - d2 * (1.0 / 120.0)));
        let sin_lat = self.sin_lat + (self.cos_lat * sin - self.sin_lat * versine);
        let cos_lat = self.cos_lat - (self.sin_lat * sin + self.cos_lat * versine);
        Self::of(sin_lat, cos_lat, position.height)
    }

    /// dRM/dφ and dRN/dφ \[m/rad\].
    #[inline]
    #[must_use]
    pub fn radii_slopes(&self) -> Radii {
        let k = ECCENTRICITY_SQUARED * self.sin_lat * self.cos_lat / (1.0 - ECCENTRICITY_SQUARED * self.sin_lat * self.sin_lat);
        Radii {
            meridian: 3.0 * (self.meridian - self.height) * k,
            normal: (self.normal - self.height) * k,
        }
    }

    /// A place `d_ned` \[m\] from `here`, by the radii of this place, which is near.
    #[inline]
    #[must_use]
    pub fn offset(&self, here: &Geodetic, d_ned: &Vector3<f64>) -> Geodetic {
        Geodetic {
            lat: here.lat + d_ned.x * self.per_meridian,
            lon: wrap_angle(here.lon + d_ned.y * (self.per_normal * self.per_cos)),
            height: here.height - d_ned.z,
        }
    }

    /// tan φ.
    #[inline]
    #[must_use]
    pub fn tan_lat(&self) -> f64 {
        self.sin_lat * self.per_cos
    }

    /// `w_ie_n` \[rad/s\].
    #[inline]
    #[must_use]
    pub fn earth_rate_n(&self) -> Vector3<f64> {
        Vector3::new(EARTH_RATE * self.cos_lat, 0.0, -EARTH_RATE * self.sin_lat)
    }

    /// `w_en_n` \[rad/s\] for `v_eb_n` \[m/s\].
    #[inline]
    #[must_use]
    pub fn transport_rate_n(&self, v_eb_n: &Vector3<f64>) -> Vector3<f64> {
        let east = v_eb_n.y * self.per_normal;
        Vector3::new(east, -v_eb_n.x * self.per_meridian, -east * self.tan_lat())
    }

    /// W = ∂w_en_n/∂v_eb_n, 3×3 \[1/m\]: the transport rate is linear in velocity.
    #[inline]
    #[must_use]
    pub fn transport_matrix(&self) -> Matrix3<f64> {
        let east = self.per_normal;
        Matrix3::new(
            0.0,
            east,
            0.0, //
            -self.per_meridian,
            0.0,
            0.0, //
            0.0,
            -east * self.tan_lat(),
            0.0,
        )
    }

    /// g \[m/s²\] of a gravity model here.
    #[inline]
    #[must_use]
    pub fn gravity(&self, model: Gravity) -> f64 {
        model.of_sin_squared(self.sin_lat * self.sin_lat, self.height)
    }
}

/// `w_ie_n` \[rad/s\] at a latitude \[rad\].
#[inline]
#[must_use]
pub fn earth_rate_n(lat: f64) -> Vector3<f64> {
    let (sin, cos) = math::sin_cos(lat);
    Vector3::new(EARTH_RATE * cos, 0.0, -EARTH_RATE * sin)
}

/// `w_en_n` \[rad/s\] at a position moving with `v_n` = `v_eb_n` \[m/s\].
#[inline]
#[must_use]
pub fn transport_rate_n(position: &Geodetic, v_n: &Vector3<f64>) -> Vector3<f64> {
    LocalEarth::at(position).transport_rate_n(v_n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::frames::rotation_en;
    use fusion_core::geometry::so3;
    use nalgebra::{Rotation3, UnitQuaternion};

    #[test]
    fn earth_rate_at_the_site_is_12_1533_deg_per_h_north_and_8_8618_up() {
        let per_hour = earth_rate_n(36.098_277_778_f64.to_radians()).map(|x| x.to_degrees() * 3600.0);
        // 6e-5 deg/h: the table has four decimals (five for the total).
        assert!((per_hour - Vector3::new(12.1533, 0.0, -8.8618)).amax() < 6e-5, "{per_hour}");
        assert!((per_hour.norm() - 15.04107).abs() < 6e-6);
    }

    #[test]
    fn transport_rate_matches_the_turning_of_the_local_axes_along_the_path() {
        let p = Geodetic::new(0.63, 2.26, 5000.0);
        let v = Vector3::new(120.0, -240.0, 7.0);
        let h = 10.0;
        let q_en = |t: f64| {
            let g = p.offset(&(v * t));
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation_en(g.lat, g.lon)))
        };
        let numeric = so3::log(&(q_en(-h).inverse() * q_en(h))) / (2.0 * h);
        let analytic = transport_rate_n(&p, &v);
        // 1e-12 of 5e-5: truncation (v h/R)²/6 = 3e-8 relative, rounding 1e-16/20.
        assert!((numeric - analytic).norm() < 1e-11, "{numeric} {analytic}");
        assert!((LocalEarth::at(&p).transport_matrix() * v - analytic).norm() < 1e-20); // rounding
    }

    #[test]
    fn rates_stay_finite_at_the_poles() {
        for lat in [core::f64::consts::FRAC_PI_2, -core::f64::consts::FRAC_PI_2] {
            let w = transport_rate_n(&Geodetic::new(lat, 0.0, 0.0), &Vector3::new(1.0, 1.0, 1.0));
            assert!(w.iter().all(|x| x.is_finite()), "{w}");
        }
    }
}
