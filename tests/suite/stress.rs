//! `fusion stress` on a short simulated design and on recorded fixes, and its error messages.

use crate::support::{Workspace, narrow, page, shows, squeezed, stderr, stdout};
use predicates::str::contains;
use serde_json::Value;

/// A boat on a straight line: a receiver of position and velocity, no input, a hundred seconds.
const BOAT: &str = r#"
[run]
description = "Boat with GNSS, simulated"
origin = { latitude = "47 deg", longitude = "8 deg" }
seed = 4

[process]
type = "constant_velocity"
acceleration_noise = "0.1 m/s^2/sqrt(Hz)"
position_sigma = "10 m"
velocity_sigma = "5 m/s"

[sensor.fix]
type = "gnss_position"
source = "gps"
noise = { sigma = "2 m" }
gate = { type = "nis", probability = 0.999 }

[sensor.speed]
type = "gnss_velocity"
source = "gps"
noise = { sigma = "0.2 m/s" }

[initial.fix]
type = "first_fix"
source = "gps"
position_sigma = "5 m"
velocity_sigma = "1 m/s"

[simulation]
trajectory = [{ type = "straight", distance = "1000 m", speed = "10 m/s" }]
sensor.fix = { rate = "2 Hz", white = "2 m" }
sensor.speed = { rate = "2 Hz", white = "0.2 m/s" }

[stress]
settle = "20 s"
watch = "30 s"
pairs = 2

# Health that says nothing.
[variant.mute.health]
innovations = { degraded = 1e9, lost = 1e9, false_alarm = "1e30 h" }
rejected = { degraded = "1 h", lost = "1 h" }
reacquired = 0
silent.at_least = "1 h"
calibration = 1e9
"#;

fn boat(test: &str) -> Workspace {
    let w = Workspace::new(test);
    w.write("boat.toml", BOAT);
    w
}

/// The rows of stress.csv, each with its cells by name.
fn rows(w: &Workspace, file: &str) -> Vec<std::collections::HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(w.path(file)).unwrap();
    let found: Result<Vec<_>, csv::Error> = reader.deserialize().collect();
    found.unwrap()
}

#[test]
fn every_fault_that_fits_is_applied_to_every_stream_the_same_on_any_number_of_threads() {
    let w = boat("stress-all");
    for (out, threads) in [("one", "1"), ("two", "2")] {
        let ran = w.fusion(&["stress", "boat.toml", "--threads", threads, "--out", out]);
        let parts = ["One fault at a time", "Two faults", "Sizes", "worst", "recovered", "health"];
        shows(ran.stdout(narrow()), &parts);
    }
    assert_eq!(w.read("one/stress.csv"), w.read("two/stress.csv"));
    let all = rows(&w, "one/stress.csv");
    let on = |fault: &str| -> Vec<&str> { all.iter().filter(|r| r["fault"] == fault).map(|r| r["on"].as_str()).collect() };
    for fault in [
        "gap-1",
        "lost",
        "spike",
        "stuck",
        "nan",
        "step",
        "ramp",
        "duplicate",
        "disorder",
        "glitch",
        "clock-jump",
    ] {
        assert_eq!(on(fault), ["fix", "speed"], "{fault}");
    }
    // A position has neither scale nor sign.
    assert_eq!((on("scale"), on("sign")), (vec!["speed"], vec!["speed"]));
    let pairs = all.iter().filter(|r| r["fault"].contains(" + ")).count();
    assert_eq!((on("none").len(), pairs), (1, 2));
    let row = |fault: &str, on: &str| all.iter().find(|r| r["fault"] == fault && r["on"] == on).unwrap();
    // 30 and 10 times the declared σ of all three axes, or up to twice that if the innovations are larger; with a
    // direction of unit length.
    let size = |fault: &str, on: &str| row(fault, on)["size"].split(' ').next().unwrap().parse::<f64>().unwrap();
    assert!((60.0..120.0).contains(&size("spike", "fix")), "{:?}", row("spike", "fix"));
    assert!((2.0..4.0).contains(&size("step", "speed")), "{:?}", row("step", "speed"));
    // A duplicate and a short gap have no effect on a filter that predicts. A permanently lost sensor is reported.
    assert_eq!(
        (
            row("duplicate", "fix")["survived"].as_str(),
            row("gap-1", "fix")["recovered_s"].as_str()
        ),
        ("true", "0")
    );
    assert_ne!(row("lost", "fix")["health"], "", "{:?}", row("lost", "fix"));
}

