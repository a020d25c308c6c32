//! Every chart through the attitudes where Euler angles end: loops that pass ±90° of pitch, with an
//! attitude measured all the way.

use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::campaign::{Runs, Statistic, monte_carlo};

/// Two loops: the nose goes up to 150° of pitch and down to −150°, the second time while it turns.
const LOOPS: &str = r#"
[run]
origin = { latitude = "36.1 deg", longitude = "129.4 deg" }
[process]
type = "attitude_only"
source = "imu"
gyro_noise = "0.3 deg/sqrt(s)"
gyro_bias = { estimate = true, initial = [0, 0, 0], sigma = "0.1 deg/s" }
[sensor.tracker]
type = "attitude"
source = "tracker"
noise = { sigma = "3 deg" }
[initial.start]
type = "explicit"
attitude = [0, 0, "30 deg"]
attitude_sigma = "5 deg"
[simulation]
imu = { rate = "100 Hz", gyro = { noise = "0.3 deg/sqrt(s)" } }
draw_parameters = true
start = { heading = "30 deg" }
trajectory = [
    { type = "straight", duration = "5 s", speed = "20 m/s", acceleration = "10 m/s^2" },
    { type = "bump", duration = "10 s", pitch = "150 deg" },
    { type = "bump", duration = "10 s", pitch = "150 deg", heading = "60 deg" },
]
[simulation.sensor.tracker]
rate = "100 Hz"
white = "3 deg"
"#;

fn loops(chart: &str) -> Runs {
    let (mut document, errors) = Document::parse("loops.toml", LOOPS);
    assert!(errors.is_empty(), "{errors:?}");
    document.set(&format!("filter.chart={chart}")).unwrap();
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    monte_carlo(&design, &Options::default(), 0..10, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"))
}

#[test]
fn every_chart_is_consistent_through_loops_that_pass_the_vertical() {
    let nees = |chart: &str| loops(chart).campaign.judge(Statistic::Nees(2)).unwrap();
    let body = nees("body");
    assert!(body.is_consistent(), "{body:?}");
    for chart in ["navigation", "additive_quaternion", "additive_euler"] {
        let other = nees(chart);
        // 2 %: charts differ at second order in corrections of some 0.1 rad at the start, 1e-2 of it.
        // Euler angles up to a milliradian from the vertical would give 300 times as much.
        assert!((other.mean / body.mean - 1.0).abs() < 0.02, "{chart}: {other:?} {body:?}");
    }
}
