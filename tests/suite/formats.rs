//! Estimates in the formats of maps and other programs, beside estimates.csv.

use crate::support::{Workspace, stderr, stdout};
use fusion::source::table::LogTable;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The values of a column of a table.
fn column<'a>(table: &'a LogTable, name: &str) -> &'a [f64] {
    let found = table.columns.iter().find(|column| column.name == name);
    &found.unwrap_or_else(|| panic!("there is no column {name}")).values
}

/// Checks that every element of a text in XML is closed in its order.
fn assert_is_well_formed(text: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in text.split('<').skip(1).map(|part| part.split('>').next().unwrap()) {
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "{tag}");
        } else if !tag.starts_with('?') && !tag.ends_with('/') {
            open.push(tag.split(' ').next().unwrap());
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn a_run_writes_its_estimates_for_maps_and_other_programs() {
    fusion_formats::link();
    let w = Workspace::new("formats");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let also = "geojson,gpx,kml,mcap,parquet,sbet,tum,kml";
    let set = "run.output_rate=1 Hz";
    let args = ["run", &design, "--set", set, "--out", "out", "--also", also, "--smooth"];
    let shown = stdout(&w.fusion(&args).success());
    let csv = LogTable::read(&w.path("out/estimates.csv")).unwrap();
    let rows = csv.rows();
    assert!(rows > 100, "{rows}");
    for name in also.split(',') {
        for first in ["estimates", "smoothed"] {
            let file = format!("{first}.{name}");
            assert!(shown.contains(&file), "{file} is not named:\n{shown}");
            assert!(w.path("out").join(&file).exists(), "{file}");
        }
    }

    let parquet = LogTable::read(&w.path("out/estimates.parquet")).unwrap();
    let cells = |table: &LogTable| -> Vec<(String, Vec<u64>)> {
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect();
        table
            .columns
            .iter()
            .map(|column| (column.name.clone(), bits(&column.values)))
            .collect()
    };
    assert!(
        cells(&parquet) == cells(&csv),
        "estimates.parquet has other cells than estimates.csv"
    );

    let tum = w.read("out/estimates.tum");
    assert_eq!(tum.lines().count(), rows);
    let of_row = |line: &str| -> Vec<f64> { line.split(' ').map(|cell| cell.parse().unwrap()).collect() };
    for (k, row) in tum.lines().map(of_row).enumerate() {
        let [north, east, down] = ["n_m", "e_m", "d_m"].map(|name| column(&csv, name)[k]);
        // Both are rounded to 0.1 mm.
        for (found, wanted) in row[1..4].iter().zip([east, north, -down]) {
            assert!((found - wanted).abs() < 1e-9, "row {k}: {row:?}");
        }
        assert!((row[0] - column(&csv, "t_s")[k]).abs() < 1e-6);
    }

    let sbet = std::fs::read(w.path("out/estimates.sbet")).unwrap();
    let (numbers, rest) = sbet.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    assert_eq!((numbers.len(), rest.len()), (17 * rows, 0));
    for (k, record) in numbers.chunks(17).enumerate() {
        let written = [
            "t_s",
            "lat_deg",
            "lon_deg",
            "height_m",
            "vn_mps",
            "ve_mps",
            "vd_mps",
            "roll_deg",
            "pitch_deg",
        ];
        let of_degrees = [false, true, true, false, false, false, false, true, true];
        for ((name, is_angle), found) in written.into_iter().zip(of_degrees).zip(record) {
            let found = if is_angle { found.to_degrees() } else { *found };
            // The table is rounded to 0.1 mm or better; degrees of a place to 1e-9.
            assert!((column(&csv, name)[k] - found).abs() < 1e-4, "row {k}, {name}: {record:?}");
        }
    }

    let map: serde_json::Value = serde_json::from_str(&w.read("out/estimates.geojson")).unwrap();
    let features = map["features"].as_array().unwrap();
    let of = |kind: &str| features.iter().filter(|f| f["geometry"]["type"] == kind).count();
    assert_eq!(of("Point"), rows);
    assert!(of("Polygon") > 0 && of("Polygon") < rows);
    for file in ["gpx", "kml"] {
        let text = w.read(&format!("out/estimates.{file}"));
        assert_is_well_formed(&text);
        let point = if file == "gpx" { "<trkpt" } else { "<gx:coord" };
        assert_eq!(text.matches(point).count(), rows, "{file}");
    }
}

#[test]
fn further_formats_have_the_estimates_of_the_table() {
    fusion_formats::link();
    let w = Workspace::new("formats-causal");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let late = "simulation.sensor.position.fault.late={ type = \"late\", by = \"2 s\" }";
    let sets = ["run.output_rate=1 Hz", "run.order=\"rewind\"", "run.rewind.horizon=3 s", late];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    for causal in [false, true] {
        let args = ["run", &design, "--out", "out", "--also", "tum"].into_iter().chain(sets.clone());
        let args: Vec<&str> = args.chain(causal.then_some("--causal")).collect();
        w.fusion(&args).success();
        let [table, other] = ["estimates.csv", if causal { "revised.csv" } else { "current.csv" }]
            .map(|file| LogTable::read(&w.path("out").join(file)).unwrap());
        assert_ne!(column(&table, "n_m"), column(&other, "n_m"), "the late rows change nothing");
        let tum = w.read("out/estimates.tum");
        let north: Vec<f64> = tum.lines().map(|line| line.split(' ').nth(2).unwrap().parse().unwrap()).collect();
        assert_eq!(north, column(&table, "n_m"), "causal: {causal}");
    }
}

#[test]
fn a_bag_of_the_estimates_is_read_back() {
    fusion_formats::link();
    let w = Workspace::new("formats-bag");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let args = ["run", &design, "--set", "run.output_rate=1 Hz", "--out", "out", "--also", "mcap"];
    w.fusion(&args).success();
    let csv = LogTable::read(&w.path("out/estimates.csv")).unwrap();
    let tables = LogTable::read_all(&w.path("out/estimates.mcap")).unwrap();
    let of = |topic: &str| {
        let found = tables.iter().find(|table| table.topic.as_ref().is_some_and(|t| t.name == topic));
        found.unwrap_or_else(|| panic!("there is no topic {topic}"))
    };
    let odometry = of("/estimate/odometry");
    let near = |table: &LogTable, name: &str, wanted: &[f64], sign: f64, bound: f64| {
        let found = column(table, name);
        assert_eq!(found.len(), wanted.len(), "{name}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - sign * wanted).abs() <= bound, "{name}: {found} is not {wanted}");
        }
    };
    // estimates.csv has positions to 0.1 mm and angles to 1e-10 deg.
    near(odometry, "pose.pose.position.x", column(&csv, "e_m"), 1.0, 6e-5);
    near(odometry, "pose.pose.position.y", column(&csv, "n_m"), 1.0, 6e-5);
    near(odometry, "pose.pose.position.z", column(&csv, "d_m"), -1.0, 6e-5);
    near(of("/estimate/fix"), "latitude", column(&csv, "lat_deg"), 1.0, 1e-10);
    let variances: Vec<f64> = column(&csv, "sigma_e_m").iter().map(|sigma| sigma * sigma).collect();
    let largest = variances.iter().copied().fold(0.0, f64::max);
    // The 1σ has six decimals.
    near(odometry, "pose.covariance[0]", &variances, 1.0, 2e-6 * largest.sqrt() + 1e-12);
    // Forward speed: the velocity turned by the attitude keeps its length.
    let squared = |table: &LogTable, names: [&str; 3], k: usize| names.map(|name| column(table, name)[k].powi(2)).iter().sum::<f64>();
    for k in 0..csv.rows() {
        let body = squared(
            odometry,
            ["x", "y", "z"].map(|axis| match axis {
                "x" => "twist.twist.linear.x",
                "y" => "twist.twist.linear.y",
                _ => "twist.twist.linear.z",
            }),
            k,
        );
        let level = squared(&csv, ["vn_mps", "ve_mps", "vd_mps"], k);
        // Velocities have five decimals.
        assert!((body.sqrt() - level.sqrt()).abs() < 2e-5, "row {k}");
    }
    assert!(of("/diagnostics").rows() > 0);
    assert_eq!(of("/tf").rows(), csv.rows());
}

#[test]
fn an_unknown_format_and_a_run_that_may_be_resumed_are_refused() {
    let w = Workspace::new("formats-refused");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let error = stderr(&w.fusion(&["run", &design, "--out", "out", "--also", "shape"]).failure());
    assert!(error.contains("kml: path over time for Google Earth"), "{error}");
    let error = stderr(&w.fusion(&["run", &design, "--also", "kml"]).failure());
    assert!(error.contains("--out"), "{error}");
    let args = ["run", &design, "--out", "out", "--also", "kml", "--checkpoint", "saved"];
    let error = stderr(&w.fusion(&args).failure());
    assert!(error.contains("--checkpoint"), "{error}");
    assert!(!Path::new("out").exists());
}
