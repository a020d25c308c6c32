//! The format under the laws of sources, recognised by `inspect`, and in a run that ends as over the same log as CSV.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::models::registry;
use fusion::source::OpenContext;
use fusion::source::testing::check;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of a test, which is removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("own-format-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn fusion(&self, args: &[&str]) -> Output {
        let ran = Command::new(env!("CARGO_BIN_EXE_own-format"))
            .args(args)
            .current_dir(&self.0)
            .output()
            .unwrap();
        assert!(ran.status.success(), "{args:?}: {}", String::from_utf8_lossy(&ran.stderr));
        ran
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_format_obeys_the_laws_of_sources() {
    own_format::link();
    let folder = Folder::new("laws");
    let rows = "{\"stamp\": 0, \"gyro\": [1, 2, 3]}\n\n{\"gyro\": [4, 5.5, 6], \"stamp\": 10, \"more\": {\"x\": 1}}\n";
    fs::write(folder.0.join("drive.jsonl"), rows).unwrap();
    let own = registry::all().into_iter().find(|r| r.name == "json_lines").unwrap();
    let context = OpenContext {
        data_dir: folder.0.clone(),
        ..OpenContext::default()
    };
    check(own, &context, 2).unwrap();
    registry::refuse_duplicates().unwrap();
}

/// A CSV file as JSON lines, its numbers as they are written.
fn as_json_lines(csv: &Path) {
    let text = fs::read_to_string(csv).unwrap();
    let mut rows = text.lines();
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    let of = |row: &str| {
        let cells = names.iter().zip(row.split(',')).filter(|(_, cell)| !cell.is_empty());
        let fields: Vec<String> = cells.map(|(name, cell)| format!("{name:?}: {cell}")).collect();
        format!("{{{}}}\n", fields.join(", "))
    };
    fs::write(csv.with_extension("jsonl"), rows.map(of).collect::<String>()).unwrap();
}

#[test]
fn a_run_over_json_lines_ends_as_one_over_text_and_inspect_knows_the_format() {
    let folder = Folder::new("run");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/ins-gps.toml");
    folder.fusion(&["record", design, "--out", "log"]);
    let log = folder.0.join("log");
    for entry in fs::read_dir(&log).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "csv") {
            as_json_lines(&path);
        }
    }
    let text = fs::read_to_string(log.join("design.toml")).unwrap();
    let own = text
        .replace("type = \"csv\"", "type = \"json_lines\"")
        .replace(".csv\"", ".jsonl\"");
    fs::write(log.join("own.toml"), own).unwrap();
    folder.fusion(&["run", "log/design.toml", "--out", "csv"]);
    folder.fusion(&["run", "log/own.toml", "--out", "own"]);
    for file in ["estimates.csv", "updates.csv"] {
        let [one, other] = ["csv", "own"].map(|out| fs::read(folder.0.join(out).join(file)).unwrap());
        assert!(one.len() > 10_000 && one == other, "{file}");
    }
    let told = folder.fusion(&["inspect", "log/imu.jsonl", "log/gnss.jsonl", "--write", "first.toml"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    let first = fs::read_to_string(folder.0.join("first.toml")).unwrap();
    assert!(first.contains("type = \"json_lines\""), "{told}\n{first}");
    folder.fusion(&["check", "first.toml"]);
}

/// The rows of two files as messages of two topics in one file, in the order of their stamps.
fn as_topics(log: &Path, topics: [(&str, &str, &str); 2]) {
    let mut all = Vec::new();
    for (file, topic, message_type) in topics {
        let text = fs::read_to_string(log.join(file)).unwrap();
        for message in text.lines() {
            let stamp: serde_json::Value = serde_json::from_str(message).unwrap();
            let line = format!("{{\"topic\": {topic:?}, \"type\": {message_type:?}, \"message\": {message}}}\n");
            all.push((stamp["time [s]"].as_f64().unwrap(), line));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let lines: String = all.into_iter().map(|(_, line)| line).collect();
    fs::write(log.join("drive.jsonl"), lines).unwrap();
}

#[test]
fn a_file_with_several_streams_is_read_by_topic_and_inspect_knows_the_types() {
    let folder = Folder::new("topics");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/ins-gps.toml");
    folder.fusion(&["record", design, "--out", "log"]);
    let log = folder.0.join("log");
    let topics = [("imu", "/imu/data", "sensor_msgs/Imu"), ("gnss", "/gnss/fix", "own_msgs/Fix")];
    topics
        .iter()
        .for_each(|(name, ..)| as_json_lines(&log.join(name).with_extension("csv")));
    as_topics(
        &log,
        topics.map(|(name, topic, of)| (if name == "imu" { "imu.jsonl" } else { "gnss.jsonl" }, topic, of)),
    );
    let mut own = fs::read_to_string(log.join("design.toml")).unwrap();
    for (name, topic, _) in topics {
        let (table, path) = (format!("[source.{name}]\ntype = \"csv\""), format!("\"{name}.csv\""));
        assert!(own.contains(&table) && own.contains(&path), "{own}");
        own = own.replace(&table, &format!("[source.{name}]\ntype = \"json_lines\"\ntopic = {topic:?}"));
        own = own.replace(&path, "\"drive.jsonl\"");
    }
    fs::write(log.join("own.toml"), &own).unwrap();
    fs::write(log.join("wrong.toml"), own.replace("/gnss/fix", "/fix")).unwrap();
    let wrong = Command::new(env!("CARGO_BIN_EXE_own-format"))
        .args(["run", "wrong.toml"])
        .current_dir(&log)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(
        told.contains("no message of the topic `/fix`") && told.contains("/imu/data, /gnss/fix"),
        "{told}"
    );
    folder.fusion(&["run", "log/design.toml", "--out", "csv"]);
    folder.fusion(&["run", "log/own.toml", "--out", "own"]);
    for file in ["estimates.csv", "updates.csv"] {
        let [one, other] = ["csv", "own"].map(|out| fs::read(folder.0.join(out).join(file)).unwrap());
        assert!(one.len() > 10_000 && one == other, "{file}");
    }
    folder.fusion(&["inspect", "log/drive.jsonl", "--write", "first.toml"]);
    let first = fs::read_to_string(folder.0.join("first.toml")).unwrap();
    for (_, topic, message_type) in topics {
        let line = first.lines().find(|line| line.starts_with(&format!("topic = {topic:?}")));
        assert!(line.is_some_and(|line| line.contains(message_type)), "{first}");
    }
    folder.fusion(&["check", "first.toml"]);
}

#[test]
fn a_line_that_is_no_object_is_told_with_its_place() {
    let folder = Folder::new("broken");
    fs::write(folder.0.join("drive.jsonl"), "{\"stamp\": 0, \"gyro\": [1, 2, 3]}\nlost\n").unwrap();
    own_format::link();
    let own = registry::all().into_iter().find(|r| r.name == "json_lines").unwrap();
    let context = OpenContext {
        data_dir: folder.0.clone(),
        ..OpenContext::default()
    };
    let told = check(own, &context, 2).unwrap_err();
    assert!(told.contains("drive.jsonl:2") && told.contains("no JSON object"), "{told}");
}
