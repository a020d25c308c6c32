//! Range rate to a fixed beacon: z = d·v / |d| \[m/s\], d from the beacon to the body; away is positive.
//!
//! Valid within 10 km of the beacon, on the plane that touches the earth there. Not here: clock drift.

use fusion::core::model::{Exact, ExactModel, ExactView, Measurement, Real, Undefined};
use fusion::core::state::{Geodetic, Quantity, Velocity};
use fusion::models::{block::*, units::*, vocabulary::state};

/// Range rate to a fixed beacon.
#[derive(Debug, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeRateSpec {
    /// Where the beacon is.
    beacon: Place,
}
fusion::models::register! { Sensor, "range_rate", RangeRateSpec, r#"beacon = { latitude = "36.0985 deg", longitude = "129.4505 deg" }"# }

#[typetag::deserialize(name = "range_rate")]
impl SensorSpec for RangeRateSpec {
    fn reading(&self) -> Reading {
        Reading::Channel(Channel::vector("range_rate", 1, dim::Speed::KIND.dimension))
    }
    fn noise(&self) -> Vec<Dimension> {
        vec![dim::Speed::KIND.dimension]
    }
    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        let (position, velocity) = (b.quantity(state::POSITION)?, b.quantity(state::VELOCITY)?);
        Ok(Box::new(Exact(RangeRate(self.beacon.into(), position, velocity))))
    }
}

/// The beacon, and what is read of the state.
#[derive(Debug)]
struct RangeRate(Geodetic, Quantity<Geodetic>, Quantity<Velocity>);

impl ExactModel for RangeRate {
    fn dim(&self) -> usize {
        1
    }
    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let (beacon, [lat, lon, height], v) = (&self.0, x.geodetic(&self.1), x.velocity(&self.2));
        let r = fusion::core::geometry::wgs84::radii(beacon.lat);
        let north = (lat - beacon.lat) * r.meridian;
        let east = (lon - beacon.lon) * (r.normal * beacon.lat.cos());
        let d = nalgebra::Vector3::new(north, east, -height + beacon.height);
        let (range, here) = (d.dot(&d).sqrt(), Undefined("the body is at the beacon"));
        z[0] = if range.re() > 1.0 { d.dot(&v) / range } else { return Err(here) };
        Ok(())
    }
}
