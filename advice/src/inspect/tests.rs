//! Results for tables with known content.

use super::signal::Kind;
use super::*;
use fusion::source::table::LogColumn;

mod field;
mod loggers;
mod names;
mod roles;
mod sigmas;
mod stamps;
mod text;
mod types;
mod values;
mod water;
mod wheels;

/// A table of columns by name.
fn table(columns: &[(&str, &dyn Fn(f64) -> f64)], rows: usize, rate: f64) -> LogTable {
    let column = |(name, of): &(&str, &dyn Fn(f64) -> f64)| LogColumn {
        name: (*name).to_owned(),
        values: (0..rows).map(|k| of(k as f64 / rate)).collect(),
        ..LogColumn::default()
    };
    LogTable {
        path: "log.csv".into(),
        header: true,
        columns: columns.iter().map(column).collect(),
        ..LogTable::default()
    }
}

/// A number between -1 and 1 that changes from row to row without a pattern.
fn noise(t: f64, seed: f64) -> f64 {
    let x = ((t * 1000.0).round() * 12.9898 + seed * 78.233).sin() * 43_758.545;
    2.0 * (x - x.floor()) - 1.0
}

/// A minute at 50 Hz: twenty seconds at rest, z down, then shaken; one g, and a bias of 0.01 rad/s about y.
fn unit() -> LogTable {
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
    // Windows of a second: the first 19 or 20 of 59 whole ones.
    assert!((rest.share - 1.0 / 3.0).abs() < 0.02, "{rest:?}");
    assert!(rest.first.0 < 0.1 && (rest.first.1 - 20.0).abs() < 1.1, "{rest:?}");
    // Uniform between ±0.01: 1σ is 0.0058; 95 % of windows of 50 samples are at most a fifth above.
    assert!(rest.accel_std.iter().all(|s| (0.0055..0.007).contains(s)), "{rest:?}");
    let degree = 1_f64.to_radians();
    assert!(
        rest.gyro_std.iter().all(|s| (0.0055 * degree..0.007 * degree).contains(s)),
        "{rest:?}"
    );
    // 0.573 deg/s; the mean of the noise over a second is within 0.002 deg/s.
    assert!((rest.bias[1] - 0.573 * degree).abs() < 0.003 * degree, "{rest:?}");
    // σ √Δt, from 19 differences of three axes: within half.
    let density = 0.0058 / 50_f64.sqrt();
    assert!((0.5..1.5).contains(&(rest.accel_noise / density)), "{rest:?}");
    assert!(rest.times == 2.0 && rest.passing == 0.0, "{rest:?}");
}

#[test]
fn slow_motion_is_no_rest() {
    // Ten minutes, shaken by 0.01 to 1 m/s² from second to second, as a creeping car: windows of every strength.
    let strength = |t: f64| 10_f64.powf(-1.0 + noise(t.floor(), 9.0));
    let mut creeping = unit();
    creeping.columns = table(
        &[
            ("t_s", &|t| t),
            ("ax", &move |t| strength(t) * noise(t, 1.0)),
            ("ay", &move |t| strength(t) * noise(t, 2.0)),
            ("az", &move |t| -9.81 + strength(t) * noise(t, 3.0)),
            ("gx_dps", &move |t| 5.0 * strength(t) * noise(t, 4.0)),
            ("gy_dps", &move |t| 5.0 * strength(t) * noise(t, 5.0)),
            ("gz_dps", &move |t| 5.0 * strength(t) * noise(t, 6.0)),
        ],
        30_000,
        50.0,
    )
    .columns;
    let imu = Imu::of(&Log::of(creeping), &|_| None).unwrap();
    assert!(imu.rest.is_none(), "{imu:?}");
}

#[test]
fn rest_is_where_the_reported_speed_says_so() {
    let log = Log::of(unit());
    let told = Imu::of(&log, &|t| Some((5.0..15.0).contains(&t))).unwrap().rest.unwrap();
    assert!(
        (told.first.0 - 5.0).abs() < 1.1 && (told.share - 1.0 / 6.0).abs() < 0.03,
        "{told:?}"
    );
}

