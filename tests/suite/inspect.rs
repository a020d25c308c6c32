//! First designs that are guessed from recorded logs, compared with the designs that were made by hand.

use crate::real::{data, recorded};
use crate::support::{Workspace, stderr, stdout};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{Options, Summary, run};
use fusion_advice::inspect::{Inspection, files};
use std::path::Path;

/// Runs the design that is guessed from these files of the recorded logs; `None` without the data.
fn guessed(paths: &[&str]) -> Option<Summary> {
    guessed_and(paths, "")
}

/// The same with more lines at its end.
fn guessed_and(paths: &[&str], more: &str) -> Option<Summary> {
    let data = data()?;
    let paths: Vec<_> = paths.iter().map(|path| data.join(path)).collect();
    let inspection = Inspection::of(&files(&paths).unwrap_or_else(|e| panic!("{e}"))).unwrap_or_else(|e| panic!("{e}"));
    let text = inspection
        .design(Path::new("/"))
        .unwrap_or_else(|e| panic!("{}", fusion::config::Diagnostics::from(e)));
    let text = text + more;
    let (document, mistakes) = Document::parse("first.toml", &text);
    assert!(mistakes.is_empty(), "{text}");
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}\n{text}"));
    Some(run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|e| panic!("{e}\n{text}")))
}

/// The horizontal RMS of a guessed design [m].
fn horizontal(paths: &[&str]) -> Option<f64> {
    Some(guessed(paths)?.score().unwrap().horizontal_rms)
}

#[test]
fn a_car_runs_by_what_is_guessed_from_its_folder() {
    let Some(summary) = guessed(&["pntos_cobra_car/derived"]) else {
        return;
    };
    let score = summary.score().unwrap();
    // By hand 1.435 m. Measured 1.877 m: 1.2 m of it is the offset of the reference point, which is ahead of the unit
    // and in no file. A wrong axis, sign or unit costs tens of metres. One twentieth is left for tuning.
    assert!(score.horizontal_rms < 1.98, "{}", score.horizontal_rms);
    // By hand 0.36 deg; 0.46 measured.
    assert!(score.attitude_deg.unwrap().rms[2] < 0.6, "{:?}", score.attitude_deg);
}

#[test]
fn a_car_that_creeps_in_an_outage_is_not_taken_for_one_that_stands() {
    let outages =
        "\n[source.gnss.fault.outage]\ntype = \"outage\"\nwindow = { from = \"300 s\", duration = \"60 s\", every = \"180 s\" }\n";
    let Some(summary) = guessed_and(&["pntos_cobra_car/derived"], outages) else {
        return;
    };
    // Measured 12.2 m at the end of a minute without GNSS, and 45.8 m when one row of a standstill was used at 1.2 m/s.
    let largest = summary.score().unwrap().horizontal_max;
    assert!(largest < 16.0, "{largest}");
}

#[test]
fn a_car_whose_unit_sits_backwards_and_upside_down_runs_too() {
    let Some(summary) = guessed(&["rtklibexplorer_drive/derived"]) else {
        return;
    };
    let score = summary.score().unwrap();
    // By hand 0.037 m. Measured 0.044 m, and 0.44 m before the drift of its clock was guessed.
    assert!(score.horizontal_rms < 0.05, "{}", score.horizontal_rms);
    // Other fixes of its receiver judge it, with the same delay as the used fixes. Without the declared latency NEES
    // was 11 of 3.
    assert_eq!(summary.judge().source.as_deref(), Some("gnss"));
    assert!(score.nees_velocity.as_ref().unwrap().mean < 5.0, "{:?}", score.nees_velocity);
}

#[test]
fn odometers_doppler_logs_and_attitude_references_are_found() {
    if !recorded() {
        return;
    }
    // The guessed designs use positions once per second, the designs by hand once per minute. So these errors are
    // smaller than those by hand, and only show that axes and signs are right. Measured 0.67 m and 0.30 m.
    let auv = ["20220712_0_1.csv", "20220719_6_1.csv"].map(|f| horizontal(&[&format!("auv_navigation_dataset/original/{f}")]).unwrap());
    assert!(auv[0] < 1.0 && auv[1] < 0.5, "{auv:?}");
    // Fixes of 1.3 m judge it: a wrong sign of the turn costs tens of metres. Measured 1.57 m, and 2.57 m when the
    // correlation time of the slow error of GPS was taken as ten minutes.
    let husky = horizontal(&["robot_localization_husky/derived"]).unwrap();
    assert!(husky < 1.8, "{husky}");
}

