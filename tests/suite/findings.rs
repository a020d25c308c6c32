//! What runs of the shipped designs are told to look at next: sound designs nothing, the others what is known of them.

use super::real::data;
use crate::support::Workspace;
use serde_json::Value;
use std::path::Path;

/// Design, variant, and what is found: what it is about, and a part of the advice.
type Case = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

/// Simulated designs, and what is known of them.
const SIMULATED: &[Case] = &[
    // Fixes err by 0.8 m for a minute, the compass by 0.5° for ever; the design has no state for either.
    (
        "ins-gps-outlier",
        "base",
        &[
            ("NEES position", "slow error of `gps_position`; declare its `bias`"),
            ("NEES attitude", "slow error of `compass`; declare its `bias`"),
        ],
    ),
    // With states for both errors.
    ("ins-gps-outlier", "correlated-bias", &[]),
    // Without a gate the outliers are seen in the innovations, and nothing else is blamed.
    (
        "ins-gps-outlier",
        "correlated-bias+no-gate",
        &[("gps_position", "outliers, which a `gate` would refuse")],
    ),
    ("ins-gps", "base", &[]),
    ("tracked-navigators", "base", &[]),
    ("uri-r-straight", "base", &[]),
    ("utv-square", "base", &[]),
    ("templates/auv", "base", &[]),
    ("templates/boat", "base", &[]),
    ("templates/car", "base", &[]),
    ("templates/drone", "base", &[]),
    ("templates/person", "base", &[]),
    ("templates/rover", "base", &[]),
];

/// Recorded logs.
const RECORDED: &[Case] = &[
    // No truth; the heading is found by the first minutes of fixes, which nothing shows. Fixes were missing for four minutes.
    (
        "real/divesafe",
        "base",
        &[
            ("heading_offset", "it may settle at a wrong angle"),
            ("usbl", "larger than need be"),
            ("usbl", "drift"),
        ],
    ),
    ("real/husky", "base", &[]),
    ("real/broad", "base", &[]),
    // The heading of its reference errs by 0.3°, which the course of the reference's own velocity shows.
    (
        "real/pntos-car",
        "base",
        &[("heading", "give the heading of the reference a 1σ of")],
    ),
    ("real/rtklib-drive", "base", &[]),
    // Its attitude reference is that of another body, 0.6° off.
    (
        "real/tumvi",
        "base",
        &[("NEES attitude", "errors of its own (`sigma`), other axes (`remove_mean_mounting`)")],
    ),
];

/// The settings with a value that advice names, as `--set` takes them.
fn settings(about: &str, advice: &str) -> Vec<String> {
    let quoted = advice
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|text| text.contains(" = ") && text.contains('.'));
    let whole = |text: &str| {
        let is_of_sensor = text.starts_with("gate.");
        let path = if is_of_sensor {
            format!("sensor.{about}.{text}")
        } else {
            text.to_owned()
        };
        path.replacen(" = ", "=", 1)
    };
    quoted.map(whole).collect()
}

fn check(cases: &[Case], data: Option<&Path>) {
    let w = Workspace::new(if data.is_some() {
        "findings-recorded"
    } else {
        "findings-simulated"
    });
    for (design, variant, expected) in cases {
        let file = format!("{}/configs/{design}.toml", env!("CARGO_MANIFEST_DIR"));
        let mut arguments = vec!["run", file.as_str(), "--variant", variant, "--out", "out"];
        let data = data.map(|data| data.display().to_string());
        arguments.extend(data.iter().flat_map(|data| ["--data", data.as_str()]));
        w.fusion(&arguments).success();
        let summary: Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
        let text = |finding: &Value, key: &str| finding[key].as_str().unwrap().to_owned();
        let found = summary["findings"].as_array().unwrap();
        let found: Vec<(String, String)> = found.iter().map(|f| (text(f, "about"), text(f, "advice"))).collect();
        for setting in found.iter().flat_map(|(about, advice)| settings(about, advice)) {
            let arguments = ["check", file.as_str(), "--variant", variant, "--set", setting.as_str()];
            w.fusion(&arguments).success();
        }
        let fits = |(found, expected): (&(String, String), &(&str, &str))| found.0 == expected.0 && found.1.contains(expected.1);
        assert!(
            found.len() == expected.len() && found.iter().zip(*expected).all(fits),
            "{design} {variant}: {found:#?}"
        );
    }
}

#[test]
fn of_simulated_designs() {
    check(SIMULATED, None);
}

#[test]
fn of_recorded_logs() {
    if let Some(data) = data() {
        check(RECORDED, Some(&data));
    }
}
