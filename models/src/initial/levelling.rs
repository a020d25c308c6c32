//! Static levelling, and gyrocompassing if the gyros are accurate enough.
//!
//! Levelling  roll = atan2(−f_y, −f_z),  pitch = atan2(f_x, √(f_y² + f_z²)) of the mean f at rest
//! Gyro bias  the mean rate at rest (minus the Earth's rate if the heading is known)
//! Compassing ω_x' = ω_x cθ + ω_y sφ sθ + ω_z cφ sθ,  ω_y' = ω_y cφ − ω_z sφ,
//!            ψ = atan2(−ω_y', ω_x')
//! Tilt 1σ    σ² = `tilt_sigma`² + s²/|f|², s the 1σ, across f, of the mean forces of eighths of the rest: vibration
//!            averages out, the acceleration of a moving vehicle does not
//! Bias 1σ    σ² = `gyro_bias_sigma`² + s², s the 1σ of the mean rates of eighths of the rest, if the noise of samples
//!            hardly causes such an s: a vehicle that turns slowly within that noise passes the rest test
//! Predicted  σ_ψ² = (σ_g² + N_g²/T)/(Ω cos φ)² + ((σ_a/g) tan φ)²
//! Kept       after the vehicle moves, the gyros carry the attitude to the start
//! Valid      at rest, |latitude| < 80° for compassing
//! Source     Groves 2013, §5.6; Titterton and Weston 2004, §10.3; the bound of a χ²: Laurent and Massart 2000, lemma 1

use super::write_attitude;
use crate::stage::still::StillTest;
use crate::vocabulary::state;
use alloc::string::String;
use fusion_core::belief::Belief;
use fusion_core::geometry::{so3, wgs84};
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::memory::{Memory, Tape};
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Layout, Manifold, Vector};
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Roll and pitch \[rad\] from a specific force at rest.
#[must_use]
pub fn level(f: &Vector3<f64>) -> (f64, f64) {
    (math::atan2(-f.y, -f.z), math::atan2(f.x, math::hypot(f.y, f.z)))
}

/// Heading \[rad\] from the mean angular rate at rest, given roll and pitch.
#[must_use]
pub fn gyrocompass(w: &Vector3<f64>, roll: f64, pitch: f64) -> f64 {
    let (sr, cr) = math::sin_cos(roll);
    let (sp, cp) = math::sin_cos(pitch);
    let x = w.x * cp + w.y * sr * sp + w.z * cr * sp;
    let y = w.y * cr - w.z * sr;
    math::atan2(-y, x)
}

/// 1σ of gyrocompassing \[rad\] over `duration` \[s\] at latitude `lat` \[rad\].
#[must_use]
pub fn predicted_heading_sigma(gyro_bias: f64, gyro_noise: f64, accel_bias: f64, duration: f64, lat: f64) -> f64 {
    let horizontal = wgs84::EARTH_RATE * math::cos(lat);
    let gyro = math::sqrt(gyro_bias * gyro_bias + gyro_noise * gyro_noise / duration) / horizontal;
    math::hypot(gyro, accel_bias / 9.81 * math::tan(lat))
}

/// The 1σ of the heading by gyrocompassing, and the latitude \[rad\].
#[derive(Clone, Copy, Debug, Literal)]
pub struct Compass {
    sigma: f64,
    lat: f64,
}

/// Parts of the rest whose mean forces and rates are compared.
const PARTS: f64 = 8.0;
/// −ln of the probability that noise alone makes the mean rates of parts scatter so much: one in a million.
const CHANCE: f64 = 13.8;

/// Sums over one period of rest.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Rest {
    since: Option<Time>,
    count: f64,
    w: Vector3<f64>,
    f: Vector3<f64>,
    parts: Parts,
    turns: Parts,
    /// The sum of the squared steps from each rate to the next.
    steps: Vector3<f64>,
    last: Vector3<f64>,
}
memory!(Rest {
    since,
    count,
    w,
    f,
    parts,
    turns,
    steps,
    last
});

impl Rest {
    fn add(&mut self, w: &Vector3<f64>, f: &Vector3<f64>, share: f64) {
        if self.count > 0.0 {
            let step = w - self.last;
            self.steps += step.component_mul(&step);
        }
        self.last = *w;
        self.turns.add(w, share);
        self.count += 1.0;
        self.w += w;
        self.f += f;
        self.parts.add(f, share);
    }

