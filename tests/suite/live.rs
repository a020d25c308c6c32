//! Live links over loopback: rows in, estimates out, the record and its replay, kills and resumes.

use crate::support::{Workspace, stderr};
use std::fs;
use std::io::Write;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A design whose unit comes by UDP and whose receiver by TCP, and which sends its estimates by UDP.
fn design(imu: u16, gnss: u16, out: u16) -> String {
    let filter = include_str!("../../examples/embed.toml");
    format!(
        r#"{filter}
[run]
order = "rewind"
rewind.horizon = "2 s"

[source.imu]
type = "csv"
path = "imu.csv"
names = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
time.column = "t"
channels.angular_rate = {{ columns = ["gx", "gy", "gz"], unit = "rad/s" }}
channels.specific_force = {{ columns = ["ax", "ay", "az"], unit = "m/s^2" }}

[source.gnss]
type = "csv"
path = "gnss.csv"
time.column = "t"
channels.position.latitude = "lat"
channels.position.longitude = "lon"
channels.position.height = "h"
channels.position.unit = "deg"

[link.unit]
type = "udp"
listen = "127.0.0.1:{imu}"
send_to = "127.0.0.1:{out}"
line_ends = true
sources = ["imu"]

[link.receiver]
type = "tcp"
connect = "127.0.0.1:{gnss}"
sources = ["gnss"]

[output.estimate]
type = "json"
link = "unit"
rate = "50 Hz"
"#
    )
}

