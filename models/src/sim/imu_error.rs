//! Errors of an inertial measurement unit.
//!
//! Measured   `ω_m = M ω + b + w`, the same for specific force
//! M          I + diag(scale factor) + misalignment off the diagonal, drawn once
//! b          turn-on constant + first-order Gauss-Markov + random walk
//! w          white, sampled: σ = N/√Δt for a density N, Δt the interval of the sample
//! Then       quantised; the remainder is added to the next sample: no angle is lost
//! Numbers    of a preset, 1σ (`consumer` by order of magnitude):
//!
//! | preset       | gyro: bias, Gauss-Markov, noise           | accelerometer: the same                |
//! |--------------|-------------------------------------------|----------------------------------------|
//! | `perfect`    | 0, 0, 0                                   | 0, 0, 0                                |
//! | `hg1700`     | 1 °/h, 0, 0.125 °/√h                      | 1 mg, 0, 0.065 ft/s/√h                 |
//! | `navigation` | 0.01 °/h, 0, 0.002 °/√h                   | 50 µg, 0, 10 µg/√Hz                    |
//! | `consumer`   | 0.2 °/s, 20 °/h over 300 s, 0.3 °/√h      | 20 mg, 0.3 mg over 300 s, 150 µg/√Hz   |
//!
//! Not here   g-sensitivity, temperature, vibration rectification, lock-in and dither of ring lasers
//! Source     Groves 2013, §4.4; data sheet figures of the units named

use super::inverse::Sample;
use super::random::{Markov, Random};
use crate::units::{Axes, NonNegative, Positive, STANDARD_GRAVITY, dim, range};
use fusion_core::math;
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// A known unit to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ImuPreset {
    /// No error at all.
    #[default]
    Perfect,
    /// Tactical, ring laser gyroscopes.
    Hg1700,
    /// Navigation grade.
    Navigation,
    /// Micro-mechanical, as in a telephone.
    Consumer,
}

macro_rules! triad_spec {
    ($(#[$doc:meta])* $Spec:ident, $Drift:ident, $value:ty, $noise:ty, $walk:ty) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $Spec {
            /// Turn-on bias, constant over a run (1σ).
            bias: Option<Axes<$value, range::NonNegative>>,
            /// Slowly varying part of the bias.
            markov: Option<$Drift>,
            /// Random walk of the bias.
            bias_random_walk: Option<Axes<$walk, range::NonNegative>>,
            /// White noise density.
            noise: Option<Axes<$noise, range::NonNegative>>,
            /// Scale factor error, constant over a run (1σ).
            scale_factor: Option<Axes<dim::Ratio, range::NonNegative>>,
            /// White noise of the scale factor: on every axis this times the magnitude of what is measured.
            scale_noise: Option<NonNegative<dim::ScaleNoise>>,
            /// Misalignment of each axis towards each other one, constant over a run (1σ).
            misalignment: Option<Axes<dim::Angle, range::NonNegative>>,
            /// Least step of the output, at the rate of the samples.
            resolution: Option<Axes<$value, range::NonNegative>>,
        }

        /// A first-order Gauss-Markov error.
        #[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        struct $Drift {
            /// Stationary 1σ.
            sigma: Axes<$value, range::NonNegative>,
            /// Correlation time.
            correlation_time: Positive<dim::Duration>,
        }

        impl $Spec {
            fn over(&self, preset: TriadErrors) -> TriadErrors {
                TriadErrors {
                    bias: self.bias.map_or(preset.bias, Axes::si),
                    markov: self.markov.map_or(preset.markov, |m| m.sigma.si()),
                    tau: self.markov.map_or(preset.tau, |m| m.correlation_time.si()),
                    walk: self.bias_random_walk.map_or(preset.walk, Axes::si),
                    noise: self.noise.map_or(preset.noise, Axes::si),
                    scale: self.scale_factor.map_or(preset.scale, Axes::si),
                    scale_noise: self.scale_noise.map_or(preset.scale_noise, |n| n.si()),
                    misalignment: self.misalignment.map_or(preset.misalignment, Axes::si),
                    resolution: self.resolution.map_or(preset.resolution, Axes::si),
                }
            }
        }
    };
}
triad_spec!(
    /// Errors of three gyroscopes: the differences from the preset.
    GyroErrorSpec,
    GyroDriftSpec,
    dim::AngularRate,
    dim::AngleRandomWalk,
    dim::RateRandomWalk
);
triad_spec!(
    /// Errors of three accelerometers: the differences from the preset.
    AccelerometerErrorSpec,
    AccelerometerDriftSpec,
    dim::Acceleration,
    dim::VelocityRandomWalk,
    dim::AccelerationRandomWalk
);

