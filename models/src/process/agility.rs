//! Agility: how fast a vehicle can change its motion while nobody measures it.
//!
//! Over a gap in the input the vehicle keeps its velocity and its attitude, but for accelerations and
//! turns that are correlated in time: of 1σ a \[m/s²\] and w \[rad/s\] per body axis, with a correlation
//! time τ. Their integral over T seconds has the variance
//!
//! ```text
//! a² g(T),   g(T) = 2τ² (T/τ − 1 + exp(−T/τ))
//! ```
//!
//! It begins as (aT)² and goes over into a random walk of 2a²τT. A part of a gap adds what g grows by.
//! Roll and pitch of a vehicle do not walk away: their 1σ grows up to `tilt`, that of the heading up to
//! that of a uniform distribution, π/√3. Where the vehicle turns by driving, on a circle of `turning_radius`
//! R at least, w about down is at most speed/R.
//!
//! Source     integrated Gauss-Markov process: Gelb 1974, Applied Optimal Estimation, §3.8

use crate::units::{Axes, Dimensional, Positive, dim, range};
use fusion_core::model::Gap;
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// How fast the vehicle can change its motion: what a gap in the input adds to the uncertainty. A single
/// sample that changes by less is no spike. Per body axis: forward, right, down.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AgilitySpec {
    /// 1σ of its acceleration.
    acceleration: Axes<dim::Acceleration, range::Positive>,
    /// 1σ of its angular rate.
    angular_rate: Axes<dim::AngularRate, range::Positive>,
    /// How long an acceleration or a turn lasts.
    time: Positive<dim::Duration>,
    /// The largest 1σ of roll and pitch that a gap leaves.
    tilt: Positive<dim::Angle>,
    /// The smallest circle that it can drive, where it cannot turn on the spot: its angular rate about
    /// down is then at most its speed over this radius.
    turning_radius: Option<Positive<dim::Length>>,
}

impl Default for AgilitySpec {
    /// A car in a town, a multicopter in gentle flight, a vehicle under water.
    fn default() -> Self {
        Self {
            acceleration: [positive(3.0); 3].into(),
            angular_rate: [positive(0.5); 3].into(),
            time: positive(1.0),
            tilt: positive(20f64.to_radians()),
            turning_radius: None,
        }
    }
}

fn positive<D: Dimensional>(si: f64) -> Positive<D> {
    Positive::try_from_si(si).unwrap_or_else(|_| unreachable!("the defaults are positive"))
}

/// The same in SI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Agility {
    acceleration: Vector3<f64>,
    rate: Vector3<f64>,
    time: f64,
    tilt: f64,
    /// The largest curvature of its path \[1/m\]; none where it can turn on the spot.
    curvature: Option<f64>,
}

impl From<&AgilitySpec> for Agility {
    fn from(spec: &AgilitySpec) -> Self {
        Self {
            acceleration: spec.acceleration.si().into(),
            rate: spec.angular_rate.si().into(),
            time: spec.time.si(),
            tilt: spec.tilt.si(),
            curvature: spec.turning_radius.map(|radius| 1.0 / radius.si()),
        }
    }
}

impl Agility {
    /// By how much angular rate and specific force may change from sample to sample, per number of an
    /// inertial sample: shocks act on every axis as on the most agile one.
    pub(super) fn changes(&self) -> [f64; 6] {
        let (w, a) = (self.rate.max(), self.acceleration.max());
        [w, w, w, a, a, a]
    }

    /// What g grows by over a part of a gap \[s²\].
    fn growth(&self, gap: &Gap) -> f64 {
        let g = |seconds: f64| {
            let x = seconds / self.time;
            // x + expm1(−x) loses digits below 1e-4, where x²/2 − x³/6 is exact to rounding.
            let integral = if x < 1e-4 { x * x * (0.5 - x / 6.0) } else { x + (-x).exp_m1() };
            2.0 * self.time * self.time * integral
        };
        g(gap.to) - g(gap.from)
    }

    /// The variance of the velocity that a part of a gap adds, north east down \[m²/s²\].
    pub(super) fn velocity(&self, gap: &Gap, c_nb: &Matrix3<f64>) -> Matrix3<f64> {
        let a = &self.acceleration;
        let variance = Matrix3::from_diagonal(&(a.component_mul(a) * self.growth(gap)));
        c_nb * variance * c_nb.transpose()
    }

    /// The variance of the attitude that a part of a gap adds at a speed \[m/s\], per body axis, and that
    /// up to which it grows \[rad²\].
    pub(super) fn attitude(&self, gap: &Gap, speed: f64) -> (Vector3<f64>, Vector3<f64>) {
        let mut w = self.rate;
        if let Some(curvature) = self.curvature {
            w.z = w.z.min(speed * curvature);
        }
        let heading = core::f64::consts::PI.powi(2) / 3.0;
        let tilt = self.tilt * self.tilt;
        (w.component_mul(&w) * self.growth(gap), Vector3::new(tilt, tilt, heading))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agility() -> Agility {
        Agility::from(&AgilitySpec::default())
    }

    #[test]
    fn a_short_gap_adds_the_square_of_a_constant_acceleration_and_a_long_one_a_random_walk() {
        let a = agility();
        let at = |from: f64, to: f64| a.velocity(&Gap { from, to }, &Matrix3::identity()).m11;
        // 1e-3·1/3: the next term of the series at T = τ/1000.
        assert!((at(0.0, 1e-3) / 9e-6 - 1.0).abs() < 4e-4);
        // A second of the walk: 2a²τ; exp(−50) of the rest is left.
        assert!((at(50.0, 51.0) - 18.0).abs() < 1e-12);
    }

    #[test]
    fn a_vehicle_that_turns_by_driving_does_not_turn_at_rest() {
        let gap = Gap { from: 0.0, to: 1.0 };
        let spec = AgilitySpec {
            turning_radius: Some(positive(5.0)),
            ..AgilitySpec::default()
        };
        let turning = |speed: f64| Agility::from(&spec).attitude(&gap, speed).0;
        let free = agility().attitude(&gap, 0.0).0;
        assert_eq!((turning(0.0).z, turning(0.0).x), (0.0, free.x));
        // At 1 m/s a circle of 5 m is 0.2 rad/s, at 10 m/s the rate of 0.5 rad/s is the smaller one.
        assert!((turning(1.0).z / free.z - 0.16).abs() < 1e-15 && turning(10.0) == free);
    }

    #[test]
    fn parts_of_a_gap_add_up_to_the_whole() {
        let a = agility();
        let parts: f64 = (0..300)
            .map(|k| 0.1 * f64::from(k))
            .map(|t| a.growth(&Gap { from: t, to: t + 0.1 }))
            .sum();
        let whole = a.growth(&Gap { from: 0.0, to: 30.0 });
        // 1e-12: 300 roundings.
        assert!((parts / whole - 1.0).abs() < 1e-12);
    }

    #[test]
    fn both_branches_of_the_growth_agree_where_they_meet() {
        let a = agility();
        let [below, above] = [1e-4 - 1e-12, 1e-4 + 1e-12].map(|to| a.growth(&Gap { from: 0.0, to }));
        // 1e-8·2: the gap of 2e-12 relative to 1e-4, and ε/x² of rounding.
        assert!((below / above - 1.0).abs() < 1e-7, "{below:e} {above:e}");
    }
}
