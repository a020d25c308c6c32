//! Topics whose type of messages shows what they are.

use super::*;
use fusion::source::table::{Role, Topic};

/// A drive to the north at 5 m/s, in degrees and metres. The positions scatter by `scatter` metres.
fn drive(role: Role, topic: &str, scatter: f64) -> LogTable {
    let table = table(
        &[
            ("t_s", &|t| t),
            ("lat", &move |t| (47e7 + (5.0 * t + scatter * noise(t, 1.0)) * 89.9).round()),
            ("lon", &move |t| (8.5e7 + scatter * noise(t, 2.0) * 131.0).round()),
            ("alt", &|t| 500_000.0 + 100.0 * t),
        ],
        300,
        5.0,
    );
    let mut table = LogTable {
        role,
        topic: Some(Topic {
            name: topic.to_owned(),
            message_type: topic.to_owned(),
        }),
        ..table
    };
    for (column, unit) in table.columns[1..].iter_mut().zip(["1e-7 deg", "1e-7 deg", "mm"]) {
        column.label = Some(format!("{} [{unit}]", column.name));
    }
    table
}

#[test]
fn the_type_of_messages_decides_what_is_measured() {
    let rows = [
        (Role::Other, "setpoint", 0.01),
        (Role::Estimate, "filter", 0.01),
        (Role::Truth, "simulation", 1.0),
        (Role::Measurement, "gps", 0.01),
        (Role::Measurement, "other_gps", 3.0),
    ];
    let logs = rows.map(|(role, topic, scatter)| Log::of(drive(role, topic, scatter)));
    assert!(logs[0].signals.is_empty() && logs[1].is_estimate());
    let looked = Inspection::look(logs.to_vec());
    let name = |found: &Option<(usize, Track)>| found.as_ref().map(|(k, _)| *k);
    assert_eq!((name(&looked.position), name(&looked.reference)), (Some(3), Some(2)));
    // By scatter alone, the better receiver would be taken for a truth.
    let measured = Inspection::look(logs[3..].to_vec());
    assert_eq!((name(&measured.position), name(&measured.reference)), (Some(0), None));
    let unknown =
        [(Role::Unknown, "a", 0.01), (Role::Unknown, "b", 3.0)].map(|(role, topic, scatter)| Log::of(drive(role, topic, scatter)));
    let guessed = Inspection::look(unknown.to_vec());
    assert_eq!((name(&guessed.position), name(&guessed.reference)), (Some(1), Some(0)));
}

#[test]
fn places_have_the_units_of_their_messages() {
    let log = Log::of(drive(Role::Measurement, "gps", 0.01));
    let place = log.signal(Kind::Geodetic).unwrap();
    assert_eq!((place.unit.as_str(), place.of_height), ("1e-7 deg", "mm"));
    let track = Track::of(&log, None).unwrap();
    let [lat, lon, height] = track.origin.unwrap();
    // 1e-7 deg and 1 mm: as the columns are rounded, with the scatter of 1 cm.
    assert!((lat.to_degrees() - 47.0).abs() < 2e-7 && (lon.to_degrees() - 8.5).abs() < 2e-7);
    assert!((height - 500.0).abs() < 1e-9);
    // 60 s at 5 m/s, by a mean radius of the Earth: within 0.2 %.
    assert!(
        (track.position.last().unwrap()[0] / 299.0 - 1.0).abs() < 2e-3,
        "{:?}",
        track.position.last()
    );
}

#[test]
fn notes_of_a_file_are_shown_once() {
    let mut logs = [drive(Role::Measurement, "gps", 0.01), drive(Role::Other, "state", 0.01)];
    for table in &mut logs {
        table.remarks = vec!["3 drop-outs of the logger".to_owned()];
        table.broken = Some("after byte 9: the file is cut off".to_owned());
    }
    let page = Inspection::look(logs.map(Log::of).to_vec()).page();
    let text = fusion_tables::text::page(&page, 200);
    assert_eq!(text.matches("3 drop-outs of the logger").count(), 1, "{text}");
    assert_eq!(text.matches("is damaged: after byte 9").count(), 1, "{text}");
    assert!(text.contains("no measurements, by the type of the messages"), "{text}");
}
