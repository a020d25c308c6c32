//! Agility: how fast a vehicle can change its motion while no sensor measures it.
//!
//! A vehicle changes its motion by accelerations and turns that are correlated in time: of 1σ a \[m/s²\] and w
//! \[rad/s\] per body axis, with a correlation time τ. The samples before a gap give the values at its beginning. These
//! fade away by exp(−T/τ): their integral over T seconds is τ (1 − exp(−T/τ)) times the value. The accelerations and
//! turns that begin in the gap have an integral with the variance
//!
//! ```text
//! a² g(T),   g(T) = τ² (2T/τ − 3 + 4 exp(−T/τ) − exp(−2T/τ))
//! ```
//!
//! It begins as ⅔ a² T³/τ and approaches a random walk of 2a²τT. A part of a gap adds the growth of g. Roll and pitch
//! of a vehicle are bounded: their 1σ grows up to `tilt`, and that of the heading up to the 1σ of a uniform
//! distribution, π/√3. If the vehicle turns by driving, on a circle of at least `turning_radius` R, w about down is at
//! most speed/R.
//!
//! Source     integrated Gauss-Markov process, given its initial value: Gelb 1974, Applied Optimal Estimation, §3.8
//! Not here   noise of these values

use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::math;
use fusion_core::model::{Gap, Literal};
use fusion_core::state::{Attitude, Slot, Velocity};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// How fast the vehicle can change its motion, in SI and radians.
#[derive(Clone, Copy, Debug, Literal)]
pub struct Agility {
    acceleration: Vector3<f64>,
    rate: Vector3<f64>,
    time: f64,
    tilt: f64,
    /// The largest curvature of its path \[1/m\]; `None` if it can turn on the spot.
    curvature: Option<f64>,
}

/// The effect of a fading motion over a part of a gap, in the body axes at the beginning of the part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fading {
    /// The rotation of the vehicle.
    pub(super) turn: UnitQuaternion<f64>,
    /// The change of its velocity \[m/s\].
    pub(super) velocity: Vector3<f64>,
    /// The part of the path that this change causes \[m\].
    pub(super) path: Vector3<f64>,
    /// Rate \[rad/s\] and specific force \[m/s²\] that are left at the end.
    pub(super) w: Vector3<f64>,
    pub(super) f: Vector3<f64>,
}

impl Agility {
    /// The growth of g over a part of a gap \[s²\].
    fn growth(&self, gap: &Gap) -> f64 {
        let g = |seconds: f64| {
            let x = seconds / self.time;
            // The differences lose digits as 1/x², the series neglects x³/8 of the integral.
            let integral = if x < 1e-3 {
                x * x * x * (2.0 / 3.0 - x / 2.0 + x * x * (7.0 / 30.0))
            } else {
                2.0 * x + 4.0 * math::exp_m1(-x) - math::exp_m1(-2.0 * x)
            };
            self.time * self.time * integral
        };
        g(gap.to) - g(gap.from)
    }

    /// The effect over a part of a gap of the `motion` at the beginning of the gap. `motion` is rate and specific force
    /// minus those of a vehicle at constant velocity and attitude, in body axes; missing numbers are zero.
    pub(super) fn fading(&self, gap: &Gap, motion: &[f64]) -> Fading {
        let left = |seconds: f64| math::exp(-seconds / self.time);
        let (dt, begun) = (gap.duration(), left(gap.from));
        let once = -self.time * math::exp_m1(-dt / self.time);
        let twice = self.time * (dt - once);
        let of = |from: usize| motion.get(from..from + 3).map_or_else(Vector3::zeros, Vector3::from_column_slice);
        let (w, f) = (of(0), of(3));
        let turn = w * (begun * once);
        // The mean attitude while the velocity changes.
        let mid = so3::exp(&(turn * 0.5));
        Fading {
            turn: so3::exp(&turn),
            velocity: mid * f * (begun * once),
            path: mid * f * (begun * twice),
            w: w * left(gap.to),
            f: f * left(gap.to),
        }
    }

    /// The variance of the velocity that a part of a gap adds, north east down \[m²/s²\].
    pub(super) fn velocity(&self, gap: &Gap, c_nb: &Matrix3<f64>) -> Matrix3<f64> {
        let a = &self.acceleration;
        let variance = Matrix3::from_diagonal(&(a.component_mul(a) * self.growth(gap)));
        c_nb * variance * c_nb.transpose()
    }

    /// The variance of the attitude that a part of a gap adds, per body axis, and the upper limit of this variance
    /// \[rad²\].
    pub(super) fn attitude(&self, gap: &Gap) -> (Vector3<f64>, Vector3<f64>) {
        let w = self.rate;
        let heading = math::powi(core::f64::consts::PI, 2) / 3.0;
        let tilt = self.tilt * self.tilt;
        (w.component_mul(&w) * self.growth(gap), Vector3::new(tilt, tilt, heading))
    }

    /// The largest variance of the heading that a part of a gap adds, per square of the speed \[rad²/(m/s)²\]. `None`
    /// if the vehicle can turn on the spot.
    pub(super) fn by_speed(&self, gap: &Gap) -> Option<f64> {
        self.curvature.map(|curvature| curvature * curvature * self.growth(gap))
    }

