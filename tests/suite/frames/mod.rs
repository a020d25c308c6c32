//! Mistakes of axes, signs, units and lever arms, found by `fusion_advice::frames` from the data. Each is provoked on
//! the log of the car and on a drive in closed form. Shipped designs give no warning.

mod attitude;
mod axes;
mod motion;
mod parameters;

use super::real::{data, real_design};
use super::rewind::designs;
use super::support::{Workspace, stderr, stdout};
use fusion::config::{Document, Edit, Files};
use fusion::core::geometry::so3::{from_rpy, log, rotation, to_rpy};
use fusion::design::Design;
use fusion::run::Options;
use fusion_advice::frames::{Judged, judge};
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

/// The warnings, and the comparisons with the data.
fn told(design: &Design, options: &Options) -> (String, Judged) {
    let judged = judge(design, options, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
    (judged.mistakes.to_string(), judged)
}

const RATE: &str = "source.imu.channels.angular_rate";

const FORCE: &str = "source.imu.channels.specific_force";

const VELOCITY: &str = "source.gnss.channels.velocity";

/// The design of the car without its reference: only the course determines the attitude.
fn car(has_reference: bool, sets: &[String]) -> Option<(Design, Options)> {
    edited_car(has_reference, sets, &[])
}

/// The same design with edits.
fn edited_car(has_reference: bool, sets: &[String], edits: &[Edit]) -> Option<(Design, Options)> {
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
    edits.iter().for_each(|edit| document.apply(edit).unwrap());
    let options = Options {
        data: Some(data()?),
        base,
        ..Options::default()
    };
    Some((Design::read(document).unwrap_or_else(|e| panic!("{e}")), options))
}

const POSITION: &str = "source.gnss.channels.position";

#[test]
fn no_frame_of_a_shipped_design_is_doubted() {
    let mut judged = 0;
    for file in designs("configs/real") {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        let (document, _) = Document::parse(&name, &std::fs::read_to_string(&file).unwrap());
        let variants = document.root().get("variant").map_or(&[][..], |v| v.entries());
        // Only a variant with other data is a separate case. The other variants would give the same result.
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
                // Half of the limit for a warning: the next log will differ.
                assert!(c.margin < 3.0, "{name} {variant:?}: {c:?}");
            }
        }
    }
    assert!(judged >= 15, "{judged} comparisons");
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
    let (mut gnss, mut ahrs) = (
        "t,n,e,d,vn,ve,vd,sn,se,sd\n".to_owned(),
        "t,qw,qx,qy,qz,roll,pitch,yaw\n".to_owned(),
    );
    let mut place = Vector3::zeros();
    for i in 0..30_000 {
        let t = f64::from(i) * 0.01;
        let (v, q) = (velocity(t), q(t));
        if i % 100 == 0 {
            // A 1σ that changes with the satellites in view.
            let sigma = 0.1 + 0.03 * (0.017 * t).sin();
            let row = [place.x, place.y, place.z, v.x, v.y, v.z, sigma, 1.2 * sigma, 2.0 * sigma];
            writeln!(gnss, "{t},{}", row.map(|n| n.to_string()).join(",")).unwrap();
        }
        if i % 10 == 0 {
            let rpy = to_rpy(&q);
            writeln!(ahrs, "{t},{},{},{},{},{},{},{}", q.w, q.i, q.j, q.k, rpy.x, rpy.y, rpy.z).unwrap();
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

fn told_of(workspace: &Workspace, text: &str, sets: &[String]) -> (String, Judged) {
    let (design, options) = read(workspace, text, sets);
    told(&design, &options)
}

/// The log of a boat in waves, without a reference: `log/sea.toml`.
fn rough_sea(w: &Workspace) -> String {
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    // Long enough for slow motion to be decisive, in rough water, with the antenna on a mast.
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
    // A log from the sea has no reference.
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

/// The warnings for a recorded template.
fn warned(w: &Workspace, sets: &[&str]) -> String {
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    stderr(
        &w.fusion(&[&["check", "log/design.toml", "--data", "log", "--format", "json"], &sets[..]].concat())
            .success(),
    )
}
