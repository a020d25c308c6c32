use crate::real::data;
use crate::support::{Workspace, stderr, stdout};
use predicates::prelude::predicate;
use std::fmt::Write;
use std::path::Path;

/// Deviation of an axis at a cluster time, in the unit of `scale`, from allan.csv.
fn deviation(csv: &str, axis: &str, tau: f64, scale: f64) -> f64 {
    let row = csv.lines().map(|l| l.split(',').collect::<Vec<_>>()).find(|row| {
        let at = row[3].parse::<f64>().unwrap_or(f64::NAN);
        format!("{},{}", row[1], row[2]) == axis && (at / tau - 1.0).abs() < 1e-9
    });
    row.unwrap_or_else(|| panic!("{axis} at {tau}"))[4].parse::<f64>().unwrap() / scale
}

/// Figures of `adis16405_static/README.md`, computed by a separate program, and 2 deg/√h from the data sheet of the
/// unit.
#[test]
fn a_real_unit_at_rest_has_its_published_deviations() {
    let Some(data) = data() else { return };
    let log = data.join("adis16405_static/derived/adis16405_imu1_counts.csv.gz");
    let w = Workspace::new("allan-real");
    let gyro = ["--gyro", "gx_lsb,gy_lsb,gz_lsb", "--gyro-unit", "0.05 deg/s"];
    let force = ["--accelerometer", "ax_lsb,ay_lsb,az_lsb", "--accelerometer-unit", "0.00333 g"];
    let mut args = vec![
        "allan",
        log.to_str().unwrap(),
        "--rate",
        "100 Hz",
        "--out",
        "out",
        "--format",
        "json",
    ];
    args.extend(gyro);
    args.extend(force);
    let ran = w.fusion(&args).success();
    assert!(stdout(&ran).contains("Gyros of"));
    let csv = w.read("out/allan.csv");
    let (deg, g) = (1_f64.to_radians(), 9.80665);
    let published = [
        (
            "Gyro,x",
            deg,
            [(0.1, 0.125), (1.0, 0.0409), (10.0, 0.0134), (100.0, 0.0072), (1000.0, 0.0052)],
        ),
        (
            "Gyro,z",
            deg,
            [(0.1, 0.119), (1.0, 0.0387), (10.0, 0.0129), (100.0, 0.0082), (1000.0, 0.0170)],
        ),
    ];
    for (axis, scale, points) in published {
        for (tau, wanted) in points {
            let found = deviation(&csv, axis, tau, scale);
            // Half of the last printed digit there: 0.5e-3 and 0.5e-4.
            let bound = if tau < 1.0 { 0.5e-3 } else { 0.5e-4 };
            assert!(
                (found - wanted).abs() <= 1.01 * bound,
                "{axis} at {tau}: {found}, published {wanted}"
            );
        }
    }
    for (axis, points) in [
        (
            "Accelerometer,x",
            [(1.0, 7.2e-4), (10.0, 2.9e-4), (100.0, 3.4e-4), (1000.0, 8.7e-4)],
        ),
        (
            "Accelerometer,z",
            [(1.0, 6.2e-4), (10.0, 2.3e-4), (100.0, 2.4e-4), (1000.0, 4.2e-4)],
        ),
    ] {
        for (tau, wanted) in points {
            let found = deviation(&csv, axis, tau, g);
            assert!(
                (found - wanted).abs() <= 1.01 * 0.5e-5,
                "{axis} at {tau}: {found}, published {wanted}"
            );
        }
    }
    // The data sheet's angle random walk, 2 deg/√h = 0.0333 deg/s/√Hz, is a typical value: this unit has 0.04.
    let noise: toml::Table = toml::from_str(&w.read("out/noise.toml")).unwrap();
    for axis in noise["process"]["gyro"]["noise"].as_array().unwrap() {
        let value: f64 = axis.as_str().unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((0.036..0.044).contains(&value), "{value}");
    }
    assert!(w.read("out/allan.svg").contains("</svg>"));
}

/// White noise of 1 deg/s at 10 Hz, and a gap.
fn rest() -> String {
    let (mut state, mut csv) = (1_u64, String::from("t,gx,gy,gz\n"));
    let mut number = || {
        // Twelve uniform numbers have the variance 1.
        let sum: f64 = (0..12)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as f64 / f64::from(1_u32 << 31)
            })
            .sum();
        sum - 6.0
    };
    for k in 0..4000 {
        let t = f64::from(k) * 0.1 + if k >= 3600 { 5.0 } else { 0.0 };
        writeln!(csv, "{t:.3},{},{},{}", number(), number(), number()).unwrap();
    }
    csv
}

