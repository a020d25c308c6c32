//! `fusion tune`: noises from innovations, without a reference.

use crate::real::data;
use crate::support::{Workspace, page, stderr, stdout, table};
use fusion::Selection;
use fusion::run::{KeptRows, Options};
use fusion_judge::tune::{Log, Outage, Settings, Tuned, tune};
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn tuned(design: &str, patterns: &[&str], set: &[&str], data: Option<&Path>) -> Tuned {
    tuned_with(&Settings::default(), design, patterns, set, data)
}

fn tuned_with(settings: &Settings, design: &str, patterns: &[&str], set: &[&str], data: Option<&Path>) -> Tuned {
    let selection = Selection {
        set: set.iter().map(|set| (*set).to_owned()).collect(),
        ..Selection::default()
    };
    let file = Path::new(ROOT).join(design);
    let log = Log {
        document: selection.load(&file).unwrap_or_else(|d| panic!("{d}")).document,
        options: Options {
            data: data.map(Path::to_path_buf),
            base: file.parent().unwrap().to_path_buf(),
            kept: Some(KeptRows::default()),
            ..Options::default()
        },
    };
    let patterns: Vec<String> = patterns.iter().map(|p| (*p).to_owned()).collect();
    tune(&[log], &patterns, settings, &|_, _| {}).unwrap_or_else(|d| panic!("{d}"))
}

/// The factor of each noise that is found, by the path of the noise.
fn factor(tuned: &Tuned, path: &str) -> Option<(f64, (f64, f64))> {
    let found = tuned.found.iter().find(|f| f.parameter.path == path).unwrap();
    found.is_identifiable().then(|| (found.factor, found.interval()))
}

/// The local level of the Nile: Durbin and Koopman 2012, §2.10, and `statsmodels`, to their last digit.
#[test]
fn the_nile_has_the_variances_and_the_likelihood_of_statsmodels() {
    // The first year has no expectation: it does not count.
    let settings = Settings {
        settle: 1.5,
        ..Settings::default()
    };
    let found = tuned_with(
        &settings,
        "configs/series/nile.toml",
        &["process.walk", "sensor.flow.noise"],
        &[],
        None,
    );
    assert!(found.is_sound() && found.has_converged, "{found:?}");
    let variance = |path: &str, declared: f64| (factor(&found, path).unwrap().0 * declared).powi(2);
    let (level, noise) = (variance("process.walk", 5.0), variance("sensor.flow.noise", 500.0));
    // Half of the last digit of the four.
    assert!((noise - 15_098.5).abs() < 5.0, "{noise}");
    assert!((level - 1_469.2).abs() < 0.5, "{level}");
    assert!((found.log_likelihood + 632.546).abs() < 0.0005, "{}", found.log_likelihood);
}

/// The first year counts here: the filter expects it with a σ of a thousand kilometres.
#[test]
fn a_result_has_the_likelihood_of_its_innovations() {
    let w = Workspace::new("likelihood");
    let design = format!("{ROOT}/configs/series/nile.toml");
    let sets = [
        "--set",
        "process.walk=[0, 0, \"38.33 m/sqrt(s)\"]",
        "--set",
        "sensor.flow.noise.sigma=122.876 m",
    ];
    w.fusion(&[&["run", &design, "--out", "out"][..], &sets].concat()).success();
    let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let sections = summary["sections"].as_array().unwrap();
    let section = sections.iter().find(|s| s["name"] == "likelihood").unwrap();
    let row = &section["rows"][0];
    assert_eq!((&row[0], &row[2]), (&"flow".into(), &100.into()));
    let first = -0.5 * (std::f64::consts::TAU.ln() + 2.0 * 1e6_f64.ln());
    let found = row[3].as_f64().unwrap() - first;
    // The last digit of the published value.
    assert!((found + 632.546).abs() < 0.0005, "{found}");
}