#[test]
fn a_filter_that_is_wrong_and_says_so_passes_and_one_that_is_silent_fails() {
    let w = boat("stress-silent");
    let stress = |variant: &str, more: &[&str]| {
        let args = ["stress", "boat.toml", "--only", "sign", "--pairs", "0", "--variant", variant];
        w.fusion(&[&args, more].concat())
    };
    let row = |ran: &assert_cmd::assert::Assert| squeezed(&stdout(ran)).into_iter().find(|l| l.starts_with("sign speed")).unwrap();
    // Ten seconds of reversed velocity: the fixes contradict it.
    let silent = stress("mute", &[]).code(3);
    assert!(
        row(&silent).contains(" FAILED ") && row(&silent).ends_with(" s"),
        "{}",
        row(&silent)
    );
    // The message appears once.
    assert_eq!(stderr(&silent).matches("1 of 1 cases failed").count(), 1, "{}", stderr(&silent));
    let honest = stress("base", &[]).success();
    assert!(
        row(&honest).contains(" lost ") && !row(&honest).contains("FAILED"),
        "{}",
        row(&honest)
    );
    assert_eq!(stderr(&honest), "");
    // A declared case is reported and does not fail. A declared case that no longer fails is reported too.
    let known = ["--set", "stress.fault.sign.known=['speed']"];
    let declared = stress("mute", &known).success();
    assert!(row(&declared).ends_with(" known"), "{}", row(&declared));
    assert!(row(&stress("base", &known).success()).ends_with(" passes now"));
}

#[test]
fn a_case_is_repeated_by_what_its_row_says() {
    let w = boat("stress-repeat");
    w.fusion(&["stress", "boat.toml", "--only", "gap-30", "--pairs", "0", "--out", "out"]);
    let set = &rows(&w, "out/stress.csv")[1]["set"];
    let ran = w.fusion(&["run", "boat.toml", "--verbose", "--set", set]).success();
    // Half a minute at 2 Hz.
    assert!(
        stdout(&ran).contains("fix: left out 60: withheld by fault stress-1"),
        "{set}\n{}",
        stdout(&ran)
    );
}

#[test]
fn the_seed_draws_directions_and_pairs() {
    let w = boat("stress-seed");
    let sets = |seed: &str| -> Vec<String> {
        w.fusion(&["stress", "boat.toml", "--only", "spike,gap-1", "--seed", seed, "--out", seed]);
        rows(&w, &format!("{seed}/stress.csv")).iter().map(|r| r["set"].clone()).collect()
    };
    let (one, again, two) = (sets("1"), sets("1"), sets("2"));
    assert_eq!(one, again);
    assert_ne!(one, two);
}

#[test]
fn a_design_changes_the_catalogue_and_a_file_replaces_it() {
    let w = boat("stress-catalogue");
    let own = "\n[stress.fault.gap-1]\nenabled = false\n[stress.fault.dropped]\ntype = 'drop'\nrate = 0.5\nduration = '10 s'\n";
    w.write(
        "own.toml",
        format!("{}{own}", BOAT.replace("pairs = 2", "pairs = 0\nat = '44.8 s'")),
    );
    w.fusion(&["stress", "own.toml", "--out", "own"]);
    let all = rows(&w, "own/stress.csv");
    let names: Vec<&str> = all.iter().map(|r| r["fault"].as_str()).collect();
    assert!(
        !names.contains(&"gap-1") && names.contains(&"gap-5") && names.contains(&"dropped"),
        "{names:?}"
    );
    let dropped = all.iter().find(|r| r["fault"] == "dropped").unwrap();
    assert_eq!((dropped["from_s"].as_str(), dropped["to_s"].as_str()), ("44.800000", "54.800000"));
    // One row, between its neighbours: at 45.0 s.
    let spike = all.iter().find(|r| r["fault"] == "spike").unwrap();
    assert_eq!((spike["from_s"].as_str(), spike["to_s"].as_str()), ("44.750000", "45.250000"));
    w.write("short.toml", "[fault.cut]\ntype = 'outage'\nduration = '3 s'\n");
    let ran = w.fusion(&[
        "stress",
        "boat.toml",
        "--catalogue",
        "short.toml",
        "--format",
        "json",
        "--pairs",
        "0",
    ]);
    let page = page(&ran.success());
    let cells = |row: &Value| row["cells"][0].as_str().map(str::to_owned);
    let table = page["sections"][0]["tables"][0]["rows"].as_array().unwrap();
    let faults: Vec<String> = table.iter().filter_map(cells).collect();
    assert_eq!(faults, ["none", "cut", "cut"]);
}

