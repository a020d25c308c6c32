//! Magnitude of gravity (gravitation less centrifugal) over the WGS-84 ellipsoid.
//!
//! `g_n = [0, 0, +g]` in north-east-down. With s = sin²φ, h height \[m\], g \[m/s²\]:
//!
//! Somigliana        `9.7803253359 (1 + 0.00193185265241 s)/√(1 − e² s)`
//!                   `· [1 − (2/a)(1 + f + m − 2 f s) h + 3 h²/a²]`, m = Ω² a² b/GM
//! TittertonWeston   `9.780318 (1 + 5.3024e-3 s − 5.9e-6 sin²2φ)/(1 + h/R0)²`, R0 = √(RM RN)
//! Noureldin         `9.7803267714 (1 + 0.0052790414 s + 0.0000232718 s²)`
//!                   `+ (−3.0876910891e-6 + 4.3977311e-9 s) h + 7.211e-13 h²`
//!
//! Flat              g, on a plane that does not turn
//!
//! Valid    heights of −10 km to 100 km; the three differ by about 1e-5 m/s² at the surface
//! Not here deflection of the vertical, anomalies, tides; decrease with depth under water or rock
//! Source   Groves 2013, eqs. 2.134 and 2.139; Titterton and Weston 2004, eqs. 3.89-3.91;
//!          Noureldin, Karamat and Georgy 2013, eq. 2.142

use fusion_core::geometry::wgs84::{
    EARTH_RATE, ECCENTRICITY_SQUARED as E2, FLATTENING, GM, SEMI_MAJOR_AXIS, SEMI_MINOR_AXIS, sin_cos_latitude,
};
use fusion_core::math;
use fusion_core::model::Literal;
use nalgebra::Vector3;

/// Standard gravity g₀ \[m/s²\], exact by definition (CGPM 1901).
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// Which formula gives the magnitude of gravity.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq)]
pub enum Gravity {
    /// Normal gravity of the WGS-84 ellipsoid, second order in height.
    #[default]
    Somigliana,
    /// Series in latitude, inverse square in height.
    TittertonWeston,
    /// Series in latitude and height.
    Noureldin,
    /// Constant \[m/s²\]: that of a process which takes the Earth for a plane that does not turn. The
    /// world simulated for it is that plane.
    Flat(f64),
}

/// How the magnitude of gravity changes with position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient {
    /// ∂g/∂φ \[m/s² per rad\].
    pub per_latitude: f64,
    /// ∂g/∂h \[m/s² per m\], negative.
    pub per_height: f64,
}

/// Somigliana's constant k = b γ_p/(a γ_e) − 1.
const K: f64 = 0.001_931_852_652_41;
/// Normal gravity at the equator \[m/s²\].
const G_EQUATOR: f64 = 9.780_325_335_9;
/// 1/a \[1/m\].
const PER_AXIS: f64 = 1.0 / SEMI_MAJOR_AXIS;
/// Ω² a² b/GM.
const M: f64 = EARTH_RATE * EARTH_RATE * SEMI_MAJOR_AXIS * SEMI_MAJOR_AXIS * SEMI_MINOR_AXIS / GM;

/// `R0 = √(RM RN) = b/(1 − e² s)` and dR0/ds.
#[inline]
fn mean_radius(s: f64) -> (f64, f64) {
    let w2 = 1.0 - E2 * s;
    (SEMI_MINOR_AXIS / w2, SEMI_MINOR_AXIS * E2 / (w2 * w2))
}

impl Gravity {
    /// g \[m/s²\] at latitude \[rad\] and height \[m\].
    #[inline]
    #[must_use]
    pub fn magnitude(self, lat: f64, h: f64) -> f64 {
        let sin = sin_cos_latitude(lat).0;
        self.of_sin_squared(sin * sin, h)
    }

