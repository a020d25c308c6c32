//! The navigators of a tracked vehicle under water: a published navigator as printed, a hardened version, and
//! navigators for comparison.

use super::support::{Workspace, stderr};
use fusion::config::Document;
use fusion::core::filter::Step;
use fusion::core::runner::{Event, Halt};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run, run};
use std::path::Path;

fn design(changes: &[&str], variants: &[&str]) -> Design {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tracked-navigators.toml");
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    changes.iter().for_each(|change| document.set(change).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// The share of each innovation in the first correction by every sensor: the diagonal of HK. The number of rows
/// identifies the sensor.
#[derive(Default)]
struct FirstGains(Vec<Vec<f64>>);

impl RunObserver for FirstGains {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            event:
                Event::Step(Step::Corrected {
                    jacobian,
                    gain,
                    residual,
                    correction,
                    ..
                }),
            ..
        } = event
        else {
            return Ok(());
        };
        let (m, n) = (residual.len(), correction.len());
        let share = |j: usize| jacobian.row(j).iter().zip(&gain[j * n..]).map(|(h, k)| h * k).sum();
        self.0.push((0..m).map(share).collect());
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

#[test]
fn the_first_gains_of_the_printed_matrices_are_those_of_the_paper() {
    // P0 and R as printed at d = 30 m, with each row at its time. Q is left out: the gains are those of the first
    // instant, before Q has an effect.
    let q = ["process.position_noise=0", "process.accelerometer.noise=0", "process.gyro.noise=0"];
    let end = [
        "simulation.trajectory=[{ type = \"rest\", duration = \"2 s\" }]",
        "reference.from=0",
    ];
    let design = design(&[&q[..], &end[..]].concat(), &["chna-literal", "asynchronous"]);
    let options = Options::default();
    let mut gains = FirstGains::default();
    Run::open(&design, &options).unwrap().go(&mut [&mut gains], &mut |_| {}).unwrap();
    // The fix, then depth, speeds and attitude of the same epoch.
    let wanted: [&[f64]; 4] = [&[0.9174, 0.9174], &[0.5], &[0.0588; 3], &[0.9901, 0.9901, 0.5]];
    for wanted in wanted {
        let found = gains.0.iter().find(|g| {
            // 2 %: the effect of 0.05 m/s, and of a tilt of 1 deg under gravity, in the tenths of a second before.
            g.len() == wanted.len() && g.iter().zip(wanted).all(|(g, w)| (g / w - 1.0).abs() < 0.02)
        });
        assert!(found.is_some(), "{wanted:?} is not among {:?}", gains.0);
    }
}

/// The number of measurements that each sensor has offered.
#[derive(Default)]
struct Offered([u64; 8]);

impl RunObserver for Offered {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Filter {
            event: Event::Updated { sensor, .. },
            ..
        } = event
        {
            self.0[*sensor] += 1;
        }
        Ok(())
    }
}

#[test]
fn the_printed_filter_takes_all_its_rows_when_a_fix_comes() {
    let design = design(&[], &["chna-literal"]);
    let mut offered = Offered::default();
    Run::open(&design, &Options::default())
        .unwrap()
        .go(&mut [&mut offered], &mut |_| {})
        .unwrap();
    let fixes = offered.0[0];
    assert!(design.sensors[0].name == "usbl" && fixes > 800, "{fixes}");
    for (sensor, count) in design.sensors.iter().zip(offered.0).skip(1) {
        // The first measurement of each sensor is used at the start, and none follows the last fix.
        assert!(count.abs_diff(fixes) <= 2, "{}: {count} for {fixes} fixes", sensor.name);
    }
}

#[test]
fn range_and_angles_tell_the_position_and_the_speed_of_sound() {
    let summary = run(&design(&[], &["raw-usbl"]), &Options::default(), &mut |_| {}).unwrap();
    let score = summary.score().unwrap();
    let horizontal = score.horizontal_rms;
    // 0.5° and 0.1 m at 36 m are 0.3 m for one fix. Tracks and attitude average some ten fixes.
    assert!(horizontal < 0.2, "{horizontal}");
    let sound = summary.parameters().iter().find(|p| p.name == "usbl.sound_speed").unwrap();
    // 800 ranges of 0.1 m at 36 m. Depth and bearing determine the position of the vehicle. The initial σ is 0.5 %.
    assert!(sound.sigma[0] < 1e-3, "{:?}", sound.sigma);
}

#[test]
fn a_simulated_ship_is_where_its_table_says() {
    let w = Workspace::new("ship_simulated");
    w.fusion(&["new", "mine", "--from", "auv"]).success();
    let run = ["run", "mine.toml", "--variant", "ship", "--out", "out"];
    w.fusion(&run).success();
    let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let blocks = summary["score"]["blocks"].as_array().unwrap();
    let of = |name: &str| {
        blocks.iter().find(|block| block["name"] == name).unwrap()["rms"][0]
            .as_f64()
            .unwrap()
    };
    // Fixes of 0.5 m and 0.3 deg five times a second, with walks of 10 m and 20 deg per second: each fix alone
    // determines the pose.
    assert!((0.4..0.6).contains(&of("ship.position")), "{}", of("ship.position"));
    assert!((0.2..0.4).contains(&of("ship.attitude").to_degrees()), "{}", of("ship.attitude"));
    let horizontal = summary["score"]["horizontal_rms"].as_f64().unwrap();
    // At 40 to 170 m the angles of ship and transceiver cause 0.6 deg of heading: 1.8 m for one fix.
    assert!(horizontal < 1.5, "{horizontal}");
    // Without a ship nothing is drawn at its place.
    let text = w.read("mine.toml");
    let line = text.lines().find(|line| line.starts_with("ship = { position")).unwrap();
    w.write("mine.toml", text.replace(line, ""));
    let refused = w.fusion(&run).failure();
    let told = stderr(&refused);
    assert!(
        told.contains("the sensor `ship` measures the pose of a ship") && told.contains("add `ship = {"),
        "{told}"
    );
}

#[test]
fn a_first_fix_does_not_count_the_slow_error_twice() {
    let w = Workspace::new("first_fix_slow");
    w.fusion(&["new", "mine", "--from", "drone"]).success();
    let text = w.read("mine.toml");
    let explicit = "position_sigma = [\"2 m\", \"2 m\", \"4 m\"]\n";
    let fix = |sigma: &str| {
        let fix = format!("[initial.fix]\ntype = \"first_fix\"\nsource = \"gnss\"\n{sigma}\n");
        format!("{}\n{fix}", text.replace(explicit, ""))
    };
    let nees = |sigma: &str| {
        w.write("mine.toml", fix(sigma));
        let design = Design::read(Document::load(&w.path("mine.toml")).unwrap()).unwrap_or_else(|d| panic!("{d}"));
        let campaign =
            fusion_judge::campaign::monte_carlo(&design, &Options::default(), 0..16, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
        campaign.campaign.pooled().nees[0].unwrap()
    };
    let (honest, place) = (nees("position_sigma = [\"1.5 m\", \"1.5 m\", \"3.2 m\"]"), nees(""));
    // 1.3 m and 1.5 m, 3 m and 3.2 m: 1 + 0.75 and 1 + 0.88 times the variance. Sixteen runs with three axes: χ²/48 is
    // within 0.53 … 1.66 with 99.8 %.
    assert!((0.53..1.66).contains(&place) && honest > 1.4 * place, "{honest} {place}");
    w.write("mine.toml", fix("position_sigma = [\"1.5 m\", \"1.5 m\", \"3.2 m\"]"));
    let told = |w: &Workspace| stderr(&w.fusion(&["check", "mine.toml"]).success());
    assert!(
        told(&w).contains("the first fix has the slow error of `gnss_position` too"),
        "{}",
        told(&w)
    );
    // A 1σ of 2.5 times that value means another source.
    for silent in ["", "position_sigma = [\"4 m\", \"4 m\", \"8 m\"]"] {
        w.write("mine.toml", fix(silent));
        assert!(!told(&w).contains("slow error"), "{}", told(&w));
    }
    // A first fix without σ needs a sensor that measures the position.
    let lonely = ["check", "mine.toml", "--set", "sensor.gnss_position.enabled=false"];
    w.write("mine.toml", fix(""));
    let refused = w.fusion(&lonely).failure();
    let told = stderr(&refused);
    assert!(told.contains("no sensor reads a position"), "{told}");
}

#[test]
fn a_transceiver_on_a_ship_under_way_finds_a_transponder_that_stands() {
    use fusion::core::geometry::so3;
    use fusion::core::geometry::wgs84::Geodetic;
    use nalgebra::Vector3;
    let w = Workspace::new("ship_usbl");
    w.write(
        "design.toml",
        r#"run = { origin = { latitude = "36.0983 deg", longitude = "129.4499 deg" } }
filter.update = "iterated"
process = { type = "hold", walk = "1 mm/sqrt(s)", position_sigma = "100 m" }
sensor.usbl = { type = "usbl", source = "acoustics", vessel = "ship", transceiver = [4, -2, 3], mounting = [0, 0, "45 deg"], noise = { sigma = ["10 cm", "0.5 deg", "0.5 deg"] } }
sensor.ship = { type = "vessel_pose", source = "acoustics", noise = { sigma = [0.02, 0.02, 0.02, 0.001, 0.001, 0.001] } }
initial.start = { type = "explicit", position_sigma = "100 m" }
[source.acoustics]
type = "csv"
path = "acoustics.csv"
time = { column = "t" }
[source.acoustics.channels]
ship_position = { latitude = "lat", longitude = "lon", height = "h", unit = "rad" }
ship_attitude = { rpy = ["roll", "pitch", "yaw"], unit = "rad" }
range = { column = "range", unit = "m" }
bearing = { column = "bearing", unit = "rad" }
depression = { column = "depression", unit = "rad" }
"#,
    );
    let (origin, target) = (
        Geodetic::new(36.0983_f64.to_radians(), 129.4499_f64.to_radians(), 0.0),
        Vector3::new(12.0, -20.0, 25.0),
    );
    let mut rows = "t,lat,lon,h,roll,pitch,yaw,range,bearing,depression\n".to_owned();
    for k in 0..60 {
        let t = f64::from(k);
        // Ten metres to and fro, ten degrees of yaw.
        let place = Vector3::new(10.0 * (0.1 * t).sin(), 10.0 * (0.13 * t).cos(), 0.3 * t.sin());
        let [roll, pitch, yaw] = [0.05 * t.sin(), 0.03 * (0.7 * t).cos(), 0.17 * (0.2 * t).sin()];
        let in_ship = so3::from_rpy(roll, pitch, yaw).inverse() * (target - place) - Vector3::new(4.0, -2.0, 3.0);
        let s = so3::from_rpy(0.0, 0.0, core::f64::consts::FRAC_PI_4).inverse() * in_ship;
        let p = origin.offset(&place);
        let (bearing, depression) = (s.y.atan2(s.x), s.z.atan2(s.xy().norm()));
        rows += &format!(
            "{t},{:?},{:?},{:?},{roll:?},{pitch:?},{yaw:?},{:?},{bearing:?},{depression:?}\n",
            p.lat,
            p.lon,
            p.height,
            s.norm()
        );
    }
    w.write("acoustics.csv", rows);
    w.fusion(&["run", "design.toml", "--data", ".", "--out", "out"]).success();
    let estimates = w.read("out/estimates.csv");
    let (header, last) = (estimates.lines().next().unwrap(), estimates.lines().last().unwrap());
    let value = |name: &str| {
        let column = header.split(',').position(|h| h == name).unwrap();
        last.split(',').nth(column).unwrap().parse::<f64>().unwrap()
    };
    let found = Vector3::new(value("n_m"), value("e_m"), value("d_m"));
    // The measurements are exact. The remaining error comes from the linearisation of the first fix, some 30 m away
    // from the start, and a millimetre from the plane in which the numbers are made. With a single linearisation the
    // end is 5 m off.
    assert!((found - target).norm() < 0.05, "{found}");
}
