//! The specific force averaged in axes that do not turn: a vertical under acceleration.
//!
//! Output     `specific_force` f̄ \[m/s²\], body axes:  f̄⁺ = Exp(−wΔt) f̄ + (1 − e^(−Δt/τ)) (f − Exp(−wΔt) f̄)
//! Rate       w = w_m less the filter's own `gyro_bias`
//! Used by    the sensor `gravity_direction`
//! Mind       neighbours share what the average holds: the N rows of 2τ say as much as one, so that
//!            the sensor's sigma is √N of the vertical's own. A row every 2τ alone is worse: it
//!            catches what shaking the average lets through
//! Valid      accelerations that average out over τ, gyros that do not drift over it

use fusion_core::geometry::so3;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Quantity, Vector, View};
use fusion_core::time::Time;
use nalgebra::Vector3;

/// The specific force, low-pass filtered over `time_constant` \[s\] in axes that do not rotate: `filtered`
/// and `f_b` in body axes, before and after a turn of `w_nb_b` \[rad/s\] for `dt` \[s\].
#[inline]
#[must_use]
pub fn low_passed(filtered: &Vector3<f64>, f_b: &Vector3<f64>, w_nb_b: &Vector3<f64>, dt: f64, time_constant: f64) -> Vector3<f64> {
    let carried = so3::exp(&(w_nb_b * -dt)) * filtered;
    carried + (f_b - carried) * (1.0 - math::exp(-dt / time_constant))
}

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct SteadyForce {
    gyro_bias: Option<Quantity<Vector<3>>>,
    time_constant: f64,
    period: i64,
    band: f64,
    gravity: f64,
    last: Option<(Time, Vector3<f64>)>,
    next: Time,
}
memory!(SteadyForce { last, next; gyro_bias, time_constant, period, band, gravity });

