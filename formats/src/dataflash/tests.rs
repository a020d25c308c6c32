//! Logs written here, as `pymavlink` 2.4.50 reads them.

use super::*;
use crate::testing::{read, survives_damage};

fn message(kind: u8, content: &[&[u8]]) -> Vec<u8> {
    [&MARK[..], &[kind], &content.concat()].concat()
}

/// A text of this number of bytes.
fn text(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}

fn format(kind: u8, length: u8, name: &str, letters: &str, columns: &str) -> Vec<u8> {
    message(FMT, &[&[kind, length + 3], &text(name, 4), &text(letters, 16), &text(columns, 64)])
}

fn imu(stamp: u64, instance: u8, x: f32) -> Vec<u8> {
    message(
        140,
        &[&stamp.to_le_bytes(), &[instance], &x.to_le_bytes(), &(-250_i16).to_le_bytes()],
    )
}

fn definitions() -> Vec<u8> {
    let units = [
        (b'E', "rad/s"),
        (b'G', "Gauss"),
        (b'#', "instance"),
        (b'U', "deglongitude"),
        (b's', "s"),
    ];
    let unit = |(letter, name): (u8, &str)| message(129, &[&[0; 8], &[letter], &text(name, 64)]);
    let multipliers = [
        (b'C', 1e-3_f64),
        (b'F', f64::from(1e-6_f32)),
        (b'0', 1.0),
        (b'-', 0.0),
        (b'G', 1e-7),
    ];
    let multiplier = |(letter, size): (u8, f64)| message(131, &[&[0; 8], &[letter], &size.to_le_bytes()]);
    let of = |kind: u8, units: &str, multipliers: &str| message(130, &[&[0; 8], &[kind], &text(units, 16), &text(multipliers, 16)]);
    [
        format(FMT, 86, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        format(129, 73, "UNIT", "QbZ", "TimeUS,Id,Label"),
        format(130, 41, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        format(131, 17, "MULT", "Qbd", "TimeUS,Id,Mult"),
        format(140, 15, "IMU", "QBfh", "TimeUS,I,GyrX,MagX"),
        format(141, 98, "TST", "LQcgMna", "Lng,TimeUS,c,half,Mode,n,Data"),
        units.into_iter().flat_map(unit).collect(),
        multipliers.into_iter().flat_map(multiplier).collect(),
        of(140, "s#EG", "F-0C"),
        of(141, "Us?????", "GF-----"),
    ]
    .concat()
}

fn test(stamp: u64) -> Vec<u8> {
    let data: Vec<u8> = (0..32_i16).flat_map(i16::to_le_bytes).collect();
    // −2.5 as a number of 16 bits.
    let half = 0xc100_u16.to_le_bytes();
    let numbers: [&[u8]; 5] = [
        &85_000_000_i32.to_le_bytes(),
        &stamp.to_le_bytes(),
        &(-1234_i16).to_le_bytes(),
        &half,
        &[4],
    ];
    message(141, &[&numbers.concat(), b"ab\0\0", &data, &[0; 13]])
}

fn log() -> Vec<u8> {
    [definitions(), imu(1000, 0, 0.5), imu(1001, 1, 0.75), test(1500), imu(2000, 0, -0.5)].concat()
}

#[test]
fn instances_are_topics_and_columns_have_the_units_of_the_log() {
    let all = read::<Dataflash>("plain.bin", &log()).unwrap();
    assert_eq!(all.rows("IMU"), ["1000 0 0.5 -250", "2000 0 -0.5 -250"]);
    assert_eq!(all.rows("IMU[1]"), ["1001 1 0.75 -250"]);
    assert_eq!(all.columns("TST")[..7], ["TimeUS", "Lng", "c", "half", "Mode", "n", "Data[0]"]);
    assert!(
        all.rows("TST")[0].starts_with("1500 8.5 -12.34 -2.5 4 ab 0 1 2"),
        "{:?}",
        all.rows("TST")
    );
    let labels = [
        "TimeUS [us]",
        "GyrX [rad/s]",
        "MagX [mgauss]",
        "TimeUS [us]",
        "GyrX [rad/s]",
        "MagX [mgauss]",
        "TimeUS [us]",
        "Lng [deg]",
    ];
    assert_eq!(all.labels, labels);
    assert_eq!(all.broken, None);
}

#[test]
fn reading_resumes_at_the_next_message() {
    // Within the damage is a mark that no message follows.
    let damaged = [&[1, 2, 0xa3, 0x95, 140][..], &imu(1, 0, 0.0)[..9]].concat();
    let log = [log(), damaged.clone(), imu(3000, 0, 1.0), imu(4000, 0, 1.0)].concat();
    let all = read::<Dataflash>("damaged.bin", &log).unwrap();
    assert_eq!(all.rows("IMU")[2..], ["3000 0 1 -250", "4000 0 1 -250"]);
    let said = all.broken.unwrap().to_string();
    assert!(said.contains(&format!("{} bytes were skipped", damaged.len())), "{said}");
}

#[test]
fn a_log_that_is_cut_off_has_all_messages_before_the_cut() {
    let log = log();
    let all = read::<Dataflash>("cut.bin", &log[..log.len() - 1]).unwrap();
    assert_eq!(all.rows("IMU").len(), 1);
    let at = (log.len() - imu(0, 0, 0.0).len()) as u64;
    assert_eq!(all.broken, Some(Broken::at(at, "the file is cut off within a message")));
}

#[test]
fn a_format_that_contradicts_itself_is_damage() {
    for wrong in [
        format(150, 3, "BAD", "Q", "TimeUS"),
        format(150, 8, "BAD", "?", "TimeUS"),
        format(140, 8, "IMU", "Q", "TimeUS"),
    ] {
        let log = [log(), wrong, imu(3000, 0, 1.0)].concat();
        let all = read::<Dataflash>("format.bin", &log).unwrap();
        assert_eq!(all.rows("IMU").len(), 3);
        assert!(all.broken.unwrap().message.contains("89 bytes were skipped"));
    }
}

#[test]
fn damaged_logs_are_read_without_a_panic() {
    let messages = log()[definitions().len()..].repeat(20);
    survives_damage::<Dataflash>("mutant.bin", &[definitions(), messages].concat());
}
