//! What is found in tables whose content is known.

use super::signal::Kind;
use super::*;
use crate::source::table::Column;

/// A table of columns by name.
fn table(columns: &[(&str, &dyn Fn(f64) -> f64)], rows: usize, rate: f64) -> Table {
    let column = |(name, of): &(&str, &dyn Fn(f64) -> f64)| Column {
        name: (*name).to_owned(),
        first: String::new(),
        values: (0..rows).map(|k| of(k as f64 / rate)).collect(),
    };
    Table {
        path: "log.csv".into(),
        header: true,
        columns: columns.iter().map(column).collect(),
        ..Table::default()
    }
}

/// A number between -1 and 1 that changes from row to row without a pattern.
fn noise(t: f64, seed: f64) -> f64 {
    let x = ((t * 1000.0).round() * 12.9898 + seed * 78.233).sin() * 43_758.545;
    2.0 * (x - x.floor()) - 1.0
}

/// A minute at 50 Hz: twenty seconds at rest, z down, then shaken; one g and a bias of 0.01 rad/s about y.
fn unit() -> Table {
    let shaken = |t: f64, size: f64, seed: f64| noise(t, seed) * if t < 20.0 { 0.01 } else { size };
    table(
        &[
            ("t_s", &|t| t),
            ("ax", &move |t| shaken(t, 1.0, 1.0)),
            ("ay", &move |t| shaken(t, 1.0, 2.0)),
            ("az", &move |t| -9.81 + shaken(t, 1.0, 3.0)),
            ("gx_dps", &move |t| shaken(t, 20.0, 4.0)),
            ("gy_dps", &move |t| 0.573 + shaken(t, 20.0, 5.0)),
            ("gz_dps", &move |t| shaken(t, 20.0, 6.0)),
        ],
        3000,
        50.0,
    )
}

#[test]
fn quantities_and_units_are_found_by_names_and_values() {
    let log = Log::of(unit());
    let force = log.signal(Kind::SpecificForce).unwrap();
    assert_eq!(
        (force.names(&log.table), force.unit.as_str()),
        (vec!["ax".into(), "ay".into(), "az".into()], "m/s^2")
    );
    assert!(force.why.contains("median length 9.8"), "{}", force.why);
    let rate = log.signal(Kind::AngularRate).unwrap();
    assert_eq!((rate.unit.as_str(), rate.factor), ("deg/s", 1_f64.to_radians()));
    assert!((log.rate() - 50.0).abs() < 1e-6 && log.signals.len() == 2, "{:?}", log.signals);
    // The same in g, and without names.
    let mut in_g = unit();
    in_g.columns[1..4]
        .iter_mut()
        .for_each(|c| c.values.iter_mut().for_each(|v| *v /= 9.80665));
    assert_eq!(Log::of(in_g).signal(Kind::SpecificForce).unwrap().unit, "g");
    let mut bare = unit();
    bare.header = false;
    let bare = Log::of(bare);
    assert_eq!(bare.signal(Kind::SpecificForce).unwrap().columns[0].0, 1);
    assert_eq!(bare.signal(Kind::AngularRate).unwrap().columns[0].0, 4);
}

#[test]
fn rest_gravity_and_bias_of_a_unit_are_found() {
    let log = Log::of(unit());
    let imu = Imu::of(&log, &|_| None).unwrap();
    // z points down: up is its opposite. The samples are level to 0.01 of 9.81 m/s².
    assert_eq!(imu.up, (2, true));
    assert!(imu.tilt < 0.005 && (imu.gravity[2] + 9.81).abs() < 0.005, "{imu:?}");
    let rest = imu.rest.unwrap();
    // Windows of a second: of 59 whole ones the first 19 or 20.
    assert!((rest.share - 1.0 / 3.0).abs() < 0.02, "{rest:?}");
    assert!(rest.first.0 < 0.1 && (rest.first.1 - 20.0).abs() < 1.1, "{rest:?}");
    // Evenly spread between ±0.01: 0.0058; 95 % of windows of 50 are within a fifth above.
    assert!(rest.accel_std.iter().all(|s| (0.0055..0.007).contains(s)), "{rest:?}");
    let degree = 1_f64.to_radians();
    assert!(
        rest.gyro_std.iter().all(|s| (0.0055 * degree..0.007 * degree).contains(s)),
        "{rest:?}"
    );
    // 0.573 deg/s; the mean of the noise over a second is within 0.002 deg/s.
    assert!((rest.bias[1] - 0.573 * degree).abs() < 0.003 * degree, "{rest:?}");
    // σ √Δt, by 19 differences of three axes: within half.
    let density = 0.0058 / 50_f64.sqrt();
    assert!((0.5..1.5).contains(&(rest.accel_noise / density)), "{rest:?}");
    assert!(rest.motion.0 > 0.5 && rest.motion.1 > 10.0 * degree, "{rest:?}");
}

