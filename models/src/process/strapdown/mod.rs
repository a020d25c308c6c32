//! Strapdown inertial navigation on the ellipsoid, NED, as a process model.
//!
//! Input      mean angular rate w_m \[rad/s\] and specific force f_m \[m/s²\] over a sample, body axes
//! Corrected  w = (w_m − b_g)/(1 + s_g),  f = (f_m − b_a)/(1 + s_a), per axis
//! States     `position` (geodetic), `velocity` v_eb_n, `attitude` q_nb; where estimated
//!            `gyro_bias`, `accel_bias`, `gyro_scale`, `accel_scale`
//! Signals    `angular_rate` w_ib_b \[rad/s\], `acceleration` dv_eb_n/dt \[m/s²\]
//! Φ, Q       see `discrete.rs`: I + FΔt, + ½F²Δt², F from [`error_model`], with the trapezoid of white
//!            accelerometer noise on velocity and gyro noise on attitude; or the derivative of the step
//! Gaps       velocity and attitude are kept, within the vehicle's agility
//! Slow input a sample of more than 0.2 s ([`LONGEST_STEP`]) is integrated in pieces, and Q gains the effect of
//!            the unknown motion in it
//! Source     spec of the mechanisation: Savage 1998; Titterton and Weston 2004, ch. 12

pub mod discrete;
pub mod error_model;
pub mod increments;
pub mod mechanisation;
pub mod pairing;

use super::inertial::{Corrected, IMU, Inertial};
use crate::earth::Gravity;
use crate::process::agility::Agility;
use crate::process::kinematic::Kinematic;
use alloc::boxed::Box;
use alloc::vec::Vec;
use error_model::Linear;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Gap, Input, Literal, Order, Preparation, Process, SignalsOut};
use fusion_core::state::{Signal, Vector};
use mechanisation::Start;
use nalgebra::Vector3;

pub use super::inertial::LONGEST_STEP;
#[cfg(feature = "declare")]
pub use super::inertial::{AccelerometerSpec, GyroSpec};

pub use discrete::Discretisation;

/// How an input sample becomes a step of the navigation state.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum Integrator {
    /// Coning and sculling corrected with the sample before: no added delay.
    #[default]
    OneSample,
    /// Coning and sculling corrected within pairs of samples: one sample later, more exact.
    TwoSample,
    /// First-order Euler integration, as a paper prints it: for comparison.
    FirstOrder,
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Strapdown {
    kinematic: Kinematic,
    inertial: Inertial,
    acceleration: Signal<Vector<3>>,
    integrator: Integrator,
    discretisation: Discretisation,
    /// Density of the random walk of the position, per axis.
    position_psd: Vector3<f64>,
    gravity: Gravity,
    agility: Agility,
    /// The largest changes of the numbers of a sample.
    changes: [f64; IMU],
}

impl Process for Strapdown {
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
        let start = Start::of(&self.kinematic.read(x));
        let corrected = self.inertial.corrected(x, input);
        self.write_next(&start, &corrected, x, input, dt);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let start = Start::of(&self.kinematic.read(x));
        let corrected = self.inertial.corrected(x, input);
        self.write_transition(&start, &corrected, input, dt, out);
    }

    fn step(&self, x: &mut [f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let start = Start::of(&self.kinematic.read(x));
        let corrected = self.inertial.corrected(x, input);
        self.write_transition(&start, &corrected, input, dt, out);
        self.write_next(&start, &corrected, x, input, dt);
    }

    fn agility(&self) -> &[f64] {
        &self.changes
    }

    fn motion(&self, x: &[f64], input: &Input<'_>, motion: &mut Vec<f64>) {
        self.kinematic.motion(x, &self.inertial.felt(x, input), self.gravity, motion);
    }

    fn coast(&self, x: &mut [f64], gap: &Gap, motion: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        let felt = self.kinematic.coast(x, gap, motion, &self.agility, self.gravity, out);
        self.inertial.feel(x, &felt.w_ib_b, &felt.f_ib_b, sample);
        true
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let (w, f) = self.inertial.corrected(x, input);
        let nav = self.kinematic.read(x);
        self.inertial.write_rate(&w, out);
        out.set(
            self.acceleration,
            &mechanisation::derivative(&nav, &w.rate, &f.rate, self.gravity).v_eb_n,
        );
        if !out.wants_jacobian() {
            return;
        }
        let b = error_model::continuous(&nav, &w.rate, &f.rate, self.gravity);
        let slots = self.kinematic.slots;
        out.add(self.acceleration, slots.position, &b.vr);
        out.add(self.acceleration, slots.velocity, &b.vv);
        out.add(self.acceleration, slots.attitude, &b.va);
        // b.v_accel = ∂v̇/∂b_a = −C_nb; by force it is C_nb.
        self.inertial.add_by_force(self.acceleration, &-b.v_accel, &f, out);
    }

    literal!();
}

