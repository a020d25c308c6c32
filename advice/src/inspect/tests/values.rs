//! Numbers that a first design takes from the values of its logs.

use super::*;

/// Twenty-five seconds of a foot at 100 Hz: at rest for two, turned slowly for one, then swung.
fn stepping() -> LogTable {
    let size = |t: f64| if t < 3.0 { 0.02 } else { 3.0 };
    // 3 deg/s: faster than at rest, with the vibration of a rest.
    let slow = |t: f64| if (2.0..3.0).contains(&t) { 3.0 } else { 0.0 };
    table(
        &[
            ("t_s", &|t| t),
            ("ax", &move |t| size(t) * noise(t, 1.0)),
            ("ay", &move |t| size(t) * noise(t, 2.0)),
            ("az", &move |t| -9.81 + size(t) * noise(t, 3.0)),
            ("gx_dps", &move |t| slow(t) + 20.0 * size(t) * noise(t, 4.0)),
            ("gy_dps", &move |t| 20.0 * size(t) * noise(t, 5.0)),
            ("gz_dps", &move |t| 20.0 * size(t) * noise(t, 6.0)),
        ],
        2500,
        100.0,
    )
}

#[test]
fn what_is_beside_a_short_rest_does_not_hide_it() {
    let rest = Imu::of(&Log::of(stepping()), &|_| None).unwrap().rest.unwrap();
    assert!(rest.first.0 < 0.1 && (rest.first.1 - 2.0).abs() < 0.1, "{rest:?}");
}

/// The unit of specific forces that are shaken by this number of g, with this share of gravity.
fn unit_of_force(shaken: f64, gravity: f64, in_g: bool) -> Option<String> {
    let one = if in_g { 1.0 } else { 9.80665 };
    let force = move |t: f64, seed: f64| one * shaken * noise(t, seed);
    let log = Log::of(table(
        &[
            ("t_s", &|t| t),
            ("ax", &move |t| force(t, 1.0)),
            ("ay", &move |t| force(t, 2.0)),
            ("az", &move |t| force(t, 3.0) - one * gravity),
        ],
        2500,
        100.0,
    ));
    Some(log.signal(Kind::SpecificForce)?.unit.clone())
}

#[test]
fn a_strongly_shaken_unit_shows_its_unit_by_means_over_a_second() {
    for shaken in [0.1, 0.5, 1.0] {
        assert_eq!(unit_of_force(shaken, 1.0, false).as_deref(), Some("m/s^2"), "{shaken} g");
        assert_eq!(unit_of_force(shaken, 1.0, true).as_deref(), Some("g"), "{shaken} g");
    }
    // Motion without gravity: no specific force.
    assert_eq!(unit_of_force(3.0, 0.0, false), None);
    assert_eq!(unit_of_force(0.3, 0.0, false), None);
}

/// The design for a unit whose rates are `times` those of [`unit`], with fixes.
fn turned(times: f64) -> String {
    let mut shaken = unit();
    shaken.path = "imu.csv".into();
    for column in &mut shaken.columns[4..7] {
        column.values.iter_mut().for_each(|v| *v *= times);
    }
    let looked = Inspection::look(vec![Log::of(shaken), Log::of(fixes(1.0))]);
    looked.design(Path::new("/")).unwrap()
}

#[test]
fn gyros_that_turn_fast_are_noisier_and_jump_further() {
    let fast = turned(10.0);
    assert!(
        fast.contains("accelerometer.vibration = \"0.1 s\"") && fast.contains("gyro.scale_noise = \"0.1 %/sqrt(Hz)\""),
        "{fast}"
    );
    // At most ±200 deg/s about each axis, 346 deg/s in total, plus the bias. The limit is twice that, and more than the
    // maximum about one axis.
    let limit = fast.split("angular_rate = \"").nth(1).unwrap().split(' ').next().unwrap();
    assert!((400.0..720.0).contains(&limit.parse().unwrap()), "{limit}");
    let slow = turned(1.0);
    assert!(!slow.contains("vibration") && !slow.contains("agility"), "{slow}");
}

