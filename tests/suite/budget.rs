//! `fusion budget`: which share of each error comes from which source.

use crate::support::{Workspace, page, stderr, titles};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

#[test]
fn a_budget_has_tables_a_file_and_a_picture() {
    let w = Workspace::new("budget");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let shown = w.fusion(&["budget", &design, "--out", "out", "--format", "json"]).success();
    assert_eq!(
        titles(&page(&shown)),
        ["Errors, 1σ", "Best improvement", "Shares of the variance", "Limits", "Written"]
    );
    let found: toml::Table = w.read("out/budget.toml").parse().unwrap();
    let sources = found["sources"].as_array().unwrap().len();
    let states = found["state"].as_array().unwrap();
    assert_eq!((states.len(), states[0]["axis"].as_str().unwrap()), (15, "north"));
    for state in states {
        let shares = state["end"]["shares"].as_array().unwrap();
        assert_eq!(shares.len(), sources);
        let sum: f64 = shares.iter().map(|share| share.as_float().unwrap()).sum();
        // Rounding of a dozen shares.
        assert!((sum - 1.0).abs() < 1e-14, "{state}");
    }
    let svg = w.read("out/budget.svg");
    assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
    // A layer for each source of this design, in each panel.
    assert_eq!(svg.matches("<polygon").count(), states.len() * (sources + 1));
}

#[test]
fn a_mistuned_filter_reports_another_sigma_than_its_errors_have() {
    let w = Workspace::new("budget-mistuned");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let found = |set: &str| {
        w.fusion(&["budget", &design, "--set", set, "--out", "out"]).success();
        let found: toml::Table = w.read("out/budget.toml").parse().unwrap();
        let of = |key: &str| found["state"][0]["end"][key].as_float().unwrap();
        (of("sigma"), of("filter_sigma"))
    };
    let (own, reported) = found("run.seed=1");
    // The start is not drawn, and is forgotten at the end.
    assert!((own / reported - 1.0).abs() < 1e-3, "{own} {reported}");
    let (mistuned, reported) = found("sensor.position.noise.sigma=0.3 m");
    // The optimal gains have the smallest error; this filter trusts the fixes three times too much.
    assert!(mistuned > own && reported < 0.7 * mistuned, "{mistuned} {reported}");
}

#[test]
fn a_design_without_a_world_a_bank_and_a_late_time_are_refused() {
    let w = Workspace::new("budget-refused");
    let series = w.fusion(&["budget", &format!("{ROOT}/configs/series/nile.toml")]).code(2);
    assert!(stderr(&series).contains("a budget needs a simulated world"), "{}", stderr(&series));
    let bank = w.fusion(&["budget", &format!("{ROOT}/configs/after-outage.toml")]).code(2);
    assert!(stderr(&bank).contains("a bank of hypotheses has no budget"), "{}", stderr(&bank));
    let late = w
        .fusion(&["budget", &format!("{ROOT}/configs/ins-gps.toml"), "--at", "60 s,10 min"])
        .code(2);
    assert!(stderr(&late).contains("no shares at 600 s"), "{}", stderr(&late));
}
