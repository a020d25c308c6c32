//! Messages as `pymavlink` 2.4.50 reads them: `by_pymavlink.py` prints the figures.

use super::definition::all;
use super::frame::{V2, checksum, crc};
use super::*;
use crate::messages::{Cells, MessageReader};
use crate::stream::Stream;
use crate::testing::{All, read, survives_damage};
use fusion::source::decode::Cell;
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A frame of MAVLink 2 of this sender.
fn of(sender: (u8, u8), name: &str, fields: &[(&str, f64)]) -> Vec<u8> {
    let from = Sender {
        system: sender.0,
        component: sender.1,
        sequence: 7,
    };
    let fields: Vec<(&str, &[f64])> = fields.iter().map(|(name, value)| (*name, core::slice::from_ref(value))).collect();
    Message::named(name).unwrap().frame(&from, &fields).unwrap()
}

fn attitude(time_boot_ms: f64) -> Vec<u8> {
    of((1, 1), "ATTITUDE", &[("time_boot_ms", time_boot_ms), ("roll", 0.25)])
}

/// A frame whose type is not known.
fn unknown(content: &[u8]) -> Vec<u8> {
    let head = [V2, content.len() as u8, 0, 0, 7, 1, 1, 0x39, 0x30, 0];
    [&head[..], content, &[0, 0]].concat()
}

/// A log of a ground station: a frame each millisecond from 2025-07-08T19:34:18Z.
fn recorded(frames: &[Vec<u8>]) -> Vec<u8> {
    let stamped = frames
        .iter()
        .enumerate()
        .map(|(k, frame)| [&(RECORDED + 1000 * k as i64).to_be_bytes()[..], frame].concat());
    stamped.collect::<Vec<_>>().concat()
}

const RECORDED: i64 = 1_752_003_258_000_000;

fn of_hex(text: &str) -> Vec<u8> {
    let pairs = text.as_bytes().chunks(2).map(|pair| core::str::from_utf8(pair).unwrap());
    pairs.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

fn stamps(all: &All, topic: &str) -> Vec<String> {
    let first = |row: &String| row.split(' ').next().unwrap().to_owned();
    all.rows(topic).iter().map(first).collect()
}

/// `by_pymavlink.py` prints these frames.
const OF_PYMAVLINK: [&str; 3] = [
    "fe1cc8039e1efaffffff0000803e000000bf000040400000003e000000c00000c03f8c50",
    "fd2c0000c8039e180000404b4c00000000009efeebeacccee85840e908007900c800dc057869030e483b0900b0040000c40900002c01c067",
    "fd080100c8039efd00000654616b656f6666e39e000000000000008600f389f4fe",
];

#[test]
fn frames_match_pymavlink() {
    let bytes = OF_PYMAVLINK.map(of_hex);
    let all = read::<Mavlink>("frames.mavlink", &bytes.concat()).unwrap();
    let attitude = "4294967290000 4294967290 0.25 -0.5 3 0.125 -2 1.5";
    assert_eq!(all.rows("ATTITUDE"), [attitude]);
    let fix = "5000000 5000000 3 -353632610 1491652300 584000 121 200 1500 27000 14 605000 1200 2500 300 0 0";
    assert_eq!(all.rows("GPS_RAW_INT"), [fix]);
    // A message without a time has the stamp of the message before it.
    assert_eq!(all.rows("STATUSTEXT"), ["5000000 6 Takeoff 0 0"]);
    assert_eq!((all.broken, all.remarks.len()), (None, 0));

    let from = Sender {
        system: 3,
        component: 158,
        sequence: 200,
    };
    let names = "time_usec fix_type lat lon alt eph epv vel cog satellites_visible alt_ellipsoid h_acc v_acc vel_acc";
    let values: Vec<f64> = fix.split(' ').skip(1).map(|cell| cell.parse().unwrap()).collect();
    let fields: Vec<(&str, &[f64])> = names.split(' ').zip(values.chunks(1)).collect();
    assert_eq!(Message::named("GPS_RAW_INT").unwrap().frame(&from, &fields).unwrap(), bytes[1]);
}

#[test]
fn every_message_type_matches_pymavlink() {
    let types = all().unwrap();
    let told: Vec<u8> = types.values().flat_map(|message| [message.seed, message.length as u8]).collect();
    assert_eq!((types.len(), u16::from_le_bytes(crc(&told).bytes())), (301, 0x3d74));

    let expected = [
        (5996, 32325.028941),
        (5837, 30878.822127),
        (5973, 29677.516892),
        (5490, 27635.208304),
    ];
    for (round, expected) in expected.into_iter().enumerate() {
        let frames = types.values().flat_map(|message| {
            let length = message.length.saturating_sub(round).max(1);
            let [low, middle, high, _] = message.id.to_le_bytes();
            let head = [V2, length as u8, 0, 0, 7, 1, 1, low, middle, high];
            let frame = [&head[..], &bytes_of(u64::from(message.id) * 4 + round as u64, length)].concat();
            let sum = checksum(&frame, message.seed);
            [frame, sum.to_vec()].concat()
        });
        let mut reader = Mavlink::of(Stream::of(Box::new(std::io::Cursor::new(frames.collect::<Vec<u8>>())))).unwrap();
        let (mut count, mut sum) = (0, 0.0);
        let mut add = |value: f64| {
            if value.is_finite() {
                count += 1;
                sum += value.asinh();
            }
        };
        let mut cells = Cells::default();
        while let Some(topic) = reader.advance().unwrap() {
            cells.clear();
            reader.decode(&mut cells).unwrap();
            assert_eq!(cells.len(), reader.columns(topic).len());
            for column in 1..cells.len() {
                match cells.get(column) {
                    Cell::Text(text) => text.iter().for_each(|byte| add((*byte).into())),
                    cell => add(cell.number().unwrap_or(f64::NAN)),
                }
            }
        }
        assert_eq!((reader.topics().len(), count), (301, expected.0));
        // 1e-6: printed to 6 decimals, and rounding of 6000 terms.
        assert!((sum - expected.1).abs() < 1e-6, "{round}: {sum}");
    }
}

/// The upper bytes of a linear congruential generator (Knuth, MMIX).
fn bytes_of(mut seed: u64, count: usize) -> Vec<u8> {
    let next = |_| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 56) as u8
    };
    (0..count).map(next).collect()
}