    /// The 1σ of the mean rates of the parts \[rad/s\], per axis; zero where noise explains it.
    fn turning(&self) -> Vector3<f64> {
        let freedom = (self.turns.complete - 1.0).max(1.0);
        let explained = 1.0 + 2.0 * math::sqrt(CHANCE / freedom) + 2.0 * CHANCE / freedom;
        // White samples step by √2 of their 1σ.
        let of_part = 0.5 * self.turns.complete / (self.count * (self.count - 1.0).max(1.0));
        Vector3::from_fn(|axis, _| {
            let variance = self.turns.squares[(axis, axis)] / freedom;
            if variance > explained * of_part * self.steps[axis] {
                math::sqrt(variance)
            } else {
                0.0
            }
        })
    }
}

/// Mean and scatter of the means of equal parts of a rest.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Parts {
    /// Sums of the current part.
    count: f64,
    sum: Vector3<f64>,
    /// The complete parts: their number, their mean, and the sum of squared deviations from it.
    complete: f64,
    mean: Vector3<f64>,
    squares: Matrix3<f64>,
}
memory!(Parts {
    count,
    sum,
    complete,
    mean,
    squares
});

impl Parts {
    /// Adds a force or a rate when `share` of the rest has passed.
    fn add(&mut self, f: &Vector3<f64>, share: f64) {
        self.count += 1.0;
        self.sum += f;
        if share * PARTS >= self.complete + 1.0 {
            let part = self.sum / self.count;
            self.complete += 1.0;
            let before = part - self.mean;
            self.mean += before / self.complete;
            self.squares += before * (part - self.mean).transpose();
            (self.count, self.sum) = (0.0, Vector3::zeros());
        }
    }

    /// The uncertainty of the direction of the mean force \[rad\]: 1σ of a part across it.
    fn wander(&self, f: &Vector3<f64>) -> f64 {
        let across = Matrix3::identity() - f * f.transpose() / f.norm_squared();
        let variance = (across * self.squares * across).trace() / (self.complete - 1.0).max(1.0);
        // Two axes share the variance.
        math::sqrt((0.5 * variance).max(0.0)) / f.norm()
    }
}

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct Levelling {
    test: Option<StillTest>,
    duration: f64,
    tilt_sigma: f64,
    gyro_bias_sigma: Option<[f64; 3]>,
    compass: Option<Compass>,
    rest: Rest,
    found: Option<(UnitQuaternion<f64>, Vector3<f64>)>,
    /// 1σ of tilt \[rad\] from the wandering force in the rest that was found.
    wander: f64,
    /// 1σ of the gyro bias \[rad/s\] from a slow turn in that rest.
    turning: Vector3<f64>,
    last: Option<Time>,
    /// The longest rest so far \[s\].
    longest: f64,
}

impl Memory for Levelling {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(test) = &mut self.test {
            test.remember(tape);
        }
        self.rest.remember(tape);
        self.found.remember(tape);
        self.wander.remember(tape);
        self.turning.remember(tape);
        self.last.remember(tape);
        self.longest.remember(tape);
    }
}

impl Levelling {
    fn solve(&mut self) {
        let (w, f) = (self.rest.w / self.rest.count, self.rest.f / self.rest.count);
        let (roll, pitch) = level(&f);
        let yaw = self.compass.map_or(0.0, |_| gyrocompass(&w, roll, pitch));
        let q = so3::from_rpy(roll, pitch, yaw);
        let earth = self.compass.map_or_else(Vector3::zeros, |c| {
            q.inverse() * Vector3::new(math::cos(c.lat), 0.0, -math::sin(c.lat)) * wgs84::EARTH_RATE
        });
        self.found = Some((q, w - earth));
        self.wander = self.rest.parts.wander(&f);
        self.turning = self.rest.turning();
    }
}

