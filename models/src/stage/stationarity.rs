//! The stationarity detector: rows while the vehicle stands still.
//!
//! Output     mean raw `angular_rate` [rad/s] and `specific_force` [m/s²] of the window, valid
//!            at its end, at `rate` while still
//! Test       [`still`](super::still) with the filter's own gyro bias; optionally a GNSS speed
//! Used by    zero velocity, zero angular rate

use super::still::{StillSpec, StillTest};
use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
use crate::units::{Dimensional, Positive, dim};
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Quantity, Vector, View};
use fusion_core::time::{Time, nanos};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// Emits rows while the vehicle stands still, judged by the IMU and, where declared, by GNSS.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StationaritySpec {
    /// The IMU stream.
    source: String,
    /// Rows per second while still.
    rate: Positive<dim::Frequency>,
    /// The bounds of stillness.
    still: StillSpec,
    /// A second witness: the speed GNSS reports.
    gnss: Option<GnssWitness>,
}

/// GNSS as a witness of stillness.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GnssWitness {
    /// A stream with a `velocity` channel.
    source: String,
    /// Still only below this speed.
    max_speed: Positive<dim::Speed>,
    /// A report older than this is no witness, for or against.
    max_age: Positive<dim::Duration>,
}

crate::register!(Stage, "stationarity", StationaritySpec, r#"
source = "imu"
rate = "10 Hz"
still = { window = "1 s", accel_std = "0.2 m/s^2", gyro_std = ["1 deg/s", "1 deg/s", "0.2 deg/s"], mean_rate = "1 deg/s" }
gnss = { source = "gnss", max_speed = "0.3 m/s", max_age = "2 s" }
"#);

#[typetag::deserialize(name = "stationarity")]
impl StageSpec for StationaritySpec {
    fn inputs(&self) -> Vec<Listen> {
        let mut inputs = vec![Listen { source: self.source.clone(), channels: imu_channels() }];
        if let Some(gnss) = &self.gnss {
            let velocity = Channel::vector("velocity", 3, dim::Speed::KIND.dimension);
            inputs.push(Listen { source: gnss.source.clone(), channels: vec![velocity] });
        }
        inputs
    }

    fn output(&self) -> Vec<Channel> {
        imu_channels()
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
        Ok(Box::new(Stationarity {
            test: StillTest::new(&self.still),
            gyro_bias: b.quantity("gyro_bias").ok(),
            period: nanos(1.0 / self.rate.si()),
            witness: self.gnss.as_ref().map(|g| (g.max_speed.si(), g.max_age.si())),
            speed: None,
            next: Time::MIN,
        }))
    }
}

/// The channels of an IMU.
pub(crate) fn imu_channels() -> Vec<Channel> {
    vec![
        Channel::vector("angular_rate", 3, dim::AngularRate::KIND.dimension),
        Channel::vector("specific_force", 3, dim::Acceleration::KIND.dimension),
    ]
}

#[derive(Debug)]
struct Stationarity {
    test: StillTest,
    gyro_bias: Option<Quantity<Vector<3>>>,
    period: i64,
    witness: Option<(f64, f64)>,
    speed: Option<(Time, f64)>,
    next: Time,
}

impl Stage for Stationarity {
    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter) {
        if input == 1 {
            self.speed = Some((time, Vector3::new(row[0], row[1], row[2]).norm()));
            return;
        }
        self.test.push(time.seconds(), Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
        let Some(view) = view else { return };
        if time < self.next {
            return;
        }
        let bias = self.gyro_bias.as_ref().map_or_else(Vector3::zeros, |q| view.get(q));
        let contradicted = self.witness.is_some_and(|(max_speed, max_age)| {
            self.speed.is_some_and(|(t, speed)| time.seconds_since(t) <= max_age && speed > max_speed)
        });
        if contradicted || !self.test.is_still(&bias) {
            return;
        }
        self.next = time.shifted(self.period);
        let [w, f] = self.test.means();
        out.emit(time, &[w.x, w.y, w.z, f.x, f.y, f.z]);
    }
}