/// Without its gate, the filter follows outliers, and expects good rows less: the comparison says by how much.
#[test]
fn a_comparison_has_the_difference_of_likelihood_with_its_error() {
    let w = Workspace::new("likelihood-compared");
    let design = format!("{ROOT}/configs/ins-gps-outlier.toml");
    let compared = w
        .fusion(&["compare", &design, "--variant", "base,no-gate", "--format", "json"])
        .success();
    let page = page(&compared);
    let rows = &table(&page, "Likelihood")["rows"];
    let all = rows
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["cells"])
        .find(|c| c[1] == "all")
        .unwrap();
    let (nats, sigma) = (all[3].as_f64().unwrap(), all[4].as_f64().unwrap());
    assert!(nats < -2.0 * sigma && sigma > 1.0, "{nats} ± {sigma}");
    let each = rows.as_array().unwrap().iter().map(|row| row["cells"][3].as_f64().unwrap());
    // Printed in full precision: 1e-9 is rounding of the sum.
    assert!((each.sum::<f64>() - 2.0 * nats).abs() < 1e-9 * nats.abs().max(1.0), "{rows}");
}

/// From ten times and from a tenth of the truth, over seeds that the tool was not made on.
#[test]
fn noises_of_a_simulated_world_are_found_from_far_off_and_the_interval_holds_them() {
    let (mut inside, mut all) = (0, 0);
    for seed in [11, 13] {
        for far in [10.0, 0.1] {
            let run = format!("run.seed={seed}");
            let position = format!("sensor.position.noise.sigma=[\"{far} m\", \"{far} m\", \"{} m\"]", 2.0 * far);
            let velocity = format!("sensor.velocity.noise.sigma={} m/s", 0.05 * far);
            let found = tuned("configs/ins-gps.toml", &["sensor.*.noise"], &[&run, &position, &velocity], None);
            assert!(found.is_sound() && found.gain() > 50.0, "{seed} {far}: {found:?}");
            for path in ["sensor.position.noise", "sensor.velocity.noise"] {
                let (factor, (from, to)) = factor(&found, path).unwrap();
                assert!((factor * far).ln().abs() < 0.25, "{seed} {far} {path}: {factor}");
                inside += i32::from((from..to).contains(&(1.0 / far)));
                all += 1;
            }
        }
    }
    // The two starts of a seed end at the same place: 4 independent intervals of 95 %, of which fewer than 3 hold the
    // truth once in 70 times.
    assert!(inside >= 6, "{inside} of {all}");
}

#[test]
fn what_the_log_does_not_tell_keeps_its_value_and_has_its_name() {
    // Twice the truth: a noise that is right keeps its value too.
    let twice = [
        "sensor.position.noise.sigma=[\"2 m\", \"2 m\", \"4 m\"]",
        "sensor.velocity.noise.sigma=0.1 m/s",
    ];
    let found = tuned("configs/ins-gps.toml", &["accelerometer.noise", "sensor.*.noise"], &twice, None);
    assert_eq!(factor(&found, "process.accelerometer.noise"), None);
    let edits: Vec<String> = found.edits().into_iter().map(|edit| edit.key).collect();
    assert_eq!(edits, ["sensor.position.noise.sigma", "sensor.velocity.noise.sigma"]);
}

#[test]
fn a_noise_that_is_right_keeps_its_value() {
    let found = tuned("configs/ins-gps.toml", &["sensor.*.noise"], &[], None);
    assert!(found.found.iter().all(|f| f.is_identifiable() && f.factor == 1.0), "{found:?}");
    assert_eq!(found.edits(), []);
}

/// One fix in ten is wrong by 30 m and more, and the sensor has a gate.
#[test]
fn outliers_behind_a_gate_do_not_widen_the_noise() {
    let outliers = "simulation.sensor.position.fault.wrong={ type = \"outliers\", rate = \"10 %\", channel = \"position\", size = [\"30 m\", \"60 m\"] }";
    let found = tuned("configs/ins-gps.toml", &["sensor.position.noise"], &[outliers], None);
    let (factor, _) = factor(&found, "sensor.position.noise").unwrap();
    assert!((0.85..1.25).contains(&factor), "{factor}");
}

