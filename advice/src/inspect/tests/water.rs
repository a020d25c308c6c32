//! Speeds over ground and through the water.

use super::*;

/// Ten minutes in circles at 2 m/s, with fixes and their velocity once a second, and a sensor with `body`. The water
/// flows with `c`.
fn circling(c: [f64; 2], body: LogTable) -> Inspection {
    let (radius, rate) = (2.0 / 0.03, 0.03);
    let north = move |t: f64| radius * (rate * t).sin() + c[0] * t;
    let east = move |t: f64| radius * (1.0 - (rate * t).cos()) + c[1] * t;
    let fixes = table(
        &[
            ("t", &|t| t),
            ("lat_deg", &move |t| 45.0 + north(t) / 6.371e6_f64.to_radians()),
            ("lon_deg", &move |t| {
                10.0 + east(t) / (6.371e6_f64.to_radians() * 45_f64.to_radians().cos())
            }),
            ("alt_m", &|t| 10.0 + 0.1 * noise(t, 40.0)),
            ("vn", &move |t| 2.0 * (rate * t).cos() + c[0] + 0.01 * noise(t, 41.0)),
            ("ve", &move |t| 2.0 * (rate * t).sin() + c[1] + 0.01 * noise(t, 42.0)),
            ("vd", &|t| 0.01 * noise(t, 43.0)),
        ],
        600,
        1.0,
    );
    let mut turning = table(
        &[
            ("t", &|t| t),
            ("ax", &|t| 0.01 * noise(t, 1.0)),
            ("ay", &|t| 0.06 + 0.01 * noise(t, 2.0)),
            ("az", &|t| -9.81 + 0.01 * noise(t, 3.0)),
            ("wx_radps", &|t| 0.01 * noise(t, 4.0)),
            ("wy_radps", &|t| 0.01 * noise(t, 5.0)),
            ("wz_radps", &|t| 0.03 + 0.01 * noise(t, 6.0)),
        ],
        30_000,
        50.0,
    );
    turning.path = "imu.csv".into();
    Inspection::look(vec![Log::of(fixes), Log::of(turning), Log::of(body)])
}

/// Three axes of a log in a file of this name.
fn three_axes(file: &str) -> LogTable {
    let mut log = table(
        &[
            ("t", &|t| t),
            ("vx", &|t| 2.0 + 0.02 * noise(t, 50.0)),
            ("vy", &|t| 0.02 * noise(t, 51.0)),
            ("vz_mps", &|t| 0.02 * noise(t, 52.0)),
        ],
        600,
        1.0,
    );
    log.columns[1].name = "vx_mps".to_owned();
    log.columns[2].name = "vy_mps".to_owned();
    log.path = file.into();
    log
}

#[test]
fn a_log_of_three_axes_sees_the_water_if_a_current_explains_it() {
    let looked = circling([0.4, -0.3], three_axes("dvl.csv"));
    let c = looked.current(Kind::BodyVelocity).unwrap();
    // 2 cm/s of noise in 600 rows.
    assert!((c[0] - 0.4).abs() < 0.02 && (c[1] + 0.3).abs() < 0.02, "{c:?}");
    let design = looked.design(Path::new("/")).unwrap();
    let log = design.split("[sensor.water_log]").nth(1).unwrap().split('[').next().unwrap();
    assert!(
        design.contains("if a current of 0.40 m/s north") && !log.contains("bias ="),
        "{design}"
    );
    let looked = circling([0.0, 0.0], three_axes("log.csv"));
    assert!(looked.is_over_ground(Kind::BodyVelocity), "{:?}", looked.water);
    assert!(!looked.design(Path::new("/")).unwrap().contains("current = {"));
    // A path in one direction does not identify the current, so the name decides: a Doppler log measures over ground.
    for (file, is_water) in [("dvl.csv", false), ("log.csv", true)] {
        let mut shaken = unit();
        shaken.path = "imu.csv".into();
        let looked = Inspection::look(vec![Log::of(fixes(-1.0)), Log::of(shaken), Log::of(three_axes(file))]);
        let design = looked.design(Path::new("/")).unwrap();
        assert!(
            design.contains("[sensor.dvl]") && design.contains("current = {") == is_water,
            "{file}: {design}"
        );
    }
}

#[test]
fn a_speed_without_a_unit_that_is_twice_that_over_ground_is_in_knots() {
    for (name, per, unit) in [("stw", 1.0 / 0.514_444, "kn"), ("speed", 3.6, "km/h"), ("speed", 1.0, "m/s")] {
        let mut log = table(&[("t", &|t| t), (name, &move |t| per * (2.0 + 0.02 * noise(t, 60.0)))], 600, 1.0);
        log.path = "log.csv".into();
        let looked = circling([0.1, 0.0], log);
        let signal = looked.logs[2].signal(Kind::Speed).unwrap();
        assert_eq!(signal.unit, unit, "{}", signal.why);
        let design = looked.design(Path::new("/")).unwrap();
        assert!(
            design.contains(&format!("speed = {{ column = \"{name}\", unit = \"{unit}\" }}")),
            "{design}"
        );
    }
}

