//! Frames a position or an attitude is written in, and the ways between them.
//!
//! e    Earth-centred Earth-fixed \[m\]: x to (0°, 0°), z to the north pole
//! n    north-east-down at a point; `C_en` maps n to e
//! ENU  east-north-up with body right-forward-up, for users of that convention:
//!      `x_ENU = T x_NED`, `x_RFU = T x_FRD`, `C_ENU = T C_NED T`,
//!      `T = [[0,1,0],[1,0,0],[0,0,−1]]`, a half turn, so `T = Tᵀ = T⁻¹`
//!
//! Accuracy  both directions to the rounding of their results (e: 1e-9 m; longitude near π:
//!           3e-9 m) at every latitude, heights −10 km to 1000 km and beyond; finite everywhere
//! Source    closed form, Groves 2013, eq. 2.112; its inverse by Bowring's iteration on the
//!           parametric latitude (Survey Review 23, 1976), three turns (two pass the tests over
//!           the stated range, the third is margin); `C_en` from Groves 2013, eq. 2.150 transposed

use core::f64::consts::{FRAC_1_SQRT_2, PI};
use fusion_core::math;
use fusion_core::model::Literal;

use fusion_core::geometry::wgs84::{ECCENTRICITY_SQUARED as E2, FLATTENING, Geodetic, Radii, SEMI_MAJOR_AXIS, SEMI_MINOR_AXIS};
use fusion_core::memory::{Memory, Tape};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Geodetic to Earth-centred Earth-fixed `r_eb_e` \[m\].
#[inline]
#[must_use]
pub fn ecef_from_geodetic(position: &Geodetic) -> Vector3<f64> {
    let (sin_lat, cos_lat) = math::sin_cos(position.lat);
    let (sin_lon, cos_lon) = math::sin_cos(position.lon);
    let normal = Radii::of_sin_squared(sin_lat * sin_lat).normal;
    let across = (normal + position.height) * cos_lat;
    Vector3::new(
        across * cos_lon,
        across * sin_lon,
        (normal * (1.0 - E2) + position.height) * sin_lat,
    )
}

/// Earth-centred Earth-fixed `r_eb_e` \[m\] to geodetic. Longitude in (−π, π]; at the poles it
/// is 0. Within 50 km of the Earth's centre the result is finite but means nothing.
#[inline]
#[must_use]
pub fn geodetic_from_ecef(r_e: &Vector3<f64>) -> Geodetic {
    const E2_SECOND: f64 = E2 / (1.0 - E2);
    let across = math::hypot(r_e.x, r_e.y);
    // Parametric latitude β as a direction (cos β, sin β), first guess on the surface.
    let (mut cos_lat, mut sin_lat) = (across * (1.0 - FLATTENING) * (1.0 - FLATTENING), r_e.z);
    for _ in 0..3 {
        let (c, s) = (cos_lat, sin_lat * (1.0 - FLATTENING));
        let n = math::hypot(c, s);
        let (c, s) = if n > 0.0 { (c / n, s / n) } else { (1.0, 0.0) };
        sin_lat = r_e.z + E2_SECOND * SEMI_MINOR_AXIS * (s * s * s);
        cos_lat = across - E2 * SEMI_MAJOR_AXIS * (c * c * c);
    }
    let lat = math::atan2(sin_lat, cos_lat);
    let n = math::hypot(cos_lat, sin_lat);
    let (c, s) = if n > 0.0 { (cos_lat / n, sin_lat / n) } else { (1.0, 0.0) };
    let lon = math::atan2(r_e.y, r_e.x);
    Geodetic {
        lat,
        lon: if lon <= -PI { PI } else { lon },
        // Regular at the poles and at the equator alike.
        height: across * c + r_e.z * s - SEMI_MAJOR_AXIS * math::sqrt(1.0 - E2 * s * s),
    }
}

/// `C_en`, 3×3: columns are north, east and down at a point, in Earth-fixed axes.
#[inline]
#[must_use]
pub fn rotation_en(lat: f64, lon: f64) -> Matrix3<f64> {
    let (sp, cp) = math::sin_cos(lat);
    let (sl, cl) = math::sin_cos(lon);
    Matrix3::new(-sp * cl, -sl, -cp * cl, -sp * sl, cl, -cp * sl, cp, 0.0, -sp)
}

/// Cartesian north-east-down axes fixed to the Earth at an origin, tangent there.
#[derive(Clone, Copy, Debug, Literal, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    origin_e: Vector3<f64>,
    c_en: Matrix3<f64>,
}

impl Default for LocalFrame {
    fn default() -> Self {
        Self::new(Geodetic::default())
    }
}

impl Memory for LocalFrame {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut origin = self.origin;
        origin.remember(tape);
        if origin != self.origin {
            *self = Self::new(origin);
        }
    }
}