/// Six times the truth: gyro noise shows in a drive of three minutes only as a limit.
#[test]
fn a_noise_that_is_refuted_but_not_identifiable_has_the_limit_that_the_log_does_not_refute() {
    let with = |factor: f64| {
        let noise = format!("process.gyro.noise={} deg/sqrt(h)", 0.125 * factor);
        let seed = "run.seed=61";
        tuned("configs/ins-gps.toml", &["gyro.noise"], &[&noise, seed], None).found[0].clone()
    };
    let found = with(10.0);
    assert!(found.is_refuted && !found.is_identifiable(), "{found:?}");
    let limit = 10.0 * found.factor;
    assert!((1.0..10.0).contains(&limit), "{limit}");
    // The search knows the limit to a sixteenth of the way, in logarithms, from the flat part to ten times: within a half.
    assert!(!with(0.8 * limit).is_refuted, "{limit}");
    assert!(with(1.5 * limit).factor < 1.0, "{limit}");
}

/// A gyro noise that is ten times too large: the first rows after outages show it too.
#[test]
fn rows_after_outages_join_the_likelihood_and_judge_the_result() {
    let large = "process.gyro.noise=1.25 deg/sqrt(h)";
    let with = |outage: Option<Outage>| {
        let settings = Settings {
            outage,
            ..Settings::default()
        };
        tuned_with(&settings, "configs/ins-gps.toml", &["gyro.noise"], &[large, "run.seed=61"], None)
    };
    let (without, found) = (with(None), with(Some(outage(15.0, None))));
    assert!(without.coasting.is_empty());
    let sensors: Vec<&str> = found.coasting.iter().map(|own| own.sensor.as_str()).collect();
    assert_eq!(sensors, ["position", "velocity"]);
    for own in &found.coasting {
        // Half of the log of three minutes is in outages of one replay, the other half in those of the other one.
        assert!((6..=11).contains(&own.outages), "{own:?}");
        assert!(own.declared > 0.0 && own.found > 0.0, "{own:?}");
    }
    assert!(
        found.coasting.iter().map(|own| own.nats).sum::<f64>() > 0.0 && !found.is_worse_after_outages,
        "{found:?}"
    );
    let (log, log_without) = (found.log_likelihood, without.log_likelihood);
    assert!((log - log_without).abs() > 1.0, "rows after outages count: {log} and {log_without}");
}

fn outage(duration: f64, of: Option<&str>) -> Outage {
    Outage {
        duration,
        of: of.map(str::to_owned),
    }
}

#[test]
fn an_outage_that_does_not_fit_or_has_no_instrument_is_an_error() {
    let w = Workspace::new("tune-outage");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let long = w.fusion(&["tune", &design, "--outage", "10 min"]).code(2);
    assert!(stderr(&long).contains("no outage of 600 s fits into the log"), "{}", stderr(&long));
    let other = w.fusion(&["tune", &design, "--outage", "gnns=10 s"]).code(2);
    assert!(stderr(&other).contains("no instrument has this name"), "{}", stderr(&other));
}

