use crate::support::estimate::{about, estimate};
use crate::support::{Topics, column, domain, link, output, prefix, wait_until};
use fusion_live::{LinkSpec, Output, Received};
use std::time::{Duration, Instant};

fn topic(name: &str, kind: &str, more: &str) -> String {
    format!(
        "domain = {}\ntopics = [{{ topic = \"{name}\", type = \"{kind}\"{more} }}]",
        domain()
    )
}

/// Estimates below this name.
fn published(prefix: &str) -> Box<dyn Output> {
    let spec = output(&format!("domain = {}\ntopics = \"{prefix}\"\ntf = false", domain()));
    spec.open(&about()).unwrap()
}

#[test]
fn messages_that_are_not_taken_in_time_are_counted() {
    let prefix = prefix("late");
    let odometry = format!("{prefix}/odometry");
    let mut receiver = link(&topic(&odometry, "nav_msgs/msg/Odometry", "")).open().unwrap().receiver;
    let mut output = published(&prefix);
    wait_until("discovery", || {
        receiver.status().unwrap().contains("1 publishers") && output.status().unwrap().contains("odometry: 1 subscribers")
    });
    let (mut bytes, mut sent) = (Vec::new(), 0);
    let mut send = |seconds: f64, sent: &mut u64| {
        output.send(&estimate(seconds), None).unwrap();
        *sent += 1;
    };
    wait_until("the first message", || {
        send(0.0, &mut sent);
        receiver.receive(Duration::from_millis(50), &mut bytes).unwrap() == Received::Bytes
    });
    // These are not taken while they arrive.
    for k in 1..2000 {
        send(0.001 * f64::from(k), &mut sent);
        std::thread::sleep(Duration::from_micros(200));
    }
    // Received, publishers, lost.
    let numbers = |status: &str| -> Vec<u64> { status.split([' ', ',']).filter_map(|word| word.parse().ok()).collect() };
    let (mut received, mut lost) = (0, 0);
    // A message shows how many are missing before it.
    wait_until("a count of all messages", || {
        send(3.0, &mut sent);
        while receiver.receive(Duration::from_millis(100), &mut bytes).unwrap() == Received::Bytes {}
        let status = receiver.status().unwrap();
        (received, lost) = match numbers(&status)[..] {
            [received, 1, lost] => (received, lost),
            _ => panic!("{status}"),
        };
        received + lost == sent
    });
    // DDS tidies up after each 64 messages.
    assert!(
        received <= 512 + 64 + (sent - 2000) && lost > 1000,
        "{received} received, {lost} lost"
    );
    assert_eq!(Topics::read("late", &bytes).topic(&odometry).rows() as u64, received);
}

#[test]
fn a_link_without_messages_waits_as_long_as_it_may() {
    let mut receiver = link(&topic(&prefix("silent"), "sensor_msgs/msg/Imu", "")).open().unwrap().receiver;
    let (begin, mut bytes) = (Instant::now(), Vec::new());
    assert_eq!(receiver.receive(Duration::from_millis(200), &mut bytes).unwrap(), Received::Nothing);
    assert!(begin.elapsed() >= Duration::from_millis(200) && bytes.is_empty());
    assert!(receiver.status().unwrap().ends_with(": 0 messages, 0 publishers"));
}

#[test]
fn a_type_that_is_not_known_needs_its_definition() {
    let read = |text: &str| toml::from_str::<Box<dyn LinkSpec>>(&format!("[ros2]\n{text}"));
    fusion_ros2::link();
    let error = read(&topic("/w", "own_msgs/msg/Wheel", "")).unwrap_err().to_string();
    assert!(error.contains("no definition of `own_msgs/msg/Wheel` is known"), "{error}");
    assert!(
        error.contains("`sensor_msgs/msg/Imu`") && error.contains("`nav_msgs/msg/Odometry`"),
        "{error}"
    );
    for (wrong, part) in [
        (topic("w", "sensor_msgs/msg/Imu", ""), "`w` is not the full name of a topic"),
        (topic("/w", "sensor_msgs/Imu", ""), "`sensor_msgs/Imu` is not a message type"),
        (topic("/w", "sensor_msgs/msg/Imu", ", qos = \"best\""), "unknown variant `best`"),
        ("domain = 233\ntopics = []".to_owned(), "there is no domain 233"),
    ] {
        let error = read(&wrong).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    let opened = link(&topic("/w", "own_msgs/msg/Wheel", ", definition = \"/no/wheel.msg\"")).open();
    let error = opened.err().unwrap().to_string();
    assert!(error.contains("/no/wheel.msg"), "{error}");
}

#[test]
fn a_topic_of_another_type_is_named_in_the_status() {
    let (prefix, path) = (
        prefix("other"),
        std::env::temp_dir().join(format!("fusion-ros2-{}.msg", std::process::id())),
    );
    // A definition of a file has precedence, and may leave out the usual types.
    std::fs::write(&path, "Header header\nstring child\ngeometry_msgs/PoseWithCovariance place\n").unwrap();
    let more = format!(", definition = \"{}\"", path.display());
    let odometry = format!("{prefix}/odometry");
    let mut receiver = link(&topic(&odometry, "nav_msgs/msg/Odometry", &more)).open().unwrap().receiver;
    let other = link(&topic(&odometry, "nav_msgs/msg/Path", "")).open().unwrap().receiver;
    std::fs::remove_file(path).unwrap();
    let mut output = published(&prefix);
    wait_until("discovery", || {
        let named = "0 messages, 1 publishers, published as `nav_msgs/msg/Odometry`";
        other.status().unwrap().contains(named) && output.status().unwrap().contains("odometry: 2 subscribers")
    });
    let mut bytes = Vec::new();
    wait_until("a message", || {
        output.send(&estimate(1.0), None).unwrap();
        receiver.receive(Duration::from_millis(50), &mut bytes).unwrap() == Received::Bytes
    });
    let read = Topics::read("other", &bytes);
    assert_eq!(column(read.topic(&odometry), "place.covariance[0]")[0], 4.0);
}
