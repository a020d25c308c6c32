//! Velocity in the axes of a vehicle or sensor: Doppler log, odometer, nonholonomic constraint.
//!
//! Measured   z = velocity of the point l over ground or through water, in the axes s, or along other
//!            directions d of these axes, row by row \[m/s\]; below for the axes themselves, otherwise dᵀ of it
//! Predicted  h(x) = (1 + κ) u_s + b,  u_s = C_bsᵀ u_b,  u_b = C_nbᵀ (v_eb_n − c_n) + w_ib_b × l_bs_b
//! Jacobian   ∂h/∂δv = −∂h/∂c = k C_bsᵀ C_nbᵀ,  ∂h/∂δφ_b = k C_bsᵀ [C_nbᵀ (v − c) ×],
//!            ∂h/∂w = −k C_bsᵀ [l ×],  ∂h/∂l = k C_bsᵀ [w ×],  ∂h/∂δμ = k [u_s ×],  ∂h/∂κ = u_s,
//!            ∂h/∂b = I₃,  k = 1 + κ
//! Water      c is the velocity of the water, 0 for bottom track. An estimated c is separated from the vehicle's
//!            velocity by sensors of position or velocity over ground; several logs may share one c
//! Beams      the beams of a Doppler log are directions too: the sensor `dvl`
//! Here       C_bs is the mounting: the attitude of the axes s in the body, x_b = C_bs x_s, with
//!            the right perturbation C_bs Exp(δμ). A nonholonomic constraint does not see δμ
//!            about forward: give that axis sigma 0
//! Valid      no slip sideways (nonholonomic), none forward beyond κ (odometer); w_ib for w_eb:
//!            7e-5 m/s per metre of lever arm, the Earth's rotation
//! Source     Groves 2013, §14.3.2 (odometry, motion constraints), §15.4

use alloc::vec::Vec;
use fusion_core::geometry::so3::{rotation, skew};
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Scalar, Tangent, Vector, Velocity, View};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// The runtime model of these sensors.
#[derive(Clone, Debug, Literal)]
pub struct BodyVelocity {
    velocity: Quantity<Velocity>,
    attitude: Quantity<Attitude>,
    rate: Option<Quantity<Vector<3>>>,
    lever_arm: Param<Vector<3>>,
    mounting: Param<Attitude>,
    scale: Param<Scalar>,
    bias: Param<Vector<3>>,
    current: Param<Vector<3>>,
    /// The measured directions, in order: unit vectors in the sensor's axes.
    pub(super) directions: Vec<Vector3<f64>>,
}

impl BodyVelocity {
    /// `C_nbᵀ (v − c)`, the body's velocity in body axes, and `u_b`, the velocity of the point.
    fn velocities(&self, at: &View<'_>) -> (Vector3<f64>, Vector3<f64>) {
        let v_n = at.get(&self.velocity) - at.get(&self.current);
        let v_b = at.get(&self.attitude).inverse_transform_vector(&v_n);
        let turning = self.rate.as_ref().map(|w| at.get(w).cross(&at.get(&self.lever_arm)));
        (v_b, v_b + turning.unwrap_or_default())
    }

    /// Adds the measured rows of ∂u/∂`quantity`.
    fn add<M: Tangent<C>, const C: usize>(&self, h: &mut Jacobian, quantity: &Quantity<M>, block: &SMatrix<f64, 3, C>) {
        for (row, direction) in self.directions.iter().enumerate() {
            h.add(row, quantity, &(direction.transpose() * block));
        }
    }
}

