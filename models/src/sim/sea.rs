//! The sea under a boat: a current that carries it, and waves that move it.
//!
//! Path     p(t) = p_w(t) + ∫ c dt + d(t): p_w the trajectory through the water, c the current, which changes
//!          linearly between the instants of its tide, d the waves
//! Waves    d = Σᵢ a \[cos θ sin ωᵢt, sin θ sin ωᵢt, −cos ωᵢt\], each with a phase: the boat goes round as the water of
//!          deep-water waves does, up and ahead (towards θ) on the crest. Three frequencies about the mean one, of the
//!          same amplitude a = √(2/3) σ, so that waves come in groups; σ, the standard deviation of heave, is a
//!          quarter of the significant height
//! Tilt     roll and pitch are sums of the same frequencies, in phase with the slope, a quarter of a period from heave
//! Start    calm; the waves rise over two periods
//! Period   as the boat meets the waves: course and speed do not change it
//! Not here how hull, keel and load answer to each frequency; slamming; waves that turn the heading; the water's own
//!          orbit, which a log in it would see
//! Source   Fossen 2011, Handbook of Marine Craft Hydrodynamics and Motion Control, §8.2 (waves) and §8.3 (current)

use super::profile::step7;
use super::segment::Motion;
use crate::block::BuildError;
use crate::units::{NonNegative, Positive, Quantity, Vec3Of, dim};
use core::f64::consts::TAU;
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// The sea that carries a boat.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeaSpec {
    /// Velocity of the water over ground, north east down: the truth of the parameter `current` of every sensor that
    /// declares one, fixed or estimated. Without it the water stands, and `current` is true like any other parameter.
    current: Option<Vec3Of<dim::Speed>>,
    /// Later values of the current, in order of time. It changes linearly from each to the next, and stays at the last.
    #[serde(default)]
    tide: Vec<TideSpec>,
    /// The waves; without them the water is flat.
    waves: Option<WavesSpec>,
}

/// The current at a time.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TideSpec {
    /// When, after the start of the run.
    at: Positive<dim::Duration>,
    /// Velocity of the water over ground then, north east down.
    current: Vec3Of<dim::Speed>,
}

/// Waves, and how far the boat moves in them.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WavesSpec {
    /// Significant height, crest to trough: four times the standard deviation of heave.
    height: NonNegative<dim::Length>,
    /// Mean period at which the boat meets them.
    period: Positive<dim::Duration>,
    /// Where they run to, clockwise from north.
    #[serde(default)]
    direction: Quantity<dim::Angle>,
    /// Standard deviation of roll.
    #[serde(default)]
    roll: NonNegative<dim::Angle>,
    /// Standard deviation of pitch.
    #[serde(default)]
    pitch: NonNegative<dim::Angle>,
}

impl SeaSpec {
    /// Whether it is declared how the water moves.
    pub(super) const fn has_current(&self) -> bool {
        self.current.is_some()
    }

    /// How the water moves after `t` seconds, from where it was at the start.
    pub(super) fn current(&self, t: f64) -> Current {
        let velocity = |declared: &Vec3Of<dim::Speed>| Vector3::from(declared.si());
        let mut here = Current {
            velocity: self.current.as_ref().map(velocity).unwrap_or_default(),
            ..Current::default()
        };
        let mut since = 0.0;
        for tide in &self.tide {
            let span = tide.at.si() - since;
            let change = (velocity(&tide.current) - here.velocity) / span;
            if t < tide.at.si() {
                here.change = change;
                break;
            }
            here.moved += (here.velocity + velocity(&tide.current)) * (0.5 * span);
            (here.velocity, since) = (velocity(&tide.current), tide.at.si());
        }
        let dt = t - since;
        here.moved += here.velocity * dt + here.change * (0.5 * dt * dt);
        here.velocity += here.change * dt;
        here
    }

    /// Refuses a tide whose entries are not in order of time, or that has no current at the start.
    pub(super) fn check(&self) -> Result<(), BuildError> {
        if self.current.is_none() && !self.tide.is_empty() {
            let help = "add `current`: the velocity of the water at the start";
            return Err(BuildError::at("sea.tide", "a tide changes a current, and there is none").help(help));
        }
        match self.tide.windows(2).position(|pair| pair[1].at.si() <= pair[0].at.si()) {
            None => Ok(()),
            Some(i) => {
                let message = "this is not later than the entry before it";
                Err(BuildError::at(format!("sea.tide.{}.at", i + 1), message).help("write the entries in order of time"))
            }
        }
    }