impl Initialiser for Levelling {
    fn row(&mut self, _: usize, time: Time, row: &[f64]) {
        let (w, f) = (Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
        if let Some(test) = &mut self.test {
            test.push(time.seconds(), w, f);
        }
        let dt = self.last.map_or(0.0, |last| time.seconds_since(last));
        self.last = Some(time);
        // The bias is unknown before the first rest, and changes little after it.
        let bias = self.found.map_or_else(Vector3::zeros, |(_, bias)| bias);
        if self.test.as_mut().map_or(self.found.is_none(), |test| test.is_still(&bias)) {
            if self.rest.since.is_none() {
                self.rest = Rest {
                    since: Some(time),
                    ..Rest::default()
                };
            }
            let lasted = self.rest.since.map_or(0.0, |since| time.seconds_since(since));
            self.longest = self.longest.max(lasted);
            self.rest.add(&w, &f, lasted / self.duration);
            if lasted >= self.duration {
                self.solve();
                return;
            }
        } else {
            self.rest.since = None;
        }
        if let Some((q, bias)) = &mut self.found {
            *q *= so3::exp(&((w - *bias) * dt));
        }
    }

    fn waits_for(&self) -> Option<String> {
        self.found.is_none().then(|| {
            let rest = format!("{} s at rest, to level", self.duration);
            let Some(test) = &self.test else { return rest };
            let [gyro, accel, mean] = test.unrest(&Vector3::zeros());
            let lately = match gyro.max(accel).max(mean) > 1.0 {
                true if mean > 1.0 => format!(
                    "; lately the rate shakes by {gyro:.1}, the force by {accel:.1}, and the mean rate is {mean:.1} of what `still` allows"
                ),
                true => format!("; lately the rate shakes by {gyro:.1} and the force by {accel:.1} of what `still` allows"),
                false => String::new(),
            };
            let so_far = match test.missed() {
                Some(missed) => format!("; {missed}"),
                None if self.longest > 0.0 => format!("; the longest rest so far lasted {:.1} s", self.longest),
                None => String::new(),
            };
            format!("{rest}{lately}{so_far}")
        })
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        let Some((q, bias)) = &self.found else { return };
        let yaw = self.compass.map_or(core::f64::consts::PI, |c| c.sigma);
        let tilt = math::hypot(self.tilt_sigma, self.wander);
        write_attitude(layout, belief, q, &[tilt, tilt, yaw]);
        if let (Some(sigma), Some(b)) = (&self.gyro_bias_sigma, layout.block(state::GYRO_BIAS)) {
            Vector::<3>::write(bias, &mut belief.x[b.storage_range()]);
            let sigma: [f64; 3] = core::array::from_fn(|axis| math::hypot(sigma[axis], self.turning[axis]));
            belief.covariance.set_sigmas(b, &sigma);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, InitialiserSpec, Listen, imu_channels};
    use crate::de::DeserializeSpec;
    use crate::stage::still::StillSpec;
    use crate::units::{Axes, NonNegative, Positive, dim, range};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Roll and pitch from the specific force at rest, the gyro bias from the rate at rest, and with `gyrocompass` the
    /// heading from the Earth's rotation.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct LevellingSpec {
        /// The IMU stream.
        source: String,
        /// How long the vehicle must stand still.
        duration: Positive<dim::Duration>,
        /// Limits of the rest test; without them the vehicle is assumed to be at rest from the first row on.
        still: Option<StillSpec>,
        /// 1σ of roll and pitch: accelerometer bias over gravity. It grows if the force wandered during the averaging.
        tilt_sigma: NonNegative<dim::Angle>,
        /// 1σ of the gyro bias found at rest; sets the state `gyro_bias`.
        gyro_bias_sigma: Option<Axes<dim::AngularRate, range::NonNegative>>,
        /// Heading from the Earth's rotation, for gyros that are accurate enough.
        gyrocompass: Option<GyrocompassSpec>,
    }

    /// Gyrocompassing: rejected if its predicted error is too large.
    #[derive(Clone, Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct GyrocompassSpec {
        /// 1σ of the gyro bias, turn-on to turn-on.
        gyro_bias: NonNegative<dim::AngularRate>,
        /// Angle random walk of the gyros.
        gyro_noise: NonNegative<dim::AngleRandomWalk>,
        /// 1σ of the accelerometer bias.
        accel_bias: NonNegative<dim::Acceleration>,
        /// The largest predicted 1σ that is accepted.
        max_sigma: Positive<dim::Angle>,
        /// Latitude; by default the latitude of the origin.
        latitude: Option<crate::units::Angle>,
    }

