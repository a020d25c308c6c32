use crate::support::{DESIGN, Workspace, fixes, has, stderr};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const RUN: [&str; 4] = ["run", "design.toml", "--out", "out"];
const FILES: [&str; 4] = ["estimates.csv", "updates.csv", "summary.json", "report.html"];

/// Starts the command in `w`. Its output is not read.
fn start(w: &Workspace, args: &[&str]) -> Child {
    Command::new(assert_cmd::cargo::cargo_bin!("fusion"))
        .args(args)
        .current_dir(w.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn fifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// Waits up to a minute until a condition holds, because the machine may be busy.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "still not: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn ended(mut child: Child) -> ExitStatus {
    until("the process has ended", || child.try_wait().unwrap().is_some());
    child.wait().unwrap()
}

fn signal(child: &Child, name: &str) {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", name, &pid]).status().unwrap().success());
}

/// All regular files of a folder, by name. A device would never end.
fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let bytes = |e: &fs::DirEntry| {
        if e.file_type().unwrap().is_file() {
            fs::read(e.path()).unwrap()
        } else {
            Vec::new()
        }
    };
    let mut files: Vec<_> = entries.map(|e| (e.file_name().to_string_lossy().into_owned(), bytes(&e))).collect();
    files.sort();
    files
}

/// The files of a finished run, and a second run on other fixes that has written half of its files. It waits for the
/// rest at a pipe, without end.
fn half_done(w: &Workspace) -> (Vec<(String, Vec<u8>)>, Child, fs::File) {
    half_done_as(w, &RUN)
}

fn half_done_as(w: &Workspace, args: &[&str]) -> (Vec<(String, Vec<u8>)>, Child, fs::File) {
    w.fusion(args).success();
    let before = content(&w.path("out"));
    fs::remove_file(w.path("gnss.csv")).unwrap();
    fifo(&w.path("gnss.csv"));
    let child = start(w, args);
    let mut pipe = OpenOptions::new().write(true).open(w.path("gnss.csv")).unwrap();
    let rows = |t: i32| format!("{t}.0,47.0,8.0,400.0,0.0,0.0,0.0\n");
    let text: String = (0..2000).map(rows).collect();
    write!(pipe, "t,lat,lon,h,vn,ve,vd\n{text}").unwrap();
    // 8 KiB are buffered; some 2000 rows are 600 KiB.
    let partial = w.path("out/.fusion-partial/estimates.csv");
    until("half of the estimates are written", || {
        fs::metadata(&partial).is_ok_and(|m| m.len() > 100_000)
    });
    (before, child, pipe)
}

#[test]
fn a_stopped_run_leaves_the_files_of_the_one_before() {
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let w = Workspace::new(&format!("files-stopped-{name}"));
        let (before, child, _pipe) = half_done(&w);
        signal(&child, name);
        assert_eq!(ended(child).code(), Some(code));
        assert_eq!(content(&w.path("out")), before, "{name}");
    }
}

#[test]
fn a_smoothed_run_that_is_stopped_leaves_nothing_of_what_it_kept() {
    let w = Workspace::new("files-smoothed");
    let (before, child, _pipe) = half_done_as(&w, &["run", "design.toml", "--out", "out", "--smooth"]);
    assert!(before.iter().any(|(name, _)| name == "smoothed.csv"));
    assert!(w.path("out/.fusion-partial/steps").exists());
    signal(&child, "TERM");
    assert_eq!(ended(child).code(), Some(143));
    assert_eq!(content(&w.path("out")), before);
}

#[test]
fn a_killed_run_leaves_the_files_of_the_one_before_and_the_next_one_tidies_up() {
    let w = Workspace::new("files-killed");
    let (before, child, _pipe) = half_done(&w);
    signal(&child, "KILL");
    assert_eq!(ended(child).signal(), Some(9));
    let named = |w: &Workspace| content(&w.path("out")).into_iter().filter(|(name, _)| name != ".fusion-partial");
    assert_eq!(named(&w).collect::<Vec<_>>(), before);
    fs::remove_file(w.path("gnss.csv")).unwrap();
    w.write("gnss.csv", fixes());
    w.fusion(&RUN).success();
    let names: Vec<String> = content(&w.path("out")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["estimates.csv", "report.html", "summary.json", "updates.csv"]);
    assert_eq!(fs::read(w.path("out/estimates.csv")).unwrap(), before[0].1, "the same run again");
}

#[test]
fn campaigns_and_comparisons_are_stopped_too() {
    let campaign = vec!["montecarlo", "-n", "1000000", "--out", "out"];
    // One variant many times: a comparison that takes minutes.
    let variants = ["base"; 2000].join(",");
    let comparison = vec!["compare", "--variant", &variants, "--out", "out"];
    for args in [campaign, comparison] {
        let w = Workspace::new(&format!("files-stopped-{}", args[0]));
        let child = start(&w, &args);
        until("the folder is there", || w.path("out/.fusion-partial").exists());
        signal(&child, "TERM");
        assert_eq!(ended(child).code(), Some(143));
        assert_eq!(content(&w.path("out")), []);
    }
}

#[test]
fn two_runs_do_not_write_into_one_folder() {
    let w = Workspace::new("files-locked");
    let (before, child, _pipe) = half_done(&w);
    let ran = w.fusion(&["compare", "--out", "out"]).code(2);
    assert!(
        stderr(&ran).contains("cannot write out: another run is writing there"),
        "{}",
        stderr(&ran)
    );
    signal(&child, "INT");
    ended(child);
    assert_eq!(content(&w.path("out")), before);
}

