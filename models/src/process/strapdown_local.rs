//! Strapdown inertial navigation over a plane, north-east-down at the origin, as a process model.
//!
//! Input      mean angular rate w_m \[rad/s\] and specific force f_m \[m/s²\] over a sample, body axes
//! Corrected  w, f as for `strapdown`: biases, scale factors, coning and sculling
//! States     `local_position` p \[m\], `velocity` v \[m/s\], both in the axes at the origin, `attitude`
//!            q_nb to those axes; where estimated `gyro_bias`, `accel_bias`, `gyro_scale`, `accel_scale`
//! Signals    `position` (geodetic), `angular_rate` w_ib_b \[rad/s\], `acceleration` dv/dt \[m/s²\]
//! Model      ṗ = v, v̇ = C f + g, Ċ = C \[w×\], g constant, down
//! Discrete   exact for constant w and f: with Γ of [`gamma`](fusion_core::geometry::gamma),
//!            C⁺ = C Γ₀(wΔt), v⁺ = v + gΔt + C Γ₁ f Δt, p⁺ = p + vΔt + ½gΔt² + C Γ₂ f Δt²
//! Φ, Q       as [`discrete`] says, exact by default: group-affine, so that
//!            Φ in an invariant chart of SE₂(3) does not depend on the state. Within 100 m and 10 m/s,
//!            at 100 Hz, its largest element differs in the right-invariant chart by 0.6 1/s with Φ of
//!            first order, 0.05 of second, 1e-11 (rounding) exact; 0.01 for `strapdown`, by the Earth's
//!            rate, and 1e-4 in the left-invariant chart
//! Valid      within some kilometres: at d the level turns by d/R, 1.6e-4 rad per km, and the plane leaves
//!            the ellipsoid by d²/2R, 8 cm at 1 km; and where the Earth's rate, 7.3e-5 rad/s, is below the
//!            errors of the gyros
//! Source     Barrau and Bonnabel 2017; Hartley et al. 2020

use super::inertial::{IMU, Inertial, LONGEST_STEP};
use super::strapdown::discrete::{self, Discretisation, Slots};
use crate::earth::LocalFrame;
use crate::earth::frames::rotation_en;
use crate::process::agility::Agility;
use alloc::boxed::Box;
use alloc::vec::Vec;
use fusion_core::geometry::gamma::gamma;
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Gap, Input, Literal, Order, Preparation, Process, SignalsOut};
use fusion_core::state::{Geodetic, Position, Signal, Vector};
use nalgebra::{Matrix3, Vector3};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct StrapdownLocal {
    slots: Slots<Position>,
    inertial: Inertial,
    geodetic: Signal<Geodetic>,
    acceleration: Signal<Vector<3>>,
    discretisation: Discretisation,
    gravity: Vector3<f64>,
    agility: Agility,
    /// By how much the numbers of a sample may change.
    changes: [f64; IMU],
    frame: LocalFrame,
    /// Local axes at the origin to Earth-centred axes.
    c_en: Matrix3<f64>,
}

impl Process for StrapdownLocal {
    fn input_dim(&self) -> usize {
        IMU
    }

    fn max_step(&self) -> f64 {
        LONGEST_STEP
    }

    fn order(&self) -> Order {
        self.discretisation.into()
    }

