//! Sentences of known estimates, and of many estimates with the reader of `fusion-formats`.

use super::fields::{degrees_and_minutes, ellipse, turn};
use super::*;
use crate::output::testing::{Kept, NOW, about, estimate};
use core::f64::consts::PI;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::health::State;
use fusion::solution::Solution;
use fusion::source::table::LogTable;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const ALL: &str = r#"{"nmea": {"link": "l", "sentences": ["GGA", "RMC", "GST", "HDT", "VTG", "ZDA", "THS"]}}"#;

fn spec(json: &str) -> Result<Box<dyn OutputSpec>, String> {
    serde_json::from_str(json).map_err(|error| error.to_string())
}

fn sent(estimates: &[Outgoing]) -> String {
    let mut output = spec(ALL).unwrap().open(&about()).unwrap();
    let mut kept = Kept::default();
    for estimate in estimates {
        output.send(estimate, Some(&mut kept)).unwrap();
    }
    String::from_utf8(kept.0).unwrap()
}

/// The sentences between `$GN` and their checksums. The checksums are compared by the reader of `fusion-formats`.
fn bodies(text: &str) -> Vec<&str> {
    text.split_terminator("\r\n").map(|line| &line[3..line.len() - 3]).collect()
}

#[test]
fn the_sentences_of_an_estimate_have_its_numbers() {
    let text = sent(&[estimate()]);
    // 5 m/s are 9.72 kn and 18 km/h, towards atan2(−4, 3).
    let expected = [
        "GGA,193418.250,4717.1143700,N,00833.9152200,W,1,,,545.400,M,0.0,M,,",
        "RMC,193418.250,A,4717.1143700,N,00833.9152200,W,9.72,306.87,080725,,,A,V",
        "GST,193418.250,,3.000,1.000,30.00,2.646,1.732,2.000",
        "HDT,123.46,T",
        "VTG,306.87,T,,M,9.72,N,18.00,K,A",
        "ZDA,193418.250,08,07,2025,00,00",
        "THS,123.46,A",
    ];
    assert_eq!(bodies(&text), expected);
    assert!(text.starts_with("$GNGGA"), "{text}");
}

#[test]
fn the_health_is_the_mode() {
    for (health, modes) in [
        (State::Aligning, ["6", "V", "E", "E", "E"]),
        (State::Coasting, ["6", "V", "E", "E", "E"]),
        (State::Degraded, ["6", "V", "E", "E", "E"]),
        (State::Good, ["1", "A", "A", "A", "A"]),
    ] {
        let text = sent(&[Outgoing { health, ..estimate() }]);
        let field = |sentence: usize, field: usize| bodies(&text)[sentence].split(',').nth(field).unwrap().to_owned();
        assert_eq!(
            [field(0, 6), field(1, 2), field(1, 12), field(4, 9), field(6, 2)],
            modes,
            "{health}"
        );
    }
}

#[test]
fn an_invalid_estimate_has_empty_fields_and_no_heading() {
    let invalid = [
        "GGA,193418.250,,,,,0,,,,M,,M,,",
        "RMC,193418.250,V,,,,,,,080725,,,N,V",
        "GST,193418.250,,,,,,,",
        "VTG,,T,,M,,N,,K,N",
        "ZDA,193418.250,08,07,2025,00,00",
        "THS,,V",
    ];
    let changed = |change: fn(&mut Solution)| {
        let mut estimate = estimate();
        estimate.solution.iter_mut().for_each(change);
        estimate
    };
    for estimate in [
        Outgoing {
            solution: None,
            health: State::Aligning,
            ..estimate()
        },
        Outgoing {
            health: State::Lost,
            ..estimate()
        },
        changed(|solution| solution.position.iter_mut().for_each(|(place, _)| place.lat = f64::NAN)),
        changed(|solution| solution.position.iter_mut().for_each(|(place, _)| place.height = f64::INFINITY)),
        changed(|solution| solution.position = None),
    ] {
        assert_eq!(bodies(&sent(&[estimate])), invalid);
    }
    let vague = changed(|solution| solution.attitude.iter_mut().for_each(|(_, p)| p[(2, 2)] = 0.3));
    assert_eq!(bodies(&sent(&[vague])).last(), Some(&"THS,,V"), "a heading with 31°");
    let blind = changed(|solution| solution.position.iter_mut().for_each(|(_, p)| p.fill(f64::NAN)));
    assert_eq!(bodies(&sent(&[blind]))[2], "GST,193418.250,,,,,,,");
}

