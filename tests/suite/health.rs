//! Health: shipped designs are in good health on undisturbed data. A filter that diverges reports it before its error
//! exceeds ten times its 3σ. It does not know the truth.

use crate::support::{Workspace, has, stderr};
use fusion::config::Document;
use fusion::core::health::State;
use fusion::core::runner::{Event, Halt};
use fusion::design::Design;
use fusion::health::FilterHealth;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use std::path::{Path, PathBuf};

/// The design `configs/NAME.toml` with variants and overrides, and its run options. `None` if its recorded data are
/// missing.
fn design(name: &str, variants: &[&str], sets: &[&str]) -> Option<(Design, Options)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = std::env::var_os("FUSION_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    if name.starts_with("real/") && !data.is_dir() {
        eprintln!("skipped: no recorded data at $FUSION_DATA or ../shared/data");
        return None;
    }
    let file = root.join("configs").join(format!("{name}.toml"));
    let mut document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    sets.iter().for_each(|set| document.set(set).unwrap());
    let options = Options {
        data: Some(data),
        base: file.parent().unwrap().to_path_buf(),
        ..Options::default()
    };
    Some((Design::read(document).unwrap_or_else(|e| panic!("{e}")), options))
}

/// The reported health and the true error.
#[derive(Debug, Default)]
struct Watch {
    state: State,
    /// When the position error first exceeded this multiple of its 3σ, and the state then.
    passed: Option<(f64, State)>,
    /// The largest of these ratios.
    worst: f64,
}

/// Ten times its 3σ: the filter must have reported its error before.
const ASTRAY: f64 = 10.0;

