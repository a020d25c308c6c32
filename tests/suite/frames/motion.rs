//! Positions, velocities and clocks.

use super::*;

#[test]
fn a_position_that_everything_else_contradicts_is_what_is_wrong() {
    let cases = [
        (vec!["longitude=\"-lon_rad\""], "write `longitude = \"lon_rad\"`"),
        (vec!["latitude=\"-lat_rad\""], "write `latitude = \"lat_rad\"`"),
        (
            vec!["latitude=\"lon_rad\"", "longitude=\"lat_rad\""],
            "write `latitude = \"lat_rad\", longitude = \"lon_rad\"`",
        ),
        (vec!["unit=\"deg\""], "write `unit = \"rad\"`"),
        (vec!["height=\"-h_m\""], "write `height = \"h_m\"`"),
    ];
    for (sets, help) in cases {
        let sets: Vec<String> = sets.iter().map(|set| format!("{POSITION}.{set}")).collect();
        for has_reference in [true, false] {
            let Some((design, options)) = car(has_reference, &sets) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings.matches("warning[").count(), 1, "{has_reference} {sets:?}:\n{warnings}");
            assert!(warnings.contains(help), "{has_reference} {sets:?}:\n{warnings}");
            // Without a reference, only the velocity shows which direction is up.
            let is_open = !has_reference && sets[0].contains("height");
            assert!(warnings.contains("the position"), "{sets:?}:\n{warnings}");
            let accused = found.comparisons.iter().find(|c| c.what == "gnss.velocity").unwrap();
            assert_eq!(accused.verdict == "as declared", !is_open, "{has_reference} {sets:?}: {accused:?}");
        }
    }
}

#[test]
fn wrong_local_coordinates_are_told_by_the_inertial_unit() {
    let workspace = Workspace::new("frames-local");
    drive(&workspace);
    for (position, help) in [
        (
            "{ north = \"e\", east = \"n\", down = \"d\" }",
            "write `north = \"n\", east = \"e\"`",
        ),
        ("{ north = \"n\", east = \"-e\", down = \"d\" }", "write `east = \"e\"`"),
    ] {
        let (warnings, _) = told_of(&workspace, DRIVE, &[format!("{POSITION}={position}")]);
        assert_eq!(warnings.matches("warning[").count(), 1, "{position}:\n{warnings}");
        assert!(
            warnings.contains("the position of `gnss.position` contradicts"),
            "{position}:\n{warnings}"
        );
        assert!(warnings.contains(help), "{position}:\n{warnings}");
    }
}

#[test]
fn a_velocity_in_a_file_of_its_own_is_compared_with_the_position_and_no_sign_is_invented() {
    let workspace = Workspace::new("frames-two-files");
    drive(&workspace);
    let own = "[source.doppler]\ntype = \"csv\"\npath = \"gnss.csv\"\ntime = { column = \"t\" }\n[source.doppler.channels]\nvelocity";
    let two = DRIVE.replace("velocity = { columns", &format!("{own} = {{ columns"));
    assert!(two.contains("[source.doppler.channels]\nvelocity"));
    let (warnings, found) = told_of(&workspace, &two, &[]);
    assert_eq!(warnings, "", "{:?}", found.comparisons);
    let with = found.comparisons.iter().find(|c| c.what == "doppler.velocity").unwrap();
    assert_eq!(with.with, "the slope of gnss.position");
    // The road is level: the log does not determine down.
    assert_eq!(with.verdict, "north, east as declared; down not decided");
    let exchanged = "source.doppler.channels.velocity.columns=[\"ve\", \"vn\", \"vd\"]".to_owned();
    let (warnings, _) = told_of(&workspace, &two, &[exchanged]);
    assert!(warnings.contains("write `columns = [\"vn\", \"ve\", \"vd\"]`"), "{warnings}");
    assert!(warnings.contains("the sign of down is not decided by these data"), "{warnings}");
}

#[test]
fn a_shifted_clock_is_told_and_hides_no_axes() {
    for (has_reference, source) in [(true, "imu"), (false, "imu"), (true, "reference")] {
        for (shift, way) in [("1.5 s", "late"), ("-1.5 s", "early")] {
            let set = format!("source.{source}.time.offset=\"{shift}\"");
            let Some((design, options)) = car(has_reference, &[set]) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings.matches("warning[").count(), 1, "{source} {shift}:\n{warnings}");
            assert!(
                warnings.contains(&format!("the stamps of `{source}` are about ")),
                "{source} {shift}:\n{warnings}"
            );
            assert!(warnings.contains(&format!(" s {way}: ")), "{source} {shift}:\n{warnings}");
            let rates = found.comparisons.iter().find(|c| c.what == "imu.angular_rate").unwrap();
            assert!(rates.verdict.starts_with("as declared, "), "{rates:?}");
        }
    }
}

#[test]
fn a_velocity_in_another_unit_is_told_with_the_unit_that_fits() {
    for (set, says, help) in [
        ("unit=\"kn\"", "too small by a factor of 1.94", "write `unit = \"m/s\"`"),
        ("scale=0.5", "too small by a factor of 2", "leave out `scale`"),
        ("scale=1.5", "too large by a factor of 1.5", "leave out `scale`"),
    ] {
        for has_reference in [true, false] {
            let Some((design, options)) = car(has_reference, &[format!("{VELOCITY}.{set}")]) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings.matches("warning[").count(), 1, "{set}:\n{warnings}");
            assert!(warnings.contains(says) && warnings.contains(help), "{set}:\n{warnings}");
            let listed = found.comparisons.iter().find(|c| c.what == "gnss.velocity").unwrap();
            assert!(listed.verdict.contains(says), "{listed:?}");
        }
    }
}

#[test]
fn columns_of_1_sigma_are_told_from_a_velocity() {
    let workspace = Workspace::new("frames-sigma");
    drive(&workspace);
    let (warnings, found) = told_of(&workspace, DRIVE, &[format!("{VELOCITY}.columns=[\"sn\", \"se\", \"sd\"]")]);
    assert_eq!(warnings, "");
    let said = found.comparisons.iter().find(|c| c.what == "gnss.velocity").unwrap();
    assert!(said.verdict.ends_with("are they 1σ?"), "{said:?}");
}

#[test]
fn utc_for_gps_time_is_told() {
    let Some((design, options)) = car(true, &["source.gnss.time.offset=\"18 s\"".to_owned()]) else {
        return;
    };
    let (warnings, _) = told(&design, &options);
    assert!(warnings.contains("the stamps of `gnss` are about 1"), "{warnings}");
    let offset = warnings.split("write `source.gnss.time.offset = \"").nth(1).unwrap();
    let offset: f64 = offset.split(" s").next().unwrap().parse().unwrap();
    // Receivers are late by up to half a second.
    assert!(offset.abs() < 0.6, "{warnings}");
}

#[test]
fn an_antenna_ahead_of_where_a_boat_turns_is_no_early_clock() {
    let w = Workspace::new("frames-early");
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    w.fusion(&["record", "mine.toml", "--out", "log", "--seed", "3"]).success();
    let warned = warned(&w, &[]);
    assert!(!warned.contains("the stamps of"), "{warned}");
}
