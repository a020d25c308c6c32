//! A vehicle on two tracks that turns by running them at different speeds.
//!
//! Tracks     each follows its command with a first-order lag, |v| and |v̇| limited. Where a turn would
//!            ask for more than the greatest speed, the speed ahead gives way
//! Slip       of each track `v' = v (1 − i)`, i a mean plus a first-order Gauss-Markov part that passes
//!            through the lag of the drive, so that no speed jumps
//! Over ground `r = (vl' − vr')/(yr − yl)`, `u = (vl' yr − vr' yl)/(yr − yl)`, `v = −r x`, with the
//!            centres of rotation of the tracks at yl < 0 < yr to the right and x ahead of the body
//!            origin. `turn_slip` α puts them at ±αB/2, B the gauge: `r = (vl' − vr')/(αB)`
//! Ground     roll and pitch are second-order Markov in the distance that the tracks run; the body moves
//!            along its own axes, so that height follows the pitch
//! Not here   forces: mass, soil, and what a slope does to the slip
//! Source     Martínez, Mandow, Morales, Pedraza, García-Cerezo, Int. J. Robotics Research 24(10) 2005

use super::super::random::{Markov, Random};
use super::super::segment::{Junction, Motion};
use super::{Command, Vehicle, VehicleSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, Quantity, dim};
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// Two tracks, one on each side, each with its own motor.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SkidSteerSpec {
    /// Distance between the middles of the tracks.
    gauge: Positive<dim::Length>,
    /// By how much a turn is slower than without lateral slip, at least 1 on real ground; this or `icr`.
    turn_slip: Option<Positive<dim::Ratio>>,
    /// The centre of rotation of each track; this or `turn_slip`.
    icr: Option<RotationCentres>,
    /// Loss of speed of each track.
    #[serde(default)]
    slip: SlipSpec,
    /// Greatest speed of a track.
    max_speed: Positive<dim::Speed>,
    /// Greatest change of a track's speed.
    max_acceleration: Positive<dim::Acceleration>,
    /// Time constant with which a track follows its command.
    lag: Positive<dim::Duration>,
    /// How uneven the ground is; level without it.
    terrain: Option<TerrainSpec>,
}

/// The instantaneous centres of rotation of the tracks.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RotationCentres {
    /// Distance of the left track's centre to the left of the body origin.
    left: Positive<dim::Length>,
    /// Distance of the right track's centre to the right of the body origin.
    right: Positive<dim::Length>,
    /// Distance of both centres ahead of the body origin.
    #[serde(default)]
    ahead: Quantity<dim::Length>,
}

/// Longitudinal slip: the share of its speed that a track loses.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SlipSpec {
    /// Mean of both tracks.
    #[serde(default)]
    mean: Quantity<dim::Ratio>,
    /// 1σ of the part that varies, independent for each track.
    #[serde(default)]
    sigma: NonNegative<dim::Ratio>,
    /// Correlation time of that part; 2 s without it.
    correlation_time: Option<Positive<dim::Duration>>,
}

/// Uneven ground.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TerrainSpec {
    /// 1σ of roll and of pitch.
    sigma: NonNegative<dim::Angle>,
    /// Distance over which they change: the integral of their correlation.
    correlation_length: Positive<dim::Length>,
}

crate::register!(
    Vehicle,
    "skid_steer",
    SkidSteerSpec,
    r#"
gauge = "0.55 m"
turn_slip = 1.5
slip = { mean = "4 %", sigma = "3 %" }
max_speed = "0.5 m/s"
max_acceleration = "0.8 m/s^2"
lag = "0.15 s"
terrain = { sigma = "1 deg", correlation_length = "2 m" }
"#
);

#[typetag::deserialize(name = "skid_steer")]
impl VehicleSpec for SkidSteerSpec {
    fn mean_slip(&self) -> Option<f64> {
        Some(self.slip.mean.si())
    }

