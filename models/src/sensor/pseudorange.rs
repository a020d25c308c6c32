//! Pseudorange of one satellite at one epoch: each row is a satellite, and has its own gate.
//!
//! Measured   z = ρ, pseudorange corrected for the clock of the satellite \[m\]; with it the row gives the satellite r_s at
//!            transmission, Earth-centred Earth-fixed \[m\]
//! Predicted  h(x) = |C(θ) r_s − r_a| + b + β, C(θ) the turn of the Earth during the flight, r_a the antenna, b the clock
//!            offset of the receiver, β a bias of all these satellites
//! Jacobian   exact by dual numbers: −uᵀ of the antenna for the unit vector u to the satellite, 1 of b and β
//! States     `clock_offset`, which `clock_drift` moves; see `receiver_clock.rs`
//! Systems    satellites of a second system are a second sensor: it shares the clock, and `bias` is the inter-system bias
//! Valid      delays of the atmosphere are removed before, by a stage, or are small against the noise
//! Source     Groves 2013, eq. 9.141 to 9.146

use super::satellite::{Antenna, given, turn, turned};
use fusion_core::literal;
use fusion_core::model::{ExactModel, ExactView, Literal, Real, Undefined};
use fusion_core::state::{Param, Scalar};

/// The quantities on which a pseudorange depends.
#[derive(Debug, Literal)]
pub struct Pseudorange {
    antenna: Antenna,
    clock: Param<Scalar>,
    bias: Param<Scalar>,
}

impl ExactModel for Pseudorange {
    fn dim(&self) -> usize {
        1
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let (satellite, (_, antenna)) = (given(x, 0)?, self.antenna.place(x));
        let d = turned(&satellite, turn(&satellite, &antenna)?) - antenna;
        z[0] = d.dot(&d).sqrt() + x.scalar(&self.clock) + x.scalar(&self.bias);
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec, Shape};
    use crate::de::DeserializeSpec;
    use crate::param::{ScalarParam, VectorParam};
    use crate::sensor::receiver_clock;
    use crate::sensor::satellite::{OfSatellite, is_signal};
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::channel;
    use fusion_core::model::{Exact, Measurement};
    use schemars::JsonSchema;

    /// Pseudoranges to satellites, one satellite per row, with the clock of the receiver as states.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct PseudorangeSpec {
        /// Antenna position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Offset of the receiver's clock times the speed of light.
        #[serde(default)]
        clock_offset: ScalarParam<dim::Length>,
        /// Drift of the receiver's clock times the speed of light; a state that moves the offset.
        #[serde(default)]
        clock_drift: ScalarParam<dim::Speed>,
        /// Error that all rows of this sensor have in common: the inter-system bias if the clock is that of another sensor.
        #[serde(default)]
        bias: ScalarParam<dim::Length>,
    }

    crate::register!(
        Sensor,
        "pseudorange",
        PseudorangeSpec,
        r#"
lever_arm = { estimate = true, initial = [0.1, -0.2, "-1 m"], sigma = "20 cm" }
clock_offset = { estimate = true, initial = "10 km", sigma = "100 m", random_walk = "1 m/sqrt(s)" }
clock_drift = { estimate = true, initial = "100 m/s", sigma = "10 m/s", random_walk = "1 m/s/sqrt(s)" }
bias = { estimate = true, initial = 0, sigma = "3 m" }
"#
    );

    #[typetag::deserialize(name = "pseudorange")]
    impl SensorSpec for PseudorangeSpec {
        fn reading(&self) -> Reading {
            Reading::Channels(vec![channel::PSEUDORANGE, channel::SATELLITE_POSITION])
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Length::KIND.dimension]
        }

        fn reported_sigma(&self) -> Option<Channel> {
            Some(sigma_of(&channel::PSEUDORANGE))
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let clock = receiver_clock::offset(b, &self.clock_offset, &self.clock_drift)?;
            let antenna = Antenna::build(b, &self.lever_arm)?;
            let bias = b.param("bias", &self.bias)?;
            let reads_signals = antenna.reads_signals() || [&clock, &bias].into_iter().any(is_signal);
            Ok(Box::new(OfSatellite {
                model: Exact(Pseudorange { antenna, clock, bias }),
                given: 3,
                reads_signals,
            }))
        }
    }

    /// The channel of the 1σ of a channel of one number.
    pub(crate) fn sigma_of(channel: &Channel) -> Channel {
        Channel {
            name: Channel::sigma_name(&channel.name).into(),
            width: 1,
            dimension: channel.dimension,
            shape: Shape::Vector,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::SPEED_OF_LIGHT;
    use crate::sensor::satellite::OfSatellite;
    use fusion_core::geometry::wgs84::{EARTH_RATE, Geodetic, SEMI_MAJOR_AXIS};
    use fusion_core::model::{Exact, Measurement};
    use fusion_core::state::{Quantity, View};
    use nalgebra::Vector3;

    #[test]
    fn a_satellite_in_the_east_is_nearer_by_the_turn_of_the_earth() {
        let at_zero = Quantity::Fixed(Geodetic::new(0.0, 0.0, 0.0));
        let model = OfSatellite {
            model: Exact(Pseudorange {
                antenna: Antenna::fixed(at_zero),
                clock: Param::Fixed(1000.0),
                bias: Param::Fixed(-3.0),
            }),
            given: 3,
            reads_signals: false,
        };
        let range = |place: [f64; 3]| {
            let mut z = [0.0; 4];
            model.predict(&View::new(&[], &[]).with_given(&place), &mut z).unwrap();
            assert_eq!(z[1..], place);
            z[0] - 997.0
        };
        // Overhead the turn is across the line of sight: ρ (1 + θ²/2 …) adds 0.1 mm.
        let up = 2e7;
        assert!((range([SEMI_MAJOR_AXIS + up, 0.0, 0.0]) - up).abs() < 1e-3);
        // The closed form of the Sagnac effect, ω (x_s y_a − y_s x_a)/c; second-order terms are below 1 mm.
        let (x, y) = (1.4e7, 2.0e7);
        let straight = Vector3::new(x - SEMI_MAJOR_AXIS, y, 0.0).norm();
        let sagnac = -EARTH_RATE * y * SEMI_MAJOR_AXIS / SPEED_OF_LIGHT;
        // The sign: during the flight the antenna moves east, towards the satellite.
        assert!(
            (range([x, y, 0.0]) - straight - sagnac).abs() < 1e-3,
            "{}",
            range([x, y, 0.0]) - straight
        );
        let none = model.predict(&View::new(&[], &[]), &mut [0.0; 4]);
        assert!(none.is_err());
    }
}