#[test]
fn an_attitude_is_guessed_from_gyros_gravity_and_field() {
    let Some(summary) = guessed(&["broad_ahrs/derived/02.csv.gz"]) else {
        return;
    };
    let score = summary.score().unwrap();
    // By hand 0.5 deg of inclination and 1.2 deg of heading; measured 0.4 and 1.2. A wrong axis costs 90 deg.
    let rms = score.attitude_deg.unwrap().rms;
    assert!(rms[0] < 1.0 && rms[1] < 1.0 && rms[2] < 2.5, "{rms:?}");
}

#[test]
fn gyros_that_hands_turn_fast_are_told_from_slow_ones_by_the_field() {
    // Its rates reach 12 rad/s. Judged by their size alone they were taken as degrees per second: 36 and 45 deg of
    // error.
    let Some(summary) = guessed(&["broad_ahrs/derived/31.csv.gz"]) else {
        return;
    };
    let rms = summary.score().unwrap().attitude_deg.unwrap().rms;
    // Measured 1.5 deg; by hand 1.4.
    assert!(rms.iter().all(|rms| *rms < 3.0), "{rms:?}");
}

#[test]
fn a_log_without_names_that_counts_from_its_own_beginning_is_brought_to_the_fixes() {
    let Some(data) = data() else { return };
    let drive = data.join("rtklibexplorer_drive");
    for fixes in ["derived/gnss.csv", "original/gnss_1934_sf.pos"] {
        let logs = [drive.join("original/imu_1934.csv"), drive.join(fixes)];
        let text = Inspection::of(&logs)
            .unwrap_or_else(|e| panic!("{e}"))
            .design(Path::new("/"))
            .unwrap();
        // Its clock began 258.18 s before the clock of the fixes in seconds. Half a coarse step is 0.125 s.
        let offset = if fixes.ends_with(".pos") {
            "offset = \"14"
        } else {
            "offset = \"-258."
        };
        assert!(text.contains(offset), "{text}");
        assert_eq!(text.contains("type = \"rtklib\""), fixes.ends_with(".pos"), "{text}");
        let Some(rms) = horizontal(&[
            "rtklibexplorer_drive/original/imu_1934.csv",
            &format!("rtklibexplorer_drive/{fixes}"),
        ]) else {
            return;
        };
        // Lost for 491 s when the clocks were not aligned. Measured 1.45 m, since the fixes judge with their own clock,
        // and the clock of the unit is 0.18 s away. A wrong axis costs tens of metres.
        assert!(rms < 2.0, "{fixes}: {rms}");
    }
}

#[test]
fn what_cannot_be_guessed_is_said() {
    let Some(data) = data() else { return };
    let inspection = Inspection::of(&files(&[data.join("adis16405_static/derived")]).unwrap()).unwrap();
    let missing = inspection.missing().join("\n");
    assert!(missing.contains("has no column of time"), "{missing}");
    let error = fusion::config::Diagnostics::from(inspection.design(Path::new("/")).unwrap_err()).render(false);
    assert!(error.contains("`Missing`") && !error.contains("column of time"), "{error}");
}