#[test]
fn times_of_32_bits_are_unwrapped() {
    let log = [
        attitude(4_294_967_000.0),
        attitude(100.0),
        // A late message of before the turn.
        attitude(4_294_967_200.0),
        // Microseconds of 32 bits turn after 71.6 minutes: this count has turned a thousand times.
        of((1, 1), "SERVO_OUTPUT_RAW", &[("time_usec", 500_000.0)]),
        attitude(200.0),
    ];
    let all = read::<Mavlink>("wraps.mavlink", &log.concat()).unwrap();
    let turn = 4_294_967_296_000_i64;
    let expected = [4_294_967_000_000, turn + 100_000, 4_294_967_200_000, turn + 200_000];
    assert_eq!(stamps(&all, "ATTITUDE"), expected.map(|stamp| stamp.to_string()));
    let near: i64 = stamps(&all, "SERVO_OUTPUT_RAW")[0].parse().unwrap();
    assert_eq!((near - 500_000) % (1 << 32), 0);
    assert!((near - 4_294_967_200_000).abs() <= 1 << 31, "{near}");
}

#[test]
fn times_since_1970_count_from_the_start_of_their_sender() {
    const UNIX: f64 = 1_752_003_258_000_000.0;
    let imu = |component, time: f64| of((1, component), "HIGHRES_IMU", &[("time_usec", time)]);
    let log = [
        imu(1, UNIX + 500.0),
        attitude(40_000.0),
        of((1, 1), "SYSTEM_TIME", &[("time_unix_usec", UNIX), ("time_boot_ms", 40_001.0)]),
        imu(1, UNIX + 2500.0),
        // The clock of another component is related to the newest time of its system.
        imu(197, UNIX - 9e9),
        imu(197, UNIX - 9e9 + 7.0),
    ];
    let all = read::<Mavlink>("unix.mavlink", &log.concat()).unwrap();
    // Before the time of its start is known, it is the first one.
    assert_eq!(stamps(&all, "HIGHRES_IMU"), ["0", "40003500"]);
    assert_eq!(stamps(&all, "HIGHRES_IMU[1.197]"), ["40003500", "40003507"]);
}

#[test]
fn a_message_without_a_time_has_that_of_its_component_or_else_of_its_system() {
    let hud = |sender| of(sender, "VFR_HUD", &[("alt", 1.0)]);
    let log = [
        hud((1, 1)),
        of((1, 154), "ATTITUDE", &[("time_boot_ms", 9000.0)]),
        hud((1, 1)),
        attitude(70.0),
        hud((1, 1)),
        // No time is set.
        attitude(0.0),
        hud((1, 154)),
        hud((2, 1)),
    ];
    let all = read::<Mavlink>("others.mavlink", &log.concat()).unwrap();
    assert_eq!(stamps(&all, "VFR_HUD"), ["", "9000000", "70000"]);
    assert_eq!(stamps(&all, "ATTITUDE[1.1]"), ["70000", "70000"]);
    assert_eq!(stamps(&all, "VFR_HUD[1.154]"), ["9000000"]);
    assert_eq!(stamps(&all, "VFR_HUD[2.1]"), [""]);
}

