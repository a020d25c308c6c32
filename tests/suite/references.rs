//! References with several sources, and with some axes only.

use crate::support::{DESIGN, Workspace, fixes, has, stderr, stdout};
use fusion::config::Document;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::design::Design;
use fusion::run::{Options, Summary, run};
use fusion::score::Score;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A receiver without a height, a pressure gauge, and a radar for velocity, each in its own file.
const SOURCES: &str = r#"
[source.rtk]
type = "csv"
path = "rtk.csv"
time = { column = "t" }
channels.horizontal_position = { latitude = "lat", longitude = "lon", unit = "deg" }

[source.gauge]
type = "csv"
path = "gauge.csv"
time = { column = "t" }
channels.depth = { column = "depth", unit = "m", latency = "0.25 s" }

[source.radar]
type = "csv"
path = "radar.csv"
time = { column = "t" }
channels.velocity = { columns = ["vn", "ve", "vd"], unit = "m/s" }
channels.depth = { column = "depth", unit = "m" }
"#;

/// The fixes and the files of references. The track is 47° + k·10⁻⁴ at 8° and 400 m. The gauge is 9 m below a surface
/// of 410 m.
fn workspace(test: &str, reference: &str) -> Workspace {
    let at = Workspace::new(test);
    let rows = |header: &str, row: &dyn Fn(u32) -> String| (0..60).fold(format!("{header}\n"), |text, k| text + &row(k) + "\n");
    at.write(
        "rtk.csv",
        rows("t,lat,lon", &|k| format!("{k},{:.9},8.0", 47.0 + 1e-4 * f64::from(k))),
    );
    at.write("gauge.csv", rows("t,depth", &|k| format!("{k}.25,9")));
    at.write("radar.csv", rows("t,vn,ve,vd,depth", &|k| format!("{k},11.1,0,0,70")));
    at.write("gnss.csv", fixes());
    at.write("design.toml", format!("{DESIGN}{SOURCES}{reference}"));
    at
}

fn score(at: &Workspace, sets: &[&str]) -> Score {
    let mut document = Document::load(&at.path("design.toml")).unwrap();
    sets.iter().for_each(|set| document.set(set).unwrap());
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let options = Options {
        base: at.path(""),
        ..Options::default()
    };
    let summary = run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    summary.score().unwrap().clone()
}

#[test]
fn a_reference_without_a_height_is_judged_horizontally() {
    let at = workspace("horizontal", "[reference]\nsource = \"rtk\"\n");
    let found = score(&at, &[]);
    let position = found.position.unwrap();
    assert!(position.rms[0] > 0.1 && position.rms[0] < 5.0, "{position:?}");
    assert!(position.rms[2].is_nan() && position.max[2].is_nan() && found.position_rmse_m.is_none());
    assert!(found.horizontal_rms > 0.1 && found.spread.horizontal.is_some() && found.spread.position.is_none());
    assert_eq!(found.nees_position.unwrap().dof, 2);
    let trajectory = found.trajectory.unwrap();
    // Not aligned, and aligned in yaw: the height is unknown.
    assert!(trajectory.horizontal && trajectory.absolute.len() == 2, "{trajectory:?}");
    let ate = trajectory.absolute[0].position.rmse;
    // Metres on the ellipsoid and along axes tangent to it, over 650 m.
    assert!((ate - found.horizontal_rms).abs() < 1e-3 * ate, "{ate} {}", found.horizontal_rms);
    let shown = at.fusion(&["run", "design.toml", "--verbose", "--out", "out"]).success();
    let shown = shown.stdout(has("position east [m]")).stdout(has("NEES position"));
    assert!(!stdout(&shown).contains("position down"));
}

#[test]
fn each_source_of_a_reference_gives_its_channels_at_its_own_times() {
    let reference = r#"
[reference.source.rtk]
[reference.source.gauge]
surface = "410 m"
sigma.position = "10 cm"
[reference.source.radar]
channels = ["velocity"]
"#;
    let at = workspace("sources", reference);
    let found = score(&at, &[]);
    let position = found.position.unwrap();
    // Fixes say 400 m, the gauge 401 m. 1e-3 m: the Earth is round over the 11 m of a second.
    assert!((position.mean[2] - 1.0).abs() < 1e-3 && position.rms[0] > 0.1, "{position:?}");
    // The gauge's 1σ is added to that of the filter.
    assert!(position.three_sigma[2] > 0.3, "{position:?}");
    let dof = [found.nees_position, found.nees_height, found.nees_velocity].map(|c| c.unwrap().dof);
    assert_eq!((dof, found.nees_undefined), ([2, 1, 3], [0; 3]));
    // At 1 Hz each. The gauge is valid at the full second, a quarter of a second before its stamp.
    let velocity = found.velocity.unwrap();
    assert!(velocity.mean[0].abs() < 1.0 && found.epochs > 100, "{velocity:?} {}", found.epochs);
    let deeper = score(&at, &["reference.source.gauge.surface=\"408 m\""]).position.unwrap();
    assert!((deeper.mean[2] + 1.0).abs() < 1e-3, "{deeper:?}");
    let shown = at.fusion(&["run", "design.toml", "--verbose"]).success();
    shown.stdout(has("NEES height")).stdout(has("position down [m]"));
    at.fusion(&["check", "design.toml"])
        .success()
        .stdout(has("`rtk`, `gauge`, `radar`"));
}

