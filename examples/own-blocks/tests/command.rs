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
fn campaigns_comparisons_and_faults_run_over_the_block() {
    let shown = fusion(&["compare", DESIGN, "--backend", "error_state,iekf"]);
    assert!(shown.contains("iekf") && shown.contains("drift"), "{shown}");
    assert!(fusion(&["montecarlo", DESIGN, "-n", "2"]).contains("range_rate"));
    assert!(fusion(&["stress", DESIGN, "--draw", "2", "--seed", "1"]).contains("recovered"));
}
