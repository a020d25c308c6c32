use crate::support::{DESIGN, Workspace, fixes, has, narrow, page, shows, snapshot, squeezed, stderr, stdout, table};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::{Value, json};

#[test]
fn help_has_examples_for_every_subcommand() {
    let w = Workspace::new("command-help");
    for sub in ["run", "check", "blocks", "compare", "montecarlo", "stress", "schema"] {
        let help = stdout(&w.fusion(&[sub, "--help"]).success().stderr("").stdout(narrow()));
        let example = help.split("Examples:").nth(1).unwrap_or_else(|| panic!("{help}"));
        assert!(example.contains(&format!("fusion {sub}")), "{example}");
    }
    w.fusion(&["--help"]).stdout(has("Exit codes: 0 done"));
    w.fusion(&["rnu"]).code(2);
}

#[test]
fn the_built_in_design_runs_without_a_file() {
    let w = Workspace::new("command-default");
    // A pipe gets neither progress nor warnings.
    let ran = w.fusion(&["run", "--verbose"]).success().stderr("").stdout(narrow());
    let parts = [
        "backend ",
        "started ",
        "epochs ",
        "Sources",
        "Sensors",
        "Errors against the reference",
        "position north [m]",
        "attitude yaw [deg]",
    ];
    shows(ran, &parts);
}

/// The first output fits on a screen, and `--verbose` shows the rest.
#[test]
fn the_first_lines_say_what_the_run_was_and_how_it_went() {
    let w = Workspace::new("command-brief");
    let arguments = [
        "run",
        "--seed",
        "7",
        "--variant",
        "no-gate",
        "--set",
        "sensor.compass.noise.sigma=1 deg",
        "--out",
        "out",
    ];
    let ran = w.fusion(&arguments).success().stdout(narrow());
    let lines = squeezed(&stdout(&ran));
    let made_of = "variant no-gate · set sensor.compass.noise.sigma=1 deg · seed 7 · design ";
    assert!(lines[1..3].join(" ").contains(made_of), "{lines:#?}");
    let at = |start: &str| {
        lines
            .iter()
            .position(|line| line.starts_with(start))
            .unwrap_or_else(|| panic!("{start}: {lines:#?}"))
    };
    let order = [
        "health",
        "position horizontal",
        "velocity",
        "attitude heading",
        "Look at next",
        "- NIS of `gps_position`",
        "Sensors",
    ]
    .map(at);
    assert!(order.is_sorted() && lines.len() <= 60, "{lines:#?}");
    let summary: Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let provenance = &summary["provenance"];
    assert_eq!(provenance["variants"], serde_json::json!(["no-gate"]));
    assert_eq!(provenance["set"], serde_json::json!(["sensor.compass.noise.sigma=1 deg"]));
    assert_eq!(
        (&provenance["seed"], &provenance["version"]),
        (&7.into(), &env!("CARGO_PKG_VERSION").into())
    );
    let hash = provenance["hash"].as_str().unwrap();
    assert!(w.read("out/report.html").contains(&format!("{made_of}{hash}")));
    let campaign = w.fusion(&[
        "montecarlo",
        "-n",
        "2",
        "--variant",
        "no-gate",
        "--set",
        "sensor.compass.noise.sigma=1 deg",
        "--out",
        "mc",
    ]);
    shows(campaign.success(), &["variant no-gate · set sensor.compass.noise.sigma=1 deg"]);
    assert!(w.read("mc/montecarlo.html").contains(&format!("seed 1 · design {hash}")));
    let compared = w.fusion(&["compare", "--variant", "base,no-gate", "--out", "both"]);
    shows(compared.success(), &["seed 1 · fusion"]);
    assert!(w.read("both/report.html").contains("seed 1 · fusion"));
}

#[test]
fn the_command_alone_runs_the_built_in_design() {
    let w = Workspace::new("command-alone");
    let [alone, run] = [w.fusion(&[]), w.fusion(&["run"])].map(|ran| squeezed(&stdout(&ran.success())));
    assert_eq!(alone[0], run[0]);
}

