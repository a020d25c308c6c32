//! The stationarity detector: rows while the vehicle stands still.
//!
//! Output     mean raw `angular_rate` \[rad/s\] and `specific_force` \[m/s²\] of the window, valid
//!            at its end, at `rate` while still
//! Test       [`still`](super::still) with the filter's own gyro bias, several times in a row;
//!            the mean force must hold the vehicle up and no more: |(C_nb(f̄ − b_a))_NE| small;
//!            a GNSS speed as a witness while it reports, the filter's own speed while it is silent
//! Used by    zero velocity, zero angular rate
//! Mind       a false alarm during a GNSS outage costs far more than a missed rest: ask for
//!            several tests in a row, and for little mean acceleration

use super::still::StillTest;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage, Tested};
use fusion_core::state::{Attitude, Quantity, Vector, Velocity, View};
use fusion_core::time::Time;
use nalgebra::Vector3;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct Stationarity {
    test: StillTest,
    gyro_bias: Option<Quantity<Vector<3>>>,
    /// Attitude, accelerometer bias, largest horizontal mean acceleration.
    lift: Option<(Quantity<Attitude>, Option<Quantity<Vector<3>>>, f64)>,
    /// The filter's velocity and its largest norm.
    filter_speed: Option<(Quantity<Velocity>, f64)>,
    /// Largest GNSS speed and age of a report.
    witness: Option<(f64, f64)>,
    persist: u32,
    test_period: i64,
    period: i64,
    reported: Option<(Time, f64)>,
    passed: u32,
    /// Tests, windows that were still, and those at which all else held, too.
    counts: [u64; 3],
    rows: u64,
    next_test: Time,
    next_row: Time,
}
memory!(Stationarity {
    test, reported, passed, counts, rows, next_test, next_row;
    gyro_bias, lift, filter_speed, witness, persist, test_period, period
});

impl Stationarity {
    fn is_still(&mut self, time: Time, view: &View<'_>) -> bool {
        let value = |q: &Option<Quantity<Vector<3>>>| q.as_ref().map_or_else(Vector3::zeros, |q| view.get(q));
        let report = self
            .witness
            .zip(self.reported)
            .filter(|((_, max_age), (t, _))| time.seconds_since(*t) <= *max_age);
        let slow = match (report, &self.filter_speed) {
            (Some(((max_speed, _), (_, speed))), _) => speed <= max_speed,
            (None, Some((velocity, max))) => view.get(velocity).norm() <= *max,
            (None, None) => true,
        };
        let held = self.lift.as_ref().is_none_or(|(attitude, bias, max)| {
            let f_n = view.get(attitude) * (self.test.means()[1] - value(bias));
            math::hypot(f_n.x, f_n.y) <= *max
        });
        let is_still = self.test.is_still(&value(&self.gyro_bias));
        let holds = slow && held && is_still;
        self.counts[0] += 1;
        self.counts[1] += u64::from(is_still);
        self.counts[2] += u64::from(holds);
        holds
    }
}