#[test]
fn a_slow_unit_that_is_shaken_and_turns_is_not_at_rest() {
    // From 20 s on it is shaken by up to 1 m/s² and turns by up to 20 deg/s about each axis.
    let hover = |from: f64| Imu::of(&Log::of(unit()), &|t| Some(t > from)).unwrap().rest;
    assert!(hover(40.0).is_none());
    assert!(hover(15.0).is_some_and(|rest| rest.first.1 < 6.1), "{:?}", hover(15.0));
}

/// Five minutes at 1 Hz northwards at 3 m/s, climbing at 0.5 m/s; the reported vertical velocity has the factor `sign`.
fn fixes(sign: f64) -> LogTable {
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
    let track = Track::of(&Log::of(fixes(-1.0)), None).unwrap();
    // 299 intervals of 3 m, except for the noise of both ends.
    assert!((track.way - 897.0).abs() < 1.0, "{}", track.way);
    // One axis, uniform between ±0.2 m, evaluated as one of two: 0.1 to 0.2 m.
    assert!((0.05..0.2).contains(&track.scatter), "{}", track.scatter);
    assert_eq!(track.claimed.map(|c| (c * 10.0).round()), Some(5.0));
    assert!((track.top_speed() - 3.0).abs() < 0.02 && (track.rate() - 1.0).abs() < 1e-9);
    let agreement = track.agreement.unwrap();
    assert!(
        (agreement[0] - 1.0).abs() < 0.01 && (agreement[2] - 1.0).abs() < 0.01,
        "{agreement:?}"
    );
    // Up instead of the expected down.
    let up = Track::of(&Log::of(fixes(1.0)), None).unwrap().agreement.unwrap();
    assert!((up[2] + 1.0).abs() < 0.01, "{up:?}");
    // Without a reported velocity, it comes from the positions.
    let mut silent = fixes(-1.0);
    silent.columns.drain(4..7);
    let silent = Track::of(&Log::of(silent), None).unwrap();
    assert!(
        !silent.is_reported && (silent.top_speed() - 3.0).abs() < 0.6,
        "{}",
        silent.top_speed()
    );
}

