//! Stamps, arrays and rows.

use super::*;
use fusion::source::{LogFormat, OwnClock};

#[test]
fn rows_that_do_not_change_are_counted() {
    let log = Log::of(unit());
    let force = log.signal(Kind::SpecificForce).unwrap();
    assert_eq!(log.repeats(force).share, 0.0);
    // From 10 s to 14 s the instrument is stuck; one axis that goes on is not enough to be alive.
    let mut stuck = unit();
    for k in 1..4 {
        let held = stuck.columns[k].values[500];
        stuck.columns[k].values[500..700].fill(held);
    }
    let log = Log::of(stuck);
    let repeats = log.repeats(log.signal(Kind::SpecificForce).unwrap());
    assert!((repeats.share - 199.0 / 2999.0).abs() < 1e-9, "{repeats:?}");
    // From the first row of the held value to the last.
    assert!((repeats.longest - 199.0 / 50.0).abs() < 1e-6, "{repeats:?}");
    assert_eq!(log.repeats(log.signal(Kind::AngularRate).unwrap()).share, 0.0);
}

#[test]
fn a_stuck_instrument_is_declared_by_its_repeats() {
    let mut held = unit();
    for column in &mut held.columns[1..] {
        (0..3000).for_each(|row| column.values[row] = column.values[row - row % 2]);
    }
    let text = Inspection::look(vec![Log::of(held)]).design(Path::new("/")).unwrap();
    assert!(
        text.contains("repeats = \"drop\"") && text.contains("50 % of the rows repeat"),
        "{text}"
    );
    let sound = Inspection::look(vec![Log::of(unit())]).design(Path::new("/")).unwrap();
    assert!(!sound.contains("repeats"), "{sound}");
}

#[test]
fn several_recordings_in_a_file_are_named_and_refused() {
    let mut twice = unit();
    let half = twice.rows() / 2;
    (half..2 * half).for_each(|row| twice.columns[0].values[row] -= 25.0);
    let looked = Inspection::look(vec![Log::of(twice)]);
    assert_eq!(looked.logs[0].clock.as_ref().unwrap().resets, 1);
    let missing = looked.missing().join("\n");
    assert!(
        missing.contains("goes back by more than a second 1 time") && missing.contains("time.plus"),
        "{missing}"
    );
    assert!(looked.design(Path::new("/")).is_err());
    assert!(!Inspection::look(vec![Log::of(unit())]).missing().join("\n").contains("goes back"));
}