const REST: &str = r#"[source.imu]
type = "csv"
path = "rest.csv"
time = { column = "t", unit = "s" }
[source.imu.channels]
angular_rate = { columns = ["gx", "gy", "gz"], unit = "deg/s" }
"#;

/// The written TOML can be used in a design without changes.
#[test]
fn a_design_that_declares_the_channels_is_enough() {
    let w = Workspace::new("allan-design");
    w.write("rest.csv", rest());
    w.write("rest.toml", REST);
    let ran = w.fusion(&["allan", "rest.toml", "--out", "out"]).success();
    assert!(stderr(&ran).contains("1 gap"), "{}", stderr(&ran));
    let noise = w.read("out/noise.toml");
    let declared: toml::Table = toml::from_str(&noise).unwrap();
    let white = declared["process"]["gyro"]["noise"][0].as_str().unwrap();
    let white: f64 = white.split(' ').next().unwrap().parse().unwrap();
    // 1 deg/s at 10 Hz is 0.316 deg/s/√Hz. With 3600 samples, σ at one sample is known to 1.2 %; the bound is four
    // times that.
    assert!((white / 0.1_f64.sqrt() - 1.0).abs() < 0.048, "{white}");
    let design = format!(
        "[run]\norigin = {{ latitude = \"47 deg\", longitude = \"8 deg\" }}\n[process]\ntype = \"strapdown\"\nsource = \"imu\"\n\
         accelerometer.noise = 1e-3\n{}\n{REST}specific_force = {{ columns = [\"gx\", \"gy\", \"gz\"], unit = \"m/s^2\" }}\n\
         [initial.start]\ntype = \"explicit\"\nposition = {{ latitude = \"47 deg\", longitude = \"8 deg\" }}\nposition_sigma = 1\n\
         velocity = [0, 0, 0]\nvelocity_sigma = 1\nattitude = [0, 0, 0]\nattitude_sigma = \"1 deg\"\n",
        noise.replace("[process]\n", "")
    );
    w.write("pasted.toml", design);
    w.fusion(&["check", "pasted.toml"]).success();
}

/// A table with stamps gives the same result as the design that declares them.
#[test]
fn a_table_is_read_by_its_stamps_unless_a_rate_is_given() {
    let w = Workspace::new("allan-stamps");
    w.write("rest.csv", rest());
    w.write("rest.toml", REST);
    let noises = |args: &[&str]| {
        let mut all = vec!["allan"];
        all.extend(args);
        let ran = w.fusion(&all).success();
        let printed = stdout(&ran);
        let paste = printed.split("# For a design:").nth(1).unwrap().to_owned();
        (paste, stderr(&ran))
    };
    let table = ["rest.csv", "--gyro", "gx,gy,gz", "--gyro-unit", "deg/s"];
    let (declared, _) = noises(&["rest.toml"]);
    let (stamped, told) = noises(&table);
    assert!(told.contains("1 gap"), "{told}");
    assert_eq!(stamped, declared);
    // Rows are counted: the gap is not seen, and the rows at it are used.
    let (by_rows, told) = noises(&[&table[..], &["--rate", "10 Hz"]].concat());
    assert!(by_rows != stamped && told.is_empty(), "{told}");
}

