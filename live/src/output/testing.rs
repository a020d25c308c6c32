//! An estimate with known numbers, and a link that keeps what is sent.

use super::{About, Outgoing};
use crate::link::Sender;
use fusion::core::geometry::so3::from_rpy;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::{EstimateClock, Origin};
use fusion::solution::Solution;
use nalgebra::{Matrix3, Vector3};
use std::io;
use std::sync::Arc;

/// 2025-07-08 19:34:18.25 UTC in nanoseconds of GPS time: 16 620 days and 18 leap seconds after 1980-01-06.
pub(super) const NOW: i64 = (16_620 * 86_400 + 18 + 70_458) * 1_000_000_000 + 250_000_000;

/// Ten seconds after time zero.
pub(super) fn about() -> About {
    About {
        description: "a test".to_owned(),
        origin: Origin::default(),
        clock: EstimateClock {
            time_zero: Some(NOW - 10_000_000_000),
        },
        sensors: Vec::new(),
    }
}

/// The largest error of the position is 3 m towards 30°, across it is 1 m, and 2 m down. The speed is 5 m/s.
pub(super) fn estimate() -> Outgoing {
    let place = Geodetic {
        lat: (47.0 + 17.11437 / 60.0_f64).to_radians(),
        lon: -(8.0 + 33.91522 / 60.0_f64).to_radians(),
        height: 545.4,
    };
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
    let p = turn * Matrix3::from_diagonal(&Vector3::new(9.0, 1.0, 4.0)) * turn.transpose();
    let rpy = [1_f64, 2.0, 123.456].map(f64::to_radians);
    Outgoing {
        number: 0,
        solution: Some(Solution {
            time: Time::from_seconds(10.0),
            position: Some((place, p)),
            velocity: Some((Vector3::new(3.0, -4.0, 0.5), Matrix3::from_diagonal_element(0.04))),
            attitude: Some((
                from_rpy(rpy[0], rpy[1], rpy[2]),
                Matrix3::from_diagonal_element(1_f64.to_radians().powi(2)),
            )),
            ..Solution::default()
        }),
        time: Time::from_seconds(10.0),
        gps_nanos: Some(NOW),
        age: Some(0.0625),
        health: State::Good,
        reasons: Arc::default(),
        waits_for: Arc::default(),
        sensors: Arc::default(),
    }
}

/// Keeps what is sent.
#[derive(Default)]
pub(super) struct Kept(pub(super) Vec<u8>);

impl Sender for Kept {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.extend(bytes);
        Ok(())
    }
}
