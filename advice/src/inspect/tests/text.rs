//! Text forms of a log: comments, several lines of names, several units in one file, times of day, recordings.

use super::loggers::{log, text};
use super::*;
use fusion::config::Document;
use fusion::examine::{Missing, examine, opening};
use fusion::run::Options;

/// The inspection of files with these names and texts, and the design that is written for them, if there is one. The
/// design has to open its files.
fn designed(files: &[(&str, String)]) -> (Inspection, String) {
    // Tests run in parallel, and files with the same name would collide.
    static NEXT: core::sync::atomic::AtomicUsize = core::sync::atomic::AtomicUsize::new(0);
    fusion_models::link();
    let number = NEXT.fetch_add(1, core::sync::atomic::Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("fusion-inspect-text-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |(name, text): &(&str, String)| {
        std::fs::write(folder.join(name), text).unwrap();
        folder.join(name)
    };
    let paths: Vec<PathBuf> = files.iter().map(write).collect();
    let looked = Inspection::of(&paths).unwrap();
    let design = looked.design(Path::new("/")).unwrap_or_default();
    if !design.is_empty() {
        let path = folder.join("design.toml");
        std::fs::write(&path, &design).unwrap();
        let options = Options::default();
        let opened = examine(Document::load(&path).unwrap(), &options, Missing::Told)
            .and_then(|read| opening(&read, &options, Missing::Told).unless_errors(()));
        if let Err(mistakes) = opened {
            panic!("{mistakes:?}\n{design}");
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
    (looked, design)
}

/// Samples of an inertial unit at rest, z down, with a different `seed` for each unit.
fn samples(k: usize, seed: f64) -> String {
    let x = 0.01 * noise(0.02 * k as f64, seed);
    format!("{x:.5},0.1,{:.5},{x:.5},{x:.5},{x:.5}", x - 9.81)
}

const NAMES: &str = "acc_x_mps2,acc_y_mps2,acc_z_mps2,gyro_x_radps,gyro_y_radps,gyro_z_radps";

#[test]
fn comments_before_the_names_are_declared_and_one_of_them_may_tell_the_rate() {
    let row = |k: usize| format!("{},{}", 700 + k, samples(k, 1.0));
    let header = |mark: &str| format!("{mark} Start Time: 0\n{mark} Sample rate: 50.0Hz\nCounter,{NAMES}");
    for mark in ["//", "#", "%"] {
        let (looked, design) = designed(&[("unit.txt", text(&header(mark), 500, &row))]);
        let clock = looked.logs[0].clock.as_ref().unwrap();
        assert!((clock.rate - 50.0).abs() < 1e-9 && (clock.span().1 - clock.span().0 - 9.98).abs() < 1e-9);
        assert!(design.contains(&format!("comment = \"{mark}\"")), "{design}");
        assert!(design.contains("time = { column = \"Counter\", rate = \"50 Hz\" }"), "{design}");
    }
    // Without that comment, no rate is invented.
    let silent = header("#").replace("50.0Hz", "unknown");
    let (looked, design) = designed(&[("unit.txt", text(&silent, 500, &row))]);
    assert!(design.is_empty() && looked.missing().join(" ").contains("counts its rows"));
    // A comment may hold the names, or the mark may be a part of the only line of names.
    let within = format!("# made by hand\n# t,{NAMES}");
    let row = |k: usize| format!("{:.2},{}", 0.02 * k as f64, samples(k, 1.0));
    let (looked, design) = designed(&[("unit.txt", text(&within, 500, &row))]);
    assert!(
        looked.logs[0].table.rows() == 500 && design.contains("header = \"comment\""),
        "{design}"
    );
    let (looked, design) = designed(&[("unit.txt", text(&format!("#t,{NAMES}"), 500, &row))]);
    assert!(looked.logs[0].table.rows() == 500 && !design.contains("comment ="), "{design}");
}

#[test]
fn two_lines_of_names_are_joined_where_the_first_stands_for_several_columns() {
    let short = "acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z";
    let of = |unit: &str| [unit; 6].join(",");
    let header = format!(",{},{}\n,{short},{short}", of("left"), of("right"));
    let row = |k: usize| format!("{:.2},{},{}", 0.02 * k as f64, samples(k, 1.0), samples(k, 5.0));
    let (looked, design) = designed(&[("feet.csv", text(&header, 500, &row))]);
    assert_eq!((looked.logs[0].table.rows(), looked.logs[0].table.malformed), (500, 0));
    assert!(
        design.contains("\"left_acc_x\", \"left_acc_y\", \"left_acc_z\"], unit = \"m/s^2\""),
        "{design}"
    );
    assert!(design.contains("skip = 2") && !design.contains("bad_rows"), "{design}");
    // The other unit is named as a choice.
    let said = format!("{:?}", looked.page().sections[0]);
    assert!(
        said.contains("holds 2 inertial units") && said.contains("`right_acc_x` `right_acc_y` `right_acc_z` with `right_gyr_x`"),
        "{said}"
    );
}

#[test]
fn a_line_of_units_is_passed_over_and_tells_the_units() {
    let header = "time,ax,ay,az,gx,gy,gz\nms,g,g,g,deg/s,deg/s,deg/s";
    let row = |k: usize| {
        format!(
            "{},0.01,{:.4},-1.0,{:.4},0.2,0.1",
            20 * k,
            0.01 * noise(0.02 * k as f64, 1.0),
            noise(0.02 * k as f64, 2.0)
        )
    };
    let (looked, design) = designed(&[("unit.csv", text(header, 500, &row))]);
    let log = &looked.logs[0];
    assert_eq!((log.table.rows(), log.clock.as_ref().unwrap().unit), (500, "ms"));
    assert_eq!(log.signal(Kind::AngularRate).unwrap().unit, "deg/s");
    assert!(
        design.contains("skip = 1") && design.contains("columns = [\"gx\", \"gy\", \"gz\"], unit = \"deg/s\""),
        "{design}"
    );
}

#[test]
fn a_name_that_stands_twice_is_written_as_the_number_of_its_column() {
    let header = format!("t,{NAMES},note,note");
    let row = |k: usize| format!("{:.2},{},{k},1", 0.02 * k as f64, samples(k, 1.0));
    let found = log("unit.csv", &text(&header, 100, &row));
    let names: Vec<&str> = found.table.columns[6..].iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["gyro_z_radps", "8", "9"]);
}

/// Fixes at 5 Hz, from 08:15:50 on, with stamps in the form of `clock`.
fn fixes_at(clock: &dyn Fn(usize, usize, f64) -> String) -> String {
    let row = |k: usize| {
        let t = 0.2 * k as f64 + 50.0;
        let of = clock(8, 15 + (t / 60.0 + 1e-9) as usize, t - 60.0 * (t / 60.0 + 1e-9).floor());
        format!(
            "{of},{:.7},8.5699,{:.2}",
            53.54 + 5e-6 * k as f64,
            40.0 + 0.1 * noise(0.2 * k as f64, 3.0)
        )
    };
    text("UTC,Latitude (deg),Longitude (deg),EllHeight (m)", 600, &row)
}

/// An inertial unit over the same two minutes, 50 Hz.
fn unit_at(date: &str) -> String {
    let row = |k: usize| {
        let t = 0.02 * k as f64 + 50.0;
        let minute = (t / 60.0 + 1e-9).floor();
        format!(
            "{date}08:{:02}:{:05.2},{}",
            15 + minute as usize,
            t - 60.0 * minute,
            samples(k, 1.0)
        )
    };
    text(&format!("UTC,{NAMES}"), 6000, &row)
}

#[test]
fn times_of_day_are_given_the_day_of_another_file() {
    let digits = |h: usize, m: usize, s: f64| format!("{h:02}{m:02}{s:05.2}");
    let colons = |h: usize, m: usize, s: f64| format!("{h:02}:{m:02}:{s:05.2}");
    for clock in [&digits as &dyn Fn(usize, usize, f64) -> String, &colons] {
        let (looked, design) = designed(&[("gnss.csv", fixes_at(clock)), ("imu.csv", unit_at("2026-06-14T"))]);
        let clocks: Vec<&Clock> = looked.logs.iter().map(|log| log.clock.as_ref().unwrap()).collect();
        assert_eq!((clocks[0].gaps, clocks[0].backwards), (0, 0), "{:?}", clocks[0].longest);
        // Both begin at 08:15:50.
        assert!((clocks[0].span().0 - clocks[1].span().0).abs() < 1e-3);
        assert!(
            design.contains("calendar = \"utc\", day = \"2026-06-14\", epoch = \"2026-06-14T08:15:50Z\""),
            "{design}"
        );
        assert!(design.contains("guessed: the day of `imu.csv`"), "{design}");
    }
    // 2026-06-14T08:15:50Z in seconds since 1970.
    let row = |k: usize| format!("{:.2},{}", 1_781_424_950.0 + 0.02 * k as f64, samples(k, 1.0));
    let (_, design) = designed(&[
        ("gnss.csv", fixes_at(&digits)),
        ("imu.csv", text(&format!("t_s,{NAMES}"), 6000, &row)),
    ]);
    assert!(
        design.contains("day = \"2026-06-14\"") && design.contains("counts_from = \"unix\""),
        "{design}"
    );
    // No file gives the day: the logs still match, and the design says what to declare.
    let (looked, design) = designed(&[("gnss.csv", fixes_at(&digits)), ("imu.csv", unit_at(""))]);
    assert!(
        looked.position.is_some() && design.contains("put in that of the first row as `day`"),
        "{design}"
    );
    assert!(
        design.contains("day = \"2000-01-01\", epoch = \"2000-01-01T08:15:50Z\""),
        "{design}"
    );
}

#[test]
fn times_of_day_go_on_after_midnight_and_seconds_stay_seconds() {
    let late = |k: usize| {
        let t = (86_340 + k) % 86_400;
        format!("{:02}{:02}{:02}.0,{}", t / 3600, t / 60 % 60, t % 60, samples(k, 1.0))
    };
    let found = log("night.csv", &text(&format!("utc_time,{NAMES}"), 200, &late));
    let clock = found.clock.as_ref().unwrap();
    assert!(
        (clock.span().1 - clock.span().0 - 199.0).abs() < 1e-3 && clock.backwards == 0,
        "{clock:?}"
    );
    // Seconds reach sixty and more in their last two digits.
    let seconds = |k: usize| format!("{}.0,{}", 100_000 + k, samples(k, 1.0));
    let found = log("day.csv", &text(&format!("utc_time,{NAMES}"), 200, &seconds));
    let clock = found.clock.as_ref().unwrap();
    assert!(clock.form == Form::Count && (clock.span().1 - clock.span().0 - 199.0).abs() < 1e-9);
}

#[test]
fn recordings_with_a_number_are_put_one_after_the_other() {
    let row = |k: usize| format!("{},{:.2},{}", 3 + k / 500, 0.02 * (k % 500) as f64, samples(k, 1.0));
    let (looked, design) = designed(&[("runs.csv", text(&format!("run,t_s,{NAMES}"), 1500, &row))]);
    let clock = looked.logs[0].clock.as_ref().unwrap();
    // 9.98 s, and 10 s between them.
    assert_eq!(clock.form, Form::Recordings { second: 0, each: 20 });
    assert_eq!((clock.resets, clock.gaps), (0, 2));
    assert!(
        design.contains("plus = { column = \"run\", each = \"20 s\" }") && design.contains("longest_gap = \"5 s\""),
        "{design}"
    );
    assert!(format!("{:?}", looked.page().sections[0]).contains("holds 3 recordings"));
    // A column that also steps elsewhere does not number the recordings.
    let other = |k: usize| format!("{},{:.2},{}", k / 100, 0.02 * (k % 500) as f64, samples(k, 1.0));
    let (looked, design) = designed(&[("runs.csv", text(&format!("run,t_s,{NAMES}"), 1500, &other))]);
    assert!(design.is_empty() && looked.missing().join(" ").contains("time.plus"));
}

#[test]
fn of_two_columns_of_time_that_of_the_other_files_is_taken() {
    let row = |k: usize| format!("{:.2},{:.2},{}", 0.02 * k as f64, 5000.0 + 0.02 * k as f64, samples(k, 1.0));
    let imu = text(&format!("time,host_time,{NAMES}"), 6000, &row);
    let gnss = |name: &str| {
        let fix = |k: usize| format!("{:.1},{:.7},8.5699,40.0", 5000.0 + 0.2 * k as f64, 53.54 + 5e-6 * k as f64);
        text(&format!("{name},lat_deg,lon_deg,alt_m"), 600, &fix)
    };
    let column = |name: &str| {
        let (looked, _) = designed(&[("imu.csv", imu.clone()), ("gnss.csv", gnss(name))]);
        let log = &looked.logs[0];
        log.table.columns[log.clock.as_ref().unwrap().column].name.clone()
    };
    assert_eq!(column("host_time"), "host_time");
    assert_eq!(column("stamp"), "time");
}

#[test]
fn a_speed_that_stays_the_same_is_measured_and_one_that_is_held_is_not() {
    // At rest for half of the time, at 5 m/s for a quarter; and a new value only in every fifth row.
    let moving = |t: f64| (10.0 * (t - 60.0).clamp(0.0, 5.0) * 100.0).round() / 1000.0;
    let declared = |each: usize| {
        let row = |k: usize| {
            let t = 0.1 * (k - k % each) as f64;
            let v = if each == 1 { moving(t) } else { 5.0 + noise(t, 2.0) };
            format!("{:.1},{v}", 0.1 * k as f64)
        };
        let found = log("wheels.csv", &text("t_s,speed_mps", 1200, &row));
        let signal = found.signal(Kind::Speed).unwrap();
        (found.repeats(signal).share, found.repeats_are_copies(&[signal]))
    };
    let (share, copies) = declared(1);
    assert!(share > 0.9 && !copies, "{share}");
    let (share, copies) = declared(5);
    assert!(share > 0.7 && copies, "{share}");
}

#[test]
fn an_axis_that_never_changes_has_a_limit_that_can_be_met() {
    let row = |k: usize| {
        format!(
            "{:.2},0.1,{},{},{},{},0.002",
            0.02 * k as f64,
            samples_y(k),
            -9.81,
            0.001 * noise(0.02 * k as f64, 2.0),
            k % 700 / 600
        )
    };
    let found = log("unit.csv", &text(&format!("t_s,{NAMES}"), 3000, &row));
    let rest = Imu::of(&found, &|_| Some(true)).unwrap().rest.unwrap();
    // x and z of the force never change: they take the limit of y. y of the gyros is constant in most windows: half of
    // its step.
    assert!(rest.accel_std[0] > 0.0 && rest.accel_std[0] == rest.accel_std[1] && rest.accel_std[2] == rest.accel_std[1]);
    assert!(rest.gyro_std.iter().all(|s| *s > 0.0), "{rest:?}");
}

fn samples_y(k: usize) -> String {
    format!("{:.4}", 0.02 * noise(0.02 * k as f64, 1.0))
}

#[test]
fn what_is_too_short_for_an_axis_has_no_force_that_is_not_a_number() {
    let row = |k: usize| format!("{:.2},{}", 0.02 * k as f64, samples(k, 1.0));
    let looked = Inspection::look(vec![log("unit.csv", &text(&format!("t_s,{NAMES}"), 20, &row))]);
    assert!(looked.imu.is_none() && looked.missing().join(" ").contains("which axis points up"));
    assert!(!format!("{:?}", looked.page()).contains("mean force"));
    // The advice is one sentence.
    let said = format!("{:?}", looked.design(Path::new("/")).unwrap_err());
    assert!(said.contains("`Missing`") && !said.contains("axis points up"), "{said}");
}
