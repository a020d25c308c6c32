//! `fusion record`: a simulated world as a log, and the filter over it.

use crate::support::{Workspace, stderr, stdout};

const FIXED_START: &str = "simulation.draw_start=false";

/// The numbers of a CSV file, each with what its last digit is worth.
fn numbers(w: &Workspace, file: &str) -> Vec<(f64, f64)> {
    let text = w.read(file);
    let number = |cell: &str| {
        let decimals = cell.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        Some((cell.parse().ok()?, 10_f64.powi(-i32::try_from(decimals).unwrap())))
    };
    let cells = text.lines().skip(1).flat_map(|line| line.split(','));
    cells.filter_map(number).collect()
}

#[test]
fn the_filter_over_the_log_estimates_what_it_estimates_in_simulation() {
    for vehicle in ["car", "drone", "boat", "auv", "person", "rover"] {
        let w = Workspace::new(&format!("record-{vehicle}"));
        w.fusion(&["new", "mine", "--from", vehicle]).success();
        let said = stdout(&w.fusion(&["record", "mine.toml", "--set", FIXED_START, "--out", "log"]).success());
        assert!(said.contains("fusion run log/design.toml") && said.contains("imu.csv"), "{said}");
        w.fusion(&["run", "mine.toml", "--set", FIXED_START, "--out", "simulated"])
            .success();
        w.fusion(&["run", "log/design.toml", "--out", "recorded"]).success();
        let [simulated, recorded] = ["simulated", "recorded"].map(|out| numbers(&w, &format!("{out}/estimates.csv")));
        let counts = (simulated.len(), recorded.len());
        assert!(counts.0 > 5000 && counts.0 == counts.1, "{vehicle}: {counts:?}");
        for ((a, digit), (b, other)) in simulated.iter().zip(&recorded) {
            // One in the last digit that both have; 1e-8: latitudes in degrees are rounded by nanometres.
            assert!((a - b).abs() < 1e-8 + 1.01 * digit.max(*other), "{vehicle}: {a} {b}");
        }
        // It is scored against the truth, which is in the log too.
        let position = |out: &str| {
            let summary: serde_json::Value = serde_json::from_str(&w.read(&format!("{out}/summary.json"))).unwrap();
            summary["score"]["position"]["rms"][0].as_f64().unwrap()
        };
        assert!((position("simulated") - position("recorded")).abs() < 1e-6, "{vehicle}");
    }
}

#[test]
fn what_cannot_be_recorded_is_told_at_its_place() {
    let w = Workspace::new("record-mistakes");
    w.fusion(&["new", "other", "--from", "car"]).success();
    w.fusion(&["record", "other.toml", "--out", "log"]).success();
    let said = stderr(&w.fusion(&["record", "log/design.toml", "--out", "again"]).code(2));
    assert!(said.contains("no simulated world"), "{said}");
}