#[test]
fn without_a_reference_the_undisturbed_run_is_one() {
    let w = Workspace::new("stress-recorded");
    let args = [
        "stress",
        "design.toml",
        "--only",
        "gap-5,spike,nan",
        "--pairs",
        "0",
        "--set",
        "stress.settle=10 s",
    ];
    let ran = w.fusion(&args);
    let text = squeezed(&stdout(&ran.stdout(contains("against the undisturbed run"))));
    let row = |fault: &str| {
        text.iter()
            .find(|l| l.starts_with(fault))
            .unwrap_or_else(|| panic!("{text:?}"))
            .clone()
    };
    // The undisturbed run differs from itself by zero. A rejected spike costs one fix.
    assert!(row("none").starts_with("none 0.0 0.0"), "{}", row("none"));
    assert!(
        row("spike gnss.position").starts_with("spike gnss.position yes"),
        "{}",
        row("spike")
    );
}

#[test]
fn a_stream_that_has_ended_is_not_disturbed() {
    let w = boat("stress-ended");
    let ends = "simulation.sensor.speed.fault.end={ type = 'outage', window = { from = '40 s' } }";
    let ran = w.fusion(&[
        "stress",
        "boat.toml",
        "--set",
        ends,
        "--set",
        "stress.at=44 s",
        "--pairs",
        "10",
        "--out",
        "out",
    ]);
    let code = ran.get_output().status.code();
    assert!(matches!(code, Some(0 | 3)), "{code:?}: {}", stderr(&ran));
    let all = rows(&w, "out/stress.csv");
    assert!(all.iter().all(|r| !r["on"].contains("speed")) && all.iter().any(|r| r["on"] == "fix"));
}

/// Drawn cases of the boat, as rows of draw.csv. `DRAW` fits its hundred seconds.
const DRAW: &str = "stress.draw={ longest = '10 s', left = '30 s', recovered = 0, false_good = 1 }";

fn drawn(w: &Workspace, more: &[&str], out: &str) -> Vec<std::collections::HashMap<String, String>> {
    w.fusion(&[&["stress", "boat.toml", "--set", DRAW, "--out", out], more].concat())
        .success();
    rows(w, &format!("{out}/draw.csv"))
}

#[test]
fn a_drawn_case_is_a_function_of_the_seed_and_of_its_number() {
    let w = boat("stress-draw");
    let nine = drawn(&w, &["--draw", "9", "--threads", "2"], "nine");
    let four = drawn(&w, &["--draw", "4", "--threads", "1"], "four");
    let alone = drawn(&w, &["--draw", "9", "--case", "3"], "alone");
    assert_eq!((&nine[..4], &nine[2..3]), (&four[..], &alone[..]));
    let other = drawn(&w, &["--draw", "4", "--seed", "2"], "other");
    let sets = |rows: &[std::collections::HashMap<String, String>]| -> Vec<String> { rows.iter().map(|r| r["set"].clone()).collect() };
    assert!(sets(&other).iter().zip(sets(&four)).all(|(a, b)| *a != b));
    // All cases are different.
    let distinct: std::collections::BTreeSet<String> = sets(&nine).into_iter().collect();
    assert_eq!(distinct.len(), 9);
    for row in &nine {
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        let faults = row["set"].lines().count();
        assert!((1..=3).contains(&faults) && row["fault"].split(" + ").count() == faults, "{row:?}");
        // It starts at the first fix and settles for 20 s. Of 147 s, 30 s remain.
        assert!(
            number("from_s") >= 20.0 && number("to_s") <= 117.0 && number("to_s") - number("from_s") <= 20.0,
            "{row:?}"
        );
    }
    // `run` repeats the case too.
    let sets: Vec<&str> = nine[0]["set"].lines().flat_map(|set| ["--set", set]).collect();
    w.fusion(&[&["run", "boat.toml"], sets.as_slice()].concat()).success();
}

#[test]
fn drawn_cases_are_counted_and_too_few_that_recover_are_a_failure() {
    let w = boat("stress-counts");
    let draw = |more: &[&str]| w.fusion(&[&["stress", "boat.toml", "--set", DRAW, "--draw", "12", "--only", "step,ramp"], more].concat());
    // A step of velocity that the health does not report.
    let mute = draw(&["--variant", "mute", "--set", "stress.draw.false_good=0", "--out", "out"]).code(3);
    let told = stderr(&mute);
    assert!(told.contains("were false goods, at most 0.0 % are allowed"), "{told}");
    let all = rows(&w, "out/draw.csv");
    let count = |key: &str| all.iter().filter(|r| r[key] == "true").count();
    assert!(count("false_good") > 0);
    let text = squeezed(&stdout(&mute));
    let row = |name: &str| text.iter().find(|l| l.starts_with(name)).unwrap_or_else(|| panic!("{text:?}"));
    let counted = row("all 12");
    let cells: Vec<&str> = counted.split(' ').collect();
    let expected = ["recovered", "false_good", "false_alarm", "late_good"].map(|key| count(key).to_string());
    assert_eq!(
        [cells[2], cells[4], cells[6], cells[8]],
        expected.each_ref().map(String::as_str),
        "{counted}"
    );
    // Each kind in its own row, and the command of one case.
    assert!(row("step").len() > 4 && row("ramp").len() > 4);
    assert!(text.concat().contains("--only step,ramp --draw 12 --seed 1 --case "), "{text:?}");
    let honest = draw(&["--set", "stress.draw.recovered=100 %"]);
    let fewer = honest.code(3);
    assert!(stderr(&fewer).contains("at least 100.0 % are asked for"), "{}", stderr(&fewer));
}