#[test]
fn every_column_is_used_or_named() {
    let mut odd = unit();
    let rows = odd.rows();
    let more: [(&str, &dyn Fn(usize) -> f64); 4] = [
        ("temperature", &|k| 20.0 + (k % 9) as f64),
        ("flag", &|_| 3.0),
        ("est_x", &|k| k as f64),
        ("note", &|_| f64::NAN),
    ];
    odd.columns.extend(more.map(|(name, of)| LogColumn {
        name: name.to_owned(),
        values: (0..rows).map(of).collect(),
        ..LogColumn::default()
    }));
    let page = Inspection::look(vec![Log::of(odd)]).page();
    let section = page.sections.iter().find(|s| s.title == "Not used").unwrap();
    let said = format!("{section:?}");
    for words in ["temperature", "no quantity is known", "always 3", "another filter", "no numbers"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(!said.contains("\"ax\""), "{said}");
}

#[test]
fn a_pressure_becomes_a_barometer() {
    let air = table(
        &[("t", &|t| t), ("pressure_pa", &|t| 1e5 - 6.0 * t + 10.0 * noise(t, 20.0))],
        300,
        1.0,
    );
    let mut shaken = unit();
    shaken.path = "imu.csv".into();
    let looked = Inspection::look(vec![Log::of(shaken), Log::of(fixes(-1.0)), Log::of(air)]);
    let design = looked.design(Path::new("/")).unwrap();
    // The first ten seconds are 999.6 to 999.8 hPa, at 100 m. In the standard atmosphere, the pressure at height zero
    // is 1.01194 times as high.
    assert!(
        design.contains("type = \"barometer\"") && design.contains("initial = \"1011."),
        "{design}"
    );
}

#[test]
fn a_heading_that_does_not_follow_the_course_is_not_decided() {
    let mut looked = Inspection::look(vec![Log::of(fixes(-1.0))]);
    let mut reference = table(
        &[
            ("t", &|t| t),
            ("roll_rad", &|t| 0.1 * noise(t, 30.0)),
            ("pitch_rad", &|t| 0.1 * noise(t, 31.0)),
            ("yaw_rad", &|t| 3.0 * noise(t, 32.0)),
        ],
        300,
        1.0,
    );
    reference.path = "ahrs.csv".into();
    looked.logs.push(Log::of(reference));
    let looked = Inspection::look(looked.logs);
    let design = looked.design(Path::new("/")).unwrap();
    assert!(looked.yaw.is_some_and(|yaw| yaw.agreement < 0.5), "{:?}", looked.yaw);
    assert!(
        design.contains("not decided") && design.contains("rpy = [\"roll_rad\", \"pitch_rad\", \"yaw_rad\"], unit"),
        "{design}"
    );
}

/// The columns of the unit, renamed from the second column on.
fn named(names: [&str; 6]) -> Log {
    let mut of = unit();
    for (column, name) in of.columns[1..].iter_mut().zip(names) {
        column.name = name.to_owned();
    }
    Log::of(of)
}

#[test]
fn axes_of_a_body_are_found_by_their_words() {
    let mg = [
        "acc_fwd_mg",
        "acc_left_mg",
        "acc_down_mg",
        "rot_fwd_dps",
        "rot_left_dps",
        "rot_down_dps",
    ];
    let bracketed = [
        "acc_fwd [mg]",
        "acc_left [mg]",
        "acc_down [mg]",
        "rot_fwd [deg/s]",
        "rot_left [deg/s]",
        "rot_down [deg/s]",
    ];
    let bare = ["acc_fwd", "acc_left", "acc_down", "rot_fwd", "rot_left", "rot_down"];
    for names in [mg, bracketed, bare] {
        let log = named(names);
        let force = log.signal(Kind::SpecificForce).unwrap();
        let rate = log.signal(Kind::AngularRate).unwrap();
        // Left is the opposite of right.
        assert_eq!(force.columns, [(1, false), (2, true), (3, false)], "{names:?}");
        assert_eq!(rate.columns, [(4, false), (5, true), (6, false)], "{names:?}");
        assert!(force.is_body && rate.unit == "deg/s", "{names:?} {}", rate.unit);
    }
}

#[test]
fn where_no_name_tells_the_unit_its_values_do() {
    let log = named(["r1", "r2", "r3", "s1", "s2", "s3"]);
    let force = log.signal(Kind::SpecificForce).unwrap();
    assert_eq!((force.columns[0].0, force.unit.as_str()), (1, "m/s^2"));
    assert_eq!(log.signal(Kind::AngularRate).unwrap().columns[0].0, 4);
    // In units of 0.001 g.
    let mut mg = unit();
    for column in &mut mg.columns[1..4] {
        column.values.iter_mut().for_each(|v| *v *= 1000.0 / 9.80665);
    }
    mg.header = false;
    assert_eq!(Log::of(mg).signal(Kind::SpecificForce).unwrap().unit, "mg");
}

#[test]
fn places_along_north_and_east_and_headings_are_found_by_name() {
    for names in [["north_cm", "east_cm", "up_cm"], ["n", "e", "u"], ["pos_n", "pos_e", "pos_u"]] {
        let [n, e, u] = names;
        let log = Log::of(table(
            &[("t", &|t| t), (n, &|t| 300.0 * t), (e, &|t| t), (u, &|t| 0.1 * t)],
            100,
            1.0,
        ));
        let place = log.signal(Kind::Local).unwrap();
        assert_eq!(place.columns, [(1, false), (2, false), (3, true)], "{names:?}");
        assert_eq!(place.unit, if n == "north_cm" { "cm" } else { "m" });
    }
    for (name, unit) in [("heading [rad]", "rad"), ("heading_deg", "deg"), ("yaw", "rad")] {
        let log = Log::of(table(&[("t", &|t| t), (name, &|t| 0.01 * t)], 100, 1.0));
        assert_eq!(log.signal(Kind::Heading).unwrap().unit, unit, "{name}");
    }
}

#[test]
fn a_standard_deviation_is_no_height() {
    let mut flat = fixes(-1.0);
    // Ten fixes a second: some of them judge.
    flat.columns[0].values.iter_mut().for_each(|t| *t *= 0.1);
    flat.columns.truncate(3);
    flat.columns.extend(["dvl_std_m", "valid_fix"].map(|name| LogColumn {
        name: name.to_owned(),
        values: (0..300).map(|k| 0.1 + f64::from(k % 2)).collect(),
        ..LogColumn::default()
    }));
    flat.columns[4].values.iter_mut().for_each(|v| *v *= 2.0);
    let mut shaken = unit();
    shaken.path = "imu.csv".into();
    let design = Inspection::look(vec![Log::of(shaken), Log::of(flat)])
        .design(Path::new("/"))
        .unwrap();
    assert!(!design.contains("dvl_std_m"), "{design}");
    assert!(
        design.contains("horizontal_position = { latitude = \"lat_deg\", longitude = \"lon_deg\", unit"),
        "{design}"
    );
}

#[test]
fn velocities_of_a_file_of_their_own_are_those_of_the_fixes() {
    let (mut places, mut velocities, mut shaken) = (fixes(-1.0), fixes(-1.0), unit());
    velocities.columns.drain(1..4);
    velocities.columns.truncate(4);
    places.columns.drain(4..7);
    velocities.path = "gnss_velocity.csv".into();
    shaken.path = "imu.csv".into();
    // The receiver writes positions and velocities 10 ms apart.
    velocities.columns[0].values.iter_mut().for_each(|t| *t += 0.01);
    let looked = Inspection::look(vec![Log::of(places), Log::of(velocities), Log::of(shaken)]);
    let (_, track) = looked.position.as_ref().unwrap();
    assert!(track.is_reported && (track.top_speed() - 3.0).abs() < 0.02, "{}", track.top_speed());
    assert!(track.agreement.is_some_and(|a| (a[0] - 1.0).abs() < 0.01), "{:?}", track.agreement);
    let design = looked.design(Path::new("/")).unwrap();
    assert!(
        design.contains("[sensor.gnss_velocity]\ntype = \"gnss_velocity\"\nsource = \"gnss_velocity\""),
        "{design}"
    );
    assert!(design.contains("path = \"gnss_velocity.csv\""), "{design}");
}

#[test]
fn a_large_bias_of_the_gyros_is_found_at_rest() {
    let mut biased = unit();
    biased.columns[4].values.iter_mut().for_each(|w| *w += 10.0);
    let looked = Inspection::look(vec![Log::of(biased)]);
    let rest = looked.imu.as_ref().unwrap().1.rest.as_ref().unwrap();
    // The mean of the noise over 20 s is within 0.01 deg/s.
    assert!((rest.bias[0].to_degrees() - 10.0).abs() < 0.01, "{rest:?}");
    let design = looked.design(Path::new("/")).unwrap();
    assert!(design.contains("initial = [\"10.00 deg/s\", \"0.57 deg/s\""), "{design}");
}

#[test]
fn a_take_off_at_low_speed_is_no_rest() {
    // By the reported speed it stands until 22 s; from 20 s on it is shaken.
    let rest = Imu::of(&Log::of(unit()), &|t| Some(t < 22.0)).unwrap().rest.unwrap();
    assert!((rest.first.1 - 20.0).abs() < 1.1, "{rest:?}");
    assert!(rest.accel_std.iter().all(|s| *s < 0.007), "{rest:?}");
}

/// A unit that is hardly shaken and turns at 2 deg/s, with fixes once a second that move at this speed \[m/s\].
fn steady(speed: f64) -> Inspection {
    let turn = 2_f64.to_radians();
    let shaken = |t: f64, seed: f64| 0.01 * noise(t, seed);
    let unit = table(
        &[
            ("t_s", &|t| t),
            ("ax", &move |t| shaken(t, 1.0)),
            ("ay", &move |t| speed * turn + shaken(t, 2.0)),
            ("az", &move |t| -9.81 + shaken(t, 3.0)),
            ("gx_dps", &move |t| shaken(t, 4.0)),
            ("gy_dps", &move |t| shaken(t, 5.0)),
            ("gz_dps", &move |t| 2.0 + shaken(t, 6.0)),
        ],
        3000,
        50.0,
    );
    let mut fixes = table(
        &[
            ("t_s", &|t| t),
            ("north_m", &move |t| speed / turn * (turn * t).sin() + noise(t, 7.0)),
            ("east_m", &move |t| -speed / turn * (turn * t).cos() + noise(t, 8.0)),
            ("down_m", &move |t| noise(t, 9.0)),
        ],
        60,
        1.0,
    );
    fixes.path = "fixes.csv".into();
    Inspection::look(vec![Log::of(unit), Log::of(fixes)])
}

#[test]
fn a_quiet_unit_whose_fixes_move_is_not_at_rest_and_starts_at_their_speed() {
    let resting = steady(0.0);
    assert!(resting.imu.as_ref().unwrap().1.rest.as_ref().is_some_and(|rest| rest.share > 0.99));
    let design = resting.design(Path::new("/")).unwrap();
    assert!(design.contains("velocity_sigma = \"0.5 m/s\""), "{design}");
    let moving = steady(8.0);
    assert!(moving.imu.as_ref().unwrap().1.rest.is_none());
    let design = moving.design(Path::new("/")).unwrap();
    assert!(!design.contains("2.00 deg/s"), "{design}");
    let sigma = design.split_once("velocity_sigma = \"").unwrap().1;
    let sigma: f64 = sigma.split_once(' ').unwrap().0.parse().unwrap();
    // The slope of six fixes with errors below 1 m: within half a metre per second.
    assert!((sigma - 8.0).abs() < 0.5, "{design}");
}

#[test]
fn fixes_that_jump_away_and_come_back_are_two_tracks() {
    let of = |apart: f64| {
        let is_false = |t: f64| (t / 5.0).floor() % 2.0 == 0.0;
        let away = move |t: f64| if is_false(t) { apart } else { 0.0 };
        Track::of(
            &Log::of(table(
                &[
                    ("t", &|t| t),
                    ("north_m", &move |t| 0.5 * t + 0.1 * noise(t, 71.0) + away(t)),
                    ("east_m", &move |t| 0.1 * noise(t, 72.0) + away(t)),
                    ("down_m", &|t| 0.1 * noise(t, 73.0)),
                ],
                600,
                1.0,
            )),
            None,
        )
    };
    let two = of(30.0).unwrap();
    // 30 m along both axes; speeds and scatter exclude the jumps.
    assert!(two.apart.is_some_and(|apart| (apart - 42.4).abs() < 2.0), "{:?}", two.apart);
    assert!(two.top_speed() < 1.5 && two.scatter < 1.0, "{} {}", two.top_speed(), two.scatter);
    assert_eq!(of(0.0).unwrap().apart, None);
}

#[test]
fn samples_of_a_recorded_simulation_are_means_and_others_are_taken_as_instants() {
    let written = [
        "specific_force_x [m/s^2]",
        "specific_force_y [m/s^2]",
        "specific_force_z [m/s^2]",
        "angular_rate_x [rad/s]",
        "angular_rate_y [rad/s]",
        "angular_rate_z [rad/s]",
    ];
    let design = |log: Log| Inspection::look(vec![log]).design(Path::new("/")).unwrap();
    assert!(!design(named(written)).contains("average = true"), "{}", design(named(written)));
    assert!(design(Log::of(unit())).contains("average = true"));
}

#[test]
fn a_filter_in_the_plane_is_judged_in_the_plane() {
    let mut fast = fixes(-1.0);
    // Ten fixes a second: some of them judge.
    fast.columns[0].values.iter_mut().for_each(|t| *t *= 0.1);
    fast.columns.drain(4..7);
    let mut odometer = table(
        &[
            ("t", &|t| t),
            ("speed_mps", &|t| 3.0 + 0.01 * noise(t, 80.0)),
            ("yawrate_radps", &|t| 0.01 * noise(t, 81.0)),
        ],
        300,
        10.0,
    );
    odometer.path = "odometry.csv".into();
    let design = Inspection::look(vec![Log::of(fast), Log::of(odometer)])
        .design(Path::new("/"))
        .unwrap();
    let judge = design.split("[source.withheld]").nth(1).unwrap();
    assert!(judge.contains("horizontal_position = {") && !judge.contains("height"), "{design}");
}
