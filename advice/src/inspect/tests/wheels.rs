//! Speeds of both sides of a vehicle.

use super::*;
use fusion::config::Document;
use fusion::design::Design;

/// The rates of wheels of 0.3 m on both sides \[rad/s\], and positions every second, at 2 m/s on a course that swings by 0.8 rad.
fn robot(unit: &str, per_unit: f64) -> Inspection {
    // 0.8 sin(0.1 t) has the rate 0.08 cos(0.1 t); half of the gauge is 0.6 m.
    let turned = |t: f64| 0.6 * 0.08 * (0.1 * t).cos();
    let side = |sign: f64| move |t: f64| (2.0 + sign * turned(t)) / per_unit;
    let (left, right) = (format!("wl_{unit}"), format!("wr_{unit}"));
    let wheels = table(&[("t_s", &|t| t), (&left, &side(1.0)), (&right, &side(-1.0))], 6000, 20.0);
    let course = |t: f64| 0.8 * (0.1 * t).sin();
    let moved = |t: f64, along: fn(f64) -> f64| (0..(20.0 * t) as usize).map(|k| 0.1 * along(course(0.05 * k as f64))).sum::<f64>();
    let fixes = table(
        &[
            ("t_s", &|t| t),
            ("lat_deg", &|t| {
                45.0 + (moved(t, f64::cos) + 0.1 * noise(t, 1.0)) / 6.367e6_f64.to_radians()
            }),
            ("lon_deg", &|t| {
                10.0 + (moved(t, f64::sin) + 0.1 * noise(t, 2.0)) / 4.517e6_f64.to_radians()
            }),
            ("alt_m", &|t| 100.0 + noise(t, 3.0)),
        ],
        300,
        1.0,
    );
    let logs = [("wheels.csv", wheels), ("gnss.csv", fixes)];
    let named = |(path, table): (&str, LogTable)| {
        Log::of(LogTable {
            path: path.into(),
            ..table
        })
    };
    Inspection::look(logs.map(named).into())
}

#[test]
fn the_speeds_of_both_sides_drive_a_design_in_the_plane() {
    for (unit, per_unit) in [("radps", 0.3), ("mps", 1.0)] {
        let text = robot(unit, per_unit).design(Path::new("/")).unwrap();
        assert!(
            text.contains("type = \"track_odometry\"") && text.contains(&format!("left = {{ column = \"wl_{unit}\"")),
            "{text}"
        );
        let scale = text
            .split("scale = ")
            .nth(1)
            .map(|rest| rest.split([' ', ',']).next().unwrap().parse::<f64>().unwrap());
        // The scatter of the fixes makes the speed between two of them too large by up to a tenth of a percent.
        assert_eq!(
            scale.map(|scale| (scale * 100.0).round()),
            (unit == "radps").then_some(30.0),
            "{text}"
        );
        let (document, mistakes) = Document::parse("first.toml", &text);
        assert!(mistakes.is_empty() && Design::read(document).is_ok(), "{text}");
    }
}

#[test]
fn a_rate_of_wheels_without_positions_in_motion_is_no_speed() {
    let mut still = robot("radps", 0.3);
    still.position = None;
    assert!(still.design(Path::new("/")).is_err());
}
