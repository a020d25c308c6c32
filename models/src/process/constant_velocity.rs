//! Constant velocity: white acceleration in local Cartesian axes.
//!
//! State      r, position in north-east-down axes fixed at the origin \[m\]; v = ṙ \[m/s\]
//! Model      v̇ = w, white with density S per axis [(m/s²)²/Hz]
//! Discrete   Φ = [I, T I; 0, I],  Q = S [T³/3, T²/2; T²/2, T], exact
//! Signals    position (geodetic), acceleration (zero)
//! Valid      within kilometres of the origin: velocity is resolved in the axes at the origin,
//!            which differ from those at the position by 9″ per 280 m
//! Source     Bar-Shalom, Li, Kirubarajan 2001, §6.2.2

use crate::earth::LocalFrame;
use crate::earth::frames::rotation_en;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Input, Literal, Process, SignalsOut};
use fusion_core::state::{Geodetic, Position, Signal, Slot, Vector, Velocity};
use nalgebra::{Matrix3, Vector3};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct ConstantVelocity {
    position: Slot<Position>,
    velocity: Slot<Velocity>,
    geodetic: Signal<Geodetic>,
    acceleration: Signal<Vector<3>>,
    psd: Vector3<f64>,
    frame: LocalFrame,
    /// Local axes at the origin to Earth-centred axes.
    c_en: Matrix3<f64>,
}

impl Process for ConstantVelocity {
    fn input_dim(&self) -> usize {
        0
    }

    fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
        let moved = self.position.read(x) + self.velocity.read(x) * dt;
        self.position.write(&moved, x);
    }

    fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        let q = Matrix3::from_diagonal(&self.psd);
        out.set(self.position, self.velocity, &(Matrix3::identity() * dt));
        out.noise(self.position, self.position, &(q * (dt * dt * dt / 3.0)));
        out.noise(self.position, self.velocity, &(q * (dt * dt / 2.0)));
        out.noise(self.velocity, self.velocity, &(q * dt));
    }

    fn signals(&self, x: &[f64], _: &Input<'_>, out: &mut SignalsOut<'_>) {
        let position = self.frame.to_geodetic(&self.position.read(x));
        out.set(self.geodetic, &position);
        out.set(self.acceleration, &Vector3::zeros());
        if out.wants_jacobian() {
            // From the axes at the origin to those at the position.
            out.add(
                self.geodetic,
                self.position,
                &(rotation_en(position.lat, position.lon).transpose() * self.c_en),
            );
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{Axes, Vec3Of, dim, range};
    use crate::vocabulary::state;
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// Constant velocity with white acceleration, in local axes at the origin; no input.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ConstantVelocitySpec {
        /// White noise density of the acceleration, north east down.
        acceleration_noise: Axes<dim::VelocityRandomWalk, range::NonNegative>,
        /// Position the filter starts from, north east down of the origin.
        #[serde(default)]
        initial_position: Vec3Of<dim::Length>,
        /// Initial 1σ of position.
        position_sigma: Axes<dim::Length, range::NonNegative>,
        /// Velocity the filter starts from, north east down.
        #[serde(default)]
        initial_velocity: Vec3Of<dim::Speed>,
        /// Initial 1σ of velocity.
        velocity_sigma: Axes<dim::Speed, range::NonNegative>,
    }

    crate::register!(
        Process,
        "constant_velocity",
        ConstantVelocitySpec,
        r#"
acceleration_noise = ["0.1 m/s^2/sqrt(Hz)", "0.1 m/s^2/sqrt(Hz)", "0.02 m/s^2/sqrt(Hz)"]
initial_position = [0, 0, 0]
position_sigma = "10 m"
initial_velocity = [0, 0, 0]
velocity_sigma = "1 m/s"
"#
    );

    #[typetag::deserialize(name = "constant_velocity")]
    impl ProcessSpec for ConstantVelocitySpec {
        fn input(&self) -> Vec<Channel> {
            Vec::new()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let frame = LocalFrame::new(b.origin()?);
            let (position, velocity) = (Vector3::from(self.initial_position.si()), Vector3::from(self.initial_velocity.si()));
            Ok(Box::new(ConstantVelocity {
                position: b.declare(
                    state::LOCAL_POSITION,
                    "m",
                    position,
                    self.position_sigma.si().to_vec(),
                    Dynamics::Process,
                )?,
                velocity: b.declare(
                    state::VELOCITY,
                    "m/s",
                    velocity,
                    self.velocity_sigma.si().to_vec(),
                    Dynamics::Process,
                )?,
                geodetic: b.signal(state::POSITION)?,
                acceleration: b.signal(state::ACCELERATION)?,
                psd: Vector3::from(self.acceleration_noise.si()).map(|density| density * density),
                c_en: rotation_en(frame.origin().lat, frame.origin().lon),
                frame,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};
    use fusion_core::Time;
    use fusion_core::filter::{Backend, Estimator, Filter};
    use fusion_core::model::Size;
    use fusion_core::state::LayoutBuilder;
    use std::sync::Arc;

    #[test]
    fn two_half_steps_grow_the_covariance_as_one_whole_step() {
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(Geodetic::new(0.6, 2.2, 0.0)),
            gravity: Default::default(),
        };
        let spec: ConstantVelocitySpec = toml::from_str("acceleration_noise = 0.3\nposition_sigma = 2\nvelocity_sigma = 1").unwrap();
        let model = spec.build(&mut build).unwrap();
        let model: Arc<dyn Process> = model.into();
        let layout = Arc::new(layout.finish());
        let after = |steps: i64| {
            let mut filter = Filter::new(layout.clone(), model.clone(), Backend::default(), Size::same(1));
            for k in 1..=steps {
                let to = Time::from_nanos(2_000_000_000 * k / steps);
                filter.predict(to, &Input::held(&[])).unwrap();
            }
            filter.belief().covariance.to_dense()
        };
        let (one, two) = (after(1), after(2));
        // Exact discretisation composes; 10 ε of 8.
        assert!(one.iter().zip(&two).all(|(one, two)| (one - two).abs() < 2e-14));
        // Position variance 4 + T²·1 + S T³/3.
        assert!((one[0] - (8.0 + 0.09 * 8.0 / 3.0)).abs() < 1e-14);
    }
}
