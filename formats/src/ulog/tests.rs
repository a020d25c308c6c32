//! Logs written here, and logs of PX4 as `pyulog` 1.3 reads them.

use super::*;
use crate::testing::{read, read_file, real, survives_damage};

fn message(kind: u8, content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len()).unwrap().to_le_bytes();
    [&length, &[kind][..], content].concat()
}

fn subscription(instance: u8, id: u16, name: &str) -> Vec<u8> {
    message(b'A', &[&[instance], &id.to_le_bytes()[..], name.as_bytes()].concat())
}

/// A message of the format `unit`.
fn unit(id: u16, stamp: u64, x: f32) -> Vec<u8> {
    let mut content = [&id.to_le_bytes()[..], &[7, 0, 0], &stamp.to_le_bytes()].concat();
    for value in [x, x + 1.0, x + 2.0] {
        content.extend(value.to_le_bytes());
    }
    content.extend((-5_i16).to_le_bytes());
    content.extend(b"ab\0d");
    message(b'D', &content)
}

/// The definitions, with the place where data are appended.
fn definitions(appended: u64) -> Vec<u8> {
    let flags = [
        &[0; 8],
        &[u8::from(appended > 0), 0, 0, 0, 0, 0, 0, 0],
        &appended.to_le_bytes()[..],
        &[0; 16],
    ]
    .concat();
    [
        b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec(),
        message(b'B', &flags),
        message(b'F', b"inner:float[3] x;int16_t n;char[4] name;uint8_t[2] _padding0;"),
        message(b'F', b"unit:uint8_t device;uint8_t[2] _padding0;uint64_t timestamp;inner in;"),
        message(b'I', b"\x08char[1] aX"),
        subscription(0, 3, "unit"),
        subscription(1, 9, "unit"),
    ]
    .concat()
}

fn log() -> Vec<u8> {
    [
        definitions(0),
        unit(3, 1000, 0.5),
        unit(9, 1500, -2.0),
        message(b'O', &250_u16.to_le_bytes()),
        unit(3, 2000, 1.5),
        // A message of a newer version.
        message(b'Z', &[0; 10]),
        message(b'S', &SYNC),
        unit(9, 2500, 4.0),
        message(b'O', &50_u16.to_le_bytes()),
    ]
    .concat()
}

#[test]
fn instances_are_topics_and_nested_fields_are_columns() {
    let all = read::<Ulog>("plain.ulg", &log()).unwrap();
    assert_eq!(
        all.columns("unit"),
        ["timestamp", "device", "in.x[0]", "in.x[1]", "in.x[2]", "in.n", "in.name"]
    );
    assert_eq!(all.rows("unit"), ["1000 7 0.5 1.5 2.5 -5 ab", "2000 7 1.5 2.5 3.5 -5 ab"]);
    assert_eq!(all.rows("unit[1]"), ["1500 7 -2 -1 0 -5 ab", "2500 7 4 5 6 -5 ab"]);
    assert_eq!(all.broken, None);
    assert_eq!(all.remarks, ["2 drop-outs of the logger, 0.300 s in all, 0.250 s the longest"]);
}

#[test]
fn a_log_that_is_cut_off_has_all_messages_before_the_cut() {
    let log = [definitions(0), unit(3, 1000, 0.5), unit(3, 2000, 1.5)].concat();
    let all = read::<Ulog>("cut.ulg", &log[..log.len() - 1]).unwrap();
    assert_eq!(all.rows("unit").len(), 1);
    let at = (log.len() - unit(3, 2000, 1.5).len()) as u64;
    assert_eq!(all.broken, Some(Broken::at(at, "the file is cut off within a message")));
}

#[test]
fn reading_resumes_after_a_synchronisation() {
    let damaged = [&[0xff, 0xff, 0, 1, 2][..], &unit(3, 3000, 0.5)[..20]].concat();
    let sound = [message(b'S', &SYNC), unit(3, 4000, 2.5)].concat();
    let log = [definitions(0), unit(3, 1000, 0.5), damaged.clone(), sound].concat();
    let all = read::<Ulog>("damaged.ulg", &log).unwrap();
    assert_eq!(all.rows("unit"), ["1000 7 0.5 1.5 2.5 -5 ab", "4000 7 2.5 3.5 4.5 -5 ab"]);
    let said = all.broken.unwrap().to_string();
    let skipped = damaged.len() + 3 + SYNC.len();
    assert!(
        said.starts_with("a place is damaged") && said.contains(&format!("{skipped} bytes were skipped")),
        "{said}"
    );
    // Without a synchronisation the log ends.
    let log = [definitions(0), unit(3, 1000, 0.5), vec![9, 0, 0, 1], unit(3, 2000, 1.5)].concat();
    let all = read::<Ulog>("lost.ulg", &log).unwrap();
    assert_eq!(all.rows("unit").len(), 1);
    assert!(all.broken.unwrap().message.contains("no synchronisation follows"));
}

