//! GNSS velocity with an antenna lever arm.
//!
//! Measured   z = v_ea_n, velocity of the antenna a, north east down \[m/s\]
//! Predicted  h(x) = v_eb_n + C_nb (w_ib_b × l_ba_b)
//! Jacobian   ∂h/∂δv = I₃,  ∂h/∂δφ_b = −C_nb [(w × l) ×],  ∂h/∂w = −C_nb [l ×],
//!            ∂h/∂l = C_nb [w ×]
//! Here       w is a signal of the process, followed to the states by the chain rule
//! Valid      rigid mount; w_ib for w_eb: 7e-5 m/s per metre of lever arm, the Earth's rotation
//! Not here   receiver filtering
//! Source     Groves 2013, §14.3.1

use fusion_core::geometry::so3::{rotation, times_skew};
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Vector, Velocity, View};
use nalgebra::Matrix3;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct GnssVelocity {
    velocity: Quantity<Velocity>,
    turning: Option<(Quantity<Attitude>, Quantity<Vector<3>>)>,
    lever_arm: Param<Vector<3>>,
    /// Of north, east and down: how many are measured, and how many count.
    size: Size,
}

impl Measurement for GnssVelocity {
    fn size(&self) -> Size {
        self.size
    }

    fn reads_signals(&self) -> bool {
        let turning = self.turning.as_ref().map(|(attitude, rate)| [attitude.place(), rate.place()]);
        let places = turning.into_iter().flatten().chain([self.velocity.place(), self.lever_arm.place()]);
        places.flatten().any(|(_, is_signal)| is_signal)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let mut v = at.get(&self.velocity);
        if let Some((attitude, rate)) = &self.turning {
            v += at.get(attitude) * at.get(rate).cross(&at.get(&self.lever_arm));
        }
        value.copy_from_slice(&v.as_slice()[..value.len()]);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.velocity, &Matrix3::identity());
        if let Some((attitude, rate)) = &self.turning {
            let c_nb = rotation(&at.get(attitude));
            let (w, l) = (at.get(rate), at.get(&self.lever_arm));
            h.add(0, attitude, &-times_skew(&c_nb, &w.cross(&l)));
            h.add(0, rate, &-times_skew(&c_nb, &l));
            h.add(0, &self.lever_arm, &times_skew(&c_nb, &w));
        }
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, NED, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::VectorParam;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use nalgebra::Vector3;
    use schemars::JsonSchema;

    /// GNSS velocity, north east down, with an antenna lever arm.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct GnssVelocitySpec {
        /// Antenna position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Use north and east only.
        #[serde(default)]
        horizontal: bool,
    }

    crate::register!(
        Sensor,
        "gnss_velocity",
        GnssVelocitySpec,
        r#"
lever_arm = { estimate = true, initial = [0.1, -0.2, "-1 m"], sigma = "20 cm" }
horizontal = false
"#
    );

    #[typetag::deserialize(name = "gnss_velocity")]
    impl SensorSpec for GnssVelocitySpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::VELOCITY)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; self.axes().len()]
        }

        fn axes(&self) -> &'static [&'static str] {
            if self.horizontal { &NED[..2] } else { NED }
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let size = Size {
                value: 3,
                residual: self.axes().len(),
            };
            Ok(Box::new(GnssVelocity::new(b, &self.lever_arm, size)?))
        }
    }

    impl GnssVelocity {
        pub(crate) fn new(b: &mut Build<'_>, lever_arm: &VectorParam<dim::Length>, size: Size) -> Result<Self, BuildError> {
            let lever_arm = b.param("lever_arm", lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Self {
                velocity: b.quantity(state::VELOCITY)?,
                // A process that does not turn serves an antenna at the body origin.
                turning: if at_the_body {
                    None
                } else {
                    Some((b.quantity(state::ATTITUDE)?, b.quantity(state::ANGULAR_RATE)?))
                },
                lever_arm,
                size,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;
    use fusion_core::state::Manifold;
    use nalgebra::Vector3;

    fn model(lever_arm: Vector3<f64>, w: Vector3<f64>, attitude: [f64; 3]) -> GnssVelocity {
        let [roll, pitch, yaw] = attitude;
        GnssVelocity {
            velocity: Quantity::Fixed(Vector3::new(1.0, 2.0, 3.0)),
            turning: Some((Quantity::Fixed(from_rpy(roll, pitch, yaw)), Quantity::Fixed(w))),
            lever_arm: Param::Fixed(lever_arm),
            size: Size { value: 3, residual: 3 },
        }
    }

    #[test]
    fn an_antenna_ahead_of_a_turning_body_moves_sideways() {
        use core::f64::consts::FRAC_PI_2;
        // Heading east, turning right at 0.5 rad/s: an antenna 2 m ahead moves south at 1 m/s.
        let m = model(Vector3::new(2.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.5), [0.0, 0.0, FRAC_PI_2]);
        let mut z = [0.0; 3];
        m.predict(&View::new(&[], &[]), &mut z).unwrap();
        // 4 ε: rounding.
        assert!((Velocity::read(&z) - Vector3::new(0.0, 2.0, 3.0)).amax() < 1e-15, "{z:?}");
    }
}