#[test]
fn rest_is_where_the_reported_speed_says_so() {
    let log = Log::of(unit());
    let told = Imu::of(&log, &|t| Some(if t > 40.0 { 0.0 } else { 5.0 })).unwrap().rest.unwrap();
    assert!(
        (told.first.0 - 40.0).abs() < 1.1 && (told.share - 1.0 / 3.0).abs() < 0.03,
        "{told:?}"
    );
}

/// Five minutes at 1 Hz northwards at 3 m/s, climbing at 0.5 m/s; the reported vertical velocity by `sign`.
fn fixes(sign: f64) -> Table {
    table(
        &[
            ("t", &|t| t),
            ("lat_deg", &|t| 45.0 + (3.0 * t + 0.2 * noise(t, 7.0)) / 6.371e6_f64.to_radians()),
            ("lon_deg", &|t| 10.0 + 1e-9 * noise(t, 8.0)),
            ("alt_m", &|t| 100.0 + 0.5 * t),
            ("vn", &|t| 3.0 + 0.01 * noise(t, 9.0)),
            ("ve", &|t| 0.01 * noise(t, 10.0)),
            ("vd", &move |t| sign * (0.5 + 0.01 * noise(t, 11.0))),
            ("sn_m", &|t| 0.5 + 0.01 * noise(t, 12.0)),
            ("se_m", &|_| 0.5),
            ("sd_m", &|_| 1.0),
        ],
        300,
        1.0,
    )
}

#[test]
fn way_scatter_and_reported_velocity_of_fixes_are_found() {
    let track = Track::of(&Log::of(fixes(-1.0))).unwrap();
    // 299 intervals of 3 m, the noise of both ends apart.
    assert!((track.way - 897.0).abs() < 1.0, "{}", track.way);
    // One axis, evenly spread between ±0.2 m, as if it were one of two: 0.1 to 0.2 m.
    assert!((0.05..0.2).contains(&track.scatter), "{}", track.scatter);
    assert_eq!(track.claimed.map(|c| (c * 10.0).round()), Some(5.0));
    assert!((track.top_speed() - 3.0).abs() < 0.02 && (track.rate() - 1.0).abs() < 1e-9);
    let agreement = track.agreement.unwrap();
    assert!(
        (agreement[0] - 1.0).abs() < 0.01 && (agreement[2] - 1.0).abs() < 0.01,
        "{agreement:?}"
    );
    // Up where down is expected.
    let up = Track::of(&Log::of(fixes(1.0))).unwrap().agreement.unwrap();
    assert!((up[2] + 1.0).abs() < 0.01, "{up:?}");
    // Without a reported velocity it is that of the positions.
    let mut silent = fixes(-1.0);
    silent.columns.drain(4..7);
    let silent = Track::of(&Log::of(silent)).unwrap();
    assert!(
        !silent.is_reported && (silent.top_speed() - 3.0).abs() < 0.6,
        "{}",
        silent.top_speed()
    );
}

#[test]
fn rows_that_do_not_change_are_counted() {
    let log = Log::of(unit());
    let force = log.signal(Kind::SpecificForce).unwrap();
    assert_eq!(log.repeats(force).share, 0.0);
    // From 10 s to 14 s the instrument is stuck; one axis that goes on is not enough to be alive.
    let mut stuck = unit();
    for k in 1..4 {
        let held = stuck.columns[k].values[500];
        stuck.columns[k].values[500..700].fill(held);
    }
    let log = Log::of(stuck);
    let repeats = log.repeats(log.signal(Kind::SpecificForce).unwrap());
    assert!((repeats.share - 199.0 / 2999.0).abs() < 1e-9, "{repeats:?}");
    // From the first row of the held value to the last.
    assert!((repeats.longest - 199.0 / 50.0).abs() < 1e-6, "{repeats:?}");
    assert_eq!(log.repeats(log.signal(Kind::AngularRate).unwrap()).share, 0.0);
}

#[test]
fn a_stuck_instrument_is_declared_by_its_repeats() {
    let mut held = unit();
    for column in &mut held.columns[1..] {
        (0..3000).for_each(|row| column.values[row] = column.values[row - row % 2]);
    }
    let text = Inspection::look(vec![Log::of(held)]).design(Path::new("/")).unwrap();
    assert!(
        text.contains("repeats = \"drop\"") && text.contains("50 % of the rows repeat"),
        "{text}"
    );
    let sound = Inspection::look(vec![Log::of(unit())]).design(Path::new("/")).unwrap();
    assert!(!sound.contains("repeats"), "{sound}");
}

#[test]
fn several_recordings_in_a_file_are_named_and_refused() {
    let mut twice = unit();
    let half = twice.rows() / 2;
    (half..2 * half).for_each(|row| twice.columns[0].values[row] -= 25.0);
    let looked = Inspection::look(vec![Log::of(twice)]);
    assert_eq!(looked.logs[0].clock.as_ref().unwrap().resets, 1);
    let missing = looked.missing().join("\n");
    assert!(
        missing.contains("goes back by more than a second 1 time") && missing.contains("time.plus"),
        "{missing}"
    );
    assert!(looked.design(Path::new("/")).is_err());
    assert!(!Inspection::look(vec![Log::of(unit())]).missing().join("\n").contains("goes back"));
}