#[test]
fn without_a_date_no_sentence_has_a_time() {
    let text = sent(&[Outgoing {
        gps_nanos: None,
        ..estimate()
    }]);
    let addresses: Vec<&str> = bodies(&text).iter().map(|body| &body[..4]).collect();
    assert_eq!(addresses, ["GGA,", "RMC,", "GST,", "HDT,", "VTG,", "THS,"]);
    assert!(text.contains("GNGGA,,4717.1143700"), "{text}");
    assert!(text.contains(",306.87,,,,A,V*"), "{text}");
}

#[test]
fn times_are_utc_to_the_millisecond() {
    // 2017-01-01 00:00:00 UTC is GPS second 1167264018, after a leap second (IERS Bulletin C 52).
    let midnight = 1_167_264_018_000_000_000;
    for (gps_nanos, time, date) in [
        (midnight, "000000.000", "01,01,2017"),
        (midnight - 400_000, "000000.000", "01,01,2017"),
        (midnight - 600_000, "235960.999", "31,12,2016"),
        (midnight - 1_750_000_000, "235959.250", "31,12,2016"),
    ] {
        let text = sent(&[Outgoing {
            gps_nanos: Some(gps_nanos),
            ..estimate()
        }]);
        assert_eq!(bodies(&text)[5], format!("ZDA,{time},{date},00,00"));
    }
}

#[test]
fn angles_are_rounded_without_a_sixtieth_minute() {
    for (degrees, digits, text) in [
        (0.0, 2, "0000.0000000"),
        (1.0 - 1e-12, 2, "0100.0000000"),
        (-89.999_999_999, 2, "8959.9999999"),
        (180.0, 3, "18000.0000000"),
        // 5 · 10⁻⁸ minutes are rounded up.
        (7.5 + 0.6e-7 / 60.0, 3, "00730.0000001"),
    ] {
        assert_eq!(degrees_and_minutes(f64::to_radians(degrees), digits), text);
    }
    for (degrees, text) in [(-0.004, "0.00"), (359.996, "0.00"), (-0.006, "359.99"), (f64::NAN, "")] {
        assert_eq!(turn(Some(f64::to_radians(degrees))), text);
    }
}

#[test]
fn at_rest_there_is_no_course() {
    let mut slow = estimate();
    // 0.28 m/s and 0.29 m/s; the 1σ is 0.2 m/s along each axis.
    for (speed, is_moving) in [(0.28, false), (0.29, true)] {
        slow.solution
            .iter_mut()
            .for_each(|s| s.velocity.iter_mut().for_each(|(v, _)| *v = Vector3::x() * speed));
        assert_eq!(bodies(&sent(&[slow.clone()]))[4].starts_with("VTG,0.00,"), is_moving);
    }
}

#[test]
fn an_ellipse_has_the_axes_and_the_direction_of_its_covariance() {
    for degrees in [0.0, 30.0, 89.0, 90.0, 91.0, 179.0_f64] {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians()).to_rotation_matrix();
        for across in [0.0, 0.25] {
            let p = turn * Matrix3::from_diagonal(&Vector3::new(16.0, across, 1.0)) * turn.transpose();
            let (axes, direction) = ellipse(&p);
            // 10 ε of 16 m²; a zero is exact.
            assert!((axes[0] - 4.0).abs() < 1e-14 && (axes[1] - across.sqrt()).abs() < 4e-14, "{axes:?}");
            assert!((direction.to_degrees() - degrees).abs() < 1e-12, "{direction}");
        }
    }
}

