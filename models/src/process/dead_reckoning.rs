//! Dead reckoning by an attitude reference and the vehicle's velocity in its own axes: for logs without
//! accelerometers.
//!
//! Input      attitude q of a reference at the end of a sample; the previous sample gives it at the start
//! States     `position` (geodetic); `body_velocity` u over ground, forward, right, down \[m/s\]; where estimated
//!            `heading_offset` o, clockwise from the reference's heading to the true one, and `drift` d, a
//!            velocity north, east, down that is not in the vehicle's axes
//! Model      ṙ = R_z(o) C(q) u + d;  u and d by their own dynamics. A surge-speed process along the heading is
//!            a u whose sway and heave have no noise
//! Discrete   C at the middle of the sample, so that a sample may be split anywhere; Φ its exact derivative
//! Signals    `velocity`, `attitude` R_z(o) q, `angular_rate` between two samples, without the Earth's
//! Measured   u by a Doppler log or a water log (`body_velocity`, `odometer`), if there is one; in drop-outs u
//!            follows its dynamics
//! Not here   errors of the reference's tilt; its heading errors are o

use super::strapdown::pairing::{Mode, Pairing, neighbour};
use super::unicycle::carried;
use alloc::boxed::Box;
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Input, Literal, Order, Preparation, Process, SignalsOut};
use fusion_core::state::{Attitude, Geodetic, Param, Scalar, Signal, Slot, Vector, Velocity};
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector4};

/// Numbers of an attitude.
const SAMPLE: usize = 4;

/// The longest step \[s\]: within it, the random walk of the velocity does not move the position.
const LONGEST_STEP: f64 = 0.5;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct DeadReckoning {
    position: Slot<Geodetic>,
    body_velocity: Slot<Vector<3>>,
    heading_offset: Param<Scalar>,
    drift: Param<Vector<3>>,
    velocity: Signal<Velocity>,
    attitude: Signal<Attitude>,
    angular_rate: Signal<Vector<3>>,
    position_psd: Matrix3<f64>,
}

/// The attitude from a sample.
struct Turned {
    /// The attitude in the middle of its interval.
    middle: UnitQuaternion<f64>,
    /// The attitude at its end.
    end: UnitQuaternion<f64>,
    /// Rate of turn \[rad/s\].
    rate: Vector3<f64>,
}

impl Turned {
    fn of(input: &Input<'_>) -> Self {
        let attitude = |s: &[f64]| so3::from_scalar_first(&Vector4::new(s[0], s[1], s[2], s[3]));
        let end = attitude(input.sample);
        // A held sample does not turn.
        let Some(before) = neighbour(input, SAMPLE).filter(|_| input.interval > 0.0) else {
            let (middle, rate) = (end, Vector3::zeros());
            return Self { middle, end, rate };
        };
        let turn = so3::log(&(attitude(before.sample).inverse() * end));
        Self {
            middle: end * so3::exp(&(turn * -0.5)),
            end,
            rate: turn / input.interval,
        }
    }
}

impl DeadReckoning {
    /// The true attitude if the reference gives `q`.
    fn attitude(&self, x: &[f64], q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let offset = self.heading_offset.stored(x).unwrap_or_default();
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), offset) * q
    }

    /// Velocity over ground, and its part along the vehicle's axes, north east down.
    fn velocity(&self, x: &[f64], attitude: &UnitQuaternion<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let own = attitude * self.body_velocity.read(x);
        (own + self.drift.stored(x).unwrap_or_default(), own)
    }
}

impl Process for DeadReckoning {
    fn input_dim(&self) -> usize {
        SAMPLE
    }

    fn preparation(&self) -> Option<Box<dyn Preparation>> {
        Some(Box::new(Pairing::new(Mode::Previous)))
    }

    fn max_step(&self) -> f64 {
        LONGEST_STEP
    }

    fn order(&self) -> Order {
        Order::Exact
    }