/// The line `time = …` of a minute of samples whose stamps are written so: header and cells, of seconds after noon of
/// 1 May 2024, 13:00 in Paris.
fn time_of(name: &str, header: &str, delimiter: &str, cells: &dyn Fn(f64) -> String) -> String {
    let titles = [header, "ax_mps2", "ay_mps2", "az_mps2", "wx_radps", "wy_radps", "wz_radps"];
    let mut text = titles.join(delimiter) + "\n";
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let samples = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|seed| 0.01 * noise(t, seed) - if seed == 3.0 { 9.81 } else { 0.0 });
        let samples: Vec<String> = samples.iter().map(|x| format!("{x:.6}")).collect();
        text += &format!("{}{delimiter}{}\n", cells(t), samples.join(delimiter));
    }
    let path = std::env::temp_dir().join(format!("fusion-inspect-{}-{name}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let looked = Inspection::of(core::slice::from_ref(&path)).unwrap();
    std::fs::remove_file(path).unwrap();
    let clock = looked.logs[0].clock.as_ref().unwrap();
    // In double precision stamps of this century are known to 0.24 us, 1.2e-5 of the interval, at both of its ends.
    assert!(
        (clock.rate - 50.0).abs() < 2e-3 && clock.ties == 0 && clock.backwards == 0,
        "{name}: {clock:?}"
    );
    let design = looked.design(Path::new("/")).unwrap();
    let line = design.lines().find(|l| l.starts_with("time = ")).unwrap_or_default();
    line.split("  #").next().unwrap_or_default().to_owned()
}

#[test]
fn stamps_of_calendars_weeks_and_two_columns_are_declared() {
    let clock = |t: f64| format!("12:{:02}:{:05.2}", (t / 60.0) as u8, t % 60.0);
    let noon = "epoch = \"2024-05-01T12:00:00Z\" }";
    assert_eq!(
        time_of("iso", "when", ",", &|t| format!("2024-05-01T{}Z", clock(t))),
        format!("time = {{ column = \"when\", calendar = \"utc\", {noon}")
    );
    assert_eq!(
        time_of("slashes", "stamp", ";", &|t| format!("2024/05/01 {}", clock(t))),
        format!("time = {{ column = \"stamp\", calendar = \"utc\", {noon}")
    );
    assert_eq!(
        time_of("apart", "date,time", ",", &|t| format!("2024-05-01,{}", clock(t))),
        format!("time = {{ column = \"time\", date = \"date\", calendar = \"utc\", {noon}")
    );
    // 1 May 2024 is a Wednesday of GPS week 2312; GPS time is 18 s ahead of UTC.
    assert_eq!(
        time_of("week", "week,tow_s", ",", &|t| format!("2312,{:.2}", 3.5 * 86_400.0 + 18.0 + t)),
        format!("time = {{ column = \"tow_s\", plus = {{ column = \"week\", each = \"604800 s\" }}, counts_from = \"gps\", {noon}")
    );
    let whole = |t: f64| 1_714_564_800 + (t + 1e-9) as u64;
    assert_eq!(
        time_of("split", "sec,nanosec", ",", &|t| format!(
            "{},{:.0}",
            whole(t),
            1e7 * (100.0 * ((t + 1e-9) % 1.0)).floor()
        )),
        "time = { column = \"sec\", plus = { column = \"nanosec\", each = \"1 ns\" }, epoch = 1714564800 }"
    );
}

#[test]
fn unix_stamps_are_brought_to_a_calendar_beside_them() {
    let logs = |first: f64| {
        let mut of_gps = unit();
        of_gps.columns[0].calendar = Some(fusion::source::table::Calendar { scale: "utc", date: None });
        // 1 May 2024, 12:00 UTC in GPS time.
        of_gps.columns[0].values.iter_mut().for_each(|t| *t = 1e9 * (*t + 1_398_600_018.0));
        let mut counted = fixes(-1.0);
        counted.columns[0].values.iter_mut().for_each(|t| *t += first);
        Inspection::look(vec![Log::of(of_gps), Log::of(counted)])
    };
    for (first, origin) in [(1_714_564_800.0, Origin::Unix), (1_398_600_018.0, Origin::Gps)] {
        let looked = logs(first);
        let clock = looked.logs[1].clock.as_ref().unwrap();
        assert_eq!(clock.origin, origin);
        assert!((clock.span().0 - 1_398_600_018.0).abs() < 1e-6, "{:?}", clock.span());
        let design = looked.design(Path::new("/")).unwrap();
        let name = if origin == Origin::Unix { "unix" } else { "gps" };
        assert!(design.contains(&format!("counts_from = \"{name}\"")), "{design}");
    }
}

/// A file of MATLAB, version 5, with arrays of so many columns.
fn matlab(arrays: &[(&str, usize, &[f64])]) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend_from_slice(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let whole = |v: [u32; 2]| v.map(u32::to_le_bytes).concat();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend_from_slice(&[0, 1, b'I', b'M']);
    for (name, columns, values) in arrays {
        let numbers: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let shape = [(values.len() / columns) as u32, *columns as u32];
        let parts = [
            element(6, &whole([6, 0])),
            element(5, &whole(shape)),
            element(1, name.as_bytes()),
            element(9, &numbers),
        ];
        file.extend(element(14, &parts.concat()));
    }
    file
}

#[test]
fn arrays_of_matlab_are_listed_and_declared() {
    let of = unit();
    let three = |first: usize| {
        of.columns[first..first + 3]
            .iter()
            .flat_map(|c| c.values.clone())
            .collect::<Vec<_>>()
    };
    let (force, rate) = (three(1), three(4));
    let samples: [(&str, usize, &[f64]); 2] = [("imu_acc", 3, &force), ("imu_gyr", 3, &rate)];
    let stamps: (&str, usize, &[f64]) = ("time", 1, &of.columns[0].values);
    for (more, time) in [
        (("sampling_rate", 1, &[50.0][..]), "time = { rate = \"50 Hz\" }"),
        (stamps, "time = { column = \"time\" }"),
    ] {
        let path = std::env::temp_dir().join(format!("fusion-inspect-{}-{}.mat", std::process::id(), more.0));
        std::fs::write(&path, matlab(&[&samples[..], &[more]].concat())).unwrap();
        let looked = Inspection::of(core::slice::from_ref(&path)).unwrap();
        std::fs::remove_file(path).unwrap();
        let arrays = &looked.logs[0].table.arrays;
        assert!(arrays.contains(&("imu_acc".to_owned(), "3000×3".to_owned())), "{arrays:?}");
        let design = looked.design(Path::new("/")).unwrap();
        assert!(design.contains("type = \"mat\"") && design.contains(time), "{design}");
        assert!(
            design.contains("specific_force = { columns = [\"imu_acc(:,1)\", \"imu_acc(:,2)\", \"imu_acc(:,3)\"]"),
            "{design}"
        );
    }
}

#[test]
fn clocks_of_two_time_scales_are_apart_by_leap_seconds_and_the_rest_is_a_delay() {
    // A unit in UTC, fixes in GPS time, in 2024: 18 s. The receiver is late or early by 0.48 s.
    for lag in [18.0, 18.48, -18.48, -17.52] {
        assert_eq!(
            leap_seconds(lag, [1_714_564_800.0, 1_714_564_818.0]),
            Some(f64::copysign(18.0, lag))
        );
    }
    // 1 September 2016: 17 s. Another offset, or clocks without a date, have no leap seconds.
    assert_eq!(leap_seconds(17.3, [1_472_688_000.0; 2]), Some(17.0));
    assert_eq!(leap_seconds(12.0, [1_714_564_800.0; 2]), None);
    assert_eq!(leap_seconds(18.0, [100.0, 118.0]), None);
}

/// A format whose stamps count from the start of the sender.
static COUNTED: LogFormat = LogFormat {
    name: "counted",
    clock: Some(OwnClock {
        unit: "us",
        counts_from: None,
    }),
    endings: &[],
    recognises: |_| false,
    read: |_| Ok(Vec::new()),
};

#[test]
fn stamps_of_one_sender_are_used_and_those_of_two_senders_are_not_comparable() {
    const RECORDED: f64 = 1.7e9;
    let sent = |start: f64| {
        let stamp = move |t: f64| 1e6 * (t + 60.0 - start);
        let delayed = move |t: f64| 1e6 * (RECORDED + t + 0.2 * noise(t, 1.0).abs());
        LogTable {
            format: &COUNTED,
            ..table(&[("stamp", &stamp), ("log_time", &delayed)], 100, 10.0)
        }
    };
    let columns = |starts: [f64; 2]| {
        let mut tables = starts.map(sent);
        super::clock::agree(&mut tables);
        tables.map(|table| super::clock::Clock::of(&table).unwrap().column)
    };
    assert_eq!(columns([0.0, 0.0]), [0, 0]);
    assert_eq!(columns([0.0, 30.0]), [1, 1]);
}

#[test]
fn stamps_of_one_name_have_one_unit() {
    let from = |starts: [f64; 2], names: [&'static str; 2], steps: [f64; 2]| {
        let mut tables = [0, 1].map(|k| {
            let stamp = move |t: f64| starts[k] + t * steps[k];
            table(&[(names[k], &stamp)], 100, 1.0)
        });
        super::clock::agree(&mut tables);
        tables.map(|table| super::clock::Clock::of(&table).unwrap().unit)
    };
    let units = |names, steps| from([0.0; 2], names, steps);
    // An inertial unit at 50 Hz, and acoustic fixes each 5 s: alone, 5 would be taken for milliseconds.
    assert_eq!(units(["t", "t"], [0.02, 5.0]), ["s", "s"]);
    // 200 Hz and 1 Hz in milliseconds: alone, 1000 would be taken for microseconds.
    assert_eq!(units(["t", "t"], [5.0, 1000.0]), ["ms", "ms"]);
    // Names that differ may count differently.
    assert_eq!(units(["t", "time"], [0.02, 5.0]), ["s", "ms"]);
    assert_eq!(units(["t_us", "t_us"], [0.02, 5.0]), ["us", "us"]);
    // Dates tell their units.
    assert_eq!(from([1.7e9, 1.7e12], ["t", "t"], [0.02, 20.0]), ["s", "ms"]);
}