/// /dev/full accepts no byte.
#[cfg(target_os = "linux")]
#[test]
fn a_file_that_cannot_be_written_is_named_and_the_others_stay_as_they_were() {
    let run = ["run", "design.toml", "--variant", "ekf", "--out", "out"];
    let compare = ["compare", "design.toml", "--variant", "base,ekf", "--out", "out"];
    let montecarlo = ["montecarlo", "design.toml", "-n", "2", "--out", "out"];
    let cases = FILES.map(|file| (file, &run[..]));
    for (file, args) in cases.into_iter().chain([("report.html", &compare[..]), ("runs.csv", &montecarlo)]) {
        let w = Workspace::new(&format!("files-full-{}-{file}", args[0]));
        w.fusion(&RUN).success();
        let _ = fs::remove_file(w.path("out").join(file));
        symlink("/dev/full", w.path("out").join(file)).unwrap();
        let others = || {
            content(&w.path("out"))
                .into_iter()
                .filter(|(name, _)| name != file)
                .collect::<Vec<_>>()
        };
        let before = others();
        let told = stderr(&w.fusion(args).code(2));
        assert!(
            told.contains(&format!("cannot write out/{file}: No space left on device")),
            "{told}"
        );
        assert!(others() == before, "{file} of {}", args[0]);
    }
}

/// A limit on the file size acts like a disk that becomes full during a run.
#[test]
fn a_disk_that_becomes_full_is_told_with_the_name_of_the_file() {
    let w = Workspace::new("files-limit");
    let fusion = assert_cmd::cargo::cargo_bin!("fusion");
    // The unit is 512 or 1024 bytes, depending on the shell.
    for (limit, file) in [(4, "estimates.csv"), (100, "report.html")] {
        let script = format!("trap '' XFSZ; ulimit -f {limit}; exec \"$0\" run design.toml --out out");
        let mut shell = Command::new("sh");
        let ran = shell.args(["-c", &script]).arg(fusion).current_dir(w.path("")).output().unwrap();
        let told = String::from_utf8_lossy(&ran.stderr);
        assert_eq!(ran.status.code(), Some(2), "{told}");
        assert!(told.contains(&format!("cannot write out/{file}: File too large")), "{told}");
        assert_eq!(content(&w.path("out")), []);
    }
}

#[test]
fn a_pipe_is_read_as_the_file_would_be() {
    let w = Workspace::new("files-pipe-in");
    w.fusion(&RUN).success();
    let before = fs::read(w.path("out/estimates.csv")).unwrap();
    fs::remove_file(w.path("gnss.csv")).unwrap();
    fifo(&w.path("gnss.csv"));
    // Checks do not consume the rows.
    w.fusion(&["check", "design.toml"]).success().stdout(has("gnss csv a pipe"));
    let child = start(&w, &RUN);
    let mut pipe = OpenOptions::new().write(true).open(w.path("gnss.csv")).unwrap();
    // Byte by byte at first.
    let text = fixes();
    for byte in text.as_bytes()[..5].chunks(1) {
        pipe.write_all(byte).unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
    pipe.write_all(&text.as_bytes()[5..]).unwrap();
    drop(pipe);
    assert!(ended(child).success());
    assert!(fs::read(w.path("out/estimates.csv")).unwrap() == before);
}

#[test]
fn a_pipe_for_a_result_is_written_while_the_run_goes_on() {
    let w = Workspace::new("files-pipe-out");
    w.fusion(&RUN).success();
    let expected = w.read("out/estimates.csv");
    fs::remove_file(w.path("out/estimates.csv")).unwrap();
    fifo(&w.path("out/estimates.csv"));
    let child = start(&w, &RUN);
    assert_eq!(w.read("out/estimates.csv"), expected);
    assert!(ended(child).success());
    assert!(fs::metadata(w.path("out/estimates.csv")).unwrap().file_type().is_fifo());
    // A pipe instead of the folder is an error, and the command does not wait for it.
    fifo(&w.path("pipe"));
    let ran = w.fusion(&["run", "design.toml", "--out", "pipe"]).code(2);
    assert!(stderr(&ran).contains("cannot write pipe: it is a file, not a folder"));
}

#[test]
fn folders_that_cannot_be_written_are_told_before_the_run() {
    let w = Workspace::new("files-unwritable");
    for sub in ["run", "compare", "montecarlo"] {
        // No user can make folders there, not even root.
        let ran = w.fusion(&[sub, "design.toml", "--out", "/proc/self/results"]).code(2);
        assert!(stderr(&ran).contains("cannot write /proc/self/results: "), "{}", stderr(&ran));
    }
}

#[test]
fn names_may_be_long() {
    let w = Workspace::new("files-names");
    let long = "n".repeat(10_000);
    let design = DESIGN
        .replace("\"Constant velocity with GNSS\"", &format!("\"{long}\""))
        .replace("[sensor.gnss]", &format!("[sensor.{long}]"))
        .replace("source = \"gnss\"", &format!("source = \"{long}\""))
        .replace("[source.gnss", &format!("[source.{long}"))
        .replace("[initial.fix]", &format!("[initial.{long}]"))
        .replace("[variant.ekf]", &format!("[variant.{long}]"));
    w.write("design.toml", &design);
    w.fusion(&RUN).success();
    assert!(w.read("out/updates.csv").contains(&long));
    w.fusion(&["check", "design.toml", "--resolved"]).success();
    w.fusion(&["run", "design.toml", "--format", "json"]).success();
    w.fusion(&["montecarlo", "design.toml", "-n", "2", "--out", "out"]).success();
    let both = format!("base,{long}");
    w.fusion(&["compare", "design.toml", "--variant", &both, "--out", "out"]).success();
    // A file cannot have such a name, and the command reports this.
    let ran = w.fusion(&["run", "design.toml", "--out", &long]).code(2);
    assert!(stderr(&ran).contains("File name too long"), "{}", stderr(&ran));
}
