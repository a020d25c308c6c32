use crate::support::estimate::{UNIX, about, estimate};
use crate::support::{PATIENCE, Topics, column, domain, first, link, output, prefix, receive, wait_until};
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Five seconds.
const IMUS: usize = 1000;
const FIXES: usize = 25;

/// Discovery of Cyclone DDS without multicast: at the first ports of this computer.
const LOCAL: &str = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" multicast=\"false\"/></Interfaces>\
                     <AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>\
                     <Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";

/// `peer.py` with these arguments.
struct Peer {
    process: Child,
    input: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Peer {
    /// Starts it; `None` without Python or its package `cyclonedds`.
    fn start(arguments: &[String]) -> Option<Self> {
        let python = std::env::var("FUSION_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let has_package = Command::new(&python)
            .args(["-c", "import cyclonedds"])
            .stderr(Stdio::null())
            .status();
        if !has_package.is_ok_and(|status| status.success()) {
            println!("skipped: `{python}` has no package `cyclonedds`; `FUSION_PYTHON` may name another Python");
            return None;
        }
        let mut process = Command::new(python)
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peer.py"))
            .args(arguments)
            .env(
                "CYCLONEDDS_URI",
                std::env::var("CYCLONEDDS_URI").unwrap_or_else(|_| LOCAL.to_owned()),
            )
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = process.stdin.take().unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap()).lines();
        Some(Self { process, input, lines })
    }

    fn line(&mut self) -> String {
        self.lines.next().expect("the peer has ended").unwrap()
    }

    fn go(&mut self) {
        self.input.write_all(b"\n").unwrap();
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The numbers that `peer.py` gives to the fields of message `k`.
fn numbers(k: usize, count: usize) -> Vec<f64> {
    (0..count).map(|j| 1000.0 * k as f64 + 0.5 * j as f64).collect()
}

#[test]
fn every_message_of_cyclone_dds_arrives_with_every_field() {
    let prefix = prefix("cyclone");
    let names = |of: &str| ["reliable", "best_effort"].map(|qos| format!("{prefix}/{of}/{qos}"));
    let arguments = [
        "publish".to_owned(),
        domain().to_string(),
        prefix.clone(),
        IMUS.to_string(),
        FIXES.to_string(),
    ];
    let Some(mut peer) = Peer::start(&arguments) else { return };
    let topic = |name: &String, kind: &str| {
        let qos = if name.ends_with("reliable") { "reliable" } else { "sensor_data" };
        format!("{{ topic = \"{name}\", type = \"sensor_msgs/msg/{kind}\", qos = \"{qos}\" }}")
    };
    let topics = names("imu").map(|name| topic(&name, "Imu")).into_iter();
    let topics: Vec<String> = topics.chain(names("fix").map(|name| topic(&name, "NavSatFix"))).collect();
    let mut receiver = link(&format!("domain = {}\ntopics = [{}]", domain(), topics.join(", ")))
        .open()
        .unwrap()
        .receiver;
    assert_eq!(peer.line(), "matched");
    wait_until("discovery", || receiver.status().unwrap().matches("1 publishers").count() == 4);
    // The peer may know these readers before they know its writers.
    std::thread::sleep(Duration::from_millis(500));
    peer.go();
    let mut bytes = Vec::new();
    receive(&mut *receiver, &mut bytes, 2 * (IMUS + FIXES));
    let status = receiver.status().unwrap();
    assert!(!status.contains("lost") && !status.contains("published as"), "{status}");
    peer.go();

    let read = Topics::read("cyclone", &bytes);
    let own = ["stamp", "log_time", "header.stamp", "header.frame_id"];
    for name in names("imu") {
        let table = read.topic(&name);
        assert_eq!(table.rows(), IMUS, "{name}");
        assert_eq!(first(table, "header.frame_id"), "frame 0");
        let numbered: Vec<_> = table.columns.iter().filter(|column| !own.contains(&column.name.as_str())).collect();
        assert_eq!(numbered.len(), 37, "{name}");
        for k in 0..IMUS {
            let row: Vec<f64> = numbered.iter().map(|column| column.values[k]).collect();
            assert_eq!(row, numbers(k, 37), "message {k} of {name}");
            // Nanoseconds of numbers with 53 bits.
            let stamp = column(table, "stamp")[k] - (UNIX + k as f64) * 1e9;
            assert!((stamp - k as f64).abs() <= 256.0, "{stamp} in message {k}");
        }
        let arrivals = column(table, "log_time");
        let seconds = (arrivals[IMUS - 1] - arrivals[0]) * 1e-9;
        assert!(arrivals.is_sorted() && seconds > 4.9, "{seconds} s for 5 s");
    }
    for name in names("fix") {
        let table = read.topic(&name);
        assert_eq!(table.rows(), FIXES, "{name}");
        let covariance: Vec<String> = (0..9).map(|j| format!("position_covariance[{j}]")).collect();
        let fields = ["latitude", "longitude", "altitude"]
            .map(str::to_owned)
            .into_iter()
            .chain(covariance);
        let fields: Vec<&[f64]> = fields.map(|field| column(table, &field)).collect();
        for k in 0..FIXES {
            let row: Vec<f64> = fields.iter().map(|field| field[k]).collect();
            assert_eq!(row, numbers(k, 12), "message {k} of {name}");
            let small = ["status.status", "status.service", "position_covariance_type"].map(|field| column(table, field)[k]);
            let k = k as f64;
            assert_eq!(small, [k % 3.0 - 1.0, 60000.0 + k, k % 4.0], "message {k} of {name}");
        }
    }
}

#[test]
fn cyclone_dds_receives_the_estimates() {
    const COUNT: usize = 20;
    let prefix = prefix("to_cyclone");
    let arguments = ["receive".to_owned(), domain().to_string(), prefix.clone(), COUNT.to_string()];
    let Some(mut peer) = Peer::start(&arguments) else { return };
    let spec = output(&format!("domain = {}\ntopics = \"{prefix}\"\ntf = false", domain()));
    let mut output = spec.open(&about()).unwrap();
    assert_eq!(peer.line(), "matched");
    wait_until("discovery", || output.status().unwrap().matches(": 1 subscribers").count() >= 2);
    std::thread::sleep(Duration::from_millis(500));
    for k in 0..COUNT {
        output.send(&estimate(0.1 * k as f64), None).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    let end = Instant::now() + PATIENCE;
    for topic in ["odometry", "fix"] {
        for k in 0..COUNT {
            assert!(Instant::now() < end, "too late");
            let line: serde_json::Value = serde_json::from_str(&peer.line()).unwrap();
            assert_eq!(line["topic"], topic);
            let message = &line["message"];
            let near = |pointer: &str, value: f64, bound: f64| {
                let found = message.pointer(pointer).and_then(serde_json::Value::as_f64);
                let found = found.unwrap_or_else(|| panic!("no {pointer} in {message}"));
                assert!((found - value).abs() <= bound, "{pointer} is {found}, not {value}");
            };
            near("/header/stamp/sec", UNIX + (0.1 * k as f64).floor(), 0.0);
            // Rounding of the time in seconds.
            near("/header/stamp/nanosec", (k % 10) as f64 * 1e8, 1.0);
            if topic == "fix" {
                assert_eq!(message["header"]["frame_id"], "base_link");
                near("/longitude", 0.2_f64.to_degrees(), 1e-12);
                near("/altitude", 100.0, 0.0);
                near("/position_covariance/4", 1.0, 1e-12);
                near("/position_covariance_type", 3.0, 0.0);
                continue;
            }
            assert_eq!(
                (&message["header"]["frame_id"], &message["child_frame_id"]),
                (&"map".into(), &"base_link".into())
            );
            // The radius of the Earth changes along the way.
            near("/pose/pose/position/y", 0.3 * k as f64, 1e-3);
            let half = 0.5_f64.sqrt();
            // The negative of a quaternion is the same turn.
            let sign = message
                .pointer("/pose/pose/orientation/w")
                .and_then(serde_json::Value::as_f64)
                .unwrap()
                .signum();
            for (axis, value) in [("x", 0.0), ("y", 0.0), ("z", half), ("w", half)] {
                near(&format!("/pose/pose/orientation/{axis}"), sign * value, 1e-12);
            }
            let variances = [4.0, 1.0, 9.0, 0.0, 0.0, 0.0];
            let of_twist = [0.25, 0.5, 0.75, -1.0, -1.0, -1.0];
            for i in 0..6 {
                for j in 0..6 {
                    let at = |of: [f64; 6]| if i == j { of[i] } else { 0.0 };
                    near(&format!("/pose/covariance/{}", 6 * i + j), at(variances), 1e-12);
                    near(&format!("/twist/covariance/{}", 6 * i + j), at(of_twist), 1e-12);
                }
            }
            for (axis, value) in [("x", 3.0), ("y", 0.0), ("z", 0.0)] {
                near(&format!("/twist/twist/linear/{axis}"), value, 1e-12);
                near(&format!("/twist/twist/angular/{axis}"), 0.0, 0.0);
            }
        }
    }
}
