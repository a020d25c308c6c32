//! Zero angular rate: at rest the gyros read their bias and the turning of the Earth.
//!
//! Measured   z = mean of the raw gyros over a window at rest, w_ib_b with its bias \[rad/s\]
//! Predicted  h(x) = b_g + C_nbᵀ w_ie_n
//! Jacobian   ∂h/∂b_g = I₃,  ∂h/∂δφ_b = [C_nbᵀ w_ie_n ×],  ∂h/∂δr = C_nbᵀ ∂w_ie_n/∂r
//! Place      that of the process; where it has none, the origin of the run
//! Valid      at rest, w_eb = 0; feed it by a detector of rest. The window's mean, not single samples:
//!            its noise is the random walk over √window
//! Source     Groves 2013, §15.3

use crate::earth::LocalEarth;
use fusion_core::geometry::so3::{rotation, skew};
use fusion_core::geometry::wgs84::EARTH_RATE;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Quantity, Vector, View};
use nalgebra::{Matrix3, Vector3};

/// `w_ie_n` \[rad/s\] and its derivative with δr \[rad/s per m\].
fn earth_rate(p: &Geodetic) -> (Vector3<f64>, Matrix3<f64>) {
    let earth = LocalEarth::at(p);
    let by_latitude = Vector3::new(-EARTH_RATE * earth.sin_lat, 0.0, -EARTH_RATE * earth.cos_lat);
    let by_position = Matrix3::from_columns(&[by_latitude / earth.meridian, Vector3::zeros(), Vector3::zeros()]);
    (earth.earth_rate_n(), by_position)
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct ZeroAngularRate {
    gyro_bias: Quantity<Vector<3>>,
    position: Quantity<Geodetic>,
    attitude: Quantity<Attitude>,
}

impl Measurement for ZeroAngularRate {
    fn size(&self) -> Size {
        Size::same(3)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let (w_ie, _) = earth_rate(&at.get(&self.position));
        let w_ie_b = at.get(&self.attitude).inverse_transform_vector(&w_ie);
        value.copy_from_slice((at.get(&self.gyro_bias) + w_ie_b).as_slice());
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let (w_ie, by_position) = earth_rate(&at.get(&self.position));
        let c_bn = rotation(&at.get(&self.attitude)).transpose();
        h.add(0, &self.gyro_bias, &Matrix3::identity());
        h.add(0, &self.attitude, &skew(&(c_bn * w_ie)));
        h.add(0, &self.position, &(c_bn * by_position));
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec, XYZ};
    use crate::de::DeserializeSpec;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Pseudo-measurement at rest: the gyros read their bias and the rotation of the Earth.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ZeroAngularRateSpec {}

    crate::register!(Sensor, "zero_angular_rate", ZeroAngularRateSpec, "");

    #[typetag::deserialize(name = "zero_angular_rate")]
    impl SensorSpec for ZeroAngularRateSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::ANGULAR_RATE)
        }

        fn timing(&self) -> Option<&'static str> {
            Some("stationarity")
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::AngularRate::KIND.dimension; 3]
        }

        fn axes(&self) -> &'static [&'static str] {
            XYZ
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let help =
                "let the process estimate its gyro bias: `gyro_bias = { estimate = true, … }`; without it this block corrects nothing";
            // A process of attitude alone is where the run is declared to be.
            let position = match (b.quantity(state::POSITION), b.origin) {
                (Err(_), Some(origin)) => Quantity::Fixed(origin),
                (position, _) => position?,
            };
            Ok(Box::new(ZeroAngularRate {
                gyro_bias: b.quantity(state::GYRO_BIAS).map_err(|e| e.help(help))?,
                attitude: b.quantity(state::ATTITUDE)?,
                position,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, SensorSpec};

    #[test]
    fn at_rest_level_and_north_the_gyros_read_the_earth_rate_of_the_site() {
        let (w, _) = earth_rate(&Geodetic::new(36.098_277_778_f64.to_radians(), 2.26, 0.0));
        let per_hour = w.map(|w| w.to_degrees() * 3600.0);
        // 6e-5 deg/h: the table has four decimals.
        assert!((per_hour - Vector3::new(12.1533, 0.0, -8.8618)).amax() < 6e-5, "{per_hour}");
    }

    #[test]
    fn the_slope_with_position_matches_central_differences() {
        let p = Geodetic::new(0.9, 1.0, 300.0);
        let (_, by_position) = earth_rate(&p);
        for k in 0..3 {
            let mut d = Vector3::zeros();
            d[k] = 2000.0;
            let numeric = (earth_rate(&p.offset(&d)).0 - earth_rate(&p.offset(&-d)).0) / 4000.0;
            // 1e-17 of 1e-11: rounding 1e-20/4e3, truncation (2 km/R)² relative = 1e-7.
            assert!((by_position.column(k) - numeric).amax() < 1e-17, "{k}: {numeric}");
        }
    }

    #[test]
    fn a_process_without_a_place_is_at_the_origin() {
        let built = |origin: Option<Geodetic>| {
            let mut layout = fusion_core::state::LayoutBuilder::new();
            let mut build = Build {
                name: "process",
                layout: &mut layout,
                origin,
                gravity: crate::earth::Gravity::default(),
            };
            let process = "[attitude_only]\ngyro_noise = 0\ngyro_bias = { estimate = true, initial = [0.1, 0, 0], sigma = 0.1 }";
            let process: Box<dyn crate::block::ProcessSpec> = toml::from_str(process).unwrap();
            process.build(&mut build).unwrap();
            let sensor = ZeroAngularRateSpec {}.build(&mut build).map_err(|e| e.to_string())?;
            let (layout, mut z) = (layout.finish(), [0.0; 3]);
            sensor.predict(&View::new(layout.initial(), &[]), &mut z).unwrap();
            Ok::<_, String>(Vector3::from(z))
        };
        let origin = Geodetic::new(0.6, 2.0, 100.0);
        let expected = Vector3::new(0.1, 0.0, 0.0) + LocalEarth::at(&origin).earth_rate_n();
        // 1e-16: one rounding of 0.1.
        assert!((built(Some(origin)).unwrap() - expected).amax() < 1e-16);
        assert!(built(None).unwrap_err().contains("position"));
    }
}