    fn preparation(&self) -> Option<Box<dyn Preparation>> {
        self.inertial.preparation()
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let (w, f) = self.inertial.driving(x, input);
        let (p, v, q) = (
            self.slots.position.read(x),
            self.slots.velocity.read(x),
            self.slots.attitude.read(x),
        );
        let phi = w * dt;
        let (half, g) = (0.5 * dt * dt, self.gravity);
        let moved = p + v * dt + g * half + q * (gamma(2, &phi) * f) * (dt * dt);
        let mut turned = q * so3::exp(&phi);
        turned.renormalize_fast();
        self.slots.position.write(&moved, x);
        self.slots.velocity.write(&(v + g * dt + q * so3::mean_rotated(&phi, &(f * dt))), x);
        self.slots.attitude.write(&turned, x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let c_nb = so3::rotation(&self.slots.attitude.read(x));
        let corrected = self.inertial.corrected(x, input);
        let (gyro, accel) = self.inertial.noise(&corrected.0.rate, input);
        let (w, f) = if self.discretisation == Discretisation::Exact {
            let (w, f) = self.inertial.driving(x, input);
            self.slots.write_exact_noise(&c_nb, (&w, &f), &gyro, &accel, dt, out);
            (w, f)
        } else {
            self.slots.write_trapezoid(&c_nb, &gyro, &accel, dt, out);
            (corrected.0.rate, corrected.1.rate)
        };
        let phi = discrete::over_plane(self.discretisation, &c_nb, (&w, &f), dt);
        self.slots.write(&phi, out);
        self.inertial
            .write_transition(&corrected, &[phi.by_force, phi.by_rate], &self.slots, out);
    }

    fn agility(&self) -> &[f64] {
        &self.changes
    }

    fn motion(&self, x: &[f64], input: &Input<'_>, motion: &mut Vec<f64>) {
        let felt = self.inertial.felt(x, input);
        let steady = -self.slots.attitude.read(x).inverse_transform_vector(&self.gravity);
        motion.extend_from_slice(felt.w_ib_b.as_slice());
        motion.extend_from_slice((felt.f_ib_b - steady).as_slice());
    }

    fn coast(&self, x: &mut [f64], gap: &Gap, motion: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        let (v, q, dt) = (self.slots.velocity.read(x), self.slots.attitude.read(x), gap.duration());
        let (c_nb, fading) = (so3::rotation(&q), self.agility.fading(gap, motion));
        out.set(self.slots.position, self.slots.velocity, &(Matrix3::identity() * dt));
        out.set(self.slots.position, self.slots.attitude, &(-c_nb * so3::skew(&fading.path)));
        self.slots.fade(&fading, &c_nb, out);
        out.noise_trapezoid(self.slots.velocity, self.slots.velocity, &self.agility.velocity(gap, &c_nb));
        self.agility.turn(gap, self.slots.attitude, self.slots.velocity, v.xy().norm(), out);
        let position = self.slots.position.read(x) + v * dt + c_nb * fading.path;
        let q = q * fading.turn;
        self.slots.position.write(&position, x);
        self.slots.velocity.write(&(v + c_nb * fading.velocity), x);
        self.slots.attitude.write(&q, x);
        let steady = -q.inverse_transform_vector(&self.gravity);
        self.inertial.feel(x, &fading.w, &(steady + fading.f), sample);
        true
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let (w, f) = self.inertial.corrected(x, input);
        let q = self.slots.attitude.read(x);
        let position = self.frame.to_geodetic(&self.slots.position.read(x));
        self.inertial.write_rate(&w, out);
        out.set(self.geodetic, &position);
        out.set(self.acceleration, &(q * f.rate + self.gravity));
        if !out.wants_jacobian() {
            return;
        }
        let c_nb = so3::rotation(&q);
        // From the axes at the origin to those at the position.
        let turn = rotation_en(position.lat, position.lon).transpose() * self.c_en;
        out.add(self.geodetic, self.slots.position, &turn);
        out.add(self.acceleration, self.slots.attitude, &(-c_nb * so3::skew(&f.rate)));
        self.inertial.add_by_force(self.acceleration, &c_nb, &f, out);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec, imu_channels};
    use crate::de::DeserializeSpec;
    use crate::earth::Gravity;
    use crate::process::agility::AgilitySpec;
    use crate::process::inertial::{AccelerometerSpec, GyroSpec};
    use crate::process::strapdown::pairing::Mode;
    use crate::units::{Positive, STANDARD_GRAVITY, dim};
    use crate::vocabulary::state;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// By what a sample is corrected for coning and sculling.
    #[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
    #[serde(rename_all = "snake_case")]
    pub enum LocalIntegrator {
        /// The sample before: no added delay.
        #[default]
        OneSample,
        /// Its partner in pairs of samples: one sample later, more exact.
        TwoSample,
        /// Nothing: rate and force are constant within a sample.
        Constant,
    }

    /// Strapdown inertial navigation over a plane with constant gravity that does not turn, for small areas
    /// and small drones: states local position, velocity, attitude and, where declared, biases and scale
    /// factors; driven by the channels `angular_rate` and `specific_force` of its source. Needs an origin.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct StrapdownLocalSpec {
        /// The gyros: noise, bias, scale.
        gyro: GyroSpec,
        /// The accelerometers: noise, bias, scale.
        accelerometer: AccelerometerSpec,
        /// By what samples are corrected before they are integrated, exactly for constant rate and force.
        #[serde(default)]
        integrator: LocalIntegrator,
        /// How Φ and Q of a step are computed.
        #[serde(default = "exact")]
        discretisation: Discretisation,
        /// Gravity, down; standard gravity without it.
        #[serde(default = "standard")]
        gravity: Positive<dim::Acceleration>,
        /// How fast the vehicle can change its motion, for gaps and spikes of the samples.
        #[serde(default)]
        agility: AgilitySpec,
    }

