//! Takes the delay of the troposphere out of pseudoranges.
//!
//! Delay    T = \[0.0022768 p/(1 − 0.00266 cos 2φ − 0.00028 h/km) + 0.002277 (1255/t + 0.05) e\]/sin E
//! Air      the standard atmosphere at the height h: p = 1013.25 (1 − 2.2557e-5 h)^5.2568 hPa, t = 288.15 − 0.0065 h K,
//!          e = u exp((17.15 t − 4684)/(t − 38.45)) 6.108 hPa, u the relative humidity
//! Valid    0 to 10 km; lower and higher heights count as these. A row below 3° of elevation does not pass
//! Source   Saastamoinen 1972; RTKLIB 2.4.2 manual, eq. E.5.1 to E.5.4

use super::satellite::Body;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::time::Time;

/// The lowest elevation at which 1/sin E is a mapping of the delay \[rad\]: 3°.
const LOWEST: f64 = 0.052;

/// The delay at the zenith \[m\].
fn zenith(place: &Geodetic, humidity: f64) -> f64 {
    let h = math::clamp(place.height, 0.0, 1e4);
    let pressure = 1013.25 * math::powf(1.0 - 2.2557e-5 * h, 5.2568);
    let t = 288.15 - 6.5e-3 * h;
    let vapour = 6.108 * math::exp((17.15 * t - 4684.0) / (t - 38.45)) * humidity;
    let gravity = 1.0 - 0.00266 * math::cos(2.0 * place.lat) - 0.000_28 * h / 1e3;
    0.002_276_8 * pressure / gravity + 0.002_277 * (1255.0 / t + 0.05) * vapour
}

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct Saastamoinen {
    body: Body,
    humidity: f64,
}
memory!(Saastamoinen { ; body, humidity });

impl Stage for Saastamoinen {
    fn row(&mut self, _: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        let Some(seen) = self.body.sees(row, view).filter(|seen| seen.elevation >= LOWEST) else {
            return;
        };
        let delay = zenith(&seen.place, self.humidity) / math::sin(seen.elevation);
        out.emit(time, &[row[0] - delay, row[1], row[2], row[3]]);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::stage::satellite::{channels, listen};
    use crate::units::{NonNegative, dim};
    use schemars::JsonSchema;

    /// Takes the delay of the troposphere out of pseudoranges, by the model of Saastamoinen in a standard atmosphere.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct SaastamoinenSpec {
        /// The stream of pseudoranges, with the positions of their satellites.
        source: String,
        /// Relative humidity of the air, 0 to 1; 0.7 by default.
        #[serde(default = "humid")]
        humidity: NonNegative<dim::Ratio>,
    }

    fn humid() -> NonNegative<dim::Ratio> {
        NonNegative::try_from_si(0.7).unwrap_or_default()
    }

    crate::register!(
        Stage,
        "saastamoinen",
        SaastamoinenSpec,
        r#"
source = "gps"
humidity = 0.7
"#
    );

    #[typetag::deserialize(name = "saastamoinen")]
    impl StageSpec for SaastamoinenSpec {
        fn inputs(&self) -> Vec<Listen> {
            listen(&self.source)
        }

        fn output(&self) -> Vec<Channel> {
            channels()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let humidity = self.humidity.si();
            if humidity > 1.0 {
                return Err(BuildError::at("humidity", "a relative humidity is at most 1").help("write 70 % as `0.7` or `\"70 %\"`"));
            }
            let body = Body::build(b)?;
            Ok(Box::new(Saastamoinen { body, humidity }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zenith_delay_is_that_of_the_standard_atmosphere() {
        // Hydrostatic 2.307 m at 1013.25 hPa and 45°, by the formula of Davis 1985: the same but for 0.00266.
        assert!((zenith(&Geodetic::new(core::f64::consts::FRAC_PI_4, 0.0, 0.0), 0.0) - 2.307).abs() < 1e-3);
        // Half of the pressure is at 5.5 km; the wet part at 70 % is 0.1 to 0.15 m at 15 °C.
        let (low, high) = (Geodetic::new(0.8, 0.0, 0.0), Geodetic::new(0.8, 0.0, 5500.0));
        assert!((zenith(&high, 0.0) / zenith(&low, 0.0) - 0.5).abs() < 0.01);
        let wet = zenith(&low, 0.7) - zenith(&low, 0.0);
        assert!((0.1..0.15).contains(&wet), "{wet}");
        // `tropmodel` of RTKLIB 2.4.3, straight up. It counts from 273.16 K, which moves the wet part by 1e-4 of a metre.
        for (lat, height, humidity, delay) in [(45_f64, 500.0, 0.5, 2.244_107), (36.0, 2000.0, 0.7, 1.864_431)] {
            let found = zenith(&Geodetic::new(lat.to_radians(), 0.0, height), humidity);
            assert!((found - delay).abs() < 1e-4, "{found}");
        }
    }
}