    fn rates(&self) -> core::ops::Range<usize> {
        0..0
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let attitude = self.attitude(x, &Turned::of(input).middle);
        let moved = self.velocity(x, &attitude).0 * dt;
        self.position.write(&self.position.read(x).offset(&moved), x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let attitude = self.attitude(x, &Turned::of(input).middle);
        let (v, own) = self.velocity(x, &attitude);
        let (position, moved) = (self.position.read(x), v * dt);
        let (carried, factor) = carried(&position, &position.offset(&moved), &moved.xy());
        let metres = Matrix3::from_diagonal(&(factor.push(1.0) * dt));
        out.set(self.position, self.position, &carried);
        out.set(self.position, self.body_velocity, &(metres * so3::rotation(&attitude)));
        if let Param::State(offset) = self.heading_offset {
            out.set(self.position, offset, &(metres * Vector3::z().cross(&own)));
        }
        if let Param::State(drift) = self.drift {
            out.set(self.position, drift, &metres);
        }
        out.noise_trapezoid(self.position, self.position, &(self.position_psd * dt));
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let turned = Turned::of(input);
        let attitude = self.attitude(x, &turned.end);
        let (v, own) = self.velocity(x, &attitude);
        out.set(self.velocity, &v);
        out.set(self.attitude, &attitude);
        out.set(self.angular_rate, &turned.rate);
        if out.wants_jacobian() {
            let c_nb = so3::rotation(&attitude);
            out.add(self.velocity, self.body_velocity, &c_nb);
            out.add_quantity(self.velocity, &self.heading_offset, &Vector3::z().cross(&own));
            out.add_quantity(self.velocity, &self.drift, &Matrix3::identity());
            out.add_quantity(self.attitude, &self.heading_offset, &c_nb.row(2).transpose());
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
    use crate::param::{ScalarParam, VectorParam};
    use crate::units::{Axes, Positive, dim, range};
    use crate::vocabulary::{channel, state};
    use fusion_core::geometry::wgs84::Geodetic as Place;
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// Dead reckoning: position by the vehicle's velocity in its own axes and the attitude of a reference.
    /// Driven by the channel `attitude` of its source.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct DeadReckoningSpec {
        /// Initial 1σ of position, north east down. The position starts at the origin, or at the position from an
        /// initialiser.
        position_sigma: Axes<dim::Length, range::NonNegative>,
        /// Random walk of the position, north east down: motion that is neither in the velocity nor in the drift.
        #[serde(default)]
        position_noise: Axes<dim::PositionRandomWalk, range::NonNegative>,
        /// Initial 1σ of the velocity, forward right down; with `velocity_time` also the stationary 1σ.
        velocity_sigma: Axes<dim::Speed, range::NonNegative>,
        /// White noise density of the acceleration, forward right down; not with `velocity_time`.
        #[serde(default)]
        velocity_noise: Axes<dim::VelocityRandomWalk, range::NonNegative>,
        /// Correlation time of a velocity that returns to zero; without it the velocity is a random walk.
        velocity_time: Option<Positive<dim::Duration>>,
        /// From the reference's heading to the true heading, clockwise; estimated as the state `heading_offset`.
        #[serde(default)]
        heading_offset: ScalarParam<dim::Angle>,
        /// Velocity in addition to that in the vehicle's axes, north east down; estimated as the state `drift`.
        #[serde(default)]
        drift: VectorParam<dim::Speed>,
    }

    crate::register!(
        Process,
        "dead_reckoning",
        DeadReckoningSpec,
        r#"
position_sigma = "1 m"
velocity_sigma = ["1 m/s", "0.2 m/s", "0.1 m/s"]
velocity_noise = ["0.1 m/s/sqrt(s)", "2 cm/s/sqrt(s)", "2 cm/s/sqrt(s)"]
heading_offset = { estimate = true, initial = 0, sigma = "5 deg", random_walk = "0.1 deg/sqrt(s)" }
drift = { estimate = true, initial = [0, 0, 0], sigma = ["0.2 m/s", "0.2 m/s", 0], correlation_time = "60 s" }
"#
    );

    #[typetag::deserialize(name = "dead_reckoning")]
    impl ProcessSpec for DeadReckoningSpec {
        fn input(&self) -> Vec<Channel> {
            vec![channel::ATTITUDE]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let place = b.origin.unwrap_or(Place::new(0.0, 0.0, 0.0));
            let (sigma, noise) = (self.velocity_sigma.si(), self.velocity_noise.si());
            let dynamics = match self.velocity_time {
                None => Dynamics::RandomWalk {
                    psd: noise.map(|n| n * n).to_vec(),
                },
                Some(tau) if noise == [0.0; 3] => Dynamics::GaussMarkov {
                    sigma: sigma.to_vec(),
                    tau: tau.si(),
                },
                Some(_) => {
                    let message = "a velocity is a random walk or returns to zero, not both";
                    let help = "with `velocity_time` the noise follows from `velocity_sigma`: leave `velocity_noise` out";
                    return Err(BuildError::at("velocity_time", message).help(help));
                }
            };
            Ok(Box::new(DeadReckoning {
                position: b.declare(state::POSITION, "m", place, self.position_sigma.si().to_vec(), Dynamics::Process)?,
                body_velocity: b.declare(state::BODY_VELOCITY, "m/s", Vector3::zeros(), sigma.to_vec(), dynamics)?,
                heading_offset: b.param_named(state::HEADING_OFFSET, "heading_offset", &self.heading_offset)?,
                drift: b.param_named(state::DRIFT, "drift", &self.drift)?,
                velocity: b.signal(state::VELOCITY)?,
                attitude: b.signal(state::ATTITUDE)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                position_psd: crate::process::kinematic::psd(self.position_noise.si()),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};
    use fusion_core::geometry::wgs84::Geodetic as Place;
    use fusion_core::state::LayoutBuilder;

    #[test]
    fn ahead_is_where_the_reference_and_its_offset_say() {
        let spec: DeadReckoningSpec =
            toml::from_str("position_sigma = 1\nvelocity_sigma = 1\nheading_offset = '30 deg'\ndrift = [0, 0, 0.5]").unwrap();
        let mut layout = LayoutBuilder::new();
        let place = Place::new(0.6, 2.2, 0.0);
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(place),
            gravity: crate::earth::Gravity::default(),
        };
        let process = spec.build(&mut build).unwrap();
        let mut x = layout.so_far().initial().to_vec();
        x[3..6].copy_from_slice(&[2.0, 0.0, 0.0]);
        let q = so3::to_scalar_first(&so3::from_rpy(0.0, 0.0, 60f64.to_radians()));
        process.propagate(&mut x, &Input::held(q.as_slice()), 0.5);
        let moved = Place::new(x[0], x[1], x[2]).difference(&place);
        // 1e-9: coordinates of 6e6 m.
        assert!((moved - Vector3::new(0.0, 1.0, 0.25)).amax() < 1e-8, "{moved}");
    }

    #[test]
    fn a_velocity_has_one_kind_of_noise() {
        let spec: DeadReckoningSpec =
            toml::from_str("position_sigma = 1\nvelocity_sigma = 1\nvelocity_noise = 1\nvelocity_time = 5").unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        assert_eq!(spec.build(&mut build).unwrap_err().field, "velocity_time");
    }
}
