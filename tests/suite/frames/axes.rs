//! Axes, signs and units of inertial units.

use super::*;

/// The wrong declarations, and the two lines that the warning must contain.
fn provoked() -> Vec<(Vec<String>, Vec<&'static str>)> {
    let both = |axes: &str| {
        vec![
            format!("{RATE}.rotation={{ axes = {axes} }}"),
            format!("{FORCE}.rotation={{ axes = {axes} }}"),
        ]
    };
    let back = "write `rotation = { axes = [\"x\", \"y\", \"z\"] }`";
    let mut all = vec![
        (
            both("[\"y\", \"-x\", \"z\"]"),
            vec!["forward is minus the declared y, right is the declared x", back],
        ),
        (
            both("[\"-y\", \"x\", \"z\"]"),
            vec!["forward is the declared y, right is minus the declared x", back],
        ),
        // Upside down.
        (
            both("[\"x\", \"-y\", \"-z\"]"),
            vec!["right is minus the declared y, down is minus the declared z", back],
        ),
        // East, north, up.
        (
            vec![format!("{VELOCITY}.columns=[\"ve_mps\", \"vn_mps\", \"-vd_mps\"]")],
            vec![
                "north is the declared east, east is the declared north, down is minus the declared down",
                "write `columns = [\"vn_mps\", \"ve_mps\", \"vd_mps\"]`",
            ],
        ),
        (
            vec![format!("{VELOCITY}.columns.2=\"-vd_mps\"")],
            vec![
                "down is minus the declared down",
                "write `columns = [\"vn_mps\", \"ve_mps\", \"vd_mps\"]`",
            ],
        ),
        (
            vec![format!("{RATE}.unit=\"deg\"")],
            vec![
                "too small by a factor of 5",
                "`deg` is declared, the numbers fit `rad`: write `unit = \"rad\"`",
            ],
        ),
        (
            vec![format!("{FORCE}.increment=false"), format!("{FORCE}.unit=\"m/s^2\"")],
            vec!["too small by a factor of 99", "write `increment = true`"],
        ),
    ];
    let bodies = ["forward", "right", "down"];
    for (i, (letter, is)) in ["x", "y", "z"].into_iter().zip(bodies).enumerate() {
        for (channel, column) in [(RATE, format!("dth{letter}_rad")), (FORCE, format!("dv{letter}_mps"))] {
            let sentence: &str = match is {
                "forward" => "forward is minus the declared x\n",
                "right" => "right is minus the declared y\n",
                _ => "down is minus the declared z\n",
            };
            let help = if channel == RATE {
                "write `columns = [\"dthx_rad\", \"dthy_rad\", \"dthz_rad\"]`"
            } else {
                "write `columns = [\"dvx_mps\", \"dvy_mps\", \"dvz_mps\"]`"
            };
            all.push((vec![format!("{channel}.columns.{i}=\"-{column}\"")], vec![sentence, help]));
        }
    }
    all
}

#[test]
fn every_frame_mistake_on_the_car_is_named_with_and_without_a_reference() {
    for has_reference in [true, false] {
        for (sets, expected) in provoked() {
            let Some((design, options)) = car(has_reference, &sets) else {
                return;
            };
            let (warnings, judged) = told(&design, &options);
            for line in expected {
                assert!(
                    warnings.contains(line),
                    "reference {has_reference}, {sets:?}: {line:?} is not in\n{warnings}"
                );
            }
            let count = warnings.matches("warning[").count();
            let channels = if sets[0].contains("rotation") { 2 } else { 1 };
            assert_eq!(
                count, channels,
                "reference {has_reference}, {sets:?}: as many channels are wrong:\n{warnings}"
            );
            if !has_reference {
                continue;
            }
            let edits: Vec<Edit> = judged.mistakes.iter().flat_map(|found| found.corrections().to_vec()).collect();
            let Some((design, options)) = edited_car(has_reference, &sets, &edits) else {
                return;
            };
            let (warnings, _) = told(&design, &options);
            assert_eq!(warnings, "", "reference {has_reference}, {sets:?}: {edits:?} cure it");
        }
    }
}

#[test]
fn exchanged_gyros_are_exchanged_back_without_a_sign() {
    let set = format!("{RATE}.columns=[\"dthy_rad\", \"dthx_rad\", \"dthz_rad\"]");
    let Some((design, options)) = car(false, &[set]) else { return };
    let (warnings, _) = told(&design, &options);
    assert!(
        warnings.contains("write `columns = [\"dthx_rad\", \"dthy_rad\", \"dthz_rad\"]`"),
        "{warnings}"
    );
}