impl Stage for SteadyForce {
    fn row(&mut self, _: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter) {
        if !row.iter().all(|v| v.is_finite()) {
            return;
        }
        let (w, f) = (Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
        let bias = view
            .zip(self.gyro_bias.as_ref())
            .map_or_else(Vector3::zeros, |(view, bias)| view.get(bias));
        let steady = self.last.map_or(f, |(last, steady)| {
            low_passed(&steady, &f, &(w - bias), time.seconds_since(last), self.time_constant)
        });
        self.last = Some((time, steady));
        let off = (steady.norm() / self.gravity - 1.0).abs();
        if time >= self.next && off <= self.band {
            self.next = time.shifted(self.period);
            out.emit(time, steady.as_slice());
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec, imu_channels};
    use crate::de::DeserializeSpec;
    use crate::earth::LocalEarth;
    use crate::units::{Positive, STANDARD_GRAVITY, dim};
    use crate::vocabulary::{channel, state};
    use fusion_core::time::nanos;
    use schemars::JsonSchema;

    /// The specific force, low-pass filtered in axes that do not rotate: a vertical for a body that
    /// accelerates.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct SteadyForceSpec {
        /// The IMU stream.
        source: String,
        /// Time constant: longer than the accelerations last, shorter than the gyros drift.
        time_constant: Positive<dim::Duration>,
        /// Rows per second at most; a row per sample where absent.
        rate: Option<Positive<dim::Frequency>>,
        /// Rows are left out where |f̄| differs from g by more than this share of g; without it none.
        band: Option<Positive<dim::Ratio>>,
        /// g for `band`; by default that of the origin, or standard gravity.
        gravity: Option<Positive<dim::Acceleration>>,
    }

    crate::register!(
        Stage,
        "steady_force",
        SteadyForceSpec,
        r#"
source = "imu"
time_constant = "1.5 s"
rate = "10 Hz"
band = "5 %"
gravity = "9.81 m/s^2"
"#
    );

    #[typetag::deserialize(name = "steady_force")]
    impl StageSpec for SteadyForceSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: imu_channels(),
            }]
        }

        fn output(&self) -> Vec<Channel> {
            vec![channel::SPECIFIC_FORCE]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let at_origin = b.origin.map_or(STANDARD_GRAVITY, |o| LocalEarth::at(&o).gravity(b.gravity));
            Ok(Box::new(SteadyForce {
                gyro_bias: b.quantity(state::GYRO_BIAS).ok(),
                time_constant: self.time_constant.si(),
                period: self.rate.map_or(0, |rate| nanos(1.0 / rate.si())),
                band: self.band.map_or(f64::INFINITY, |band| band.si()),
                gravity: self.gravity.map_or(at_origin, |g| g.si()),
                last: None,
                next: Time::MIN,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turning_body_that_shakes_gives_its_vertical_less_the_bias_of_its_gyros() {
        let bias = Vector3::new(0.02, -0.01, 0.03);
        let mut stage = SteadyForce {
            gyro_bias: Some(Quantity::Fixed(bias)),
            time_constant: 1.5,
            period: 0,
            band: 0.05,
            gravity: 9.8,
            last: None,
            next: Time::MIN,
        };
        let (w, mut q, view) = (Vector3::new(0.3, -0.5, 0.8), so3::from_rpy(0.1, 0.2, 0.3), View::new(&[], &[]));
        for k in 0..1000 {
            let shake = (core::f64::consts::TAU * 2.0 * f64::from(k) * 0.01).sin() * 3.0;
            let f = q.inverse() * Vector3::new(shake, 0.0, -9.8);
            let row = [w.x + bias.x, w.y + bias.y, w.z + bias.z, f.x, f.y, f.z];
            let mut out = Emitter::default();
            stage.row(0, Time::from_seconds(f64::from(k) * 0.01), &row, Some(&view), &mut out);
            let rows: Vec<_> = out.rows().map(|(_, row)| q * Vector3::new(row[0], row[1], row[2])).collect();
            // 3 m/s² at 2 Hz through 1/(2π·2·1.5), and as much again of the transient.
            assert!(
                (rows[0] - Vector3::new(0.0, 0.0, -9.8)).norm() < 2.0 * 3.0 / 18.8,
                "{k}: {}",
                rows[0]
            );
            q *= so3::exp(&(w * 0.01));
        }
    }

    #[test]
    fn a_force_that_stays_off_gravity_is_no_vertical() {
        let mut stage = SteadyForce {
            gyro_bias: None,
            time_constant: 1.5,
            period: 0,
            band: 0.05,
            gravity: 9.8,
            last: None,
            next: Time::MIN,
        };
        let mut emitted = |f: f64, seconds: core::ops::Range<i32>| {
            let mut out = Emitter::default();
            for k in seconds.start * 100..seconds.end * 100 {
                stage.row(
                    0,
                    Time::from_seconds(f64::from(k) * 0.01),
                    &[0.0, 0.0, 0.0, 0.0, 0.0, -f],
                    None,
                    &mut out,
                );
            }
            out.rows().count()
        };
        assert_eq!(emitted(9.8, 0..1), 100);
        // The average passes 5 % of a step by 10 % after τ ln 2 = 1.04 s.
        assert_eq!(emitted(10.78, 1..3), 103);
        assert_eq!(emitted(10.78, 3..5), 0);
    }

    #[test]
    fn the_low_pass_follows_a_turning_body_without_lag() {
        let (w, dt) = (Vector3::new(0.5, -1.0, 0.3), 0.01);
        let mut q = so3::from_rpy(0.1, 0.2, 0.3);
        let mut filtered = q.inverse() * Vector3::new(0.0, 0.0, -9.8);
        for _ in 0..500 {
            q *= so3::exp(&(w * dt));
            filtered = low_passed(&filtered, &(q.inverse() * Vector3::new(0.0, 0.0, -9.8)), &w, dt, 1.5);
        }
        assert!((filtered - (q.inverse() * Vector3::new(0.0, 0.0, -9.8))).norm() < 1e-11); // 500 roundings of 10
        // A step of force is followed to 1 − 1/e after one time constant.
        let mut still = Vector3::zeros();
        for _ in 0..150 {
            still = low_passed(&still, &Vector3::x(), &Vector3::zeros(), dt, 1.5);
        }
        assert!((still.x - (1.0 - (-1.0_f64).exp())).abs() < 1e-14); // rounding of 150 steps
    }
}
