//! Logs in the forms of loggers: times, places, several instruments in a file, estimates of other filters.

use super::*;
use core::sync::atomic::{AtomicUsize, Ordering};
use fusion::config::Document;
use fusion::design::Design;

/// A log from a file with this name and text.
pub(super) fn log(name: &str, text: &str) -> Log {
    // Tests run in parallel, and files with the same name would collide.
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("fusion-loggers-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    let mut table = LogTable::read(&path).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    table.path = name.into();
    Log::of(table)
}

/// A header, and rows made from their number.
pub(super) fn text(header: &str, rows: usize, row: &dyn Fn(usize) -> String) -> String {
    (0..rows).fold(format!("{header}\n"), |text, k| text + &row(k) + "\n")
}

/// Positions of a minute at 1 Hz, 11 m further north in each row.
fn places(header: &str, lat: f64, lon: f64, step: f64) -> Log {
    log(
        "gps.csv",
        &text(header, 60, &|k| format!("{k}.0,{:.7},{:.7},10.0", lat + step * k as f64, lon)),
    )
}

#[test]
fn a_latitude_beyond_a_quarter_turn_is_in_degrees() {
    let unit = |log: &Log| log.signal(Kind::Geodetic).map(|s| s.unit.clone());
    let near = places("time_s,lat,lon,alt", 51.42, -2.67, 1e-4);
    assert_eq!(unit(&near).unwrap(), "deg");
    // A track of a minute at 11 m/s.
    let looked = Inspection::look(vec![near]);
    let track = &looked.position.as_ref().unwrap().1;
    assert!((track.way / (59.0 * 11.12) - 1.0).abs() < 1e-2, "{}", track.way);
    // On the equator, too, where only the speed shows it: 637 m/s in rad; and rad if the values are in rad.
    assert_eq!(unit(&places("time_s,lat,lon,alt", 0.4, 1.5, 1e-4)).unwrap(), "deg");
    assert_eq!(unit(&places("time_s,lat,lon,alt", 0.4, 1.5, 1e-6)).unwrap(), "rad");
}

#[test]
fn a_height_is_known_by_its_words_and_its_absence_is_said() {
    let height = |header: &str| {
        let log = places(header, 51.42, -2.67, 1e-4);
        log.signal(Kind::Geodetic).unwrap().names(&log.table).get(2).cloned()
    };
    assert_eq!(height("time_s,Lat,Lon,AltHAE").unwrap(), "AltHAE");
    assert_eq!(height("time_s,Lat,Lon,AltRate"), None);
    // A receiver has two heights: use the height above the ellipsoid, in any column order.
    let row = |k: usize| format!("{k}.0,{:.7},-2.67,46.0,95.0", 51.42 + 1e-4 * k as f64);
    for (header, ellipsoid) in [
        ("time_s,lat,lon,hMSL,HeightEll", "HeightEll"),
        ("time_s,lat,lon,AltWGS84,AltMSL", "AltWGS84"),
    ] {
        let both = log("gps.csv", &text(header, 60, &row));
        assert_eq!(both.signal(Kind::Geodetic).unwrap().names(&both.table)[2], ellipsoid);
    }
    let said = |header: &str| {
        let unit = warm(&|k| 2e4 * k as f64, &|_| 20.0);
        let looked = Inspection::look(vec![unit, places(header, 51.42, -2.67, 1e-4)]);
        looked.missing().iter().any(|missing| missing.contains("name it `height_m`"))
    };
    assert!(said("time_s,Lat,Lon,AltRate") && !said("time_s,Lat,Lon,AltHAE"));
}

#[test]
fn degrees_and_minutes_in_one_number_are_read_as_nmea_writes_them() {
    // 48° 54.554′ N, 130° 36.442′ W, and north by 0.006′, 11.1 m, a row.
    let looked = Inspection::look(vec![places("time_s,Lat,Lon,Alt", 4854.554, -13_036.442, 0.006)]);
    assert_eq!(looked.logs[0].signal(Kind::Geodetic).unwrap().unit, "ddmm");
    let track = &looked.position.as_ref().unwrap().1;
    let origin = track.origin.unwrap();
    assert!((origin[0].to_degrees() - (48.0 + 54.554 / 60.0)).abs() < 1e-9, "{origin:?}");
    assert!((origin[1].to_degrees() + 130.0 + 36.442 / 60.0).abs() < 1e-9, "{origin:?}");
    assert!((track.way / (59.0 * 11.12) - 1.0).abs() < 1e-2, "{}", track.way);
    // 60 minutes and more are not a valid position.
    let odd = places("time_s,Lat,Lon,Alt", 4875.0, -13_036.442, 0.006);
    assert!(!odd.has(Kind::Geodetic), "{:?}", odd.signals);
    assert!(!places("time_s,lat_deg,lon_deg,alt", 514_234_656.0, -26_715_894.0, 10.0).has(Kind::Geodetic));
}

/// Rows of an inertial unit at 50 Hz with a temperature `T`.
fn warm(stamp: &dyn Fn(usize) -> f64, warmth: &dyn Fn(usize) -> f64) -> Log {
    let row = |k: usize| {
        let x = 0.01 * noise(0.02 * k as f64, 1.0);
        format!("{},{x},{x},0.0,{x},{x},-9.81,{}", stamp(k), warmth(k))
    };
    log("IMU.csv", &text("TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T", 500, &row))
}

#[test]
fn a_name_of_time_outranks_a_temperature() {
    let stamp = |k: usize| 1.464e9 + 2e4 * k as f64;
    let rising = |k: usize| 29.5 + 1e-3 * k as f64;
    let noisy = |k: usize| 29.5 + 1e-3 * noise(0.02 * k as f64, 3.0);
    for warmth in [&rising as &dyn Fn(usize) -> f64, &noisy] {
        let found = warm(&stamp, warmth);
        let clock = found.clock.as_ref().unwrap();
        assert_eq!((found.table.columns[clock.column].name.as_str(), clock.unit), ("TimeUS", "us"));
        assert!((clock.rate - 50.0).abs() < 1e-6 && clock.backwards == 0, "{clock:?}");
    }
    // A temperature alone does not count as time.
    let alone = log("a.csv", &text("T,x", 100, &|k| format!("{},0", noisy(k))));
    assert!(alone.clock.is_none());
}

#[test]
fn a_counter_of_rows_has_no_rate() {
    let unit = |header: &str, each: usize| log("foot.csv", &text(header, 100, &|k| format!("{},0.1,0.2,9.8", each * k)));
    for (header, each) in [("index,ax,ay,az", 1), ("Packet number,ax,ay,az", 4), ("sensor,ax,ay,az", 1)] {
        let found = unit(header, each);
        assert!(found.clock.is_none(), "{header}");
        let missing = Inspection::look(vec![found]).missing().join("\n");
        assert!(missing.contains("counts its rows") && missing.contains("rate = "), "{missing}");
    }
    // Fixes once a second, with a name that says so.
    assert_eq!(unit("time,ax,ay,az", 1).clock.unwrap().unit, "s");
    assert_eq!(unit("ms,ax,ay,az", 1).clock.unwrap().unit, "ms");
}

#[test]
fn a_date_that_begins_with_the_day_is_named() {
    let of = |first: &str| {
        log(
            "glider.csv",
            &text("Timestamp,Depth", 20, &|k| format!("{first} 23:24:{k:02},{k}.5")),
        )
    };
    let missing = Inspection::look(vec![of("21/07/2019")]).missing().join("\n");
    assert!(
        missing.contains("21/07/2019 23:24:00") && missing.contains("`\"dmy\"`") && !missing.contains("none is called"),
        "{missing}"
    );
    let either = Inspection::look(vec![of("07/08/2019")]).missing().join("\n");
    assert!(either.contains("\"dmy\"` or `\"mdy\""), "{either}");
}

/// Rows of several numbered inertial units with equal stamps, at 50 Hz, and a temperature.
fn units_in_turn(count: usize) -> Log {
    let row = |k: usize| {
        let (row, unit) = (k / count, k % count);
        let x = 0.01 * noise(0.02 * row as f64, 1.0 + unit as f64) + unit as f64;
        format!("{},{unit},{x},0.0,{x},{x},0.1,-9.81,{}", 8_000_000 + 20_000 * row, 29.5 + x)
    };
    log("IMU.csv", &text("TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T", 1000 * count, &row))
}

#[test]
fn of_several_instruments_in_a_file_the_first_one_is_read() {
    for count in [2, 3] {
        let found = units_in_turn(count);
        let clock = found.clock.as_ref().unwrap();
        assert_eq!((found.table.rows(), clock.ties, clock.backwards), (1000, 0, 0));
        assert!((clock.rate - 50.0).abs() < 1e-6, "{clock:?}");
        // The mean of the first unit is zero, the mean of all is not.
        let rates = found.values(Kind::AngularRate).unwrap();
        assert!(rates.iter().all(|w| w[0].abs() < 0.011));
        let looked = Inspection::look(vec![found]);
        assert_eq!(looked.missing().len(), 1, "{:?}", looked.missing());
        let said = format!("{:?}", looked.page().sections[0]);
        assert!(said.contains(&format!("holds {count} instruments in turn")), "{said}");
        let design = looked.design(Path::new("/")).unwrap();
        assert!(
            design.contains("valid = { column = \"I\", equals = 0 }") && !design.contains("ties"),
            "{design}"
        );
    }
    // A stamp that occurs twice for one instrument does not show several instruments.
    let twice = |k: usize| format!("{},{},0.1,0.2,9.8", k / 2, k / 2 % 2);
    assert!(log("a.csv", &text("t,I,ax,ay,az", 200, &twice)).instances.is_none());
    assert!(Log::of(unit()).instances.is_none());
}

#[test]
fn the_estimate_of_another_filter_is_no_measurement() {
    let fix = |step: f64, off: f64| {
        move |k: usize| {
            let lat = 51.42 + 1e-4 * step * k as f64 + off * noise(k as f64, 1.0);
            format!(
                "{},3,{lat:.8},-2.67,{}",
                1e6 * step * k as f64,
                50.0 + off * 1e5 * noise(k as f64, 2.0)
            )
        }
    };
    let received = |name: &str, header: &str| log(name, &text(header, 100, &fix(1.0, 1e-5)));
    let smooth = |name: &str| log(name, &text("TimeUS,Mode,Lat,Lng,Alt", 1000, &fix(0.1, 1e-8)));
    let attitude = || {
        log(
            "ATT.csv",
            &text("TimeUS,Roll,Pitch,Yaw", 1000, &|k| {
                format!("{},1.5,{},100.0", 1e5 * k as f64, k % 7)
            }),
        )
    };
    let gps = || received("GPS.csv", "TimeUS,Status,Lat,Lng,Alt");
    for name in ["POS.csv", "AHR2.csv", "XKF1.csv", "ekf_output.csv"] {
        let looked = Inspection::look(vec![smooth(name), gps(), units_in_turn(1)]);
        let (k, _) = looked.position.as_ref().unwrap();
        assert_eq!(
            (looked.logs[*k].name().as_str(), looked.reference.is_none()),
            ("GPS.csv", true),
            "{name}"
        );
        let design = looked.design(Path::new("/")).unwrap();
        assert!(design.contains(&format!("no measurement: `{name}`")), "{design}");
    }
    // Without another position it is used; a truth keeps its role.
    assert!(Inspection::look(vec![smooth("POS.csv")]).position.is_some());
    let judged = Inspection::look(vec![smooth("truth.csv"), gps()]);
    assert_eq!(judged.reference.as_ref().unwrap().0, 0);
    // An attitude of another filter does not replace a unit with unknown stamps, and is named if it is used.
    let row = |k: usize| format!("{k},0.{0},0.2,0.3,0.1,0.2,-9.{0}", k % 10);
    let silent = log("IMU.csv", &text("index,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 100, &row));
    assert!(Inspection::look(vec![attitude(), gps(), silent]).design(Path::new("/")).is_err());
    let alone = Inspection::look(vec![attitude(), gps()]).design(Path::new("/")).unwrap();
    assert!(alone.contains("`ATT.csv` is by its name the estimate of another filter"), "{alone}");
}

#[test]
fn a_row_without_a_fix_is_told_by_its_flag_or_by_its_place() {
    let of = |header: &str, row: &dyn Fn(usize) -> String| {
        let looked = Inspection::look(vec![log("gps.csv", &text(header, 200, row)), units_in_turn(1)]);
        let design = looked.design(Path::new("/")).unwrap();
        let valid = design.lines().find(|l| l.starts_with("valid")).unwrap_or_default();
        valid.split("  #").next().unwrap_or_default().to_owned()
    };
    let place = |k: usize| format!("{k},{:.6},-2.67,{}", 51.42 + 1e-5 * k as f64, k as f64 - 100.0);
    // Most rows have no new fix.
    let flagged = |k: usize| format!("{},{}", place(k), u8::from(k.is_multiple_of(5)));
    assert_eq!(of("time,lat,lon,alt,fix", &flagged), "valid = { column = \"fix\", equals = 1 }");
    let quality = |k: usize| format!("{},{}", place(k), if k.is_multiple_of(5) { 2 } else { 1 });
    assert_eq!(of("time,lat,lon,alt,Q", &quality), "valid = { column = \"Q\", equals = 1 }");
    // Half of the heights are below zero, and one of them is zero.
    let zeros = |k: usize| if k < 10 { format!("{k},0,0,-17") } else { place(k) };
    assert_eq!(of("time,lat,lon,alt", &zeros), "valid = { column = \"lat\", not_equals = 0 }");
}

/// The design that is written for these logs, read back: it has to be valid.
fn written(logs: Vec<Log>) -> String {
    fusion_models::link();
    let text = Inspection::look(logs).design(Path::new("/")).unwrap();
    let (document, mistakes) = Document::parse("x.toml", &text);
    assert!(mistakes.is_empty() && !text.contains("NaN"), "{mistakes:?}\n{text}");
    if let Err(mistakes) = Design::read(document) {
        panic!("{mistakes:?}\n{text}");
    }
    text
}

#[test]
fn speed_and_course_are_a_velocity_and_the_way_tells_a_unit_that_no_name_does() {
    // East at 11.12 m/s, 21.62 kn, 40.03 km/h, to a hundredth and a degree: constant columns do not count.
    let moved = |header: &str, speed: f64| {
        let row = |k: usize| {
            let wander = noise(k as f64, 1.0);
            let (lon, said) = (8.0 + 1e-4 * k as f64, speed * (1.0 + 0.01 * wander));
            format!("{k}.0,{:.8},{lon:.7},10.0,{said},{}", 1e-8 * k as f64, 90.0 + wander)
        };
        log("gnss.csv", &text(header, 60, &row))
    };
    for (header, speed, unit) in [
        ("t,lat_deg,lon_deg,alt_m,SOG (kn),COG (deg)", 21.62, "kn"),
        ("t,lat_deg,lon_deg,alt_m,speed,bearing", 40.03, "km/h"),
        ("t,lat_deg,lon_deg,alt_m,speed,bearing", 11.12, "m/s"),
    ] {
        let log = moved(header, speed);
        let velocity = log.signal(Kind::Velocity).unwrap_or_else(|| panic!("{header}: {:?}", log.signals));
        assert!(velocity.course.is_some() && velocity.unit == unit, "{header} {speed}: {velocity:?}");
        let of = velocity.values(&log.table);
        assert!(
            of.iter().all(|v| v[0].abs() < 0.2 && (v[1] - 11.12).abs() < 0.12),
            "{header}: {:?}",
            of[0]
        );
    }
    // Neither sign nor factor fits: no unit is claimed.
    let odd = moved("t,lat_deg,lon_deg,alt_m,speed,bearing", 80.0);
    assert_eq!(odd.signal(Kind::Velocity).unwrap().unit, "m/s");
}

#[test]
fn rows_that_are_far_apart_make_a_design_without_nan_and_with_intervals_of_their_own() {
    let row = |k: usize| format!("{}.0,0.0,0.0,{},{:.6},8.0", 20 * k, (3 * k) % 360, 47.0 + 1e-4 * k as f64);
    let far = log("log.csv", &text("t_s,roll_deg,pitch_deg,heading_deg,lat_deg,lon_deg", 400, &row));
    let design = written(vec![far]);
    assert!(design.contains("longest_interval = \"70.0 s\""), "{design}");
}

#[test]
fn a_receiver_without_a_vertical_makes_a_design_that_is_read() {
    // An inertial unit that turns and accelerates as the fixes show, on a circle of 50 m at 5 m/s.
    let (speed, radius, rate) = (5.0, 50.0, 0.1_f64);
    let fix = |k: usize| {
        let angle = rate * 0.2 * k as f64;
        let (north, east) = (radius * angle.sin(), radius * (1.0 - angle.cos()));
        let lon = 8.0 + east / (111_320.0 * 53.0_f64.to_radians().cos());
        format!(
            "{:.1},{:.8},{lon:.8},{:.3},{:.2}",
            0.2 * k as f64,
            53.0 + north / 111_320.0,
            speed / 0.514_444,
            angle.to_degrees() % 360.0
        )
    };
    let imu = |k: usize| {
        let t = 0.02 * k as f64;
        let x = 0.02 * noise(t, 1.0);
        format!("{t:.2},{x},{},{},{x},{x},{rate}", speed * rate, -9.81 + x)
    };
    let gnss = log("gnss.csv", &text("t,lat_deg,lon_deg,SOG (kn),COG (deg)", 900, &fix));
    let unit = log(
        "imu.csv",
        &text(
            "t,acc_x_mps2,acc_y_mps2,acc_z_mps2,gyro_x_radps,gyro_y_radps,gyro_z_radps",
            9000,
            &imu,
        ),
    );
    let design = written(vec![unit, gnss]);
    assert!(
        design.contains("horizontal_velocity") && design.contains("horizontal_position"),
        "{design}"
    );
}