#[test]
fn mistakes_of_the_catalogue_are_told_by_every_command() {
    let w = boat("stress-mistakes");
    let said = |table: &str, command: &str| {
        w.write("wrong.toml", format!("{BOAT}\n[stress.fault.own]\n{table}\n"));
        stderr(&w.fusion(&[command, "wrong.toml"]).code(2))
    };
    for command in ["check", "stress"] {
        let both = said("type = 'outage'\nrows = 1\nduration = 3", command);
        assert!(
            both.contains("wrong.toml:") && both.contains("`rows` or for a `duration`"),
            "{both}"
        );
    }
    assert!(said("type = 'outrage'", "stress").contains("did you mean `outage`?"));
    assert!(said("type = 'scale'\neach = 'channel'", "stress").contains("missing field `factor`"));
    assert!(said("type = 'outage'\nsise.value = 3", "stress").contains("unknown field `sise`"));
    let unknown = stderr(&w.fusion(&["stress", "boat.toml", "--only", "spik"]).code(2));
    assert!(unknown.contains("did you mean `spike`?"), "{unknown}");
    let kind = stderr(&w.fusion(&["stress", "boat.toml", "--draw", "2", "--only", "rampe"]).code(2));
    assert!(kind.contains("did you mean `ramp`?"), "{kind}");
    for (set, message) in [
        ("stress.draw.of=['altitude']", "an error called `altitude` is unknown"),
        ("stress.draw.size=[3, 1]", "a range goes from a value above zero"),
        ("stress.draw.shortest='61 s'", "is longer than the longest"),
    ] {
        let told = stderr(&w.fusion(&["check", "boat.toml", "--set", set]).code(2));
        assert!(told.contains(message), "{told}");
    }
    let never = w.fusion(&["stress", "boat.toml", "--set", "initial.fix.source=nobody"]);
    never.code(2);
}

/// The law of parts, for cases of the catalogue and for drawn ones.
#[test]
fn parts_of_a_stress_make_the_whole_in_any_order() {
    let w = boat("stress-parts");
    for (file, more) in [
        ("stress.csv", &["--only", "gap-1,step", "--pairs", "2"][..]),
        ("draw.csv", &["--set", DRAW, "--draw", "6"]),
    ] {
        let with = |args: &[&str]| w.fusion(&[&["stress", "boat.toml"], more, args].concat());
        let whole = with(&["--out", "whole"]);
        for (runs, part) in [("1..2", "a"), ("2..5", "b"), ("5..7", "c")] {
            with(&["--runs", runs, "--part", part]);
        }
        let merged = w.fusion(&["merge", "c", "a", "b", "--out", "merged"]);
        assert_eq!(rows(&w, &format!("whole/{file}")).len(), if file == "draw.csv" { 6 } else { 7 });
        assert_eq!(w.read(&format!("whole/{file}")), w.read(&format!("merged/{file}")));
        assert_eq!(stdout(&whole).replace("whole/", "merged/"), stdout(&merged));
        assert_eq!(whole.get_output().status.code(), merged.get_output().status.code());
        let refused = |files: &[&str]| stderr(&w.fusion(&[&["merge"], files].concat()).code(2));
        let missing = refused(&["a", "b"]);
        assert!(
            missing.contains("cases 5 to 6 are in no part") && missing.contains(" --runs 5..7 --part FILE`"),
            "{missing}"
        );
        assert!(refused(&["a", "b", "b", "c"]).contains("`b`: case 2 is in two parts"));
        // Another list of the same length.
        let other = |args: &[&str]| w.fusion(&[&["stress", "boat.toml", "--runs", "5..7", "--part", "other"], args].concat());
        match file {
            "draw.csv" => other(&["--set", DRAW, "--draw", "6", "--only", "ramp"]),
            _ => other(&["--only", "gap-5,step", "--pairs", "2"]),
        };
        let mixed = refused(&["a", "b", "other"]);
        assert!(
            mixed.contains("`other`: it belongs to another campaign: its list of cases is"),
            "{mixed}"
        );
    }
    let beyond = stderr(
        &w.fusion(&["stress", "boat.toml", "--only", "gap-1", "--pairs", "0", "--runs", "1..9"])
            .code(2),
    );
    assert!(beyond.contains("there are 2 cases, with the numbers 1..3"), "{beyond}");
}
