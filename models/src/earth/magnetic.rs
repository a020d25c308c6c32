//! The Earth's magnetic field.
//!
//! Axes       n north-east-down: m_n = F (cos I cos D, cos I sin D, sin I)
//! Model      the World Magnetic Model of NOAA and BGS, behind the cargo feature `wmm`: the main field to
//!            degree 12. Its 1σ is 0.2 to 0.4° of declination, more near the magnetic poles
//! Not here   the crust, buildings, solar storms

use fusion_core::math;
use nalgebra::Vector3;

/// The field at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarthField {
    /// F \[T\].
    pub strength: f64,
    /// I \[rad\], positive below the horizon.
    pub inclination: f64,
    /// D \[rad\], clockwise from true north.
    pub declination: f64,
}

impl EarthField {
    /// m_n \[T\].
    #[must_use]
    pub fn vector(&self) -> Vector3<f64> {
        let [unit, ..] = self.slopes();
        unit * self.strength
    }

    /// ∂m_n/∂(F, I, D); the first is the direction of the field.
    #[must_use]
    pub fn slopes(&self) -> [Vector3<f64>; 3] {
        let ((si, ci), (sd, cd)) = (math::sin_cos(self.inclination), math::sin_cos(self.declination));
        [
            Vector3::new(ci * cd, ci * sd, si),
            Vector3::new(-si * cd, -si * sd, ci) * self.strength,
            Vector3::new(-ci * sd, ci * cd, 0.0) * self.strength,
        ]
    }
}

/// The field of the World Magnetic Model at `place` on a day written "2026-11-22".
///
/// # Errors
/// A message: an invalid day, or a day or place outside the model.
#[cfg(feature = "wmm")]
pub fn world_model(place: &fusion_core::geometry::wgs84::Geodetic, day: &str) -> Result<EarthField, String> {
    use world_magnetic_model::GeomagneticField;
    use world_magnetic_model::time::{Date, Month};
    use world_magnetic_model::uom::si::f32::{Angle, Length};
    use world_magnetic_model::uom::si::{angle::radian, length::meter, magnetic_flux_density::tesla};

    let wrong = || format!("`{day}` is not a day; write it as \"2026-11-22\"");
    let parts: Vec<&str> = day.split('-').collect();
    let [year, month, date] = parts[..] else { return Err(wrong()) };
    let month = month.parse::<u8>().ok().and_then(|m| Month::try_from(m).ok());
    let (Ok(year), Some(month), Ok(date)) = (year.parse(), month, date.parse()) else {
        return Err(wrong());
    };
    let date = Date::from_calendar_date(year, month, date).map_err(|_| wrong())?;
    let (height, lat, lon) = (place.height as f32, place.lat as f32, place.lon as f32);
    let field = GeomagneticField::new(
        Length::new::<meter>(height),
        Angle::new::<radian>(lat),
        Angle::new::<radian>(lon),
        date,
    );
    let field = field.map_err(|e| format!("the World Magnetic Model has no field there and then: {e}"))?;
    Ok(EarthField {
        strength: field.f().get::<tesla>().into(),
        inclination: field.inclination().get::<radian>().into(),
        declination: field.declination().get::<radian>().into(),
    })
}

/// The field of the World Magnetic Model, which this build does not have.
///
/// # Errors
/// Always.
#[cfg(all(feature = "declare", not(feature = "wmm")))]
pub fn world_model(_: &fusion_core::geometry::wgs84::Geodetic, _: &str) -> Result<EarthField, String> {
    Err("this program was built without the World Magnetic Model: build it with `--features wmm`, or declare `strength`, `inclination` and `declination`".to_owned())
}

#[cfg(all(test, feature = "wmm"))]
mod tests {
    use super::*;
    use fusion_core::geometry::wgs84::Geodetic;

    /// Day, height \[km\], latitude, longitude \[deg\]; X, Y, Z \[nT\]. Source: NOAA's WMM2025_TEST_VALUES.txt in
    /// WMM2025COF.zip, which is table 6 of the WMM2025 report. The last half of the rows are for 2027.5.
    const PUBLISHED: [(&str, [f64; 3], [f64; 3]); 12] = [
        ("2025-01-01", [0.0, 80.0, 0.0], [6521.6, 145.9, 54791.5]),
        ("2025-01-01", [0.0, 0.0, 120.0], [39677.8, -109.6, -10580.2]),
        ("2025-01-01", [0.0, -80.0, -120.0], [6117.5, 15751.9, -52022.5]),
        ("2025-01-01", [100.0, 80.0, 0.0], [6216.0, 92.4, 52598.8]),
        ("2025-01-01", [100.0, 0.0, 120.0], [37688.6, -96.2, -10152.1]),
        ("2025-01-01", [100.0, -80.0, -120.0], [5907.6, 14780.3, -49540.7]),
        ("2027-07-02", [0.0, 80.0, 0.0], [6500.8, 294.5, 54869.4]),
        ("2027-07-02", [0.0, 0.0, 120.0], [39701.6, -167.4, -10381.8]),
        ("2027-07-02", [0.0, -80.0, -120.0], [6200.7, 15730.3, -51783.7]),
        ("2027-07-02", [100.0, 80.0, 0.0], [6196.7, 233.8, 52670.5]),
        ("2027-07-02", [100.0, 0.0, 120.0], [37711.5, -148.7, -9969.8]),
        ("2027-07-02", [100.0, -80.0, -120.0], [5984.0, 14760.1, -49317.7]),
    ];

    #[test]
    fn matches_noaa_s_test_values_of_the_world_magnetic_model() {
        for (day, [km, lat, lon], published) in PUBLISHED {
            let place = Geodetic::new(lat.to_radians(), lon.to_radians(), km * 1e3);
            let found = world_model(&place, day).unwrap().vector() * 1e9;
            // Half of the last digit is 0.05 nT, and single precision sums 90 terms of up to 55 µT to another 0.1;
            // 2027.5 is noon of its day, half a day at 100 nT a year.
            let tolerance = if day.ends_with("01") { 0.15 } else { 0.3 };
            let off = (found - Vector3::from(published)).amax();
            assert!(off < tolerance, "{day} {km} km {lat} {lon}: {found} {published:?}");
        }
    }

    #[test]
    fn a_day_is_written_as_in_the_message_and_lies_within_the_models() {
        let place = Geodetic::new(0.6, 2.2, 0.0);
        for day in ["", "2026", "2026-13-01", "2026-02-30", "22.11.2026", "2026-11-22-1"] {
            assert!(world_model(&place, day).unwrap_err().contains("2026-11-22"), "{day}");
        }
        assert!(world_model(&place, "1900-01-01").unwrap_err().contains("no field there and then"));
    }
}
