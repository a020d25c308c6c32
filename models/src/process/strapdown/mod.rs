//! Strapdown inertial navigation on the ellipsoid, NED, as a process model.
//!
//! Input      mean angular rate w_m \[rad/s\] and specific force f_m \[m/s²\] over a sample, body axes
//! Corrected  w = (w_m − b_g)/(1 + s_g),  f = (f_m − b_a)/(1 + s_a), per axis
//! States     `position` (geodetic), `velocity` v_eb_n, `attitude` q_nb; where estimated
//!            `gyro_bias`, `accel_bias`, `gyro_scale`, `accel_scale`
//! Signals    `angular_rate` w_ib_b \[rad/s\], `acceleration` dv_eb_n/dt \[m/s²\]
//! Φ          I + FΔt, or + ½F²Δt², F from [`error_model`]
//! Q          trapezoid of white accelerometer noise on velocity and gyro noise on attitude
//! Gaps       velocity and attitude stay, up to the vehicle's agility
//! Slow input a sample of more than 0.2 s ([`LONGEST_STEP`]) is integrated in pieces, and as only its
//!            mean is known Q gains what a change from the neighbour's rate and force may move attitude
//!            and velocity by within it: (T Δw)²/8, (T Δf)²/8 per axis and sample
//! Source     spec of the mechanisation: Savage 1998; Titterton and Weston 2004, ch. 12

pub mod error_model;
pub mod increments;
pub mod mechanisation;
pub mod pairing;

use crate::block::{Build, BuildError, Channel, ProcessSpec, imu_channels};
use crate::earth::Gravity;
use crate::param::VectorParam;
use crate::process::agility::{Agility, AgilitySpec};
use crate::process::kinematic::{Kinematic, psd, value};
use crate::units::{Axes, dim, range};
use crate::vocabulary::state;
use error_model::Blocks;
use fusion_core::linear::Transition;
use fusion_core::model::{Gap, Input, Preparation, Process, SignalsOut};
use fusion_core::state::{Param, Signal, Vector};
use nalgebra::{Matrix3, Vector3};
use pairing::{Mode, Pairing, neighbour};
use schemars::JsonSchema;
use serde::Deserialize;

/// How an input sample becomes a step of the navigation state.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Coning and sculling corrected with the sample before: no added delay.
    #[default]
    OneSample,
    /// Coning and sculling corrected within pairs of samples: one sample later, more exact.
    TwoSample,
    /// First-order Euler integration, as a paper prints it: for comparison.
    FirstOrder,
}

/// How Φ is computed from F.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Discretisation {
    /// Φ = I + FΔt.
    #[default]
    FirstOrder,
    /// Φ = I + FΔt + ½F²Δt².
    SecondOrder,
}

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

/// The gyros.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GyroSpec {
    /// White noise of the rate: the angle random walk, e.g. "0.125 deg/sqrt(h)".
    noise: Axes<dim::AngleRandomWalk, range::NonNegative>,
    /// Bias; estimated as the state `gyro_bias`.
    #[serde(default)]
    bias: VectorParam<dim::AngularRate>,
    /// Scale factor error; estimated as the state `gyro_scale`.
    #[serde(default)]
    scale: VectorParam<dim::Ratio>,
}

/// The accelerometers.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AccelerometerSpec {
    /// White noise of the specific force: the velocity random walk, e.g. "70 ug/sqrt(Hz)".
    noise: Axes<dim::VelocityRandomWalk, range::NonNegative>,
    /// Bias; estimated as the state `accel_bias`.
    #[serde(default)]
    bias: VectorParam<dim::Acceleration>,
    /// Scale factor error; estimated as the state `accel_scale`.
    #[serde(default)]
    scale: VectorParam<dim::Ratio>,
}

/// Strapdown inertial navigation on the ellipsoid: states position, velocity, attitude and, where
/// declared, biases and scale factors; driven by the channels `angular_rate` and
/// `specific_force` of its source.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrapdownSpec {
    /// The gyros: noise, bias, scale.
    gyro: GyroSpec,
    /// The accelerometers: noise, bias, scale.
    accelerometer: AccelerometerSpec,
    /// How samples are integrated.
    #[serde(default)]
    integrator: Integrator,
    /// How Φ is computed from F.
    #[serde(default)]
    discretisation: Discretisation,
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
discretisation = "second_order"
gravity = "somigliana"
agility = { acceleration = ["3 m/s^2", "2 m/s^2", "1 m/s^2"], angular_rate = ["5 deg/s", "5 deg/s", "30 deg/s"], time = "1 s", tilt = "10 deg" }
gyro = { noise = "0.2 deg/sqrt(h)", bias = { estimate = true, initial = [0.01, 0, 0], sigma = "0.1 deg/s", random_walk = "1e-5 rad/s/sqrt(s)" }, scale = { estimate = true, initial = [0, 0.02, 0], sigma = "1 %" } }
accelerometer = { noise = "70 ug/sqrt(Hz)", bias = { estimate = true, initial = [0, 0.1, 0], sigma = "10 mg", correlation_time = "1000 s" }, scale = { estimate = true, initial = [0, 0, 0.01], sigma = "1 %" } }
"#
);