    fn build(&self, start: &Junction, seed: u64) -> Result<Box<dyn Vehicle>, BuildError> {
        let half = 0.5 * self.gauge.si();
        let (left, right, ahead) = match (self.turn_slip, self.icr) {
            (Some(slip), None) => (half * slip.si(), half * slip.si(), 0.0),
            (None, Some(icr)) => (icr.left.si(), icr.right.si(), icr.ahead.si()),
            _ => return Err(BuildError::at("turn_slip", "state either `turn_slip` or `icr`")),
        };
        let tau = self.slip.correlation_time.map_or(DEFAULT_SLIP_TIME, |t| t.si());
        let sigma = self.slip.sigma.si();
        let mut vehicle = SkidSteer {
            left,
            right,
            ahead,
            max_speed: self.max_speed.si(),
            max_acceleration: self.max_acceleration.si(),
            lag: self.lag.si(),
            mean_slip: self.slip.mean.si(),
            varying_slip: Markov::new(vec![sigma; 2], tau, Random::new(seed, "vehicle/slip")),
            slip: [0.0; 2],
            tracks: [0.0; 2],
            terrain: self.terrain.map(|t| Terrain::new(&t, seed)),
            motion: Motion {
                position: start.position,
                rpy: Vector3::new(0.0, 0.0, start.heading),
                ..Motion::default()
            },
        };
        vehicle.slip = [0, 1].map(|i| vehicle.mean_slip + vehicle.varying_slip.state()[i]);
        vehicle.tilt();
        Ok(Box::new(vehicle))
    }
}

/// Default correlation time of the slip \[s\].
const DEFAULT_SLIP_TIME: f64 = 2.0;

#[derive(Clone, Debug)]
struct SkidSteer {
    /// Centres of rotation: to the left, to the right, ahead \[m\].
    left: f64,
    right: f64,
    ahead: f64,
    max_speed: f64,
    max_acceleration: f64,
    lag: f64,
    mean_slip: f64,
    varying_slip: Markov,
    /// The slip that acts on the left and the right track.
    slip: [f64; 2],
    /// Speeds of the tracks \[m/s\].
    tracks: [f64; 2],
    terrain: Option<Terrain>,
    motion: Motion,
}

impl SkidSteer {
    /// The track speeds that follow the command if nothing slips, within their limits.
    fn wanted(&self, command: &Command) -> [f64; 2] {
        let most_turn = 2.0 * self.max_speed / (self.left + self.right);
        let turn = command.turn.clamp(-most_turn, most_turn);
        let by = [turn * self.left, -turn * self.right];
        let least = by.iter().fold(f64::NEG_INFINITY, |m, b| m.max(-self.max_speed - b));
        let most = by.iter().fold(f64::INFINITY, |m, b| m.min(self.max_speed - b));
        let speed = command.speed.min(most).max(least);
        by.map(|by| (speed + by).clamp(-self.max_speed, self.max_speed))
    }

    /// Takes roll and pitch from the ground.
    fn tilt(&mut self) {
        if let Some(terrain) = &self.terrain {
            (self.motion.rpy.x, self.motion.rpy.y) = (terrain.roll.angle, terrain.pitch.angle);
        }
    }
}

impl Vehicle for SkidSteer {
    fn motion(&self) -> Motion {
        self.motion
    }

    fn tracks(&self) -> Option<[f64; 2]> {
        Some(self.tracks)
    }

