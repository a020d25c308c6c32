use crate::support::{DESIGN, Workspace, fixes, snapshot};
use serde_json::Value;

/// Lines of the table with blanks squeezed, so that widths may change.
fn squeezed(text: &str) -> Vec<String> {
    text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

fn has(text: &str, line: &str) {
    assert!(squeezed(text).iter().any(|l| l.contains(line)), "no line with {line:?} in\n{text}");
}

fn is_narrow(text: &str) {
    for line in text.lines() {
        assert!(line.chars().count() <= 100 && line.trim_end() == line, "{line:?}");
    }
}

#[test]
fn help_has_examples_for_every_subcommand() {
    let w = Workspace::new("command-help");
    for sub in ["run", "check", "blocks", "compare", "montecarlo", "schema"] {
        let ran = w.fusion(&[sub, "--help"]);
        assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
        let example = ran.stdout.split("Examples:").nth(1).unwrap_or_else(|| panic!("{}", ran.stdout));
        assert!(example.contains(&format!("fusion {sub}")), "{example}");
        is_narrow(&ran.stdout);
    }
    has(&w.fusion(&["--help"]).stdout, "Exit codes: 0 done");
    assert_eq!(w.fusion(&["rnu"]).code, 2);
}

#[test]
fn the_built_in_design_runs_without_a_file() {
    let w = Workspace::new("command-default");
    let ran = w.fusion(&["run"]);
    assert_eq!(
        (ran.code, ran.stderr.as_str()),
        (0, ""),
        "a pipe gets neither progress nor warnings"
    );
    for line in [
        "backend ",
        "started at",
        "epochs ",
        "Sources",
        "Sensors",
        "Errors against the reference",
        "position north [m]",
        "attitude yaw [deg]",
    ] {
        has(&ran.stdout, line);
    }
    is_narrow(&ran.stdout);
}

#[test]
fn the_command_alone_runs_the_built_in_design() {
    let w = Workspace::new("command-alone");
    let (alone, run) = (w.fusion(&[]), w.fusion(&["run"]));
    assert_eq!(
        (alone.code, squeezed(&alone.stdout)[0].clone()),
        (0, squeezed(&run.stdout)[0].clone())
    );
}

#[test]
fn variants_are_compared_in_one_table_and_one_page() {
    let w = Workspace::new("command-compare");
    let ran = w.fusion(&["compare", "--variant", "base,ekf", "--out", "both"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    for line in ["base", "ekf", "RMS N [m]", "rejected", "ns per epoch"] {
        has(&ran.stdout, line);
    }
    is_narrow(&ran.stdout);
    assert!(w.read("both/report.html").contains("ekf"));
    assert_eq!(w.fusion(&["compare", "--variant", "base,nobody"]).code, 2);
}

#[test]
fn a_campaign_is_the_same_file_for_any_number_of_threads() {
    let w = Workspace::new("command-montecarlo");
    let campaign = |out: &str, threads: &str, seed: &str| {
        let ran = w.fusion(&["montecarlo", "-n", "3", "--threads", threads, "--seed", seed, "--out", out]);
        assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
        has(&ran.stdout, "3 runs");
        has(&ran.stdout, "NEES position");
        is_narrow(&ran.stdout);
        w.read(&format!("{out}/runs.csv"))
    };
    let (one, two, other) = (campaign("one", "1", "1"), campaign("two", "2", "1"), campaign("other", "2", "9"));
    assert_eq!(one, two);
    assert_ne!(one, other, "the seed of the campaign counts");
    let rows: Vec<&str> = one.lines().collect();
    assert!(
        rows.len() == 4 && rows[0].starts_with("run,seed,rms_n_m") && rows[1] != rows[2],
        "{one}"
    );
}

#[test]
fn a_recorded_design_runs_and_is_reproduced() {
    let w = Workspace::new("command-recorded");
    let (first, second) = (w.fusion(&["run", "design.toml"]), w.fusion(&["run", "design.toml"]));
    assert_eq!((first.code, first.stderr.as_str()), (0, ""));
    let without_times = |text: &str| squeezed(text).into_iter().filter(|l| !l.starts_with("epochs")).collect::<Vec<_>>();
    assert_eq!(without_times(&first.stdout), without_times(&second.stdout));
    has(&first.stdout, "gnss 60 of 60 rows, 59.0 s at 1.000 Hz");
    has(&first.stdout, "body / single / joseph");
    has(&first.stdout, "Nothing written");
    assert!(!first.stdout.contains('\u{1b}'), "no colour in a pipe");
}

#[test]
fn files_have_the_documented_columns() {
    let w = Workspace::new("command-files");
    let ran = w.fusion(&["run", "design.toml", "--out", "deep/results"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    has(&ran.stdout, "deep/results/estimates.csv");
    let estimates = w.read("deep/results/estimates.csv");
    let axes = [
        "lat_deg",
        "lon_deg",
        "height_m",
        "n_m",
        "e_m",
        "d_m",
        "vn_mps",
        "ve_mps",
        "vd_mps",
        "roll_deg",
        "pitch_deg",
        "yaw_deg",
    ];
    let header = format!("t_s,{},sigma_{}", axes.join(","), axes.join(",sigma_"));
    let (first, rows) = estimates.split_once('\n').unwrap();
    assert!(first.starts_with(&header), "{first}");
    let fields = first.split(',').count();
    assert!(rows.lines().count() > 50 && rows.lines().all(|l| l.split(',').count() == fields));
    let updates = w.read("deep/results/updates.csv");
    let header = "t_s,sensor,verdict,nis,statistic,threshold,mode,weight,residual_0,residual_1,residual_2,sigma_0,sigma_1,sigma_2";
    assert_eq!(updates.lines().next(), Some(header));
    assert!(updates.lines().skip(1).all(|l| l.split(',').nth(1) == Some("gnss")));
    let summary: Value = serde_json::from_str(&w.read("deep/results/summary.json")).unwrap();
    assert_eq!(summary["description"], "Constant velocity with GNSS");
    assert_eq!(summary["sources"][0]["rows"], 60);
}

#[test]
fn results_that_cannot_be_written_are_told() {
    let w = Workspace::new("command-unwritable");
    w.write("results", "a file");
    let ran = w.fusion(&["run", "design.toml", "--out", "results"]);
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("cannot write results"), "{}", ran.stderr);
}

#[test]
fn an_override_changes_the_run_and_comes_after_the_variants() {
    let w = Workspace::new("command-set");
    has(
        &w.fusion(&["run", "design.toml", "--variant", "ekf"]).stdout,
        "additive_euler / single / joseph",
    );
    let both = w.fusion(&["run", "design.toml", "--set", "filter.backend=error_state", "--variant", "ekf"]);
    assert_eq!(both.code, 0, "{}", both.stderr);
    has(&both.stdout, "body / single / joseph");
    let tight = w.fusion(&["run", "design.toml", "--set", "sensor.gnss.noise.sigma=1 cm"]);
    has(&tight.stdout, "optimistic");
}

#[test]
fn data_may_lie_elsewhere() {
    let w = Workspace::new("command-data");
    std::fs::create_dir(w.path("logs")).unwrap();
    std::fs::rename(w.path("gnss.csv"), w.path("logs/gnss.csv")).unwrap();
    assert_eq!(w.fusion(&["run", "design.toml"]).code, 2);
    assert_eq!(w.fusion(&["run", "design.toml", "--data", "logs"]).code, 0);
}

#[test]
fn a_filter_that_never_starts_is_a_warning() {
    let w = Workspace::new("command-never");
    let ran = w.fusion(&["run", "design.toml", "--set", "run.start=1000 s"]);
    assert_eq!(ran.code, 0);
    has(&ran.stdout, "started never");
    snapshot("never_started", &ran.stderr);
}

#[test]
fn rows_left_out_are_told_with_their_reason() {
    let w = Workspace::new("command-left-out");
    w.write("gnss.csv", fixes().replace("\n7.0,", "\nseven,"));
    let ran = w.fusion(&["run", "design.toml", "--set", "source.gnss.bad_rows=skip"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    has(&ran.stdout, "gnss 59 of 60 rows");
    has(&ran.stdout, "left out 1:");
    has(&ran.stdout, "line 9: `seven` in column `t`");
}

#[test]
fn a_design_is_checked_without_being_run() {
    let w = Workspace::new("command-check");
    let ran = w.fusion(&["check", "design.toml"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    is_narrow(&ran.stdout);
    snapshot("check", &ran.stdout);
    std::fs::remove_file(w.path("gnss.csv")).unwrap();
    let ran = w.fusion(&["check", "design.toml"]);
    assert_eq!(ran.code, 0);
    has(&ran.stdout, "gnss csv not found ./gnss.csv");
    w.write("design.toml", DESIGN.replace("\"gnss_position\"", "\"gnss_positon\""));
    assert_eq!(w.fusion(&["check", "design.toml"]).code, 2);
}

/// Two fixes of the receiver are a kilometre off, and its velocity is right throughout.
#[test]
fn a_sensor_goes_with_another_in_either_order_of_declaration() {
    let w = Workspace::new("command-only-with");
    let far = |line: &str| line.replacen(",47.", ",47.01", 1);
    let lines = fixes().lines().map(str::to_owned).collect::<Vec<_>>();
    let spoilt = lines
        .iter()
        .enumerate()
        .map(|(k, l)| if [21, 41].contains(&k) { far(l) } else { l.clone() } + "\n");
    w.write("gnss.csv", spoilt.collect::<String>());
    let speed = "[sensor.speed]\ntype = \"gnss_velocity\"\nsource = \"gnss\"\nonly_with = \"gnss\"\nnoise = { sigma = \"0.1 m/s\" }\n\n";
    let run = |design: &str| {
        w.write("design.toml", design);
        let ran = w.fusion(&["run", "design.toml", "--out", "results"]);
        assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
        w.read("results/updates.csv")
    };
    let before = run(&DESIGN.replacen("[sensor.gnss]", &format!("{speed}[sensor.gnss]"), 1));
    assert_eq!(before, run(&format!("{DESIGN}\n{speed}")));
    let rejected = |sensor: &str| -> Vec<String> {
        let cells = before.lines().map(|l| l.split(',').collect::<Vec<_>>());
        let rejected = cells.filter(|c| c[1] == sensor && c[2] == "rejected");
        rejected
            .map(|c| {
                assert!(c[3] == c[4] && !c[3].is_empty() && (sensor == "gnss") != (c[5] == "inf"), "{c:?}");
                c[0].to_owned()
            })
            .collect()
    };
    assert_eq!(rejected("gnss"), ["20.000000", "40.000000"]);
    assert_eq!(rejected("speed"), rejected("gnss"));

    has(&w.fusion(&["check", "design.toml"]).stdout, "speed only with gnss");
    let alone = ["check", "design.toml", "--set", "sensor.gnss.enabled=false"];
    has(&w.fusion(&alone).stdout, "speed only with gnss, which is left out: no effect");
    let ran = w.fusion(&["run", "design.toml", "--set", "sensor.gnss.enabled=false", "--out", "alone"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    let updates = w.read("alone/updates.csv");
    assert!(updates.contains("speed,accepted") && !updates.contains("rejected"));
}

#[test]
fn a_file_that_does_not_fit_fails_the_check() {
    let w = Workspace::new("command-check-header");
    w.write("gnss.csv", fixes().replace("vn", "v_north"));
    let ran = w.fusion(&["check", "design.toml"]);
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("has no column `vn`"), "{}", ran.stderr);
}

#[test]
fn the_built_in_design_is_checked() {
    let ran = Workspace::new("command-check-default").fusion(&["check"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    for line in ["State, ", "Sensors", "Initialisers", "Streams", "the simulated truth"] {
        has(&ran.stdout, line);
    }
    is_narrow(&ran.stdout);
}

#[test]
fn faults_of_a_simulated_unit_are_checked_and_applied() {
    let w = Workspace::new("command-imu-fault");
    let gap = "{ type = \"outage\", window = { from = \"20 s\", to = \"21 s\" } }";
    let set = format!("simulation.imu.fault={{ gap = {gap} }}");
    let checked = w.fusion(&["check", "--set", &set]);
    assert_eq!((checked.code, checked.stderr.as_str()), (0, ""));
    has(&checked.stdout, "imu gap outage, window (from 20 s, to 21 s)");
    let ran = w.fusion(&["run", "--set", &set, "--out", "results"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    let summary: serde_json::Value = serde_json::from_str(&w.read("results/summary.json")).unwrap();
    let imu = summary["sources"].as_array().unwrap().iter().find(|s| s["name"] == "imu").unwrap();
    assert_eq!(imu["skipped"][0], serde_json::json!(["withheld by a fault", 100]));
}

#[test]
fn every_block_is_listed_and_described() {
    let w = Workspace::new("command-blocks");
    let list = w.fusion(&["blocks"]);
    assert_eq!(list.code, 0);
    is_narrow(&list.stdout);
    fusion::models::link();
    for r in fusion::models::registry::all() {
        has(&list.stdout, r.name);
        let one = w.fusion(&["blocks", r.name]);
        assert_eq!(one.code, 0, "{}", one.stderr);
        let schema = fusion::schema::block(r);
        for field in schema["properties"].as_object().into_iter().flat_map(|p| p.keys()) {
            assert!(
                one.stdout.contains(&format!("\n  {field}: ")),
                "`{field}` of `{}`:\n{}",
                r.name,
                one.stdout
            );
        }
    }
    snapshot("block", &w.fusion(&["blocks", "gnss_position"]).stdout);
}

/// What `fusion blocks` shows can be copied into a design.
#[test]
fn every_example_shown_is_toml_with_its_type() {
    let w = Workspace::new("command-examples");
    for r in fusion::models::registry::all() {
        let shown = w.fusion(&["blocks", r.name]).stdout;
        for example in shown.split("\nExample\n").skip(1) {
            let example = example.split("\n\n").next().unwrap();
            let design: toml::Table = toml::from_str(example).unwrap_or_else(|e| panic!("{}: {e}\n{example}", r.name));
            assert!(!design.is_empty());
        }
    }
}

#[test]
fn an_unknown_block_is_no_dead_end() {
    let ran = Workspace::new("command-unknown-block").fusion(&["blocks", "gnss_positon"]);
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("did you mean `gnss_position`?"), "{}", ran.stderr);
}

#[test]
fn the_schema_is_json() {
    let ran = Workspace::new("command-schema").fusion(&["schema"]);
    assert_eq!(ran.code, 0);
    let schema: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(schema["properties"]["sensor"]["type"], "object");
}