    const fn exact() -> Discretisation {
        Discretisation::Exact
    }

    fn standard() -> Positive<dim::Acceleration> {
        Positive::try_from_si(STANDARD_GRAVITY).unwrap_or_else(|_| unreachable!("standard gravity is positive"))
    }

    crate::register!(
        Process,
        "strapdown_local",
        StrapdownLocalSpec,
        r#"
integrator = "one_sample"
discretisation = "exact"
gravity = "9.81 m/s^2"
agility = { acceleration = ["3 m/s^2", "2 m/s^2", "1 m/s^2"], angular_rate = ["5 deg/s", "5 deg/s", "30 deg/s"], time = "1 s", tilt = "10 deg" }
gyro = { noise = "0.2 deg/sqrt(h)", bias = { estimate = true, initial = [0.01, 0, 0], sigma = "0.1 deg/s", random_walk = "1e-5 rad/s/sqrt(s)" }, scale = { estimate = true, initial = [0, 0.02, 0], sigma = "1 %" } }
accelerometer = { noise = ["70 ug/sqrt(Hz)", "70 ug/sqrt(Hz)", "90 ug/sqrt(Hz)"], bias = { estimate = true, initial = [0, 0.1, 0], sigma = "10 mg", correlation_time = "1000 s" }, scale = { estimate = true, initial = [0, 0, 0.01], sigma = "1 %" } }
"#
    );

    #[typetag::deserialize(name = "strapdown_local")]
    impl ProcessSpec for StrapdownLocalSpec {
        fn input(&self) -> Vec<Channel> {
            imu_channels()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let frame = LocalFrame::new(b.origin()?);
            let g = self.gravity.si();
            b.gravity = Gravity::Flat(g);
            let correction = match self.integrator {
                LocalIntegrator::OneSample => Some(Mode::Previous),
                LocalIntegrator::TwoSample => Some(Mode::Pairs),
                LocalIntegrator::Constant => None,
            };
            Ok(Box::new(StrapdownLocal {
                slots: Slots::declare(b, state::LOCAL_POSITION, Vector3::zeros())?,
                inertial: Inertial::declare(b, &self.gyro, &self.accelerometer, correction)?,
                geodetic: b.signal(state::POSITION)?,
                acceleration: b.signal(state::ACCELERATION)?,
                discretisation: self.discretisation,
                gravity: Vector3::new(0.0, 0.0, g),
                agility: (&self.agility).into(),
                changes: Agility::from(&self.agility).changes(),
                c_en: rotation_en(frame.origin().lat, frame.origin().lon),
                frame,
            }))
        }
    }
}

#[cfg(test)]
mod tests;
