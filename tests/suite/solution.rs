//! The solution of a process: position, velocity and attitude in estimates.csv compared with a known motion, for
//! processes that derive a part of the solution from their input or from other states.

use crate::support::Workspace;
use fusion::core::geometry::wgs84::Geodetic;
use std::fmt::Write;

/// Speed ahead \[m/s\].
const U: f64 = 2.0;
/// Rate of turn \[rad/s\].
const R: f64 = 0.1;
/// Heading at the start \[rad\].
const START: f64 = 0.5;
/// Heading error of the attitude reference \[rad\].
const OFF: f64 = -0.7;
/// Seconds between two rows.
const STEP: f64 = 0.1;

/// Heading \[rad\], position north and east of the origin \[m\], after `t` seconds of the circle.
fn circle(t: f64) -> [f64; 3] {
    let psi = START + R * t;
    let radius = U / R;
    [psi, radius * (psi.sin() - START.sin()), radius * (START.cos() - psi.cos())]
}

/// A minute of the circle, as every instrument of the designs below sees it.
fn log() -> String {
    let origin = Geodetic::new(45_f64.to_radians(), 10_f64.to_radians(), 0.0);
    let mut text = "t,lat,lon,height,level,yaw,u,s,d,r\n".to_owned();
    for k in 0..=600 {
        let t = STEP * f64::from(k);
        let [psi, n, e] = circle(t);
        let place = origin.offset(&[n, e, 0.0].into());
        let [lat, lon] = [place.lat, place.lon].map(f64::to_degrees);
        let off = psi - OFF;
        writeln!(text, "{t},{lat:.10},{lon:.10},{},0,{off},{U},0,0,{R}", place.height).unwrap();
    }
    text
}

/// Runs the process `design` over the log; its columns of estimates.csv by name, in its last 20 s.
fn estimates(name: &str, design: &str) -> impl Fn(&str) -> Vec<f64> {
    let w = Workspace::new(&format!("solution-{name}"));
    w.write("log.csv", log());
    w.write(
        "circle.toml",
        format!(
            r#"
[run]
origin = {{ latitude = "45 deg", longitude = "10 deg", height = 0 }}
[source.log]
type = "csv"
path = "log.csv"
time = {{ column = "t" }}
[source.log.channels]
position = {{ latitude = "lat", longitude = "lon", height = "height", unit = "deg" }}
attitude = {{ rpy = ["level", "level", "yaw"], unit = "rad" }}
body_velocity = {{ columns = ["u", "s", "d"], unit = "m/s" }}
forward_speed = {{ column = "u", unit = "m/s" }}
yaw_rate = {{ column = "r", unit = "rad/s" }}
{design}
"#
        ),
    );
    w.fusion(&["run", "circle.toml", "--out", "results"]).success();
    let text = w.read("results/estimates.csv");
    move |wanted: &str| {
        let column = text.lines().next().unwrap().split(',').position(|name| name == wanted).unwrap();
        let rows = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>());
        rows.filter(|row| row[0] > 40.0).map(|row| row[column]).collect()
    }
}

/// The largest differences of velocity \[m/s\], heading \[rad\] and position \[m\] from the circle.
fn errors(of: &impl Fn(&str) -> Vec<f64>) -> [f64; 3] {
    let columns = ["t_s", "n_m", "e_m", "vn_mps", "ve_mps", "yaw_deg", "roll_deg", "pitch_deg"].map(of);
    let mut worst = [0.0_f64; 3];
    assert!(columns[0].len() > 100);
    for (k, t) in columns[0].iter().enumerate() {
        let [n, e, vn, ve, yaw, roll, pitch] = [1, 2, 3, 4, 5, 6, 7].map(|i: usize| columns[i][k]);
        let [psi, north, east] = circle(*t);
        let turn = (yaw.to_radians() - psi)
            .sin()
            .abs()
            .max(roll.to_radians().abs())
            .max(pitch.to_radians().abs());
        let found = [(vn - U * psi.cos()).hypot(ve - U * psi.sin()), turn, (n - north).hypot(e - east)];
        // A NaN counts as larger than all numbers.
        worst = [0, 1, 2].map(|i| if found[i] <= worst[i] { worst[i] } else { found[i] });
    }
    worst
}

