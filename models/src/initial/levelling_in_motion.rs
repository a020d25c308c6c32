//! Levelling of a vehicle that moves: waves, a flight, a drive.
//!
//! Level      down is −mean of C f over the last T, in axes that do not turn: C follows the gyros. An acceleration
//!            averages out as far as the velocity is the same at both ends: its error is |Δv|/(g T)
//! Tilt 1σ    σ² = `tilt_sigma`² + s²/|f|², s the 1σ of the horizontal mean forces of eighths of T, over the last T
//! Gyro bias  unknown: b causes a tilt of b T
//! Kept       it goes on until the filter starts, so a long wait for a heading does no harm; it begins anew after a gap
//!            longer than T
//! Source     complementary filter of rates and force: Mahony, Hamel, Pflimlin 2008, §IV; with a gain of 1/T

use super::levelling::level;
use super::write_attitude;
use alloc::string::String;
use fusion_core::belief::Belief;
use fusion_core::geometry::so3;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::Layout;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// Parts of the averaging time whose mean forces are compared.
const PARTS: f64 = 8.0;

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct LevellingInMotion {
    duration: f64,
    /// How long rows come before the filter may start \[s\].
    after: f64,
    tilt_sigma: f64,
    /// Body to level axes; `None` before the first row.
    attitude: Option<UnitQuaternion<f64>>,
    last: Option<Time>,
    /// How long rows came \[s\].
    elapsed: f64,
    /// The mean force, level axes \[m/s²\].
    mean: Vector3<f64>,
    part: Part,
    /// The variance of the horizontal mean forces of parts, per axis \[m²/s⁴\].
    wander: f64,
    complete: f64,
}
memory!(LevellingInMotion {
    attitude,
    last,
    elapsed,
    mean,
    part,
    wander,
    complete;
    duration,
    after,
    tilt_sigma
});

/// The sum of forces over a part of the averaging time, level axes, and how long it lasted \[s\].
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Part {
    sum: Vector3<f64>,
    time: f64,
}
memory!(Part { sum, time });

impl LevellingInMotion {
    /// Takes a force, level axes, that lasted for `dt` into the means.
    fn add(&mut self, force: Vector3<f64>, dt: f64) {
        self.elapsed += dt;
        self.mean += (force - self.mean) * (dt / self.elapsed.min(self.duration));
        self.part.sum += force * dt;
        self.part.time += dt;
        if self.part.time * PARTS >= self.duration {
            let part = self.part.sum / self.part.time;
            self.part = Part::default();
            self.complete += 1.0;
            let off = (part - self.mean).xy().norm_squared() / 2.0;
            self.wander += (off - self.wander) / self.complete.min(PARTS);
        }
    }
}

