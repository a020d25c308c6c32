use super::real::{real_design, recorded};
use crate::support::{Workspace, has, shows, stderr};
use fusion::run::{Keep, Options, Smoothing, Summary, run};
use fusion::score::Score;
use serde_json::Value;
use std::fs;

/// A run of `configs/real/NAME.toml`, smoothed by all its data; `None` without the data.
fn smoothed_run(name: &str, variants: &[&str], sets: &[&str]) -> Option<Summary> {
    let (design, options) = real_design(name, variants, sets)?;
    let options = Options {
        smooth: Smoothing::Whole(Keep::Memory),
        ..options
    };
    Some(run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}")))
}

/// The largest horizontal error in each outage of `seconds` from each of `starts`, every `every`, of the
/// filter and of what is smoothed.
fn outages(name: &str, starts: &[u32], seconds: u32, every: u32) -> [Vec<f64>; 2] {
    let mut drifts = [Vec::new(), Vec::new()];
    for start in starts {
        let window =
            format!("source.gnss.fault.outage.window={{ from = \"{start} s\", duration = \"{seconds} s\", every = \"{every} s\" }}");
        let summary = smoothed_run(name, &["outages"], &[&window]).unwrap();
        let scores = [summary.score().unwrap(), smoothed(&summary)];
        for (drifts, score) in drifts.iter_mut().zip(scores) {
            drifts.extend(score.drift.iter().map(|d| d.max_horizontal));
        }
        // The same windows.
        let windows = scores.map(|s| s.drift.iter().map(|d| (d.from, d.until)).collect::<Vec<_>>());
        assert_eq!(windows[0], windows[1]);
    }
    drifts
}

fn smoothed(summary: &Summary) -> &Score {
    summary.smoothed().unwrap().score.as_ref().unwrap()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn the_minutes_without_gnss_of_the_car_are_bridged_to_two_metres() {
    if !recorded() {
        return;
    }
    let [filtered, smoothed] = outages("pntos-car", &[300, 360, 420], 60, 180);
    // The filter's own is 6.0 m. Measured 1.70 m; the specification asks for 2.2 m.
    assert!(
        smoothed.len() >= 36 && rms(&smoothed) <= 1.87 && rms(&filtered) > 5.0,
        "{} {smoothed:?}",
        rms(&smoothed)
    );
}

#[test]
fn the_half_minutes_without_gnss_of_the_drive_are_bridged_to_a_metre() {
    if !recorded() {
        return;
    }
    let [filtered, smoothed] = outages("rtklib-drive", &[120, 145, 170], 30, 75);
    // The filter's own is 5.0 m. Measured 0.81 m, and 0.83 m with the height; the specification asks for
    // 1.8 m.
    assert!(
        smoothed.len() >= 15 && rms(&smoothed) <= 0.9 && rms(&filtered) > 4.0,
        "{} {smoothed:?}",
        rms(&smoothed)
    );
}

#[test]
fn smoothed_estimates_are_better_than_those_of_the_filter_and_know_their_errors() {
    // Measured 0.016 m (the specification asks for 0.03 m), 1.29 m, 0.026 m; a tenth above. The filter has
    // 0.037 m, 1.43 m, 0.056 m.
    for (name, bound) in [("rtklib-drive", 0.018), ("pntos-car", 1.42), ("tumvi", 0.029)] {
        let Some(summary) = smoothed_run(name, &[], &[]) else { return };
        let (filtered, smoothed) = (summary.score().unwrap(), smoothed(&summary));
        assert_eq!(filtered.epochs, smoothed.epochs);
        assert!(
            smoothed.horizontal_rms < filtered.horizontal_rms.min(bound),
            "{name}: {}",
            smoothed.horizontal_rms
        );
        assert_eq!(smoothed.nees_undefined, [0; 3]);
    }
}

#[test]
fn estimates_that_no_reference_asks_for_change_no_score() {
    let Some(asked) = smoothed_run("rtklib-drive", &[], &[]) else {
        return;
    };
    let w = Workspace::new("smoothing-asked");
    let (design, options) = real_design("rtklib-drive", &[], &["run.output_rate=1000 Hz"]).unwrap();
    let options = Options {
        smooth: Smoothing::Whole(Keep::Memory),
        out: Some(w.path("out")),
        ..options
    };
    let all = run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    let count = |summary: &Summary| summary.smoothed().unwrap().estimates;
    assert!(
        count(&all) == all.counts().epochs && count(&asked) < all.counts().epochs / 5,
        "{} {}",
        count(&asked),
        all.counts().epochs
    );
    let [all, asked] = [&all, &asked].map(smoothed);
    assert_eq!(
        (all.position, all.velocity, all.nees_position),
        (asked.position, asked.velocity, asked.nees_position)
    );
}

/// Rows of a file as numbers; an empty cell is 0.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let number = |cell: &str| cell.parse().unwrap_or(0.0);
    text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
}

