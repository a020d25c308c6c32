//! Universal Transverse Mercator coordinates as positions.
//!
//! Accuracy  a nanometre or two within 3900 km of the central meridian, far beyond any zone
//! Source    Krüger's series to sixth order in the third flattening: Karney, Transverse Mercator with an
//!           accuracy of a few nanometers (J. Geodesy 85, 2011), eqs. 7-9, 11, 15, 19-21, 36
//! Not here  from a position to the plane, the polar grids (UPS), convergence and scale

use fusion_core::geometry::wgs84::{ECCENTRICITY_SQUARED as E2, FLATTENING, Geodetic, SEMI_MAJOR_AXIS};
use fusion_core::math;

/// Scale on the central meridian.
const SCALE: f64 = 0.9996;
const FALSE_EASTING: f64 = 500_000.0;
const FALSE_NORTHING_SOUTH: f64 = 10_000_000.0;
/// The third flattening.
const N: f64 = FLATTENING / (2.0 - FLATTENING);
/// Newton's method doubles the digits at each step; two steps reach rounding, the rest is margin.
const STEPS: usize = 5;

/// A zone of the grid, with its hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Zone {
    number: u8,
    is_south: bool,
}

impl Zone {
    /// Zone `number`, of which there are 60; `None` for another one.
    #[must_use]
    pub const fn new(number: u8, is_south: bool) -> Option<Self> {
        if matches!(number, 1..=60) {
            Some(Self { number, is_south })
        } else {
            None
        }
    }

    /// The position of easting, northing \[m\] and ellipsoidal height \[m\]. Far outside the zone the
    /// series mean nothing, and the result is finite.
    #[must_use]
    pub fn to_geodetic(self, easting: f64, northing: f64, height: f64) -> Geodetic {
        let false_northing = if self.is_south { FALSE_NORTHING_SOUTH } else { 0.0 };
        let unit = SCALE * rectifying_radius();
        let (xi, eta) = ((northing - false_northing) / unit, (easting - FALSE_EASTING) / unit);
        let (mut x, mut y) = (xi, eta);
        for (j, beta) in beta().into_iter().enumerate() {
            let twice = 2.0 * (j + 1) as f64;
            let (sin, cos) = math::sin_cos(twice * xi);
            x -= beta * sin * math::cosh(twice * eta);
            y -= beta * cos * math::sinh(twice * eta);
        }
        let (sin, cos) = math::sin_cos(x);
        let conformal = sin / math::hypot(math::sinh(y), cos);
        let central = (6.0 * f64::from(self.number) - 183.0).to_radians();
        Geodetic {
            lat: math::atan(tangent_of_latitude(conformal)),
            lon: fusion_core::geometry::so3::wrap_angle(central + math::atan2(math::sinh(y), cos)),
            height,
        }
    }
}

/// The radius of the circle as long as a meridian \[m\].
fn rectifying_radius() -> f64 {
    let n2 = N * N;
    SEMI_MAJOR_AXIS / (1.0 + N) * (1.0 + n2 * (1.0 / 4.0 + n2 * (1.0 / 64.0 + n2 / 256.0)))
}

/// Coefficients of the series from the plane to the conformal sphere.
fn beta() -> [f64; 6] {
    let polynomial = |lowest: i32, factors: &[f64]| math::powi(N, lowest) * factors.iter().rev().fold(0.0, |sum, factor| sum * N + factor);
    [
        polynomial(
            1,
            &[
                1.0 / 2.0,
                -2.0 / 3.0,
                37.0 / 96.0,
                -1.0 / 360.0,
                -81.0 / 512.0,
                96_199.0 / 604_800.0,
            ],
        ),
        polynomial(
            2,
            &[1.0 / 48.0, 1.0 / 15.0, -437.0 / 1440.0, 46.0 / 105.0, -1_118_711.0 / 3_870_720.0],
        ),
        polynomial(3, &[17.0 / 480.0, -37.0 / 840.0, -209.0 / 4480.0, 5569.0 / 90_720.0]),
        polynomial(4, &[4397.0 / 161_280.0, -11.0 / 504.0, -830_251.0 / 7_257_600.0]),
        polynomial(5, &[4583.0 / 161_280.0, -108_847.0 / 3_991_680.0]),
        polynomial(6, &[20_648_693.0 / 638_668_800.0]),
    ]
}

/// The tangent of the geodetic latitude from that of the conformal one.
fn tangent_of_latitude(conformal: f64) -> f64 {
    let e = math::sqrt(E2);
    let mut t = conformal / (1.0 - E2);
    for _ in 0..STEPS {
        let one = math::hypot(1.0_f64, t);
        let sigma = math::sinh(e * math::atanh(e * t / one));
        let seen = t * math::hypot(1.0_f64, sigma) - sigma * one;
        let slope = (1.0 + (1.0 - E2) * t * t) / ((1.0 - E2) * math::hypot(1.0_f64, seen) * one);
        t += (conformal - seen) * slope;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_proj_over_zones_and_hemispheres() {
        // pyproj 3.7.2, from EPSG:326xx and 327xx to EPSG:4326, printed to 1e-12 deg.
        let cases = [
            (32, false, 448_251.795, 5_411_943.794, 48.858_299_993_107, 8.294_498_591_891),
            (32, false, 500_000.0, 0.0, 0.0, 9.0),
            (13, false, 487_439.123_4, 4_438_549.987_6, 40.097_146_167_055, -105.147_361_317_157),
            (33, false, 812_345.678, 7_123_456.789, 64.095_916_998_693, 21.416_126_883_092),
            (56, true, 334_368.633_6, 6_250_948.345_4, -33.868_799_999_857, 151.209_299_999_483),
            (19, true, 166_021.443, 1_116_915.044, -79.579_614_843_951, -85.763_532_657_874),
            (31, false, 399_000.0, 9_328_000.0, 83.931_599_864_732, -5.588_830_742_275),
        ];
        for (number, is_south, easting, northing, lat, lon) in cases {
            let found = Zone::new(number, is_south).unwrap().to_geodetic(easting, northing, 12.5);
            let (d_lat, d_lon) = (found.lat.to_degrees() - lat, found.lon.to_degrees() - lon);
            // Rounding of what is printed, and of longitudes near 180 deg.
            assert!(d_lat.abs() < 2e-12 && d_lon.abs() < 2e-12, "{number}: {d_lat:e} {d_lon:e}");
            assert_eq!(found.height, 12.5);
        }
        assert_eq!((Zone::new(0, false), Zone::new(61, true)), (None, None));
    }

    #[test]
    fn what_lies_outside_every_zone_is_finite() {
        let zone = Zone::new(1, false).unwrap();
        for (easting, northing) in [(-1e7, 3e7), (1e6, -2e7), (500_000.0, 10_001_965.7), (3e7, 0.0)] {
            let p = zone.to_geodetic(easting, northing, 0.0);
            assert!(p.lat.is_finite() && p.lon.is_finite(), "{easting} {northing}: {p:?}");
        }
    }
}
