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
