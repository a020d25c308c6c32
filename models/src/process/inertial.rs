//! An inertial unit that drives a process: the declared properties of its sensors, and the correction of its samples.
//!
//! Corrected  w = (w_m − b_g)/(1 + s_g),  f = (f_m − b_a)/(1 + s_a), per axis
//! Vibration  the accelerometers' noise may follow it: `vibration.rs`
//! Turns      the gyros' noise may grow with the rate: N² ← N² + (k |w|)² on every axis
//! Slow input a sample of more than [`LONGEST_STEP`] is integrated in pieces. Only its mean is known, so Q gains the
//!            possible effect of the change from the neighbour's rate and force on attitude and velocity:
//!            (T Δw)²/8, (T Δf)²/8 per axis and sample

use super::kinematic::{Felt, value};
use super::strapdown::discrete::{Slots, times_diagonal};
use super::strapdown::increments;
use super::strapdown::pairing::{Mode, Pairing, neighbour};
use super::vibration::{self, Vibration};
use alloc::boxed::Box;
use fusion_core::linear::Transition;
use fusion_core::math;
use fusion_core::model::{Input, Literal, Preparation, SignalsOut};
use fusion_core::state::{Param, Signal, Tangent, Vector};
use nalgebra::{Matrix3, Vector3};

/// The longest step of one linearisation \[s\]. In it, a turn of 0.5 rad/s is 0.1 rad, and a series for Φ neglects 0.5
/// %. Inertial units run at 50 Hz and more; with slower units the motion between two samples is unknown.
pub const LONGEST_STEP: f64 = 0.2;

/// Numbers of an inertial sample: angular rate, specific force.
pub(super) const IMU: usize = 6;

/// The sensors of the unit, at run time.
#[derive(Debug, Literal)]
pub struct Inertial {
    gyro_bias: Param<Vector<3>>,
    accel_bias: Param<Vector<3>>,
    gyro_scale: Param<Vector<3>>,
    accel_scale: Param<Vector<3>>,
    angular_rate: Signal<Vector<3>>,
    /// The densities of white noise, per axis.
    gyro_psd: Vector3<f64>,
    accel_psd: Vector3<f64>,
    /// Growth of the density of the gyros' noise with the square of the rate.
    gyro_scale_psd: f64,
    /// Which neighbour corrects a sample for coning and sculling.
    correction: Option<Mode>,
    /// The window of vibration \[s\].
    vibration: Option<f64>,
}

/// Corrected rate and force of a step, free of the known errors of the sensors, and their derivatives by bias and
/// scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corrected {
    pub(super) rate: Vector3<f64>,
    gain: Vector3<f64>,
    bias: Vector3<f64>,
}

impl Corrected {
    /// The corrected value of another sample of the sensor.
    #[inline]
    fn also(&self, measured: &[f64]) -> Vector3<f64> {
        (Vector3::new(measured[0], measured[1], measured[2]) - self.bias).component_mul(&self.gain)
    }

    /// ∂/∂bias, a diagonal.
    #[inline]
    fn by_bias(&self) -> Vector3<f64> {
        -self.gain
    }

    /// ∂/∂scale, a diagonal.
    #[inline]
    fn by_scale(&self) -> Vector3<f64> {
        -self.rate.component_mul(&self.gain)
    }
}

/// The error model of a sensor, which corrects its samples.
struct Correction {
    bias: Vector3<f64>,
    gain: Vector3<f64>,
}

impl Correction {
    #[inline]
    fn new(bias: Vector3<f64>, scale: &Vector3<f64>) -> Self {
        // Most sensors have no scale error.
        let gain = if *scale == Vector3::zeros() {
            Vector3::repeat(1.0)
        } else {
            scale.map(|s| 1.0 / (1.0 + s))
        };
        Self { bias, gain }
    }

    /// The output of the sensor for a true `rate`.
    fn measured(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        rate.component_div(&self.gain) + self.bias
    }

    #[inline]
    fn of(self, measured: &[f64]) -> Corrected {
        let mut corrected = Corrected {
            rate: Vector3::zeros(),
            gain: self.gain,
            bias: self.bias,
        };
        corrected.rate = corrected.also(measured);
        corrected
    }
}