#[test]
fn smoothed_csv_has_the_columns_and_the_epochs_of_estimates_csv() {
    let w = Workspace::new("smoothing-files");
    for (out, smooth) in [("disk", "--smooth"), ("again", "--smooth=disk"), ("memory", "--smooth=memory")] {
        let ran = w.fusion(&["run", "design.toml", "--set", "run.output_rate=0.5", "--out", out, smooth]);
        let written = format!("{out}/smoothed.csv");
        assert!(crate::support::stdout(&ran.success()).contains(&written));
    }
    let (estimates, smoothed) = (w.read("disk/estimates.csv"), w.read("disk/smoothed.csv"));
    assert_eq!(estimates.lines().next(), smoothed.lines().next());
    let (filter, later) = (rows(&estimates), rows(&smoothed));
    assert!(filter.len() == later.len() && filter.len() > 25, "{}", filter.len());
    let header: Vec<&str> = estimates.lines().next().unwrap().split(',').collect();
    let sigma = header.iter().position(|h| *h == "sigma_n_m").unwrap();
    for (filter, later) in filter.iter().zip(&later) {
        assert_eq!(filter[0].to_bits(), later[0].to_bits());
        assert!(later[sigma] <= filter[sigma], "{} {}", later[sigma], filter[sigma]);
    }
    // A log without an origin starts at the first position of the filter, in both files.
    assert!(later[0][sigma] < 0.8 * filter[0][sigma]);
    for out in ["again", "memory"] {
        assert!(w.read(&format!("{out}/smoothed.csv")) == smoothed, "{out}");
    }
    // Nothing else is left.
    let names = |out: &str| {
        let mut names: Vec<_> = fs::read_dir(w.path(out)).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(
        names("disk"),
        ["estimates.csv", "report.html", "smoothed.csv", "summary.json", "updates.csv"]
    );
    // A run that is not smoothed has no such file, and removes that of another.
    w.fusion(&["run", "design.toml", "--out", "disk"]).success();
    assert!(!w.path("disk/smoothed.csv").exists());
}

#[test]
fn the_last_epoch_is_that_of_the_filter() {
    let w = Workspace::new("smoothing-last");
    w.fusion(&["run", "design.toml", "--out", "out", "--smooth"]).success();
    let last = |file: &str| w.read(file).lines().last().unwrap().to_owned();
    assert_eq!(last("out/estimates.csv"), last("out/smoothed.csv"));
}

#[test]
fn a_lag_is_the_whole_log_up_to_then() {
    let w = Workspace::new("smoothing-lag");
    w.fusion(&["run", "design.toml", "--out", "lag", "--set", "run.smooth.lag=7 s"])
        .success();
    let lagged = rows(&w.read("lag/smoothed.csv"));
    for end in [20, 33] {
        let stop = format!("run.stop={end} s");
        w.fusion(&["run", "design.toml", "--out", "whole", "--smooth", "--set", &stop])
            .success();
        let whole = rows(&w.read("whole/smoothed.csv"));
        let at = |rows: &[Vec<f64>]| rows.iter().find(|row| row[0] as i32 == end - 7).cloned().unwrap();
        for (a, b) in at(&lagged).iter().zip(at(&whole)) {
            // 1e-3 of a σ, which is printed to four digits.
            assert!((a - b).abs() <= 1e-3 * b.abs().max(1e-3), "{end}: {a} {b}");
        }
        // By another lag it is another.
        let other = whole.iter().find(|row| row[0] as i32 == end - 2).cloned().unwrap();
        let same = lagged.iter().find(|row| row[0] as i32 == end - 2).cloned().unwrap();
        assert!(other.iter().zip(&same).any(|(a, b)| (a - b).abs() > 1e-3 * b.abs().max(1e-3)));
    }
    let told = stderr(&w.fusion(&["run", "design.toml", "--set", "run.smooth.lag=-1 s"]).code(2));
    assert!(told.contains("lag"), "{told}");
}

#[test]
fn smoothing_on_disk_needs_a_folder_and_in_memory_none() {
    let w = Workspace::new("smoothing-folder");
    let told = stderr(&w.fusion(&["run", "design.toml", "--smooth=disk"]).code(2));
    assert!(
        told.contains("smoothing on disk needs a folder") && told.contains("--out DIR"),
        "{told}"
    );
    w.fusion(&["run", "design.toml", "--smooth"]).success();
    w.fusion(&["run", "design.toml", "--smooth=tape"]).code(2);
}

#[test]
fn a_simulated_run_shows_smoothed_errors_beside_the_others() {
    let w = Workspace::new("smoothing-shown");
    let ran = w.fusion(&["run", "--verbose", "--smooth", "--out", "out"]).success();
    let ran = shows(ran, &["each smoothed by all data", "NEES position, smoothed", "smoothed.csv"]);
    let summary: Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let rms = |score: &Value| score["horizontal_rms"].as_f64().unwrap();
    let (filtered, smoothed) = (&summary["score"], &summary["smoothed"]["score"]);
    assert!(rms(smoothed) < 0.9 * rms(filtered), "{} {}", rms(smoothed), rms(filtered));
    assert_eq!(summary["smoothed"]["lag"], Value::Null);
    assert_eq!(filtered["epochs"], smoothed["epochs"]);
    drop(ran);
    let compared = w.fusion(&["compare", "--variant", "base", "--smooth"]).success();
    shows(compared, &["base, smoothed"]);
    let lag = w.fusion(&["run", "--verbose", "--set", "run.smooth.lag=10 s"]).success();
    lag.stdout(has("each smoothed by data of 10 s after it"));
    let campaign = w.fusion(&["montecarlo", "-n", "2", "--set", "run.smooth.lag=10 s"]);
    campaign.success();
}

/// The drive without an inertial unit for longer than it coasts: the filter stops and starts again.
#[test]
fn a_run_that_stopped_and_started_again_is_smoothed_in_its_pieces() {
    let gap = "source.imu.fault.gap={ type = \"outage\", window = { from = \"250 s\", duration = \"20 s\" } }";
    let sets = [gap, "process.input.longest_gap=5 s"];
    let Some(summary) = smoothed_run("rtklib-drive", &[], &sets) else {
        return;
    };
    let score = smoothed(&summary);
    assert_eq!(score.nees_undefined, [0; 3]);
    let filtered = summary.score().unwrap();
    assert!(filtered.epochs == score.epochs && score.horizontal_rms < filtered.horizontal_rms);
}

#[test]
fn of_a_design_with_a_filter_in_a_stage_the_outer_one_is_smoothed() {
    let Some((design, options)) = real_design("broad", &["cascaded"], &[]) else {
        return;
    };
    let w = Workspace::new("smoothing-nested");
    let options = Options {
        smooth: Smoothing::Whole(Keep::Disk),
        out: Some(w.path("out")),
        ..options
    };
    let summary = run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    let (own, inside) = (smoothed(&summary), &summary.inside()[0]);
    assert!(own.epochs > 1000 && inside.score.epochs > 1000);
    let names = |start: &str| {
        let names = fs::read_dir(w.path("out"))
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.starts_with(start)).count()
    };
    assert_eq!((names("estimates."), names("smoothed")), (2, 1));
}
