//! The files of other programs, written by a run of the command's demonstration and read back.

use super::ellipse::Ellipses;
use super::sbet;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::time::Time;
use fusion::output::EstimateClock;
use fusion::solution::Solution;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

fn place(north: f64) -> Geodetic {
    let mut place = Geodetic {
        lat: 0.8,
        lon: 0.2,
        height: 100.0,
    };
    place.lat += north / place.metres_per_radian().0;
    place
}

#[test]
fn an_ellipse_has_three_sigma_as_its_axes_and_does_not_overlap_with_the_one_before() {
    let mut ellipses = Ellipses::default();
    // 2 m along the direction 30° east of north, 1 m across.
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 30_f64.to_radians());
    let covariance = turn * Matrix3::from_diagonal(&Vector3::new(4.0, 1.0, 9.0)) * turn.inverse();
    let ring = ellipses.next(&place(0.0), &covariance).unwrap();
    let (north, east) = place(0.0).metres_per_radian();
    let corners: Vec<(f64, f64)> = ring.iter().map(|(lat, lon)| (north * (lat - 0.8), east * (lon - 0.2))).collect();
    assert!((corners[0].0 - corners[36].0).abs() < 1e-9 && (corners[0].1 - corners[36].1).abs() < 1e-9);
    let along = |of: &(f64, f64), degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        of.0 * cosine + of.1 * sine
    };
    let reach = |degrees: f64| corners.iter().map(|corner| along(corner, degrees)).fold(0.0, f64::max);
    // A corner every 10° may miss the end of an axis by 1 − cos 5°.
    assert!((reach(30.0) - 6.0).abs() < 0.03 && (reach(120.0) - 3.0).abs() < 0.02, "{corners:?}");
    // Counter-clockwise with east to the right: the area is positive.
    let area: f64 = corners.windows(2).map(|w| w[0].1 * w[1].0 - w[1].1 * w[0].0).sum();
    assert!(area > 0.0);
    assert!(ellipses.next(&place(11.9), &covariance).is_none());
    assert!(ellipses.next(&place(12.1), &covariance).is_some());
}

#[test]
fn a_record_of_sbet_has_its_fields_in_their_order() {
    // 2025-07-08T19:34:18 UTC is a Tuesday, and GPS time is 18 s ahead: 2 days, 19 h, 34 min, 36 s.
    let zero = fusion::source::table::gps_of_unix(1_752_003_258.0).unwrap();
    let clock = EstimateClock {
        time_zero: Some((zero * 1e9) as i64),
    };
    let solution = Solution {
        time: Time::from_seconds(0.25),
        position: Some((place(0.0), Matrix3::identity())),
        velocity: Some((Vector3::new(1.0, -2.0, 3.0), Matrix3::identity())),
        attitude: Some((UnitQuaternion::from_euler_angles(0.1, -0.2, 2.5), Matrix3::identity())),
        ..Solution::default()
    };
    let second = f64::from(((2 * 24 + 19) * 60 + 34) * 60 + 36) + 0.25;
    let expected = [second, 0.8, 0.2, 100.0, 1.0, -2.0, 3.0, 0.1, -0.2, 2.5];
    let record = sbet::record(&solution, clock).unwrap();
    for (found, wanted) in record.iter().zip(expected.into_iter().chain([0.0; 7])) {
        // The angles go through a quaternion: a few ε.
        assert!((found - wanted).abs() < 1e-15, "{record:?}");
    }
    // Without a date, the time is that of the log. A value that is not estimated is NaN. A record needs a position.
    let bare = Solution {
        velocity: None,
        attitude: None,
        ..solution
    };
    let record = sbet::record(&bare, EstimateClock::default()).unwrap();
    assert_eq!(record[..4], [0.25, 0.8, 0.2, 100.0]);
    assert!(record[4..10].iter().all(|number| number.is_nan()), "{record:?}");
    assert_eq!(record[10..], [0.0; 7]);
    assert_eq!(
        sbet::record(
            &Solution {
                position: None,
                ..solution
            },
            clock
        ),
        None
    );
}