    crate::register!(
        Initialiser,
        "levelling",
        LevellingSpec,
        r#"
source = "imu"
duration = "5 s"
still = { accel_std = "0.2 m/s^2", gyro_std = "1 deg/s" }
tilt_sigma = "0.5 deg"
gyro_bias_sigma = "0.05 deg/s"
"#
    );

    #[typetag::deserialize(name = "levelling")]
    impl InitialiserSpec for LevellingSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: imu_channels(),
            }]
        }

        fn writes(&self) -> Vec<&'static str> {
            let mut blocks = vec![state::ATTITUDE.as_str()];
            if self.gyro_bias_sigma.is_some() {
                blocks.push(state::GYRO_BIAS.as_str());
            }
            blocks
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            let compass = match &self.gyrocompass {
                None => None,
                Some(g) => Some(self.compass(g, b)?),
            };
            Ok(Box::new(Levelling {
                test: self.still.as_ref().map(StillTest::new),
                duration: self.duration.si(),
                tilt_sigma: self.tilt_sigma.si(),
                gyro_bias_sigma: self.gyro_bias_sigma.map(Axes::si),
                compass,
                rest: Rest::default(),
                found: None,
                wander: 0.0,
                turning: Vector3::zeros(),
                last: None,
                longest: 0.0,
            }))
        }
    }

    impl LevellingSpec {
        fn compass(&self, g: &GyrocompassSpec, b: &Build<'_>) -> Result<Compass, BuildError> {
            let lat = match g.latitude {
                Some(lat) => lat.si(),
                None => b.origin()?.lat,
            };
            if lat.abs() > 80_f64.to_radians() {
                let message = "gyrocompassing fails within 10° of a pole: the Earth's rotation is vertical there";
                return Err(BuildError::at("gyrocompass", message).help("take the heading from a compass or from a GNSS course"));
            }
            let sigma = predicted_heading_sigma(g.gyro_bias.si(), g.gyro_noise.si(), g.accel_bias.si(), self.duration.si(), lat);
            if sigma > g.max_sigma.si() {
                let message = format!(
                    "gyrocompassing would have a 1σ of {:.2}° here, more than the {:.2}° allowed",
                    sigma.to_degrees(),
                    g.max_sigma.si().to_degrees()
                );
                let help = "level for longer, take the heading from a compass or a GNSS course, or allow more";
                return Err(BuildError::at("gyrocompass.max_sigma", message).help(help));
            }
            Ok(Compass { sigma, lat })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::Build;
    use crate::stage::still::StillSpec;
    use fusion_core::testing::Lcg;

    type V = Vector3<f64>;

    const G: f64 = 9.8;
    const LAT: f64 = 36.1 * core::f64::consts::PI / 180.0;
    const DEG_PER_HOUR: f64 = core::f64::consts::PI / 180.0 / 3600.0;

    /// Rate and specific force of a body at rest.
    fn at_rest(q: &UnitQuaternion<f64>, lat: f64) -> (V, V) {
        let earth = V::new(lat.cos(), 0.0, -lat.sin()) * wgs84::EARTH_RATE;
        (q.inverse() * earth, q.inverse() * V::new(0.0, 0.0, -G))
    }

    #[test]
    fn exact_inputs_return_roll_pitch_and_heading_to_1e_minus_12() {
        for lat in [-1.2, -0.3, 0.0, LAT] {
            for roll in [-3.0, -0.5, 0.0, 0.1, 2.0] {
                for pitch in [-1.2, -0.2, 0.0, 0.7] {
                    for yaw in [-3.1, -1.0, 0.0, 2.0] {
                        let (w, f) = at_rest(&so3::from_rpy(roll, pitch, yaw), lat);
                        let (r, p) = level(&f);
                        // 1e-12: the arithmetic of a few trigonometric functions, divided by cos(1.2)² = 0.13.
                        assert!((r - roll).abs() < 1e-12 && (p - pitch).abs() < 1e-12, "{roll} {pitch} {yaw}");
                        assert!((gyrocompass(&w, r, p) - yaw).abs() < 1e-12, "{lat} {roll} {pitch} {yaw}");
                    }
                }
            }
        }
    }

    /// Roll, pitch and heading found at 36.1° north, level and heading north \[deg\], with these
    /// errors of rate and force.
    fn found(w_error: &V, f_error: &V) -> V {
        let (w, f) = at_rest(&UnitQuaternion::identity(), LAT);
        let (roll, pitch) = level(&(f + f_error));
        V::new(roll, pitch, gyrocompass(&(w + w_error), roll, pitch)).map(f64::to_degrees)
    }

    #[test]
    fn levelling_with_1_mg_errs_by_0_057_deg() {
        let errors = found(&V::zeros(), &V::new(1e-3 * G, 1e-3 * G, 0.0));
        // 5e-4: half of the last digit printed. δroll = −∇_y/g, δpitch = ∇_x/g.
        assert!((errors.x + 0.057).abs() < 5e-4 && (errors.y - 0.057).abs() < 5e-4, "{errors}");
    }

    #[test]
    fn gyrocompassing_errs_by_minus_the_east_gyro_bias_over_the_horizontal_earth_rate() {
        let error = |deg_per_hour: f64| found(&V::new(0.0, deg_per_hour * DEG_PER_HOUR, 0.0), &V::zeros()).z;
        // 5e-4: half of the last digit printed.
        assert!((error(0.01) + 0.047).abs() < 5e-4, "{}", error(0.01));
        // 0.011° below the linear 4.71°: the arctangent's third order, (ε/Ω cos φ)³/3.
        assert!((error(1.0) + 4.71 - 0.011).abs() < 5e-3, "{}", error(1.0));
        let predicted = |bias: f64| predicted_heading_sigma(bias * DEG_PER_HOUR, 0.0, 0.0, 120.0, LAT).to_degrees();
        assert!((predicted(0.01) - 0.047).abs() < 5e-4 && (predicted(1.0) - 4.71).abs() < 5e-3);
    }

    #[test]
    fn gyrocompassing_errs_by_the_east_accelerometer_bias_times_the_tangent_of_latitude() {
        let error = found(&V::zeros(), &V::new(0.0, 1e-3 * G, 0.0)).z;
        let linear = (1e-3 * LAT.tan()).to_degrees();
        // 1e-6 of it: squares of 1e-3 rad.
        assert!((error / linear - 1.0).abs() < 1e-5, "{error} {linear}");
        // 0.1 %: the prediction takes 9.81 m/s² for g.
        assert!((predicted_heading_sigma(0.0, 0.0, 1e-3 * G, 120.0, LAT).to_degrees() / linear - 1.0).abs() < 1.1e-3);
    }

    #[test]
    fn gyrocompassing_with_0_125_deg_per_root_h_over_120_s_errs_by_3_2_deg() {
        let noise = 0.125 * DEG_PER_HOUR * 60.0;
        let predicted = predicted_heading_sigma(0.0, noise, 0.0, 120.0, LAT).to_degrees();
        assert!((predicted - 3.2).abs() < 0.05, "{predicted}"); // half of the last digit
        let still: StillSpec = toml::from_str("window = 2\naccel_std = 1\ngyro_std = 1").unwrap();
        let (w, f) = at_rest(&UnitQuaternion::identity(), LAT);
        let (runs, dt) = (400, 0.1_f64);
        let square: f64 = (0..runs)
            .map(|seed| {
                let mut random = Lcg::new(seed);
                let mut levelling = Levelling {
                    test: Some(StillTest::new(&still)),
                    duration: 120.0,
                    tilt_sigma: 0.0,
                    gyro_bias_sigma: None,
                    compass: Some(Compass { sigma: 0.0, lat: LAT }),
                    rest: Rest::default(),
                    found: None,
                    wander: 0.0,
                    turning: Vector3::zeros(),
                    last: None,
                    longest: 0.0,
                };
                let mut k = 0;
                while levelling.found.is_none() {
                    let white = V::from_fn(|_, _| random.normal()) * (noise / dt.sqrt());
                    let w = w + white;
                    levelling.row(0, Time::from_seconds(f64::from(k) * dt), &[w.x, w.y, w.z, f.x, f.y, f.z]);
                    k += 1;
                }
                let (q, _) = levelling.found.unwrap();
                so3::to_rpy(&q).z.to_degrees().powi(2)
            })
            .sum();
        let sigma = (square / runs as f64).sqrt();
        // 12 %: 1/√(2·400) = 3.5 % of 1σ, and 1.5 % of digits.
        assert!((sigma / 3.2 - 1.0).abs() < 0.12, "{sigma}");
    }

    /// Levelling over `duration` without a rest test.
    fn unbounded(duration: f64) -> Levelling {
        Levelling {
            test: None,
            duration,
            tilt_sigma: 0.01,
            gyro_bias_sigma: None,
            compass: None,
            rest: Rest::default(),
            found: None,
            wander: 0.0,
            turning: Vector3::zeros(),
            last: None,
            longest: 0.0,
        }
    }

    #[test]
    fn the_1_sigma_of_tilt_grows_by_what_the_force_wandered_and_not_by_vibration() {
        let wander = |force: &dyn Fn(f64) -> f64| {
            let mut levelling = unbounded(4.0);
            (0..=400).for_each(|k| {
                let t = f64::from(k) * 0.01;
                levelling.row(0, Time::from_seconds(t), &[0.0, 0.0, 0.0, force(t), 0.0, -G]);
            });
            assert!(levelling.found.is_some());
            levelling.wander
        };
        assert_eq!(wander(&|_| 0.3), 0.0, "at rest");
        // 1 m/s² at 31 Hz: an eighth of 0.5 s holds 15.5 periods, of which half a period remains: 1/31π of it.
        let vibration = wander(&|t| (31.0 * core::f64::consts::TAU * t).sin());
        assert!(vibration < 2e-3, "{vibration}");
        // Starting after 2 s with 2 m/s²: means of 0 and 2, 1σ 1.07 m/s² on one of two axes.
        let driving = wander(&|t| if t > 2.0 { 2.0 } else { 0.0 });
        let expected = (8.0_f64 / 7.0 / 2.0).sqrt() / (G * G + 1.0).sqrt();
        // 3 %: the axis across the mean force, which leans by 0.1 rad, and the sample between the halves.
        assert!((driving / expected - 1.0).abs() < 0.03, "{driving} {expected}");
    }

    #[test]
    fn the_1_sigma_of_the_bias_grows_by_a_slow_turn_and_not_by_noise() {
        // Four seconds at 100 Hz with white noise of 0.03 rad/s: a turn of 0.05 rad/s is hardly above it.
        let turning = |seed: u64, rate: &dyn Fn(f64) -> f64| {
            let (mut levelling, mut random) = (unbounded(4.0), Lcg::new(seed));
            (0..=400).for_each(|k| {
                let t = f64::from(k) * 0.01;
                let [x, y, z] = core::array::from_fn(|_| 0.03 * random.normal());
                levelling.row(0, Time::from_seconds(t), &[x, y, z + rate(t), 0.0, 0.0, -G]);
            });
            assert!(levelling.found.is_some());
            levelling.turning
        };
        // One in a million for each axis: 600 draws have none.
        assert!((0..200).all(|seed| turning(seed, &|_| 0.01) == V::zeros()));
        // From 3 s on: means of 0 and 0.05 in six and two of eight parts, 1σ 0.0231 rad/s, with noise of 0.004 rad/s.
        let found = turning(1, &|t| if t > 3.0 { 0.05 } else { 0.0 });
        assert!(found.x == 0.0 && found.y == 0.0 && (found.z - 0.0231).abs() < 0.008, "{found}");
    }

    #[test]
    fn a_force_that_grows_along_itself_is_no_wander() {
        let mut levelling = unbounded(4.0);
        // A lift that starts up after 2 s.
        for k in 0..=400 {
            let up = if k > 200 { G + 2.0 } else { G };
            levelling.row(0, Time::from_seconds(f64::from(k) * 0.01), &[0.0, 0.0, 0.0, 0.0, 0.0, -up]);
        }
        assert!(levelling.found.is_some());
        assert_eq!(levelling.wander, 0.0);
    }

    #[test]
    fn what_is_written_has_the_1_sigma_of_tilt_and_of_the_wander_and_no_heading() {
        let mut layout = fusion_core::state::LayoutBuilder::new();
        let mut b = Build {
            name: "process",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        let moved = fusion_core::state::Dynamics::Process;
        b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), vec![0.0; 3], moved)
            .unwrap();
        let layout = layout.finish();
        let form = fusion_core::filter::Backend::default().form.form();
        let mut belief = Belief::initial(&layout, &form, Time::default());
        let mut levelling = unbounded(4.0);
        for k in 0..=400 {
            let forward = if k > 200 { 0.2 } else { 0.0 };
            levelling.row(0, Time::from_seconds(f64::from(k) * 0.01), &[0.0, 0.0, 0.0, forward, 0.0, -G]);
        }
        levelling.write(Time::default(), &layout, &mut belief);
        let variance = belief.covariance.marginal::<3>(&layout.blocks()[0]).diagonal();
        // See `the_1_sigma_of_tilt_grows…`. The wander is close to the declared 0.01 rad, so that both are visible in
        // the sum.
        assert!((0.005..0.02).contains(&levelling.wander), "{}", levelling.wander);
        let tilt = 0.01_f64.powi(2) + levelling.wander.powi(2);
        let expected = V::new(tilt, tilt, core::f64::consts::PI.powi(2));
        // 4 ε: the square of a root.
        assert!(
            (variance - expected).component_div(&expected).amax() < 4.0 * f64::EPSILON,
            "{variance} {expected}"
        );
    }

    #[test]
    fn a_rest_that_is_interrupted_begins_anew() {
        let still: StillSpec = toml::from_str("window = 0.2\naccel_std = 0.1\ngyro_std = 0.01").unwrap();
        let mut levelling = unbounded(2.0);
        levelling.test = Some(StillTest::new(&still));
        let found = (0..1000).find(|k| {
            let t = f64::from(*k) * 0.01;
            // Shaken from 1.5 s to 2 s.
            let shake = if (150..200).contains(k) { f64::from(k % 2) } else { 0.0 };
            levelling.row(0, Time::from_seconds(t), &[0.0, 0.0, 0.0, shake, 0.0, -G]);
            levelling.found.is_some()
        });
        // 2 s after the last shake has left the window of 0.2 s.
        let wanted = 420;
        assert!(found.is_some_and(|k| (wanted - 2..=wanted + 1).contains(&k)), "{found:?}");
    }

    #[test]
    fn what_keeps_it_from_levelling_is_said_in_shares_of_the_bounds() {
        let still: StillSpec = toml::from_str("accel_std = 0.1\ngyro_std = 0.01").unwrap();
        let mut levelling = unbounded(2.0);
        levelling.test = Some(StillTest::new(&still));
        assert_eq!(levelling.waits_for().unwrap(), "2 s at rest, to level");
        for k in 0..200 {
            let shake = if k % 2 == 0 { 0.3 } else { -0.3 };
            levelling.row(0, Time::from_seconds(f64::from(k) * 0.01), &[0.0, 0.0, 0.0, shake, 0.0, -G]);
        }
        let message = levelling.waits_for().unwrap();
        assert!(
            message.contains("the rate shakes by 0.0 and the force by 3.0 of what `still` allows"),
            "{message}"
        );
        assert!(
            message.ends_with("the quietest window has 0.30 m/s² where `still.accel_std` allows 0.10"),
            "{message}"
        );
        // Rests that are too short.
        let mut levelling = unbounded(2.0);
        levelling.test = Some(StillTest::new(&still));
        for k in 0..1000 {
            let shake = if k % 200 > 150 { f64::from(k % 2) } else { 0.0 };
            levelling.row(0, Time::from_seconds(f64::from(k) * 0.01), &[0.0, 0.0, 0.0, shake, 0.0, -G]);
        }
        let message = levelling.waits_for().unwrap();
        assert!(message.contains("the longest rest so far lasted 0.6 s"), "{message}");
    }

    #[test]
    fn without_bounds_the_first_rows_are_averaged_and_the_gyros_carry_on() {
        let mut levelling = unbounded(1.0);
        // Shaking that no bound of stillness would let pass, and that averages out over 11 rows.
        for k in 0..=10 {
            assert!(levelling.waits_for().is_some(), "{k}");
            let shake = f64::from(k - 5);
            levelling.row(0, Time::from_seconds(f64::from(k) * 0.1), &[0.0, 0.0, 0.0, 1.0 + shake, 0.0, -G]);
        }
        let (q, _) = levelling.found.unwrap();
        assert!((so3::to_rpy(&q) - V::new(0.0, (1.0 / G).atan(), 0.0)).norm() < 1e-14); // rounding
        levelling.row(0, Time::from_seconds(1.1), &[0.5, 0.0, 0.0, 0.0, 0.0, -G]);
        let (turned, _) = levelling.found.unwrap();
        assert!((so3::log(&(q.inverse() * turned)) - V::new(0.05, 0.0, 0.0)).norm() < 1e-14);
    }
}