#[typetag::deserialize(name = "strapdown")]
impl ProcessSpec for StrapdownSpec {
    fn input(&self) -> Vec<Channel> {
        imu_channels()
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
        let gravity = self.gravity.into();
        b.gravity = gravity;
        Ok(Box::new(Strapdown {
            kinematic: Kinematic::declare(b)?,
            gyro_bias: b.param_named(state::GYRO_BIAS, "gyro.bias", &self.gyro.bias)?,
            accel_bias: b.param_named(state::ACCEL_BIAS, "accelerometer.bias", &self.accelerometer.bias)?,
            gyro_scale: b.param_named(state::GYRO_SCALE, "gyro.scale", &self.gyro.scale)?,
            accel_scale: b.param_named(state::ACCEL_SCALE, "accelerometer.scale", &self.accelerometer.scale)?,
            angular_rate: b.signal(state::ANGULAR_RATE)?,
            acceleration: b.signal(state::ACCELERATION)?,
            gyro_psd: psd(self.gyro.noise.si()),
            accel_psd: psd(self.accelerometer.noise.si()),
            integrator: self.integrator,
            discretisation: self.discretisation,
            gravity,
            agility: (&self.agility).into(),
            changes: Agility::from(&self.agility).changes(),
        }))
    }
}

/// The longest step of one linearisation \[s\]: a turn of 0.5 rad/s is 0.1 rad then, and what Φ leaves
/// out of it 0.5 %. Inertial units are read at 50 Hz and more; slower ones leave open what the body does
/// between two samples.
pub const LONGEST_STEP: f64 = 0.2;

/// Numbers of an inertial sample: angular rate, specific force.
const IMU: usize = 6;

/// The runtime model.
#[derive(Debug)]
struct Strapdown {
    kinematic: Kinematic,
    gyro_bias: Param<Vector<3>>,
    accel_bias: Param<Vector<3>>,
    gyro_scale: Param<Vector<3>>,
    accel_scale: Param<Vector<3>>,
    angular_rate: Signal<Vector<3>>,
    acceleration: Signal<Vector<3>>,
    gyro_psd: Matrix3<f64>,
    accel_psd: Matrix3<f64>,
    integrator: Integrator,
    discretisation: Discretisation,
    gravity: Gravity,
    agility: Agility,
    /// By how much the numbers of a sample may change.
    changes: [f64; IMU],
}

/// Corrected rates, with ∂/∂bias = −`gain` and ∂/∂scale = −`rate`·`gain` per axis.
struct Corrected {
    rate: Vector3<f64>,
    gain: Vector3<f64>,
}

impl Corrected {
    /// ∂/∂bias, a diagonal.
    fn by_bias(&self) -> Vector3<f64> {
        -self.gain
    }

    /// ∂/∂scale, a diagonal.
    fn by_scale(&self) -> Vector3<f64> {
        -self.rate.component_mul(&self.gain)
    }
}

/// `m · diag(d)`.
fn times_diagonal(m: &Matrix3<f64>, d: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m[(i, j)] * d[j])
}

impl Strapdown {
    fn gyro(&self, x: &[f64]) -> Correction {
        Correction::new(value(&self.gyro_bias, x), &value(&self.gyro_scale, x))
    }

    fn accelerometer(&self, x: &[f64]) -> Correction {
        Correction::new(value(&self.accel_bias, x), &value(&self.accel_scale, x))
    }
}

/// What a sensor's error model makes of what it measures.
struct Correction {
    bias: Vector3<f64>,
    gain: Vector3<f64>,
}

impl Correction {
    fn new(bias: Vector3<f64>, scale: &Vector3<f64>) -> Self {
        Self {
            bias,
            gain: scale.map(|s| 1.0 / (1.0 + s)),
        }
    }

    /// What the sensor measures of a true `rate`.
    fn measured(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        rate.component_div(&self.gain) + self.bias
    }

