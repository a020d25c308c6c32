//! Rate of the pseudorange of one satellite, from the Doppler shift of its carrier: each row is a satellite.
//!
//! Measured   z = ρ̇, corrected for the drift of the clock of the satellite \[m/s\]; with it the row gives the satellite r_s
//!            and its velocity v_s relative to the Earth at transmission, Earth-centred Earth-fixed
//! Predicted  h(x) = uᵀ [C(θ)(v_s + ω × r_s) − (v_a + ω × r_a)] + d, u the unit vector to the satellite, ω the rate of the
//!            Earth, v_a = C_en (v_eb_n + C_nb (w_ib_b × l)) of the antenna, d the clock drift of the receiver
//! Jacobian   exact by dual numbers
//! Valid      w_ib for w_eb: 7e-5 m/s per metre of lever arm; the change of the delays of the atmosphere is neglected
//! Not here   the carrier phase itself; its difference over an epoch divided by the time is such a rate at the middle
//! Source     Groves 2013, eq. 9.142 to 9.147

use super::satellite::{Antenna, given, turn, turned};
use fusion_core::geometry::wgs84::EARTH_RATE;
use fusion_core::literal;
use fusion_core::model::{ExactModel, ExactView, Literal, Real, Undefined};
use fusion_core::state::{Param, Quantity, Scalar, Vector, Velocity};
use nalgebra::Vector3;

/// The quantities on which the rate depends.
#[derive(Debug, Literal)]
pub struct Rate {
    antenna: Antenna,
    velocity: Quantity<Velocity>,
    turning: Option<Quantity<Vector<3>>>,
    clock: Param<Scalar>,
}

/// ω × r for the rate of the Earth.
fn carried<D: Real>(r: &Vector3<D>) -> Vector3<D> {
    Vector3::new(-r.y * EARTH_RATE, r.x * EARTH_RATE, D::from(0.0))
}

/// A vector north, east, down at a place, in Earth-centred axes.
fn from_north<D: Real>([lat, lon, _]: [D; 3], v: &Vector3<D>) -> Vector3<D> {
    let ((sp, cp), (sl, cl)) = (lat.sin_cos(), lon.sin_cos());
    let outward = -sp * v.x - cp * v.z;
    Vector3::new(outward * cl - sl * v.y, outward * sl + cl * v.y, cp * v.x - sp * v.z)
}

impl ExactModel for Rate {
    fn dim(&self) -> usize {
        1
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let (satellite, its_velocity) = (given(x, 0)?, given(x, 3)?);
        let (body, antenna) = self.antenna.place(x);
        let angle = turn(&satellite, &antenna)?;
        let d = turned(&satellite, angle) - antenna;
        let mut v_n = x.velocity(&self.velocity);
        if let Some((attitude, rate)) = self.antenna.attitude.as_ref().zip(self.turning.as_ref()) {
            v_n += x.rotate(attitude, &x.vector(rate).cross(&x.vector(&self.antenna.lever_arm)));
        }
        let relative = turned(&(its_velocity + carried(&satellite)), angle) - from_north(body, &v_n) - carried(&antenna);
        z[0] = d.dot(&relative) / d.dot(&d).sqrt() + x.scalar(&self.clock);
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
    use crate::param::{ScalarParam, VectorParam};
    use crate::sensor::pseudorange::sigma_of;
    use crate::sensor::receiver_clock;
    use crate::sensor::satellite::{OfSatellite, is_signal};
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use fusion_core::model::{Exact, Measurement};
    use schemars::JsonSchema;

    /// Rates of pseudoranges (Doppler), one satellite per row.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct PseudorangeRateSpec {
        /// Antenna position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Drift of the receiver's clock times the speed of light; mostly that of a sensor `pseudorange`:
        /// `{ shared = "NAME.clock_drift" }`.
        #[serde(default)]
        clock_drift: ScalarParam<dim::Speed>,
    }