    /// g \[m/s²\] from s = sin²φ, for callers that have it.
    #[inline]
    #[must_use]
    pub fn of_sin_squared(self, s: f64, h: f64) -> f64 {
        match self {
            Self::Flat(g) => g,
            Self::Somigliana => {
                let surface = G_EQUATOR * (1.0 + K * s) / math::sqrt(1.0 - E2 * s);
                let u = h * PER_AXIS;
                surface * (1.0 - 2.0 * (1.0 + FLATTENING + M - 2.0 * FLATTENING * s) * u + 3.0 * u * u)
            }
            Self::TittertonWeston => {
                let surface = 9.780_318 * (1.0 + 5.3024e-3 * s - 5.9e-6 * 4.0 * s * (1.0 - s));
                let ratio = 1.0 + h / mean_radius(s).0;
                surface / (ratio * ratio)
            }
            Self::Noureldin => {
                9.780_326_771_4 * (1.0 + s * (0.005_279_041_4 + 0.000_023_271_8 * s))
                    + h * (-3.087_691_089_1e-6 + 4.397_731_1e-9 * s + 7.211e-13 * h)
            }
        }
    }

    /// `g_n = [0, 0, g]` \[m/s²\], north-east-down.
    #[inline]
    #[must_use]
    pub fn vector_n(self, lat: f64, h: f64) -> Vector3<f64> {
        Vector3::new(0.0, 0.0, self.magnitude(lat, h))
    }

    /// Exact derivatives of [`Self::magnitude`] at latitude \[rad\] and height \[m\].
    #[inline]
    #[must_use]
    pub fn gradient(self, lat: f64, h: f64) -> Gradient {
        let (sin, cos) = sin_cos_latitude(lat);
        self.gradient_of(sin, cos, h)
    }