    /// Whether the boat goes up and down.
    pub(super) const fn has_waves(&self) -> bool {
        self.waves.is_some()
    }
}

/// The motion of the water.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Current {
    /// Its way since the start \[m\].
    moved: Vector3<f64>,
    /// Over ground \[m/s\].
    pub(super) velocity: Vector3<f64>,
    /// How fast the velocity changes \[m/s²\].
    change: Vector3<f64>,
}

/// Frequency, over the mean one, and phase \[rad\] of each wave. The squares of the frequencies have a mean of 1, so that
/// heave crosses 0 upwards once in a period on average; with these phases the crests do not meet at the start.
const WAVES: [(f64, f64); 3] = [(0.75, 0.0), (1.0, 2.0), (1.2, 4.0)];

/// Periods over which the sea rises.
const RISE: f64 = 2.0;

impl SeaSpec {
    /// Adds current and waves after `t` seconds to a motion in the water.
    pub(super) fn carry(&self, t: f64, motion: &mut Motion) {
        let current = self.current(t);
        motion.position += current.moved;
        motion.velocity += current.velocity;
        motion.acceleration += current.change;
        let Some(waves) = &self.waves else { return };
        let (period, (s, c)) = (waves.period.si(), math::sin_cos(waves.direction.si()));
        // Three sines of amplitude a have a variance of 3a²/2.
        let amplitude = math::sqrt(2.0 / 3.0_f64);
        let heave = 0.25 * waves.height.si() * amplitude;
        let tilt = Vector3::new(waves.roll.si(), waves.pitch.si(), 0.0) * amplitude;
        let rise = step7(t / (RISE * period)).stretched(1.0, RISE * period);
        for (frequency, phase) in WAVES {
            let rate = TAU * frequency / period;
            let (sin, cos) = math::sin_cos(rate * t + phase);
            // The orbit, up at the crest and ahead with the wave there, and its derivatives.
            let orbit = |sin: f64, cos: f64| Vector3::new(c * sin, s * sin, -cos) * heave;
            let (x, v, a) = (orbit(sin, cos), orbit(cos, -sin) * rate, orbit(-sin, -cos) * (rate * rate));
            motion.position += x * rise.value;
            motion.velocity += v * rise.value + x * rise.first;
            motion.acceleration += a * rise.value + v * (2.0 * rise.first) + x * rise.second;
            motion.rpy += tilt * (sin * rise.value);
            motion.rpy_rate += tilt * (cos * rate * rise.value + sin * rise.first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sea(text: &str) -> SeaSpec {
        toml::from_str(text).unwrap()
    }

    const ROUGH: &str = "waves = { height = '2 m', period = '6 s', direction = '90 deg', roll = '5 deg', pitch = '2 deg' }";

    fn carried(sea: &SeaSpec, t: f64) -> Motion {
        let mut motion = Motion::default();
        sea.carry(t, &mut motion);
        motion
    }

    #[test]
    fn a_current_carries_the_boat_at_its_velocity() {
        let m = carried(&sea("current = ['0.3 m/s', '-0.2 m/s', 0]"), 100.0);
        assert_eq!(m.position, Vector3::new(30.0, -20.0, 0.0));
        assert_eq!(m.velocity, Vector3::new(0.3, -0.2, 0.0));
    }

    #[test]
    fn a_tide_changes_the_current_evenly_and_leaves_it_at_the_last() {
        let sea =
            sea("current = [0.4, 0, 0]\ntide = [{ at = '100 s', current = [0.4, 0.2, 0] }, { at = '300 s', current = [-0.4, 0.2, 0] }]");
        let at = |t: f64| (carried(&sea, t).velocity, carried(&sea, t).position);
        assert_eq!(at(0.0), (Vector3::new(0.4, 0.0, 0.0), Vector3::zeros()));
        // 1e-12 m: rounding. Each leg adds its mean velocity times its time.
        let near = |t: f64, v: [f64; 3], p: [f64; 3]| {
            let (velocity, position) = at(t);
            assert!(
                (velocity - Vector3::from(v)).norm() < 1e-12 && (position - Vector3::from(p)).norm() < 1e-12,
                "{t} {velocity} {position}"
            );
        };
        near(50.0, [0.4, 0.1, 0.0], [20.0, 2.5, 0.0]);
        near(200.0, [0.0, 0.2, 0.0], [60.0, 30.0, 0.0]);
        near(400.0, [-0.4, 0.2, 0.0], [0.0, 70.0, 0.0]);
        // 1e-6: truncation and rounding, as below.
        for t in [3.0, 50.0, 99.0, 101.0, 222.0, 500.0] {
            let slope = (carried(&sea, t + 1e-4).position - carried(&sea, t - 1e-4).position) / 2e-4;
            assert!((slope - carried(&sea, t).velocity).norm() < 1e-6, "{t}");
            let slope = (carried(&sea, t + 1e-4).velocity - carried(&sea, t - 1e-4).velocity) / 2e-4;
            assert!((slope - carried(&sea, t).acceleration).norm() < 1e-6, "{t}");
        }
    }

    #[test]
    fn a_tide_without_a_current_or_out_of_order_is_refused() {
        let refused = |text: &str| sea(text).check().map_err(|e| e.field).err();
        assert_eq!(refused("tide = [{ at = '1 s', current = [0, 0, 0] }]").unwrap(), "sea.tide");
        let tide = |a: u32, b: u32| {
            format!("current = [0, 0, 0]\ntide = [{{ at = {a}, current = [0, 0, 0] }}, {{ at = {b}, current = [0, 0, 0] }}]")
        };
        assert_eq!(refused(&tide(5, 5)).unwrap(), "sea.tide.1.at");
        assert_eq!(refused(&tide(5, 6)), None);
    }

    #[test]
    fn its_motion_is_the_integral_of_its_derivatives_from_a_calm_start() {
        const H: f64 = 1e-4;
        let sea = sea(&format!("current = [0.3, -0.2, 0]\n{ROUGH}"));
        assert_eq!(carried(&sea, 0.0).position, Vector3::zeros());
        for k in 1..500 {
            let t = 0.123 * f64::from(k);
            let (before, here, after) = (carried(&sea, t - H), carried(&sea, t), carried(&sea, t + H));
            // 1e-6: truncation H²/6 times a few, rounding ε/H times metres.
            let compare = |a: Vector3<f64>, b: Vector3<f64>, exact: Vector3<f64>| {
                assert!(((b - a) / (2.0 * H) - exact).norm() < 1e-6, "{t}");
            };
            compare(before.position, after.position, here.velocity);
            compare(before.velocity, after.velocity, here.acceleration);
            compare(before.rpy, after.rpy, here.rpy_rate);
        }
    }

    #[test]
    fn heave_roll_pitch_and_period_are_those_declared_and_the_orbit_lies_in_the_direction() {
        let (sea, n) = (sea(ROUGH), 60_000);
        let (mut sums, mut crossings, mut before) = ([0.0; 5], 0, 0.0);
        for k in 0..n {
            let m = carried(&sea, 12.0 + 0.1 * f64::from(k));
            let values = [m.position.x, m.position.y, m.position.z, m.rpy.x, m.rpy.y];
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * value);
            crossings += i32::from(before < 0.0 && m.position.z >= 0.0);
            before = m.position.z;
        }
        let [north, east, down, roll, pitch] = sums.map(|sum| (sum / f64::from(n)).sqrt());
        // 1 %: groups of 2 min, over 100 min.
        let near = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 0.01, "{value} {expected}");
        assert!(north < 1e-12, "{north}");
        near(east, 0.5);
        near(down, 0.5);
        near(roll, 5.0_f64.to_radians());
        near(pitch, 2.0_f64.to_radians());
        // 5 %: the mean of squares gives the crossings of many waves exactly, and of three nearly.
        let period = 0.1 * f64::from(n) / f64::from(crossings);
        assert!((period / 6.0 - 1.0).abs() < 0.05, "{period}");
    }

    #[test]
    fn the_boat_goes_ahead_on_the_crest_and_leans_between_crest_and_trough() {
        let (sea, [mut up_ahead, mut up_up, mut up_lean, mut way_lean]) = (sea(ROUGH), [0.0; 4]);
        for k in 0..60_000 {
            let m = carried(&sea, 12.0 + 0.1 * f64::from(k));
            up_ahead -= m.position.z * m.velocity.y;
            up_up += m.position.z * m.position.z;
            up_lean += m.position.z * m.rpy.x;
            way_lean += m.position.y * m.rpy.x;
        }
        // Orbits: the speed ahead is ω times the height. 5 %: the mean ω of the three waves is 0.983 of 2π/period.
        let ahead = up_ahead / (up_up * TAU / 6.0);
        assert!((ahead - 1.0).abs() < 0.05, "{ahead}");
        assert!(way_lean > 0.0 && up_lean.abs() < 0.01 * way_lean, "{up_lean} {way_lean}");
    }
}
