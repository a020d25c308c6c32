//! Findings of the shipped designs: none for sound designs, the known problems for the others.

use super::real::data;
use crate::support::Workspace;
use serde_json::Value;
use std::path::Path;

/// Design, variant, and the findings: the subject, and a part of the advice.
type Case = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

/// Simulated designs with their known problems.
const SIMULATED: &[Case] = &[
    // Fixes have an error of 0.8 m for a minute, the compass has a constant error of 0.5°. The design has no state for
    // either.
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
    // Without a gate the outliers appear in the innovations, and no other cause is reported.
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
    // No truth is available. The first minutes of fixes determine the heading, and nothing confirms it. Fixes were
    // missing for four minutes.
    (
        "real/divesafe",
        "base",
        &[
            ("heading_offset", "it may settle at a wrong angle"),
            ("usbl", "too large errors of its estimate"),
            ("usbl", "drift"),
        ],
    ),
    ("real/husky", "base", &[]),
    ("real/broad", "base", &[]),
    // The heading of the reference has an error of 0.3°, which the course of the reference's velocity shows.
    (
        "real/pntos-car",
        "base",
        &[("heading", "give the heading of the reference a 1σ of")],
    ),
    ("real/rtklib-drive", "base", &[]),
    // The attitude reference belongs to another body, 0.6° off.
    (
        "real/tumvi",
        "base",
        &[("NEES attitude", "its own errors (`sigma`), other axes (`remove_mean_mounting`)")],
    ),
];

/// The settings that the advice names with a value, in the form that `--set` accepts.
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
        for edit in summary["findings"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|f| f["edits"].as_array().cloned().unwrap_or_default())
        {
            let setting = format!("{}={}", edit["key"].as_str().unwrap(), edit["value"].as_str().unwrap());
            w.fusion(&["check", file.as_str(), "--variant", variant, "--set", setting.as_str()])
                .success();
        }
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
fn each_rule_has_its_heading_in_the_book_in_the_same_order() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/book/src/rules.md")).unwrap();
    let headings: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix("### ")).collect();
    let rules: Vec<&str> = fusion_advice::rules::ALL.iter().map(|rule| rule.id).collect();
    assert_eq!(headings, rules);
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

/// A log of the car. Until 90 s the receiver has errors of 0.4 m/s, five times the declared noise, and reports this 1σ.
fn poor_at_first(data: &Path) -> String {
    /// The width of a uniform distribution with this 1σ \[m/s\].
    const WIDTH: f64 = 1.4;
    let text = std::fs::read_to_string(data.join("rtklibexplorer_drive/derived/gnss.csv")).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    let names: Vec<&str> = head.split(',').collect();
    let (first, sigma) = (9, 12);
    assert_eq!((names[first], names[sigma]), ("vn_mps", "svn_mps"));
    // Knuth 1997, §3.3.4: a linear congruential generator.
    let mut state = 3_u64;
    let mut error = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        WIDTH * ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5)
    };
    let row = |row: &str| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        if cells[0].parse::<f64>().unwrap() < 90.0 {
            for axis in 0..3 {
                let velocity: f64 = cells[first + axis].parse().unwrap();
                cells[first + axis] = format!("{:.4}", velocity + error());
                cells[sigma + axis] = format!("{:.4}", WIDTH / 12_f64.sqrt());
            }
        }
        cells.join(",")
    };
    let rows: Vec<String> = rows.lines().map(row).collect();
    format!("{head}\n{}\n", rows.join("\n"))
}

#[test]
fn a_start_that_a_poor_receiver_spoils_is_told_with_the_columns_that_say_so_and_the_edit_cures_it() {
    let Some(data) = data() else { return };
    let w = Workspace::new("findings-moved");
    w.write("gnss.csv", poor_at_first(&data));
    let log = w.path("gnss.csv");
    let run = |sets: &[String]| {
        let file = format!("{}/configs/real/rtklib-drive.toml", env!("CARGO_MANIFEST_DIR"));
        let data = data.display().to_string();
        let mut arguments = vec!["run", file.as_str(), "--data", data.as_str(), "--out", "out"];
        arguments.extend(sets.iter().flat_map(|set| ["--set", set.as_str()]));
        w.fusion(&arguments).success();
        serde_json::from_str::<Value>(&w.read("out/summary.json")).unwrap()
    };
    let mut sets = vec![
        format!("source.gnss.path='{}'", log.display()),
        "sensor.gnss_velocity.gate={ type = 'none' }".to_owned(),
        "sensor.gnss_position.gate={ type = 'none' }".to_owned(),
        "sensor.gnss_velocity.time_offset={ estimate = true, initial = '0.13 s', sigma = '50 ms' }".to_owned(),
        "sensor.gnss_velocity.lever_arm={ estimate = true, initial = [0, '-5 cm', 0], sigma = '1 m' }".to_owned(),
    ];
    let told = |summary: &Value| {
        let all = summary["findings"].as_array().unwrap();
        let of = |finding: &Value, key: &str| finding[key].as_str().unwrap().to_owned();
        all.iter()
            .map(|f| (of(f, "about"), of(f, "evidence"), of(f, "advice")))
            .collect::<Vec<_>>()
    };
    let spoilt = run(&sets);
    let (about, evidence, advice) = &told(&spoilt)[0];
    let moved = "`gnss_velocity.time_offset` moved from 0.13 to ";
    assert!(about == "gnss_velocity" && evidence.contains(moved), "{evidence}");
    assert!(advice.contains("`svn_mps`, `sve_mps`, `svd_mps`: write `source.gnss."), "{advice}");
    let excess = &spoilt["excesses"].as_array().unwrap();
    let own = excess.iter().find(|e| e["sensor"] == "gnss_velocity").unwrap();
    // The errors last until 90 s.
    assert!(own["from"].as_f64().unwrap() < 60.0 && own["nis"].as_f64().unwrap() > 12.0, "{own}");
    let edits = settings(about, advice);
    assert_eq!(edits.len(), 2, "{edits:?}");
    sets.extend(edits);
    let cured = run(&sets);
    assert_eq!(told(&cured), []);
    assert_eq!(cured["excesses"].as_array().unwrap().len(), 0);
}