#[test]
fn a_barometer_that_wind_presses_is_as_noisy_as_it_moves_against_the_heights() {
    // ±30 Pa within ten seconds, with small steps from row to row; the path climbs at half a metre a second, 6 Pa.
    let noise_of = |swing: f64| {
        let pressure = move |t: f64| 1e5 - 6.0 * t + swing * (0.2 * core::f64::consts::PI * t).sin();
        let air = table(&[("t", &|t| t), ("pressure_pa", &pressure)], 3000, 10.0);
        let mut shaken = unit();
        shaken.path = "imu.csv".into();
        let looked = Inspection::look(vec![Log::of(shaken), Log::of(fixes(-1.0)), Log::of(air)]);
        let design = looked.design(Path::new("/")).unwrap();
        let sigma = design
            .split("[sensor.barometer]")
            .nth(1)
            .unwrap()
            .split("noise = { sigma = \"")
            .nth(1);
        sigma.unwrap().split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    // Rows half a period apart differ by 2 × 30 |sin|, half of the time by more than 42: 42 / √2 / 0.674 = 44.
    let pressed = noise_of(30.0);
    assert!((40.0..48.0).contains(&pressed), "{pressed}");
    // 5 cm of the climb remain in five seconds, and 3 Pa is the minimum.
    assert!((noise_of(0.0) - 3.0).abs() < 0.1, "{}", noise_of(0.0));
}

/// An attitude reference and fixes: a row every `step` seconds, a new fix in every second row, one circle in `round`
/// seconds.
fn glider(step: f64, round: f64) -> String {
    let angle = move |t: f64| core::f64::consts::TAU * t / round;
    let radius = 0.3 * round / core::f64::consts::TAU / 6.371e6_f64.to_radians();
    let fix = move |t: f64| (0.5 * t / step).floor() * 2.0 * step;
    let log = table(
        &[
            ("t_s", &|t| t),
            ("roll_deg", &|t| noise(t, 1.0)),
            ("pitch_deg", &|t| noise(t, 2.0)),
            ("heading_deg", &move |t| (angle(t).to_degrees() + 90.0).rem_euclid(360.0)),
            ("lat_deg", &move |t| 45.0 + radius * angle(fix(t)).cos()),
            ("lon_deg", &move |t| 10.0 + radius / 45_f64.to_radians().cos() * angle(fix(t)).sin()),
        ],
        1000,
        1.0 / step,
    );
    Inspection::look(vec![Log::of(log)]).design(Path::new("/")).unwrap()
}

#[test]
fn what_nobody_measures_between_rare_fixes_lasts_as_the_fixes_tell() {
    let design = glider(20.0, 4000.0);
    let number = |key: &str| {
        let after = design.split(key).nth(1).unwrap_or_else(|| panic!("{key}: {design}"));
        after.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    // Directions 40 s apart differ by 3.6 deg: -40 s / ln cos 3.6 deg = 20 257 s.
    let lasting = number("velocity_time = \"");
    assert!((lasting / 20_257.0 - 1.0).abs() < 0.02, "{lasting}");
    let drift = design
        .split("drift = ")
        .nth(1)
        .unwrap()
        .split("correlation_time = \"")
        .nth(1)
        .unwrap();
    assert!((drift.split(' ').next().unwrap().parse::<f64>().unwrap() / lasting - 0.5).abs() < 0.01);
    assert!((number("input.longest_interval = \"") / lasting - 0.2).abs() < 0.01);
    // Frequent fixes show the motion themselves.
    let often = glider(1.0, 200.0);
    assert!(
        often.contains("velocity_time = \"20 s\"") && often.contains("longest_interval = \"5.0 s\""),
        "{often}"
    );
}

#[test]
fn the_track_of_another_wanders_as_the_velocity_of_the_process_changes() {
    let is_false = |t: f64| (t / 5.0).floor() % 2.0 == 0.0;
    let away = move |t: f64| if is_false(t) { 30.0 } else { 0.0 };
    let log = table(
        &[
            ("t_s", &|t| t),
            ("roll_deg", &|t| noise(t, 1.0)),
            ("pitch_deg", &|t| noise(t, 2.0)),
            ("heading_deg", &|t| 90.0 + noise(t, 3.0)),
            ("north_m", &move |t| 0.8 * t + 0.1 * noise(t, 71.0) + away(t)),
            ("east_m", &move |t| 0.1 * noise(t, 72.0) + away(t)),
            ("down_m", &|t| 0.1 * noise(t, 73.0)),
        ],
        600,
        1.0,
    );
    let design = Inspection::look(vec![Log::of(log)]).design(Path::new("/")).unwrap();
    let number = |key: &str| {
        let after = design.split(key).nth(1).unwrap_or_else(|| panic!("{key}: {design}"));
        after.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    // The wander of the velocity ahead, and of a drift with 0.6 times its 1σ and half its correlation time.
    let ahead = (2.0 / number("velocity_time = \"")).sqrt() * number("velocity_sigma = [\"");
    let drift = 0.6 * core::f64::consts::SQRT_2 * ahead;
    assert!((number("wander = \"") / ahead.hypot(drift) - 1.0).abs() < 0.05, "{design}");
}

#[test]
fn withheld_velocities_have_the_error_of_their_scatter() {
    let mut fast = fixes(-1.0);
    fast.path = "gnss.csv".into();
    // Five fixes a second: some of them judge.
    fast.columns[0].values.iter_mut().for_each(|t| *t *= 0.2);
    let mut unit = unit();
    unit.path = "imu.csv".into();
    let design = |fast: LogTable| {
        let looked = Inspection::look(vec![Log::of(unit.clone()), Log::of(fast)]);
        (
            looked.position.as_ref().unwrap().1.velocity_scatter,
            looked.design(Path::new("/")).unwrap(),
        )
    };
    let (scatter, with) = design(fast.clone());
    let sigma = |design: &str| {
        design
            .split("[reference]")
            .nth(1)
            .unwrap()
            .split("sigma = {")
            .nth(1)
            .unwrap()
            .to_owned()
    };
    let written = sigma(&with)
        .split("velocity = \"")
        .nth(1)
        .unwrap_or_else(|| panic!("{with}"))
        .to_owned();
    let written: f64 = written.split(' ').next().unwrap().parse().unwrap();
    // Rounded up to a millimetre a second.
    assert!(
        scatter > 1e-3 && (0.0..1.001e-3).contains(&(written - scatter)),
        "{written} {scatter}"
    );
    // If the file has no velocity, no velocity is judged.
    fast.columns.drain(4..7);
    let (_, without) = design(fast);
    assert!(!sigma(&without).split('}').next().unwrap().contains("velocity"), "{without}");
}
