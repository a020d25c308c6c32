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

/// A design whose receiver speaks the own format by the own link, and which sends heights by the own output.
const LIVE: &str = r#"
[process]
type = "constant_velocity"
acceleration_noise = "0.5 m/s^2/sqrt(Hz)"
position_sigma = "10 m"
velocity_sigma = "5 m/s"
[run]
origin = { latitude = "47 deg", longitude = "8 deg" }
[sensor.gnss]
type = "gnss_position"
source = "gnss"
noise = { sigma = "2 m" }
[initial.fix]
type = "first_fix"
source = "gnss"
position_sigma = "5 m"
[initial.rest]
type = "explicit"
velocity = [0, 0, 0]
velocity_sigma = "1 m/s"
[source.gnss]
type = "json_lines"
path = "gnss.jsonl"
time = { column = "t", unit = "s" }
channels.position = { latitude = "lat", longitude = "lon", height = "h", unit = "deg" }
[link.socket]
type = "unix_datagram"
listen = "in.socket"
send_to = "out.socket"
sources = ["gnss"]
[output.height]
type = "height"
link = "socket"
rate = "20 Hz"
"#;

#[cfg(unix)]
#[test]
fn an_own_link_and_an_own_output_run_live_and_their_record_has_the_same_bits() {
    use std::os::unix::net::UnixDatagram;
    use std::time::{Duration, Instant};
    let folder = Folder::new("live");
    fs::write(folder.0.join("live.toml"), LIVE).unwrap();
    let socket = UnixDatagram::bind(folder.0.join("out.socket")).unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    let into = folder.0.join("in.socket");
    let sender = std::thread::spawn(move || {
        let (mut heights, mut buffer) = (Vec::new(), [0; 64]);
        let sender = UnixDatagram::unbound().unwrap();
        let until = Instant::now() + Duration::from_secs(30);
        for k in 0..40 {
            let row = format!("{{\"t\": {k}, \"lat\": 47.0, \"lon\": 8.0, \"h\": 400.0}}\n");
            // The program may need a while to open its socket.
            while sender.send_to(row.as_bytes(), &into).is_err() {
                assert!(Instant::now() < until, "the socket was not opened");
                std::thread::sleep(Duration::from_millis(10));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        while let Ok(count) = socket.recv(&mut buffer) {
            heights.push(String::from_utf8(buffer[..count].to_vec()).unwrap());
        }
        heights
    });
    folder.fusion(&["live", "live.toml", "--for", "3 s", "--record", "in.mcap", "--out", "live"]);
    let heights = sender.join().unwrap();
    assert!(heights.len() > 10, "{heights:?}");
    assert!(heights.last().unwrap().starts_with("400.00 "), "{heights:?}");
    folder.fusion(&["run", "live.toml", "--replay", "in.mcap", "--out", "again"]);
    let read = |name: &str| fs::read_to_string(folder.0.join(name)).unwrap();
    assert_eq!(read("live/estimates.csv"), read("again/estimates.csv"));
    // The head, and an estimate for each of the 40 rows but the first, which starts the filter.
    assert_eq!(read("live/estimates.csv").lines().count(), 40, "a row was lost");
}
