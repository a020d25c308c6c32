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

/// Files of a boat on a winding way: fixes each second, and `vx vy vz` five times a second in some axes, without a unit.
fn afloat(name: &str, own: impl Fn([f64; 2]) -> [f64; 3]) -> Inspection {
    let folder = std::env::temp_dir().join(format!("fusion-inspect-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let noise = |k: f64| (12.9898 * k).sin();
    let (mut fixes, mut speeds) = ("time,lat,lon,alt\n".to_owned(), "time,vx,vy,vz\n".to_owned());
    let (mut course, mut at) = (0.0_f64, [0.0, 0.0]);
    for k in 0..1500 {
        let t = 0.2 * f64::from(k);
        course += 0.2 * 0.1 * (0.05 * t).sin();
        let v = [2.0 * course.cos(), 2.0 * course.sin()];
        let said = own(v).map(|v| v + 0.02 * noise(t + v));
        speeds += &format!("{t:.1},{:.4},{:.4},{:.4}\n", said[0], said[1], said[2]);
        if k % 5 == 0 {
            let [lat, lon] = [45.0 + at[0] / 111_132.95, 8.0 + at[1] / 78_847.0];
            fixes += &format!("{t:.1},{lat:.8},{lon:.8},{:.2}\n", 10.0 + 0.1 * noise(t));
        }
        (0..2).for_each(|i| at[i] += 0.2 * v[i]);
    }
    std::fs::write(folder.join("fixes.csv"), fixes).unwrap();
    std::fs::write(folder.join("speeds.csv"), speeds).unwrap();
    let looked = Inspection::of(&[folder.join("fixes.csv"), folder.join("speeds.csv")]).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    looked
}

#[test]
fn a_velocity_without_a_unit_is_read_in_the_axes_that_the_positions_show() {
    let of = |looked: &Inspection, kind: Kind| looked.logs[1].signal(kind).map(|s| s.names(&looked.logs[1].table));
    let body = afloat("body", |v| [v[0].hypot(v[1]), 0.0, 0.0]);
    assert_eq!(of(&body, Kind::BodyVelocity).unwrap(), ["vx", "vy", "vz"]);
    let world = afloat("world", |v| [v[1], v[0], 0.0]);
    assert_eq!(of(&world, Kind::Velocity).unwrap(), ["vy", "vx", "-vz"]);
    assert!(
        world.position.as_ref().unwrap().1.is_reported,
        "the velocity belongs to the positions"
    );
    let scaled = afloat("scaled", |v| [0.1 * v[0], 0.1 * v[1], 0.0]);
    assert!(of(&scaled, Kind::Velocity).is_none() && of(&scaled, Kind::BodyVelocity).is_none());
}
