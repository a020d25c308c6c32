//! Runs that are stopped or killed and then resumed: the same files, to the last bit, as without a stop.

use super::real::real_design;
use super::rewind::{designs, rows, shipped};
use super::support::Workspace;
use fusion::core::memory::{Memory, save};
use fusion::core::runner::Halt;
use fusion::core::testing::Lcg;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Checkpoints, Options, Run};
use fusion_present::report::Recording;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Stops a run before a row.
struct Stop {
    at: u64,
    rows: u64,
}

fusion::core::memory!(Stop { rows; at });

impl RunObserver for Stop {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Row(_) = event {
            if self.rows == self.at {
                return Err("stopped".into());
            }
            self.rows += 1;
        }
        Ok(())
    }

    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }
}

/// All files of a folder; summary.json without the values that depend on the clock.
fn files(folder: &Path) -> BTreeMap<PathBuf, String> {
    let read = |path: PathBuf| {
        let mut text = fs::read_to_string(&path).unwrap();
        if path.ends_with("summary.json") {
            // And without the allocated memory.
            let timed = ["wall_seconds", "filter_ns_per_epoch", "longest_seconds", "\"memory\": "];
            let lines = text.lines().filter(|line| !timed.iter().any(|t| line.contains(t)));
            text = lines.collect::<Vec<_>>().join("\n");
        }
        (PathBuf::from(path.file_name().unwrap()), text)
    };
    fs::read_dir(folder).unwrap().map(|f| read(f.unwrap().path())).collect()
}

/// Runs, stops before row `at`, and returns the data that a report would draw.
fn run(design: &Design, options: &Options, at: u64) -> Result<Vec<u8>, String> {
    let run = Run::open(design, options).unwrap_or_else(|d| panic!("{d}"));
    let mut recording = Recording::of(design, run.assembly());
    let mut stop = Stop { at, rows: 0 };
    let finished = run.go(&mut [&mut stop, &mut recording], &mut |_| {}).map_err(|d| d.to_string())?;
    finished.keep().unwrap();
    let mut drawn = Vec::new();
    save(&mut recording, &mut drawn);
    Ok(drawn)
}

/// Stops a run with this number of rows twice, resumes it, and compares all results with a run without a stop.
fn goes_on(name: &str, design: &Design, options: &Options, count: u64) {
    let stem = Path::new(name).file_stem().unwrap().to_str().unwrap();
    let w = Workspace::new(&format!("resumed-{stem}"));
    let to = |out: &str| Options {
        out: Some(w.path(out)),
        data: options.data.clone(),
        base: options.base.clone(),
        ..Options::default()
    };
    let whole = run(design, &to("whole"), u64::MAX).unwrap();
    let file = w.path("checkpoint");
    let saved = |resume: bool| Options {
        checkpoint: Some(Checkpoints {
            file: file.clone(),
            every: Duration::ZERO,
        }),
        resume: resume.then(|| file.clone()),
        ..to("stopped")
    };
    let mut random = Lcg::new(count);
    // The first checkpoint is after 64 rows.
    assert!(count > 200, "{name}: {count} rows");
    let first = count / 3 + (random.unit() * (count / 4) as f64) as u64;
    let second = first + 1 + (random.unit() * (count / 3) as f64) as u64;
    let stopped = |at, resumes| {
        let why = run(design, &saved(resumes), at).unwrap_err();
        assert!(why.contains("stopped"), "{name}: {why}");
        assert_eq!(
            fs::read_dir(w.path("stopped")).unwrap().count(),
            1,
            "{name}: nothing has a name yet"
        );
    };
    stopped(first, false);
    stopped(second, true);
    let drawn = run(design, &saved(true), u64::MAX).unwrap();
    assert!(!file.exists(), "{name}: it is not needed any more");
    let (found, wanted) = (files(&w.path("stopped")), files(&w.path("whole")));
    assert_eq!(found.keys().collect::<Vec<_>>(), wanted.keys().collect::<Vec<_>>(), "{name}");
    for (file, text) in &wanted {
        let differs = text.lines().zip(found[file].lines()).find(|(a, b)| a != b);
        assert_eq!(
            differs,
            None,
            "{name}: line of {} after stops at {first} and {second}",
            file.display()
        );
        assert_eq!(text.len(), found[file].len(), "{name}: {}", file.display());
    }
    assert!(drawn == whole, "{name}: what a report draws");
}

/// With hold order and smoothing with a lag, and with rewinding.
fn obeys(name: &str, read: impl Fn(&[&str]) -> (Design, Options)) {
    let (design, options) = read(&[]);
    let is_steered = design.simulation.as_ref().is_some_and(|s| s.block.world.vehicle.is_some());
    let short: &[&str] = if is_steered { &["simulation.longest=60"] } else { &[] };
    let rows = rows(&read(short).0, &options, 400);
    let stop = format!("run.stop=\"{} s\"", rows.last().unwrap().time.seconds());
    let smooth = if design.filter.bank.is_some() {
        "run.output_rate=5"
    } else {
        "run.smooth={ lag = \"1.5 s\" }"
    };
    let rewind = ["run.order=\"rewind\"", "run.rewind={ horizon = \"3 s\", spacing = \"0.25 s\" }"];
    // The orders alternate over the designs: to open a log, or to write its results, takes longer than the run.
    let orders = [&[smooth][..], &rewind];
    let is_both = name.ends_with("/ins-gps.toml") || name == "pntos-car";
    let turn = Path::new(name).file_stem().map_or(0, |stem| stem.len()) % 2;
    for sets in orders
        .into_iter()
        .enumerate()
        .filter(|(i, _)| is_both || *i == turn)
        .map(|(_, sets)| sets)
    {
        let (design, _) = read(&[short, &[&stop], sets].concat());
        goes_on(name, &design, &options, rows.len() as u64);
    }
}