/// Rate and force, free of the known errors of the sensors.
type Sample = (Corrected, Corrected);

impl Strapdown {
    #[inline]
    fn write_next(&self, start: &Start, corrected: &Sample, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let (w, f) = self.inertial.driven(corrected, input);
        let next = if self.integrator == Integrator::FirstOrder {
            mechanisation::step_first_order(&start.nav, &w, &f, dt, self.gravity)
        } else {
            mechanisation::step_from(start, &w, &f, dt, self.gravity)
        };
        self.kinematic.write(&next, x);
    }

    #[inline(always)]
    fn write_transition(&self, start: &Start, corrected: &Sample, input: &Input<'_>, dt: f64, out: &mut Transition) {
        let (gyro, accel) = self.inertial.noise(&corrected.0.rate, input);
        let (slots, (w, f)) = (&self.kinematic.slots, (&corrected.0.rate, &corrected.1.rate));
        if self.discretisation == Discretisation::FirstOrder {
            let linear = Linear::at(start, w, f, self.gravity);
            let responses = slots.write_first_order(&linear, dt, out);
            self.inertial.write_transition(corrected, &responses, slots, out);
            slots.write_trapezoid(&start.c_nb, &gyro, &accel, dt, out);
        } else {
            self.write_other(start, corrected, input, dt, out);
        }
        out.noise_trapezoid_of_axes(slots.position, &(self.position_psd * dt));
    }