#[test]
fn a_message_with_a_wrong_length_is_malformed() {
    let mut short = unit(3, 2000, 1.5);
    short.truncate(short.len() - 6);
    short[0] -= 6;
    let log = [definitions(0), short, unit(3, 3000, 1.5)].concat();
    let all = read::<Ulog>("short.ulg", &log).unwrap();
    assert!(
        all.messages[0].1.as_ref().is_err_and(|why| why.contains("23 bytes")),
        "{:?}",
        all.messages
    );
    assert_eq!(all.rows("unit").len(), 1);
}

#[test]
fn appended_data_follow_the_last_whole_message() {
    let start = [definitions(1), unit(3, 1000, 0.5), unit(3, 2000, 0.5)[..15].to_vec()].concat();
    let start = [definitions(start.len() as u64), start[definitions(1).len()..].to_vec()].concat();
    let all = read::<Ulog>("appended.ulg", &[start, unit(3, 9000, 0.5)].concat()).unwrap();
    assert_eq!(all.rows("unit"), ["1000 7 0.5 1.5 2.5 -5 ab", "9000 7 0.5 1.5 2.5 -5 ab"]);
    assert_eq!(all.broken, None);
}

#[test]
fn formats_that_grow_without_limit_have_no_messages() {
    for fields in ["deep:deep d;", "deep:uint64_t[9] a;deep[9] d;", "deep:uint8_t[99999999999999] a;"] {
        let log = [
            definitions(0),
            message(b'F', fields.as_bytes()),
            subscription(0, 4, "deep"),
            message(b'D', &[4, 0, 0]),
        ]
        .concat();
        let all = read::<Ulog>("deep.ulg", &log).unwrap();
        assert!(all.messages.is_empty() && all.broken.is_some(), "{all:?}");
    }
}

#[test]
fn damaged_logs_are_read_without_a_panic() {
    survives_damage::<Ulog>("mutant.ulg", &[log(), log()[definitions(0).len()..].repeat(5)].concat());
}

#[test]
fn the_names_of_messages_tell_what_they_are() {
    let roles = [
        ("sensor_combined", Role::Measurement),
        ("vehicle_imu", Role::Measurement),
        ("sensor_selection", Role::Other),
        ("vehicle_attitude_groundtruth", Role::Truth),
        ("estimator_attitude", Role::Estimate),
        ("estimator_innovations", Role::Other),
        ("vehicle_attitude_setpoint", Role::Other),
    ];
    for (name, role) in roles {
        assert_eq!(kinds::role(name), role, "{name}");
    }
    assert_eq!(kinds::meaning("sensor_gps", "alt"), Some("alt [mm]"));
    assert_eq!(kinds::meaning("vehicle_local_position", "z"), Some("down [m]"));
    assert_eq!(kinds::meaning("vehicle_attitude", "q[0]"), None);
}

#[test]
fn matches_pyulog_on_real_logs() {
    // The finite numbers of a topic in ULog(FILE).data_list, and the sum of math.asinh(x), which small and large numbers
    // change alike.
    let expected = [
        ("sample_px4_events.ulg", "sensor_combined", 108962, 408938.247423),
        ("sample_px4_events.ulg", "vehicle_attitude", 6842, 46251.777290),
        ("sample_px4_events.ulg", "vehicle_gps_position", 19239, 59414.849174),
        ("sample_px4_events.ulg", "vehicle_local_position", 14417, 36973.649641),
        ("sample_px4_events.ulg", "vehicle_magnetometer", 3213, 39044.676259),
        (
            "sample_logging_tagged_and_default_params.ulg",
            "estimator_states[1]",
            510,
            377.932616,
        ),
        (
            "sample_logging_tagged_and_default_params.ulg",
            "estimator_states[2]",
            510,
            377.788614,
        ),
        (
            "sample_logging_tagged_and_default_params.ulg",
            "sensor_combined",
            26364,
            64755.699507,
        ),
        (
            "sample_logging_tagged_and_default_params.ulg",
            "vehicle_global_position_groundtruth",
            1526,
            2546.382410,
        ),
    ];
    for (name, topic, count, sum) in expected {
        let Some(path) = real(name) else { return };
        let all = read_file::<Ulog>(&path).unwrap();
        assert_eq!(all.broken, None);
        let found = all.sum(topic);
        // 5.1e-7: written to 6 decimals; 1e-12 · |sum|: rounding of 1e5 terms.
        assert!(
            found.0 == count && (found.1 - sum).abs() <= 5.1e-7 + 1e-12 * sum.abs(),
            "{name} {topic}: {found:?}"
        );
    }
}