impl LocalFrame {
    /// The frame at an origin.
    #[must_use]
    pub fn new(origin: Geodetic) -> Self {
        Self {
            origin,
            origin_e: ecef_from_geodetic(&origin),
            c_en: rotation_en(origin.lat, origin.lon),
        }
    }

    /// Where the axes are fixed.
    #[inline]
    #[must_use]
    pub const fn origin(&self) -> Geodetic {
        self.origin
    }

    /// Local north, east, down \[m\] of a position, exact at any distance.
    #[inline]
    #[must_use]
    pub fn to_ned(&self, position: &Geodetic) -> Vector3<f64> {
        self.c_en.tr_mul(&(ecef_from_geodetic(position) - self.origin_e))
    }

    /// The position at local north, east, down \[m\].
    #[inline]
    #[must_use]
    pub fn to_geodetic(&self, r_ned: &Vector3<f64>) -> Geodetic {
        geodetic_from_ecef(&(self.origin_e + self.c_en * r_ned))
    }
}

/// T, 3×3: swaps north-east-down with east-north-up, and forward-right-down with
/// right-forward-up. Its own inverse.
#[inline]
#[must_use]
pub fn swap_matrix() -> Matrix3<f64> {
    Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0)
}

/// `T v`: a vector from one convention to the other.
#[inline]
#[must_use]
pub fn swap_axes(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.y, v.x, -v.z)
}

/// The quaternion of `T C T`: an attitude (forward-right-down to north-east-down) from or to
/// (right-forward-up to east-north-up). The vector part turns with T, the scalar stays.
#[inline]
#[must_use]
pub fn swap_attitude(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.j, q.i, -q.k))
}

