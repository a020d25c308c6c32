//! The parts library, `configs/parts/KIND/NAME.toml`: every part in the folder, composed into a small design of its
//! kind and simulated, or included by a shipped design.

use crate::support::Workspace;
use fusion::config::Document;
use fusion::design::Design;
use fusion::models::units;
use fusion::run::Options;
use fusion_judge::campaign::monte_carlo;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Parts that do not form a design with companions only: their streams, ship or mission plan are in the designs that
/// include them. Or their tuning is published and does not match the simulated errors.
const OF_DESIGNS: [&str; 11] = [
    "gnss/rtk",
    "gnss/single-frequency",
    "gnss/single-point",
    "navigator/tracked",
    "usbl/moored-ship",
    "usbl/sea-trial",
    "vehicle/car",
    "vehicle/tracked",
    "vehicle/tracked-navigators",
    "vehicle/uri-r",
    "vehicle/utv",
];

const DESIGN: &str = r#"
[run]
description = "A part of the library with its companions, simulated"
origin = { latitude = "47 deg", longitude = "8 deg", height = "400 m" }
seed = 1

[process]
type = "strapdown"

[stage.rest]
type = "stationarity"
source = "imu"
rate = "1 Hz"
max_speed = "0.5 m/s"
still = { window = "1 s", accel_std = "0.1 m/s^2", gyro_std = "0.5 deg/s" }

[sensor.rest]
type = "zero_angular_rate"
source = "rest"
noise = { sigma = "0.05 deg/s" }

[initial.start]
type = "explicit"
position_sigma = "2 m"
velocity = [0, 0, 0]
velocity_sigma = "0.1 m/s"
attitude = [0, 0, "30 deg"]
attitude_sigma = ["0.5 deg", "0.5 deg", "1 deg"]

[simulation]
draw_parameters = true
draw_start = true
start = { heading = "30 deg" }
"#;

/// Turns to both sides, so that accelerations about all axes separate attitude from biases.
const TRAJECTORY: &str = r#"
trajectory = [
    { type = "rest", duration = "10 s" },
    { type = "straight", distance = "20 m", speed = "3 m/s", acceleration = "1 m/s^2" },
    { type = "turn", angle = "90 deg", radius = "10 m" },
    { type = "straight", distance = "20 m" },
    { type = "turn", angle = "-180 deg", radius = "10 m" },
    { type = "straight", distance = "20 m" },
]
"#;

/// For a simulated vehicle.
const MISSION: &str = r#"
longest = "2 min"
mission = [
    { type = "wait", duration = "10 s" },
    { type = "go_to", to = ["20 m", "10 m"], speed = "0.8 m/s" },
    { type = "go_to", to = ["20 m", "30 m"], speed = "0.8 m/s" },
]
"#;

struct Part {
    kind: String,
    /// `KIND/NAME`.
    name: String,
    path: PathBuf,
    text: String,
}