/// The searches from three starts, in two processes and any order, give the page of one process.
#[test]
fn parts_of_a_tuning_make_the_whole() {
    let w = Workspace::new("tune-parts");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let far = [
        "--start",
        "sensor.velocity.noise.sigma=0.5 m/s",
        "--start",
        "sensor.velocity.noise.sigma=5 mm/s",
    ];
    let all = [&["tune", &design, "--params", "sensor.velocity.noise"][..], &far].concat();
    let whole = stdout(&w.fusion(&all).success());
    for (runs, part) in [("0..1", "a.part"), ("1..3", "b.part")] {
        w.fusion(&[&all[..], &["--runs", runs, "--part", part]].concat()).success();
    }
    assert_eq!(stdout(&w.fusion(&["merge", "b.part", "a.part"]).success()), whole);
    let missing = stderr(&w.fusion(&["merge", "b.part"]).code(2));
    assert!(missing.contains("starts 0 to 0 are in no part"), "{missing}");
    assert!(missing.contains("--runs 0..1 --part"), "{missing}");
    let beyond = stderr(&w.fusion(&[&all[..], &["--runs", "2..4", "--part", "c.part"]].concat()).code(2));
    assert!(beyond.contains("there are the starts 0..3"), "{beyond}");
}

#[test]
fn a_start_with_a_mistake_or_with_the_declared_values_is_an_error() {
    let w = Workspace::new("tune-start");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let slip = w.fusion(&["tune", &design, "--start", "sensor.positoin.noise.sigma=1 m"]).code(2);
    assert!(stderr(&slip).contains("positoin"), "{}", stderr(&slip));
    let other = w.fusion(&["tune", &design, "--start", "run.seed=2"]).code(2);
    assert!(
        stderr(&other).contains("has the declared value of every noise"),
        "{}",
        stderr(&other)
    );
}

/// The velocity of the simulated receiver is four times worse in every other quarter of a minute.
#[test]
fn a_noise_that_changes_along_the_log_covers_the_declared_share_of_it() {
    let worse = "simulation.sensor.velocity.fault.worse={ type = \"noise\", channel = \"velocity\", sigma = \"0.2 m/s\", \
                 window = { from = \"15 s\", duration = \"15 s\", every = \"30 s\" } }";
    let with = |cover: Option<f64>| {
        let settings = Settings {
            cover,
            ..Settings::default()
        };
        let found = tuned_with(&settings, "configs/ins-gps.toml", &["sensor.velocity.noise"], &[worse], None);
        0.05 * factor(&found, "sensor.velocity.noise").unwrap().0
    };
    let (whole, half, most) = (with(None), with(Some(0.5)), with(Some(0.95)));
    // Between the two noises of the receiver, 0.05 and 0.21 m/s.
    assert!((0.05..0.21).contains(&whole), "{whole}");
    // One half of the parts is above the median, which is the value of the whole.
    assert!((half / whole - 1.0).abs() < 1e-12, "{half} and {whole}");
    // The noise of the bad parts; a log-normal law of only two values is wide.
    assert!((0.18..0.6).contains(&most), "{most}");
}

/// Both searches end at the same maximum, and the better end counts.
#[test]
fn a_further_start_ends_at_the_same_maximum() {
    let far = "sensor.velocity.noise.sigma=0.5 m/s";
    let selection = Selection {
        set: vec![far.to_owned(), "sensor.velocity.noise.sigma=1 cm/s".to_owned()],
        ..Selection::default()
    };
    let file = Path::new(ROOT).join("configs/ins-gps.toml");
    let settings = Settings {
        starts: vec![selection.load(&file).unwrap_or_else(|d| panic!("{d}")).document],
        ..Settings::default()
    };
    let design = "configs/ins-gps.toml";
    let one = tuned(design, &["sensor.velocity.noise"], &[far], None);
    let two = tuned_with(&settings, design, &["sensor.velocity.noise"], &[far], None);
    assert!(two.runs > one.runs, "{} and {}", two.runs, one.runs);
    // Each search ends within a hundredth of a nat of the maximum.
    assert!((one.log_likelihood - two.log_likelihood).abs() < 0.02, "{one:?} {two:?}");
}

