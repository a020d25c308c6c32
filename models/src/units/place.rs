//! A geodetic place.

use fusion_core::geometry::wgs84::Geodetic;
use schemars::JsonSchema;
use serde::Deserialize;

use super::quantity::{Latitude, Length, Longitude};

/// A geodetic place on or above the WGS-84 ellipsoid.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Geodetic latitude, e.g. "36.098 deg".
    pub latitude: Latitude,
    /// Longitude.
    pub longitude: Longitude,
    /// Height above the ellipsoid.
    #[serde(default)]
    pub height: Length,
}

impl From<Place> for Geodetic {
    fn from(place: Place) -> Self {
        Self {
            lat: place.latitude.si(),
            lon: place.longitude.si(),
            height: place.height.si(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(fields: &str) -> Result<Geodetic, String> {
        toml::from_str::<Place>(fields).map(Into::into).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn a_place_is_read_from_degrees_or_radians() {
        let home = place("latitude = '36.1 deg'\nlongitude = -2.25\nheight = '10 m'").unwrap();
        assert_eq!(home, Geodetic::new(36.1_f64.to_radians(), -2.25, 10.0));
        // A receiver may count longitudes from 0 to 360 degrees.
        assert!(place("latitude = '-90 deg'\nlongitude = '359 deg'").is_ok());
    }

    #[test]
    fn degrees_without_their_unit_are_refused_with_what_was_meant() {
        assert_eq!(
            place("latitude = 47\nlongitude = '8 deg'").unwrap_err(),
            "47 is out of range; an angle [rad] from -90 to 90 degrees is expected here, e.g. \"5 deg\"; \
             a bare number is in rad: was \"47 deg\" meant?"
        );
        assert!(
            place("latitude = 0.7\nlongitude = 129.45")
                .unwrap_err()
                .ends_with("was \"129.45 deg\" meant?")
        );
        let beyond = place("latitude = '95 deg'\nlongitude = 0").unwrap_err();
        assert!(
            beyond.starts_with("\"95 deg\" is out of range") && !beyond.contains("meant"),
            "{beyond}"
        );
    }
}