#[test]
fn a_direction_ahead_that_is_not_decided_is_not_printed() {
    let looked = circling([0.0, 0.0], three_axes("dvl.csv"));
    let page = format!("{:?}", looked.page().sections);
    let design = looked.design(Path::new("/")).unwrap();
    assert!(looked.pair.unwrap().forward.is_some_and(|(_, c)| c < 0.6), "{:?}", looked.pair);
    assert!(
        page.contains("not decided (correlation") && !page.contains("in sensor axes (corr"),
        "{page}"
    );
    assert!(design.contains("not decided: nothing here tells which axis is ahead"), "{design}");
}

/// Ten minutes under water with fixes every two seconds: the unit's axes are turned to the right by `turned`, those of
/// the velocity log are forward, left, up.
fn diving(turned: f64) -> Inspection {
    let speed = |t: f64| 1.0 + 0.4 * (0.11 * t).sin();
    let heading = |t: f64| 2.0 * (0.04 * t).sin() + 0.5 * (0.19 * t).cos();
    let depth = |t: f64| 5.0 + 3.0 * (0.05 * t).sin();
    let slope = |of: &dyn Fn(f64) -> f64, t: f64| (of(t + 1e-4) - of(t - 1e-4)) / 2e-4;
    let way: Vec<[f64; 2]> = (0..60_000)
        .scan([0.0; 2], |at, k| {
            let t = 0.01 * f64::from(k);
            *at = [
                at[0] + 0.01 * speed(t) * heading(t).cos(),
                at[1] + 0.01 * speed(t) * heading(t).sin(),
            ];
            Some(*at)
        })
        .collect();
    let at = |t: f64, i: usize| way[((t / 0.01) as usize).min(way.len() - 1)][i];
    let fixes = table(
        &[
            ("t", &|t| t),
            ("lat_deg", &|t| 45.0 + (at(t, 0) + 0.5 * noise(t, 1.0)) / 6.371e6_f64.to_radians()),
            ("lon_deg", &|t| {
                10.0 + (at(t, 1) + 0.5 * noise(t, 2.0)) / (6.371e6_f64.to_radians() * 45_f64.to_radians().cos())
            }),
            ("alt_m", &|t| noise(t, 3.0) - depth(t)),
        ],
        300,
        0.5,
    );
    let ahead = |t: f64| slope(&speed, t) + 0.03 * noise(t, 4.0);
    let aside = |t: f64| speed(t) * slope(&heading, t) + 0.03 * noise(t, 5.0);
    let (sin, cos) = turned.sin_cos();
    let mut unit = table(
        &[
            ("t", &|t| t),
            ("ax", &move |t| cos * ahead(t) + sin * aside(t)),
            ("ay", &move |t| cos * aside(t) - sin * ahead(t)),
            ("az", &|t| -9.81 + 0.03 * noise(t, 6.0)),
            ("wx_radps", &|t| 0.002 * noise(t, 7.0)),
            ("wy_radps", &|t| 0.002 * noise(t, 8.0)),
            ("wz_radps", &|t| slope(&heading, t) + 0.002 * noise(t, 9.0)),
        ],
        30_000,
        50.0,
    );
    unit.path = "imu.csv".into();
    let mut dvl = table(
        &[
            ("t", &|t| t),
            ("vx", &|t| speed(t) + 0.01 * noise(t, 10.0)),
            ("vy", &|t| 0.01 * noise(t, 11.0)),
            ("vz", &|t| 0.01 * noise(t, 12.0) - slope(&depth, t)),
        ],
        3_000,
        5.0,
    );
    dvl.path = "dvl.csv".into();
    let mut pressure = table(&[("t", &|t| t), ("depth_m", &|t| depth(t) + 0.2 * noise(t, 13.0))], 3_000, 5.0);
    pressure.path = "depth.csv".into();
    Inspection::look([fixes, unit, dvl, pressure].map(Log::of).into())
}

#[test]
fn a_velocity_log_shows_how_the_unit_is_turned_and_z_which_way_is_up() {
    for (turned, axes, mounting) in [
        (0.0, None, None),
        (90.0, Some("rotation = { axes = [\"-y\", \"x\", \"z\"] }"), None),
        (110.0, Some("rotation = { axes = [\"-y\", \"x\", \"z\"] }"), Some(-20.0)),
    ] {
        let looked = diving(f64::to_radians(turned));
        let design = looked.design(Path::new("/")).unwrap();
        assert!(
            axes.is_none_or(|axes| design.contains(axes)) && design.contains("rotation") == axes.is_some(),
            "{turned}: {design}"
        );
        assert!(
            design.contains("body_velocity = { columns = [\"vx\", \"-vy\", \"-vz\"]"),
            "{turned}: {design}"
        );
        let dvl = design.split("[sensor.dvl]").nth(1).unwrap().split("\n[").next().unwrap();
        let found = dvl.split("mounting = [0, 0, \"").nth(1).map(|rest| rest.split(' ').next().unwrap());
        let off = found.map_or(0.0, |found| found.parse::<f64>().unwrap()) - mounting.unwrap_or(0.0);
        // The 1σ of the angle is 1 deg.
        assert!(
            found.is_some() >= mounting.is_some() && off.abs() < 4.0,
            "{turned}: {:?} {dvl}",
            looked.turned
        );
        // Uniform noise of ±0.2 m.
        assert!(design.contains("guessed: neighbouring depths scatter by it"), "{design}");
    }
}