/// Samples multiplied by the interval give the same noises, if the names state a unit or if gravity shows it.
#[test]
fn increments_are_divided_by_the_interval() {
    let w = Workspace::new("allan-increments");
    let noise = |k: i32, seed: f64| {
        let x = (f64::from(k) * 12.9898 + seed).sin() * 43_758.545;
        x - x.floor() - 0.5
    };
    let table = |header: &str, factor: f64| {
        let row = |k: i32| {
            let of = |at: f64, size: f64, seed: f64| format!("{:.9}", factor * (at + size * noise(k, seed)));
            let force = [of(0.0, 0.1, 1.0), of(0.0, 0.1, 2.0), of(-9.8, 0.1, 3.0)];
            let rate = [of(0.0, 0.01, 4.0), of(0.0, 0.01, 5.0), of(0.0, 0.01, 6.0)];
            format!("{:.3},{},{}\n", 0.01 * f64::from(k), force.join(","), rate.join(","))
        };
        format!("{header}\n{}", (0..6000).map(row).collect::<String>())
    };
    let of = |name: &str, names: [&str; 6], factor: f64| {
        w.write(name, table(&format!("t,{}", names.join(",")), factor));
        let (force, rate) = (names[..3].join(","), names[3..].join(","));
        let ran = w.fusion(&["allan", name, "--accelerometer", &force, "--gyro", &rate]).success();
        (stdout(&ran), stderr(&ran))
    };
    let paste = |printed: &str| printed.split("# For a design:").nth(1).unwrap().to_owned();
    let (rates, warned) = of("rates.csv", ["ax", "ay", "az", "gx", "gy", "gz"], 1.0);
    assert!(!rates.contains("increments") && warned.is_empty(), "{rates}{warned}");
    let named = ["dvx_mps", "dvy_mps", "dvz_mps", "dthx_rad", "dthy_rad", "dthz_rad"];
    for (file, names) in [("named.csv", named), ("bare.csv", ["a", "b", "c", "d", "e", "f"])] {
        let (increments, warned) = of(file, names, 0.01);
        assert!(
            increments.matches("The columns hold increments").count() == 2 && warned.is_empty(),
            "{increments}{warned}"
        );
        assert_eq!(paste(&increments), paste(&rates), "{file}");
    }
    // If no column shows gravity, the numbers are in another unit.
    let (_, warned) = of("counts.csv", ["ax", "ay", "az", "gx", "gy", "gz"], 7.0);
    assert!(
        warned.contains("68.6 m/s^2 long") && warned.contains("--accelerometer-unit"),
        "{warned}"
    );
}

#[test]
fn a_mistake_says_what_is_accepted() {
    let w = Workspace::new("allan-mistakes");
    w.write("rest.csv", rest());
    w.write("rest.toml", REST.replace("angular_rate", "velocity").replace("deg/s", "m/s"));
    let broken = rest().replacen("0.200,", "0.200,x", 1);
    w.write("broken.csv", broken);
    w.write("bare.csv", rest().replacen("t,", "row,", 1));
    let columns = ["--gyro", "gx,gy,gz"];
    for (args, said) in [
        (&["rest.csv"][..], "`--gyro gx,gy,gz`"),
        (&["bare.csv", columns[0], columns[1]], "add `--rate"),
        (&["rest.csv", "--rate", "100 m"], "a frequency"),
        (&["rest.csv", "--rate", "100 Hz"], "`--gyro gx,gy,gz`"),
        (&["rest.csv", "--rate", "100 Hz", "--gyro", "gx,gy"], "takes three columns, not 2"),
        (&["rest.csv", "--rate", "100 Hz", "--gyro", "gx,gy,gzz"], "did you mean `gz`"),
        (
            &["rest.csv", "--rate", "100 Hz", columns[0], columns[1], "--gyro-unit", "m"],
            "an angular rate",
        ),
        (&["broken.csv", "--rate", "100 Hz", columns[0], columns[1]], "broken.csv:4"),
        (&["rest.toml"], "no source has a channel `angular_rate`"),
        (&["rest.toml", "--source", "imuu"], "did you mean `imu`"),
    ] {
        let mut all = vec!["allan"];
        all.extend(args);
        w.fusion(&all).code(2).stderr(predicate::str::contains(said));
    }
    assert!(!Path::new(&w.path("out")).exists());
}

#[test]
fn a_part_of_a_log_is_cut_out_by_seconds_and_by_stamps() {
    let w = Workspace::new("allan-part");
    w.write("rest.csv", rest());
    w.write("rest.toml", REST);
    let spans = |args: &[&str]| {
        let ran = w.fusion(&[&["allan"], args, &["--from", "20", "--to", "@200"]].concat()).success();
        let told = stdout(&ran);
        assert!(told.contains("180 s at 10 Hz"), "{told}");
        // The gap is after the selected part.
        assert!(!stderr(&ran).contains("gap"), "{}", stderr(&ran));
    };
    let columns = ["--gyro", "gx,gy,gz"];
    spans(&["rest.toml"]);
    spans(&[&["rest.csv"], &columns[..]].concat());
    spans(&[&["rest.csv", "--rate", "10 Hz"], &columns[..]].concat());
    let empty = w.fusion(&["allan", "rest.toml", "--from", "9000"]).code(2);
    assert!(stderr(&empty).contains("--from"), "{}", stderr(&empty));
    let wrong = w.fusion(&["allan", "rest.toml", "--from", "noon"]).code(2);
    assert!(stderr(&wrong).contains("seconds from the first sample"), "{}", stderr(&wrong));
}
