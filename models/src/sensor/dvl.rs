//! A Doppler log, beam by beam.
//!
//! Measured   z_i = velocity of the sensor over ground or through water along its beam i; moving the way the beam
//!            points is positive \[m/s\]
//! Predicted  dᵢᵀ of what `body_velocity` predicts, dᵢ = [sin θ cos αᵢ, sin θ sin αᵢ, cos θ]: θ the angle of the beams
//!            from the sensor's down axis, αᵢ the azimuth of beam i, clockwise from its forward axis
//! Jacobian   dᵢᵀ of that of `body_velocity`; lever arm, mounting, scale, bias and current are the same
//! Rows       each beam is a separate measurement with its own gate. A beam without an echo has no number and
//!            leaves the others unchanged. Two beams give the velocity in a plane, three give all of it
//! Velocity   four beams a quarter of a turn apart, with 1σ s each, are equivalent to their velocity with 1σ of
//!            s/(√2 sin θ) forward and right and s/(2 cos θ) down
//! Valid      the beams see the same ground, or water with the same motion
//! Not here   the difference between the fourth beam and the others as a measure of quality: the gates judge it
//! Source     Brokloff 1994, Matrix algorithm for Doppler sonar navigation

use super::body_velocity::BodyVelocity;
use alloc::boxed::Box;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::View;

/// The runtime model: components along directions that may be missing one by one.
#[derive(Debug, Literal)]
pub struct Beams(BodyVelocity);

impl Measurement for Beams {
    fn size(&self) -> Size {
        self.0.size()
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        self.0.predict(at, value)
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        self.0.jacobian(at, h)
    }

    fn part(&self, row: usize) -> Option<Box<dyn Measurement>> {
        let mut beam = self.0.clone();
        beam.directions = vec![*self.0.directions.get(row)?];
        Some(Box::new(beam))
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
    use crate::sensor::body_velocity::BodyVelocitySpec;
    use crate::units::{Angle, Dimension, Dimensional, Positive, dim};
    use core::f64::consts::FRAC_PI_2;
    use fusion_core::math;
    use nalgebra::Vector3;
    use schemars::JsonSchema;

    /// The names of the beams and of their channels.
    const BEAMS: &[&str] = &["beam_1", "beam_2", "beam_3", "beam_4", "beam_5", "beam_6", "beam_7", "beam_8"];

    /// Velocities along the beams of a Doppler log, each a separate measurement: channels `beam_1`, `beam_2` and so on.
    #[derive(Clone, Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct DvlSpec {
        /// Angle of the beams from the sensor's down axis, less than 90 deg; 20 to 30 deg are usual.
        beam_angle: Positive<dim::Angle>,
        /// Azimuth of each beam, clockwise from the sensor's forward axis: one to eight beams.
        azimuths: Vec<Angle>,
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the sensor's axes in the body: x_body = C(mounting) x_sensor.
        #[serde(default)]
        mounting: RotationParam,
        /// Scale error κ of all beams: they read (1 + κ) of the velocity.
        #[serde(default)]
        scale: ScalarParam<dim::Ratio>,
        /// Bias in the sensor's axes, added to the true velocity.
        #[serde(default)]
        bias: VectorParam<dim::Speed>,
        /// Velocity of the water over ground, north east down: for a log that measures against the water, not the bottom.
        #[serde(default)]
        current: VectorParam<dim::Speed>,
    }

    crate::register!(
        Sensor,
        "dvl",
        DvlSpec,
        r#"
beam_angle = "22.5 deg"
azimuths = ["-45 deg", "45 deg", "135 deg", "-135 deg"]
lever_arm = { estimate = true, initial = [0.4, 0.1, "60 cm"], sigma = "10 cm" }
mounting = { estimate = true, initial = [0, 0, "45 deg"], sigma = "1 deg" }
scale = { estimate = true, initial = 0, sigma = "1 %" }
bias = { estimate = true, initial = [0, 0, 0], sigma = "5 cm/s", correlation_time = "60 s" }
current = { estimate = true, initial = ["30 cm/s", 0, 0], sigma = ["0.5 m/s", "0.5 m/s", 0], correlation_time = "20 min" }
"#
    );