    /// The same for second order or exact.
    #[inline(never)]
    fn write_other(&self, start: &Start, corrected: &Sample, input: &Input<'_>, dt: f64, out: &mut Transition) {
        let ((gyro, accel), slots) = (self.inertial.noise(&corrected.0.rate, input), &self.kinematic.slots);
        let phi = if self.discretisation == Discretisation::Exact {
            let (w, f) = self.inertial.driven(corrected, input);
            slots.write_exact_noise(&start.c_nb, (&w, &f), &gyro, &accel, dt, out);
            discrete::over_ellipsoid(&start.nav, (&w, &f), dt, self.gravity)
        } else {
            slots.write_trapezoid(&start.c_nb, &gyro, &accel, dt, out);
            let b = error_model::continuous_at(start, &corrected.0.rate, &corrected.1.rate, self.gravity);
            discrete::second_order(&b, dt)
        };
        slots.write(&phi, out);
        self.inertial.write_transition(corrected, &[phi.by_force, phi.by_rate], slots, out);
    }
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec, imu_channels};
    use crate::de::DeserializeSpec;
    use crate::process::agility::AgilitySpec;
    use crate::process::kinematic;
    use crate::units::{Axes, dim, range};
    use crate::vocabulary::state;
    use pairing::Mode;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Which formula gives the magnitude of gravity.
    #[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
    #[serde(rename_all = "snake_case")]
    pub enum GravitySpec {
        /// WGS-84 normal gravity with height (Somigliana): the default.
        #[default]
        Somigliana,
        /// The series of Titterton and Weston 2004.
        TittertonWeston,
        /// The series of Noureldin et al. 2013.
        Noureldin,
    }

    impl From<GravitySpec> for Gravity {
        fn from(spec: GravitySpec) -> Self {
            match spec {
                GravitySpec::Somigliana => Self::Somigliana,
                GravitySpec::TittertonWeston => Self::TittertonWeston,
                GravitySpec::Noureldin => Self::Noureldin,
            }
        }
    }

    /// Strapdown inertial navigation on the ellipsoid: states position, velocity, attitude and, where
    /// declared, biases and scale factors; driven by the channels `angular_rate` and
    /// `specific_force` of its source.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct StrapdownSpec {
        /// The gyros: noise, bias, scale.
        gyro: GyroSpec,
        /// The accelerometers: noise, bias, scale.
        accelerometer: AccelerometerSpec,
        /// How samples are integrated.
        #[serde(default)]
        integrator: Integrator,
        /// How Φ and Q of a step are computed; `exact` is not for the integrator `first_order`.
        #[serde(default)]
        discretisation: Discretisation,
        /// Random walk of the position, north east down, in addition to the effect of the sensors' noise: 0, unless a
        /// published Q has one.
        #[serde(default)]
        position_noise: Axes<dim::PositionRandomWalk, range::NonNegative>,
        /// The gravity model.
        #[serde(default)]
        gravity: GravitySpec,
        /// How fast the vehicle can change its motion, for gaps and spikes of the samples.
        #[serde(default)]
        agility: AgilitySpec,
    }

    crate::register!(
        Process,
        "strapdown",
        StrapdownSpec,
        r#"
integrator = "one_sample"
position_noise = "1 mm/sqrt(s)"
discretisation = "second_order"
gravity = "somigliana"
agility = { acceleration = ["3 m/s^2", "2 m/s^2", "1 m/s^2"], angular_rate = ["5 deg/s", "5 deg/s", "30 deg/s"], time = "1 s", tilt = "10 deg" }
gyro = { noise = "0.2 deg/sqrt(h)", bias = { estimate = true, initial = [0.01, 0, 0], sigma = "0.1 deg/s", random_walk = "1e-5 rad/s/sqrt(s)" }, scale = { estimate = true, initial = [0, 0.02, 0], sigma = "1 %" }, scale_noise = "0.2 %/sqrt(Hz)" }
accelerometer = { noise = "70 ug/sqrt(Hz)", bias = { estimate = true, initial = [0, 0.1, 0], sigma = "10 mg", correlation_time = "1000 s" }, scale = { estimate = true, initial = [0, 0, 0.01], sigma = "1 %" }, vibration = "1 s" }
"#
    );

    #[typetag::deserialize(name = "strapdown")]
    impl ProcessSpec for StrapdownSpec {
        fn input(&self) -> Vec<Channel> {
            imu_channels()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let correction = match self.integrator {
                Integrator::FirstOrder => None,
                Integrator::OneSample => Some(Mode::Previous),
                Integrator::TwoSample => Some(Mode::Pairs),
            };
            if correction.is_none() && self.discretisation == Discretisation::Exact {
                let message = "`exact` is the derivative of a step that integrates the turn of the body, which `first_order` does not";
                let help = "choose `integrator = \"one_sample\"`, or `discretisation = \"first_order\"`";
                return Err(BuildError::at("discretisation", message).help(help));
            }
            let gravity = self.gravity.into();
            b.gravity = gravity;
            Ok(Box::new(Strapdown {
                kinematic: Kinematic::declare(b)?,
                inertial: Inertial::declare(b, &self.gyro, &self.accelerometer, correction)?,
                acceleration: b.signal(state::ACCELERATION)?,
                integrator: self.integrator,
                discretisation: self.discretisation,
                position_psd: kinematic::psd(self.position_noise.si()).diagonal(),
                gravity,
                agility: (&self.agility).into(),
                changes: Agility::from(&self.agility).changes(),
            }))
        }
    }
}

#[cfg(test)]
mod tests;