/// All signed permutations of three columns.
fn permutations() -> Vec<[(usize, bool); 3]> {
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let signs = (0..8).map(|bits: u8| [0, 1, 2].map(|i| bits >> i & 1 == 1));
    signs.flat_map(|s| orders.map(|o| [0, 1, 2].map(|i| (o[i], s[i])))).collect()
}

#[test]
fn every_signed_permutation_of_a_units_axes_is_undone_on_a_drive_in_closed_form() {
    let workspace = Workspace::new("frames-drive");
    drive(&workspace);
    for text in [DRIVE.to_owned(), format!("{DRIVE}{AHRS}")] {
        for axes in permutations() {
            let columns = |letter: &str| {
                let one = |(axis, negative): &(usize, bool)| {
                    format!("\"{}{letter}{}\"", if *negative { "-" } else { "" }, ["x", "y", "z"][*axis])
                };
                format!("[{}]", axes.iter().map(one).collect::<Vec<_>>().join(", "))
            };
            let sets = [
                format!("{RATE}.columns={}", columns("w")),
                format!("{FORCE}.columns={}", columns("f")),
            ];
            let (warnings, _) = told_of(&workspace, &text, &sets);
            if axes == [(0, false), (1, false), (2, false)] {
                assert_eq!(warnings, "");
                continue;
            }
            for right in ["[\"wx\", \"wy\", \"wz\"]", "[\"fx\", \"fy\", \"fz\"]"] {
                assert!(warnings.contains(&format!("write `columns = {right}`")), "{sets:?}:\n{warnings}");
            }
        }
    }
}

#[test]
fn the_edits_of_warnings_are_written_into_a_copy_that_has_none() {
    let workspace = Workspace::new("frames-fix");
    drive(&workspace);
    let wrong = DRIVE.replace("\"wx\", \"wy\"", "\"wy\", \"-wx\"");
    assert_ne!(wrong, DRIVE);
    workspace.write("wrong.toml", format!("# My car.\n{wrong}"));
    let check = |design: &str, more: &[&str]| {
        let arguments = [&["check", design, "--data", "."], more].concat();
        let done = workspace.fusion(&arguments).success();
        (stdout(&done), stderr(&done))
    };
    let (page, warnings) = check("wrong.toml", &["--fix", "right.toml"]);
    assert!(warnings.contains("warning[axes]"), "{warnings}");
    assert!(
        page.contains("write `source.imu.channels.angular_rate.columns = [\"wx\", \"wy\", \"wz\"]`"),
        "{page}"
    );
    let right = workspace.read("right.toml");
    assert!(
        right.starts_with("# My car.\n") && right.contains("columns = [\"wx\", \"wy\", \"wz\"]"),
        "{right}"
    );
    assert_eq!(check("right.toml", &[]).1, "");
    // Without the rule there is neither a warning nor a copy.
    let (page, warnings) = check("wrong.toml", &["--ignore", "axes", "--fix", "none.toml"]);
    assert!(
        !warnings.contains("axes") && page.contains("no copy is written"),
        "{page}{warnings}"
    );
    assert!(!workspace.path("none.toml").exists());
    // Relative paths start at the folder of the design, and files are not replaced.
    for (copy, told) in [("../right.toml", "is not beside"), ("wrong.toml", "is there already")] {
        let refused = workspace.fusion(&["check", "wrong.toml", "--fix", copy]).code(2);
        assert!(stderr(&refused).contains(told), "{copy}");
    }
}

#[test]
fn a_sign_behind_a_declared_rotation_is_put_right_in_the_columns() {
    let workspace = Workspace::new("frames-rotation");
    drive(&workspace);
    let turned = "rotation={ axes = [\"y\", \"-z\", \"-x\"] }";
    // x_body = y, y_body = -z, z_body = -x of the sensor. So the sensor's x, y, z are -z, x, -y of the body.
    let sets = |first: &str| {
        let channels = [(RATE, "w"), (FORCE, "f")].map(|(channel, l)| {
            let columns = format!("{channel}.columns=[\"{first}{l}z\", \"{l}x\", \"-{l}y\"]");
            [columns, format!("{channel}.{turned}")]
        });
        channels.concat()
    };
    let (warnings, _) = told_of(&workspace, DRIVE, &sets("-"));
    assert_eq!(warnings, "");
    let (warnings, _) = told_of(&workspace, DRIVE, &sets(""));
    assert!(warnings.contains("write `columns = [\"-wz\", \"wx\", \"-wy\"]`"), "{warnings}");
    assert!(warnings.contains("write `columns = [\"-fz\", \"fx\", \"-fy\"]`"), "{warnings}");
}

