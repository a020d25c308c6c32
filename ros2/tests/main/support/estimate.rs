//! An estimate whose messages are known in closed form.

use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::{EstimateClock, Origin};
use fusion::solution::Solution;
use fusion_live::{About, Outgoing, SensorNow};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// 2023-11-14T22:13:20Z, as seconds since 1970 and as nanoseconds of GPS time: 315 964 800 s before 1980, 18 leap seconds.
pub const UNIX: f64 = 1_700_000_000.0;
const GPS_NANOS: i64 = (1_700_000_000 - 315_964_800 + 18) * 1_000_000_000;

pub fn about() -> About {
    let mut about = About::default();
    about.origin = Origin::default();
    about.clock = EstimateClock {
        time_zero: Some(GPS_NANOS),
    };
    about.sensors = vec!["gnss".to_owned(), "baro".to_owned()];
    about
}

/// Heading north at 3 m/s from the origin.
pub fn estimate(seconds: f64) -> Outgoing {
    let mut place = Geodetic {
        lat: 0.8,
        lon: 0.2,
        height: 100.0,
    };
    place.lat += 3.0 * seconds / place.metres_per_radian().0;
    let mut estimate = Outgoing::default();
    estimate.time = Time::from_seconds(seconds);
    estimate.solution = Some(Solution {
        time: estimate.time,
        position: Some((place, Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 9.0)))),
        velocity: Some((Vector3::new(3.0, 0.0, 0.0), Matrix3::from_diagonal(&Vector3::new(0.25, 0.5, 0.75)))),
        attitude: Some((UnitQuaternion::identity(), Matrix3::zeros())),
        with_attitude: [Matrix3::zeros(); 2],
    });
    estimate.health = State::Good;
    let mut gnss = SensorNow::default();
    (gnss.time, gnss.used, gnss.rejected, gnss.is_used, gnss.nis) = (Some(estimate.time), 7, 2, true, Some(1.5));
    estimate.sensors = [gnss, SensorNow::default()].into();
    estimate
}
