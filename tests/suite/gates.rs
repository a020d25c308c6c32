//! Faults that are known against what the statistics of gates say of them.

use crate::support::{DESIGN, Workspace, narrow, shows, stdout};
use serde_json::Value;

/// Position, known 0.25 s late, and velocity from the rows of one receiver.
fn two_sensors() -> String {
    let velocity = "[sensor.speed]\ntype = \"gnss_velocity\"\nsource = \"gnss\"\nnoise = { sigma = \"1 m/s\" }\n\
                    gate = { type = \"nis\", probability = 0.999 }\n\n[initial.fix]";
    let late = "height = \"h\"\nlatency = \"0.25 s\"";
    DESIGN.replace("[initial.fix]", velocity).replace("height = \"h\"", late)
}

/// The summary of `fusion run` with this fault on the receiver.
fn summary(w: &Workspace, fault: &str, more: &[&str]) -> Value {
    w.write("faulty.toml", format!("{}\n[source.gnss.fault.wild]\n{fault}\n", two_sensors()));
    w.fusion(&[&["run", "faulty.toml", "--out", "out"], more].concat())
        .success()
        .stdout(narrow());
    serde_json::from_str(&w.read("out/summary.json")).unwrap()
}

fn count(sensor: &Value, path: &str) -> u64 {
    sensor
        .pointer(path)
        .and_then(Value::as_u64)
        .unwrap_or_else(|| panic!("{path} of {sensor}"))
}

/// Three fixes of 60 are 50 m off: those and no others are rejected, for 3 s.
const SPIKE: &str = "type = \"spike\"\nchannel = \"position\"\nwindow = { from = 20, to = 22.5 }\nvalue = [0, \"50 m\", 0]";

#[test]
fn a_spike_is_caught_by_the_sensor_that_reads_it_and_is_nothing_to_the_other() {
    let w = Workspace::new("gates-spike");
    let summary = summary(&w, SPIKE, &[]);
    let [position, speed] = [0, 1].map(|k| &summary["sensors"][k]);
    assert_eq!(
        position["disturbed"],
        serde_json::json!({ "missed": 0, "caught": 3, "false_rejections": 0 })
    );
    let refusal = serde_json::json!({ "from": 19.75, "measurements": 3, "seconds": 3.0 });
    assert_eq!(
        (&position["longest_rejection_streak"], &position["ends_denied"]),
        (&refusal, &Value::Bool(false))
    );
    assert_eq!(
        (&speed["disturbed"], &speed["longest_rejection_streak"]),
        (&Value::Null, &Value::Null)
    );
}

#[test]
fn without_a_gate_every_disturbed_row_is_missed() {
    let w = Workspace::new("gates-open");
    let summary = summary(&w, SPIKE, &["--set", "sensor.gnss.gate={ type = \"none\" }"]);
    assert_eq!(count(&summary["sensors"][0], "/disturbed/missed"), 3);
}

#[test]
fn missed_and_caught_are_the_rows_that_the_source_says_were_disturbed() {
    let w = Workspace::new("gates-outliers");
    // From small ones that pass to large ones that do not.
    let outliers = "type = \"outliers\"\nchannel = \"position\"\nrate = 0.3\nsize = [0, \"20 m\"]\nwindow = { from = 2 }";
    let summary = summary(&w, outliers, &[]);
    let printed = stdout(&w.fusion(&["run", "faulty.toml", "--verbose"]));
    let (_, rest) = printed.split_once("disturbed ").unwrap();
    let disturbed: u64 = rest.split(':').next().unwrap().parse().unwrap();
    let position = &summary["sensors"][0];
    let [missed, caught, wrong] = ["missed", "caught", "false_rejections"].map(|c| count(position, &format!("/disturbed/{c}")));
    assert!(missed > 0 && caught > 0, "both kinds are wanted: {position}");
    assert_eq!(missed + caught, disturbed);
    assert_eq!(caught + wrong, count(position, "/rejected"));
    for title in ["missed", "false"] {
        assert!(printed.contains(title), "{printed}");
    }
}

#[test]
fn a_gate_that_never_comes_back_ends_denied_with_the_run() {
    let w = Workspace::new("gates-denied");
    let summary = summary(&w, &SPIKE.replace("from = 20, to = 22.5", "from = 50"), &[]);
    let position = &summary["sensors"][0];
    // Ten fixes; the last velocity carries the estimate to 59 s.
    let refusal = serde_json::json!({ "from": 49.75, "measurements": 10, "seconds": 9.25 });
    assert_eq!(
        (&position["longest_rejection_streak"], &position["ends_denied"]),
        (&refusal, &Value::Bool(true))
    );
}