#[test]
fn what_does_not_move_is_not_judged() {
    let workspace = Workspace::new("frames-noise");
    drive(&workspace);
    let mut random = fusion::core::testing::Lcg::new(5);
    let mut noise = || random.unit() - 0.5;
    let mut imu = "t,wx,wy,wz,fx,fy,fz\n".to_owned();
    for i in 1..6000 {
        let t = f64::from(i) * 0.05;
        let row = [noise(), noise(), noise(), noise(), noise(), noise() - 9.8];
        writeln!(imu, "{t},{},{},{},{},{},{}", row[0], row[1], row[2], row[3], row[4], row[5]).unwrap();
    }
    workspace.write("imu.csv", imu);
    let (warnings, found) = told_of(&workspace, DRIVE, &[]);
    assert_eq!(warnings, "", "{:?}", found.comparisons);
    let channels = found.comparisons.iter().filter(|c| c.samples > 0);
    assert_eq!(channels.count(), 3, "{:?}", found.comparisons);
    let said = |what: &str| found.comparisons.iter().find(|c| c.what == what).unwrap().verdict.clone();
    assert_eq!(said("imu.specific_force"), "down as declared; forward, right not decided");
    assert_eq!(said("imu.angular_rate"), "not decided: no agreement, or too little motion");
}

#[test]
fn check_tells_the_mistake_at_its_place_where_data_are_named() {
    let workspace = Workspace::new("frames-check");
    drive(&workspace);
    workspace.write("drive.toml", DRIVE.replace("\"wz\"]", "\"-wz\"]"));
    let ran = workspace.fusion(&["check", "drive.toml", "--data", "."]).success();
    let told = stderr(&ran);
    assert!(told.contains("drive.toml:28:28"), "{told}");
    assert!(
        told.contains("`imu.angular_rate`") && told.contains("down is minus the declared z"),
        "{told}"
    );
    assert!(stdout(&ran).contains("Frames, judged by the data"));
    let ran = workspace.fusion(&["check", "drive.toml"]).success();
    assert_eq!(stderr(&ran), "");
}

#[test]
fn waves_do_not_accuse_a_unit_that_is_right() {
    let w = Workspace::new("frames-waves");
    let sea = rough_sea(&w);
    const RIGHT: &str = "\"angular_rate_z [rad/s]\"";
    assert!(sea.contains(RIGHT));
    w.write("log/wrong.toml", sea.replace(RIGHT, "\"-angular_rate_z [rad/s]\""));
    let said = |design: &str| {
        // With JSON, sentences are not wrapped.
        let ran = w.fusion(&["check", design, "--data", "log", "--format", "json"]).success();
        (stderr(&ran), stdout(&ran))
    };
    let (warned, compared) = said("log/sea.toml");
    assert!(
        !warned.contains("warning") && compared.contains("not decided: waves"),
        "{warned}{compared}"
    );
    assert!(compared.contains("gnss_position.lever_arm"), "arms are judged: {compared}");
    // If waves hide a wrong sign, the field shows it, and no other advice is given.
    let (warned, compared) = said("log/wrong.toml");
    assert_eq!(warned.matches("warning[").count(), 1, "{warned}");
    assert!(
        warned.contains("the axes of `imu.angular_rate`") && warned.contains("down is minus the declared z"),
        "{warned}"
    );
    assert!(compared.contains("not decided: waves"), "{compared}");
}

#[test]
fn the_stride_of_a_foot_accuses_no_axis_and_a_wrong_reference_no_unit() {
    let w = Workspace::new("frames-foot");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    w.fusion(&["record", "mine.toml", "--out", "log"]).success();
    assert_eq!(warned(&w, &[]), "");
    for every in [2, 5, 10, 20] {
        assert_eq!(
            warned(&w, &[&format!("source.reference.keep={{ every = {every} }}")]),
            "",
            "{every}"
        );
    }
    for shift in ["-0.3 s", "-0.4 s", "0.3 s"] {
        assert_eq!(warned(&w, &[&format!("source.reference.time.offset=\"{shift}\"")]), "", "{shift}");
    }
    let exchanged =
        "source.reference.channels.velocity.columns=[\"velocity_east [m/s]\", \"velocity_north [m/s]\", \"velocity_down [m/s]\"]";
    let order = "source.reference.channels.attitude.quaternion=[\"attitude_x\", \"attitude_y\", \"attitude_z\", \"attitude_w\"]";
    for (set, accused) in [(exchanged, "`reference.velocity`"), (order, "`reference.attitude`")] {
        let warned = warned(&w, &[set]);
        assert_eq!(warned.matches("warning[").count(), 1, "{warned}");
        assert!(warned.contains(accused), "{warned}");
    }
}
