//! A constellation of navigation satellites, and the part of it that the vehicle sees.
//!
//! Orbits     circular, radius r, inclination i; satellite j of n in one of p planes:
//!            u = 2π (j − 1)/n + √(μ/r³) t,  Ω = 2π (j mod p)/p − ω_ie t,
//!            r_s = r \[cos u cos Ω − sin u cos i sin Ω, cos u sin Ω + sin u cos i cos Ω, sin u sin i\]
//! Velocity   its derivative: relative to the Earth, Earth-centred Earth-fixed axes
//! Errors     of a range, constant in a run: σ_s + σ_i/√(1 − 0.899 cos²e) + σ_t/√(1 − 0.998 cos²e), each times a normal
//!            number, e the elevation at the origin at the start, at least that of the mask
//! Seen       above the mask, above the mask of every sector in force, and of these the `most` highest
//! Time       the place at transmission: the time of flight is that from the place at reception
//! Source     Groves 2013, eq. 8.8 to 8.12, 9.79 and 9.80; the values by default are those of its published software

use super::random::Random;
use crate::block::BuildError;
use crate::earth::SPEED_OF_LIGHT;
use crate::earth::frames::{ecef_from_geodetic, rotation_en};
use crate::fault::Windows;
use crate::units::{NonNegative, Positive, Quantity, dim};
use core::f64::consts::TAU;
use fusion_core::Time;
use fusion_core::geometry::wgs84::{EARTH_RATE, GM, Geodetic, SEMI_MAJOR_AXIS};
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// Navigation satellites on circular orbits, for simulated sensors `pseudorange` and `pseudorange_rate`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstellationSpec {
    /// Number of satellites, 1 to 200.
    #[serde(default = "satellites")]
    satellites: u16,
    /// Number of orbital planes.
    #[serde(default = "planes")]
    planes: u16,
    /// Radius of the orbits.
    #[serde(default = "radius")]
    radius: Positive<dim::Length>,
    /// Inclination of the orbits.
    #[serde(default = "inclination")]
    inclination: Quantity<dim::Angle>,
    /// Least elevation at which a satellite is seen.
    #[serde(default = "mask")]
    mask: Quantity<dim::Angle>,
    /// 1σ of the constant error of a range by orbit and clock of the satellite.
    #[serde(default)]
    signal_error: NonNegative<dim::Length>,
    /// 1σ of the constant error of a range by the ionosphere, at the zenith.
    #[serde(default)]
    ionosphere: NonNegative<dim::Length>,
    /// 1σ of the constant error of a range by the troposphere, at the zenith.
    #[serde(default)]
    troposphere: NonNegative<dim::Length>,
    /// Sectors of azimuth in which buildings hide the sky.
    #[serde(default)]
    sectors: Vec<SectorSpec>,
    /// Time spans with few satellites: only the highest are seen.
    #[serde(default)]
    few: Vec<FewSpec>,
}

/// A sector of azimuth with its own mask.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SectorSpec {
    /// Azimuth at which it begins, clockwise from north.
    from: Quantity<dim::Angle>,
    /// Azimuth at which it ends, clockwise from `from`.
    to: Quantity<dim::Angle>,
    /// Least elevation at which a satellite is seen there.
    mask: Quantity<dim::Angle>,
    /// When it holds; always without one.
    #[serde(default)]
    window: Windows,
}

/// A time span with at most so many satellites.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FewSpec {
    /// The number of satellites that are seen at most.
    most: u16,
    /// When.
    window: Windows,
}

const fn satellites() -> u16 {
    30
}

const fn planes() -> u16 {
    6
}

fn radius() -> Positive<dim::Length> {
    const METRES: f64 = 2.656_175e7;
    #[expect(clippy::expect_used, reason = "a constant, and a test reads it")]
    Positive::try_from_si(METRES).expect("a length")
}

fn inclination() -> Quantity<dim::Angle> {
    Quantity::from_si(55f64.to_radians())
}

fn mask() -> Quantity<dim::Angle> {
    Quantity::from_si(10f64.to_radians())
}

