//! Sentences as `pynmeagps` 1.1.8 reads them.

use super::*;
use crate::testing::{read, survives_damage};

/// A sentence with its checksum.
pub(crate) fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn log(bodies: &[&str]) -> Vec<u8> {
    bodies.iter().flat_map(|body| sentence(body).into_bytes()).collect()
}

/// 2025-07-08 00:00:00 UTC in nanoseconds of GPS time: 16 620 days and 18 leap seconds after 1980-01-06.
const MIDNIGHT: i64 = (16_620 * 86_400 + 18) * 1_000_000_000;

fn at(seconds: f64) -> String {
    (MIDNIGHT + (seconds * 1e9) as i64).to_string()
}

#[test]
fn sentences_without_a_date_have_the_date_of_the_newest_one() {
    let all = read::<Nmea>(
        "dates.nmea",
        &log(&[
            "GPGGA,235959.50,4717.11437,N,00833.91522,W,1,08,1.01,499.6,M,48.0,M,,",
            "HEHDT,123.4,T",
            "GPRMC,000000.25,A,4717.11437,S,00833.91522,E,0.004,77.52,080725,,,A",
            "GPVTG,77.52,T,,M,0.004,N,0.008,K,A",
            "GPGGA,235959.75,4717.11437,N,00833.91522,W,1,08,1.01,499.6,M,48.0,M,,0123",
            "GPGGA,000000.75,,,,,0,,,,M,,M,,",
            "GPZDA,120000,09,07,2025,00,00",
        ]),
    )
    .unwrap();
    let position = "47.2852395 N -8.565253666666667 W";
    assert_eq!(
        all.rows("GPGGA"),
        [
            format!("{} 235959.50 {position} 1 8 1.01 499.6 M 48 M  ", at(-0.5)),
            format!("{} 235959.75 {position} 1 8 1.01 499.6 M 48 M  123", at(-0.25)),
            format!("{} 000000.75     0    M  M  ", at(0.75)),
        ]
    );
    assert_eq!(all.rows("HEHDT"), [format!("{} 123.4 T", at(-0.5))]);
    assert!(all.rows("GPRMC")[0].starts_with(&format!("{} 000000.25 A -47.2852395 S 8.565253666666667 E 0.004", at(0.25))));
    assert_eq!(all.rows("GPVTG"), [format!("{} 77.52 T  M 0.004 N 0.008 K A", at(0.25))]);
    assert_eq!(all.rows("GPZDA"), [format!("{} 120000 9 7 2025 0 0", at(1.5 * 86_400.0))]);
    assert!(all.labels.contains(&"lat [deg]".to_owned()));
    assert_eq!((all.broken, all.remarks.len()), (None, 0));
}

#[test]
fn without_any_date_stamps_are_times_of_day() {
    let all = read::<Nmea>(
        "day.nmea",
        &log(&["GPGLL,4717.1,N,00833.9,E,235959,A,A", "GPGLL,4717.1,N,00833.9,E,000001,A,A"]),
    )
    .unwrap();
    let stamps: Vec<i64> = all
        .rows("GPGLL")
        .iter()
        .map(|row| row.split(' ').next().unwrap().parse().unwrap())
        .collect();
    // Time zero is midnight: the log begins less than half a day before it.
    assert_eq!(stamps, [-1_000_000_000, 1_000_000_000]);
    assert_eq!(all.remarks, ["no sentence has a date: stamps are times of day"]);
}

#[test]
fn a_wrong_checksum_is_a_malformed_row_and_a_cut_line_the_end() {
    let mut log = log(&["GPHDT,1.5,T", "GPHDT,2.5,T", "GPHDT,3.5,T", "PUBX,04,1,2"]);
    log[24] ^= 1;
    let text = [b"# a comment\n\n".to_vec(), log.clone()].concat();
    let all = read::<Nmea>("checksum.nmea", &text[..text.len() - 3]).unwrap();
    assert_eq!(all.rows("GPHDT").len(), 2);
    assert!(all.messages[1].1.as_ref().is_err_and(|why| why.contains("checksum")), "{all:?}");
    assert_eq!(all.remarks[1], "1 lines have no sentence");
    let at = (text.len() - sentence("PUBX,04,1,2").len()) as u64;
    assert_eq!(all.broken, Some(Broken::at(at, "the file is cut off within a sentence")));
    // Without the end of a line, the last sentence is whole.
    let all = read::<Nmea>("whole.nmea", &text[..text.len() - 2]).unwrap();
    assert_eq!(all.rows("PUBX"), ["0 04 1 2"]);
}

#[test]
fn wind_and_satellites_are_not_measured_motion() {
    for (address, is_measured) in [
        ("GNGGA", true),
        ("HEHDT", true),
        ("WIMWV", false),
        ("GPGSV", false),
        ("PUBX", false),
    ] {
        assert_eq!(role(address) == Role::Measurement, is_measured, "{address}");
    }
}

#[test]
fn damaged_logs_are_read_without_a_panic() {
    let bodies = [
        "GPRMC,000000.25,A,4717.11437,S,00833.91522,E,0.004,77.52,080725,,,A",
        "GPHDT,1.5,T",
        "GPGSA,A,3,1,2,,,,,,,,,,,1,2,3",
    ];
    survives_damage::<Nmea>("mutant.nmea", &log(&bodies).repeat(10));
}