/// The simulated inertial measurement unit.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImuErrorSpec {
    /// Samples per second; at most 1e9 samples in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// The unit to start from: `perfect` (the default), `hg1700`, `navigation` or `consumer`.
    #[serde(default)]
    preset: ImuPreset,
    /// Differences from the preset for the gyroscopes.
    #[serde(default)]
    gyro: GyroErrorSpec,
    /// Differences from the preset for the accelerometers.
    #[serde(default)]
    accelerometer: AccelerometerErrorSpec,
}

/// The sizes of the errors of one triad, per axis, in SI: 1σ of those that are constant, densities of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriadErrors {
    /// Turn-on bias.
    pub bias: [f64; 3],
    /// Stationary 1σ of the slowly varying part of the bias.
    pub markov: [f64; 3],
    /// Correlation time of that part \[s\].
    pub tau: f64,
    /// Density of the random walk of the bias.
    pub walk: [f64; 3],
    /// Density of white noise.
    pub noise: [f64; 3],
    /// Scale factor error.
    pub scale: [f64; 3],
    /// Density of white noise over the magnitude of what is measured, on every axis.
    pub scale_noise: f64,
    /// Misalignment of each axis towards each other one \[rad\].
    pub misalignment: [f64; 3],
    /// Least step of the output; 0 without quantisation.
    pub resolution: [f64; 3],
}

impl TriadErrors {
    fn new(bias: f64, markov: f64, noise: f64) -> Self {
        let none = [0.0; 3];
        let (bias, markov, noise) = ([bias; 3], [markov; 3], [noise; 3]);
        Self {
            bias,
            markov,
            tau: 300.0,
            walk: none,
            noise,
            scale: none,
            scale_noise: 0.0,
            misalignment: none,
            resolution: none,
        }
    }
}

impl ImuPreset {
    /// Gyroscopes, accelerometers.
    fn numbers(self) -> (TriadErrors, TriadErrors) {
        let deg = 1_f64.to_radians();
        let (per_hour, per_root_hour) = (deg / 3600.0, deg / 60.0);
        let mg = 1e-3 * STANDARD_GRAVITY;
        match self {
            Self::Perfect => (TriadErrors::new(0.0, 0.0, 0.0), TriadErrors::new(0.0, 0.0, 0.0)),
            Self::Hg1700 => (
                TriadErrors::new(per_hour, 0.0, 0.125 * per_root_hour),
                TriadErrors::new(mg, 0.0, 0.065 * 0.3048 / 60.0),
            ),
            Self::Navigation => (
                TriadErrors::new(0.01 * per_hour, 0.0, 0.002 * per_root_hour),
                TriadErrors::new(0.05 * mg, 0.0, 0.01 * mg),
            ),
            Self::Consumer => (
                TriadErrors::new(0.2 * deg, 20.0 * per_hour, 0.3 * per_root_hour),
                TriadErrors::new(20.0 * mg, 0.3 * mg, 0.15 * mg),
            ),
        }
    }
}

impl ImuErrorSpec {
    /// The sizes of the errors of the gyroscopes and of the accelerometers.
    #[must_use]
    pub fn errors(&self) -> [TriadErrors; 2] {
        let (gyro, accelerometer) = self.preset.numbers();
        [self.gyro.over(gyro), self.accelerometer.over(accelerometer)]
    }
}

/// Errors of a unit as they run: stateful, seeded.
#[derive(Clone, Debug)]
pub struct ImuError {
    gyro: Triad,
    accelerometer: Triad,
}

impl ImuError {
    /// Draws the errors that are constant over the run with this `seed`.
    #[must_use]
    pub fn new(spec: &ImuErrorSpec, seed: u64) -> Self {
        let [gyro, accelerometer] = spec.errors();
        Self {
            gyro: Triad::new(gyro, seed, "imu/gyro"),
            accelerometer: Triad::new(accelerometer, seed, "imu/accelerometer"),
        }
    }

    /// Advances the errors by `dt` seconds and returns the measurement if `truth` is the mean
    /// over this time.
    #[must_use]
    pub fn measure(&mut self, truth: &Sample, dt: f64) -> Sample {
        Sample {
            rate: self.gyro.measure(&truth.rate, dt),
            force: self.accelerometer.measure(&truth.force, dt),
        }
    }

    /// The scale factor errors.
    #[must_use]
    pub fn scale(&self) -> Sample {
        let of = |triad: &Triad| triad.map.diagonal().add_scalar(-1.0);
        Sample {
            rate: of(&self.gyro),
            force: of(&self.accelerometer),
        }
    }

