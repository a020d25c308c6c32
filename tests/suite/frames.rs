//! Mistakes of axes, signs, units and lever arms, found by `fusion::frames` from the data: each provoked on the log of
//! the car and on a drive in closed form; none is told of a shipped design.

use super::real::{data, real_design};
use super::rewind::designs;
use super::support::{Workspace, stderr, stdout};
use fusion::config::{Document, Files};
use fusion::core::geometry::so3::{from_rpy, log, rotation};
use fusion::design::Design;
use fusion::frames::{Judged, judge};
use fusion::run::Options;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

/// The warnings, and what the data say.
fn told(design: &Design, options: &Options) -> (String, Judged) {
    let judged = judge(design, options, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
    (judged.mistakes.to_string(), judged)
}

const RATE: &str = "source.imu.channels.angular_rate";
const FORCE: &str = "source.imu.channels.specific_force";
const VELOCITY: &str = "source.gnss.channels.velocity";

/// What is declared wrongly, and the two lines that have to be told of it.
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

/// The design of the car without its reference: the course alone tells the attitude.
fn car(has_reference: bool, sets: &[String]) -> Option<(Design, Options)> {
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/real");
    let file = base.join("pntos-car.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let mut kept = true;
    let lines = text.lines().filter(|line| {
        if line.starts_with('[') {
            kept = has_reference || !(line.contains("reference") || line.contains("variant"));
        }
        kept
    });
    let text: String = lines.fold(String::new(), |text, line| text + line + "\n");
    let (mut document, mistakes) = Document::parse(&file.display().to_string(), &text);
    assert!(mistakes.is_empty());
    assert!(document.compose(&file, Files::Disk).is_empty());
    sets.iter().for_each(|set| document.set(set).unwrap());
    let options = Options {
        data: Some(data()?),
        base,
        ..Options::default()
    };
    Some((Design::read(document).unwrap_or_else(|e| panic!("{e}")), options))
}

#[test]
fn every_frame_mistake_on_the_car_is_named_with_and_without_a_reference() {
    for has_reference in [true, false] {
        for (sets, expected) in provoked() {
            let Some((design, options)) = car(has_reference, &sets) else {
                return;
            };
            let (warnings, _) = told(&design, &options);
            for line in expected {
                assert!(
                    warnings.contains(line),
                    "reference {has_reference}, {sets:?}: {line:?} is not in\n{warnings}"
                );
            }
            let count = warnings.matches("warning: ").count();
            let channels = if sets[0].contains("rotation") { 2 } else { 1 };
            assert_eq!(
                count, channels,
                "reference {has_reference}, {sets:?}: as many channels are wrong:\n{warnings}"
            );
        }
    }
}

const POSITION: &str = "source.gnss.channels.position";

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
            assert_eq!(warnings.matches("warning: ").count(), 1, "{has_reference} {sets:?}:\n{warnings}");
            assert!(warnings.contains(help), "{has_reference} {sets:?}:\n{warnings}");
            // Without a reference nothing but the velocity tells which way up is.
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
        assert_eq!(warnings.matches("warning: ").count(), 1, "{position}:\n{warnings}");
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
    // The road is level: nothing tells of down.
    assert_eq!(with.verdict, "north, east as declared; down not decided");
    let exchanged = "source.doppler.channels.velocity.columns=[\"ve\", \"vn\", \"vd\"]".to_owned();
    let (warnings, _) = told_of(&workspace, &two, &[exchanged]);
    assert!(warnings.contains("write `columns = [\"vn\", \"ve\", \"vd\"]`"), "{warnings}");
    assert!(warnings.contains("the sign of down is not decided by these data"), "{warnings}");
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

#[test]
fn a_shifted_clock_is_told_and_hides_no_axes() {
    for (has_reference, source) in [(true, "imu"), (false, "imu"), (true, "reference")] {
        for (shift, way) in [("1.5 s", "late"), ("-1.5 s", "early")] {
            let set = format!("source.{source}.time.offset=\"{shift}\"");
            let Some((design, options)) = car(has_reference, &[set]) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings.matches("warning: ").count(), 1, "{source} {shift}:\n{warnings}");
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
        ("scale=0.5", "too small by a factor of 2", "leave it out"),
        ("scale=1.5", "too large by a factor of 1.5", "leave it out"),
    ] {
        for has_reference in [true, false] {
            let Some((design, options)) = car(has_reference, &[format!("{VELOCITY}.{set}")]) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings.matches("warning: ").count(), 1, "{set}:\n{warnings}");
            assert!(warnings.contains(says) && warnings.contains(help), "{set}:\n{warnings}");
            let listed = found.comparisons.iter().find(|c| c.what == "gnss.velocity").unwrap();
            assert!(listed.verdict.contains(says), "{listed:?}");
        }
    }
}

#[test]
fn no_frame_of_a_shipped_design_is_doubted() {
    let mut judged = 0;
    for file in designs("configs/real") {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        let (document, _) = Document::parse(&name, &std::fs::read_to_string(&file).unwrap());
        let variants = document.root().get("variant").map_or(&[][..], |v| v.entries());
        // Only a variant with data of its own is another case; the others would be judged alike.
        let own = variants.iter().filter(|v| {
            v.node
                .at("source")
                .is_some_and(|s| s.entries().iter().any(|s| s.node.get("path").is_some()))
        });
        let own: Vec<&str> = own.map(|v| v.key.as_str()).collect();
        for variant in own.iter().map(std::slice::from_ref).chain([&[][..]]) {
            let Some((design, options)) = real_design(&name, variant, &[]) else {
                return;
            };
            let (warnings, found) = told(&design, &options);
            assert_eq!(warnings, "", "{name} {variant:?}");
            judged += found.comparisons.len();
            for c in &found.comparisons {
                // Half of what is certain: the next log is another one.
                assert!(c.margin < 3.0, "{name} {variant:?}: {c:?}");
            }
        }
    }
    assert!(judged >= 15, "{judged} comparisons");
}

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

#[test]
fn a_lever_arm_with_the_wrong_sign_is_named_on_the_car() {
    // The reference's own point lies 1.2 m ahead of the inertial unit: fused, its velocity has that arm.
    let fused = |arm: &str| {
        vec![
            "source.gnss.path=\"pntos_cobra_car/derived/ref_20hz.csv.gz\"".to_owned(),
            "source.gnss.keep={ every = 20 }".to_owned(),
            format!("sensor.gnss_position.lever_arm={{ estimate = true, initial = {arm}, sigma = \"0.1 m\" }}"),
            "run.stop=\"1300 s\"".to_owned(),
        ]
    };
    let Some((design, options)) = car(false, &fused("[\"1.2 m\", 0, 0]")) else {
        return;
    };
    let (warnings, found) = told(&design, &options);
    assert_eq!(warnings, "", "{:?}", found.comparisons);
    let (design, options) = car(false, &fused("[\"-1.2 m\", 0, 0]")).unwrap();
    let (warnings, _) = told(&design, &options);
    assert!(
        warnings.contains("the lever arm of `gnss_position` has the wrong sign along x"),
        "{warnings}"
    );
    assert!(warnings.contains("try `initial = [\"1.2 m\", \"0 m\", \"0 m\"]`"), "{warnings}");
    // The antenna's own arm was found by fusing the log: 0, 0.3, −0.35 m. With a 1σ of a metre no sign is declared.
    for (sigma, is_told) in [("0.1 m", true), ("1 m", false)] {
        let arm = format!("sensor.gnss_position.lever_arm={{ estimate = true, initial = [0, \"-0.3 m\", 0], sigma = \"{sigma}\" }}");
        let (design, options) = car(true, &[arm]).unwrap();
        let (warnings, _) = told(&design, &options);
        assert_eq!(
            warnings.contains("the lever arm of `gnss_position` has the wrong sign along y"),
            is_told,
            "{sigma}: {warnings}"
        );
    }
}

/// Five minutes on roads that bend and tilt, in closed form: rows of an inertial unit at 20 Hz, of positions and
/// velocities at 1 Hz, and of attitudes.
fn drive(workspace: &Workspace) {
    let speed = |t: f64| 10.0 + 4.0 * (0.21 * t).sin();
    let heading = |t: f64| 4.0 * (0.05 * t).sin() + 0.3 * (0.37 * t).cos();
    let q = |t: f64| from_rpy(0.06 * (0.53 * t).sin(), 0.05 * (0.71 * t).cos(), heading(t));
    let velocity = |t: f64| Vector3::new(speed(t) * heading(t).cos(), speed(t) * heading(t).sin(), 0.0);
    let mut imu = "t,wx,wy,wz,fx,fy,fz\n".to_owned();
    for i in 1..6000 {
        let (a, b) = (f64::from(i - 1) * 0.05, f64::from(i) * 0.05);
        let w = log(&(q(a).inverse() * q(b))) / 0.05;
        let n = (velocity(b) - velocity(a)) / 0.05 - Vector3::new(0.0, 0.0, 9.8);
        let f = rotation(&q((a + b) / 2.0)).transpose() * n;
        writeln!(imu, "{b},{},{},{},{},{},{}", w.x, w.y, w.z, f.x, f.y, f.z).unwrap();
    }
    let (mut gnss, mut ahrs) = ("t,n,e,d,vn,ve,vd,sn,se,sd\n".to_owned(), "t,qw,qx,qy,qz\n".to_owned());
    let mut place = Vector3::zeros();
    for i in 0..30_000 {
        let t = f64::from(i) * 0.01;
        let (v, q) = (velocity(t), q(t));
        if i % 100 == 0 {
            // 1σ that change with the sky.
            let sigma = 0.1 + 0.03 * (0.017 * t).sin();
            let row = [place.x, place.y, place.z, v.x, v.y, v.z, sigma, 1.2 * sigma, 2.0 * sigma];
            writeln!(gnss, "{t},{}", row.map(|n| n.to_string()).join(",")).unwrap();
        }
        if i % 10 == 0 {
            writeln!(ahrs, "{t},{},{},{},{}", q.w, q.i, q.j, q.k).unwrap();
        }
        place += (v + velocity(t + 0.01)) * 0.005;
    }
    [("imu.csv", imu), ("gnss.csv", gnss), ("ahrs.csv", ahrs)]
        .iter()
        .for_each(|(file, rows)| workspace.write(file, rows));
}

const DRIVE: &str = r#"
[run]
origin = { latitude = "50 deg", longitude = "10 deg", height = "0 m" }
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.01 deg/s/sqrt(Hz)"
accelerometer.noise = "1 mg/sqrt(Hz)"
[initial.start]
type = "explicit"
velocity = [0, 0, 0]
velocity_sigma = "10 m/s"
attitude = [0, 0, 0]
attitude_sigma = "20 deg"
[initial.fix]
type = "first_fix"
source = "gnss"
position_sigma = "1 m"
[sensor.gnss]
type = "gnss_position"
source = "gnss"
noise = { sigma = "1 m" }
[source.imu]
type = "csv"
path = "imu.csv"
time = { column = "t" }
[source.imu.channels]
angular_rate = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
[source.gnss]
type = "csv"
path = "gnss.csv"
time = { column = "t" }
[source.gnss.channels]
position = { north = "n", east = "e", down = "d" }
velocity = { columns = ["vn", "ve", "vd"], unit = "m/s" }
"#;

const AHRS: &str = r#"
[source.ahrs]
type = "csv"
path = "ahrs.csv"
time = { column = "t" }
channels.attitude = { quaternion = ["qw", "qx", "qy", "qz"] }
[reference]
source = "ahrs"
"#;

/// All signed permutations of three columns.
fn permutations() -> Vec<[(usize, bool); 3]> {
    let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let signs = (0..8).map(|bits: u8| [0, 1, 2].map(|i| bits >> i & 1 == 1));
    signs.flat_map(|s| orders.map(|o| [0, 1, 2].map(|i| (o[i], s[i])))).collect()
}

fn read(workspace: &Workspace, text: &str, sets: &[String]) -> (Design, Options) {
    let (mut document, mistakes) = Document::parse("drive.toml", text);
    assert!(mistakes.is_empty(), "{mistakes:?}");
    sets.iter().for_each(|set| document.set(set).unwrap());
    let options = Options {
        data: Some(workspace.path("")),
        ..Options::default()
    };
    (Design::read(document).unwrap_or_else(|e| panic!("{e}")), options)
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

fn told_of(workspace: &Workspace, text: &str, sets: &[String]) -> (String, Judged) {
    let (design, options) = read(workspace, text, sets);
    told(&design, &options)
}

#[test]
fn a_sign_behind_a_declared_rotation_is_put_right_in_the_columns() {
    let workspace = Workspace::new("frames-rotation");
    drive(&workspace);
    let turned = "rotation={ axes = [\"y\", \"-z\", \"-x\"] }";
    // x_body = y, y_body = -z, z_body = -x of the sensor: whose x, y, z are -z, x, -y of the body.
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

/// The log of a boat in waves, without a reference: `log/sea.toml`.
fn rough_sea(w: &Workspace) -> String {
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    // Long enough for slow motion to tell, rough, and the antenna on a mast.
    let lines = "{ type = \"straight\", distance = \"100 m\" }, { type = \"turn\", angle = \"180 deg\", radius = \"15 m\" }, \
                 { type = \"straight\", distance = \"100 m\" }, { type = \"turn\", angle = \"-180 deg\", radius = \"15 m\" }, ";
    let way = format!(
        "[{{ type = \"rest\", duration = \"20 s\" }}, {{ type = \"straight\", distance = \"100 m\", speed = \"3 m/s\", acceleration = \"0.3 m/s^2\" }}, {}]",
        lines.repeat(8)
    );
    let sets = [
        format!("simulation.trajectory={way}"),
        "sensor.gnss_position.lever_arm=[\"-3 m\", 0, \"-2.5 m\"]".to_owned(),
        "sensor.gnss_velocity.lever_arm=[\"-3 m\", 0, \"-2.5 m\"]".to_owned(),
    ];
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set.as_str()]).collect();
    w.fusion(&[&["record", "mine.toml", "--out", "log"], &sets[..]].concat()).success();
    // At sea there is no reference.
    let recorded = w.read("log/design.toml");
    let tables = recorded.split_inclusive('\n').fold(Vec::<String>::new(), |mut tables, line| {
        match tables.last_mut() {
            Some(table) if !line.starts_with('[') => table.push_str(line),
            _ => tables.push(line.to_owned()),
        }
        tables
    });
    let is_reference = |table: &String| table.starts_with("[reference]") || table.starts_with("[source.reference");
    let sea: String = tables.into_iter().filter(|table| !is_reference(table)).collect();
    w.write("log/sea.toml", &sea);
    sea
}

#[test]
fn a_fixed_parameter_that_the_data_contradict_is_told_and_no_other() {
    let w = Workspace::new("frames-parameters");
    rough_sea(&w);
    // Each as it is declared of the log: 3.5 deg, 0, 0, −3 m ahead and 2.5 m above, none.
    for (set, told) in [
        ("sensor.magnetometer.declination=\"12 deg\"", "`declination` of `magnetometer`"),
        ("sensor.log.scale=0.1", "`scale` of `log`"),
        ("sensor.gnss_position.time_offset=\"0.3 s\"", "`time_offset` of `gnss_position`"),
        ("sensor.gnss_position.lever_arm=[0, 0, 0]", "`lever_arm` of `gnss_position`"),
        ("sensor.log.mounting=[0, 0, \"8 deg\"]", "`mounting` of `log`"),
        ("sensor.log.current=[0, 0, 0]", "`current` of `log`"),
    ] {
        let ran = w.fusion(&["check", "log/sea.toml", "--data", "log", "--set", set]).success();
        let warned = stderr(&ran);
        assert_eq!(warned.matches("warning: ").count(), 1, "{set}:\n{warned}");
        assert!(warned.contains(&format!("warning: {told} is declared as")), "{set}:\n{warned}");
    }
    // Both sensors of the receiver read one antenna.
    let set = "sensor.gnss_velocity.lever_arm=[0, 0, 0]";
    let ran = w.fusion(&["check", "log/sea.toml", "--data", "log", "--set", set]).success();
    let shared = "here stands `lever_arm = { shared = \"gnss_position.lever_arm\" }`";
    assert!(stderr(&ran).contains(shared), "{}", stderr(&ran));
    // An error that is small, and no chance.
    let set = "sensor.magnetometer.declination=\"5 deg\"";
    let ran = w
        .fusion(&["check", "log/sea.toml", "--data", "log", "--format", "json", "--set", set])
        .success();
    assert!(!stderr(&ran).contains("declination"), "{}", stderr(&ran));
    let listed = stdout(&ran);
    assert!(
        listed.contains("within 2 deg of what is declared, but") && listed.contains("find it as a state"),
        "{listed}"
    );
}

/// The log of a template, `log/design.toml`.
fn recorded(w: &Workspace, template: &str) {
    w.fusion(&["new", "mine", "--from", template]).success();
    w.fusion(&["record", "mine.toml", "--seed", "3", "--out", "log"]).success();
}

/// What is warned of, and what is listed, with these changes of a recorded log.
fn judged(w: &Workspace, sets: &[&str]) -> (String, String) {
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
    // As JSON no sentence is broken.
    let args = [&["check", "log/design.toml", "--data", "log", "--format", "json"], &sets[..]].concat();
    let ran = w.fusion(&args).success();
    (stderr(&ran), stdout(&ran))
}

/// Each with one warning, which has these words.
fn one_each(w: &Workspace, cases: &[(&[&str], &str, &str)]) {
    for (sets, told, help) in cases {
        let (warned, _) = judged(w, sets);
        assert_eq!(warned.matches("warning: ").count(), 1, "{sets:?}:\n{warned}");
        assert!(warned.contains(told) && warned.contains(help), "{sets:?}:\n{warned}");
    }
}

#[test]
fn of_an_underwater_vehicle_the_cause_is_told_and_not_what_acts_like_it() {
    let w = Workspace::new("frames-auv");
    recorded(&w, "auv");
    // Attitude and mounting of the transceiver cancel: as states both go away from what is right.
    let (warned, listed) = judged(&w, &[]);
    assert_eq!(warned, "");
    assert!(listed.contains("the data do not tell it from others: alone it is"), "{listed}");
    let cases: [(&[&str], &str, &str); 4] = [
        (
            &["sensor.usbl.time_offset=\"2 s\""],
            "`time_offset` of `usbl` is declared as",
            "where it is estimated, it becomes 0.0",
        ),
        (
            &["source.depth.channels.depth.column=\"-depth [m]\""],
            "`depth.depth` has a wrong sign",
            "write `column = \"depth [m]\"`",
        ),
        (
            &["sensor.dvl.mounting.initial=[0, 0, \"90 deg\"]"],
            "the axes of `dvl` are turned by -90 deg about down",
            "write `mounting = [\"0 deg\", \"0 deg\", \"0 deg\"]`",
        ),
        (
            &["sensor.usbl.attitude=[0, 0, \"90 deg\"]"],
            "the axes of `usbl` are turned by -90 deg about down",
            "write `attitude = [\"0 deg\", \"0 deg\", \"0 deg\"]`",
        ),
    ];
    one_each(&w, &cases);
}

#[test]
fn of_an_odometer_sign_unit_scale_and_delay_are_told() {
    let w = Workspace::new("frames-odometer");
    recorded(&w, "car");
    assert_eq!(judged(&w, &[]).0, "");
    what_is_tried_is_told(&w);
    let cases: [(&[&str], &str, &str); 6] = [
        (
            &["source.odometer.channels.speed.scale=-1"],
            "the numbers of `odometer` have the wrong sign",
            "change the sign",
        ),
        (
            &["source.odometer.channels.speed.scale=3.6"],
            "the numbers of `odometer` are too large by a factor of 3.5",
            "leave it out",
        ),
        // Before that of a mounting, which would act like it.
        (
            &["source.odometer.time.offset=\"-0.5 s\"", "sensor.odometer.time_offset=\"0.1 s\""],
            "`time_offset` of `odometer` is declared as",
            "in all the delay is 0.0",
        ),
        (
            &["source.odometer.time.offset=\"0.5 s\""],
            "`time_offset` of `odometer` is left out",
            "in all the delay is 0.0",
        ),
        // A latency that is declared too large is no negative one.
        (
            &["source.gnss.channels.position.latency=\"0.3 s\""],
            "`time_offset` of `gnss_position` is left out",
            "in all the delay is -0.00",
        ),
        // Where it would be, the other clock is late.
        (
            &["source.imu.time.offset=\"0.2 s\""],
            "the stamps of `imu` are about 0.17 s late",
            "write `source.imu.time.offset = \"0.03 s\"`",
        ),
    ];
    one_each(&w, &cases);
}

/// Of a sensor that is followed badly; which trial ends last is left to the threads.
fn what_is_tried_is_told(w: &Workspace) {
    let file = w.path("log/design.toml");
    let (mut document, _) = Document::parse("design.toml", &w.read("log/design.toml"));
    assert!(document.compose(&file, Files::Disk).is_empty());
    document.set("source.odometer.time.offset=\"0.5 s\"").unwrap();
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let options = Options {
        data: Some(w.path("log")),
        ..Options::default()
    };
    let steps = std::sync::Mutex::new(Vec::new());
    let heard = |step: fusion::frames::Step<'_>| steps.lock().unwrap().push((step.what.to_owned(), step.done, step.all));
    let judged = judge(&design, &options, &heard).unwrap_or_else(|d| panic!("{d}"));
    let steps = steps.into_inner().unwrap();
    assert!(steps.iter().all(|(_, done, all)| done <= all), "{steps:?}");
    let is_ended = |(_, done, all): &&(String, usize, usize)| done == all && *all > 1;
    let ended = steps.iter().filter(is_ended).count();
    assert!(ended >= 2, "near what is declared, and far from it: {steps:?}, {}", judged.mistakes);
    assert!(steps.iter().any(|(what, ..)| what == "`time_offset` of `odometer`"), "{steps:?}");
}

#[test]
fn waves_do_not_accuse_a_unit_that_is_right() {
    let w = Workspace::new("frames-waves");
    let sea = rough_sea(&w);
    const RIGHT: &str = "\"angular_rate_z [rad/s]\"";
    assert!(sea.contains(RIGHT));
    w.write("log/wrong.toml", sea.replace(RIGHT, "\"-angular_rate_z [rad/s]\""));
    let said = |design: &str| {
        // As JSON no sentence is broken.
        let ran = w.fusion(&["check", design, "--data", "log", "--format", "json"]).success();
        (stderr(&ran), stdout(&ran))
    };
    let (warned, compared) = said("log/sea.toml");
    assert!(
        !warned.contains("warning") && compared.contains("not decided: waves"),
        "{warned}{compared}"
    );
    assert!(compared.contains("gnss_position.lever_arm"), "arms are judged: {compared}");
    // Where waves hide a wrong sign, the field tells it, and nothing else is advised.
    let (warned, compared) = said("log/wrong.toml");
    assert_eq!(warned.matches("warning: ").count(), 1, "{warned}");
    assert!(
        warned.contains("the axes of `imu.angular_rate`") && warned.contains("down is minus the declared z"),
        "{warned}"
    );
    assert!(compared.contains("not decided: waves"), "{compared}");
}

/// Two minutes of a unit that is turned by hand about all its axes, with the field of the Earth: rows at 50 Hz.
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
    for (set, write) in [
        (format!("{RATE}.columns.0=\"-wx\""), "write `columns = [\"wx\", \"wy\", \"wz\"]`"),
        (format!("{RATE}.columns.2=\"-wz\""), "write `columns = [\"wx\", \"wy\", \"wz\"]`"),
        (format!("{RATE}.unit=\"deg/s\""), "write `unit = \"rad/s\"`"),
    ] {
        let (warnings, found) = told_of(&workspace, BY_HAND, std::slice::from_ref(&set));
        assert_eq!(warnings.matches("warning: ").count(), 1, "{set}: {warnings}{:?}", found.comparisons);
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
        assert_eq!(warnings.matches("warning: ").count(), 1, "{set}: {warnings}");
        assert!(
            warnings.contains("`ahrs.attitude` contradicts") && warnings.contains(write),
            "{set}: {warnings}"
        );
        let unit = found.comparisons.iter().filter(|c| c.what.starts_with("imu.") && c.samples > 0);
        unit.for_each(|c| assert!(c.verdict.ends_with("as declared"), "{set}: {c:?}"));
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
        ("source.imu.time.unit=\"ms\"", "write `time.unit = \"s\"`"),
    ] {
        let (warnings, _) = told_of(&workspace, &text, &[set.to_owned()]);
        assert_eq!(
            warnings.matches("warning: ").count(),
            usize::from(!write.is_empty()),
            "{set}: {warnings}"
        );
        assert!(warnings.contains(write), "{set}: {warnings}");
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

/// The warnings of a recorded template.
fn warned(w: &Workspace, sets: &[&str]) -> String {
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    stderr(
        &w.fusion(&[&["check", "log/design.toml", "--data", "log", "--format", "json"], &sets[..]].concat())
            .success(),
    )
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
        assert_eq!(warned.matches("warning: ").count(), 1, "{warned}");
        assert!(warned.contains(accused), "{warned}");
    }
}

#[test]
fn an_antenna_ahead_of_where_a_boat_turns_is_no_early_clock() {
    let w = Workspace::new("frames-early");
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    w.fusion(&["record", "mine.toml", "--out", "log", "--seed", "3"]).success();
    let warned = warned(&w, &[]);
    assert!(!warned.contains("the stamps of"), "{warned}");
}