/// A robot on a winding path: an odometer, a gyro about the vertical and fixes.
fn robot(w: &Workspace) {
    let (mut odometer, mut fixes) = ("t,speed_mps,yawrate_radps\n".to_owned(), "t,lat_deg,lon_deg,h_m\n".to_owned());
    let (mut north, mut east) = (0.0_f64, 0.0_f64);
    for k in 0..3000 {
        let t = 0.1 * f64::from(k);
        let heading = 0.8 * (0.05 * t).sin();
        north += 0.1 * heading.cos();
        east += 0.1 * heading.sin();
        odometer += &format!("{t:.2},{:.4},{:.6}\n", 1.0 + 1e-4 * f64::from(k % 7), 0.04 * (0.05 * t).cos());
        if k % 10 == 0 {
            let (lat, lon) = (45.0 + north / 111_132.0, 10.0 + east / 78_847.0);
            fixes += &format!("{t:.2},{lat:.9},{lon:.9},{:.1}\n", 100.0 + f64::from(k % 20) * 0.01);
        }
    }
    std::fs::create_dir_all(w.path("log")).unwrap();
    w.write("log/odometry.csv", odometer);
    w.write("log/gnss.csv", fixes);
}

#[test]
fn from_a_folder_to_a_running_filter_in_two_commands() {
    let w = Workspace::new("inspect-folder");
    robot(&w);
    let looked = w.fusion(&["inspect", "log", "--write", "first.toml"]).success();
    assert!(stdout(&looked).contains("`fusion run first.toml`"), "{}", stdout(&looked));
    let design = w.read("first.toml");
    assert!(design.contains("guessed") && design.contains("type = \"odometer\""), "{design}");
    w.fusion(&["check", "first.toml"]).success();
    let ran = w.fusion(&["run", "first.toml"]).success();
    assert!(stdout(&ran).contains("gnss_position"), "{}", stdout(&ran));

    // An existing design is not replaced.
    let again = w.fusion(&["inspect", "log", "--write", "first.toml"]).code(2);
    assert!(stderr(&again).contains("is there already"), "{}", stderr(&again));
    assert_eq!(w.read("first.toml"), design);
}

/// The odometer counts since 1970, the fixes have dates. Neither clock cuts off a minute of the log.
#[test]
fn files_with_clocks_of_their_own_are_brought_together_by_what_they_count_from() {
    let w = Workspace::new("inspect-clocks");
    robot(&w);
    let rewrite = |name: &str, stamp: &dyn Fn(f64) -> String| {
        let text = w.read(name);
        let rows = text.lines().enumerate().map(|(k, line)| match line.split_once(',') {
            Some((t, rest)) if k > 0 => format!("{},{rest}\n", stamp(t.parse().unwrap())),
            _ => format!("{line}\n"),
        });
        w.write(name, rows.collect::<String>());
    };
    rewrite("log/odometry.csv", &|t| format!("{:.2}", 1_714_564_800.0 + t));
    rewrite("log/gnss.csv", &|t| {
        format!("2024/05/01 12:{:02}:{:05.2}", (t / 60.0) as u8, t % 60.0)
    });
    let looked = w.fusion(&["inspect", "log", "--write", "first.toml"]).success();
    assert!(stdout(&looked).contains("calendar"), "{}", stdout(&looked));
    let design = w.read("first.toml");
    assert!(
        design.contains("counts_from = \"unix\"") && design.contains("calendar = \"utc\""),
        "{design}"
    );
    w.fusion(&["check", "first.toml"]).success();
    let ran = w.fusion(&["run", "first.toml"]).success();
    // The first six of 300 fixes give the initial heading of the filter.
    assert!(stdout(&ran).contains("gnss_position       294"), "{}", stdout(&ran));
}

/// Velocities are in a separate file, and the reference is not a sensor.
#[test]
fn what_is_recorded_of_a_simulation_becomes_a_filter_that_knows_its_heading() {
    // Measured 0.3 deg and 1.5 deg. Without velocities and magnetometers it was 17 and 20 deg. The boat had 4 deg when
    // its log through the water was taken as a log over ground.
    for vehicle in ["boat", "drone"] {
        let w = Workspace::new(&format!("inspect-{vehicle}"));
        w.fusion(&["new", "own", "--from", vehicle]).success();
        w.fusion(&["record", "own.toml", "--out", "log"]).success();
        w.fusion(&["inspect", "log", "--write", "first.toml"]).success();
        let design = w.read("first.toml");
        for used in ["gnss_velocity.csv", "type = \"magnetometer\"", "hard_iron = { estimate = true"] {
            assert!(design.contains(used), "{vehicle} {used}: {design}");
        }
        let document = Document::load(&w.path("first.toml")).unwrap_or_else(|e| panic!("{e}"));
        let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
        let summary = run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
        let heading = summary.score().unwrap().attitude_deg.unwrap().rms[2];
        assert!(heading < if vehicle == "boat" { 1.0 } else { 4.0 }, "{vehicle}: {heading}");
    }
}

