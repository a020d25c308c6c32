//! Attitudes, headings and magnetic fields; impossible numbers.

use super::*;

#[test]
fn a_headings_frame_is_named_by_the_course() {
    let attitude = "source.reference.channels.attitude";
    let east = [
        format!("{attitude}.navigation_rotation={{ axes = [\"y\", \"x\", \"-z\"] }}"),
        format!("{attitude}.rotation={{ axes = [\"x\", \"-y\", \"-z\"] }}"),
    ];
    let quarter = [format!("{attitude}.rotation={{ rpy = [0, 0, \"90 deg\"] }}")];
    let inverse = [format!("{attitude}.inverse=true")];
    let cases = [
        (&east[..], "it is counted anti-clockwise from east"),
        (&quarter[..], "the course is 90° clockwise of it"),
        (&inverse[..], "they agree with it as `inverse = false`: write that"),
    ];
    for (sets, expected) in cases {
        let Some((design, options)) = car(true, sets) else { return };
        let (warnings, _) = told(&design, &options);
        assert!(warnings.contains(expected), "{sets:?}:\n{warnings}");
    }
}

#[test]
fn wrong_axes_of_a_magnetometer_are_named_by_how_the_field_turns() {
    let columns = "source.imu.channels.magnetic_field.columns";
    for (set, expected) in [
        (
            format!("{columns}=[\"mag_y\", \"mag_x\", \"mag_z\"]"),
            "forward is minus the declared y, right is minus the declared x",
        ),
        (format!("{columns}.2=\"-mag_z\""), "down is minus the declared z"),
    ] {
        let Some((design, options)) = real_design("broad", &[], &[&set]) else {
            return;
        };
        let (warnings, found) = told(&design, &options);
        assert!(
            warnings.contains("the axes of `imu.magnetic_field` are not"),
            "{set}: {:?}",
            found.comparisons
        );
        assert!(warnings.contains(expected), "{set}:\n{warnings}");
        assert!(
            warnings.contains("write `columns = [\"mag_x\", \"mag_y\", \"mag_z\"]`"),
            "{set}:\n{warnings}"
        );
    }
}

/// Two minutes of a unit that is turned by hand about all its axes, in the field of the Earth: rows at 50 Hz.
fn turned_by_hand(workspace: &Workspace) {
    let rate = |t: f64| Vector3::new(0.8 * (0.7 * t).sin(), 0.6 * (1.1 * t).cos(), 0.9 * (0.5 * t + 1.0).sin());
    let mut q = from_rpy(0.0, 0.0, 0.0);
    let mut rows = "t,wx,wy,wz,fx,fy,fz,mx,my,mz\n".to_owned();
    for i in 0..6000 {
        let t = f64::from(i) * 0.02;
        let to_body = rotation(&q).transpose();
        let w = rate(t);
        let (f, m) = (to_body * Vector3::new(0.0, 0.0, -9.8), to_body * Vector3::new(19.0, 1.0, 44.0));
        writeln!(rows, "{t},{},{},{},{},{},{},{},{},{}", w.x, w.y, w.z, f.x, f.y, f.z, m.x, m.y, m.z).unwrap();
        q *= fusion::core::geometry::so3::exp(&(rate(t + 0.01) * 0.02));
    }
    workspace.write("imu.csv", rows);
}

const BY_HAND: &str = r#"
[run]
origin = { latitude = "50 deg", longitude = "10 deg", height = "0 m" }
[process]
type = "attitude_only"
source = "imu"
gyro_noise = "0.1 deg/sqrt(s)"
[initial.start]
type = "explicit"
attitude = [0, 0, 0]
attitude_sigma = "5 deg"
[sensor.field]
type = "magnetometer"
source = "imu"
strength = "48 uT"
inclination = "66 deg"
declination = "3 deg"
noise = { sigma = "1 uT" }
[source.imu]
type = "csv"
path = "imu.csv"
time = { column = "t" }
[source.imu.channels]
angular_rate = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
magnetic_field = { columns = ["mx", "my", "mz"], unit = "uT" }
"#;

#[test]
fn gyros_that_turn_otherwise_than_the_field_are_accused_not_acquitted() {
    let workspace = Workspace::new("frames-by-hand");
    turned_by_hand(&workspace);
    let (warnings, found) = told_of(&workspace, BY_HAND, &[]);
    assert_eq!(warnings, "");
    let said = found.comparisons.iter().find(|c| c.what == "imu.magnetic_field").unwrap();
    assert_eq!(said.verdict, "as declared");
    // No other channel measures the motion. The check says so, for the rates too.
    for channel in ["imu.specific_force", "imu.angular_rate"] {
        let said = found.comparisons.iter().find(|c| c.what == channel).unwrap();
        assert_eq!(
            said.verdict,
            "not judged: an attitude, or a velocity of more than 2 m/s, would tell"
        );
    }
    for (set, write) in [
        (format!("{RATE}.columns.0=\"-wx\""), "write `columns = [\"wx\", \"wy\", \"wz\"]`"),
        (format!("{RATE}.columns.2=\"-wz\""), "write `columns = [\"wx\", \"wy\", \"wz\"]`"),
        (format!("{RATE}.unit=\"deg/s\""), "write `unit = \"rad/s\"`"),
    ] {
        let (warnings, found) = told_of(&workspace, BY_HAND, std::slice::from_ref(&set));
        assert_eq!(warnings.matches("warning[").count(), 1, "{set}: {warnings}{:?}", found.comparisons);
        assert!(
            warnings.contains("`imu.angular_rate`") && warnings.contains(write),
            "{set}: {warnings}"
        );
    }
}