    crate::register!(
        Sensor,
        "pseudorange_rate",
        PseudorangeRateSpec,
        r#"
lever_arm = { estimate = true, initial = [0.1, -0.2, "-1 m"], sigma = "20 cm" }
clock_drift = { estimate = true, initial = "100 m/s", sigma = "10 m/s", random_walk = "1 m/s/sqrt(s)" }
"#
    );

    #[typetag::deserialize(name = "pseudorange_rate")]
    impl SensorSpec for PseudorangeRateSpec {
        fn reading(&self) -> Reading {
            Reading::Channels(vec![
                channel::PSEUDORANGE_RATE,
                channel::SATELLITE_POSITION,
                channel::SATELLITE_VELOCITY,
            ])
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension]
        }

        fn reported_sigma(&self) -> Option<Channel> {
            Some(sigma_of(&channel::PSEUDORANGE_RATE))
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let clock = receiver_clock::drift(b, &self.clock_drift)?;
            let antenna = Antenna::build(b, &self.lever_arm)?;
            let turning = match antenna.attitude {
                None => None,
                Some(_) => Some(b.quantity(state::ANGULAR_RATE)?),
            };
            let velocity = b.quantity(state::VELOCITY)?;
            let reads_signals = turning.is_some() || antenna.reads_signals() || is_signal(&velocity) || is_signal(&clock);
            Ok(Box::new(OfSatellite {
                model: Exact(Rate {
                    antenna,
                    velocity,
                    turning,
                    clock,
                }),
                given: 6,
                reads_signals,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::SPEED_OF_LIGHT;
    use crate::earth::frames::{ecef_from_geodetic, rotation_en};
    use crate::sensor::satellite::EXAMPLE;
    use fusion_core::geometry::wgs84::Geodetic;
    use fusion_core::model::{Exact, Measurement};
    use fusion_core::state::View;

    /// |C(θ) r_s(t − τ) − r_a(t)|, with τ found by iteration.
    fn range(t: f64, start: &Geodetic, v_n: &Vector3<f64>) -> f64 {
        let r_a = ecef_from_geodetic(start) + rotation_en(start.lat, start.lon) * v_n * t;
        let [x, y, z, vx, vy, vz] = EXAMPLE;
        let mut rho = 2e7;
        for _ in 0..6 {
            let sent = t - rho / SPEED_OF_LIGHT;
            let r_s = Vector3::new(x, y, z) + Vector3::new(vx, vy, vz) * sent;
            rho = (turned(&r_s, rho / SPEED_OF_LIGHT * EARTH_RATE) - r_a).norm();
        }
        rho
    }

    #[test]
    fn the_rate_is_the_derivative_of_the_range() {
        let (start, v_n) = (Geodetic::new(0.6, 2.2, 100.0), Vector3::new(30.0, -20.0, 5.0));
        let model = Rate {
            antenna: Antenna::fixed(Quantity::Fixed(start)),
            velocity: Quantity::Fixed(v_n),
            turning: None,
            clock: Param::Fixed(7.0),
        };
        // The row of t = 0: the satellite when the signal was sent.
        let [x, y, z, vx, vy, vz] = EXAMPLE;
        let sent = -range(0.0, &start, &v_n) / SPEED_OF_LIGHT;
        let place = [x + vx * sent, y + vy * sent, z + vz * sent, vx, vy, vz];
        let mut predicted = [0.0];
        Exact(model)
            .predict(&View::new(&[], &[]).with_given(&place), &mut predicted)
            .unwrap();
        let numeric = (range(0.5, &start, &v_n) - range(-0.5, &start, &v_n)) / 1.0;
        // 1 cm/s: the model neglects ρ̇ v/c of the time of flight, 1000 m/s times 2700 m/s over c = 9 mm/s.
        assert!((predicted[0] - 7.0 - numeric).abs() < 1e-2, "{} {numeric}", predicted[0] - 7.0);
    }
}