/// A port that is free now.
fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Waits for the program to connect.
fn accept(listener: &TcpListener) -> TcpStream {
    listener.set_nonblocking(true).unwrap();
    // It starts within this time on any machine; if it ends with an error, the test does not wait for ever.
    let until = Instant::now() + Duration::from_secs(30);
    loop {
        match listener.accept() {
            Ok((stream, _)) => return stream,
            Err(error) => assert!(Instant::now() < until, "no program connects: {error}"),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until the program listens at a port, as Linux lists it: a datagram that is sent before is lost.
fn listens(port: u16) {
    let entry = format!(":{port:04X} ");
    // As in `accept`.
    let until = Instant::now() + Duration::from_secs(30);
    while fs::read_to_string("/proc/net/udp").is_ok_and(|listed| !listed.contains(&entry)) {
        assert!(Instant::now() < until, "no program listens at port {port}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Seconds of the filter in a second of the test.
const FASTER: f64 = 10.0;

/// The row of the unit at `time`: at rest for 12 s, then it speeds up and turns.
fn imu(time: f64) -> String {
    let (turn, ahead) = if time < 12.0 {
        (0.0, 0.0)
    } else {
        (0.05, 0.3 * (0.5 * time).sin())
    };
    format!("{time:.2},0.0001,-0.0001,{turn},{ahead},0.001,-9.79")
}

/// A fix; one in nine has no height, so that it is a bad row.
fn gnss(time: f64) -> String {
    let moved = if time < 12.0 { 0.0 } else { 1e-6 * (time - 12.0) };
    let height = if (2.0 * time) as u32 % 9 == 4 { "none" } else { "50.0" };
    format!("{time:.2},{:.9},{:.9},{height}\n", 36.1 + moved, 129.5 + 0.3 * moved)
}

/// Sends rows from `from` to `to` seconds: those of the unit as datagrams without line ends, those of the receiver in
/// pieces that end within lines.
fn send(ports: (u16, u16), listener: &TcpListener, from: f64, to: f64) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut receiver = accept(listener);
    listens(ports.0);
    receiver.write_all(b"t,lat,lon,h\n").unwrap();
    let begun = Instant::now();
    for k in (from * 100.0) as u32..(to * 100.0) as u32 {
        let time = f64::from(k) * 0.01;
        let due = Duration::from_secs_f64((time - from) / FASTER);
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        socket.send_to(imu(time).as_bytes(), ("127.0.0.1", ports.0)).unwrap();
        if k % 50 == 0 {
            let row = gnss(time);
            let (first, rest) = row.as_bytes().split_at(9);
            receiver.write_all(first).unwrap();
            std::thread::sleep(Duration::from_millis(1));
            receiver.write_all(rest).unwrap();
        }
    }
    // The last rows arrive before the link closes.
    std::thread::sleep(Duration::from_millis(100));
}

fn start(w: &Workspace, args: &[&str]) -> Child {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("fusion"));
    let command = command.current_dir(w.path(".")).args(args);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Ends it as a service manager does, and returns what it has printed.
fn terminate(child: Child) -> (String, String) {
    Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

/// The files of results that have to be equal.
fn assert_same_results(w: &Workspace, one: &str, other: &str) {
    for file in ["estimates.csv", "current.csv", "updates.csv"] {
        let read = |folder: &str| fs::read_to_string(w.path(folder).join(file)).unwrap();
        let (a, b) = (read(one), read(other));
        let first = a.lines().zip(b.lines()).position(|(a, b)| a != b);
        assert!(a == b, "{file} differs from row {first:?} on: {} and {} bytes", a.len(), b.len());
        assert!(a.lines().count() > 10, "{file} has {} rows", a.lines().count());
    }
    let [a, b] = [one, other].map(|folder| {
        let summary = fs::read_to_string(w.path(folder).join("summary.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&summary).unwrap()["sources"].clone()
    });
    assert_eq!(a, b, "rows of the sources");
}

#[test]
fn a_record_gives_the_estimates_of_the_live_run_to_the_bit_and_estimates_leave_at_their_rate() {
    let w = Workspace::new("live");
    let ports = (free_port(), free_port());
    let listener = TcpListener::bind(("127.0.0.1", ports.1)).unwrap();
    let out = UdpSocket::bind("127.0.0.1:0").unwrap();
    out.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    fs::write(w.path("live.toml"), design(ports.0, ports.1, out.local_addr().unwrap().port())).unwrap();
    let child = start(
        &w,
        &["live", "live.toml", "--record", "in.mcap", "--out", "live", "--status", "1 s"],
    );
    let lines = std::thread::spawn(move || {
        let (mut lines, mut buffer) = (Vec::new(), [0; 4096]);
        // The first line may take as long as the program needs to start.
        out.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        while let Ok(count) = out.recv(&mut buffer) {
            lines.push(String::from_utf8(buffer[..count].to_vec()).unwrap());
            out.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
        }
        lines
    });
    send(ports, &listener, 0.0, 30.0);
    let (shown, told) = terminate(child);
    assert!(shown.contains("estimates.csv"), "{shown}");
    assert!(told.contains("source imu: "), "{told}");
    let lines = lines.join().unwrap();
    // 50 a second for three seconds, on a machine that is busy with other tests.
    assert!(lines.len() > 75, "{} estimates left", lines.len());
    let last: serde_json::Value = serde_json::from_str(lines.last().unwrap()).unwrap();
    assert_eq!(last["health"], "good", "{last}");
    // The vehicle goes north by 1e-6 deg a second.
    assert!((last["latitude"].as_f64().unwrap() - 36.1).abs() < 1e-3, "{last}");
    assert!(last["age"].as_f64().unwrap() < 5.0, "{last}");

    w.fusion(&["run", "live.toml", "--replay", "in.mcap", "--out", "again"]).success();
    assert_same_results(&w, "live", "again");
    // Every row that was sent is in it: none of the sources lost one.
    let summary: serde_json::Value = serde_json::from_str(&fs::read_to_string(w.path("again/summary.json")).unwrap()).unwrap();
    assert_eq!(summary["sources"][0]["used"], 3000, "{}", summary["sources"]);
    assert_eq!(summary["sources"][1]["rows"], 60, "{}", summary["sources"]);

    // A log of the same drive is the reference of the record: here the rows that were sent.
    let sent = (0..60).map(|k| gnss(f64::from(k) * 0.5));
    let truth: String = sent.filter(|row| !row.contains("none")).collect();
    fs::write(w.path("truth.csv"), format!("t,lat,lon,h\n{truth}")).unwrap();
    let text = fs::read_to_string(w.path("live.toml")).unwrap();
    let truth = text
        .split("[source.gnss]")
        .nth(1)
        .unwrap()
        .split("\n\n")
        .next()
        .unwrap()
        .replace("gnss.csv", "truth.csv");
    fs::write(
        w.path("scored.toml"),
        format!("{text}\n[source.truth]{truth}\n\n[reference]\nsource = \"truth\"\n"),
    )
    .unwrap();
    w.fusion(&["run", "scored.toml", "--replay", "in.mcap", "--out", "scored"])
        .success();
    assert_same_results(&w, "live", "scored");
    let summary: serde_json::Value = serde_json::from_str(&fs::read_to_string(w.path("scored/summary.json")).unwrap()).unwrap();
    // The samples and the fixes are not of the same motion. 3σ of a fix is 3 m by axis.
    let rms = summary["score"]["horizontal_rms"].as_f64();
    assert!(rms.is_some_and(|rms| rms < 3.0), "{}", summary["score"]);
}

#[test]
fn a_killed_run_goes_on_and_gives_the_bits_of_its_record() {
    let w = Workspace::new("live-killed");
    let ports = (free_port(), free_port());
    let listener = TcpListener::bind(("127.0.0.1", ports.1)).unwrap();
    fs::write(w.path("live.toml"), design(ports.0, ports.1, free_port())).unwrap();
    let args = [
        "live",
        "live.toml",
        "--record",
        "in.mcap",
        "--out",
        "live",
        "--checkpoint",
        "saved",
        "--every",
        "0.2 s",
    ];
    let mut child = start(&w, &args);
    send(ports, &listener, 0.0, 15.0);
    assert!(w.path("saved").exists(), "no checkpoint was written");
    child.kill().unwrap();
    child.wait().unwrap();
    let recorded = fs::metadata(w.path("in.mcap")).unwrap().len();

    let resumed = [&args[..], &["--resume", "saved"]].concat();
    let child = start(&w, &resumed);
    send(ports, &listener, 15.0, 30.0);
    terminate(child);
    assert!(
        fs::metadata(w.path("in.mcap")).unwrap().len() > recorded,
        "the record ends at the kill"
    );
    w.fusion(&["run", "live.toml", "--replay", "in.mcap", "--out", "again"]).success();
    assert_same_results(&w, "live", "again");
    let summary: serde_json::Value = serde_json::from_str(&fs::read_to_string(w.path("live/summary.json")).unwrap()).unwrap();
    // Of 30 fixes before the kill and 30 after it, seven are bad.
    assert_eq!(summary["sources"][1]["skipped"][0][1], 7, "{}", summary["sources"]);
    let times = fs::read_to_string(w.path("live/estimates.csv")).unwrap();
    let last: f64 = times.lines().last().unwrap().split(',').next().unwrap().parse().unwrap();
    assert!(last > 29.0, "it ends at {last} s");
}

#[test]
fn a_record_is_not_overwritten_and_a_wrong_file_is_no_record() {
    let w = Workspace::new("live-refused");
    fs::write(w.path("live.toml"), design(free_port(), free_port(), free_port())).unwrap();
    fs::write(w.path("in.mcap"), "kept").unwrap();
    let told = stderr(&w.fusion(&["live", "live.toml", "--record", "in.mcap", "--for", "1 s"]).failure());
    assert!(told.contains("a record is not overwritten"), "{told}");
    assert_eq!(fs::read_to_string(w.path("in.mcap")).unwrap(), "kept");
    let told = stderr(&w.fusion(&["run", "live.toml", "--replay", "in.mcap"]).failure());
    assert!(told.contains("in.mcap is not a record of `fusion live`"), "{told}");
}

#[test]
fn a_record_of_other_links_is_refused_and_its_links_are_named() {
    let w = Workspace::new("live-other-links");
    let text = design(free_port(), free_port(), free_port());
    fs::write(w.path("live.toml"), &text).unwrap();
    w.fusion(&["live", "live.toml", "--record", "in.mcap", "--for", "0.2 s"]).success();
    fs::write(w.path("other.toml"), text.replace("[link.receiver]", "[link.gnss]")).unwrap();
    let told = stderr(&w.fusion(&["run", "other.toml", "--replay", "in.mcap"]).failure());
    assert!(
        told.contains("no link `gnss`; it has `unit`, `receiver`") || told.contains("no link `gnss`; it has `receiver`, `unit`"),
        "{told}"
    );
}

#[test]
fn mistakes_in_the_tables_of_links_are_shown_at_their_place() {
    let w = Workspace::new("live-mistakes");
    let text = design(free_port(), free_port(), free_port());
    for (old, new, expected) in [
        ("type = \"tcp\"", "type = \"ros2\"", "built without the link `ros2`"),
        ("type = \"tcp\"", "type = \"tpc\"", "did you mean `tcp`"),
        ("connect = ", "# connect = ", "either `connect` or `listen`"),
        ("rate = \"50 Hz\"", "rate = \"50 Hz\"\nwatchdog = \"0 s\"", "greater than 0"),
        ("rate = \"50 Hz\"", "rate = \"0 Hz\"", "greater than 0"),
    ] {
        let wrong = text.replacen(old, new, 1);
        assert_ne!(wrong, text, "{old}");
        fs::write(w.path("live.toml"), wrong).unwrap();
        let told = stderr(&w.fusion(&["live", "live.toml", "--for", "1 s"]).code(2));
        assert!(told.contains(expected) && told.contains("--> live.toml:"), "{new}: {told}");
    }
}

/// A design with four sources: a unit, a receiver by TCP, its velocity, and a compass.
fn four(ports: [u16; 4], out: u16) -> String {
    let [imu, gnss, velocity, compass] = ports;
    let two = design(imu, gnss, out);
    format!(
        r#"{two}
[sensor.velocity]
type = "gnss_velocity"
source = "doppler"
noise = {{ sigma = "0.5 m/s" }}

[sensor.heading]
type = "heading"
source = "compass"
noise = {{ sigma = "5 deg" }}

[source.doppler]
type = "csv"
path = "doppler.csv"
names = ["t", "n", "e", "d"]
time.column = "t"
channels.velocity = {{ columns = ["n", "e", "d"], unit = "m/s" }}

[source.compass]
type = "csv"
path = "compass.csv"
names = ["t", "h"]
time.column = "t"
channels.heading = {{ columns = ["h"], unit = "deg" }}

[link.doppler]
type = "udp"
listen = "127.0.0.1:{velocity}"
line_ends = true
sources = ["doppler"]

[link.compass]
type = "udp"
listen = "127.0.0.1:{compass}"
line_ends = true
sources = ["compass"]
"#
    )
}

/// Sends the rows of an instrument at rest by UDP until the end, with jitter and drop-outs, and returns their number.
fn at_rest(port: u16, rate: f64, seed: u64, until: Instant, begun: Instant, row: fn(f64) -> String) -> u64 {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut random = fusion::core::testing::Lcg::new(seed);
    let mut count = 0;
    for k in 0_u32.. {
        let time = f64::from(k) / rate;
        // Late by up to half an interval; one row in a thousand begins a silence of up to 50 rows.
        let due = begun + Duration::from_secs_f64(time + 0.5 * random.unit() / rate);
        if due > until {
            break;
        }
        if (k / 50) % 20 == 7 && random.unit() < 0.5 {
            continue;
        }
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        socket.send_to(row(time).as_bytes(), ("127.0.0.1", port)).unwrap();
        count += 1;
    }
    count
}

/// The memory of a process \[kB\].
fn memory(id: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.trim().strip_suffix(" kB")?.trim().parse().ok())
        .unwrap_or(0)
}

/// Runs four senders in real time, with jitter, drop-outs and a link that is cut every `cut`: no row is lost, the memory is
/// flat, the latency is bounded, and the record gives the same bits.
fn soak(name: &str, length: Duration, cut: Duration) {
    let w = Workspace::new(name);
    let ports = [free_port(), free_port(), free_port(), free_port()];
    let listener = TcpListener::bind(("127.0.0.1", ports[1])).unwrap();
    fs::write(w.path("live.toml"), four(ports, free_port())).unwrap();
    let set = "run.output_rate=1 Hz";
    let child = start(
        &w,
        &[
            "live",
            "live.toml",
            "--set",
            set,
            "--record",
            "in.mcap",
            "--out",
            "live",
            "--status",
            "10 s",
        ],
    );
    let id = child.id();
    let first = accept(&listener);
    [ports[0], ports[2], ports[3]].into_iter().for_each(listens);
    let (begun, until) = (Instant::now(), Instant::now() + length);
    let udp = |port, rate, seed, row: fn(f64) -> String| std::thread::spawn(move || at_rest(port, rate, seed, until, begun, row));
    let senders = [
        udp(ports[0], 200.0, 1, |t| format!("{t:.4},0.0001,-0.0001,0,0.001,0.001,-9.79")),
        udp(ports[2], 5.0, 2, |t| format!("{t:.4},0.1,-0.1,0.05")),
        udp(ports[3], 50.0, 3, |t| format!("{t:.4},30")),
    ];
    let receiver = std::thread::spawn(move || {
        let headed = |mut stream: TcpStream| {
            stream.write_all(b"t,lat,lon,h\n").unwrap();
            stream
        };
        let mut stream = Some(headed(first));
        let (mut count, mut cuts, mut next) = (0_u64, 0_u32, begun + cut);
        for k in 0_u32.. {
            let time = f64::from(k) * 0.5;
            let due = begun + Duration::from_secs_f64(time);
            if due > until {
                break;
            }
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            if Instant::now() > next {
                // The link is cut, and is opened again by the program.
                (stream, next, cuts) = (None, next + cut, cuts + 1);
            }
            let mut to = stream.take().unwrap_or_else(|| headed(accept(&listener)));
            to.write_all(format!("{time:.4},36.1,129.5,50\n").as_bytes()).unwrap();
            stream = Some(to);
            count += 1;
        }
        std::thread::sleep(Duration::from_millis(300));
        (count, cuts)
    });
    let mut memories = Vec::new();
    while Instant::now() < until {
        std::thread::sleep(Duration::from_secs(1));
        memories.push(memory(id));
    }
    let sent: Vec<u64> = senders.into_iter().map(|sender| sender.join().unwrap()).collect();
    let (fixes, cuts) = receiver.join().unwrap();
    let (_, told) = terminate(child);
    let last = told
        .lines()
        .rfind(|line| line.starts_with("latency"))
        .unwrap_or_default()
        .to_owned();
    eprintln!(
        "{sent:?} rows and {fixes} fixes, {cuts} cuts; {last}; memory {:?} kB",
        memories.iter().step_by(memories.len().div_ceil(12)).collect::<Vec<_>>()
    );

    w.fusion(&["run", "live.toml", "--set", set, "--replay", "in.mcap", "--out", "again"])
        .success();
    assert_same_results(&w, "live", "again");
    let summary: serde_json::Value = serde_json::from_str(&fs::read_to_string(w.path("again/summary.json")).unwrap()).unwrap();
    let used = |name: &str| {
        let all = summary["sources"].as_array().unwrap();
        all.iter().find(|source| source["name"] == name).unwrap()["used"].as_u64().unwrap()
    };
    let counted = [used("imu"), used("doppler"), used("compass")];
    assert_eq!(counted[..], sent[..], "rows of UDP");
    assert_eq!(used("gnss"), fixes, "rows of TCP");
    // The allocator keeps what it had once: the second half of the time needs no more than a tenth above the first.
    let (early, late) = memories.split_at(memories.len() / 2);
    let most = |part: &[u64]| part.iter().copied().max().unwrap_or(0);
    assert!(most(late) as f64 <= 1.1 * most(early) as f64, "{memories:?}");
}

#[test]
fn four_senders_with_cuts_lose_no_row() {
    soak("live-soak", Duration::from_secs(20), Duration::from_secs(6));
}

/// `FUSION_SOAK=60 cargo test --release --test main live::soak -- --ignored --nocapture`: that many minutes.
#[test]
#[ignore = "as long as FUSION_SOAK says, in minutes"]
fn soak_for_a_long_time() {
    let minutes = std::env::var("FUSION_SOAK")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(1_u64);
    soak("live-long", Duration::from_secs(60 * minutes), Duration::from_secs(60));
}

#[test]
fn the_book_lists_the_registered_links_and_outputs_and_no_others() {
    fusion_live::link_blocks();
    let live = include_str!("../../book/src/live.md");
    for (role, heading) in [
        (fusion::models::registry::Role::Link, "## Links"),
        (fusion::models::registry::Role::Output, "## Outputs"),
    ] {
        let (_, section) = live.split_once(heading).unwrap();
        let (section, _) = section.split_once("\n## ").unwrap();
        let rows = section
            .lines()
            .filter_map(|line| line.strip_prefix("| `"))
            .filter(|row| !row.starts_with("type`"));
        let listed: Vec<(&str, &str)> = rows.map(|row| row.split_once('`').unwrap()).collect();
        let registered = fusion::models::registry::names(role);
        for name in &registered {
            assert!(
                listed.iter().any(|(listed, _)| listed == name),
                "no row of the {} {name}",
                role.name()
            );
        }
        for (name, row) in listed {
            let is_off = row.contains(&format!("feature `{name}`")) && !registered.contains(&name);
            assert!(is_off || registered.contains(&name), "{} {name}", role.name());
        }
    }
}