impl RunObserver for Watch {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Filter {
                filter,
                event: Event::Health { health },
            } if filter.is_outermost() => self.state = health.state,
            RunEvent::Reference { filter, epoch, error } if filter.is_outermost() => {
                let Some(position) = error.and_then(|e| e.position) else {
                    return Ok(());
                };
                let ratio = position.error.norm() / (3.0 * position.own.trace().sqrt());
                self.worst = self.worst.max(ratio);
                if ratio > ASTRAY && self.passed.is_none() {
                    self.passed = Some((epoch.time.seconds(), self.state));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn watched(name: &str, variants: &[&str], sets: &[&str]) -> Option<(Vec<FilterHealth>, Watch)> {
    let (design, options) = design(name, variants, sets)?;
    let mut watch = Watch::default();
    let run = Run::open(&design, &options).unwrap_or_else(|d| panic!("{d}"));
    let ended = run.go(&mut [&mut watch], &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    Some((ended.keep().unwrap_or_else(|d| panic!("{d}")).health().to_vec(), watch))
}

#[test]
fn shipped_designs_are_in_good_health_where_nothing_disturbs_them() {
    let designs: [(&str, &[&str]); 14] = [
        ("ins-gps", &[]),
        ("ins-gps-outlier", &[]),
        ("ins-gps-outlier", &["clean"]),
        ("ins-gps-outlier", &["correlated-bias"]),
        ("ins-gps-outlier", &["cascaded"]),
        ("ins-gps-outlier", &["square"]),
        ("tracked-navigators", &[]),
        ("tracked-navigators", &["hna"]),
        ("real/pntos-car", &[]),
        ("real/rtklib-drive", &[]),
        ("real/rtklib-drive", &["gated"]),
        ("real/husky", &[]),
        ("real/tumvi", &[]),
        ("real/broad", &["trial_15"]),
    ];
    for (name, variants) in designs {
        let Some((health, _)) = watched(name, variants, &[]) else {
            continue;
        };
        for filter in health {
            assert!(filter.is_good() && filter.spent.good > 0.0, "{name} {variants:?}: {filter:#?}");
        }
    }
}

/// Both GNSS sensors of the car have a gate.
const GATED: [&str; 2] = [
    "sensor.gnss_position.gate={ type = \"nis\", probability = 0.999 }",
    "sensor.gnss_velocity.gate={ type = \"nis\", probability = 0.999 }",
];

/// A fault of the car's inertial unit or its GNSS.
fn fault(source: &str, kind: &str) -> String {
    format!("source.{source}.fault.test={{ {kind} }}")
}

/// The car until 700 s, when it drives through a town.
fn car(sets: &[&str]) -> Option<(FilterHealth, Watch)> {
    let sets: Vec<&str> = ["run.stop=700 s"].iter().chain(sets).copied().collect();
    let (health, watch) = watched("real/pntos-car", &[], &sets)?;
    Some((health.into_iter().next()?, watch))
}

/// It survives, or it reports the fault before its error exceeds ten times its 3σ.
fn speaks(what: &str, sets: &[&str]) {
    let Some((health, watch)) = car(sets) else { return };
    let spoke = watch.passed.is_none_or(|(_, state)| state >= State::Degraded);
    assert!(spoke, "{what}: {:?}, {:#?}", watch.passed, health.transitions);
}

#[test]
fn a_filter_without_its_inertial_unit_speaks_before_it_is_astray() {
    for seconds in [1, 2, 5, 30] {
        let gap = fault(
            "imu",
            &format!("type = \"outage\", window = {{ from = \"600 s\", duration = \"{seconds} s\" }}"),
        );
        speaks(&format!("{seconds} s, gated"), &[GATED[0], GATED[1], &gap]);
        speaks(&format!("{seconds} s"), &[&gap]);
    }
}

#[test]
fn a_filter_hit_by_a_spike_of_its_gyros_speaks_before_it_is_astray() {
    for rate in [9, 35, 100] {
        let window = "window = { from = \"600 s\", duration = \"0.01 s\" }";
        let spike = fault(
            "imu",
            &format!("type = \"spike\", channel = \"angular_rate\", value = [0, \"{rate} rad/s\", 0], {window}"),
        );
        speaks(&format!("{rate} rad/s, gated"), &[GATED[0], GATED[1], &spike]);
        speaks(&format!("{rate} rad/s"), &[&spike]);
    }
}

#[test]
fn a_filter_on_wrong_inertial_data_speaks_before_it_is_astray() {
    let stuck = fault("imu", "type = \"frozen\", window = { from = \"600 s\", duration = \"20 s\" }");
    let value = fault(
        "imu",
        "type = \"spike\", channel = \"specific_force\", value = [\"1e38 m/s^2\", 0, 0], window = { from = \"600 s\", duration = \"0.01 s\" }",
    );
    let scale = |factor: &str| {
        let window = "window = { from = \"600 s\", duration = \"60 s\" }";
        fault(
            "imu",
            &format!("type = \"scale\", channel = \"specific_force\", factor = {factor}, {window}"),
        )
    };
    let all = [
        ("a stuck stream", stuck),
        ("1e38 in a cell", value),
        ("a wrong sign", scale("-1")),
        ("a wrong scale", scale("1.1")),
    ];
    for (what, fault) in &all {
        speaks(&format!("{what}, gated"), &[GATED[0], GATED[1], fault]);
        speaks(what, &[fault]);
    }
}

#[test]
fn wrong_fixes_for_45_seconds_are_told() {
    let spike = fault(
        "gnss",
        "type = \"spike\", channel = \"position\", value = [0, \"60 m\", 0], window = { from = \"600 s\", duration = \"45 s\" }",
    );
    for sets in [&[GATED[0], GATED[1], &spike][..], &[&spike]] {
        let Some((health, watch)) = car(sets) else { return };
        let told = health.transitions.iter().find(|t| t.time > 600.0);
        // Three fixes at 1 Hz.
        assert!(
            told.is_some_and(|t| t.state >= State::Degraded && t.time < 603.0),
            "{:#?}",
            health.transitions
        );
        assert!(watch.passed.is_none_or(|(_, state)| state >= State::Degraded), "{:?}", watch.passed);
    }
}

#[test]
fn an_estimate_that_runs_away_from_sound_fixes_is_told() {
    let (health, watch) = watched("ins-gps-outlier", &["stress", "ins-fault"], &[]).unwrap();
    assert!(
        watch.passed.is_some_and(|(_, state)| state >= State::Degraded),
        "{:?} {:#?}",
        watch.passed,
        health[0].transitions
    );
}

#[test]
fn a_slow_sensor_that_is_rejected_for_long_is_told() {
    let slow = "source.gnss.keep={ every = 10 }";
    let spike = fault(
        "gnss",
        "type = \"spike\", channel = \"position\", value = [0, \"60 m\", 0], window = { from = \"600 s\" }",
    );
    let Some((health, _)) = car(&[GATED[0], GATED[1], slow, &spike]) else {
        return;
    };
    // Three fixes at intervals of ten seconds, and ten seconds to the first of them.
    let told = health.transitions.iter().find(|t| t.time > 600.0);
    assert!(
        told.is_some_and(|t| t.state >= State::Degraded && t.time < 631.0),
        "{:#?}",
        health.transitions
    );
    let Some((health, _)) = car(&[GATED[0], GATED[1], slow]) else {
        return;
    };
    assert!(health.is_good(), "{:#?}", health.transitions);
}

/// A barometer with an estimated bias and without a gate, and GNSS with gates.
const BAROMETER: [&str; 4] = [
    "sensor.velocity.gate={ type = \"nis\", probability = 0.999 }",
    "sensor.baro={ type = \"barometer\", source = \"baro\", bias = { estimate = true, initial = 0, sigma = \"10 m\" }, noise = { sigma = \"20 Pa\" } }",
    "simulation.sensor.baro={ rate = \"10 Hz\", white = \"20 Pa\" }",
    "run.stop=55 s",
];

#[test]
fn a_bias_that_takes_the_blame_for_a_glitch_of_gnss_is_told() {
    let glitch = |sensor: &str, value: &str| {
        let window = "window = { from = \"40 s\", duration = \"2.6 s\" }";
        format!("simulation.sensor.{sensor}.fault.glitch={{ type = \"spike\", value = [0, 0, \"{value}\"], {window} }}")
    };
    let glitches = [glitch("position", "-500 m"), glitch("velocity", "-50 m/s")];
    let sets: Vec<&str> = BAROMETER.into_iter().chain(glitches.iter().map(String::as_str)).collect();
    let (health, watch) = watched("ins-gps", &[], &sets).unwrap();
    let spoke = watch.passed.is_none_or(|(_, state)| state >= State::Degraded);
    assert!(spoke && !health[0].is_good(), "{:?} {:#?}", watch.passed, health[0].transitions);
    let (health, _) = watched("ins-gps", &[], &BAROMETER).unwrap();
    assert!(health[0].is_good(), "{:#?}", health[0].transitions);
}

#[test]
fn gnss_lost_for_good_is_told() {
    let lost = fault("gnss", "type = \"outage\", window = { from = \"600 s\" }");
    let Some((health, _)) = car(&[&lost]) else { return };
    assert_eq!(health.state, State::Degraded);
    let reasons: Vec<String> = health.transitions.last().unwrap().reasons.iter().map(ToString::to_string).collect();
    assert!(reasons.iter().any(|r| r == "`gnss_position` silent"), "{reasons:?}");
}

#[test]
fn a_walk_that_zero_velocities_no_longer_hold_is_told_half_a_minute_later() {
    let shaken =
        "simulation.imu.fault.shaken={ type = \"noise\", channel = \"angular_rate\", sigma = \"3 deg/s\", window = { from = \"40 s\" } }";
    let sees = |variants: &[&str], sets: &[&str]| {
        let (health, watch) = watched("templates/person", variants, sets).unwrap();
        let ill = health[0].transitions.iter().find(|t| t.state >= State::Degraded).cloned();
        (ill, watch.worst)
    };
    let (ill, worst) = sees(&[], &[]);
    assert!(ill.is_none() && worst < 1.5, "held: {ill:?} {worst}");
    // The last fix is used at 40 s at the latest. Without fixes, no fix is used since the start.
    for (variants, sets, from) in [(&[][..], &[shaken][..], 69.0..71.0), (&["free"], &[], 29.0..31.0)] {
        let (ill, _) = sees(variants, sets);
        let ill = ill.unwrap();
        let reasons: Vec<String> = ill.reasons.iter().map(ToString::to_string).collect();
        assert!(from.contains(&ill.time), "{ill:?}");
        assert_eq!(reasons, ["nothing measures position or velocity"]);
    }
}

#[test]
fn what_a_declared_outage_leaves_behind_is_of_that_outage() {
    let w = Workspace::new("health-declared");
    w.fusion(&["new", "mine", "--from", "drone"]).success();
    let minute = ["position", "velocity"].map(|what| format!("simulation.sensor.gnss_{what}.fault.jammed.window.duration=60 s"));
    let sets = minute.iter().flat_map(|set| ["--set", set.as_str()]);
    let arguments: Vec<&str> = ["run", "mine.toml", "--variant", "jammed"].into_iter().chain(sets).collect();
    let said = crate::support::stdout(&w.fusion(&arguments).success());
    // Silence is reported for 5 s after its end.
    assert!(said.contains("all within declared outages or just after them"), "{said}");
}

#[test]
fn declared_faults_are_in_the_report_and_the_summary() {
    let w = Workspace::new("health-faults");
    let fault = "simulation.sensor.compass.fault.stuck={ type = \"frozen\", window = [{ from = \"100 s\", to = \"130 s\" }, { from = \"200 s\", duration = \"1 h\" }] }";
    w.fusion(&["run", "--set", fault, "--out", "out"]).success();
    let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let own = summary["faults"].as_array().unwrap().iter().filter(|f| f["fault"] == "stuck");
    let own: Vec<(f64, f64)> = own.map(|f| (f["from"].as_f64().unwrap(), f["to"].as_f64().unwrap())).collect();
    assert_eq!((own.len(), own[0], own[1].0), (2, (100.0, 130.0), 200.0));
    assert!(own[1].1 < 1000.0, "it ends with the run: {own:?}");
    assert!(w.read("out/report.html").contains("[100.0,130.0,\"stuck of compass\"]"));
}

#[test]
fn health_is_printed_written_and_an_exit_code_where_that_is_asked_for() {
    let w = Workspace::new("health-strict");
    let good = w.fusion(&["run", "--strict", "--out", "good"]).success().stderr("");
    good.stdout(has("health good"));
    let summary: serde_json::Value = serde_json::from_str(&w.read("good/summary.json")).unwrap();
    let own = &summary["health"][0];
    assert_eq!((&own["state"], &own["worst"]), (&"good".into(), &"good".into()));
    // A filter with fixes cannot meet this limit: the position soon has a smaller σ.
    let ill = ["run", "--set", "health.floor.position=1 m", "--out", "ill"];
    w.fusion(&ill).success();
    let strict: Vec<&str> = ill.iter().chain(&["--strict"]).copied().collect();
    let ran = w.fusion(&strict).code(3);
    assert!(stderr(&ran).contains("`position` σ below its floor"), "{}", stderr(&ran));
    let summary: serde_json::Value = serde_json::from_str(&w.read("ill/summary.json")).unwrap();
    let transitions = summary["health"][0]["transitions"].as_array().unwrap();
    let reasons = || transitions.iter().flat_map(|t| t["reasons"].as_array().unwrap());
    assert!(
        reasons().any(|r| r["reason"] == "floor" && r["of"] == "position"),
        "{transitions:?}"
    );
    assert!(w.read("ill/report.html").contains("σ below its floor"));
}