    fn step(&mut self, command: &Command, dt: f64) {
        let follow = -math::exp_m1(-dt / self.lag);
        let wanted = self.wanted(command);
        self.varying_slip.advance(dt);
        for (i, speed) in self.tracks.iter_mut().enumerate() {
            let most = self.max_acceleration * dt;
            *speed += ((wanted[i] - *speed) * follow).clamp(-most, most);
            let slip = self.mean_slip + self.varying_slip.state()[i];
            self.slip[i] += (slip - self.slip[i]) * follow;
        }
        let [l, r] = [0, 1].map(|i| self.tracks[i] * (1.0 - self.slip[i]));
        let apart = self.left + self.right;
        let turn = (l - r) / apart;
        let over_ground = Vector3::new((l * self.right + r * self.left) / apart, -turn * self.ahead, 0.0);
        if let Some(terrain) = &mut self.terrain {
            terrain.run(0.5 * (self.tracks[0].abs() + self.tracks[1].abs()) * dt);
        }
        let before = self.motion;
        self.tilt();
        self.motion.rpy.z += turn * dt;
        self.motion.velocity = self.motion.attitude() * over_ground;
        self.motion.position += 0.5 * (before.velocity + self.motion.velocity) * dt;
        self.motion.acceleration = (self.motion.velocity - before.velocity) / dt;
        self.motion.rpy_rate = (self.motion.rpy - before.rpy) / dt;
    }
}

/// The ground under the tracks.
#[derive(Clone, Debug)]
struct Terrain {
    sigma: f64,
    /// 2 over the correlation length \[1/m\].
    rate: f64,
    roll: Tilt,
    pitch: Tilt,
    random: Random,
}

/// One angle of the ground and its derivative by distance.
#[derive(Clone, Copy, Debug, Default)]
struct Tilt {
    angle: f64,
    slope: f64,
}

impl Terrain {
    /// Starts in its stationary distribution.
    fn new(spec: &TerrainSpec, seed: u64) -> Self {
        let mut random = Random::new(seed, "vehicle/terrain");
        let (sigma, rate) = (spec.sigma.si(), 2.0 / spec.correlation_length.si());
        let mut tilt = || Tilt {
            angle: sigma * random.normal(),
            slope: rate * sigma * random.normal(),
        };
        Self {
            sigma,
            rate,
            roll: tilt(),
            pitch: tilt(),
            random,
        }
    }