/// The quaternion of T itself: a half turn about the axis midway between x and y. For a mount
/// whose sensor reports right-forward-up under a forward-right-down body.
#[inline]
#[must_use]
pub fn swap_quaternion() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;
    use fusion_core::geometry::so3;

    /// Geodetic \[rad, rad, m\] and Earth-fixed \[m\], from the closed form in 50-digit arithmetic
    /// (mpmath 1.3), printed to 17 digits.
    #[expect(clippy::excessive_precision, clippy::approx_constant, reason = "as printed by the oracle")]
    #[rustfmt::skip]
    const GOLDEN: [([f64; 3], [f64; 3]); 8] = [
        ([0.6300338015, 2.2593277471, -23.0],
         [-3_278_406.179_040_670_1, 3_984_111.216_963_643_4, 3_736_994.867_424_186_9]),
        ([0.0, 0.0, 0.0],
         [6_378_137.0, 0.0, 0.0]),
        ([1.5707963, -3.1, 1_000_000.0],
         [-0.198_099_871_054_054_25, -0.008_244_253_907_115_587_6, 7_356_752.314_245_176_8]),
        ([-1.5, 0.001, -10_000.0],
         [451_974.114_116_904_20, 451.974_264_775_002_52, -6_330_746.702_235_084_8]),
        ([-0.7, -2.0, 400_000.0],
         [-2_160_216.511_451_517_8, -4_720_159.190_797_300_1, -4_344_770.621_368_388_2]),
        ([0.0001, 1.5, -10_000.0],
         [450_464.188_979_341_22, 6_352_184.699_959_813_3, 632.543_931_696_248_07]),
        ([0.785, 3.1415926, 8848.0],
         [-4_525_642.188_108_992_8, 0.242_528_228_822_446_59, 4_491_809.346_428_900_0]),
        ([-1.5707963267, 0.5, 12.0],
         [0.000_532_956_584_521_781_5, 0.000_291_155_509_102_891_82, -6_356_764.314_245_179_5]),
    ];

    #[test]
    fn earth_fixed_coordinates_match_fifty_digit_arithmetic_both_ways() {
        for ([lat, lon, height], [x, y, z]) in GOLDEN {
            let (p, r) = (Geodetic::new(lat, lon, height), Vector3::new(x, y, z));
            // 2e-9 m: two ulps of 6.4e6 m in each coordinate.
            let forward = (ecef_from_geodetic(&p) - r).amax();
            assert!(forward <= 2e-9, "{lat} {lon} {height} {forward:e}");
            // 4e-9 m: an ulp of longitude near π is 2.8e-9 m.
            let back = geodetic_from_ecef(&r);
            let (north, east) = p.metres_per_radian();
            let backward = ((back.lat - lat) * north)
                .hypot((back.lon - lon) * east)
                .hypot(back.height - height);
            assert!(backward <= 4e-9, "{lat} {lon} {height} {backward:e}");
        }
    }

    #[test]
    fn geodetic_and_earth_fixed_round_trip_over_the_whole_range() {
        for i in 0..=180 {
            let lat = FRAC_PI_2 * f64::from(i - 90) / 90.0;
            for lon in [-3.0, -0.4, 0.0, 1.1, PI] {
                for h in [-10_000.0, -23.0, 0.0, 3_000.0, 100_000.0, 1_000_000.0] {
                    let p = Geodetic::new(lat, lon, h);
                    let r = ecef_from_geodetic(&p);
                    let back = geodetic_from_ecef(&r);
                    // 5e-9 m: rounding of both maps, see the golden test.
                    let across = r.x.hypot(r.y);
                    let position = (ecef_from_geodetic(&back) - r).norm();
                    assert!(position < 5e-9, "{lat} {lon} {h} {position:e}");
                    assert!((back.lat - lat).abs() * 6.4e6 < 5e-9, "{lat} {lon} {h}");
                    assert!((back.height - h).abs() < 5e-9, "{lat} {lon} {h}");
                    assert!((back.lon - lon).abs() * across < 5e-9, "{lat} {lon} {h}");
                }
            }
        }
    }

    #[test]
    fn the_site_lies_at_its_tabulated_earth_fixed_point() {
        let p = Geodetic::new(36.098_277_778_f64.to_radians(), 129.449_944_444_f64.to_radians(), -23.0);
        let expected = Vector3::new(-3_278_406.178_9, 3_984_111.217, 3_736_994.867_5);
        // 1e-4 m: four decimals of metres, and angles to 5e-10° = 6e-5 m.
        assert!((ecef_from_geodetic(&p) - expected).amax() < 1.2e-4);
    }

    #[test]
    fn degenerate_points_are_finite() {
        for r in [Vector3::zeros(), Vector3::new(0.0, 0.0, -1.0), Vector3::new(-1.0, -0.0, 0.0)] {
            let p = geodetic_from_ecef(&r);
            assert!(p.lat.is_finite() && p.lon > -PI && p.lon <= PI && p.height.is_finite());
        }
        assert_eq!(geodetic_from_ecef(&Vector3::new(0.0, 0.0, 7e6)).lat, FRAC_PI_2);
    }

    #[test]
    fn the_local_frame_matches_the_tabulated_acoustic_fix() {
        let site = Geodetic::new(36.098_277_778_f64.to_radians(), 129.449_944_444_f64.to_radians(), 10.0);
        let p = LocalFrame::new(site).to_geodetic(&Vector3::new(-16.33596, 26.60041, 35.18709));
        // Table: first-order chart, nine decimals of a degree. 1e-8° = 1 mm; 1e-4 m: curvature.
        assert!((p.lat.to_degrees() - 36.098_130_555).abs() < 1e-8, "{}", p.lat.to_degrees());
        assert!((p.lon.to_degrees() - 129.450_239_834).abs() < 1e-8, "{}", p.lon.to_degrees());
        assert!((p.height + 25.18709).abs() < 1e-4);
    }

    #[test]
    fn the_local_frame_inverts_itself_and_meets_the_geodetic_chart_at_its_origin() {
        let frame = LocalFrame::new(Geodetic::new(0.63, 2.26, -23.0));
        for d in [Vector3::new(1.0, -2.0, 3.0), Vector3::new(-4e5, 6e5, -2e4)] {
            let back = frame.to_ned(&frame.to_geodetic(&d));
            assert!((back - d).amax() < 1e-8); // a few roundings of 6.4e6 m
        }
        let d = Vector3::new(3.0, -4.0, 1.0);
        let chart = frame.to_ned(&frame.origin().offset(&d));
        // 1e-5 m: curvature d²/2R = 2e-6 m, and h/R = 4e-7 of d.
        assert!((chart - d).amax() < 1e-5);
        assert_eq!(frame.to_ned(&frame.origin()), Vector3::zeros());
    }

    #[test]
    fn swapping_conventions_equals_the_matrix_product() {
        let t = swap_matrix();
        assert_eq!(t * t, Matrix3::identity());
        assert_eq!(t.determinant(), 1.0);
        let v = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(t * v, swap_axes(&v));
        let q = so3::from_rpy(0.3, -0.2, 1.9);
        let c = t * so3::rotation(&q) * t;
        // 4 ε: rounding of the products.
        assert!((so3::rotation(&swap_attitude(&q)) - c).amax() < 1e-15);
        assert!((so3::rotation(&swap_quaternion()) - t).amax() < 1e-15);
    }

    #[test]
    fn a_swapped_attitude_matches_the_published_right_forward_up_columns() {
        // Noureldin et al. 2013: pitch p, roll r, y = −heading.
        let (roll, pitch, heading) = (0.2_f64, -0.1_f64, 1.3_f64);
        let (sr, cr) = roll.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        let (sy, cy) = (-heading).sin_cos();
        let expected = Matrix3::from_columns(&[
            Vector3::new(cy * cr - sy * sp * sr, sy * cr + cy * sp * sr, -cp * sr),
            Vector3::new(-sy * cp, cy * cp, sp),
            Vector3::new(cy * sr + sy * sp * cr, sy * sr - cy * sp * cr, cp * cr),
        ]);
        let q = swap_attitude(&so3::from_rpy(roll, pitch, heading));
        assert!((so3::rotation(&q) - expected).amax() < 1e-15); // 4 ε
    }
}