#[test]
fn variants_are_compared_in_one_table_and_one_page() {
    let w = Workspace::new("command-compare");
    let ran = w.fusion(&["compare", "--variant", "base,ekf", "--out", "both"]);
    let ran = ran.success().stderr("").stdout(narrow());
    // Headers are wrapped if there are many columns.
    shows(ran, &["base", "ekf", "RMS N", "rejected", "epoch"]);
    assert!(w.read("both/report.html").contains("ekf"));
    w.fusion(&["compare", "--variant", "base,nobody"]).code(2);
    // A list of variants is not accepted where one design is required.
    let listed = w.fusion(&["run", "--variant", "ekf,no-gate"]).code(2);
    listed
        .stderr(contains("has no variant `ekf,no-gate`"))
        .stderr(contains("`--variant ekf+no-gate`"));
}

/// NIS of three rows is divided by three, and shown next to the counts and innovations of each sensor.
#[test]
fn variants_without_a_reference_are_compared_by_their_sensors() {
    let w = Workspace::new("command-compare-sensors");
    w.fusion(&["run", "design.toml", "--out", "one"]).success();
    let summary: Value = serde_json::from_str(&w.read("one/summary.json")).unwrap();
    let sensor = &summary["sensors"][0];
    let ran = w
        .fusion(&["compare", "design.toml", "--variant", "base,ekf", "--format", "json"])
        .success();
    let page = page(&ran);
    let measured = table(&page, "Measurements of each sensor");
    let base = measured["rows"][0]["cells"].as_array().unwrap();
    assert_eq!(base[..2], [json!("gnss"), json!("base")]);
    assert_eq!(base[2..4], [sensor["accepted"].clone(), sensor["rejected"].clone()]);
    assert_eq!(sensor["nis"]["dof"], 3);
    assert_eq!(base[4].as_f64().unwrap(), sensor["nis"]["mean"].as_f64().unwrap() / 3.0);
    // The fixes alternate by up to 2 m; the design declares 2 m per axis.
    assert_eq!(base[5], "conservative");
    assert_eq!(measured["rows"][1]["cells"][1], "ekf");
    let innovations = table(&page, "Innovations of accepted measurements");
    let north = &innovations["rows"][0];
    assert_eq!((&north["unit"], &north["cells"][0]), (&json!("m"), &json!("gnss north")));
    assert_eq!(north["cells"][2], sensor["innovations"]["rms"][0]);
    // The runs are next to each other for each residual.
    let next = &innovations["rows"][1]["cells"];
    assert_eq!((&next[0], &next[1]), (&json!("gnss north"), &json!("ekf")));
    // NEES is not shown, because there is no reference.
    table(&page, "Filter time per epoch");
    let scored = w.fusion(&["compare", "--variant", "base,ekf"]).success();
    let scored = stdout(&scored);
    assert!(scored.contains("Measurements of all sensors together"), "{scored}");
    assert!(!scored.contains("Measurements of each sensor"), "{scored}");
    let (_, lengths) = scored
        .split_once("Length of the horizontal position error")
        .unwrap_or_else(|| panic!("{scored}"));
    let title = lengths.lines().nth(1).unwrap_or_default();
    assert!(
        ["RMS", "median", "95 %", "max"].iter().all(|column| title.contains(column)),
        "{scored}"
    );
}

