//! Static air pressure in the standard troposphere.
//!
//! Measured   z = pressure at the sensor a \[Pa\]
//! Predicted  h(x) = p₀ (1 − L (h_a + b)/T₀)^n,  h_a = h_b − e₃ᵀ C_nb l_ba_b,
//!            T₀ = 288.15 K, L = 6.5 mK/m, n = g₀ M/(R L) = 5.255880
//! Jacobian   ∂h/∂h_a = ∂h/∂b = −n L h/(T₀ − L (h_a + b)), along h_a as for a height;
//!            ∂h/∂p₀ = h/p₀
//! Valid      up to 11 km; p₀ follows the weather (1 hPa is 8 m), b a temperature other than
//!            standard, the geoid and the mount
//! Source     ISO 2533:1975 (ICAO standard atmosphere)

use super::vertical::Vertical;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Param, Scalar, View};
use nalgebra::Matrix1;

/// Temperature at sea level T₀ \[K\].
const TEMPERATURE: f64 = 288.15;

/// Lapse rate L \[K/m\].
const LAPSE_RATE: f64 = 6.5e-3;

/// n = g₀ M/(R L) with g₀ = 9.80665 m/s² and R/M = 287.05287 J/(kg K).
const EXPONENT: f64 = crate::earth::STANDARD_GRAVITY / (287.052_87 * LAPSE_RATE);

/// Top of the troposphere \[m\].
const TROPOPAUSE: f64 = 11_000.0;

/// Pressure at a height \[m\] over pressure at sea level.
#[must_use]
fn pressure_ratio(height: f64) -> f64 {
    math::powf(1.0 - LAPSE_RATE * height / TEMPERATURE, EXPONENT)
}

/// d ln p/dh at a height \[m\], in 1/m.
#[must_use]
fn logarithmic_slope(height: f64) -> f64 {
    -EXPONENT * LAPSE_RATE / (TEMPERATURE - LAPSE_RATE * height)
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Barometer {
    point: Vertical,
    sea_level_pressure: Param<Scalar>,
    bias: Param<Scalar>,
}

impl Barometer {
    fn height(&self, at: &View<'_>) -> Result<f64, Undefined> {
        let height = self.point.height(at) + at.get(&self.bias);
        if height < TROPOPAUSE {
            Ok(height)
        } else {
            Err(Undefined("the barometer is above the troposphere"))
        }
    }
}

impl Measurement for Barometer {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.get(&self.sea_level_pressure) * pressure_ratio(self.height(at)?);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let height = self.height(at)?;
        let ratio = pressure_ratio(height);
        let slope = at.get(&self.sea_level_pressure) * ratio * logarithmic_slope(height);
        self.point.jacobian(at, slope, h);
        h.add(0, &self.bias, &Matrix1::new(slope));
        h.add(0, &self.sea_level_pressure, &Matrix1::new(ratio));
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::{ParamSpec, ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, Pressure, dim};
    use schemars::JsonSchema;

    /// Static air pressure in the standard troposphere.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct BarometerSpec {
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Pressure at height zero of the standard atmosphere, which changes with the weather.
        #[serde(default = "standard_pressure")]
        sea_level_pressure: ScalarParam<dim::Pressure>,
        /// Height that the atmosphere seems to add.
        #[serde(default)]
        bias: ScalarParam<dim::Length>,
    }

    fn standard_pressure() -> ScalarParam<dim::Pressure> {
        ParamSpec::Fixed(Pressure::from_si(101_325.0))
    }

    crate::register!(
        Sensor,
        "barometer",
        BarometerSpec,
        r#"
lever_arm = [0.5, 0, "-20 cm"]
sea_level_pressure = { estimate = true, initial = "1013.25 hPa", sigma = "10 hPa", random_walk = "2 Pa/sqrt(s)" }
bias = { estimate = true, initial = 0, sigma = "5 m", correlation_time = "600 s" }
"#
    );

    #[typetag::deserialize(name = "barometer")]
    impl SensorSpec for BarometerSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(Channel::vector("pressure", 1, dim::Pressure::KIND.dimension))
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Pressure::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            if self.sea_level_pressure.initial().is_some_and(|p| p <= 0.0) {
                return Err(BuildError::at("sea_level_pressure", "the pressure must be greater than 0")
                    .help("write e.g. \"1013.25 hPa\", the pressure at sea level"));
            }
            Ok(Box::new(Barometer {
                point: Vertical::build(b, &self.lever_arm)?,
                sea_level_pressure: b.param("sea_level_pressure", &self.sea_level_pressure)?,
                bias: b.param("bias", &self.bias)?,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn pressure_matches_the_tables_of_the_standard_atmosphere() {
        // ISO 2533:1975, table 5, by geopotential height; printed to five or six digits.
        for (height, hectopascal) in [(0.0, 1013.25), (1000.0, 898.746), (5000.0, 540.199), (11_000.0, 226.321)] {
            let p = 1013.25 * pressure_ratio(height);
            assert!((p - hectopascal).abs() < 1e-3, "{height}: {p}");
        }
    }

    #[test]
    fn above_the_troposphere_there_is_no_value() {
        let model = Barometer {
            point: Vertical::fixed(12_000.0, UnitQuaternion::identity(), Vector3::zeros()),
            sea_level_pressure: Param::Fixed(101_325.0),
            bias: Param::Fixed(0.0),
        };
        assert!(model.predict(&View::new(&[], &[]), &mut [0.0]).is_err());
    }
}