impl Measurement for BodyVelocity {
    fn size(&self) -> Size {
        Size::same(self.directions.len())
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let u_s = at.get(&self.mounting).inverse_transform_vector(&self.velocities(at).1);
        let h = u_s * (1.0 + at.get(&self.scale)) + at.get(&self.bias);
        for (value, direction) in value.iter_mut().zip(&self.directions) {
            *value = direction.dot(&h);
        }
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let (v_b, u_b) = self.velocities(at);
        let c_bn = rotation(&at.get(&self.attitude)).transpose();
        let c_sb = rotation(&at.get(&self.mounting)).transpose();
        let k = 1.0 + at.get(&self.scale);
        let (u_s, scaled) = (c_sb * u_b, c_sb * k);
        self.add(h, &self.velocity, &(scaled * c_bn));
        self.add(h, &self.current, &(-scaled * c_bn));
        self.add(h, &self.bias, &Matrix3::identity());
        self.add(h, &self.attitude, &(scaled * skew(&v_b)));
        self.add(h, &self.mounting, &(skew(&u_s) * k));
        self.add(h, &self.scale, &u_s);
        if let Some(rate) = &self.rate {
            self.add(h, rate, &(-scaled * skew(&at.get(&self.lever_arm))));
            self.add(h, &self.lever_arm, &(scaled * skew(&at.get(rate))));
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
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::{RotationParam, ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, parameter, state};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Forward, right, down of the sensor's axes.
    pub(super) const AXES: [Vector3<f64>; 3] = [
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(0.0, 1.0, 0.0),
        Vector3::new(0.0, 0.0, 1.0),
    ];

    /// Velocity over ground in the sensor's own axes: a Doppler log.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct BodyVelocitySpec {
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        pub(crate) lever_arm: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the sensor's axes in the body: x_body = C(mounting) x_sensor.
        #[serde(default)]
        pub(crate) mounting: RotationParam,
        /// Scale error κ: the sensor reads (1 + κ) of the velocity.
        #[serde(default)]
        pub(crate) scale: ScalarParam<dim::Ratio>,
        /// Bias in the sensor's axes, added to the true velocity.
        #[serde(default)]
        pub(crate) bias: VectorParam<dim::Speed>,
        /// Velocity of the water over ground, north east down: for a log that measures against the water, not the bottom.
        #[serde(default)]
        pub(crate) current: VectorParam<dim::Speed>,
    }

    crate::register!(
        Sensor,
        "body_velocity",
        BodyVelocitySpec,
        r#"
lever_arm = { estimate = true, initial = [0.4, 0.1, "60 cm"], sigma = "10 cm" }
mounting = { estimate = true, initial = [0, 0, "45 deg"], sigma = "1 deg" }
scale = { estimate = true, initial = 0, sigma = "1 %" }
bias = { estimate = true, initial = [0, 0, 0], sigma = "5 cm/s", correlation_time = "60 s" }
current = { estimate = true, initial = ["30 cm/s", 0, 0], sigma = ["0.5 m/s", "0.5 m/s", 0], correlation_time = "20 min" }
"#
    );

    /// Speed along the forward axis of a vehicle: an odometer, a wheel encoder, a water log. It does not measure motion
    /// sideways and down, so these velocities drift. Add a sensor `nonholonomic` if the vehicle hardly slips; for a water
    /// log let both sensors share the `current`.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct OdometerSpec {
        /// Where the speed is measured, in body axes from the body origin (the IMU): a wheel, the middle of the rear axle.
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the vehicle's axes in the body: x_body = C(mounting) x_vehicle.
        #[serde(default)]
        mounting: RotationParam,
        /// Scale error κ: the sensor reads (1 + κ) of the speed.
        #[serde(default)]
        scale: ScalarParam<dim::Ratio>,
        /// Velocity of the water over ground, north east down: for a log that measures against the water.
        #[serde(default)]
        current: VectorParam<dim::Speed>,
    }

    crate::register!(
        Sensor,
        "odometer",
        OdometerSpec,
        r#"
lever_arm = ["-1.2 m", "0.7 m", "0.4 m"]
mounting = { estimate = true, initial = ["0.5 deg", "-1 deg", "2 deg"], sigma = [0, "1 deg", "1 deg"] }
scale = { estimate = true, initial = "1 %", sigma = "3 %", random_walk = "0.01 %/sqrt(s)" }
"#
    );

