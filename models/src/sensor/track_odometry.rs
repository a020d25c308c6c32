//! Speeds of the two tracks of a skid-steered vehicle, by its instantaneous centres of rotation (ICR).
//!
//! Measured   z = speed of the left and of the right track \[m/s\]
//! Predicted  h(x) = (u − r y)/(1 − i),  y = c ∓ B/2
//!            u forward speed at the point l, r rate of turn about the vehicle's down axis, B the gauge between the
//!            ICRs of the tracks (of the vehicle times what skidding adds), c their middle to the right, i slip
//! Jacobian   exact by dual numbers
//! Inverse    r = (z_l − z_r)(1 − i)/B,  u = (1 − i)(z_l y_r − z_r y_l)/B
//! Sideways   the ICR of the body lies x_icr ahead: the sensor `nonholonomic` with that lever arm
//! Valid      one slip for both tracks; B and c constant, or as slow as their random walk
//! Source     Martínez et al. 2005, Approximating kinematics for tracked mobile robots

use fusion_core::literal;
use fusion_core::model::{ExactModel, ExactView, Literal, Real, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Scalar, Vector, Velocity};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct TrackOdometry {
    velocity: Quantity<Velocity>,
    attitude: Quantity<Attitude>,
    rate: Quantity<Vector<3>>,
    gauge: Param<Scalar>,
    centre: Param<Scalar>,
    slip: Param<Scalar>,
    lever_arm: Param<Vector<3>>,
    mounting: Param<Attitude>,
}

impl ExactModel for TrackOdometry {
    fn dim(&self) -> usize {
        2
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let w_b = x.vector(&self.rate);
        let u_b = x.matrix(&self.attitude).transpose() * x.velocity(&self.velocity) + w_b.cross(&x.vector(&self.lever_arm));
        let c_sb = x.matrix(&self.mounting).transpose();
        let (u, r) = ((c_sb * u_b).x, (c_sb * w_b).z);
        let kept = -x.scalar(&self.slip) + 1.0;
        if kept.re() < 1e-3 {
            return Err(Undefined("tracks that lose all of their speed tell none"));
        }
        let (centre, half) = (x.scalar(&self.centre), x.scalar(&self.gauge) * 0.5);
        z[0] = (u - r * (centre - half)) / kept;
        z[1] = (u - r * (centre + half)) / kept;
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::{RotationParam, ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, parameter, state};
    use fusion_core::model::{Exact, Measurement};
    use schemars::JsonSchema;

    /// Speeds of the left and right track of a skid-steered vehicle.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct TrackOdometrySpec {
        /// Distance between the centres of rotation of the two tracks; the gauge of the vehicle times 1.5 or so.
        gauge: ScalarParam<dim::Length>,
        /// Middle between these centres, to the right of the point of the lever arm.
        #[serde(default)]
        centre: ScalarParam<dim::Length>,
        /// Slip of both tracks: the share of their speed that is lost.
        #[serde(default)]
        slip: ScalarParam<dim::Ratio>,
        /// Middle of the tracks in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the vehicle's axes in the body: x_body = C(mounting) x_vehicle.
        #[serde(default)]
        mounting: RotationParam,
    }

    crate::register!(
        Sensor,
        "track_odometry",
        TrackOdometrySpec,
        r#"
gauge = { estimate = true, initial = "4.15 m", sigma = "20 cm" }
centre = { estimate = true, initial = 0, sigma = "5 cm" }
slip = { estimate = true, initial = "4 %", sigma = "3 %", correlation_time = "2 s" }
lever_arm = ["30 cm", 0, "50 cm"]
"#
    );

    #[typetag::deserialize(name = "track_odometry")]
    impl SensorSpec for TrackOdometrySpec {
        fn reading(&self) -> Reading {
            Reading::Channels(vec![channel::LEFT_TRACK, channel::RIGHT_TRACK])
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; 2]
        }

        fn axes(&self) -> &'static [&'static str] {
            &["left", "right"]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            if self.gauge.initial().is_some_and(|gauge| gauge <= 0.0) {
                return Err(
                    BuildError::at("gauge", "the gauge, the distance between the tracks, must be greater than 0")
                        .help("write e.g. \"0.8 m\""),
                );
            }
            Ok(Box::new(Exact(TrackOdometry {
                velocity: b.quantity(state::VELOCITY)?,
                attitude: b.quantity(state::ATTITUDE)?,
                rate: b.quantity(state::ANGULAR_RATE)?,
                gauge: b.param("gauge", &self.gauge)?,
                centre: b.param("centre", &self.centre)?,
                slip: b.param(parameter::SLIP, &self.slip)?,
                lever_arm: b.param("lever_arm", &self.lever_arm)?,
                mounting: b.param("mounting", &self.mounting)?,
            })))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;
    use fusion_core::model::{Exact, Measurement};
    use fusion_core::state::View;
    use nalgebra::Vector3;

    #[test]
    fn turning_right_on_the_spot_the_left_track_runs_ahead_and_slip_makes_both_faster() {
        let predict = |speed: f64, slip: f64, centre: f64| {
            let model = TrackOdometry {
                velocity: Quantity::Fixed(Vector3::new(0.0, speed, 0.0)),
                attitude: Quantity::Fixed(from_rpy(0.0, 0.0, core::f64::consts::FRAC_PI_2)),
                rate: Quantity::Fixed(Vector3::new(0.0, 0.0, 0.1)),
                gauge: Param::Fixed(4.0),
                centre: Param::Fixed(centre),
                slip: Param::Fixed(slip),
                lever_arm: Param::Fixed(Vector3::zeros()),
                mounting: Param::Fixed(from_rpy(0.0, 0.0, 0.0)),
            };
            let mut z = [0.0; 2];
            Exact(model).predict(&View::new(&[], &[]), &mut z).unwrap();
            z
        };
        // 4 ε: rounding.
        let close = |z: [f64; 2], want: [f64; 2]| assert!(z.iter().zip(want).all(|(z, w)| (z - w).abs() < 2e-15), "{z:?} {want:?}");
        close(predict(0.0, 0.0, 0.0), [0.2, -0.2]);
        close(predict(0.3, 0.0, 0.0), [0.5, 0.1]);
        close(predict(0.3, 0.5, 0.0), [1.0, 0.2]);
        // The inverse: r = (z_l − z_r)/B, u = (z_l y_r − z_r y_l)/B.
        let [l, r] = predict(0.3, 0.0, 0.5);
        close([(l - r) / 4.0, (l * 2.5 - r * -1.5) / 4.0], [0.1, 0.3]);
    }
}