    fn rate(&self, measured: &[f64]) -> Vector3<f64> {
        (Vector3::new(measured[0], measured[1], measured[2]) - self.bias).component_mul(&self.gain)
    }

    fn of(self, measured: &[f64]) -> Corrected {
        Corrected {
            rate: self.rate(measured),
            gain: self.gain,
        }
    }
}

impl Process for Strapdown {
    fn input_dim(&self) -> usize {
        IMU
    }

    fn max_step(&self) -> f64 {
        LONGEST_STEP
    }

    fn order(&self) -> u8 {
        match self.discretisation {
            Discretisation::FirstOrder => 1,
            Discretisation::SecondOrder => 2,
        }
    }

    fn preparation(&self) -> Option<Box<dyn Preparation>> {
        let mode = match self.integrator {
            Integrator::FirstOrder => return None,
            Integrator::OneSample => Mode::Previous,
            Integrator::TwoSample => Mode::Pairs,
        };
        Some(Box::new(Pairing::new(mode)))
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let (gyro, accelerometer) = (self.gyro(x), self.accelerometer(x));
        let (mut w, mut f) = (gyro.rate(&input.sample[..3]), accelerometer.rate(&input.sample[3..6]));
        let nav = self.kinematic.read(x);
        let next = if self.integrator == Integrator::FirstOrder {
            mechanisation::step_first_order(&nav, &w, &f, dt, self.gravity)
        } else {
            // The first sample of a stream covers no time and corrects nothing.
            if let Some(other) = neighbour(input, IMU).filter(|other| other.interval > 0.0) {
                let (w2, f2) = (gyro.rate(&other.sample[..3]), accelerometer.rate(&other.sample[3..6]));
                let (we, fe, wl, fl) = if other.is_earlier { (w2, f2, w, f) } else { (w, f, w2, f2) };
                // The intervals may differ; for linear rates this length is exact.
                let pair = 2.0 * input.interval * input.interval / (input.interval + other.interval);
                w += increments::coning_rate(&we, &wl, pair);
                f += increments::sculling_rate(&we, &fe, &wl, &fl, pair);
            }
            mechanisation::step(&nav, &w, &f, dt, self.gravity)
        };
        self.kinematic.write(&next, x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let (w, f) = (self.gyro(x).of(&input.sample[..3]), self.accelerometer(x).of(&input.sample[3..6]));
        let nav = self.kinematic.read(x);
        let b = error_model::continuous(&nav, &w.rate, &f.rate, self.gravity);
        let Kinematic {
            position: r,
            velocity: v,
            attitude: a,
        } = self.kinematic;
        let phi = discretise(&b, dt, self.discretisation);
        let [[rr, rv, ra], [vr, vv, va], [ar, av, aa]] = &phi.kinematic;
        out.set(r, r, rr);
        out.set(r, v, rv);
        out.set(v, r, vr);
        out.set(v, v, vv);
        out.set(v, a, va);
        out.set(a, r, ar);
        out.set(a, v, av);
        out.set(a, a, aa);
        let second = self.discretisation == Discretisation::SecondOrder;
        if second {
            out.set(r, a, ra);
        }
        let [r_acc, v_acc, a_acc] = &phi.by_force;
        for (param, effect) in [(&self.accel_bias, f.by_bias()), (&self.accel_scale, f.by_scale())] {
            if let Param::State(slot) = param {
                out.set(v, *slot, &times_diagonal(v_acc, &effect));
                if second {
                    out.set(r, *slot, &times_diagonal(r_acc, &effect));
                    out.set(a, *slot, &times_diagonal(a_acc, &effect));
                }
            }
        }
        let [v_gyr, a_gyr] = &phi.by_rate;
        for (param, effect) in [(&self.gyro_bias, w.by_bias()), (&self.gyro_scale, w.by_scale())] {
            if let Param::State(slot) = param {
                out.set(a, *slot, &times_diagonal(a_gyr, &effect));
                if second {
                    out.set(v, *slot, &times_diagonal(v_gyr, &effect));
                }
            }
        }
        let (slow_gyro, slow_accel) = within_sample(input);
        let p = self.accel_psd + slow_accel;
        // Noise alike on all axes is the same in every frame.
        let psd_n = if p.m11 == p.m22 && p.m22 == p.m33 {
            p
        } else {
            b.v_accel * p * b.v_accel.transpose()
        };
        out.noise_trapezoid(v, v, &(psd_n * dt));
        out.noise_trapezoid(a, a, &((self.gyro_psd + slow_gyro) * dt));
    }

    fn agility(&self) -> &[f64] {
        &self.changes
    }

    fn coast(&self, x: &mut [f64], gap: &Gap, sample: &mut [f64], out: &mut Transition) -> bool {
        let felt = self.kinematic.coast(x, gap, &self.agility, self.gravity, out);
        sample[..3].copy_from_slice(self.gyro(x).measured(&felt.w_ib_b).as_slice());
        sample[3..].copy_from_slice(self.accelerometer(x).measured(&felt.f_ib_b).as_slice());
        true
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let (w, f) = (self.gyro(x).of(&input.sample[..3]), self.accelerometer(x).of(&input.sample[3..6]));
        let nav = self.kinematic.read(x);
        out.set(self.angular_rate, &w.rate);
        out.set(
            self.acceleration,
            &mechanisation::derivative(&nav, &w.rate, &f.rate, self.gravity).v_eb_n,
        );
        if !out.wants_jacobian() {
            return;
        }
        out.add_quantity(self.angular_rate, &self.gyro_bias, &Matrix3::from_diagonal(&w.by_bias()));
        out.add_quantity(self.angular_rate, &self.gyro_scale, &Matrix3::from_diagonal(&w.by_scale()));
        let b = error_model::continuous(&nav, &w.rate, &f.rate, self.gravity);
        out.add(self.acceleration, self.kinematic.position, &b.vr);
        out.add(self.acceleration, self.kinematic.velocity, &b.vv);
        out.add(self.acceleration, self.kinematic.attitude, &b.va);
        // b.v_accel = ∂v̇/∂b_a = −C_nb; by force it is C_nb.
        out.add_quantity(self.acceleration, &self.accel_bias, &times_diagonal(&-b.v_accel, &f.by_bias()));
        out.add_quantity(self.acceleration, &self.accel_scale, &times_diagonal(&-b.v_accel, &f.by_scale()));
    }
}

/// The density of noise on rate and on force that stands for their unknown course within a long sample.
/// Where they change by Δ from one sample to the next, their integral is off in the middle by ΔT/8 if they
/// do so steadily, by ΔT/2 if they jump there; a density of T Δ²/8 has a 1σ of ΔT/4 there.
fn within_sample(input: &Input<'_>) -> (Matrix3<f64>, Matrix3<f64>) {
    let other = neighbour(input, IMU).filter(|other| other.interval > 0.0 && input.interval > LONGEST_STEP);
    let density = |from: usize| {
        other.map_or_else(Matrix3::zeros, |other| {
            let change = |k: usize| input.sample[from + k] - other.sample[from + k];
            Matrix3::from_diagonal(&Vector3::from_fn(|k, _| change(k).powi(2) * input.interval / 8.0))
        })
    };
    (density(0), density(3))
}

/// Φ in 3×3 blocks; the last two are the response to an error of specific force and of rate.
struct Discrete {
    kinematic: [[Matrix3<f64>; 3]; 3],
    by_force: [Matrix3<f64>; 3],
    by_rate: [Matrix3<f64>; 2],
}

/// Φ = I + FΔt (+ ½F²Δt²) in blocks r, v, a.
fn discretise(b: &Blocks, dt: f64, order: Discretisation) -> Discrete {
    let (zero, one) = (Matrix3::zeros(), Matrix3::identity());
    // Errors of force and rate drive velocity and attitude with the sign of +f and +w.
    let (force, rate) = (-b.v_accel, -b.a_gyro);
    if order == Discretisation::FirstOrder {
        return Discrete {
            kinematic: [
                [one + b.rr * dt, b.rv * dt, zero],
                [b.vr * dt, one + b.vv * dt, b.va * dt],
                [b.ar * dt, b.av * dt, one + b.aa * dt],
            ],
            by_force: [zero, force * dt, zero],
            by_rate: [zero, rate * dt],
        };
    }
    let f = [[b.rr, b.rv, zero], [b.vr, b.vv, b.va], [b.ar, b.av, b.aa]];
    let half = 0.5 * dt * dt;
    let kinematic = core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            let squared = f[i][0] * f[0][j] + f[i][1] * f[1][j] + f[i][2] * f[2][j];
            f[i][j] * dt + squared * half + if i == j { one } else { zero }
        })
    });
    Discrete {
        kinematic,
        by_force: [f[0][1] * force * half, force * dt + f[1][1] * force * half, f[2][1] * force * half],
        by_rate: [f[1][2] * rate * half, rate * dt + f[2][2] * rate * half],
    }
}

#[cfg(test)]
mod tests;
