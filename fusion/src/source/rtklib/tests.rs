//! Solutions as RTKLIB writes them, and one of a real drive beside what was made of it by hand.

use super::*;
use crate::source::testing::recorded::{Rows, rows, spec};
use std::path::Path;

const CHANNELS: &str = "
    path = 'log.pos'
    [channels]
    position = { latitude = 'latitude(deg)', longitude = 'longitude(deg)', height = 'height(m)' }
    velocity = { columns = ['vn(m/s)', 've(m/s)', '-vu(m/s)'] }";
const HEADER: &str = "latitude(deg) longitude(deg)  height(m)   Q  ns   vn(m/s)   ve(m/s)   vu(m/s)\n";

fn read(name: &str, time: &str, text: &str) -> Result<Rows, String> {
    let dir = std::env::temp_dir().join(format!("fusion-rtklib-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    std::fs::write(dir.join("log.pos"), text).unwrap();
    let found = rows(&spec::<RtklibSpec>(&format!("{time}{CHANNELS}")), &dir);
    std::fs::remove_dir_all(&dir).unwrap();
    found.map_err(|e| e.replace(&format!("{}/", dir.display()), ""))
}

#[test]
fn stamps_are_of_the_time_system_and_in_the_form_that_the_file_has() {
    let epoch = "time.epoch = '2025-07-08T19:34:00Z'";
    let values = "40.5 -105.25 1601.5 1 21 1.5 -0.5 0.25\n";
    let about = "% program   : RTKLIB ver.2.4.2\n% pos mode  : kinematic\n%\n";
    for (system, stamp) in [
        ("GPST", "2025/07/08 19:34:36.250"),
        ("GPST", "2374  243276.250"),
        ("UTC ", "2025/07/08 19:34:18.250"),
        ("UTC ", "2374  243258.250"),
        ("JST ", "2025/07/09 04:34:18.250"),
    ] {
        let text = format!("{about}%  {system}                  {HEADER}{stamp}   {values}\n% a comment\n");
        let found = read("systems", epoch, &text).unwrap();
        let place = [40.5_f64.to_radians(), -105.25_f64.to_radians(), 1601.5];
        assert_eq!(
            found,
            [(18_250_000_000, [&place[..], &[1.5, -0.5, -0.25]].concat())],
            "{system} {stamp}"
        );
    }
}

#[test]
fn what_is_wrong_with_a_solution_is_said_by_line() {
    let said = |text: &str| read("wrong", "time.epoch = '2025-07-08T19:34:00Z'", text).unwrap_err();
    let values = "40.5 -105.25 1601.5 1 21 1.5 -0.5 0.25\n";
    for (text, what) in [
        (
            format!("% GPST {HEADER}2025/07/32 00:00:00 {values}"),
            "log.pos:2: `2025/07/32 00:00:00` does not exist",
        ),
        (
            format!("% GPST {HEADER}\nnow or never {values}"),
            "log.pos:3: this row has 11 fields, not 10",
        ),
        (
            format!("% GPST {HEADER}x y {values}"),
            "log.pos:2: `x y` is neither a date and time nor a GPS week",
        ),
        (format!("% GPST {HEADER}2374 x {values}"), "log.pos:2: `2374 x` is neither"),
        (
            format!("% LOCAL {HEADER}2374 0 {values}"),
            "the last comment before the rows begins with `LOCAL`",
        ),
        (format!("2374 0 {values}"), "no comment before the first row names the columns"),
        (
            "% GPST latitude(d'\") Q\n2374 0 40 30 0.0 1\n".to_owned(),
            "in degrees, minutes and seconds",
        ),
        (String::new(), "no comment before the first row names the columns"),
    ] {
        assert!(said(&text).contains(what), "{what}: {}", said(&text));
    }
}

#[test]
fn a_recorded_solution_is_that_which_was_made_of_it_by_hand() {
    let data = std::env::var_os("FUSION_DATA").unwrap_or_else(|| "../../shared/data".into());
    let data = Path::new(&data).join("rtklibexplorer_drive");
    if !data.join("original/gnss_1934_sf.pos").exists() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    let solution: RtklibSpec =
        spec(&format!("time.epoch = '2025-07-08 19:34:18 GPST'{CHANNELS}").replace("log.pos", "original/gnss_1934_sf.pos"));
    let toml = "
        path = 'derived/gnss.csv'
        time = { column = 't_s' }
        [channels]
        position = { latitude = 'lat_deg', longitude = 'lon_deg', height = 'h_m', unit = 'deg' }
        velocity = { columns = ['vn_mps', 've_mps', 'vd_mps'], unit = 'm/s' }";
    let derived: crate::source::CsvSpec = spec(toml);
    let (solution, derived) = (rows(&solution, &data).unwrap(), rows(&derived, &data).unwrap());
    assert_eq!(solution.len(), 2197);
    // Both print the same digits.
    assert_eq!(solution, derived);
}