#[test]
fn innovations_are_those_of_updates_csv_from_the_reference_on() {
    let w = Workspace::new("gates-innovations");
    let truth = two_sensors()
        .split("[source.gnss]")
        .nth(1)
        .unwrap()
        .split("[variant")
        .next()
        .unwrap()
        .to_owned();
    let truth = truth.replace("source.gnss.", "source.truth.");
    let design = format!("{SPIKE}\n\n[source.truth]{truth}\n[reference]\nsource = \"truth\"\nfrom = \"30 s\"");
    let summary = summary(&w, &design, &[]);
    for sensor in summary["sensors"].as_array().unwrap() {
        let updates = w.read("out/updates.csv");
        let cells = updates.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
        let counted = cells.filter(|c| c[0].parse::<f64>().unwrap() >= 30.0 && c[2] == "accepted" && sensor["name"] == c[1]);
        let residuals: Vec<[f64; 3]> = counted.map(|c| [8, 9, 10].map(|k| c[k].parse().unwrap())).collect();
        let innovations = &sensor["innovations"];
        assert!(residuals.len() > 25 && innovations["count"] == residuals.len(), "{innovations}");
        assert_eq!(innovations["axis"], serde_json::json!(["north", "east", "down"]));
        for k in 0..3 {
            let rms = (residuals.iter().map(|r| r[k] * r[k]).sum::<f64>() / residuals.len() as f64).sqrt();
            let max = residuals.iter().map(|r| r[k].abs()).fold(0.0, f64::max);
            for (name, wanted) in [("rms", rms), ("max", max)] {
                let found = innovations[name][k].as_f64().unwrap();
                // updates.csv has seven digits.
                assert!((found - wanted).abs() <= 1e-6 * wanted, "{name} {k}: {found} for {wanted}");
            }
        }
    }
}

/// One sensor of a simulated world errs by hundreds of metres now and then; without its gate the
/// same draws are all missed.
#[test]
fn outliers_of_a_simulated_sensor_are_the_same_rows_under_every_gate() {
    let w = Workspace::new("gates-simulated");
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps-outlier.toml");
    let run = |variant: &[&str]| -> Value {
        let size = "simulation.sensor.gps_position.fault.outliers.size=[\"300 m\", \"500 m\"]";
        w.fusion(&[&["run", config, "--out", "out", "--set", size], variant].concat())
            .success();
        serde_json::from_str(&w.read("out/summary.json")).unwrap()
    };
    let (gated, open) = (run(&[]), run(&["--variant", "no-gate"]));
    let [gated, open] = [&gated, &open].map(|s| &s["sensors"][0]);
    let caught = count(gated, "/disturbed/caught");
    // 255 fixes after the start, one in ten: 25.5 ± 4.8 (1σ of the binomial), 4σ.
    assert!((7..45).contains(&caught), "{caught}");
    assert_eq!((count(gated, "/disturbed/missed"), count(open, "/disturbed/missed")), (0, caught));
}

#[test]
fn a_campaign_and_a_comparison_show_the_same_counts() {
    let w = Workspace::new("gates-campaign");
    summary(&w, SPIKE, &[]);
    let titles = ["missed", "false", "longest streak", "end denied", "largest max"];
    shows(
        w.fusion(&["montecarlo", "faulty.toml", "-n", "2", "--out", "out"]).success(),
        &titles,
    );
    let runs = w.read("out/runs.csv");
    let mut rows = runs.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let rows: Vec<_> = rows.collect();
    assert_eq!(rows.len(), 2);
    let expected = [
        ("gnss_rejected", "3"),
        ("gnss_missed", "0"),
        ("gnss_false", "0"),
        ("gnss_longest_rejection_streak", "3"),
        ("gnss_longest_rejection_streak_s", "3.000000000e0"),
        ("gnss_ends_denied", "0"),
        ("speed_missed", ""),
        ("speed_longest_rejection_streak", "0"),
    ];
    for row in &rows {
        assert_eq!(row.len(), header.len());
        let cell = |name: &str| row[header.iter().position(|h| *h == name).unwrap_or_else(|| panic!("{name}"))];
        for (name, value) in expected {
            assert_eq!(cell(name), value, "{name}");
        }
        for k in 1..=3 {
            let [rms, max] = ["rms", "max"].map(|what| cell(&format!("gnss_innovation_{what}_{k}")).parse::<f64>().unwrap());
            assert!(rms <= max, "{rms} {max}");
        }
    }
    let compared = stdout(&w.fusion(&["compare", "faulty.toml", "--variant", "base,ekf"]));
    let line = compared.lines().skip_while(|l| !l.contains("missed")).nth(1).unwrap();
    let counts: Vec<&str> = line.split_whitespace().take(6).collect();
    assert_eq!(counts, ["gnss", "base", "56", "3", "0", "0"], "{compared}");
}