    /// The biases of the last sample.
    #[must_use]
    pub fn bias(&self) -> Sample {
        Sample {
            rate: self.gyro.bias(),
            force: self.accelerometer.bias(),
        }
    }
}

#[derive(Clone, Debug)]
struct Triad {
    numbers: TriadErrors,
    /// The last interval \[s\], and its root.
    step: (f64, f64),
    constant: Vector3<f64>,
    markov: Markov,
    walk: Vector3<f64>,
    map: Matrix3<f64>,
    /// The remainder of quantisation that is not output yet, times seconds.
    rest: Vector3<f64>,
    walking: Random,
    white: Random,
    turning: Random,
}

impl Triad {
    fn new(numbers: TriadErrors, seed: u64, name: &str) -> Self {
        let random = |part: &str| Random::new(seed, &format!("{name}/{part}"));
        let (mut turn_on, mut mounting) = (random("bias"), random("mounting"));
        let constant = Vector3::from_fn(|i, _| numbers.bias[i] * turn_on.normal());
        let map = Matrix3::from_fn(|i, j| {
            let draw = mounting.normal();
            if i == j {
                1.0 + numbers.scale[i] * draw
            } else {
                numbers.misalignment[i] * draw
            }
        });
        Self {
            constant,
            markov: Markov::new(numbers.markov.to_vec(), numbers.tau, random("markov")),
            walk: Vector3::zeros(),
            map,
            rest: Vector3::zeros(),
            walking: random("walk"),
            white: random("white"),
            turning: random("scale_noise"),
            step: (0.0, 0.0),
            numbers,
        }
    }

    fn bias(&self) -> Vector3<f64> {
        // Number by number: numbers that were just written one by one are slow to read as a whole.
        let slow = self.markov.state();
        Vector3::from_fn(|i, _| self.constant[i] + slow[i] + self.walk[i])
    }

