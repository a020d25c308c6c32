//! Strapdown navigation that takes its rotation from an attitude reference instead of gyros.
//!
//! Input      mean specific force f_m \[m/s²\] over a sample, and the reference's attitude q_nb at
//!            its end; the sample before gives that at its start
//! Turning    w_nb_b = Log(q_start⁻¹ ⊗ q_end)/T − b_g, constant over the sample: it may be split anywhere
//! States     `position` (geodetic), `velocity` v_eb_n, `attitude` q_nb; where estimated
//!            `accel_bias`,  f = f_m − b_a, and `gyro_bias` b_g, with which the reference drifts: 15 in all
//! Discrete   position and velocity as `strapdown`;  q⁺ = q ⊗ Exp(w_nb_b Δt)
//! Φ          I + FΔt, F of the strapdown error model but for the attitude, which does not see
//!            position and velocity:  Φ_aa = Exp(w_nb_b Δt)ᵀ, Φ_ag = −J_r(w_nb_b Δt) Δt, exact
//! Signals    `angular_rate` w_ib_b = w_nb_b + C_nbᵀ w_in_n \[rad/s\], `acceleration` \[m/s²\]
//! Cascaded   an attitude filter, the stage `filter`, drives this process; the sensor `attitude` on the same
//!            stage holds the attitude to the reference's. With a small sigma the attitude equals the
//!            reference's; with the reference's true 1σ, position fixes may correct its errors. So one model
//!            covers the cascade, a filter that owns the attitude, and the cases between them
//! Mind       the same gyros enter twice: `attitude_noise` and the sensor's sigma must include the common
//!            errors of the reference
//! Drift      a reference that removes its gyro bias, or is held by a compass, does not drift: leave b_g out

use crate::earth::{Gravity, LocalEarth};
use crate::process::agility::Agility;
use crate::process::kinematic::{Felt, Kinematic, value};
use crate::process::strapdown::discrete::Slots;
use crate::process::strapdown::error_model::{self, Blocks};
use crate::process::strapdown::mechanisation::{self, Nav};
use crate::process::strapdown::pairing::{Mode, Pairing, neighbour};
use alloc::boxed::Box;
use alloc::vec::Vec;
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Gap, Input, Literal, Preparation, Process, SignalsOut};
use fusion_core::state::{Param, Signal, Vector};
use nalgebra::{Matrix3, Vector3, Vector4};

/// Numbers of a sample: specific force, attitude.
const SAMPLE: usize = 7;

/// The specific force among these numbers.
const FORCE: usize = 3;