#[test]
fn every_simulated_design_that_is_stopped_ends_as_without_a_stop() {
    for folder in ["configs", "configs/backends", "configs/published"] {
        for file in designs(folder) {
            obeys(&file.display().to_string(), |sets| shipped(&file, sets));
        }
    }
}

#[test]
fn every_recorded_design_that_is_stopped_ends_as_without_a_stop() {
    for file in designs("configs/real") {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        if real_design(&name, &[], &[]).is_none() {
            return;
        }
        obeys(&name, |sets| real_design(&name, &[], sets).unwrap());
    }
}

fn fusion(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("fusion"));
    let design = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps-outlier.toml");
    command.arg("run").arg(design).args(args).current_dir(folder);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// `FUSION_KILLS` gives the number of kills, 6 by default.
#[test]
fn a_run_that_is_killed_again_and_again_ends_as_without_a_stop() {
    let kills = std::env::var("FUSION_KILLS").map_or(6, |n| n.parse().unwrap());
    let w = Workspace::new("killed");
    let began = Instant::now();
    assert!(fusion(&w.path(""), &["--out", "whole"]).status().unwrap().success());
    let usual = began.elapsed().as_secs_f64();
    let (mut random, mut done, mut resumed) = (Lcg::new(11), 0, 0);
    while done < kills {
        let begin = ["--out", "killed", "--checkpoint", "saved", "--every", "20 ms"];
        let go_on = [&begin[..], &["--resume", "saved"]].concat();
        let args = if w.path("saved").exists() { &go_on } else { &begin[..] };
        resumed += u64::from(args.len() > begin.len());
        let mut child = fusion(&w.path(""), args).spawn().unwrap();
        std::thread::sleep(Duration::from_secs_f64(usual * (0.1 + 0.5 * random.unit())));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{}", std::io::read_to_string(child.stderr.unwrap()).unwrap());
            compare(&w);
            fs::remove_dir_all(w.path("killed")).unwrap();
        } else {
            // SIGKILL.
            child.kill().unwrap();
            child.wait().unwrap();
            done += 1;
        }
    }
    assert!(resumed > 0 && w.path("saved").exists(), "{resumed}");
    let end = fusion(&w.path(""), &["--out", "killed", "--resume", "saved"]).output().unwrap();
    assert!(end.status.success(), "{}", String::from_utf8_lossy(&end.stderr));
    compare(&w);
}

fn compare(w: &Workspace) {
    let [killed, whole] = ["killed", "whole"].map(|folder| files(&w.path(folder)));
    assert_eq!(killed.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    // report.html contains the duration of the run.
    for name in ["estimates.csv", "updates.csv", "summary.json"] {
        assert!(killed[Path::new(name)] == whole[Path::new(name)], "{name}");
    }
}

#[test]
fn what_cannot_be_gone_on_with_is_told_and_stays_as_it_is() {
    let w = Workspace::new("refused");
    let run = |args: &[&str]| {
        let output = fusion(&w.path(""), args).output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    let saved = ["--out", "out", "--checkpoint", "saved", "--every", "0 s"];
    let mut child = fusion(&w.path(""), &saved).spawn().unwrap();
    while !w.path("saved").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = || {
        let partial = w.path("out/.fusion-partial");
        (fs::read(w.path("saved")).unwrap(), fs::read(partial.join("estimates.csv")).unwrap())
    };
    let before = kept();
    let told = |args: &[&str], what: &str| {
        let (success, why) = run(args);
        assert!(!success && why.contains(what), "{args:?}: {why}");
        assert!(kept() == before, "{args:?}");
    };
    told(&saved, "continue it with `--resume saved`");
    fs::write(w.path("other"), "of another run").unwrap();
    let to_other = ["--out", "out", "--resume", "saved", "--checkpoint", "other"];
    told(&to_other, "continue it with `--resume other`");
    told(&["--out", "out", "--resume", "saved", "--seed", "5"], "saved is of another run");
    told(&["--out", "out", "--resume", "nothing"], "cannot continue with nothing");
    told(&["--out", "out", "--resume", "saved", "--smooth"], "cannot be saved");
    told(&["--out", "out", "--every", "1 s"], "--checkpoint");
    told(&["--out", "out", "--checkpoint", "x", "--every", "1 m"], "a time is wanted");
    fs::write(w.path("half"), &before.0[..before.0.len() / 2]).unwrap();
    told(&["--out", "out", "--resume", "half"], "not written to its end");
    assert!(run(&["--out", "out", "--resume", "saved"]).0);
}
