//! Magnetometers.

use super::*;

/// Three minutes of a level vehicle that turns left and right in a field of 50 uT with a dip of 60 deg. A `sign` of −1
/// mirrors the y axis of the field.
fn turning(sign: f64) -> (Log, Log) {
    let heading = |t: f64| 2.0 * (0.2 * t).sin();
    let rate = |t: f64| 0.4 * (0.2 * t).cos();
    let mut samples = table(
        &[
            ("t", &|t| t),
            ("ax", &|t| 0.01 * noise(t, 1.0)),
            ("ay", &|t| 0.01 * noise(t, 2.0)),
            ("az", &|t| -9.81 + 0.01 * noise(t, 3.0)),
            ("wx_radps", &|t| 0.01 * noise(t, 4.0)),
            ("wy_radps", &|t| 0.01 * noise(t, 5.0)),
            ("wz_radps", &move |t| rate(t)),
        ],
        9000,
        50.0,
    );
    samples.path = "imu.csv".into();
    let field = table(
        &[
            ("t", &|t| t),
            ("mx_ut", &move |t| 25.0 * heading(t).cos() + 0.2 * noise(t, 6.0)),
            ("my_ut", &move |t| -25.0 * sign * heading(t).sin()),
            ("mz_ut", &|t| 43.3 + 0.2 * noise(t, 7.0)),
        ],
        1800,
        10.0,
    );
    (Log::of(samples), Log::of(field))
}

#[test]
fn a_magnetometer_is_used_if_its_field_turns_as_the_gyros_do() {
    let (unit, field) = turning(1.0);
    let found = Field::of(&field, &unit, [0.0; 3]).unwrap().unwrap();
    assert!(
        (found.strength - 50e-6).abs() < 1e-6 && (found.dip.to_degrees() - 60.0).abs() < 1.0,
        "{found:?}"
    );
    assert!(found.explained > 0.95, "{found:?}");
    let (unit, mirrored) = turning(-1.0);
    let why = Field::of(&mirrored, &unit, [0.0; 3]).unwrap().unwrap_err();
    // Turns about one axis do not show whose sign is wrong.
    assert!(why.contains("if axis z of the gyros, or axis x of the magnetometer"), "{why}");
    // So it is printed with the unit, not only in the list of unused columns.
    let page = format!("{:?}", Inspection::look(vec![unit, mirrored]).page().sections);
    let (found, rest) = page.split_once("Inertial unit").unwrap();
    assert!(
        rest.contains("counts the other way") && found.contains("counts the other way"),
        "{page}"
    );
}

#[test]
fn a_field_that_is_not_that_of_the_earth_is_refused_with_its_strength() {
    let (unit, mut field) = turning(1.0);
    field.signals.iter_mut().for_each(|s| s.factor *= 3.0);
    let why = Field::of(&field, &unit, [0.0; 3]).unwrap().unwrap_err();
    assert!(why.contains("median strength is 150") && why.contains("22 to 67 uT"), "{why}");
}

#[test]
fn the_unit_of_a_field_without_a_name_is_told_by_that_of_the_earth_and_written() {
    for (unit, per) in [("T", 1e-6), ("uT", 1.0), ("nT", 1e3), ("gauss", 1e-2), ("mgauss", 10.0)] {
        let (imu, field) = turning(1.0);
        let mut plain = field.table;
        for (column, name) in plain.columns.iter_mut().zip(["t", "mx", "my", "mz"]).skip(1) {
            column.name = name.to_owned();
            column.values.iter_mut().for_each(|m| *m *= per);
        }
        plain.path = "mag.csv".into();
        let design = Inspection::look(vec![imu, Log::of(plain)]).design(Path::new("/")).unwrap();
        let declared = format!("magnetic_field = {{ columns = [\"mx\", \"my\", \"mz\"], unit = \"{unit}\"");
        // In a separate file it still measures the heading.
        assert!(
            design.contains(&declared) && design.contains("type = \"compass\""),
            "{unit}: {design}"
        );
        assert!(!design.contains("heading = \"0 deg\""), "{design}");
    }
}