/// The column names give the quantity but no unit, there is no truth, and every design is sound and runs.
#[test]
fn every_design_that_is_written_for_a_recorded_simulation_runs() {
    for vehicle in ["car", "drone", "boat", "auv", "person"] {
        let w = Workspace::new(&format!("inspect-neutral-{vehicle}"));
        w.fusion(&["new", "own", "--from", vehicle]).success();
        w.fusion(&["record", "own.toml", "--out", "log"]).success();
        std::fs::remove_file(w.path("log/reference.csv")).unwrap();
        std::fs::remove_file(w.path("log/design.toml")).unwrap();
        for entry in std::fs::read_dir(w.path("log")).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            let (header, rows) = text.split_once('\n').unwrap();
            let plain: Vec<&str> = header.split(',').map(|name| name.split(" [").next().unwrap()).collect();
            std::fs::write(&path, format!("{}\n{rows}", plain.join(","))).unwrap();
        }
        w.fusion(&["inspect", "log", "--write", "first.toml"]).success();
        w.fusion(&["check", "first.toml"]).success();
        w.fusion(&["run", "first.toml"]).success();
    }
}

/// A foot without positions: its path begins at zero, and the heading counts from the start or from the magnetometer.
#[test]
fn a_foot_without_positions_becomes_a_filter_of_its_way() {
    let w = Workspace::new("inspect-foot");
    w.fusion(&["new", "own", "--from", "person"]).success();
    w.fusion(&["record", "own.toml", "--out", "log"]).success();
    std::fs::rename(w.path("log/reference.csv"), w.path("truth.csv")).unwrap();
    w.fusion(&["inspect", "log", "--write", "first.toml"]).success();
    let design = w.read("first.toml");
    for used in [
        "type = \"strapdown\"",
        "type = \"zero_velocity\"",
        // The simulated foot does not roll during a stance.
        "type = \"zero_angular_rate\"",
        "the way is relative to the start",
        "accelerometer.vibration = \"0.1 s\"",
        "gyro.scale_noise = \"0.1 %/sqrt(Hz)\"",
        "count from where the unit's forward axis points",
    ] {
        assert!(design.contains(used), "{used}: {design}");
    }
    let judged = design
        + "\n[source.truth]\ntype = \"csv\"\npath = \"../truth.csv\"\ntime = { column = \"time [s]\" }\n[source.truth.channels]\n\
           velocity = { columns = [\"velocity_north [m/s]\", \"velocity_east [m/s]\", \"velocity_down [m/s]\"] }\n[reference]\nsource = \
           \"truth\"\n";
    w.write("judged.toml", judged.replace("heading = \"0 deg\"", "heading = \"30 deg\""));
    let document = Document::load(&w.path("judged.toml")).unwrap_or_else(|e| panic!("{e}"));
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let summary = run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    // It walks at 1.2 m/s for two minutes. Without its stances the velocity error is tens of metres per second.
    let off = summary.score().unwrap().velocity.unwrap().rms;
    assert!(off.iter().all(|rms| *rms < 0.3), "{off:?}");
}

#[test]
fn the_only_folder_of_a_folder_is_taken_and_named() {
    let w = Workspace::new("inspect-inner");
    robot(&w);
    std::fs::create_dir_all(w.path("outer")).unwrap();
    std::fs::rename(w.path("log"), w.path("outer/log")).unwrap();
    let looked = stdout(&w.fusion(&["inspect", "outer"]).success());
    assert!(
        looked.contains("its only folder is taken, `outer/log`") && looked.contains("gnss.csv"),
        "{looked}"
    );
}

