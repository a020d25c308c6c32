use crate::support::estimate::{UNIX, about, estimate};
use crate::support::{Topics, column, domain, first, link, output, prefix, receive, wait_until};
use fusion::core::health::State;
use std::time::{SystemTime, UNIX_EPOCH};

/// The number of estimates, one each 0.1 s.
const COUNT: usize = 40;

#[test]
fn estimates_that_leave_arrive_with_the_axes_of_ros() {
    let (domain, prefix) = (domain(), prefix("estimates"));
    let topics = [
        (format!("{prefix}/odometry"), "nav_msgs/msg/Odometry"),
        (format!("{prefix}/fix"), "sensor_msgs/msg/NavSatFix"),
        ("/tf".to_owned(), "tf2_msgs/msg/TFMessage"),
        ("/diagnostics".to_owned(), "diagnostic_msgs/msg/DiagnosticArray"),
    ];
    let table = |(topic, kind): &(String, &str)| format!("{{ topic = \"{topic}\", type = \"{kind}\", qos = \"reliable\" }}");
    let tables = topics.iter().map(table).collect::<Vec<_>>().join(", ");
    let link = link(&format!("domain = {domain}\ntopics = [{tables}]"));
    let mut receiver = link.open().unwrap().receiver;
    let output = output(&format!("domain = {domain}\ntopics = \"{prefix}\"\nworld_frame = \"odom\""));
    assert_eq!(output.link(), None);
    let mut output = output.open(&about()).unwrap();
    let of = |status: Option<String>, part: &str| status.unwrap().matches(part).count();
    wait_until("discovery", || {
        of(output.status(), ": 1 subscribers") == 4 && of(receiver.status(), "0 messages, 1 publishers") == 4
    });

    let now = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
    let (began, mut bytes, mut expected) = (now(), Vec::new(), 0);
    for k in 0..COUNT {
        let mut estimate = estimate(0.1 * k as f64);
        // Diagnostics leave at 0 s, 1 s, when the health changes twice, and 1 s after that.
        if k == 15 {
            (estimate.health, estimate.reasons) = (State::Degraded, ["gnss: rejected".to_owned()].into());
        }
        output.send(&estimate, None).unwrap();
        expected += 3 + usize::from([0, 10, 15, 16, 26, 36].contains(&k));
        // One after the other: a reader that is late on a busy computer misses none of the ten that are kept.
        receive(&mut *receiver, &mut bytes, expected);
    }
    let status = receiver.status().unwrap();
    assert!(!status.contains("lost"), "{status}");

    let read = Topics::read("estimates", &bytes);
    let odometry = read.topic(&format!("{prefix}/odometry"));
    let constant = |table, name: &str, value: f64| {
        let found = column(table, name);
        assert_eq!(found.len(), COUNT, "{name}");
        // Rounding of a place on the Earth: 6.4e6 m.
        assert!(found.iter().all(|x| (x - value).abs() < 2e-9), "{name}: {found:?} is not {value}");
    };
    assert_eq!(
        (first(odometry, "header.frame_id"), first(odometry, "child_frame_id")),
        ("odom", "base_link")
    );
    let arrivals = column(odometry, "log_time").iter().map(|nanos| nanos * 1e-9);
    assert!(arrivals.clone().is_sorted() && arrivals.clone().all(|time| began < time && time < now()));
    for k in 0..COUNT {
        // The stamps of a table are numbers with 53 bits: 0.3 µs. The radius of the Earth changes along the way.
        assert!((column(odometry, "stamp")[k] * 1e-9 - (UNIX + 0.1 * k as f64)).abs() < 1e-6);
        let y = column(odometry, "pose.pose.position.y")[k];
        assert!((y - 0.3 * k as f64).abs() < 1e-3, "{y} at {k}");
    }
    // North is y, a heading north is a turn of 90°, and north-east-down variances 1, 4, 9 are 4, 1, 9.
    let half = 0.5_f64.sqrt();
    for (name, value) in [
        ("pose.pose.position.x", 0.0),
        ("pose.covariance[0]", 4.0),
        ("pose.covariance[7]", 1.0),
        ("pose.covariance[14]", 9.0),
        ("twist.twist.linear.x", 3.0),
        ("twist.covariance[0]", 0.25),
        ("twist.covariance[35]", -1.0),
    ] {
        constant(odometry, name, value);
    }
    let fix = read.topic(&format!("{prefix}/fix"));
    constant(fix, "longitude", 0.2_f64.to_degrees());
    constant(fix, "altitude", 100.0);
    // The negative of a quaternion is the same turn.
    let tf = read.topic("/tf");
    for (table, name) in [(odometry, "pose.pose.orientation"), (tf, "transforms[0].transform.rotation")] {
        let [z, w] = ["z", "w"].map(|axis| column(table, &format!("{name}.{axis}")));
        let is_turn = |(z, w): (&f64, &f64)| (z * w - 0.5).abs() < 1e-12 && (z.abs() - half).abs() < 1e-12;
        assert!(z.len() == COUNT && z.iter().zip(w).all(is_turn), "{name}: {z:?} {w:?}");
    }

    // A source reads the link as it reads a bag of the same bytes.
    let (topic, channel) = (
        &topics[0].0,
        "channels.speed = { columns = [\"twist.twist.linear.x\"], unit = \"m/s\" }",
    );
    let [recorded, live] = [None, Some(&bytes[..])].map(|arriving| read.rows(topic, channel, arriving));
    assert!(
        recorded.len() == COUNT && recorded.iter().all(|(_, speed)| *speed == [3.0]),
        "{recorded:?}"
    );
    assert_eq!(live, recorded);

    let diagnostics = read.topic("/diagnostics");
    assert_eq!(column(diagnostics, "status[0].level"), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    // `gnss` is used, `baro` has no measurement.
    assert_eq!(column(diagnostics, "status[1].level"), [0.0; 6]);
    assert_eq!(column(diagnostics, "status[2].level"), [3.0; 6]);
    assert_eq!(first(diagnostics, "status[1].name"), "fusion: gnss");
    assert_eq!(column(diagnostics, "status[1].values[1].value"), [7.0; 6]);
}