    /// The same from sin φ and cos φ, for callers that have them.
    #[inline]
    #[must_use]
    pub fn gradient_of(self, sin: f64, cos: f64, h: f64) -> Gradient {
        let s = sin * sin;
        let (per_s, per_height) = match self {
            Self::Flat(_) => (0.0, 0.0),
            Self::Somigliana => {
                let w2 = 1.0 - E2 * s;
                let root = G_EQUATOR / math::sqrt(w2);
                let surface = root * (1.0 + K * s);
                let surface_s = root * (K + 0.5 * E2 * (1.0 + K * s) / w2);
                let u = h * PER_AXIS;
                let slope = 2.0 * (1.0 + FLATTENING + M - 2.0 * FLATTENING * s);
                let factor = 1.0 - slope * u + 3.0 * u * u;
                (
                    surface_s * factor + surface * 4.0 * FLATTENING * u,
                    surface * (6.0 * u - slope) * PER_AXIS,
                )
            }
            Self::TittertonWeston => {
                let surface = 9.780_318 * (1.0 + 5.3024e-3 * s - 5.9e-6 * 4.0 * s * (1.0 - s));
                let surface_s = 9.780_318 * (5.3024e-3 - 5.9e-6 * 4.0 * (1.0 - 2.0 * s));
                let (r0, r0_s) = mean_radius(s);
                let ratio = 1.0 + h / r0;
                let square = ratio * ratio;
                (
                    surface_s / square + 2.0 * surface / (square * ratio) * h / (r0 * r0) * r0_s,
                    -2.0 * surface / (square * ratio * r0),
                )
            }
            Self::Noureldin => (
                9.780_326_771_4 * (0.005_279_041_4 + 2.0 * 0.000_023_271_8 * s) + 4.397_731_1e-9 * h,
                -3.087_691_089_1e-6 + 4.397_731_1e-9 * s + 2.0 * 7.211e-13 * h,
            ),
        };
        Gradient {
            per_latitude: per_s * 2.0 * sin * cos,
            per_height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::wgs84::radii;

    const ALL: [Gravity; 3] = [Gravity::Somigliana, Gravity::TittertonWeston, Gravity::Noureldin];
    const SITE: f64 = 36.098_277_778;

    #[test]
    fn somigliana_matches_the_wgs_84_table_of_normal_gravity() {
        let table = [
            (0.0, 0.0, 9.780_325_335_9),
            (30.0, 0.0, 9.793_247_269_2),
            (SITE, 0.0, 9.798_275_073_0),
            (SITE, -23.0, 9.798_346_056),
            (SITE, 1000.0, 9.795_189_590),
            (45.0, 0.0, 9.806_197_769_4),
            (60.0, 0.0, 9.819_176_953_1),
            (90.0, 0.0, 9.832_184_937_9),
        ];
        for (lat, h, g) in table {
            let got = Gravity::default().magnitude(f64::to_radians(lat), h);
            assert!((got - g).abs() < 6e-10, "{lat} {h} {got}"); // digits of the table
        }
    }

    #[test]
    fn titterton_weston_and_noureldin_give_9_79826723_and_9_79827646_at_the_site() {
        let lat = SITE.to_radians();
        // 6e-9: the table has eight decimals.
        assert!((Gravity::TittertonWeston.magnitude(lat, 0.0) - 9.798_267_23).abs() < 6e-9);
        assert!((Gravity::Noureldin.magnitude(lat, 0.0) - 9.798_276_46).abs() < 6e-9);
    }

    #[test]
    fn the_models_agree_with_each_other_over_the_globe_and_in_height() {
        for lat in [-90.0, -60.0, -30.0, 0.0, 20.0, 45.0, 75.0] {
            for h in [-5000.0, 0.0, 9000.0] {
                let lat = f64::to_radians(lat);
                let reference = Gravity::Somigliana.magnitude(lat, h);
                for model in ALL {
                    // 1.2e-4 m/s²: the inverse-square law of Titterton and Weston lacks the
                    // flattening and centrifugal part of the height slope, 1e-8 1/s² × 9 km.
                    let gap = model.magnitude(lat, h) - reference;
                    assert!(gap.abs() < 1.2e-4, "{model:?} {lat} {h} {gap:e}");
                }
            }
        }
    }

    #[test]
    fn mean_radius_is_the_root_of_the_product_of_both_radii() {
        for lat in [0.0_f64, 0.63, -1.2, 1.57] {
            let r = radii(lat);
            let r0 = (r.meridian * r.normal).sqrt();
            // 4 ε of 6.4e6 m: exact up to rounding.
            assert!((mean_radius(lat.sin().powi(2)).0 - r0).abs() < 6e-9);
        }
    }

    #[test]
    fn gradient_matches_central_differences() {
        for model in ALL {
            for lat in [-1.4, -0.5, 0.0, 0.63, 1.5] {
                for h in [-5000.0, 0.0, 20_000.0] {
                    let g = model.gradient(lat, h);
                    let step = 1e-4;
                    let by_lat = (model.magnitude(lat + step, h) - model.magnitude(lat - step, h)) / (2.0 * step);
                    // 1e-9: truncation h²/6·4·0.05 = 3e-10, rounding 2e-15/1e-4 = 2e-11.
                    assert!((g.per_latitude - by_lat).abs() < 1e-9, "{model:?} {lat} {h} latitude");
                    let step = 100.0;
                    let by_h = (model.magnitude(lat, h + step) - model.magnitude(lat, h - step)) / (2.0 * step);
                    // 2e-15 1/s² of 3e-6: truncation 4 g h²/R³·… = 2e-15, rounding 2e-17.
                    assert!((g.per_height - by_h).abs() < 4e-15, "{model:?} {lat} {h} height");
                }
            }
        }
    }

    #[test]
    fn gravity_points_down() {
        let g = Gravity::default().vector_n(0.5, 10.0);
        assert_eq!((g.x, g.y), (0.0, 0.0));
        assert_eq!(g.z, Gravity::Somigliana.magnitude(0.5, 10.0));
    }
}
