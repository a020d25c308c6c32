//! Messages as `pyubx2` 1.4 reads them.

use super::*;
use crate::nmea::tests::sentence;
use crate::testing::{read, read_file, real, survives_damage};

/// A message with its checksum.
fn message(id: [u8; 2], content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len()).unwrap().to_le_bytes();
    let summed = [&id, &length, content].concat();
    let [a, b] = summed.iter().fold([0_u8, 0], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    });
    [&[0xb5, 0x62], &summed[..], &[a, b]].concat()
}

/// `NAV-POSLLH` at a time of the week \[ms\].
fn position(tow: u32) -> Vec<u8> {
    let numbers = [tow as i32, 85_000_001, -473_000_000, 499_600, 451_600, 2500, 3100];
    message([1, 2], &numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
}

/// `NAV-TIMEGPS` in week 2374.
fn week(tow: u32) -> Vec<u8> {
    let content = [
        &tow.to_le_bytes()[..],
        &(-12_i32).to_le_bytes(),
        &2374_i16.to_le_bytes(),
        &[18, 7],
        &20_u32.to_le_bytes(),
    ]
    .concat();
    message([1, 0x20], &content)
}

/// A time of week 2374 in nanoseconds of GPS time.
fn at(tow: i64) -> i64 {
    (2374 * 604_800_000 + tow) * 1_000_000
}

#[test]
fn the_time_of_the_week_gets_the_week_of_the_newest_message() {
    let rmc = "GNRMC,194201.00,A,4718.0,S,00830.0,E,0.004,77.52,080725,,,A";
    let rtcm = b"\xd3\x00\x13\x3e\xd7\xd3\x02\x02\x98\x0e\xde\xef\x34\xb4\xbd\x62\xac\x09\x41\x98\x6f\x33\x36\x0b\x98";
    let log = [
        position(604_799_000),
        week(1000),
        rtcm.to_vec(),
        sentence(rmc).into_bytes(),
        sentence("GNTHS,77.5,A").into_bytes(),
        position(2000),
        position(604_799_900),
        position(0),
    ];
    let all = read::<Ubx>("weeks.ubx", &log.concat()).unwrap();
    let row = |stamp: i64, tow: u32| format!("{stamp} {tow} 8.5000001 -47.3 499600 451600 2500 3100");
    let rows = [
        row(at(-1000), 604_799_000),
        row(at(2000), 2000),
        // The time runs on by half a week at most: this is before the message before it.
        row(at(-100), 604_799_900),
        row(at(0), 0),
    ];
    assert_eq!(all.rows("NAV-POSLLH"), rows);
    assert_eq!(all.rows("NAV-TIMEGPS"), [format!("{} 1000 -12 2374 18 1 1 1 20", at(1000))]);
    // 2025-07-08 19:42:01 UTC is 243 739 s in week 2374, with 18 leap seconds.
    assert!(
        all.rows("GNTHS")[0].starts_with(&format!("{} 77.5", at(243_739_000))),
        "{:?}",
        all.rows("GNTHS")
    );
    assert!(all.labels.contains(&"height [mm]".to_owned()) && all.labels.contains(&"lat [deg]".to_owned()));
    assert_eq!((all.broken, all.remarks.len()), (None, 0));
}

#[test]
fn a_date_gives_the_week() {
    let mut content = vec![0; 92];
    content[..4].copy_from_slice(&243_739_250_u32.to_le_bytes());
    content[4..11].copy_from_slice(&[0xe9, 0x07, 7, 8, 19, 42, 1]);
    content[11] = 7;
    let log = [
        message([1, 7], &content),
        message(
            [0x0d, 1],
            &[&[0xe8, 3, 0, 0, 0, 0, 0, 0x80, 5, 0, 0, 0, 0x46, 9, 0, 0][..]].concat(),
        ),
    ];
    let all = read::<Ubx>("dates.ubx", &log.concat()).unwrap();
    assert!(
        all.rows("NAV-PVT")[0].starts_with(&format!("{} 243739250 2025 7 8 19 42 1 1 1 1 0", at(243_739_250))),
        "{all:?}"
    );
    // The pulse is half a millisecond after 1 s of the week.
    assert_eq!(
        all.rows("TIM-TP"),
        [format!("{} 1000 0.5 5 2374 0 0 0 0 0 0 0", at(1000) + 500_000)]
    );
}

#[test]
fn digits_of_high_precision_are_added() {
    let numbers = [243_739_250, 85_000_001, -473_000_000, 499_600, 451_600];
    let fine = [12_i8, -34, 5, -9].map(|x| x as u8);
    let content = [
        &[0, 0, 0, 0][..],
        &numbers.map(i32::to_le_bytes).concat(),
        &fine,
        &250_u32.to_le_bytes(),
        &310_u32.to_le_bytes(),
    ];
    let all = read::<Ubx>("fine.ubx", &message([1, 0x14], &content.concat())).unwrap();
    // Without a week, week 0.
    assert_eq!(
        all.rows("NAV-HPPOSLLH"),
        ["243739250000000 0 0 243739250 8.500000111999999 -47.300000034 499600.5 451599.1 25 31"]
    );
    assert_eq!(all.remarks, ["no message has the week: stamps count from the start of a week"]);
}

/// A measurement of this type with its tag.
fn tagged(kind: u8, value: i32, tag: u32) -> Vec<u8> {
    let [low, middle, high, _] = value.to_le_bytes();
    [&[low, middle, high, kind][..], &tag.to_le_bytes()].concat()
}

#[test]
fn sensors_have_columns_and_each_tag_a_row() {
    let raw = [
        vec![0; 4],
        tagged(14, -4096, 7),
        tagged(18, 10_240, 7),
        tagged(14, 2048, 9),
        tagged(8, 0x80_0005, 9),
    ]
    .concat();
    // The tag of the calibration, and two measurements.
    let meas = [
        &[1, 0, 0, 0, 0b1000, 2 << 3, 3, 0][..],
        &tagged(5, -2048, 0)[..4],
        &tagged(11, 1500, 0)[..4],
        &[9, 0, 0, 0],
    ]
    .concat();
    let all = read::<Ubx>(
        "sensors.ubx",
        &[week(1000), message([0x10, 3], &raw), message([0x10, 2], &meas)].concat(),
    )
    .unwrap();
    let stamp = at(1000);
    let names = [
        "time",
        "sTag",
        "gyroX",
        "gyroY",
        "gyroZ",
        "accX",
        "accY",
        "accZ",
        "gyroTemp",
        "wheelTicksFL",
        "wheelTicksFR",
        "wheelTicksRL",
    ];
    assert_eq!(all.columns("ESF-RAW")[..12], names);
    assert_eq!(
        all.rows("ESF-RAW"),
        [format!("{stamp} 7 -1     10       "), format!("{stamp} 9 0.5         -5   ")]
    );
    assert_eq!(all.rows("ESF-MEAS"), [format!("{stamp} 1 0 0 1 2 3 9   -0.5          1.5")]);
}

#[test]
fn a_wrong_checksum_is_a_malformed_row_and_reading_resumes() {
    let mut wrong = position(2000);
    wrong[10] ^= 1;
    let log = [
        position(1000),
        wrong,
        vec![0xb5, 0x62, 1, 2, 0xff, 0xff],
        position(3000),
        position(4000),
    ];
    let all = read::<Ubx>("wrong.ubx", &log.concat()).unwrap();
    assert_eq!((all.rows("NAV-POSLLH").len(), all.messages.len()), (3, 4));
    assert!(all.messages[1].1.as_ref().is_err_and(|why| why == "its checksum is wrong"));
    // All of the wrong message but its first byte, and the mark without a message.
    let skipped = position(0).len() - 1 + 6;
    let said = all.broken.unwrap().to_string();
    assert!(said.contains(&format!("{skipped} bytes were skipped")), "{said}");
    let log = log.concat();
    let all = read::<Ubx>("cut.ubx", &log[..log.len() - 1]).unwrap();
    let at = (log.len() - position(0).len()) as u64;
    assert_eq!(all.broken, Some(Broken::at(at, "the file is cut off within a message")));
}

#[test]
fn the_table_of_messages_is_read_to_its_end() {
    let layouts = layout::all();
    let lines = include_str!("messages.txt").lines().filter(|line| !line.starts_with(' ')).count();
    assert_eq!(layouts.len(), lines);
    // The lengths of the interface description.
    for (name, length) in [
        ("NAV-PVT", 92),
        ("NAV-HPPOSLLH", 36),
        ("NAV-RELPOSNED", 64),
        ("NAV-COV", 64),
        ("ESF-INS", 36),
        ("TIM-TM2", 28),
        ("HNR-PVT", 72),
    ] {
        let (_, layout) = layouts.iter().find(|(_, layout)| layout.name == name).unwrap();
        assert_eq!(layout.length(), length, "{name}");
    }
}

#[test]
fn matches_pyubx2_on_a_real_log() {
    let Some(path) = real("ubx_mixed.log") else { return };
    let all = read_file::<Ubx>(&path).unwrap();
    assert_eq!(all.broken, None);
    // Messages, numbers without the stamp and reserved fields, and the sum of math.asinh(x) over the attributes of
    // UBXReader.
    let expected = [
        ("NAV-PVT", 39, 1716, 5248.107996),
        ("NAV-SOL", 39, 702, 3397.436395),
        ("NAV-STATUS", 32, 448, 1549.064441),
        ("NAV-POSLLH", 21, 147, 1383.496550),
        ("NAV-VELNED", 9, 81, 333.290988),
        ("NAV-TIMEGPS", 8, 64, 402.437828),
        ("NAV-TIMEUTC", 1, 14, 66.417776),
    ];
    for (topic, messages, count, sum) in expected {
        let rows = all.rows(topic);
        let stamps: f64 = rows
            .iter()
            .map(|row| row.split(' ').next().unwrap().parse::<f64>().unwrap().asinh())
            .sum();
        let (found, of_all) = all.sum(topic);
        // 1e-6: written to 6 decimals, and rounding of 2000 terms.
        let is_equal = (rows.len(), found - rows.len()) == (messages, count) && (of_all - stamps - sum).abs() < 1e-6;
        assert!(is_equal, "{topic}: {} {found} {}", rows.len(), of_all - stamps);
    }
    // NAV-TIMEGPS has week 2128. The messages before it get the week by the date of NAV-PVT.
    for row in all.rows("NAV-PVT").iter().chain(&all.rows("NAV-SOL")) {
        let cells: Vec<i64> = row.split(' ').take(2).map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(cells[0], (2128 * 604_800_000 + cells[1]) * 1_000_000);
    }
}

#[test]
fn matches_pyubx2_on_sentences_of_a_real_log() {
    let Some(path) = real("receiver_com3.ubx") else { return };
    let all = read_file::<Ubx>(&path).unwrap();
    assert_eq!(
        (all.broken, all.messages.iter().filter(|(_, cells)| cells.is_err()).count()),
        (None, 0)
    );
    for (address, count) in [
        ("GNRMC", 90),
        ("GNVTG", 83),
        ("GNGGA", 81),
        ("GNGSA", 247),
        ("GPGSV", 51),
        ("GNGLL", 32),
        ("GNTXT", 102),
    ] {
        let of = all.messages.iter().filter(|(name, _)| name == address).count();
        assert_eq!(of, count, "{address}");
    }
}

#[test]
fn damaged_logs_are_read_without_a_panic() {
    let raw = [vec![0; 4], tagged(14, -4096, 7), tagged(14, 2048, 9)].concat();
    let log = [
        week(1000),
        sentence("GNTHS,77.5,A").into_bytes(),
        position(2000),
        message([0x10, 3], &raw),
    ];
    survives_damage::<Ubx>("mutant.ubx", &log.concat().repeat(8));
}
