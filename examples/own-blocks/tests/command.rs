//! The whole command with a block of this crate: a program of five lines gets all of it.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use std::path::Path;
use std::process::Command;

const DESIGN: &str = "design.toml";

/// The output of the command, which has to succeed; a campaign of faults may judge the design and exit with 3.
fn fusion(args: &[&str]) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let ran = Command::new(env!("CARGO_BIN_EXE_own-blocks"))
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&ran.stderr);
    let is_judged = args[0] == "stress" && ran.status.code() == Some(3);
    assert!(ran.status.success() || is_judged, "{args:?}: {told}");
    String::from_utf8(ran.stdout).unwrap()
}

#[test]
fn every_command_knows_the_block() {
    let help = fusion(&["blocks", "range_rate"]);
    assert!(help.contains("beacon") && help.contains("Range rate to a fixed beacon"), "{help}");
    assert!(fusion(&["blocks"]).contains("range_rate"));
    assert!(fusion(&["schema"]).contains("sensor.range_rate"));
    assert!(fusion(&["check", DESIGN]).contains("range_rate"));
    let out = std::env::temp_dir().join(format!("own-blocks-{}", std::process::id()));
    let shown = fusion(&["run", DESIGN, "--out", out.to_str().unwrap()]);
    assert!(shown.contains("range_rate"), "{shown}");
    for file in ["summary.json", "estimates.csv", "updates.csv", "report.html"] {
        assert!(out.join(file).exists(), "{file}");
    }
    let updates = std::fs::read_to_string(out.join("updates.csv")).unwrap();
    assert!(updates.contains("range_rate"), "no row of the sensor");
    std::fs::remove_dir_all(&out).unwrap();
}

#[test]
fn the_section_of_the_observer_is_in_terminal_summary_and_report_also_with_checkpoints() {
    let out = std::env::temp_dir().join(format!("own-blocks-section-{}", std::process::id()));
    let path = |name: &str| out.join(name).to_str().unwrap().to_owned();
    std::fs::create_dir_all(&out).unwrap();
    let shown = fusion(&["run", DESIGN, "--out", &path("whole")]);
    assert!(shown.contains("Speeds") && shown.contains("largest [m/s]"), "{shown}");
    assert!(std::fs::read_to_string(path("whole/report.html")).unwrap().contains("Speeds"));
    let section = |folder: &str| {
        let text = std::fs::read_to_string(path(&format!("{folder}/summary.json"))).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
        summary["speeds"].clone()
    };
    let whole = section("whole");
    // The trajectory has 10 m/s.
    let largest = whole["largest"][0].as_f64().unwrap();
    assert!((largest - 10.0).abs() < 0.5, "{largest}");
    // Only a run whose observers have a memory can be saved.
    fusion(&[
        "run",
        DESIGN,
        "--out",
        &path("saved"),
        "--checkpoint",
        &path("checkpoint"),
        "--every",
        "0 s",
    ]);
    assert_eq!(section("saved"), whole);
    std::fs::remove_dir_all(&out).unwrap();
}

#[test]
fn campaigns_comparisons_and_faults_run_over_the_block() {
    let shown = fusion(&["compare", DESIGN, "--backend", "error_state,iekf"]);
    assert!(shown.contains("iekf") && shown.contains("drift"), "{shown}");
    assert!(fusion(&["montecarlo", DESIGN, "-n", "2"]).contains("range_rate"));
    assert!(fusion(&["stress", DESIGN, "--draw", "2", "--seed", "1"]).contains("recovered"));
}
