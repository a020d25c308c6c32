//! The WGS-84 ellipsoid and geodetic position as a manifold.
//!
//! Position    latitude φ, longitude λ \[rad\], height h above the ellipsoid \[m\]
//! Tangent     `δr_n = [δN, δE, δD]` \[m\] at the point, north-east-down
//! ⊞           `φ + δN/(RM+h)`, `λ + δE/((RN+h) cos φ)`, `h − δD`, scales taken at the base point
//! ⊟           the inverse of ⊞ about the base point, exact up to rounding of φ and λ
//!             (an ulp of λ near π is 3e-9 m)
//! Valid       a chart, not a geodesic: metres are true to first order, which a filter's error
//!             needs. For exact local coordinates go through Earth-centred axes.
//! Poles       cos φ is held at or above 1e-6 in size (a ring of 6 m), so every result is finite.
//!             A latitude pushed past ±90° is left there: it still names the right point.
//! Source      NIMA TR8350.2; Groves 2013, eqs. 2.105, 2.106, 2.111

use crate::math;
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use nalgebra::Vector3;

use super::so3::wrap_angle;

/// Semi-major axis a \[m\].
pub const SEMI_MAJOR_AXIS: f64 = 6_378_137.0;
/// Flattening f.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// Semi-minor axis b = a(1 − f) \[m\].
pub const SEMI_MINOR_AXIS: f64 = SEMI_MAJOR_AXIS * (1.0 - FLATTENING);
/// First eccentricity squared e² = f(2 − f).
pub const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);
/// Earth's rotation rate Ω \[rad/s\].
pub const EARTH_RATE: f64 = 7.292_115e-5;
/// Gravitational constant times Earth's mass, GM \[m³/s²\].
pub const GM: f64 = 3.986_004_418e14;

/// The least |cos φ| used in a divisor.
const COS_LATITUDE_FLOOR: f64 = 1e-6;

/// Radii of curvature \[m\], or their derivatives with latitude \[m/rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radii {
    /// Along the meridian, RM (north-south).
    pub meridian: f64,
    /// Along the prime vertical, RN (east-west).
    pub normal: f64,
}

impl Radii {
    /// RM and RN from sin²φ.
    #[inline]
    #[must_use]
    pub fn of_sin_squared(sin2: f64) -> Self {
        let w2 = 1.0 - ECCENTRICITY_SQUARED * sin2;
        let w = math::sqrt(w2);
        Self {
            meridian: SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY_SQUARED) / (w2 * w),
            normal: SEMI_MAJOR_AXIS / w,
        }
    }

    /// 1/(RM + h) and 1/(RN + h) \[1/m\] from sin²φ and the height h: one division each.
    #[inline]
    #[must_use]
    pub fn reciprocals(sin2: f64, height: f64) -> Self {
        let w2 = 1.0 - ECCENTRICITY_SQUARED * sin2;
        let w = math::sqrt(w2);
        let w3 = w2 * w;
        Self {
            meridian: w3 / (SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY_SQUARED) + height * w3),
            normal: w / (SEMI_MAJOR_AXIS + height * w),
        }
    }
}

/// RM and RN at a latitude \[rad\]:
/// `RM = a(1−e²)/(1−e²sin²φ)^{3/2}`, `RN = a/(1−e²sin²φ)^{1/2}`.
#[inline]
#[must_use]
pub fn radii(lat: f64) -> Radii {
    let s = math::sin(lat);
    Radii::of_sin_squared(s * s)
}

/// dRM/dφ and dRN/dφ \[m/rad\]: `3 RM e² sc/(1−e²s²)` and `RN e² sc/(1−e²s²)`.
#[inline]
#[must_use]
pub fn radii_derivative(lat: f64) -> Radii {
    let (s, c) = math::sin_cos(lat);
    let r = Radii::of_sin_squared(s * s);
    let k = ECCENTRICITY_SQUARED * s * c / (1.0 - ECCENTRICITY_SQUARED * s * s);
    Radii {
        meridian: 3.0 * r.meridian * k,
        normal: r.normal * k,
    }
}

/// sin φ and cos φ of a latitude \[rad\], each to 2 ulps.
///
/// Polynomials about the equator below 45°, about the pole above: faster than the platform's functions,
/// which take any angle, and the same bits everywhere. Far beyond a pole the platform's are taken.
#[inline]
#[must_use]
pub fn sin_cos_latitude(lat: f64) -> (f64, f64) {
    let size = lat.abs();
    if size <= FRAC_PI_4 {
        return near_zero(lat);
    }
    if size < 3.0 * FRAC_PI_4 {
        // π/2 − φ, π/2 in two parts.
        let (cos, sin) = near_zero((FRAC_PI_2 - size) + FRAC_PI_2_REST);
        return (sin.copysign(lat), cos);
    }
    math::sin_cos(lat)
}

/// π/2 less its nearest double.
const FRAC_PI_2_REST: f64 = 6.123_233_995_736_766e-17;