#[test]
fn a_log_of_a_ground_station_has_the_time_of_its_recorder() {
    let frames = [attitude(70.0), unknown(b"abc"), of_hex(OF_PYMAVLINK[0]), attitude(80.0)];
    let all = read::<Mavlink>("station.tlog", &recorded(&frames)).unwrap();
    assert_eq!(all.columns("ATTITUDE")[..3], ["stamp", "log_time", "time_boot_ms"]);
    let row = |stamp, k: i64, ms| format!("{stamp} {} {ms} 0.25 0 0 0 0 0", RECORDED + 1000 * k);
    assert_eq!(all.rows("ATTITUDE"), [row(70_000, 0, 70), row(80_000, 3, 80)]);
    assert!(all.rows("ATTITUDE[3.158]")[0].starts_with(&format!("4294967290000 {} ", RECORDED + 2000)));
    assert_eq!(all.broken, None);
    assert_eq!(all.remarks, ["1 messages are of types that are not known: 1 with the number 12345"]);

    // A stamp may have the bytes of marks, and the beginning of a log may be missing.
    let marked = [&(RECORDED | 0xfefd_fefe).to_be_bytes()[..], &attitude(70.0)].concat();
    let log = recorded(&frames);
    let all = read::<Mavlink>("begun.tlog", &[&log[12..], &marked].concat()).unwrap();
    assert_eq!(all.rows("ATTITUDE[1.1]").len(), 2);
    assert_eq!(all.columns("ATTITUDE")[1], "log_time");
    let first = recorded(&[attitude(70.0)]).len() - 12;
    let said = all.broken.unwrap().to_string();
    assert!(said.contains(&format!("after byte 0: {first} bytes were skipped")), "{said}");
}

#[test]
fn noise_and_wrong_checksums_are_damage_and_unknown_types_are_counted() {
    let mut wrong = attitude(20.0);
    wrong[14] ^= 1;
    // Zeros and marks, of which some are followed by the length of more bytes than there are.
    let noise = [0, 0, 0, 0, 0, 0, 0, 0, 0xfe, 0xfd, 0xfe];
    let log = [
        noise.to_vec(),
        attitude(10.0),
        wrong.clone(),
        unknown(&[0xfe; 9]),
        unknown(b"abc"),
        attitude(30.0),
        noise.to_vec(),
        attitude(40.0),
    ];
    let all = read::<Mavlink>("noise.mavlink", &log.concat()).unwrap();
    assert_eq!(stamps(&all, "ATTITUDE"), ["10000", "30000", "40000"]);
    let skipped = 2 * noise.len() + wrong.len();
    let said = all.broken.unwrap().to_string();
    assert_eq!(
        said,
        format!("3 places are damaged, the first after byte 0: {skipped} bytes were skipped")
    );
    assert_eq!(all.remarks, ["2 messages are of types that are not known: 2 with the number 12345"]);

    let log = log.concat();
    let all = read::<Mavlink>("cut.mavlink", &log[..log.len() - 1]).unwrap();
    assert_eq!(stamps(&all, "ATTITUDE"), ["10000", "30000"]);
    let at = (log.len() - attitude(40.0).len()) as u64;
    let cut = all.broken.unwrap();
    // The noise before it has a mark too.
    assert!(cut.at.is_some_and(|byte| byte <= at && byte >= at - 3), "{cut}");
    assert_eq!(cut.message, "the file is cut off within a message");
}

#[test]
fn a_mark_within_noise_hides_no_message() {
    // A frame of 20 bytes would end within the next message, and one of 200 bytes behind the end of the file.
    let [short, long] = [[0xfe, 20, 1, 2, 3, 200], [0xfe, 200, 1, 2, 3, 200]];
    let log = [
        attitude(10.0),
        short.to_vec(),
        attitude(20.0),
        long.to_vec(),
        attitude(30.0),
        unknown(b"abc"),
    ];
    let all = read::<Mavlink>("marks.mavlink", &log.concat()).unwrap();
    assert_eq!(stamps(&all, "ATTITUDE"), ["10000", "20000", "30000"]);
    let said = all.broken.unwrap().to_string();
    assert!(
        said.starts_with("2 places are damaged") && said.ends_with("12 bytes were skipped"),
        "{said}"
    );
    assert_eq!(all.remarks.len(), 1);
}

/// Gives bytes one by one, and panics if it is asked for more than are allowed.
struct Link {
    bytes: Vec<u8>,
    given: usize,
    allowed: Arc<AtomicUsize>,
}

impl Read for Link {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        assert!(
            self.given < self.allowed.load(Ordering::Relaxed),
            "a byte beyond the message is asked for"
        );
        buffer[0] = self.bytes[self.given];
        self.given += 1;
        Ok(1)
    }
}