/// The rate of the reference \[rad/s\] over a sample of specific force and attitude; `None` over a held sample.
fn turning(input: &Input<'_>) -> Option<Vector3<f64>> {
    let attitude = |s: &[f64]| so3::from_scalar_first(&Vector4::new(s[3], s[4], s[5], s[6]));
    // The neighbours here come before the sample.
    let other = neighbour(input, SAMPLE).filter(|_| input.interval > 0.0)?;
    Some(so3::log(&(attitude(other.sample).inverse() * attitude(input.sample))) / input.interval)
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct ExternalAttitude {
    kinematic: Kinematic,
    accel_bias: Param<Vector<3>>,
    gyro_bias: Param<Vector<3>>,
    angular_rate: Signal<Vector<3>>,
    acceleration: Signal<Vector<3>>,
    attitude_psd: Matrix3<f64>,
    accel_psd: Matrix3<f64>,
    gravity: Gravity,
    agility: Agility,
    /// The largest changes of the numbers of a sample.
    changes: [f64; SAMPLE],
}

/// Everything one step needs.
struct Step {
    nav: Nav,
    w_nb_b: Vector3<f64>,
    /// True if the reference turned and drifted in this step.
    is_turned: bool,
    w_ib_b: Vector3<f64>,
    f_ib_b: Vector3<f64>,
}

impl ExternalAttitude {
    fn step(&self, x: &[f64], input: &Input<'_>) -> Step {
        let nav = self.kinematic.read(x);
        let turning = turning(input);
        let w_nb_b = turning.map_or_else(Vector3::zeros, |w| w - value(&self.gyro_bias, x));
        let earth = LocalEarth::at(&nav.position);
        let w_in_n = earth.earth_rate_n() + earth.transport_rate_n(&nav.v_eb_n);
        let w_ib_b = w_nb_b + nav.q_nb.inverse_transform_vector(&w_in_n);
        Step {
            nav,
            w_nb_b,
            is_turned: turning.is_some(),
            w_ib_b,
            f_ib_b: Vector3::from_column_slice(&input.sample[..3]) - value(&self.accel_bias, x),
        }
    }

    fn blocks(&self, s: &Step) -> Blocks {
        error_model::continuous(&s.nav, &s.w_ib_b, &s.f_ib_b, self.gravity)
    }
}

impl Process for ExternalAttitude {
    fn preparation(&self) -> Option<Box<dyn Preparation>> {
        Some(Box::new(Pairing::new(Mode::Previous)))
    }

    fn input_dim(&self) -> usize {
        SAMPLE
    }

    fn rates(&self) -> core::ops::Range<usize> {
        0..FORCE
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let s = self.step(x, input);
        let next = mechanisation::step(&s.nav, &s.w_ib_b, &s.f_ib_b, dt, self.gravity);
        let mut q_nb = s.nav.q_nb * so3::exp(&(s.w_nb_b * dt));
        q_nb.renormalize();
        self.kinematic.write(&Nav { q_nb, ..next }, x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let s = self.step(x, input);
        let b = self.blocks(&s);
        let Slots {
            position: r,
            velocity: v,
            attitude: a,
        } = self.kinematic.slots;
        let one = Matrix3::identity();
        out.set(r, r, &(one + b.rr * dt));
        out.set(r, v, &(b.rv * dt));
        out.set(v, r, &(b.vr * dt));
        out.set(v, v, &(one + b.vv * dt));
        out.set(v, a, &(b.va * dt));
        out.set(a, a, &so3::rotation(&so3::exp(&(s.w_nb_b * dt))).transpose());
        if let Param::State(bias) = &self.accel_bias {
            out.set(v, *bias, &(b.v_accel * dt));
        }
        if let (Param::State(bias), true) = (&self.gyro_bias, s.is_turned) {
            out.set(a, *bias, &(so3::right_jacobian(&(s.w_nb_b * dt)) * -dt));
        }
        let c_nb = so3::rotation(&s.nav.q_nb);
        out.noise_trapezoid(v, v, &(c_nb * self.accel_psd * c_nb.transpose() * dt));
        out.noise_trapezoid(a, a, &(self.attitude_psd * dt));
    }

    fn agility(&self) -> &[f64] {
        &self.changes
    }

    fn motion(&self, x: &[f64], input: &Input<'_>, motion: &mut Vec<f64>) {
        let s = self.step(x, input);
        let felt = Felt {
            w_ib_b: s.w_ib_b,
            f_ib_b: s.f_ib_b,
        };
        self.kinematic.motion(x, &felt, self.gravity, motion);
    }

    fn coast(&self, x: &mut [f64], gap: &Gap, motion: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        // A held sample does not turn, whatever its attitude.
        let mut force = [0.0; 2 * FORCE];
        if let Some(motion) = motion.get(FORCE..2 * FORCE) {
            force[FORCE..].copy_from_slice(motion);
        }
        let felt = self.kinematic.coast(x, gap, &force, &self.agility, self.gravity, out);
        let f_m = felt.f_ib_b + value(&self.accel_bias, x);
        sample[..3].copy_from_slice(f_m.as_slice());
        true
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let s = self.step(x, input);
        out.set(self.angular_rate, &s.w_ib_b);
        out.set(
            self.acceleration,
            &mechanisation::derivative(&s.nav, &s.w_ib_b, &s.f_ib_b, self.gravity).v_eb_n,
        );
        if !out.wants_jacobian() {
            return;
        }
        let b = self.blocks(&s);
        // w_ib_b = w_nb_b + C_nbᵀ w_in: the sign of the error model's δw_nb_b = −C_nbᵀ δw_in − … is reversed.
        out.add(self.angular_rate, self.kinematic.slots.position, &-b.ar);
        out.add(self.angular_rate, self.kinematic.slots.velocity, &-b.av);
        out.add(self.angular_rate, self.kinematic.slots.attitude, &so3::skew(&(s.w_ib_b - s.w_nb_b)));
        if s.is_turned {
            out.add_quantity(self.angular_rate, &self.gyro_bias, &-Matrix3::identity());
        }
        out.add(self.acceleration, self.kinematic.slots.position, &b.vr);
        out.add(self.acceleration, self.kinematic.slots.velocity, &b.vv);
        out.add(self.acceleration, self.kinematic.slots.attitude, &b.va);
        out.add_quantity(self.acceleration, &self.accel_bias, &b.v_accel);
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
    use crate::param::VectorParam;
    use crate::process::agility::AgilitySpec;
    use crate::process::kinematic::psd;
    use crate::process::strapdown::GravitySpec;
    use crate::units::{Axes, dim, range};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Strapdown navigation that takes its rotation from an attitude reference: states position,
    /// velocity, attitude and, where declared, accelerometer and gyro bias; driven by the channels
    /// `specific_force` and `attitude` of its source.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ExternalAttitudeSpec {
        /// White noise of the reference's rotation: the angle random walk.
        attitude_noise: Axes<dim::AngleRandomWalk, range::NonNegative>,
        /// White noise of the specific force: the velocity random walk, e.g. "70 ug/sqrt(Hz)".
        accelerometer_noise: Axes<dim::VelocityRandomWalk, range::NonNegative>,
        /// Accelerometer bias; estimated as the state `accel_bias`.
        #[serde(default)]
        accelerometer_bias: VectorParam<dim::Acceleration>,
        /// Bias of the reference's gyros, with which its attitude drifts; estimated as the state `gyro_bias`.
        #[serde(default)]
        gyro_bias: VectorParam<dim::AngularRate>,
        /// The gravity model.
        #[serde(default)]
        gravity: GravitySpec,
        /// How fast the vehicle can change its motion, for gaps and spikes of the samples.
        #[serde(default)]
        agility: AgilitySpec,
    }

    crate::register!(
        Process,
        "strapdown_external_attitude",
        ExternalAttitudeSpec,
        r#"
attitude_noise = "0.1 deg/sqrt(s)"
accelerometer_noise = "70 ug/sqrt(Hz)"
accelerometer_bias = { estimate = true, initial = [0, 0.1, 0], sigma = "10 mg", correlation_time = "1000 s" }
gyro_bias = { estimate = true, initial = [0, 0, 0.001], sigma = "1 deg/h" }
gravity = "somigliana"
"#
    );

    #[typetag::deserialize(name = "strapdown_external_attitude")]
    impl ProcessSpec for ExternalAttitudeSpec {
        fn input(&self) -> Vec<Channel> {
            vec![channel::SPECIFIC_FORCE, channel::ATTITUDE]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let gravity = self.gravity.into();
            b.gravity = gravity;
            Ok(Box::new(ExternalAttitude {
                kinematic: Kinematic::declare(b)?,
                accel_bias: b.body_param(state::ACCEL_BIAS, "accelerometer_bias", &self.accelerometer_bias)?,
                gyro_bias: b.body_param(state::GYRO_BIAS, "gyro_bias", &self.gyro_bias)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                acceleration: b.signal(state::ACCELERATION)?,
                attitude_psd: psd(self.attitude_noise.si()),
                accel_psd: psd(self.accelerometer_noise.si()),
                gravity,
                agility: (&self.agility).into(),
                changes: changes(&(&self.agility).into()),
            }))
        }
    }

    /// The largest changes of the numbers of a sample; a quaternion may change its sign.
    fn changes(agility: &Agility) -> [f64; SAMPLE] {
        let [_, _, _, x, y, z] = agility.changes();
        let any = f64::INFINITY;
        [x, y, z, any, any, any, any]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};
    use fusion_core::geometry::wgs84::Geodetic as Place;
    use fusion_core::state::LayoutBuilder;
    use fusion_core::testing::check_process;
    use nalgebra::UnitQuaternion;

    fn built() -> (LayoutBuilder, Box<dyn Process>) {
        let mut layout = LayoutBuilder::new();
        let spec: ExternalAttitudeSpec = toml::from_str(
            "attitude_noise = 1e-3\naccelerometer_noise = 1e-2\naccelerometer_bias = { estimate = true, initial = [0, 0, 0], sigma = 0.1 }\n\
             gyro_bias = { estimate = true, initial = [0, 0, 0], sigma = 0.01 }",
        )
        .unwrap();
        let origin = Some(Place::new(0.63, 2.26, -20.0));
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin,
            gravity: Gravity::default(),
        };
        let process = spec.build(&mut build).unwrap();
        (layout, process)
    }

    fn sample(f: Vector3<f64>, q: UnitQuaternion<f64>) -> [f64; 7] {
        [f.x, f.y, f.z, q.w, q.i, q.j, q.k]
    }

    /// `now` with its neighbour `before`.
    fn between(before: &[f64], now: &[f64], interval: f64) -> Vec<f64> {
        [now, before, &[interval]].concat()
    }

    #[test]
    fn a_split_sample_ends_at_the_reference_and_so_does_a_whole_one() {
        let (layout, process) = built();
        let (q0, q1) = (so3::from_rpy(0.1, -0.2, 1.0), so3::from_rpy(0.15, -0.18, 1.1));
        let f = Vector3::new(0.5, 0.2, -9.7);
        let (before, now) = (sample(f, q0), sample(f, q1));
        let sample = between(&before, &now, 0.02);
        let input = Input {
            sample: &sample,
            interval: 0.02,
        };
        let mut whole = layout.so_far().initial().to_vec();
        whole[6..10].copy_from_slice(so3::to_scalar_first(&q0).as_slice());
        let mut split = whole.clone();
        process.propagate(&mut whole, &input, 0.02);
        process.propagate(&mut split, &input, 0.013);
        process.propagate(&mut split, &input, 0.007);
        for x in [whole, split] {
            let q = so3::from_scalar_first(&Vector4::from_column_slice(&x[6..10]));
            assert!(so3::log(&(q1.inverse() * q)).norm() < 1e-15); // rounding
        }
    }

    #[test]
    fn a_turning_reference_is_linearised_truly() {
        let (layout, process) = built();
        let (q0, q1) = (so3::from_rpy(0.1, -0.2, 1.0), so3::from_rpy(0.11, -0.19, 1.02));
        let f = Vector3::new(2.0, -1.0, -9.7);
        let (before, now) = (sample(f, q0), sample(f, q1));
        let mut x = layout.so_far().initial().to_vec();
        x[3..6].copy_from_slice(&[12.0, -7.0, 1.0]);
        x[6..10].copy_from_slice(so3::to_scalar_first(&q0).as_slice());
        for dt in [0.1, 0.01] {
            let input = Input {
                sample: &between(&before, &now, 0.05),
                interval: 0.05,
            };
            check_process(layout.so_far(), process.as_ref(), &x, &input, dt).unwrap();
        }
    }
}