/// sin x and cos x for |x| ≤ π/4: the minimax polynomials of fdlibm.
#[inline]
#[expect(clippy::excessive_precision, reason = "as printed by the source")]
fn near_zero(x: f64) -> (f64, f64) {
    const S: [f64; 6] = [
        -1.666_666_666_666_663_243_48e-1,
        8.333_333_333_322_489_461_24e-3,
        -1.984_126_982_985_794_931_34e-4,
        2.755_731_370_707_006_767_89e-6,
        -2.505_076_025_340_686_341_95e-8,
        1.589_690_995_211_550_102_21e-10,
    ];
    const C: [f64; 6] = [
        4.166_666_666_666_660_190_37e-2,
        -1.388_888_888_887_410_957_49e-3,
        2.480_158_728_947_672_941_78e-5,
        -2.755_731_435_139_066_330_35e-7,
        2.087_572_321_298_174_827_90e-9,
        -1.135_964_755_778_819_482_65e-11,
    ];
    let z = x * x;
    let (z2, z4) = (z * z, (z * z) * (z * z));
    // By halves rather than by Horner's scheme: a third of the depth.
    let series = |k: &[f64; 6]| (k[0] + k[1] * z) + z2 * (k[2] + k[3] * z) + z4 * (k[4] + k[5] * z);
    let (half, sin) = (0.5 * z, x + x * z * series(&S));
    let rounded = 1.0 - half;
    (sin, rounded + (((1.0 - rounded) - half) + z2 * series(&C)))
}

/// cos φ for use in a divisor: the sign is kept, the size is at least 1e-6.
#[inline]
#[must_use]
pub fn divisible_cos(cos_lat: f64) -> f64 {
    cos_lat.abs().max(COS_LATITUDE_FLOOR).copysign(cos_lat)
}

/// A geodetic position on WGS-84.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geodetic {
    /// Geodetic latitude φ \[rad\], north positive.
    pub lat: f64,
    /// Longitude λ \[rad\], east positive.
    pub lon: f64,
    /// Height above the ellipsoid h \[m\], up positive.
    pub height: f64,
}
crate::memory!(Geodetic { lat, lon, height });

impl Geodetic {
    /// From latitude and longitude \[rad\] and height \[m\].
    #[inline]
    #[must_use]
    pub const fn new(lat: f64, lon: f64, height: f64) -> Self {
        Self { lat, lon, height }
    }

    /// Metres per radian of latitude and of longitude at this point:
    /// `RM + h` and `(RN + h) cos φ`, with cos φ held off zero.
    #[inline]
    #[must_use]
    pub fn metres_per_radian(&self) -> (f64, f64) {
        let (s, c) = sin_cos_latitude(self.lat);
        let r = Radii::of_sin_squared(s * s);
        (r.meridian + self.height, (r.normal + self.height) * divisible_cos(c))
    }

    /// `self ⊞ δr`: the point displaced by `d_ned` = \[δN, δE, δD\] \[m\] in the chart of this
    /// point. Longitude comes back in (−π, π].
    #[inline]
    #[must_use]
    pub fn offset(&self, d_ned: &Vector3<f64>) -> Self {
        let (s, c) = sin_cos_latitude(self.lat);
        let per = Radii::reciprocals(s * s, self.height);
        Self {
            lat: self.lat + d_ned.x * per.meridian,
            lon: wrap_angle(self.lon + d_ned.y * per.normal / divisible_cos(c)),
            height: self.height - d_ned.z,
        }
    }