/// Accelerometers that are declared in feet, and columns of σ that are not read: the second half judges both edits.
#[test]
fn an_edit_of_advice_is_proposed_if_the_half_that_it_has_not_seen_gains() {
    let Some(data) = data() else { return };
    let w = Workspace::new("tune-structure");
    let design = format!("{ROOT}/configs/real/rtklib-drive.toml");
    let data = data.display().to_string();
    let arguments = ["tune", &design, "--data", &data, "--structure"];
    let feet = ["--set", "source.imu.channels.specific_force.unit=\"ft/s^2\"", "--format", "json"];
    let of = |rule: &str, set: &[&str]| {
        let page = page(&w.fusion(&[&arguments[..], set].concat()).success());
        let rows = page["sections"][0]["tables"][0]["rows"].as_array().unwrap();
        let row = rows.iter().find(|row| row["cells"][0] == rule);
        row.unwrap_or_else(|| panic!("{rule} is not in {page}"))["cells"].clone()
    };
    let unit = of("unit", &feet);
    let (nats, sigma) = (unit[2].as_f64().unwrap(), unit[3].as_f64().unwrap());
    assert!(nats > sigma && sigma > 0.0 && unit[4] == "proposed", "{unit}");
    // The columns of σ do not mend the innovations that a wrong lever arm makes large.
    let arm = ["--set", "sensor.gnss_position.lever_arm=[3, 0, 0]", "--format", "json"];
    assert_eq!(of("nis-large", &arm)[4], "no gain on unseen rows");
    // Its fixes have a slow error, of which the second half says that it is not that of the first half.
    let good = stdout(&w.fusion(&arguments).success());
    assert!(!good.contains("proposed"), "{good}");
    assert!(good.contains("Innovations identify only σ²/τ of a slow error"), "{good}");
}

/// The filter of an attitude has the directions of gravity and field from stages.
#[test]
fn a_design_whose_rows_come_from_stages_is_refused() {
    let Some(data) = data() else { return };
    let w = Workspace::new("tune-stages");
    w.write("broad.toml", std::fs::read(format!("{ROOT}/configs/real/broad.toml")).unwrap());
    let data = data.display().to_string();
    let refused = stdout(&w.fusion(&["tune", "broad.toml", "--data", &data, "--fix", "copy.toml"]).code(4));
    assert!(
        refused.contains("made by the stage `vertical`") && refused.contains("made by the stage `compass`"),
        "{refused}"
    );
    assert!(refused.contains("are not independent: not tuned. Stages make them"), "{refused}");
    assert!(!w.path("copy.toml").exists());
}