#[test]
fn a_campaign_is_the_same_file_for_any_number_of_threads() {
    let w = Workspace::new("command-montecarlo");
    let campaign = |out: &str, threads: &str, seed: &str| {
        let ran = w.fusion(&["montecarlo", "-n", "3", "--threads", threads, "--seed", seed, "--out", out]);
        shows(ran.success().stdout(narrow()), &["3 runs", "NEES position"]);
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
fn a_campaign_tells_what_half_of_its_runs_say() {
    let w = Workspace::new("command-campaign-findings");
    let of = |design: &str| {
        let file = format!("{}/configs/{design}.toml", env!("CARGO_MANIFEST_DIR"));
        squeezed(&stdout(&w.fusion(&["montecarlo", &file, "-n", "4"]).success())).join(" ")
    };
    let told = of("ins-gps-outlier");
    for part in [
        "Said by the run in the middle, `fusion run … --seed",
        "declare its `bias`",
        "(4 of 4 runs).",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    // A finding that one run in twenty has by chance is not reported.
    assert!(!of("ins-gps").contains("Look at next"));
}

#[test]
fn runs_that_repeat_each_other_are_not_taken_for_independent_ones() {
    let w = Workspace::new("command-repeats");
    let ran = w.fusion(&["montecarlo", "design.toml", "-n", "3"]).success();
    ran.stderr(contains(
        "nothing in this design is random: all 3 runs are the same, and count as one",
    ));
    let noisy = w.read("design.toml") + "[source.gnss.fault.hum]\ntype = \"noise\"\nsigma = \"1 m\"\nchannel = \"position\"\n";
    w.write("noisy.toml", noisy);
    let ran = w.fusion(&["montecarlo", "noisy.toml", "-n", "3"]).success();
    ran.stderr(contains("the runs share one recorded log and differ by their random faults alone"));
}

#[test]
fn parameters_are_scored_against_the_truth_that_the_simulation_drew() {
    let w = Workspace::new("command-drawn");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    let estimated = "sensor.position.lever_arm={ estimate = true, initial = [0.3, 0, -1], sigma = \"20 cm\" }";
    let args = ["montecarlo", design, "-n", "4", "--out", "out", "--set", estimated];
    let drawn = w.fusion(&args).success();
    let drawn = shows(drawn, &["NEES gyro_bias", "position.lever_arm x [m]"]);
    let judged = |text: &str| squeezed(text).iter().any(|line| line.starts_with("NEES position.lever_arm "));
    assert!(judged(&stdout(&drawn)));
    let mut runs = csv::Reader::from_path(w.path("out/runs.csv")).unwrap();
    let header = runs.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (error, sigma) = (column("position.lever_arm_error_1"), column("position.lever_arm_sigma_1"));
    let rows: Vec<csv::StringRecord> = runs.records().map(Result::unwrap).collect();
    let number = |row: &csv::StringRecord, k: usize| row[k].parse::<f64>().unwrap();
    // Each run draws its own truth. A correct filter ends within 4σ of it.
    assert!(rows.windows(2).all(|w| number(&w[0], error) != number(&w[1], error)));
    assert!(rows.iter().all(|r| number(r, error).abs() < 4.0 * number(r, sigma)), "{rows:?}");
    // A parameter that was not drawn has its initial value as truth, which proves nothing about the covariance.
    let fixed = w
        .fusion(&[&args[..], &["--set", "simulation.draw_parameters=false"]].concat())
        .success();
    assert!(!judged(&stdout(&fixed.stdout(has("NEES gyro_bias")))));
}

#[test]
fn every_row_is_in_exactly_one_count() {
    let w = Workspace::new("command-counts");
    let faults = "
        [source.gnss.fault]
        wrong = { type = 'spike', channel = 'position', window = { from = 20, to = 22 }, value = [0, 500, 0] }
        early = { type = 'not_a_number', window = { from = 5, to = 7 } }
        broken = { type = 'not_a_number', window = { from = 30, to = 33 } }
        slow = { type = 'late', by = '2.5 s', window = { from = 40, to = 40.5 } }";
    let design = w.read("design.toml").replace("[run]", "[run]\nstart = 5\nstop = 50") + faults;
    w.write("design.toml", design);
    let ran = w.fusion(&["run", "design.toml", "--verbose", "--out", "results"]).success();
    let summary: Value = serde_json::from_str(&w.read("results/summary.json")).unwrap();
    // 60 fixes, one per second from 0 s. The fix at 7 s is the first with numbers and starts the filter. The fix at 40
    // s arrives at 42.5 s.
    let common = [("rows", 60), ("before_run", 5), ("after_run", 9)];
    let initialiser = [("used", 1), ("not_finite", 2), ("not_needed", 43)];
    let sensor = [("used", 37), ("late", 1), ("rejected", 2), ("before_start", 3), ("not_finite", 3)];
    let consumers = summary["consumers"].as_array().unwrap();
    // The initialiser reads position and velocity.
    assert_eq!(consumers.len(), 3, "{consumers:?}");
    for (counts, expected) in consumers.iter().zip([&initialiser[..], &initialiser, &sensor]) {
        for (count, value) in common.iter().chain(expected) {
            assert_eq!(counts[count], *value, "{count} of {counts}");
        }
        let numbers: Vec<u64> = counts.as_object().unwrap().values().filter_map(Value::as_u64).collect();
        assert_eq!(
            numbers.iter().sum::<u64>(),
            2 * 60,
            "the rows, and all that became of them: {counts}"
        );
    }
    shows(
        ran,
        &[
            // Long headers are wrapped between words.
            "consumer stream rows before the after the run before the late not finite",
            "run start",
            "initial.fix gnss 60 5 9 2",
            "gnss gnss 60 5 9 3 1 3",
        ],
    );
}

#[test]
fn a_recorded_design_runs_and_is_reproduced() {
    let w = Workspace::new("command-recorded");
    let [first, second] = [(); 2].map(|()| w.fusion(&["run", "design.toml", "--verbose"]).success().stderr(""));
    let without_times = |text: &str| {
        squeezed(text)
            .into_iter()
            .filter(|l| !l.starts_with("time taken") && !l.starts_with("filter, per epoch"))
            .collect::<Vec<_>>()
    };
    assert_eq!(without_times(&stdout(&first)), without_times(&stdout(&second)));
    let parts = ["gnss 60 60 59.0 1.000", "body / single / joseph", "Nothing written"];
    let first = shows(first, &parts);
    assert!(!stdout(&first).contains('\u{1b}'), "no colour in a pipe");
}

/// The tables of the terminal, the report and JSON come from the same tree.
#[test]
fn text_json_and_html_show_the_same_numbers() {
    let w = Workspace::new("command-format");
    let text = stdout(&w.fusion(&["run", "design.toml", "--verbose", "--out", "out"]).success());
    let ran = w.fusion(&["run", "design.toml", "--format", "json"]).success().stderr("");
    let page = page(&ran);
    assert_eq!(page["title"], "Constant velocity with GNSS");
    let innovations = table(&page, "Innovations of accepted measurements");
    let row = &innovations["rows"][0];
    assert_eq!((&row["unit"], &row["cells"][0]), (&"m".into(), &"gnss north".into()));
    let summary: Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let rms = row["cells"][1].as_f64().unwrap();
    // 1e-12: the number is written as decimal text and read again.
    assert!((rms - summary["sensors"][0]["innovations"]["rms"][0].as_f64().unwrap()).abs() < 1e-12 * rms);
    let shown = format!("{rms:.3}");
    assert!(
        squeezed(&text).iter().any(|l| l.starts_with(&format!("gnss north [m] {shown} "))),
        "{shown} in {text}"
    );
    let cell = format!("gnss north [m]</th><td>{shown}</td>");
    assert!(w.read("out/report.html").contains(&cell), "{cell}");
    let verdict = table(&page, "Consistency")["rows"][0]["cells"][5].clone();
    assert!(text.contains(verdict.as_str().unwrap()), "{verdict} in {text}");
}

#[test]
fn files_have_the_documented_columns() {
    let w = Workspace::new("command-files");
    let ran = w.fusion(&["run", "design.toml", "--out", "deep/results"]);
    ran.success().stdout(has("deep/results/estimates.csv"));
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
fn a_name_with_a_comma_is_one_cell_of_every_file() {
    let w = Workspace::new("command-comma");
    let design = w.read("design.toml").replace("[sensor.gnss]", "[sensor.\"gnss, roof\"]");
    w.write("design.toml", design);
    w.fusion(&["run", "design.toml", "--out", "results"]).success();
    w.fusion(&["montecarlo", "design.toml", "-n", "2", "--out", "results"]).success();
    let table = |file: &str| {
        // This reader accepts only rows with the width of the header.
        let mut reader = csv::Reader::from_path(w.path(file)).unwrap();
        let header = reader.headers().unwrap().clone();
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        (header, rows)
    };
    let (header, rows) = table("results/updates.csv");
    assert_eq!(&header[1], "sensor");
    assert!(rows.len() > 50 && rows.iter().all(|row| &row[1] == "gnss, roof"));
    let (header, rows) = table("results/runs.csv");
    let counted = header.iter().position(|name| name == "gnss, roof_accepted").unwrap();
    assert!(rows.len() == 2 && rows.iter().all(|row| row[counted].parse::<u64>().is_ok_and(|n| n > 50)));
}

#[test]
fn results_that_cannot_be_written_are_told() {
    let w = Workspace::new("command-unwritable");
    w.write("results", "a file");
    let ran = w.fusion(&["run", "design.toml", "--out", "results"]);
    ran.code(2).stderr(contains("cannot write results"));
}

#[test]
fn an_override_changes_the_run_and_comes_after_the_variants() {
    let w = Workspace::new("command-set");
    w.fusion(&["run", "design.toml", "--verbose", "--variant", "ekf"])
        .stdout(has("additive_euler / single / joseph"));
    w.fusion(&[
        "run",
        "design.toml",
        "--verbose",
        "--set",
        "filter.backend=error_state",
        "--variant",
        "ekf",
    ])
    .success()
    .stdout(has("body / single / joseph"));
    w.fusion(&["run", "design.toml", "--verbose", "--set", "sensor.gnss.noise.sigma=1 cm"])
        .stdout(has("overconfident"));
}

#[test]
fn a_run_takes_a_backend_as_compare_does() {
    let w = Workspace::new("command-backend");
    w.fusion(&["run", "design.toml", "--verbose", "--backend", "ekf+iterated"])
        .success()
        .stdout(has("additive_euler / iterated / joseph"));
    let ran = w.fusion(&["run", "design.toml", "--backend", "iterrated"]);
    ran.code(2).stderr(contains("did you mean `iterated`?"));
    let ran = w.fusion(&["compare", "design.toml", "-n", "2", "--out", "results"]);
    ran.code(2).stderr(contains("'-n <N>'"));
}

#[test]
fn data_may_lie_elsewhere() {
    let w = Workspace::new("command-data");
    std::fs::create_dir(w.path("logs")).unwrap();
    std::fs::rename(w.path("gnss.csv"), w.path("logs/gnss.csv")).unwrap();
    w.fusion(&["run", "design.toml"]).code(2);
    w.fusion(&["run", "design.toml", "--data", "logs"]).success();
}

#[test]
fn a_filter_that_never_starts_is_a_warning() {
    let w = Workspace::new("command-never");
    let ran = w.fusion(&["run", "design.toml", "--set", "run.start=1000 s"]);
    let ran = ran.success().stdout(has("started never"));
    snapshot("never_started", &stderr(&ran));
}

#[test]
fn a_detector_that_never_holds_is_told_with_what_it_missed() {
    let w = Workspace::new("command-detector");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let narrow = "stage.standing.still.accel_std=0.005 m/s^2";
    let missed = "of `standing` the quietest window has";
    w.fusion(&["run", "mine.toml", "--set", narrow])
        .success()
        .stderr(contains(missed).and(contains("where `still.accel_std` allows 0.0050")));
    w.fusion(&["run", "mine.toml"]).success().stderr(contains(missed).not());
}

#[test]
fn a_truth_beside_what_the_filter_believes_is_told_its_place() {
    let w = Workspace::new("command-truth");
    w.fusion(&["run", "design.toml", "--set", "sensor.gnss.truth.lever_arm=[1, 0, 0]"])
        .code(2)
        .stderr(contains("`[simulation.sensor.NAME]`").and(contains("unknown field").not()));
}

#[test]
fn rows_left_out_are_told_with_their_reason() {
    let w = Workspace::new("command-left-out");
    w.write("gnss.csv", fixes().replace("\n7.0,", "\nseven,"));
    let ran = w.fusion(&["run", "design.toml", "--verbose", "--set", "source.gnss.bad_rows=skip"]);
    let parts = ["gnss 60 59 59.0", "gnss: left out 1:", "line 9: `seven` in column `t`"];
    shows(ran.success(), &parts);
}

#[test]
fn a_design_is_checked_without_being_run() {
    let w = Workspace::new("command-check");
    let check = || w.fusion(&["check", "design.toml"]);
    snapshot("check", &stdout(&check().success().stderr("").stdout(narrow())));
    std::fs::remove_file(w.path("gnss.csv")).unwrap();
    check().success().stdout(has("gnss csv not found ./gnss.csv"));
    w.write("design.toml", DESIGN.replace("\"gnss_position\"", "\"gnss_positon\""));
    check().code(2);
}

/// Two fixes of the receiver are a kilometre off, but its velocity is always right.
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
        w.fusion(&["run", "design.toml", "--out", "results"]).success().stderr("");
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

    w.fusion(&["check", "design.toml"]).stdout(has("speed only with gnss"));
    w.fusion(&["check", "design.toml", "--set", "sensor.gnss.enabled=false"])
        .stdout(has("speed only with gnss, which is left out: no effect"));
    w.fusion(&["run", "design.toml", "--set", "sensor.gnss.enabled=false", "--out", "alone"])
        .success()
        .stderr("");
    let updates = w.read("alone/updates.csv");
    assert!(updates.contains("speed,accepted") && !updates.contains("rejected"));
}

#[test]
fn a_run_needs_no_row_of_a_source_without_users() {
    let w = Workspace::new("command-unheard");
    let second = "[sensor.second]\ntype = \"gnss_position\"\nsource = \"second\"\nnoise = \"3 m\"\n\n";
    let end = DESIGN.find("[variant.").unwrap();
    let source = DESIGN[DESIGN.find("[source.gnss]").unwrap()..end].replace("gnss", "second");
    w.write("design.toml", format!("{DESIGN}\n{second}{source}"));
    let header = fixes().lines().next().unwrap().to_owned();
    let invalid = fixes().lines().nth(1).unwrap().replacen(",4", ",x4", 1);
    let off = ["--set", "sensor.second.enabled=false"];
    for (file, why) in [
        (header.clone() + "\n", "has no rows"),
        (format!("{header}\n{invalid}\n"), "no row of this file"),
    ] {
        w.write("second.csv", file);
        let skip = ["run", "design.toml", "--set", "source.second.bad_rows=\"skip\""];
        let told = stderr(&w.fusion(&skip).failure());
        assert!(told.contains(why) && told.contains("second.csv"), "{told}");
        w.fusion(&[&skip[..], &off].concat()).success();
    }
    // A file that is not there is a mistake in any case.
    std::fs::remove_file(w.path("second.csv")).unwrap();
    w.fusion(&[&["run", "design.toml"], &off[..]].concat())
        .code(2)
        .stderr(has("second.csv"));
}

#[test]
fn a_file_that_does_not_fit_fails_the_check() {
    let w = Workspace::new("command-check-header");
    w.write("gnss.csv", fixes().replace("vn", "v_north"));
    w.fusion(&["check", "design.toml"]).code(2).stderr(contains("has no column `vn`"));
}

#[test]
fn the_built_in_design_is_checked() {
    let ran = Workspace::new("command-check-default").fusion(&["check"]);
    let parts = ["State, ", "Sensors", "Initialisers", "Streams", "the simulated truth"];
    shows(ran.success().stderr("").stdout(narrow()), &parts);
}

#[test]
fn faults_of_a_simulated_unit_are_checked_and_applied() {
    let w = Workspace::new("command-imu-fault");
    let gap = "{ type = \"outage\", window = { from = \"20 s\", to = \"21 s\" } }";
    let set = format!("simulation.imu.fault={{ gap = {gap} }}");
    let checked = w.fusion(&["check", "--set", &set]).success().stderr("");
    checked.stdout(has("imu gap outage, window (from 20 s, to 21 s)"));
    w.fusion(&["run", "--set", &set, "--out", "results"]).success().stderr("");
    let summary: Value = serde_json::from_str(&w.read("results/summary.json")).unwrap();
    let imu = summary["sources"].as_array().unwrap().iter().find(|s| s["name"] == "imu").unwrap();
    assert_eq!(imu["skipped"][0], serde_json::json!(["withheld by fault gap", 100]));
}

#[test]
fn every_block_is_listed_and_described() {
    let w = Workspace::new("command-blocks");
    let mut list = w.fusion(&["blocks"]).success().stdout(narrow());
    fusion::models::link();
    for r in fusion::models::registry::all() {
        list = list.stdout(has(r.name));
        let one = stdout(&w.fusion(&["blocks", r.name]).success());
        let schema = fusion::schema::block(r);
        for field in schema["properties"].as_object().into_iter().flat_map(|p| p.keys()) {
            assert!(one.contains(&format!("\n  {field}: ")), "`{field}` of `{}`:\n{one}", r.name);
        }
    }
    snapshot("block", &stdout(&w.fusion(&["blocks", "gnss_position"])));
}

/// The examples that `fusion blocks` shows can be copied into a design.
#[test]
fn every_example_shown_is_toml_with_its_type() {
    let w = Workspace::new("command-examples");
    for r in fusion::models::registry::all() {
        let shown = stdout(&w.fusion(&["blocks", r.name]));
        for example in shown.split("\nExample\n").skip(1) {
            // The text of another block with this name begins at the margin.
            let example: Vec<&str> = example.lines().take_while(|l| l.is_empty() || l.starts_with(' ')).collect();
            let example = example.join("\n");
            let design: toml::Table = toml::from_str(&example).unwrap_or_else(|e| panic!("{}: {e}\n{example}", r.name));
            assert!(!design.is_empty());
            let source = design.get("sensor").and_then(|s| s.get("example")?.get("source")?.as_str());
            assert!(
                source != Some("gnss") || r.name.starts_with("gnss"),
                "a receiver measures no {}",
                r.name
            );
        }
    }
}

/// A sensor without its own rows has the stage that times it in its example, and so it runs.
#[test]
fn the_example_of_a_pseudo_measurement_can_be_appended_to_a_design() {
    let w = Workspace::new("command-paste");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    for name in ["zero_velocity", "zero_angular_rate", "nonholonomic"] {
        let shown = stdout(&w.fusion(&["blocks", name]));
        let example = shown.split("\nExample\n").nth(1).unwrap();
        w.write("mine.toml", format!("include = [{design:?}]\n{example}"));
        w.fusion(&["check", "mine.toml"]).success();
    }
}

#[test]
fn an_unknown_block_is_no_dead_end() {
    let ran = Workspace::new("command-unknown-block").fusion(&["blocks", "gnss_positon"]);
    ran.code(2).stderr(contains("did you mean `gnss_position`?"));
}

#[test]
fn tables_that_are_no_block_are_described_from_the_schema() {
    let w = Workspace::new("command-tables");
    let whole = fusion::schema::design();
    for (table, schema) in whole["$defs"]["design"]["properties"].as_object().unwrap() {
        let shown = stdout(&w.fusion(&["blocks", table]).success().stdout(narrow()));
        assert!(shown.contains(&format!("[{table}]\n")), "{shown}");
        for field in schema["properties"].as_object().into_iter().flat_map(|p| p.keys()) {
            assert!(shown.contains(&format!("\n  {field}: ")), "`{field}` of `{table}`:\n{shown}");
        }
    }
    let reference = stdout(&w.fusion(&["blocks", "reference"]));
    assert!(
        reference.contains("\n  lever_arm: ") && reference.contains("the reference's point in body axes"),
        "{reference}"
    );
    w.fusion(&["blocks", "referense"])
        .code(2)
        .stderr(contains("did you mean `reference`?"));
}

#[test]
fn the_schema_is_json() {
    let ran = Workspace::new("command-schema").fusion(&["schema"]).success();
    let schema: Value = serde_json::from_str(&stdout(&ran)).unwrap();
    assert_eq!(schema["properties"]["sensor"]["type"], "object");
}

/// At the time of a fix, a run writes the estimate after the update.
#[test]
fn the_estimate_at_a_fix_is_the_one_after_it_in_file_and_score() {
    let w = Workspace::new("command-posterior");
    // The prior is so wide that only the fix counts: 1σ is 5 m before it, and R's 0.2 m after it.
    let wide = DESIGN
        .replace("position_sigma = \"10 m\"", "position_sigma = \"1 km\"")
        .replace(
            "acceleration_noise = \"0.5 m/s^2/sqrt(Hz)\"",
            "acceleration_noise = \"50 m/s^2/sqrt(Hz)\"",
        )
        .replace("sigma = \"2 m\"", "sigma = \"0.2 m\"")
        + "[reference]\nsource = \"truth\"\n"
        + &DESIGN[DESIGN.find("[source.gnss]").unwrap()..DESIGN.find("[variant").unwrap()].replace("source.gnss", "source.truth");
    w.write("wide.toml", wide);
    w.fusion(&["run", "wide.toml", "--out", "out"]).success();
    let column = |file: &str, name: &str| -> Vec<f64> {
        let text = w.read(file);
        let mut lines = text.lines();
        let at = lines.next().unwrap().split(',').position(|c| c == name).unwrap();
        lines.map(|l| l.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let times = column("out/estimates.csv", "t_s");
    let sigmas = column("out/estimates.csv", "sigma_n_m");
    let fixes = column("out/updates.csv", "t_s");
    assert!(fixes.len() > 50 && fixes.iter().all(|t| times.contains(t)), "{times:?}");
    for (t, sigma) in times.iter().zip(&sigmas).filter(|(t, _)| fixes.contains(t)) {
        assert!((0.1..0.21).contains(sigma), "{sigma} m at {t} s");
    }
    let summary: Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let three_sigma = summary["score"]["position"]["three_sigma"][0].as_f64().unwrap();
    assert!(three_sigma < 3.0 * 0.21, "{three_sigma}");
}

#[test]
fn check_lists_when_the_segments_of_a_trajectory_begin() {
    let w = Workspace::new("command-segments");
    let segments = r#"simulation.trajectory=[{ type = "rest", duration = "9 s" }, { type = "rest", duration = "5 s" }]"#;
    let ran = w.fusion(&["check", "--set", segments]).success();
    shows(ran, &["Trajectory", "1 rest 0 9.000", "2 rest 9.000 14.00"]);
}

#[test]
fn check_without_data_says_how_frames_are_judged() {
    let w = Workspace::new("command-frames");
    let plain = w.fusion(&["check", "design.toml"]).success();
    shows(plain, &["frames not judged: with `--data DIR`"]);
    let declared = stdout(&w.fusion(&["check", "design.toml", "--set", "run.data_dir=logs"]).success());
    assert!(
        squeezed(&declared).join(" ").contains("logs` the recorded channels are compared"),
        "{declared}"
    );
    std::fs::create_dir(w.path("elsewhere")).unwrap();
    let missing = stdout(&w.fusion(&["check", "design.toml", "--data", "elsewhere"]).success());
    assert!(squeezed(&missing).join(" ").contains("gnss.csv` is not there"), "{missing}");
    // One minute northwards without a turn: the velocity can be compared only with the position.
    let named = w.fusion(&["check", "design.toml", "--data", "."]).success();
    assert!(!stdout(&named).contains("with `--data DIR`"), "{}", stdout(&named));
    // The simulated drive has nothing to judge.
    let simulated = w.fusion(&["check"]).success();
    assert!(!stdout(&simulated).contains("not judged"), "{}", stdout(&simulated));
}

#[test]
fn check_warns_of_a_unit_that_the_header_contradicts() {
    let w = Workspace::new("command-units");
    w.write("gnss.csv", fixes().replacen("vn,ve,vd", "vn [km/h],ve [km/h],vd [km/h]", 1));
    let columns = r#"source.gnss.channels.velocity.columns=["vn [km/h]", "ve [km/h]", "vd [km/h]"]"#;
    let ran = w.fusion(&["check", "design.toml", "--set", columns]).success();
    let told = stderr(&ran);
    assert!(
        told.contains("warning[named-unit]: the column `vn [km/h]` is named as in `km/h`"),
        "{told}"
    );
    assert!(told.contains("--> design.toml:36:8"), "{told}");
}