impl Initialiser for LevellingInMotion {
    fn row(&mut self, _: usize, time: Time, row: &[f64]) {
        let (w, f) = (Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
        let dt = self.last.map_or(0.0, |last| time.seconds_since(last));
        let Some(before) = self.attitude.filter(|_| dt <= self.duration) else {
            let (roll, pitch) = level(&f);
            let q = so3::from_rpy(roll, pitch, 0.0);
            (self.attitude, self.last, self.mean) = (Some(q), Some(time), q * f);
            (self.elapsed, self.wander, self.complete, self.part) = (0.0, 0.0, 0.0, Part::default());
            return;
        };
        // A row that is not newer covers no time.
        if dt <= 0.0 {
            return;
        }
        self.last = Some(time);
        let q = before * so3::exp(&(w * dt));
        self.add(q * f, dt);
        // The smallest turn that makes the mean force vertical.
        let up = Vector3::new(0.0, 0.0, -1.0);
        let axis = self.mean.cross(&up);
        let angle = math::atan2(axis.norm(), self.mean.dot(&up));
        let turn = axis.try_normalize(0.0).map_or_else(Vector3::zeros, |axis| axis * angle);
        self.mean = up * self.mean.norm();
        self.attitude = Some(so3::exp(&turn) * q);
    }

    fn waits_for(&self) -> Option<String> {
        (self.elapsed < self.after).then(|| format!("{} s of rows, to level in motion", self.after))
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        let Some(q) = &self.attitude else { return };
        let size = self.mean.norm();
        let wander = if size > 0.0 { math::sqrt(self.wander) / size } else { 0.0 };
        let tilt = math::hypot(self.tilt_sigma, wander);
        write_attitude(layout, belief, q, &[tilt, tilt, core::f64::consts::PI]);
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
    use crate::units::{NonNegative, Positive, dim};
    use crate::vocabulary::state;
    use schemars::JsonSchema;

    /// Roll and pitch of a vehicle that moves: from the mean specific force in axes that follow the gyros.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct LevellingInMotionSpec {
        /// The IMU stream.
        source: String,
        /// How long forces are averaged: longer than waves and manoeuvres, and so short that the bias of the gyros turns by
        /// less than the tilt may be wrong.
        duration: Positive<dim::Duration>,
        /// How long rows come before the filter may start; the `duration` by default. Until then the mean is shorter.
        after: Option<Positive<dim::Duration>>,
        /// 1σ of roll and pitch: acceleration over gravity that lasts. It grows if the mean force wanders.
        tilt_sigma: NonNegative<dim::Angle>,
    }

    crate::register!(
        Initialiser,
        "levelling_in_motion",
        LevellingInMotionSpec,
        r#"
source = "imu"
duration = "5 s"
tilt_sigma = "5 deg"
"#
    );

    #[typetag::deserialize(name = "levelling_in_motion")]
    impl InitialiserSpec for LevellingInMotionSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: imu_channels(),
            }]
        }

        fn writes(&self) -> Vec<&'static str> {
            vec![state::ATTITUDE.as_str()]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            Ok(Box::new(LevellingInMotion {
                duration: self.duration.si(),
                after: self.after.unwrap_or(self.duration).si(),
                tilt_sigma: self.tilt_sigma.si(),
                attitude: None,
                last: None,
                elapsed: 0.0,
                mean: Vector3::zeros(),
                part: Part::default(),
                wander: 0.0,
                complete: 0.0,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::Build;
    use crate::vocabulary::state;
    use fusion_core::state::{Attitude, Manifold};

    fn level_over(duration: f64) -> LevellingInMotion {
        LevellingInMotion {
            duration,
            after: duration,
            tilt_sigma: 0.01,
            attitude: None,
            last: None,
            elapsed: 0.0,
            mean: Vector3::zeros(),
            part: Part::default(),
            wander: 0.0,
            complete: 0.0,
        }
    }

    /// The tilt error [rad] and its 1σ after `seconds` on waves of 6 deg with a period of 5 s, with a bias of the gyros
    /// and a sideways acceleration.
    fn on_waves(seconds: i32, duration: f64, bias: f64, sway: impl Fn(f64) -> f64) -> (f64, f64) {
        let attitude = |t: f64| so3::from_rpy(0.1 * (1.257 * t + 1.0).sin(), 0.05 * (1.1 * t).sin(), 0.5 + 0.02 * t);
        let mut own = level_over(duration);
        let end = 100 * seconds;
        for k in 0..=end {
            let t = 0.01 * f64::from(k);
            let w = so3::log(&(attitude(t - 0.01).inverse() * attitude(t))) / 0.01 + Vector3::new(bias, 0.0, 0.0);
            let f = attitude(t - 0.005).inverse() * Vector3::new(0.0, sway(t), -9.8);
            let row = [w.x, w.y, w.z, f.x, f.y, f.z];
            own.row(0, Time::from_nanos(10_000_000 * i64::from(k)), &row);
            // The time is a sum of steps.
            assert!((t - duration).abs() < 1e-6 || own.waits_for().is_some() == (t < duration), "{t}");
        }
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
        own.write(Time::default(), &layout, &mut belief);
        let found = Attitude::read(&belief.x).inverse() * Vector3::new(0.0, 0.0, 1.0);
        let truth = attitude(0.01 * f64::from(end)).inverse() * Vector3::new(0.0, 0.0, 1.0);
        let variance = belief.covariance.marginal::<3>(&layout.blocks()[0]);
        (found.angle(&truth), variance[(0, 0)].sqrt())
    }

    #[test]
    fn waves_do_not_tilt_it_however_long_it_waits() {
        for seconds in [6, 65, 300] {
            let (tilt, sigma) = on_waves(seconds, 5.0, 0.0, |_| 0.0);
            // The first force gives the exact tilt; half a sample of turning is 0.0006 rad.
            assert!(tilt < 2e-3 && (0.01..0.012).contains(&sigma), "{seconds}: {tilt} {sigma}");
        }
        // The bias turns it for the averaging time: 1 mrad/s for 5 s.
        let (tilt, _) = on_waves(300, 5.0, 1e-3, |_| 0.0);
        assert!((tilt - 5e-3).abs() < 2e-3, "{tilt}");
    }

    #[test]
    fn a_repeated_stamp_adds_nothing_and_a_gap_begins_anew() {
        let mut own = level_over(5.0);
        let at_rest = [0.0, 0.0, 0.0, 0.0, 0.0, -9.8];
        for t in [1.0, 1.0, 0.5, 2.0] {
            own.row(0, Time::from_seconds(t), &at_rest);
        }
        assert!(own.elapsed == 1.0 && own.attitude.unwrap().angle() == 0.0, "{own:?}");
        // On its right side after the gap.
        own.row(0, Time::from_seconds(60.0), &[0.0, 0.0, 0.0, 0.0, -9.8, 0.0]);
        let roll = own.attitude.unwrap().angle();
        assert!(own.elapsed == 0.0 && (roll - core::f64::consts::FRAC_PI_2).abs() < 1e-12, "{own:?}");
    }

    #[test]
    fn a_sway_averages_out_and_widens_the_tilt() {
        let sway = |t: f64| (0.9 * t).cos();
        let (tilt, sigma) = on_waves(60, 20.0, 0.0, sway);
        // 1 m/s² is 6 deg. Averaged exponentially over 20 s: 1/√(1 + (0.9 · 20)²) of it.
        assert!(tilt < 8e-3 && sigma > 0.03, "{tilt} {sigma}");
    }
}