#[test]
fn dead_reckoning_tells_velocity_and_attitude_of_the_vehicle() {
    let reference = r#"
[process]
type = "dead_reckoning"
source = "log"
position_sigma = "1 m"
velocity_sigma = ["2 m/s", "0.1 m/s", "0.1 m/s"]
velocity_noise = ["1 cm/s/sqrt(s)", "1 cm/s/sqrt(s)", "1 cm/s/sqrt(s)"]
heading_offset = { estimate = true, initial = -0.5, sigma = "20 deg" }
drift = { estimate = true, initial = [0, 0, 0], sigma = ["1 cm/s", "1 cm/s", 0] }
[initial.fix]
type = "first_fix"
source = "log"
position_sigma = "1 m"
[sensor.water]
type = "body_velocity"
source = "log"
noise = { sigma = "1 cm/s" }
[sensor.fix]
type = "gnss_position"
source = "log"
noise = { sigma = "10 cm" }
"#;
    let of = estimates("dead-reckoning", reference);
    let [v, turn, moved] = errors(&of);
    // The log is without noise: one thousandth of the initial errors, 2 m/s and 0.2 rad, remains.
    assert!(v < 2e-3 && turn < 1e-3 && moved < 1e-3, "{v} {turn} {moved}");
    // The error of the attitude is that of the offset about down, without tilt.
    let [yaw, offset, roll, north] = ["sigma_yaw_deg", "sigma_heading_offset", "sigma_roll_deg", "sigma_vn_mps"].map(&of);
    for ((yaw, offset), (roll, north)) in yaw.iter().zip(&offset).zip(roll.iter().zip(&north)) {
        assert!((yaw.to_radians() - offset).abs() < 1e-6 && *roll < 1e-6, "{yaw} {offset} {roll}");
        assert!(*north > 1e-4 && *north < 0.05, "{north}");
    }
}

#[test]
fn planar_odometry_tells_the_velocity_of_its_input() {
    let odometry = r#"
[process]
type = "planar_odometry"
source = "log"
sideways = false
forward_noise = "1 mm/sqrt(s)"
sideways_noise = "1 mm/sqrt(s)"
yaw_rate_noise = "0.01 deg/sqrt(s)"
[initial.start]
type = "explicit"
position_sigma = ["1 cm", "1 cm", 0]
heading = 0.5
heading_sigma = "0.1 deg"
"#;
    let [v, turn, moved] = errors(&estimates("odometry", odometry));
    // Digits of the file, 5 and 6; the plane against the ellipsoid, 40² m²/R.
    assert!(v < 2e-5 && turn < 1e-6 && moved < 1e-3, "{v} {turn} {moved}");
}

#[test]
fn a_unicycle_tells_velocity_and_attitude_of_its_states() {
    let unicycle = r#"
[process]
type = "unicycle"
speed_noise = "1 mm/s^2/sqrt(Hz)"
yaw_rate_noise = "0.01 deg/s^2/sqrt(Hz)"
position_sigma = "1 m"
initial_heading = 0.4
heading_sigma = "10 deg"
speed_sigma = "2 m/s"
yaw_rate_sigma = "10 deg/s"
[initial.fix]
type = "first_fix"
source = "log"
position_sigma = "1 m"
[sensor.fix]
type = "gnss_position"
source = "log"
noise = { sigma = "10 cm" }
"#;
    let [v, turn, moved] = errors(&estimates("unicycle", unicycle));
    // As above.
    assert!(v < 2e-3 && turn < 1e-3 && moved < 1e-3, "{v} {turn} {moved}");
}