impl Part {
    fn table(&self) -> Table {
        toml::from_str(&self.text).unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    /// The design that tests the part.
    fn design(&self) -> String {
        let (companions, more): (&[&str], _) = match self.kind.as_str() {
            "imu" => (&["gnss/zed-f9p-rtk"], ""),
            "gnss" => (&["imu/hg4930"], ""),
            "gate" => (&["imu/hg4930", "gnss/neo-m8"], ""),
            "barometer" | "depth" | "dvl" | "vehicle" | "compass" => (&["imu/hg4930", "gnss/zed-f9p-rtk"], ""),
            "magnetometer" => (
                &["imu/hg4930", "gnss/zed-f9p-rtk"],
                "[sensor.magnetometer]\nstrength = '48 uT'\ninclination = '63 deg'\ndeclination = '3 deg'\n",
            ),
            "usbl" => (
                &["imu/hg4930", "gnss/zed-f9p-rtk"],
                "[sensor.usbl]\nposition = { latitude = '47 deg', longitude = '8.001 deg', height = '420 m' }\n",
            ),
            kind => panic!("{}: `{kind}` is a new kind of part: name its companions here", self.name),
        };
        let companions = companions.iter().map(|name| folder().join(format!("{name}.toml")));
        let include: Vec<_> = companions.chain([self.path.clone()]).collect();
        let drives = self.table().get("simulation").is_some_and(|s| s.get("vehicle").is_some());
        format!(
            "include = {include:?}\n{DESIGN}{}\n{more}",
            if drives { MISSION } else { TRAJECTORY }
        )
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/parts")
}

fn inside(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    paths
}

fn parts() -> Vec<Part> {
    let kinds = inside(&folder()).into_iter().filter(|path| path.is_dir());
    let files = kinds.flat_map(|kind| inside(&kind));
    let part = |path: PathBuf| {
        let kind = path.parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned();
        let name = format!("{kind}/{}", path.file_stem().unwrap().to_str().unwrap());
        let text = std::fs::read_to_string(&path).unwrap();
        Part { kind, name, path, text }
    };
    files.map(part).collect()
}

/// The parts that are tested in a design of their kind.
fn alone() -> Vec<Part> {
    let parts = parts();
    for name in OF_DESIGNS {
        assert!(parts.iter().any(|part| part.name == name), "{name} is gone: take it from the list");
    }
    parts.into_iter().filter(|part| !OF_DESIGNS.contains(&part.name.as_str())).collect()
}

#[test]
fn every_part_makes_a_design_of_its_kind_whose_filter_knows_its_errors() {
    let w = Workspace::new("parts");
    for part in alone() {
        w.write("part.toml", part.design());
        w.fusion(&["check", "part.toml"]).success();
        let document = Document::load(&w.path("part.toml")).unwrap_or_else(|d| panic!("{}: {d}", part.name));
        let design = Design::read(document).unwrap_or_else(|d| panic!("{}: {d}", part.name));
        let campaign = monte_carlo(&design, &Options::default(), 0..10, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{}: {d}", part.name));
        for (what, nees) in ["position", "velocity", "attitude"].iter().zip(campaign.campaign.pooled().nees) {
            // Slow errors count once in a run: ten runs with three axes have 30 degrees of freedom, and χ²/30 is within
            // 0.46 … 1.79 with 99 %. The seeds are fixed: the parts have 0.70 … 1.24.
            let nees = nees.unwrap();
            assert!(
                (0.46..1.79).contains(&nees),
                "{}: NEES of {what} over its dimension is {nees}",
                part.name
            );
        }
    }
}

/// The files that a file includes, itself or in a variant, and the files that these include.
fn included(file: &Path, found: &mut BTreeSet<PathBuf>) {
    fn of(table: &Table) -> Vec<&str> {
        let files = table.get("include").and_then(Value::as_array).into_iter().flatten();
        let own = files.filter_map(Value::as_str);
        own.chain(table.values().filter_map(Value::as_table).flat_map(of)).collect()
    }
    let table: Table = toml::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    for name in of(&table) {
        let path = file.parent().unwrap().join(name).canonicalize().unwrap();
        if found.insert(path.clone()) {
            included(&path, found);
        }
    }
}

#[test]
fn every_other_part_is_in_a_shipped_design_that_is_valid() {
    let w = Workspace::new("parts-of-designs");
    let configs = folder().parent().unwrap().to_owned();
    let mut used = BTreeSet::new();
    for path in ["", "real"].into_iter().flat_map(|sub| inside(&configs.join(sub))) {
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        included(&path, &mut used);
        // With all variants. Recorded logs are not needed.
        if path.parent() == Some(&configs) {
            w.fusion(&["check", path.to_str().unwrap()]).success();
        } else {
            let document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
            Design::read(document).unwrap_or_else(|d| panic!("{d}"));
        }
    }
    for part in parts().iter().filter(|part| OF_DESIGNS.contains(&part.name.as_str())) {
        assert!(used.contains(&part.path.canonicalize().unwrap()), "{} is in no design", part.name);
    }
}

fn at<'a>(table: &'a Table, path: &str) -> Option<&'a Value> {
    let (first, rest) = path.split_once('.').unwrap_or((path, ""));
    let value = table.get(first)?;
    if rest.is_empty() {
        Some(value)
    } else {
        at(value.as_table()?, rest)
    }
}

fn si(value: &Value) -> f64 {
    units::parse(value.as_str().unwrap()).unwrap().0
}

/// The simulated error of an inertial unit equals the error that the filter declares.
#[test]
fn inertial_units_are_simulated_with_the_figures_of_the_filter() {
    for part in parts().iter().filter(|part| part.kind == "imu") {
        let table = part.table();
        if at(&table, "simulation.imu.preset").is_some() {
            continue;
        }
        for triad in ["gyro", "accelerometer"] {
            let find = |path: &str| at(&table, &path.replace("TRIAD", triad));
            let place = format!("{}, {triad}", part.name);
            assert_eq!(find("process.TRIAD.noise"), find("simulation.imu.TRIAD.noise"), "{place}");
            assert_eq!(find("process.TRIAD.bias.sigma"), find("simulation.imu.TRIAD.bias"), "{place}");
            // A Gauss-Markov error at first grows like a random walk of σ √(2/τ). The largest of three axes counts.
            let walk = find("process.TRIAD.bias.random_walk").map_or(0.0, si);
            let wander = find("simulation.imu.TRIAD.markov").map_or(0.0, |markov| {
                let sigma = match &markov["sigma"] {
                    Value::Array(axes) => axes.iter().map(si).fold(0.0, f64::max),
                    sigma => si(sigma),
                };
                sigma * (2.0 / si(&markov["correlation_time"])).sqrt()
            });
            // Two digits are written: half a unit of the second digit is at most 5 %.
            assert!((walk - wander).abs() <= 0.05 * wander, "{place}: {walk} and {wander}");
        }
    }
}

/// Simulated white noise equals the noise that the filter declares for a sensor.
#[test]
fn sensors_are_simulated_with_the_noise_of_the_filter() {
    let mut compared = 0;
    for part in alone() {
        let table = part.table();
        for (sensor, simulated) in at(&table, "simulation.sensor").and_then(Value::as_table).into_iter().flatten() {
            let declared = at(&table, &format!("sensor.{sensor}.noise.sigma"));
            assert_eq!(declared, simulated.get("white"), "{}, {sensor}", part.name);
            compared += 1;
        }
    }
    assert!(compared > 0);
}

#[test]
fn every_part_names_its_source_and_has_a_row_in_the_table() {
    let readme = std::fs::read_to_string(folder().join("README.md")).unwrap();
    for part in parts() {
        assert!(
            part.text.lines().any(|line| line.starts_with("# Source: ")),
            "{} names no source",
            part.name
        );
        let row = format!("| `{}` |", part.name);
        assert!(readme.contains(&row), "configs/parts/README.md has no row {row}");
    }
}