#[test]
fn a_slow_error_is_no_noise_and_ends_in_a_refusal() {
    let w = Workspace::new("tune-refused");
    let design = format!("{ROOT}/configs/ins-gps.toml");
    let slow = "simulation.sensor.position.markov={ sigma = \"20 m\", correlation_time = \"15 s\" }";
    let few = "simulation.sensor.position.rate=0.25 Hz";
    let refused = w
        .fusion(&["tune", &design, "--params", "sensor.position.noise", "--set", slow, "--set", few])
        .code(4);
    assert!(
        stdout(&refused).contains("The rows of `position` are not independent: not tuned"),
        "{}",
        stdout(&refused)
    );
    let unknown = w.fusion(&["tune", &design, "--params", "sensor.positon.noise"]).code(2);
    assert!(stderr(&unknown).contains("selects no declared noise"), "{}", stderr(&unknown));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads_and_is_written_into_a_copy() {
    let w = Workspace::new("tune-copy");
    let text = std::fs::read_to_string(format!("{ROOT}/configs/ins-gps.toml")).unwrap();
    let far = text.replace(
        "noise = { sigma = \"0.05 m/s\" }",
        "noise = { sigma = \"0.5 m/s\" } # by its data sheet",
    );
    assert_ne!(far, text);
    w.write("far.toml", far.replace("parts/imu", &format!("{ROOT}/configs/parts/imu")));
    let of = |threads: &str, copy: &str| {
        let mut command = assert_cmd::cargo::cargo_bin_cmd!("fusion");
        let arguments = [
            "tune",
            "far.toml",
            "--params",
            "sensor.velocity.noise",
            "--format",
            "json",
            "--fix",
            copy,
        ];
        command.current_dir(w.path("")).args(arguments).env("RAYON_NUM_THREADS", threads);
        stdout(&command.assert().success()).replace(copy, "COPY")
    };
    assert_eq!(of("1", "one.toml"), of("3", "three.toml"));
    let copy = w.read("one.toml");
    let line = copy.lines().find(|line| line.ends_with("# by its data sheet")).unwrap();
    let sigma: f64 = line.split('"').nth(1).unwrap().trim_end_matches(" m/s").parse().unwrap();
    assert!((0.04..0.06).contains(&sigma), "{line}");
    w.fusion(&["check", "one.toml"]).success();
}

/// Runs a design with the edits that were found, and without them, judged from a time on.
fn judged(design: &str, found: &Tuned, data: &Path, from: &str) -> [serde_json::Value; 2] {
    let w = Workspace::new("tune-judged");
    let (file, data, from) = (
        format!("{ROOT}/{design}"),
        data.display().to_string(),
        format!("reference.from=\"{from}\""),
    );
    let edits: Vec<String> = found
        .edits()
        .iter()
        .map(|edit| format!("{}={}", edit.key, edit.value.as_deref().unwrap()))
        .collect();
    [&[][..], &edits].map(|edits| {
        let mut arguments = vec!["run", &file, "--data", &data, "--out", "out", "--set", &from];
        arguments.extend(edits.iter().flat_map(|edit| ["--set", edit.as_str()]));
        w.fusion(&arguments).success();
        serde_json::from_str(&w.read("out/summary.json")).unwrap()
    })
}

fn rms(summary: &serde_json::Value) -> f64 {
    summary["score"]["horizontal_rms"].as_f64().unwrap()
}

fn nees(summary: &serde_json::Value, what: &str) -> f64 {
    summary["score"][what]["mean"].as_f64().unwrap() / 3.0
}

/// Found on the first half of the drive, judged on the second: the bars are those of a hand-tuned design.
#[test]
fn a_recorded_drive_tuned_on_its_first_half_is_no_worse_on_the_second() {
    let Some(data) = data() else { return };
    let design = "configs/real/rtklib-drive.toml";
    let half = ["source.imu.time.stop=\"296 s\"", "source.gnss.time.stop=\"296 s\""];
    let found = tuned(design, &[], &half, Some(&data));
    assert!(found.is_sound() && found.gain() > 0.0, "{found:?}");
    let [before, after] = judged(design, &found, &data, "296 s");
    assert!(rms(&after) <= 1.03 * rms(&before), "{} and {}", rms(&after), rms(&before));
    let nees = nees(&after, "nees_position");
    assert!((0.4..2.0).contains(&nees), "{nees}");
}

/// The noise of its velocity changes along the log. With the noise that covers 95 % of the parts, the velocity is
/// consistent on the part that was not seen.
#[test]
fn a_recorded_car_whose_noise_changes_is_consistent_with_a_noise_that_covers() {
    let Some(data) = data() else { return };
    let design = "configs/real/pntos-car.toml";
    let part = ["source.imu.time.start=\"200 s\"", "source.imu.time.stop=\"900 s\""];
    let settings = Settings {
        cover: Some(0.95),
        ..Settings::default()
    };
    let found = tuned_with(&settings, design, &[], &part, Some(&data));
    assert!(found.is_better(), "{found:?}");
    let [before, after] = judged(design, &found, &data, "900 s");
    assert!(rms(&after) <= 1.03 * rms(&before), "{} and {}", rms(&after), rms(&before));
    let (position, velocity) = (nees(&after, "nees_position"), nees(&after, "nees_velocity"));
    assert!((0.4..2.0).contains(&position) && velocity <= 3.0, "{position} {velocity}");
}