    /// An error of size 0 is not drawn. Every purpose has its own generator, so no other draw changes.
    fn measure(&mut self, truth: &Vector3<f64>, dt: f64) -> Vector3<f64> {
        if self.step.0 != dt {
            self.step = (dt, math::sqrt(dt));
        }
        let root = self.step.1;
        let TriadErrors {
            walk,
            noise,
            scale_noise,
            resolution,
            ..
        } = &self.numbers;
        self.markov.advance(dt);
        if *walk != [0.0; 3] {
            self.walk += Vector3::from(walk.map(|walk| walk * root * self.walking.normal()));
        }
        let mut measured = self.map * truth + self.bias();
        if *noise != [0.0; 3] {
            measured += Vector3::from(noise.map(|noise| noise / root * self.white.normal()));
        }
        if *scale_noise > 0.0 {
            let sigma = scale_noise * truth.norm() / root;
            measured += Vector3::from_fn(|_, _| sigma * self.turning.normal());
        }
        for (i, step) in resolution.iter().enumerate().filter(|(_, step)| **step > 0.0) {
            let wanted = measured[i] + self.rest[i] / dt;
            measured[i] = math::round(wanted / step) * step;
            self.rest[i] = (wanted - measured[i]) * dt;
        }
        measured
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(text: &str) -> ImuErrorSpec {
        toml::from_str(text).unwrap()
    }

    /// Mean and standard deviation of the x axes of rate and force over `n` samples at 100 Hz.
    fn statistics(imu: &mut ImuError, truth: &Sample, n: u32) -> [(f64, f64); 2] {
        let mut sums = [(0.0, 0.0); 2];
        for _ in 0..n {
            let m = imu.measure(truth, 0.01);
            for (sum, d) in sums.iter_mut().zip([m.rate.x - truth.rate.x, m.force.x - truth.force.x]) {
                *sum = (sum.0 + d, sum.1 + d * d);
            }
        }
        sums.map(|(s, ss)| {
            let mean = s / f64::from(n);
            (mean, (ss / f64::from(n) - mean * mean).sqrt())
        })
    }

    #[test]
    fn white_noise_at_100_hz_has_the_tabulated_sigma() {
        let mut imu = ImuError::new(
            &spec(
                r#"rate = "100 Hz"
preset = "hg1700""#,
            ),
            1,
        );
        let [gyro, accelerometer] = statistics(&mut imu, &Sample::default(), 100_000);
        // 1 %: 1/√(2n) = 0.22 % of 1σ, and 0.2 % of digits in the table.
        assert!((gyro.1.to_degrees() / 0.0208 - 1.0).abs() < 0.01, "{}", gyro.1.to_degrees());
        assert!((accelerometer.1 / 3.302e-3 - 1.0).abs() < 0.01, "{}", accelerometer.1);
        // 5 σ/√n about the bias.
        assert!((gyro.0 - imu.bias().rate.x).abs() < 5.0 * gyro.1 / 316.0);
        assert!((accelerometer.0 - imu.bias().force.x).abs() < 5.0 * accelerometer.1 / 316.0);
    }

    #[test]
    fn turn_on_biases_over_many_seeds_have_the_sigma_of_the_preset() {
        let spec = spec(
            r#"rate = 100
preset = "hg1700""#,
        );
        let (mut gyro, mut accelerometer) = (0.0, 0.0);
        for seed in 0..2000 {
            let bias = ImuError::new(&spec, seed).bias();
            gyro += bias.rate.norm_squared() / 6000.0;
            accelerometer += bias.force.norm_squared() / 6000.0;
        }
        // 5 %: 1/√(2·6000) = 0.9 % of 1σ.
        assert!((gyro.sqrt() / 4.848e-6 - 1.0).abs() < 0.05, "{}", gyro.sqrt());
        assert!((accelerometer.sqrt() / 9.80665e-3 - 1.0).abs() < 0.05, "{}", accelerometer.sqrt());
    }

    #[test]
    fn perfect_is_perfect_and_an_override_wins_over_the_preset() {
        let truth = Sample {
            rate: Vector3::new(0.1, -0.2, 0.3),
            force: Vector3::new(0.5, 1.0, -9.8),
        };
        let mut perfect = ImuError::new(&spec("rate = 100"), 1);
        assert_eq!(perfect.measure(&truth, 0.01), truth);
        let text = r#"rate = 100
preset = "consumer"
gyro = { bias = 0, noise = 0, markov = { sigma = 0, correlation_time = 1 } }"#;
        let measured = ImuError::new(&spec(text), 1).measure(&truth, 0.01);
        assert_eq!(measured.rate, truth.rate);
        assert_ne!(measured.force, truth.force);
    }

    #[test]
    fn scale_factor_and_misalignment_multiply_and_quantisation_loses_no_angle() {
        let truth = Sample {
            rate: Vector3::new(0.1, 0.0, 0.0),
            ..Sample::default()
        };
        let text = r#"rate = 100
gyro = { scale_factor = "300 ppm", misalignment = "1 mrad" }"#;
        let measured = ImuError::new(&spec(text), 4).measure(&truth, 0.01).rate;
        // 5 σ; and all three present.
        assert!((measured.x - 0.1).abs() < 5.0 * 3e-5 && measured.x != 0.1);
        assert!(measured.y.abs() < 5e-4 && measured.y != 0.0 && measured.z != 0.0);

        let mut coarse = ImuError::new(&spec("rate = 100\ngyro = { resolution = 0.03 }"), 1);
        let sum: f64 = (0..1000).map(|_| coarse.measure(&truth, 0.01).rate.x * 0.01).sum();
        // Half a step of one sample: the rest is carried.
        assert!((sum - 1.0).abs() <= 0.5 * 0.03 * 0.01 + 1e-12, "{sum}");
        let steps = coarse.measure(&truth, 0.01).rate.x / 0.03;
        assert!((steps - steps.round()).abs() < 1e-12);
    }

    #[test]
    fn noise_of_the_scale_factor_grows_with_the_rate_on_every_axis() {
        let of = |rate: f64| {
            let mut imu = ImuError::new(&spec("rate = 100\ngyro = { noise = 0, scale_noise = 0.01 }"), 3);
            let truth = Sample {
                rate: Vector3::new(0.0, rate, 0.0),
                ..Sample::default()
            };
            statistics(&mut imu, &truth, 20_000)[0].1
        };
        // 0.01 √s · 2 rad/s over √0.01 s, on an axis across; 5 σ of 20 000 samples are 2.5 %.
        assert!((of(2.0) / 0.2 - 1.0).abs() < 0.025, "{}", of(2.0));
        assert_eq!(of(0.0), 0.0);
    }

    #[test]
    fn a_random_walk_bias_spreads_with_the_root_of_time() {
        let spec = spec("rate = 100\naccelerometer = { bias_random_walk = 0.1 }");
        let mut square = 0.0;
        for seed in 0..500 {
            let mut imu = ImuError::new(&spec, seed);
            for _ in 0..25 {
                let _ = imu.measure(&Sample::default(), 1.0);
            }
            square += imu.bias().force.norm_squared() / 1500.0;
        }
        // 0.1·√25 = 0.5; 10 %: 1/√3000 = 1.8 % of 1σ.
        assert!((square.sqrt() / 0.5 - 1.0).abs() < 0.1, "{}", square.sqrt());
    }
}