#[test]
fn files_and_folders_without_a_log_are_named() {
    let w = Workspace::new("inspect-nothing");
    std::fs::create_dir_all(w.path("empty/inner")).unwrap();
    let none = w.fusion(&["inspect", "empty"]).code(2);
    assert!(
        stderr(&none).contains("holds no log") && stderr(&none).contains("inner"),
        "{}",
        stderr(&none)
    );
    let lost = w.fusion(&["inspect", "lost.csv"]).code(2);
    assert!(stderr(&lost).contains("lost.csv"), "{}", stderr(&lost));
}

/// Two minutes of a drive with turns: a unit at 50 Hz, fixes at 5 Hz, and a link that holds messages
/// back for half a second of every two.
fn station() -> Vec<u8> {
    use fusion_formats::mavlink::{Message, Sender};
    /// Unix time of the start \[µs\].
    const START: f64 = 1.752e15;
    let from = Sender {
        system: 1,
        component: 1,
        sequence: 0,
    };
    let mut log = Vec::new();
    let (mut north, mut east, mut heading) = (0.0_f64, 0.0_f64, 0.5_f64);
    for k in 0..6000 {
        let t = 0.02 * f64::from(k);
        let (speed, slope) = if t < 20.0 {
            (0.0, 0.0)
        } else {
            ((t - 20.0).min(6.0), f64::from(u8::from(t < 26.0)))
        };
        let rate = if t < 30.0 { 0.0 } else { 0.3 * (0.2 * (t - 30.0)).sin() };
        heading += 0.02 * rate;
        north += 0.02 * speed * heading.cos();
        east += 0.02 * speed * heading.sin();
        // Without noise, the samples at rest would be equal.
        let shaken = |seed: f64| 0.02 * (f64::from(k) * seed).sin();
        let mut send = |name: &str, fields: &[(&str, f64)]| {
            let arrival = t + (0.5 - t.rem_euclid(2.0)).max(0.0);
            let fields: Vec<(&str, &[f64])> = fields.iter().map(|(name, value)| (*name, std::slice::from_ref(value))).collect();
            log.extend(((START + 1e6 * arrival) as u64).to_be_bytes());
            log.extend(Message::named(name).unwrap().frame(&from, &fields).unwrap());
        };
        let time = ("time_usec", 1e6 * (t + 5.0));
        let force = [slope + shaken(1.1), speed * rate + shaken(1.7), -9.807 + shaken(2.3)];
        send(
            "HIGHRES_IMU",
            &[
                time,
                ("xacc", force[0]),
                ("yacc", force[1]),
                ("zacc", force[2]),
                ("xgyro", shaken(1.3) / 10.0),
                ("ygyro", shaken(1.9) / 10.0),
                ("zgyro", rate + shaken(2.9) / 10.0),
            ],
        );
        if k % 10 == 0 {
            let (lat, lon) = (45.0 + north / 111_132.0, 10.0 + east / 78_847.0);
            let course = heading.to_degrees().rem_euclid(360.0);
            let height = 100e3 + f64::from(k % 7);
            send(
                "GPS_RAW_INT",
                &[
                    time,
                    ("fix_type", 3.0),
                    ("lat", 1e7 * lat),
                    ("lon", 1e7 * lon),
                    ("alt", height),
                    ("vel", 100.0 * speed),
                    ("cog", 100.0 * course),
                    ("satellites_visible", 12.0),
                ],
            );
        }
    }
    log
}

#[test]
fn from_a_log_of_a_ground_station_to_a_running_filter_in_two_commands() {
    let w = Workspace::new("inspect-station");
    std::fs::write(w.path("drive.tlog"), station()).unwrap();
    w.fusion(&["inspect", "drive.tlog", "--write", "first.toml"]).success();
    let design = w.read("first.toml");
    assert!(!design.contains("log_time"), "times of arrival are no stamps:\n{design}");
    let ran = stdout(&w.fusion(&["run", "first.toml"]).success());
    assert!(ran.contains("health good") || ran.contains("health     good"), "{ran}");
    // Every held message has its own time, so the unit has no gap.
    assert!(!ran.contains("input-gap"), "{ran}");
}