impl Inertial {
    pub(super) fn preparation(&self) -> Option<Box<dyn Preparation>> {
        let pairing = self.correction.map(|mode| Box::new(Pairing::new(mode)) as Box<dyn Preparation>);
        match self.vibration {
            Some(window) => Some(Box::new(Vibration::new(window, pairing))),
            None => pairing,
        }
    }

    #[inline]
    fn gyro(&self, x: &[f64]) -> Correction {
        Correction::new(value(&self.gyro_bias, x), &value(&self.gyro_scale, x))
    }

    #[inline]
    fn accelerometer(&self, x: &[f64]) -> Correction {
        Correction::new(value(&self.accel_bias, x), &value(&self.accel_scale, x))
    }

    /// Corrected w_ib_b \[rad/s\] and f_ib_b \[m/s²\] of a sample, without coning and sculling.
    #[inline]
    pub(super) fn corrected(&self, x: &[f64], input: &Input<'_>) -> (Corrected, Corrected) {
        (self.gyro(x).of(&input.sample[..3]), self.accelerometer(x).of(&input.sample[3..IMU]))
    }

    /// The constant rate and force that replace a sample: with coning and sculling, if it has a neighbour.
    pub(super) fn driving(&self, x: &[f64], input: &Input<'_>) -> (Vector3<f64>, Vector3<f64>) {
        self.driven(&self.corrected(x, input), input)
    }

    /// The same from a corrected sample.
    #[inline]
    pub(super) fn driven(&self, (gyro, accelerometer): &(Corrected, Corrected), input: &Input<'_>) -> (Vector3<f64>, Vector3<f64>) {
        let (mut w, mut f) = (gyro.rate, accelerometer.rate);
        let other = self.correction.and_then(|_| neighbour(input, IMU));
        // The first sample of a stream covers no time and does not correct another sample.
        if let Some(other) = other.filter(|other| other.interval > 0.0) {
            let (w2, f2) = (gyro.also(&other.sample[..3]), accelerometer.also(&other.sample[3..IMU]));
            let (we, fe, wl, fl) = if other.is_earlier { (w2, f2, w, f) } else { (w, f, w2, f2) };
            // The intervals may differ; for linear rates this length is exact.
            let pair = 2.0 * input.interval * input.interval / (input.interval + other.interval);
            w += increments::coning_rate(&we, &wl, pair);
            f += increments::sculling_rate(&we, &fe, &wl, &fl, pair);
        }
        (w, f)
    }

    /// Writes Φ of the biases and scales, from the responses to an error of force and of rate.
    #[cfg_attr(not(target_pointer_width = "32"), inline(always))]
    pub(super) fn write_transition<P: Tangent<3>>(
        &self,
        (w, f): &(Corrected, Corrected),
        [by_force, by_rate]: &[[Option<Matrix3<f64>>; 3]; 2],
        slots: &Slots<P>,
        out: &mut Transition,
    ) {
        if let Param::State(slot) = self.accel_bias {
            slots.write_column(slot, by_force, &f.by_bias(), out);
        }
        if let Param::State(slot) = self.accel_scale {
            slots.write_column(slot, by_force, &f.by_scale(), out);
        }
        if let Param::State(slot) = self.gyro_bias {
            slots.write_column(slot, by_rate, &w.by_bias(), out);
        }
        if let Param::State(slot) = self.gyro_scale {
            slots.write_column(slot, by_rate, &w.by_scale(), out);
        }
    }

    /// The densities of the noise of rate and force over a sample in which the body turns by `rate`, per axis.
    #[inline]
    pub(super) fn noise(&self, rate: &Vector3<f64>, input: &Input<'_>) -> (Vector3<f64>, Vector3<f64>) {
        let gyro = self.gyro_psd.add_scalar(self.gyro_scale_psd * rate.norm_squared());
        let shaken = self.vibration.and_then(|_| vibration::density(input));
        let accel = shaken.map_or(self.accel_psd, |density| self.accel_psd.sup(&density));
        if input.interval <= LONGEST_STEP {
            return (gyro, accel);
        }
        let (slow_gyro, slow_accel) = within_sample(input);
        (gyro + slow_gyro, accel + slow_accel)
    }

    /// Rate and force, free of the known errors of the sensors.
    pub(super) fn felt(&self, x: &[f64], input: &Input<'_>) -> Felt {
        let (w, f) = self.corrected(x, input);
        Felt {
            w_ib_b: w.rate,
            f_ib_b: f.rate,
        }
    }