    /// Pseudo-measurement: a wheeled or tracked vehicle has no velocity sideways or up, a boat has no velocity sideways
    /// through the water.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct NonholonomicSpec {
        /// Where the constraint holds, in body axes from the body origin (the IMU): the middle of
        /// the axle that does not steer.
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the vehicle's axes in the body: x_body = C(mounting) x_vehicle.
        #[serde(default)]
        mounting: RotationParam,
        /// Which velocities are zero.
        #[serde(default)]
        axes: Constraint,
        /// Velocity of the water over ground, north east down: for a boat without leeway, which does not move sideways
        /// through the water.
        #[serde(default)]
        current: VectorParam<dim::Speed>,
    }

    /// The axes of a nonholonomic constraint.
    #[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
    #[serde(rename_all = "snake_case")]
    pub(super) enum Constraint {
        /// Right and down.
        #[default]
        Both,
        /// Right only.
        Right,
        /// Down only.
        Down,
    }

    impl Constraint {
        pub(super) fn rows(self) -> &'static [Vector3<f64>] {
            match self {
                Self::Both => &AXES[1..],
                Self::Right => &AXES[1..2],
                Self::Down => &AXES[2..],
            }
        }

        const fn names(self) -> &'static [&'static str] {
            match self {
                Self::Both => &["right", "down"],
                Self::Right => &["right"],
                Self::Down => &["down"],
            }
        }
    }

    crate::register!(
        Sensor,
        "nonholonomic",
        NonholonomicSpec,
        r#"
lever_arm = { estimate = true, initial = ["-1.2 m", 0, "0.4 m"], sigma = "10 cm" }
mounting = { estimate = true, initial = [0, 0, 0], sigma = [0, "1 deg", "1 deg"] }
axes = "both"
current = { estimate = true, initial = [0, 0, 0], sigma = ["0.5 m/s", "0.5 m/s", 0], correlation_time = "20 min" }
"#
    );

    impl BodyVelocitySpec {
        /// The model of the components along these directions of the sensor's axes.
        pub(crate) fn along(&self, b: &mut Build<'_>, directions: &[Vector3<f64>]) -> Result<BodyVelocity, BuildError> {
            let scale = b.param("scale", &self.scale)?;
            let mut model = BodyVelocity::build(b, &self.lever_arm, &self.mounting, directions)?;
            model.scale = scale;
            model.bias = b.param("bias", &self.bias)?;
            model.current = b.param(parameter::CURRENT, &self.current)?;
            Ok(model)
        }
    }

    #[typetag::deserialize(name = "body_velocity")]
    impl SensorSpec for BodyVelocitySpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::BODY_VELOCITY)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; 3]
        }

        fn axes(&self) -> &'static [&'static str] {
            &["forward", "right", "down"]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(self.along(b, &AXES)?))
        }
    }

    #[typetag::deserialize(name = "odometer")]
    impl SensorSpec for OdometerSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(Channel::vector("speed", 1, dim::Speed::KIND.dimension))
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let scale = b.param("scale", &self.scale)?;
            let mut model = BodyVelocity::build(b, &self.lever_arm, &self.mounting, &AXES[..1])?;
            model.scale = scale;
            model.current = b.param(parameter::CURRENT, &self.current)?;
            Ok(Box::new(model))
        }
    }

    #[typetag::deserialize(name = "nonholonomic")]
    impl SensorSpec for NonholonomicSpec {
        fn reading(&self) -> Reading {
            Reading::Constant(vec![0.0; self.axes.rows().len()])
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; self.axes.rows().len()]
        }

        fn axes(&self) -> &'static [&'static str] {
            self.axes.names()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let mut model = BodyVelocity::build(b, &self.lever_arm, &self.mounting, self.axes.rows())?;
            model.current = b.param(parameter::CURRENT, &self.current)?;
            Ok(Box::new(model))
        }
    }

    impl BodyVelocity {
        /// Over ground, without scale error and bias.
        fn build(
            b: &mut Build<'_>,
            lever_arm: &VectorParam<dim::Length>,
            mounting: &RotationParam,
            directions: &[Vector3<f64>],
        ) -> Result<Self, BuildError> {
            let lever_arm = b.param("lever_arm", lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Self {
                velocity: b.quantity(state::VELOCITY)?,
                attitude: b.quantity(state::ATTITUDE)?,
                // Without a lever arm the rate does not matter, and not every process has one.
                rate: if at_the_body {
                    None
                } else {
                    Some(b.quantity(state::ANGULAR_RATE)?)
                },
                lever_arm,
                mounting: b.param("mounting", mounting)?,
                scale: Param::Fixed(0.0),
                bias: Param::Fixed(Vector3::zeros()),
                current: Param::Fixed(Vector3::zeros()),
                directions: directions.to_vec(),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;

    fn model(mounting_yaw: f64, directions: &[Vector3<f64>]) -> BodyVelocity {
        let heading = 1.1_f64;
        BodyVelocity {
            // 3 m/s ahead, turning right at 0.2 rad/s.
            velocity: Quantity::Fixed(Vector3::new(3.0 * heading.cos(), 3.0 * heading.sin(), 0.0)),
            attitude: Quantity::Fixed(from_rpy(0.0, 0.0, heading)),
            rate: Some(Quantity::Fixed(Vector3::new(0.0, 0.0, 0.2))),
            lever_arm: Param::Fixed(Vector3::new(-2.0, 0.5, 0.0)),
            mounting: Param::Fixed(from_rpy(0.0, 0.0, mounting_yaw)),
            scale: Param::Fixed(0.1),
            bias: Param::Fixed(Vector3::zeros()),
            current: Param::Fixed(Vector3::zeros()),
            directions: directions.to_vec(),
        }
    }

    fn predict(model: &BodyVelocity) -> Vec<f64> {
        let mut z = vec![0.0; model.directions.len()];
        model.predict(&View::new(&[], &[]), &mut z).unwrap();
        z
    }

    #[test]
    fn behind_and_right_of_a_right_turn_the_vehicle_is_slower_and_swings_left() {
        // w × l = 0.2·[−0.5, −2, 0]; 4 ε: rounding.
        let z = predict(&model(0.0, &AXES));
        assert!(
            (Vector3::from_column_slice(&z) - Vector3::new(2.9, -0.4, 0.0) * 1.1).amax() < 2e-15,
            "{z:?}"
        );
        assert_eq!(predict(&model(0.0, Constraint::Both.rows())), z[1..]);
    }

    #[test]
    fn axes_mounted_to_the_right_see_the_forward_motion_from_their_left() {
        // x_b = C x_s with a yaw of 90°: the sensor's forward is the body's right.
        let z = predict(&model(core::f64::consts::FRAC_PI_2, &AXES));
        assert!(
            (Vector3::from_column_slice(&z) - Vector3::new(-0.4, -2.9, 0.0) * 1.1).amax() < 2e-15,
            "{z:?}"
        );
    }

    #[test]
    fn a_log_that_drifts_with_the_water_reads_nothing_and_one_against_it_the_sum() {
        let mut still = model(0.0, &AXES);
        still.rate = None;
        still.current = Param::Fixed(still.velocity.stored(&[]).unwrap());
        still.bias = Param::Fixed(Vector3::new(0.0, 0.02, 0.0));
        assert_eq!(predict(&still), [0.0, 0.02, 0.0]);
        still.current = Param::Fixed(-still.velocity.stored(&[]).unwrap());
        // 6 m/s through the water times 1.1; 4 ε: rounding.
        assert!((predict(&still)[0] - 6.6).abs() < 4e-15);
    }
}