impl Stage for Stationarity {
    fn tested(&self) -> Option<Tested> {
        let [tests, still, held] = self.counts;
        let nearest = match (still, held) {
            (0, _) => self.test.missed(),
            (_, 0) => Some(format!(
                "{still} windows of {tests} were still, but none of them while speed and mean acceleration were within their limits"
            )),
            (..) if self.rows == 0 => Some(format!(
                "{held} of {tests} tests held, but never {} in a row (`persist`)",
                self.persist
            )),
            _ => None,
        };
        Some(Tested { tests, held, nearest })
    }

    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter) {
        if input == 1 {
            self.reported = Some((time, Vector3::new(row[0], row[1], row[2]).norm()));
            return;
        }
        self.test.push(
            time.seconds(),
            Vector3::new(row[0], row[1], row[2]),
            Vector3::new(row[3], row[4], row[5]),
        );
        let Some(view) = view else { return };
        if time < self.next_test {
            return;
        }
        self.next_test = time.shifted(self.test_period);
        if !self.is_still(time, view) {
            self.passed = 0;
            return;
        }
        self.passed = self.passed.saturating_add(1);
        if self.passed < self.persist || time < self.next_row {
            return;
        }
        self.next_row = time.shifted(self.period);
        self.rows += 1;
        let [w, f] = self.test.means();
        out.emit(time, &[w.x, w.y, w.z, f.x, f.y, f.z]);
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
    use crate::stage::still::StillSpec;
    use crate::units::{Positive, dim};
    use crate::vocabulary::{channel, state};
    use fusion_core::time::nanos;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Emits rows while the vehicle stands still, judged by the IMU and, where declared, by GNSS.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct StationaritySpec {
        /// The IMU stream.
        source: String,
        /// Rows per second while still.
        rate: Positive<dim::Frequency>,
        /// How often the test is made.
        #[serde(default = "ten_hertz")]
        test_rate: Positive<dim::Frequency>,
        /// How many tests in a row must pass.
        #[serde(default = "once")]
        persist: u32,
        /// Limits of the rest test.
        still: StillSpec,
        /// Largest horizontal part of the mean specific force, minus its bias, in the navigation frame.
        max_mean_acceleration: Option<Positive<dim::Acceleration>>,
        /// A second test: the speed that GNSS reports.
        gnss: Option<GnssWitness>,
        /// At rest only while the estimated speed is below this; with `gnss`, used only while there is
        /// no recent reported speed.
        max_speed: Option<Positive<dim::Speed>>,
    }

    fn ten_hertz() -> Positive<dim::Frequency> {
        Positive::try_from_si(10.0).unwrap_or_else(|_| unreachable!("ten is positive"))
    }

    const fn once() -> u32 {
        1
    }

    /// GNSS as a witness of stillness.
    #[derive(Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct GnssWitness {
        /// A stream with a `velocity` channel.
        source: String,
        /// At rest only below this speed.
        max_speed: Positive<dim::Speed>,
        /// A reported speed older than this is ignored.
        max_age: Positive<dim::Duration>,
    }

    crate::register!(
        Stage,
        "stationarity",
        StationaritySpec,
        r#"
source = "imu"
rate = "1 Hz"
test_rate = "10 Hz"
persist = 5
max_mean_acceleration = "0.2 m/s^2"
max_speed = "3 m/s"
still = { window = "1 s", accel_std = "0.2 m/s^2", gyro_std = ["1 deg/s", "1 deg/s", "0.2 deg/s"], mean_rate = "1 deg/s" }
gnss = { source = "gnss", max_speed = "0.3 m/s", max_age = "2 s" }
"#
    );

    #[typetag::deserialize(name = "stationarity")]
    impl StageSpec for StationaritySpec {
        fn inputs(&self) -> Vec<Listen> {
            let mut inputs = vec![Listen {
                source: self.source.clone(),
                channels: imu_channels(),
            }];
            if let Some(gnss) = &self.gnss {
                let velocity = channel::VELOCITY;
                inputs.push(Listen {
                    source: gnss.source.clone(),
                    channels: vec![velocity],
                });
            }
            inputs
        }

        fn output(&self) -> Vec<Channel> {
            imu_channels()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let mut filter_speed = None;
            if let Some(max) = self.max_speed {
                filter_speed = Some((b.quantity(state::VELOCITY)?, max.si()));
            }
            let mut lift = None;
            if let Some(max) = self.max_mean_acceleration {
                lift = Some((b.quantity(state::ATTITUDE)?, b.quantity(state::ACCEL_BIAS).ok(), max.si()));
            }
            Ok(Box::new(Stationarity {
                test: StillTest::new(&self.still),
                gyro_bias: b.quantity(state::GYRO_BIAS).ok(),
                lift,
                filter_speed,
                witness: self.gnss.as_ref().map(|g| (g.max_speed.si(), g.max_age.si())),
                persist: self.persist,
                test_period: nanos(1.0 / self.test_rate.si()),
                period: nanos(1.0 / self.rate.si()),
                reported: None,
                passed: 0,
                counts: [0; 3],
                rows: 0,
                next_test: Time::MIN,
                next_row: Time::MIN,
            }))
        }
    }
}