    impl DvlSpec {
        /// The names of its beams, at most as many as there are names.
        fn beams(&self) -> &'static [&'static str] {
            &BEAMS[..self.azimuths.len().min(BEAMS.len())]
        }

        /// The direction of each beam, in the sensor's axes.
        pub(super) fn directions(&self) -> Result<Vec<Vector3<f64>>, BuildError> {
            let count = self.azimuths.len();
            if !(1..=BEAMS.len()).contains(&count) {
                let message = format!("{count} beams are declared, and a log has one to {}", BEAMS.len());
                return Err(BuildError::at("azimuths", message).help("write one azimuth per beam, e.g. `[\"45 deg\", \"135 deg\", …]`"));
            }
            let angle = self.beam_angle.si();
            if angle >= FRAC_PI_2 {
                let message = "beams point down: their angle from the down axis is less than 90 deg";
                return Err(BuildError::at("beam_angle", message).help("turn a log that looks elsewhere by its `mounting`"));
            }
            let (across, down) = math::sin_cos(angle);
            let beam = |azimuth: &Angle| {
                let (sin, cos) = math::sin_cos(azimuth.si());
                Vector3::new(across * cos, across * sin, down)
            };
            Ok(self.azimuths.iter().map(beam).collect())
        }
    }

    #[typetag::deserialize(name = "dvl")]
    impl SensorSpec for DvlSpec {
        fn reading(&self) -> Reading {
            let beam = |name: &&'static str| Channel::vector(name, 1, dim::Speed::KIND.dimension);
            Reading::Channels(self.beams().iter().map(beam).collect())
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Speed::KIND.dimension; self.beams().len()]
        }

        fn axes(&self) -> &'static [&'static str] {
            self.beams()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let directions = self.directions()?;
            let velocity = BodyVelocitySpec {
                lever_arm: self.lever_arm.clone(),
                mounting: self.mounting.clone(),
                scale: self.scale.clone(),
                bias: self.bias.clone(),
                current: self.current.clone(),
            };
            Ok(Box::new(Beams(velocity.along(b, &directions)?)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn spec(text: &str) -> DvlSpec {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn four_beams_say_what_their_velocity_says() {
        let (theta, s) = (22.5_f64.to_radians(), 0.03);
        let janus = spec("beam_angle = '22.5 deg'\nazimuths = ['-45 deg', '45 deg', '135 deg', '-135 deg']");
        let v = Vector3::new(1.2, -0.4, 0.3);
        // HᵀR⁻¹H and HᵀR⁻¹z: an update needs only these.
        let (mut information, mut seen) = (Matrix3::zeros(), Vector3::zeros());
        for d in janus.directions().unwrap() {
            information += d * d.transpose() / (s * s);
            seen += d * d.dot(&v) / (s * s);
        }
        let sigma = Vector3::new(
            s / (2f64.sqrt() * theta.sin()),
            s / (2f64.sqrt() * theta.sin()),
            s / (2.0 * theta.cos()),
        );
        let of_velocity = Matrix3::from_diagonal(&sigma.map(|s| 1.0 / (s * s)));
        // 1e-12: rounding of numbers of 4000.
        assert!((information - of_velocity).amax() < 1e-12 * of_velocity.amax(), "{information}");
        assert!((seen - of_velocity * v).amax() < 1e-12 * of_velocity.amax(), "{seen}");
    }

    #[test]
    fn beams_that_no_log_has_are_refused() {
        let field = |text: &str| spec(text).directions().unwrap_err().field;
        assert_eq!(field("beam_angle = '25 deg'\nazimuths = []"), "azimuths");
        assert_eq!(field("beam_angle = '25 deg'\nazimuths = [0, 1, 2, 3, 4, 5, 6, 7, 8]"), "azimuths");
        assert_eq!(field("beam_angle = '90 deg'\nazimuths = [0]"), "beam_angle");
    }
}
