//! The Earth's magnetic field.
//!
//! Axes       n north-east-down: m_n = F (cos I cos D, cos I sin D, sin I)
//! Model      the World Magnetic Model of NOAA and BGS, behind the cargo feature `wmm`: the main field to
//!            degree 12. Its 1σ is 0.2 to 0.4° of declination, more near the magnetic poles
//! Not here   the crust, buildings, solar storms

use fusion_core::geometry::wgs84::Geodetic;
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
        let ((si, ci), (sd, cd)) = (self.inclination.sin_cos(), self.declination.sin_cos());
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
/// A sentence: no such day, a day or a place that the model does not know.
#[cfg(feature = "wmm")]
pub fn world_model(place: &Geodetic, day: &str) -> Result<EarthField, String> {
    use world_magnetic_model::GeomagneticField;
    use world_magnetic_model::time::{Date, Month};
    use world_magnetic_model::uom::si::f32::{Angle, Length};
    use world_magnetic_model::uom::si::{angle::radian, length::meter, magnetic_flux_density::tesla};

    let wrong = || format!("`{day}` is no day; write it as \"2026-11-22\"");
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
#[cfg(not(feature = "wmm"))]
pub fn world_model(_: &Geodetic, _: &str) -> Result<EarthField, String> {
    Err("this program was built without the World Magnetic Model: build it with `--features wmm`, or declare `strength`, `inclination` and `declination`".to_owned())
}