/// The number of messages that a reader gives, each before a byte behind it is asked for. Each of `frames` ends with a
/// message.
fn given_in_time(frames: &[Vec<u8>]) -> usize {
    let allowed = Arc::new(AtomicUsize::new(0));
    let link = Link {
        bytes: frames.concat(),
        given: 0,
        allowed: Arc::clone(&allowed),
    };
    let mut reader = Mavlink::of(Stream::of(Box::new(link))).unwrap();
    for frame in frames {
        allowed.fetch_add(frame.len(), Ordering::Relaxed);
        assert!(reader.advance().unwrap().is_some());
        reader.decode(&mut Cells::default()).unwrap();
    }
    frames.len()
}

#[test]
fn a_message_is_given_when_its_last_byte_is_there() {
    let sound = [attitude(10.0), of_hex(OF_PYMAVLINK[0]), of_hex(OF_PYMAVLINK[2]), attitude(20.0)];
    assert_eq!(given_in_time(&sound), 4);
    let with = |noise: &[u8]| [noise, &attitude(30.0)].concat();
    let mut wrong = attitude(20.0);
    wrong[14] ^= 1;
    // The end of a frame before it, with a mark that announces 200 bytes, and zeros.
    let noisy = [
        with(&[7, 0xfe, 200, 3]),
        with(&[9; 5]),
        with(&unknown(b"abc")),
        with(&wrong),
        with(&[0; 9]),
    ];
    assert_eq!(given_in_time(&noisy), 5);
    let recorded: Vec<Vec<u8>> = sound.iter().map(|frame| [&RECORDED.to_be_bytes()[..], frame].concat()).collect();
    assert_eq!(given_in_time(&recorded), 4);
}

#[test]
fn columns_have_units_and_their_meaning() {
    let names = [
        "SCALED_IMU",
        "GPS_RAW_INT",
        "HIGHRES_IMU",
        "RAW_IMU",
        "LOCAL_POSITION_NED",
        "GPS_STATUS",
    ];
    let log = names.map(|name| of((1, 1), name, &[]));
    let all = read::<Mavlink>("labels.tlog", &recorded(&log)).unwrap();
    for label in [
        "acc_x [mg]",
        "gyro_z [mrad/s]",
        "lat [1e-7 deg]",
        "ground_speed [cm/s]",
        "cog [cdeg]",
        "acc_x [m/s^2]",
        "mag_y [gauss]",
        "abs_pressure [hPa]",
        "v_down [m/s]",
        "satellite_elevation[19] [deg]",
    ] {
        assert!(all.labels.iter().any(|found| found == label), "{label}: {:?}", all.labels);
    }
}

#[test]
fn files_are_recognised_by_two_frames() {
    let two = [attitude(10.0), of_hex(OF_PYMAVLINK[2]), attitude(20.0)];
    assert!((MAVLINK.recognises)(&two.concat()) && (MAVLINK.recognises)(&recorded(&two)));
    let one = [&attitude(10.0)[..], &[0; 40]].concat();
    for other in [&one[..], b"$GPGGA,1,2,3\r\n", &[0xa3, 0x95, 128, 1], &[0; 64], b""] {
        assert!(!(MAVLINK.recognises)(other), "{other:?}");
    }
}

#[test]
fn a_frame_has_only_fields_of_its_message() {
    let from = Sender {
        system: 1,
        component: 1,
        sequence: 0,
    };
    let odometry = Message::named("ODOMETRY").unwrap();
    assert!(odometry.frame(&from, &[("q", &[1.0; 4])]).is_ok());
    assert_eq!(
        odometry.frame(&from, &[("q", &[1.0; 5])]).unwrap_err(),
        "`ODOMETRY` has no field `q` of 5 numbers"
    );
    assert!(odometry.frame(&from, &[("lat", &[1.0])]).is_err());
}

#[test]
fn numbers_out_of_range_are_the_nearest_possible_ones() {
    let name = "RAW_IMU";
    let log = [of(
        (1, 1),
        name,
        &[("xacc", 1e9), ("yacc", -1e9), ("zacc", f64::NAN), ("xgyro", -2.5)],
    )];
    let all = read::<Mavlink>("range.mavlink", &log.concat()).unwrap();
    assert_eq!(all.rows(name), [" 0 32767 -32768 0 -3 0 0 0 0 0 0 0"]);
}

#[test]
fn damaged_logs_are_read_without_a_panic() {
    let frames: Vec<Vec<u8>> = (0..8)
        .flat_map(|k| {
            [
                attitude(f64::from(k) * 10.0 + 1.0),
                of_hex(OF_PYMAVLINK[k as usize % 3]),
                unknown(b"abc"),
            ]
        })
        .collect();
    survives_damage::<Mavlink>("mutant.mavlink", &frames.concat());
    survives_damage::<Mavlink>("mutant.tlog", &recorded(&frames));
}