#[test]
fn sources_of_a_reference_may_be_named_one_by_one_as_the_one_was() {
    let at = workspace("one", "[reference]\nsource = \"radar\"\nchannels = [\"velocity\"]\n");
    let one = score(&at, &[]);
    let at = workspace("table", "[reference.source.radar]\nchannels = [\"velocity\"]\n");
    let table = score(&at, &[]);
    assert_eq!((one.velocity, one.position), (table.velocity, None));
    assert!(one.velocity.is_some());
}

/// A recorded vehicle whose compass corrects its yaw five times a second by degrees. The truth is at its origin.
const COMPASS: &str = r#"
[sensor.compass]
type = "attitude"
source = "compass"
noise = { sigma = "2 deg" }

[simulation.sensor.compass]
rate = "5 Hz"
white = "2 deg"
"#;

/// Three numbers of a row.
fn vector(row: &[f64], first: usize) -> Vector3<f64> {
    Vector3::new(row[first], row[first + 1], row[first + 2])
}

/// The log of that vehicle, and in `point.csv` the truth at a point with the offset `arm` from its origin.
fn turning_vehicle(test: &str, arm: [f64; 3]) -> Workspace {
    let at = Workspace::new(test);
    let include = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    at.write("world.toml", format!("include = [\"{include}\"]\n{COMPASS}"));
    at.fusion(&["record", "world.toml", "--set", "simulation.draw_start=false", "--out", "log"])
        .success();
    let text = at.read("log/reference.csv");
    let (header, rows) = text.split_once('\n').unwrap();
    let numbers = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>();
    let rows: Vec<Vec<f64>> = rows.lines().map(numbers).collect();
    let attitude = |row: &[f64]| UnitQuaternion::from_quaternion(Quaternion::new(row[7], row[8], row[9], row[10]));
    let [mut origin, mut point] = [header, header].map(|header| header.to_owned() + "\n");
    for near in rows.windows(3) {
        let rate = |k: usize| (attitude(&near[k]).inverse() * attitude(&near[k + 1])).scaled_axis() / (near[k + 1][0] - near[k][0]);
        // The rate is that of both intervals, except where a turn begins or ends.
        if (rate(0) - rate(1)).norm() > 1e-3 {
            continue;
        }
        let (mut row, q, arm) = (near[1].clone(), attitude(&near[1]), Vector3::from(arm));
        let tell = |row: &[f64]| row.iter().map(|v| format!("{v}")).collect::<Vec<_>>().join(",") + "\n";
        origin += &tell(&row);
        let place = Geodetic::new(row[1].to_radians(), row[2].to_radians(), row[3]).offset(&(q * arm));
        let velocity = vector(&row, 4) + q * rate(1).cross(&arm);
        row[1..4].copy_from_slice(&[place.lat.to_degrees(), place.lon.to_degrees(), place.height]);
        row[4..7].copy_from_slice(velocity.as_slice());
        point += &tell(&row);
    }
    at.write("log/reference.csv", origin);
    at.write("log/point.csv", point);
    at
}

/// The score of a run on that log.
fn of_log(at: &Workspace, sets: &[&str]) -> Summary {
    let mut document = Document::load(&at.path("log/design.toml")).unwrap();
    sets.iter().for_each(|set| document.set(set).unwrap());
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let options = Options {
        base: at.path("log"),
        ..Options::default()
    };
    run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"))
}

#[test]
fn corrections_of_the_yaw_are_no_turn_of_the_reference_point() {
    let at = turning_vehicle("lever-velocity", [2.0, 0.5, 0.0]);
    let at_point = ["source.reference.path=\"point.csv\"", "reference.lever_arm=[2, 0.5, 0]"];
    let [origin, point] = [&[][..], &at_point].map(|sets| of_log(&at, sets).score().unwrap().velocity.unwrap());
    // The velocity of the point differs by 0.33 rad/s · 2.06 m, turned by a yaw error of at most 1°: 0.012 m/s. The
    // noise of a gyro adds 0.002 rad/s · 2.06 m. A correction of 1° taken as a turn in 0.01 s would give 3.6 m/s.
    for k in 0..3 {
        assert!((origin.max[k] - point.max[k]).abs() < 0.02, "{origin:?} {point:?}");
        assert!((origin.rms[k] - point.rms[k]).abs() < 0.005, "{origin:?} {point:?}");
    }
}