    /// `self ⊟ other` = \[δN, δE, δD\] \[m\] in the chart of `other`, so that
    /// `other.offset(&self.difference(other)) == self` up to rounding. The shorter way round
    /// in longitude.
    #[inline]
    #[must_use]
    pub fn difference(&self, other: &Self) -> Vector3<f64> {
        let (north, east) = other.metres_per_radian();
        Vector3::new(
            (self.lat - other.lat) * north,
            wrap_angle(self.lon - other.lon) * east,
            other.height - self.height,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn radii_of_curvature_match_the_wgs_84_table_from_equator_to_pole() {
        let table = [
            (0.0, 6_335_439.327_3, 6_378_137.0),
            (30.0, 6_351_377.103_7, 6_383_480.917_7),
            (36.098_277_778, 6_357_586.880_4, 6_385_560.628_3),
            (45.0, 6_367_381.815_6, 6_388_838.290_1),
            (60.0, 6_383_453.857_2, 6_394_209.173_8),
            (90.0, 6_399_593.625_8, 6_399_593.625_8),
        ];
        for (lat, meridian, normal) in table {
            let r = radii(f64::to_radians(lat));
            // 6e-5 m: the table has four decimals.
            assert!((r.meridian - meridian).abs() < 6e-5, "{lat} {}", r.meridian);
            assert!((r.normal - normal).abs() < 6e-5, "{lat} {}", r.normal);
        }
        assert!((ECCENTRICITY_SQUARED - 0.006_694_379_990_14).abs() < 5e-15); // its digits
    }

    #[test]
    fn sine_and_cosine_of_a_latitude_are_those_of_the_platform_to_two_ulps() {
        let ulp = |x: f64| (x.abs().next_up() - x.abs()).max(f64::MIN_POSITIVE);
        let edges = [
            0.0,
            1e-300,
            1e-9,
            FRAC_PI_4,
            FRAC_PI_4.next_up(),
            FRAC_PI_2,
            FRAC_PI_2.next_up(),
            3.0 * FRAC_PI_4,
            3.0,
            40.0,
        ];
        let grid = (0..100_000).map(|k| f64::from(k) * 2.4e-5);
        for lat in edges.into_iter().chain(grid).flat_map(|x| [x, -x]) {
            let ((s, c), (sin, cos)) = (sin_cos_latitude(lat), lat.sin_cos());
            assert!(
                (s - sin).abs() <= 2.0 * ulp(sin) && (c - cos).abs() <= 2.0 * ulp(cos),
                "{lat:e}: {s:e} {c:e}"
            );
        }
        let (s, c) = sin_cos_latitude(f64::NAN);
        assert!(s.is_nan() && c.is_nan());
    }

    #[test]
    fn reciprocals_are_those_of_the_radii_with_the_height_added() {
        for (sin2, height) in [(0.0, 0.0), (0.3, -4000.0), (0.9, 1e5), (1.0, 20.0)] {
            let (r, per) = (Radii::of_sin_squared(sin2), Radii::reciprocals(sin2, height));
            // 4 ε: roundings of both sides.
            assert!(((r.meridian + height) * per.meridian - 1.0).abs() < 1e-15);
            assert!(((r.normal + height) * per.normal - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_degree_at_the_site_is_110_960_8235_m_north_and_90_051_6848_m_east() {
        let (north, east) = Geodetic::new(36.098_277_778_f64.to_radians(), 2.26, 0.0).metres_per_radian();
        // 6e-5 m: the table has four decimals.
        assert!((north.to_radians() - 110_960.823_5).abs() < 6e-5);
        assert!((east.to_radians() - 90_051.684_8).abs() < 6e-5);
    }

    #[test]
    fn radii_derivative_matches_central_differences() {
        let h = 1e-5;
        for lat in [-1.2, -0.3, 0.0, 0.63, 1.5] {
            let (d, p, m) = (radii_derivative(lat), radii(lat + h), radii(lat - h));
            // 1e-3 m/rad of up to 1e5: rounding of 6e6 m (1e-9) over 2h.
            assert!((d.meridian - (p.meridian - m.meridian) / (2.0 * h)).abs() < 1e-3, "{lat}");
            assert!((d.normal - (p.normal - m.normal) / (2.0 * h)).abs() < 1e-3, "{lat}");
        }
    }

    #[test]
    fn difference_inverts_offset_everywhere_including_the_date_line_and_the_poles() {
        let d = Vector3::new(1.5, -2.5, 30.0);
        for lat in [-FRAC_PI_2, -1.0, 0.0, 0.63, 1.55, FRAC_PI_2] {
            for lon in [-PI, 1e-8 - PI, 0.0, 2.259, PI] {
                let p = Geodetic::new(lat, lon, -23.0);
                let q = p.offset(&d);
                assert!(q.lon > -PI && q.lon <= PI);
                // 1e-8 m: a few ulps of an angle near π, 3e-9 m each.
                assert!((q.difference(&p) - d).amax() < 1e-8, "{lat} {lon} {}", q.difference(&p));
            }
        }
    }

    #[test]
    fn offset_inverts_difference() {
        let p = Geodetic::new(0.63, PI - 1e-3, 100.0);
        let q = Geodetic::new(0.6301, 1e-4 - PI, -50.0);
        let back = p.offset(&q.difference(&p));
        // 4 ulps of each coordinate.
        assert!((back.lat - q.lat).abs() < 5e-16 && (back.lon - q.lon).abs() < 2e-15);
        assert!((back.height - q.height).abs() < 1e-13);
        assert!(q.difference(&p).y > 0.0, "the short way goes east across the date line");
    }

    #[test]
    fn offset_north_and_east_match_meridian_and_parallel_arcs() {
        // Oracle: rectifying series of the meridian arc from the equator to 1°, 110 574.3886 m.
        let steps = 1000;
        let mut p = Geodetic::new(0.0, 0.0, 0.0);
        for _ in 0..steps {
            p = p.offset(&Vector3::new(110_574.388_6 / f64::from(steps), 0.0, 0.0));
        }
        // 2e-9 rad = 1 cm: a first-order chart applied in steps of 110 m.
        assert!((p.lat - 1_f64.to_radians()).abs() < 2e-9, "{}", p.lat.to_degrees());
        // A full parallel closes: 2π RN cos φ metres east.
        let start = Geodetic::new(0.8, 1.0, 0.0);
        let circle = core::f64::consts::TAU * radii(0.8).normal * 0.8_f64.cos();
        let end = start.offset(&Vector3::new(0.0, circle, 0.0));
        assert!((end.lon - 1.0).abs() < 1e-14); // rounding of 2π
    }
}