    /// The sample that the sensors measure for true `rate` and `force`.
    pub(super) fn feel(&self, x: &[f64], rate: &Vector3<f64>, force: &Vector3<f64>, sample: &mut [f64]) {
        sample[..3].copy_from_slice(self.gyro(x).measured(rate).as_slice());
        sample[3..IMU].copy_from_slice(self.accelerometer(x).measured(force).as_slice());
    }

    /// Writes the signal `angular_rate`.
    pub(super) fn write_rate(&self, w: &Corrected, out: &mut SignalsOut<'_>) {
        out.set(self.angular_rate, &w.rate);
        if out.wants_jacobian() {
            out.add_quantity(self.angular_rate, &self.gyro_bias, &Matrix3::from_diagonal(&w.by_bias()));
            out.add_quantity(self.angular_rate, &self.gyro_scale, &Matrix3::from_diagonal(&w.by_scale()));
        }
    }

    /// Adds ∂`signal`/∂(bias, scale) of the accelerometers, `by_force` being its derivative by force.
    pub(super) fn add_by_force(&self, signal: Signal<Vector<3>>, by_force: &Matrix3<f64>, f: &Corrected, out: &mut SignalsOut<'_>) {
        out.add_quantity(signal, &self.accel_bias, &times_diagonal(by_force, &f.by_bias()));
        out.add_quantity(signal, &self.accel_scale, &times_diagonal(by_force, &f.by_scale()));
    }
}

/// The density of noise on rate and on force, per axis, for their unknown course within a long sample. If they change
/// by Δ from one sample to the next, their integral is wrong in the middle by ΔT/8 for a steady change and by ΔT/2 for
/// a jump there. A density of T Δ²/8 has a 1σ of ΔT/4 there.
fn within_sample(input: &Input<'_>) -> (Vector3<f64>, Vector3<f64>) {
    let other = neighbour(input, IMU).filter(|other| other.interval > 0.0);
    let density = |from: usize| {
        other.map_or_else(Vector3::zeros, |other| {
            let change = |k: usize| input.sample[from + k] - other.sample[from + k];
            Vector3::from_fn(|k, _| math::powi(change(k), 2) * input.interval / 8.0)
        })
    };
    (density(0), density(3))
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError};
    use crate::param::VectorParam;
    use crate::process::kinematic::psd;
    use crate::units::{Axes, NonNegative, dim, range};
    use crate::vocabulary::state;
    use schemars::JsonSchema;
    use serde::Deserialize;

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
        /// White noise that grows with the rate of turn, in addition to `noise`: on every axis this value times the
        /// magnitude of the rate. For errors of scale, alignment and sampling that differ from turn to turn, which a
        /// constant `scale` does not describe.
        #[serde(default)]
        scale_noise: NonNegative<dim::ScaleNoise>,
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
        /// The window over which vibration is measured: per axis, the noise is then at least the scatter of the force in
        /// it. 0 for constant noise.
        #[serde(default)]
        vibration: NonNegative<dim::Duration>,
    }

    impl Inertial {
        /// Declares the states of the sensors and the signal `angular_rate`.
        pub(crate) fn declare(
            b: &mut Build<'_>,
            gyro: &GyroSpec,
            accelerometer: &AccelerometerSpec,
            correction: Option<Mode>,
        ) -> Result<Self, BuildError> {
            Ok(Self {
                gyro_bias: b.body_param(state::GYRO_BIAS, "gyro.bias", &gyro.bias)?,
                accel_bias: b.body_param(state::ACCEL_BIAS, "accelerometer.bias", &accelerometer.bias)?,
                gyro_scale: b.param_named(state::GYRO_SCALE, "gyro.scale", &gyro.scale)?,
                accel_scale: b.param_named(state::ACCEL_SCALE, "accelerometer.scale", &accelerometer.scale)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                gyro_psd: psd(gyro.noise.si()).diagonal(),
                accel_psd: psd(accelerometer.noise.si()).diagonal(),
                gyro_scale_psd: math::powi(gyro.scale_noise.si(), 2),
                correction,
                vibration: Some(accelerometer.vibration.si()).filter(|window| *window > 0.0),
            })
        }
    }
}