#[test]
fn a_wrong_lever_arm_of_the_reference_is_found() {
    let at = turning_vehicle("lever-finding", [3.0, -1.5, 0.0]);
    let at_point = |arm: &str| -> Vec<String> {
        let sets = [
            "source.reference.path=\"point.csv\"".to_owned(),
            format!("reference.lever_arm={arm}"),
        ];
        let summary = of_log(&at, &[&sets[0], &sets[1]]);
        let found = summary.findings().iter();
        found.filter(|f| f.about == "reference").map(ToString::to_string).collect()
    };
    assert_eq!(at_point("[3, -1.5, 0]"), [""; 0], "the right one");
    let found = at_point("[1, 0, 0]");
    let (_, arm) = found[0].split_once("`reference.lever_arm = [").unwrap();
    let arm: Vec<f64> = arm.split([',', ']']).take(2).map(|n| n.trim().parse().unwrap()).collect();
    // The error of the filter, 0.4 m with a memory of some seconds, over two minutes. Twice that ahead, because only
    // the turns separate an offset ahead from a delay.
    assert!((arm[0] - 3.0).abs() < 0.8 && (arm[1] + 1.5).abs() < 0.4, "{found:?}");
    assert!(found[0].contains("an offset of [") && of_log(&at, &[]).findings().iter().all(|f| f.about != "reference"));
}

#[test]
fn runs_that_are_judged_by_other_references_are_not_compared_in_silence() {
    let at = workspace("compared", "[reference]\nsource = \"rtk\"\n");
    let text = at.read("design.toml");
    at.write("other.toml", text.clone() + "lever_arm = [\"1 m\", 0, 0]\n");
    at.write("same.toml", text);
    let said = "judged by another [reference] than the first";
    let other = stderr(&at.fusion(&["compare", "design.toml", "other.toml"]).success());
    let other = other.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        other.contains(said) && other.contains("lever_arm = [\"1 m\", 0, 0] instead of none"),
        "{other}"
    );
    let same = at.fusion(&["compare", "design.toml", "same.toml"]).success();
    assert!(!(stdout(&same) + &stderr(&same)).contains("another [reference]"));
}

#[test]
fn an_epoch_between_two_recordings_has_no_error() {
    let at = Workspace::new("recordings");
    // The second recording begins 100 s after the first and 1 km north of it, with a row of the reference just before.
    let rows = |late: f64| {
        let times = (0..20).chain(120..140).map(|k| (f64::from(k), if k < 100 { 47.0 } else { 47.01 }));
        let row = |(t, lat): (f64, f64)| format!("{},{lat},8,400,0,0,0\n", t + late);
        times.map(row).fold("t,lat,lon,h,vn,ve,vd\n".to_owned(), |text, row| text + &row)
    };
    at.write("gnss.csv", rows(0.0));
    at.write("truth.csv", rows(-0.1));
    let design = DESIGN.replace("[run]\n", "[run]\nrestart_after = \"5 s\"\n");
    let truth = r#"
[source.truth]
type = "csv"
path = "truth.csv"
time = { column = "t" }
channels.position = { latitude = "lat", longitude = "lon", height = "h", unit = "deg" }

[reference]
source = "truth"
"#;
    at.write("design.toml", design + truth);
    let found = score(&at, &[]);
    let position = found.position.unwrap();
    // All measurements are exact: 1 mm for the curvature of the Earth.
    assert!(position.max[0] < 1e-3, "{position:?}");
}

/// `keep` divides the rows of one file. Rows that the filter has used do not judge it.
#[test]
fn rows_that_the_filter_uses_are_no_judges() {
    let judge = "
[source.judge]
type = \"csv\"
path = \"gnss.csv\"
time = { column = \"t\" }
channels.position = { latitude = \"lat\", longitude = \"lon\", height = \"h\", unit = \"deg\" }

[reference]
source = \"judge\"
";
    let at = workspace("judges", judge);
    let summary = |used: &str, judging: &str| -> Summary {
        let mut document = Document::load(&at.path("design.toml")).unwrap();
        for (source, keep) in [("gnss", used), ("judge", judging)] {
            if !keep.is_empty() {
                document.set(&format!("source.{source}.keep={keep}")).unwrap();
            }
        }
        let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
        let options = Options {
            base: at.path(""),
            ..Options::default()
        };
        run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"))
    };
    for (used, judging, is_used) in [
        ("{ every = 5 }", "{ except_every = 5 }", false),
        ("{ every = 1 }", "{ except_every = 5 }", true),
        ("{ every = 4 }", "{ every = 4, offset = 2 }", false),
        ("{ every = 4 }", "{ every = 6, offset = 2 }", true),
        ("", "{ except_every = 2 }", true),
        ("", "", true),
    ] {
        let summary = summary(used, judging);
        assert_eq!(summary.judge().source.as_deref(), Some("gnss"), "{used} {judging}");
        assert_eq!(summary.judge().used_rows, is_used, "{used} {judging}");
    }
    // Two parts of the log: the filter uses the first one, and the second one judges it.
    for (stop, start, is_used) in [("20 s", "20 s", false), ("20 s", "15 s", true)] {
        let mut document = Document::load(&at.path("design.toml")).unwrap();
        document.set(&format!("source.gnss.time.stop={stop}")).unwrap();
        document.set(&format!("source.judge.time.start={start}")).unwrap();
        let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(fusion::design::of_a_sensor(&design), Some(("gnss", is_used)), "{stop} {start}");
    }
}