    /// Moves on by `distance` metres, a small part of the correlation length: x'' + 2βx' + β²x = w has
    /// the variance q/(4β³), q being the density of w.
    fn run(&mut self, distance: f64) {
        if distance <= 0.0 {
            return;
        }
        let fresh = self.sigma * math::sqrt(4.0 * math::powi(self.rate, 3) * distance);
        for tilt in [&mut self.roll, &mut self.pitch] {
            let pull = -self.rate * (2.0 * tilt.slope + self.rate * tilt.angle);
            tilt.slope += pull * distance + fresh * self.random.normal();
            tilt.angle += tilt.slope * distance;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Junction = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.0,
        speed: 0.0,
    };
    const DT: f64 = 0.01;
    const LIMITS: &str = "max_speed = 0.5\nmax_acceleration = 0.8\nlag = 0.15";

    fn vehicle(text: &str, seed: u64) -> Box<dyn Vehicle> {
        let spec: SkidSteerSpec = toml::from_str(&format!("gauge = 0.6\n{LIMITS}\n{text}")).unwrap();
        spec.build(&START, seed).unwrap()
    }

    /// The motion after this number of seconds.
    fn driven(vehicle: &mut Box<dyn Vehicle>, speed: f64, turn: f64, seconds: f64) -> Motion {
        (0..(seconds / DT).round() as u32).for_each(|_| vehicle.step(&Command { speed, turn }, DT));
        vehicle.motion()
    }

    #[test]
    fn a_command_is_followed_with_lag_within_the_limits() {
        let mut v = vehicle("turn_slip = 1.5", 1);
        let fast = driven(&mut v, 0.4, 0.0, 0.3);
        // Half a second is needed at 0.8 m/s²; the last part of it is the lag's.
        assert!((fast.velocity.x - 0.24).abs() < 1e-9, "{}", fast.velocity.x);
        let steady = driven(&mut v, 0.4, 0.2, 20.0);
        // 1e-9: 20 s are 130 time constants.
        assert!((steady.velocity.norm() - 0.4).abs() < 1e-9 && (steady.rpy_rate.z - 0.2).abs() < 1e-9);
        let most = driven(&mut v, 9.0, 0.2, 20.0);
        // The turn takes 0.2 · 0.45 m of the outer track's 0.5 m/s.
        assert!((most.velocity.norm() - 0.41).abs() < 1e-9 && (most.rpy_rate.z - 0.2).abs() < 1e-9);
    }

    #[test]
    fn both_forms_agree_and_a_centre_ahead_makes_it_slide_sideways() {
        let drive = |text| driven(&mut vehicle(text, 1), 0.2, 0.3, 10.0);
        let (a, b) = (drive("turn_slip = 1.5"), drive("icr = { left = 0.45, right = 0.45 }"));
        assert!((a.position - b.position).norm() < 1e-12 && (a.rpy - b.rpy).norm() < 1e-12); // rounding of 0.45
        let sliding = drive("icr = { left = 0.5, right = 0.4, ahead = 0.1 }");
        let in_body = sliding.attitude().inverse() * sliding.velocity;
        // v = −r x; 1e-9 as above.
        assert!((in_body - Vector3::new(0.2, -0.03, 0.0)).norm() < 1e-9, "{in_body}");
    }

    #[test]
    fn slip_loses_its_mean_and_varies_by_its_sigma() {
        let mut v = vehicle("turn_slip = 1\nslip = { mean = '4 %', sigma = '3 %' }", 3);
        driven(&mut v, 0.3, 0.0, 10.0);
        let (mut sum, mut square, n) = (0.0, 0.0, 400_000);
        for _ in 0..n {
            let m = driven(&mut v, 0.3, 0.0, DT);
            let lost = 1.0 - (m.attitude().inverse() * m.velocity).x / 0.3;
            (sum, square) = (sum + lost, square + lost * lost);
        }
        let mean = sum / f64::from(n);
        let sigma = (square / f64::from(n) - mean * mean).sqrt();
        // Two tracks halve the variance, the lag of 0.15 s takes 2/2.15 of it: 2.05 %. 4 % of both:
        // 1000 independent samples.
        assert!((mean - 0.04).abs() < 0.002 && (sigma / 0.0205 - 1.0).abs() < 0.08, "{mean} {sigma}");
    }

    #[test]
    fn the_ground_has_its_sigma_and_the_body_moves_along_its_own_axes() {
        let mut v = vehicle("turn_slip = 1\nterrain = { sigma = '1 deg', correlation_length = '2 m' }", 5);
        let (mut square, n, mut last) = (0.0, 1_000_000, v.motion());
        for _ in 0..n {
            v.step(&Command { speed: 0.4, turn: 0.0 }, DT);
            let m = v.motion();
            square += m.rpy.y * m.rpy.y + m.rpy.x * m.rpy.x;
            let in_body = m.attitude().inverse() * m.velocity;
            assert!(in_body.y.abs() + in_body.z.abs() < 1e-15, "{in_body}"); // rounding
            // Velocity is linear between steps, and position its integral.
            let way = 0.5 * (last.velocity + m.velocity) * DT;
            assert!((m.position - last.position - way).norm() < 1e-12); // rounding at 4 km
            last = m;
        }
        let sigma = (square / f64::from(n) / 2.0).sqrt().to_degrees();
        // 6 %: 4 km are 2000 correlation lengths for each of two angles.
        assert!((sigma - 1.0).abs() < 0.06, "{sigma}");
    }

    #[test]
    fn a_seed_is_a_run() {
        let text = "turn_slip = 1\nslip = { sigma = '3 %' }\nterrain = { sigma = '1 deg', correlation_length = '2 m' }";
        let run = |seed| driven(&mut vehicle(text, seed), 0.3, 0.1, 10.0);
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
    }
}