impl ConstellationSpec {
    /// Refuses a constellation that no sky has.
    pub(super) fn check(&self) -> Result<(), BuildError> {
        let at = |field: &str, message: &str| Err(BuildError::at(format!("constellation.{field}"), message));
        if !(1..=200).contains(&self.satellites) {
            return at("satellites", "a constellation has 1 to 200 satellites");
        }
        if !(1..=self.satellites).contains(&self.planes) {
            return at("planes", "there is at least one plane, and a satellite in each");
        }
        if self.radius.si() < SEMI_MAJOR_AXIS + 1e5 {
            return at(
                "radius",
                "the orbits are inside the Earth or its air: write the radius, not the height",
            );
        }
        Ok(())
    }
}

/// A satellite that is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Satellite {
    /// At transmission, Earth-centred Earth-fixed axes of that time \[m\].
    pub(super) position: Vector3<f64>,
    /// Relative to the Earth, in the same axes \[m/s\].
    pub(super) velocity: Vector3<f64>,
    /// Constant error of its range \[m\].
    pub(super) error: f64,
    elevation: f64,
}

/// The constellation of a run.
#[derive(Clone, Debug)]
pub(super) struct Constellation {
    spec: ConstellationSpec,
    errors: Vec<f64>,
}

impl Constellation {
    /// With the errors of the run of that `seed`.
    pub(super) fn new(spec: &ConstellationSpec, origin: &Geodetic, seed: u64) -> Self {
        let mut random = Random::new(seed, "constellation");
        let mask = spec.mask.si();
        let mut constellation = Self {
            spec: spec.clone(),
            errors: Vec::new(),
        };
        let errors = (1..=spec.satellites).map(|j| {
            let (position, _) = constellation.orbit(j, 0.0);
            let (_, elevation) = direction(&position, origin);
            let cos = math::cos(elevation.max(mask));
            let slant = |share: f64| 1.0 / math::sqrt(1.0 - share * cos * cos);
            spec.signal_error.si() * random.normal()
                + spec.ionosphere.si() * slant(0.899) * random.normal()
                + spec.troposphere.si() * slant(0.998) * random.normal()
        });
        constellation.errors = errors.collect();
        constellation
    }

    /// Position and velocity of satellite `j`, counted from one, `t` seconds after the start.
    fn orbit(&self, j: u16, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let ConstellationSpec { satellites, planes, .. } = self.spec;
        let r = self.spec.radius.si();
        let rate = math::sqrt(GM / (r * r * r));
        let u = TAU * f64::from(j - 1) / f64::from(satellites) + rate * t;
        let node = TAU * f64::from(j % planes) / f64::from(planes) - EARTH_RATE * t;
        let ((su, cu), (sn, cn)) = (math::sin_cos(u), math::sin_cos(node));
        let (si, ci) = math::sin_cos(self.spec.inclination.si());
        let position = Vector3::new(cu * cn - su * ci * sn, cu * sn + su * ci * cn, su * si) * r;
        let along = Vector3::new(-su * cn - cu * ci * sn, -su * sn + cu * ci * cn, cu * si) * (r * rate);
        let carried = Vector3::new(position.y, -position.x, 0.0) * EARTH_RATE;
        (position, along + carried)
    }

    /// The satellites that are seen from `place` at `time`, the highest first.
    pub(super) fn seen(&self, time: Time, place: &Geodetic) -> Vec<Satellite> {
        let (t, here) = (time.seconds(), ecef_from_geodetic(place));
        let satellite = |(j, error): (u16, &f64)| {
            let at_reception = self.orbit(j, t).0;
            let (position, velocity) = self.orbit(j, t - (at_reception - here).norm() / SPEED_OF_LIGHT);
            let (azimuth, elevation) = direction(&position, place);
            let seen = Satellite {
                position,
                velocity,
                error: *error,
                elevation,
            };
            (elevation >= self.mask(time, azimuth)).then_some(seen)
        };
        let mut seen: Vec<_> = (1..).zip(&self.errors).filter_map(satellite).collect();
        seen.sort_by(|a, b| b.elevation.total_cmp(&a.elevation));
        let few = self.spec.few.iter().filter(|few| few.window.contains(time));
        seen.truncate(few.map(|few| few.most.into()).min().unwrap_or(usize::MAX));
        seen
    }