#[test]
fn an_attitude_in_another_order_is_accused_and_no_unit() {
    let workspace = Workspace::new("frames-order");
    drive(&workspace);
    let text = format!("{DRIVE}{AHRS}");
    let quaternion = "source.ahrs.channels.attitude.quaternion";
    for (set, write) in [
        (
            format!("{quaternion}=[\"qx\", \"qy\", \"qz\", \"qw\"]"),
            "`quaternion = [\"qw\", \"qx\", \"qy\", \"qz\"]`: write that",
        ),
        (
            "source.ahrs.channels.attitude.inverse=true".to_owned(),
            "`inverse = false`: write that",
        ),
    ] {
        let (warnings, found) = told_of(&workspace, &text, std::slice::from_ref(&set));
        assert_eq!(warnings.matches("warning[").count(), 1, "{set}: {warnings}");
        assert!(
            warnings.contains("`ahrs.attitude` contradicts") && warnings.contains(write),
            "{set}: {warnings}"
        );
        let unit = found.comparisons.iter().filter(|c| c.what.starts_with("imu.") && c.samples > 0);
        unit.for_each(|c| assert!(c.verdict.ends_with("as declared"), "{set}: {c:?}"));
    }
}

#[test]
fn an_attitude_whose_vertical_is_up_and_one_in_another_unit_are_written_right() {
    let workspace = Workspace::new("frames-conventions");
    drive(&workspace);
    let text = format!("{DRIVE}{AHRS}");
    let attitude = "source.ahrs.channels.attitude";
    let up = "`inverse = true, rotation = { axes = [\"x\", \"-y\", \"-z\"] }, navigation_rotation = { axes = [\"x\", \"-y\", \"-z\"] }`";
    let quaternion = "quaternion = [\"qw\", \"qx\", \"qy\", \"qz\"]";
    assert!(AHRS.contains(quaternion));
    let degrees = text.replace(quaternion, "rpy = [\"roll\", \"pitch\", \"yaw\"], unit = \"deg\"");
    let radians = degrees.replace("unit = \"deg\" }\n[reference]", "unit = \"rad\" }\n[reference]");
    assert_eq!(told_of(&workspace, &radians, &[]).0, "");
    // The inverse of q, forward, left, up: with 300 s and with 50 s of data.
    let inverse = format!("{attitude}.quaternion=[\"qw\", \"-qx\", \"qy\", \"qz\"]");
    for (text, sets, write) in [
        (&text, vec![inverse.clone()], up),
        (&text, vec![inverse, "run.stop=\"50 s\"".to_owned()], up),
        (&degrees, Vec::new(), "`unit = \"rad\"`"),
    ] {
        let (warnings, found) = told_of(&workspace, text, &sets);
        assert_eq!(
            warnings.matches("warning[").count(),
            1,
            "{sets:?}: {warnings}{:?}",
            found.comparisons
        );
        let is_told = warnings.contains("`ahrs.attitude` contradicts") && warnings.contains(write);
        assert!(is_told, "{sets:?}: {warnings}");
    }
}

#[test]
fn numbers_that_are_not_of_this_earth_are_told_with_the_unit_that_fits() {
    let workspace = Workspace::new("frames-ranges");
    turned_by_hand(&workspace);
    let rows = (0..200).fold("t,p\n".to_owned(), |rows, k| rows + &format!("{k},{}\n", 101_325 - k));
    workspace.write("air.csv", rows);
    let air = r#"
[sensor.air]
type = "barometer"
source = "air"
sea_level_pressure = "1013.25 hPa"
noise = { sigma = "10 Pa" }
[source.air]
type = "csv"
path = "air.csv"
time = { column = "t" }
channels.pressure = { column = "p", unit = "Pa" }
"#;
    let text = BY_HAND.replace(
        "type = \"attitude_only\"\nsource = \"imu\"\ngyro_noise = \"0.1 deg/sqrt(s)\"",
        "type = \"strapdown\"\nsource = \"imu\"\ngyro.noise = \"0.1 deg/s/sqrt(Hz)\"\naccelerometer.noise = \"1 mg/sqrt(Hz)\"",
    ) + air;
    for (set, write) in [
        ("source.air.channels.pressure.unit=\"Pa\"", ""),
        ("source.air.channels.pressure.unit=\"hPa\"", "write `unit = \"Pa\"`"),
        ("source.imu.channels.magnetic_field.unit=\"T\"", "write `unit = \"uT\"`"),
        ("source.imu.time.unit=\"ms\"", "write `source.imu.time.unit = \"s\"`"),
    ] {
        let (warnings, _) = told_of(&workspace, &text, &[set.to_owned()]);
        assert_eq!(
            warnings.matches("warning[").count(),
            usize::from(!write.is_empty()),
            "{set}: {warnings}"
        );
        assert!(warnings.contains(write), "{set}: {warnings}");
    }
}