    /// Writes the noise of the attitude over a part of a gap. The speed is as uncertain as the velocity: a standing car
    /// may have started.
    pub(super) fn turn(&self, gap: &Gap, attitude: Slot<Attitude>, velocity: Slot<Velocity>, speed: f64, out: &mut Transition) {
        let (variance, bound) = self.attitude(gap);
        out.noise_up_to(attitude, &variance, &bound);
        if let Some(per) = self.by_speed(gap) {
            out.noise_in_proportion(attitude, 2, per, speed * speed, velocity, 2);
        }
    }
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::units::{Axes, Dimensional, Positive, dim, range};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// How fast the vehicle can change its motion: a gap in the input adds this uncertainty. A single sample that changes
    /// by less is not a spike. Per body axis: forward, right, down.
    #[derive(Clone, Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct AgilitySpec {
        /// 1σ of its acceleration.
        acceleration: Axes<dim::Acceleration, range::Positive>,
        /// 1σ of its angular rate.
        angular_rate: Axes<dim::AngularRate, range::Positive>,
        /// How long an acceleration or a turn lasts.
        time: Positive<dim::Duration>,
        /// The largest 1σ of roll and pitch after a gap.
        tilt: Positive<dim::Angle>,
        /// The smallest circle that it can drive, if it cannot turn on the spot: its angular rate about down is then at
        /// most its speed over this radius.
        turning_radius: Option<Positive<dim::Length>>,
    }

    impl Default for AgilitySpec {
        /// A car in a town, a multicopter in gentle flight, an underwater vehicle.
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
        /// How much angular rate and specific force may change from sample to sample, per number of an inertial sample.
        /// Shocks act on every axis as on the most agile one.
        pub(crate) fn changes(&self) -> [f64; 6] {
            let (w, a) = (self.rate.max(), self.acceleration.max());
            [w, w, w, a, a, a]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agility() -> Agility {
        Agility::from(&AgilitySpec::default())
    }

    #[test]
    fn a_short_gap_adds_the_cube_of_its_length_and_a_long_one_a_random_walk() {
        let a = agility();
        let at = |from: f64, to: f64| a.velocity(&Gap { from, to }, &Matrix3::identity()).m11;
        // ¾·1e-3: the next term of the series at T = τ/1000.
        assert!((at(0.0, 1e-3) / 6e-9 - 1.0).abs() < 8e-4);
        // A second of the walk: 2a²τ; exp(−50) of the rest is left.
        assert!((at(50.0, 51.0) - 18.0).abs() < 1e-12);
    }

    #[test]
    fn the_variance_is_that_of_the_stationary_process_less_the_part_that_its_beginning_explains() {
        let a = agility();
        for seconds in [0.01, 0.3, 1.0, 7.0] {
            let gap = Gap { from: 0.0, to: seconds };
            let stationary = 2.0 * (seconds - 1.0 + (-seconds).exp());
            // The integral of an acceleration of 1 m/s² at the beginning, without any turn.
            let told = a.fading(&gap, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]).velocity.x;
            // 1e-11: the difference of the two at 0.01 s, 7e-7 of 1e-4, loses two digits.
            assert!((a.growth(&gap) - (stationary - told * told)).abs() < 1e-11, "{seconds}");
        }
    }

    #[test]
    fn what_fades_away_in_parts_does_as_in_one() {
        let a = agility();
        let motion = [0.0, 0.0, 0.4, 2.0, -1.0, 0.5];
        let whole = a.fading(&Gap { from: 0.0, to: 1.0 }, &motion);
        let (mut turn, mut velocity, mut path) = (UnitQuaternion::identity(), Vector3::zeros(), Vector3::zeros());
        let n = 1000;
        for k in 0..n {
            let at = |k: i32| f64::from(k) / f64::from(n);
            let part = a.fading(
                &Gap {
                    from: at(k),
                    to: at(k + 1),
                },
                &motion,
            );
            path += velocity / f64::from(n) + turn * part.path;
            velocity += turn * part.velocity;
            turn *= part.turn;
        }
        assert!((whole.turn.inverse() * turn).angle() < 1e-12);
        // About the mean turn of the whole: 1/24 of its square, 0.25 rad, of the velocity, and so of the path.
        assert!(
            (whole.velocity - velocity).norm() < 0.25 * 0.25 / 12.0 * velocity.norm(),
            "{velocity}"
        );
        assert!((whole.path - path).norm() < 0.1 * path.norm(), "{path}");
        assert!((whole.w.z - 0.4 * (-1.0_f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn a_vehicle_that_turns_by_driving_does_not_turn_at_rest() {
        let gap = Gap { from: 0.0, to: 1.0 };
        let spec: AgilitySpec = toml::from_str("turning_radius = 5").unwrap();
        assert_eq!(agility().by_speed(&gap), None);
        let per = Agility::from(&spec).by_speed(&gap).unwrap();
        // At 1 m/s a circle of 5 m is 0.2 rad/s, two fifths of 0.5 rad/s.
        assert!((per / agility().attitude(&gap).0.z - 0.16).abs() < 1e-15);
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
        let [below, above] = [1e-3 - 1e-12, 1e-3 + 1e-12].map(|to| a.growth(&Gap { from: 0.0, to }));
        // 6e-9: the gap of 2e-12 relative to 1e-3, three times; ε/x² of rounding.
        assert!((below / above - 1.0).abs() < 1e-8, "{below:e} {above:e}");
    }
}