    /// Least elevation at which a satellite is seen at `azimuth`.
    fn mask(&self, time: Time, azimuth: f64) -> f64 {
        let sectors = self.spec.sectors.iter().filter(|sector| {
            let into = |angle: f64| {
                let turns = (angle - sector.from.si()) / TAU;
                TAU * (turns - math::floor(turns))
            };
            sector.window.contains(time) && into(azimuth) <= into(sector.to.si())
        });
        sectors.fold(self.spec.mask.si(), |mask, sector| mask.max(sector.mask.si()))
    }
}

/// Azimuth, clockwise from north, and elevation \[rad\] of a satellite.
fn direction(satellite: &Vector3<f64>, place: &Geodetic) -> (f64, f64) {
    let d = rotation_en(place.lat, place.lon).tr_mul(&(satellite - ecef_from_geodetic(place)));
    (math::atan2(d.y, d.x), math::atan2(-d.z, math::hypot(d.x, d.y)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACE: Geodetic = Geodetic::new(0.9, -0.03, 80.0);

    fn constellation(text: &str) -> Constellation {
        let spec: ConstellationSpec = toml::from_str(text).unwrap();
        spec.check().unwrap();
        Constellation::new(&spec, &PLACE, 3)
    }

    #[test]
    fn the_velocity_is_the_derivative_of_the_position() {
        let all = constellation("");
        for j in [1, 8, 30] {
            let (before, after) = (all.orbit(j, 99.5).0, all.orbit(j, 100.5).0);
            // 1e-4: a third derivative of 1e-4 m/s³ over 24.
            assert!((after - before - all.orbit(j, 100.0).1).amax() < 1e-4, "{j}");
            assert!((before.norm() / 2.656_175e7 - 1.0).abs() < 1e-12); // rounding
        }
    }

    #[test]
    fn sectors_and_few_hide_satellites_while_they_hold() {
        let seen = |text: &str, t: f64| constellation(text).seen(Time::from_seconds(t), &PLACE);
        let open = seen("", 0.0);
        assert!(open.len() >= 8, "{}", open.len());
        assert!(open.windows(2).all(|w| w[0].elevation >= w[1].elevation));
        let few = "few = [{ most = 3, window = { from = 10, to = 20 } }]";
        assert_eq!(seen(few, 9.0).len(), seen("", 9.0).len());
        assert_eq!(seen(few, 10.0)[..], seen("", 10.0)[..3]);
        // Across north: half of the sky.
        let north = "sectors = [{ from = '-90 deg', to = '90 deg', mask = '90 deg' }]";
        let is_south = |s: &Satellite| math::cos(direction(&s.position, &PLACE).0) < 0.0;
        assert_eq!(seen(north, 0.0), open.iter().copied().filter(is_south).collect::<Vec<_>>());
        assert!(seen("mask = '60 deg'", 0.0).len() < open.len());
    }

    #[test]
    fn the_errors_of_low_satellites_are_larger() {
        let sigma = |mask: &str| {
            let spec: ConstellationSpec = toml::from_str(&format!("satellites = 200\nionosphere = 2\nmask = '{mask}'")).unwrap();
            let errors = (0..20)
                .flat_map(|seed| Constellation::new(&spec, &PLACE, seed).errors)
                .collect::<Vec<_>>();
            math::sqrt(errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64)
        };
        // 4 %: 4000 draws, 1.1 % of 1σ. With a mask at the zenith all have the error there.
        assert!((sigma("90 deg") / 2.0 - 1.0).abs() < 0.04, "{}", sigma("90 deg"));
        assert!(sigma("10 deg") > 4.0, "{}", sigma("10 deg"));
    }

    #[test]
    fn a_constellation_that_no_sky_has_is_refused() {
        let field = |text: &str| toml::from_str::<ConstellationSpec>(text).unwrap().check().unwrap_err().field;
        assert_eq!(field("satellites = 0"), "constellation.satellites");
        assert_eq!(field("planes = 31"), "constellation.planes");
        assert_eq!(field("radius = '20200 km'\nsatellites = 0"), "constellation.satellites");
        assert_eq!(field("radius = '2000 km'"), "constellation.radius");
    }
}
