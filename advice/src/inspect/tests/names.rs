//! Names of fields as loggers of robots write them.

use super::loggers::{log, text};
use super::*;

/// A minute at 100 Hz, level, turned slowly about all axes.
fn moved(header: &str) -> Log {
    let row = |k: usize| {
        let t = 0.01 * k as f64;
        let w = |axis: f64| 0.1 * (t + axis).sin();
        format!(
            "{t:.2},{:.5},{:.5},{:.5},{:.4},{:.4},{:.4}",
            w(0.0),
            w(1.0),
            w(2.0),
            noise(t, 1.0),
            noise(t, 2.0),
            9.81 + noise(t, 3.0)
        )
    };
    log("imu.csv", &text(header, 6000, &row))
}

/// Names and unit of a quantity.
fn found(log: &Log, kind: Kind) -> Option<(Vec<String>, String)> {
    log.signal(kind).map(|s| (s.names(&log.table), s.unit.clone()))
}

#[test]
fn fields_of_px4_and_ros_are_known() {
    for (rate, force, unit) in [
        (
            "gyro_rad[0],gyro_rad[1],gyro_rad[2]",
            "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]",
            "rad/s",
        ),
        (
            "angular_velocity.x,angular_velocity.y,angular_velocity.z",
            "linear_acceleration.x,linear_acceleration.y,linear_acceleration.z",
            "rad/s",
        ),
        (
            "imu.angular_velocity.x,imu.angular_velocity.y,imu.angular_velocity.z",
            "imu.acc.x,imu.acc.y,imu.acc.z",
            "rad/s",
        ),
    ] {
        let log = moved(&format!("t_s,{rate},{force}"));
        let names = |list: &str| list.split(',').map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(found(&log, Kind::AngularRate).unwrap(), (names(rate), unit.to_owned()));
        assert_eq!(found(&log, Kind::SpecificForce).unwrap(), (names(force), "m/s^2".to_owned()));
    }
    let angles = moved("t_s,DeltaTheta[0],DeltaTheta[1],DeltaTheta[2],ax,ay,az");
    assert_eq!(found(&angles, Kind::AngularRate).unwrap().1, "rad");
    assert!(angles.signal(Kind::AngularRate).unwrap().increment);
    let row = |k: usize| format!("{k}.0,{:.3},{:.3},0.1", 3.0 + noise(k as f64, 1.0), noise(k as f64, 2.0));
    let gps = log("gps.csv", &text("t_s,vel_n_m_s,vel_e_m_s,vel_d_m_s", 60, &row));
    assert_eq!(found(&gps, Kind::Velocity).unwrap().1, "m/s");
}

#[test]
fn where_one_half_of_a_unit_has_a_name_the_other_half_is_found_next_to_it() {
    let log = moved("t_s,gyro_x,gyro_y,gyro_z,c1,c2,c3");
    assert_eq!(found(&log, Kind::SpecificForce).unwrap().0, ["c1", "c2", "c3"]);
    let log = moved("t_s,c1,c2,c3,ax,ay,az");
    assert_eq!(found(&log, Kind::AngularRate).unwrap().0, ["c1", "c2", "c3"]);
}

#[test]
fn a_setpoint_is_no_attitude_and_a_rate_of_turn_has_a_unit() {
    let row = |k: usize| {
        format!(
            "{k}.0,{:.3},0.1,{:.3},{:.1}",
            0.1 * noise(k as f64, 1.0),
            0.01 * k as f64,
            20.0 * noise(k as f64, 2.0)
        )
    };
    let log = log(
        "control.csv",
        &text("t_s,roll_setpoint,pitch_setpoint,yaw_setpoint,yaw_rate", 60, &row),
    );
    assert!(log.signal(Kind::Euler).is_none() && log.signal(Kind::Heading).is_none());
    assert_eq!(found(&log, Kind::YawRate).unwrap().1, "deg/s");
}

#[test]
fn one_stamp_of_zero_among_stamps_of_a_calendar_does_not_stop_the_look() {
    let mut imu = unit();
    imu.columns[0].values.iter_mut().for_each(|t| *t += 1.7e9);
    imu.columns[0].values[0] = 0.0;
    let mut places = fixes(1.0);
    places.columns[0].values.iter_mut().for_each(|t| *t += 1.6e9);
    let looked = Inspection::look(vec![Log::of(imu), Log::of(places)]);
    assert!(looked.imu.is_some() && looked.position.is_some());
}