#[test]
fn a_wrong_sentence_or_talker_is_an_error_that_says_what_is_right() {
    for (json, message) in [
        (r#"{"nmea": {"link": "l", "sentences": ["GSV"]}}"#, "expected one of `GGA`, `RMC`"),
        (r#"{"nmea": {"link": "l", "sentences": []}}"#, "there is no sentence to send"),
        (r#"{"nmea": {"link": "l", "talker": "gn"}}"#, "`gn` is not a talker"),
        (r#"{"nmea": {"link": "l", "talker": "PX"}}"#, "`PX` is not a talker"),
        (r#"{"nmea": {}}"#, "missing field `link`"),
    ] {
        let error = spec(json).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    assert_eq!(spec(r#"{"nmea": {"link": "l"}}"#).unwrap().link(), Some("l"));
}

/// Places and times all over the earth, with fast and slow vehicles.
fn many() -> Vec<Outgoing> {
    (0..200_u32)
        .map(|k| {
            let mut estimate = estimate();
            let share = |step: f64| (f64::from(k) * step).rem_euclid(1.0);
            estimate.gps_nanos = Some(NOW + i64::from(k) * 1_234_567_000_000);
            estimate.solution.iter_mut().for_each(|solution| {
                let height = 20_000.0 * share(0.317_811_7) - 1000.0;
                let (lat, lon) = (PI * (share(0.618_033_988_7) - 0.5), 2.0 * PI * (share(0.414_213_562_4) - 0.5));
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), share(0.732_050_8) * 7.0);
                let sigmas = Vector3::new(share(0.259_921) + 1.0, 9.0 * share(0.570_796), 2.0);
                let axes = turn.to_rotation_matrix();
                let p = axes * Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)) * axes.transpose();
                solution.position = Some((Geodetic { lat, lon, height }, p));
                solution.velocity = Some((turn * Vector3::x() * share(0.236_068) * 500.0, Matrix3::zeros()));
                solution.attitude = Some((turn, Matrix3::zeros()));
            });
            estimate
        })
        .collect()
}

#[test]
fn the_reader_of_nmea_gives_the_numbers_back() {
    fusion_formats::link();
    let many = many();
    let path = std::env::temp_dir().join(format!("fusion-live-{}.nmea", std::process::id()));
    let text = sent(&many);
    // The longest sentence of the standard, with its end.
    assert!(text.lines().all(|line| line.len() + 2 <= 82), "{text}");
    std::fs::write(&path, text).unwrap();
    let tables = LogTable::read_all(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let column = |topic: &str, name: &str| {
        let table = tables
            .iter()
            .find(|table| table.topic.as_ref().is_some_and(|t| t.name == topic))
            .unwrap();
        assert_eq!((table.malformed, &table.broken), (0, &None));
        table.columns.iter().find(|column| column.name == name).unwrap().values.clone()
    };
    // A number of the file, the number of the estimate, and half of the last digit.
    let check = |topic: &str, name: &str, half: f64, of: &dyn Fn(&Solution) -> f64| {
        let read = column(topic, name);
        assert_eq!(read.len(), many.len());
        for (read, estimate) in read.iter().zip(&many) {
            let expected = of(&estimate.solution.unwrap());
            // The meridian of 180° has two numbers. Rounding of the numbers themselves.
            let error = if name == "lon" {
                (read - expected + 180.0).rem_euclid(360.0) - 180.0
            } else {
                read - expected
            };
            assert!(error.abs() <= half + 1e-11, "{topic} {name}: {read} {expected}");
        }
    };
    let position = |solution: &Solution| solution.position.unwrap().0;
    let degrees = |radians: f64| radians.to_degrees().rem_euclid(360.0);
    for topic in ["GNGGA", "GNRMC"] {
        check(topic, "lat", 0.5e-7 / 60.0, &|solution| position(solution).lat.to_degrees());
        check(topic, "lon", 0.5e-7 / 60.0, &|solution| position(solution).lon.to_degrees());
    }
    check("GNGGA", "alt", 0.5e-3, &|solution| position(solution).height);
    check("GNRMC", "spd", 0.5e-2, &|solution| {
        solution.velocity.unwrap().0.norm() * 3600.0 / 1852.0
    });
    check("GNVTG", "sogk", 0.5e-2, &|solution| solution.velocity.unwrap().0.norm() * 3.6);
    check("GNHDT", "headingT", 0.5e-2, &|solution| degrees(solution.rpy().unwrap().0.z));
    check("GNGST", "stdAlt", 0.5e-3, &|solution| solution.position.unwrap().1[(2, 2)].sqrt());
    for (read, estimate) in column("GNZDA", "time").iter().zip(&many) {
        // A float of GPS time has a step of 256 ns.
        assert!((read - estimate.gps_nanos.unwrap() as f64).abs() <= 256.0, "{read}");
    }
}
