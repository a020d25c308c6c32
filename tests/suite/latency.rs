//! Time offsets that are estimated.

use crate::real::real;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::design::Design;
use fusion::rows::Nobody;
use fusion::run::{Options, Summary, run};
use fusion::world::SimulatedRows;

const VELOCITY: &str = "sensor.gnss_velocity.time_offset";
const POSITION: &str = "sensor.gnss_position.time_offset";

/// Value and 1σ of the parameter `name` at the end.
fn end(summary: &Summary, name: &str) -> (f64, f64) {
    let state = summary.parameters().iter().find(|s| s.name == name).unwrap();
    (state.value[0], state.sigma[0])
}

/// Where the latency of the velocity ends from each of these initial values \[s\].
fn ends(design: &str, initial: &[f64], also: &[&str]) -> Option<Vec<(f64, f64)>> {
    let from = |initial: &f64| {
        let set = format!("{VELOCITY}={{ estimate = true, initial = \"{initial} s\", sigma = \"0.2 s\" }}");
        let sets: Vec<&str> = also.iter().copied().chain([set.as_str()]).collect();
        real(design, &[], &sets).map(|summary| end(&summary, "gnss_velocity.time_offset"))
    };
    initial.iter().map(from).collect()
}

/// All in `range`, and no two apart by more than 10 ms or 3σ.
fn agree(ends: &[(f64, f64)], range: core::ops::Range<f64>) {
    let (low, high) = ends
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), e| (low.min(e.0), high.max(e.0)));
    let sigma = ends.iter().map(|e| e.1).fold(f64::MAX, f64::min);
    assert!(range.contains(&low) && range.contains(&high), "{ends:?}");
    assert!(high - low < 0.01 && high - low < 3.0 * sigma, "{ends:?}");
}

#[test]
fn the_latency_of_the_car_s_receiver_is_found_from_any_initial_value() {
    let unknown = format!("{POSITION}={{ estimate = true, initial = \"0 s\", sigma = \"0.2 s\" }}");
    // Regression of the velocity on the log's reference: 0.28 s by the median, 0.34 s by least squares.
    let Some(found) = ends("pntos-car", &[0.0, 0.25, 0.5], &[&unknown]) else {
        return;
    };
    agree(&found, 0.28..0.34);
}

#[test]
fn the_latency_of_the_rtk_receiver_is_found_from_any_initial_value() {
    // By the innovations of fixed offsets 0.13 s.
    let Some(found) = ends("rtklib-drive", &[0.0, 0.3, 0.5], &[]) else {
        return;
    };
    agree(&found, 0.12..0.16);
}

#[test]
fn a_latency_and_a_position_that_are_unknown_cost_nothing_in_an_outage() {
    let window = "source.gnss.fault.outage.window={ from = \"420 s\", duration = \"60 s\", every = \"180 s\" }";
    let rms = |sets: &[&str]| {
        let summary = real("pntos-car", &["outages"], sets)?;
        let drift = &summary.score().unwrap().drift;
        let sum: f64 = drift.iter().map(|d| d.max_horizontal.powi(2)).sum();
        Some((sum / drift.len() as f64).sqrt())
    };
    let Some(declared) = rms(&[window]) else { return };
    let unknown = [POSITION, VELOCITY].map(|path| format!("{path}={{ estimate = true, initial = \"0 s\", sigma = \"0.2 s\" }}"));
    let unknown = rms(&[window, &unknown[0], &unknown[1]]).unwrap();
    // 7.3 m both; it was 20 m where the offset stuck to its initial value.
    assert!(unknown < 1.1 * declared, "{unknown} {declared}");
}

/// A drive with turns, accelerometers of 40 mm/s/√s and a receiver of unknown latency.
fn drive() -> Design {
    let around = r#"
    { type = "straight", distance = "100 m", speed = "10 m/s", acceleration = "1 m/s^2" },
    { type = "turn", angle = "90 deg", radius = "30 m" },
    { type = "straight", distance = "60 m" },
    { type = "turn", angle = "-90 deg", radius = "30 m" },
    "#
    .repeat(8);
    let text = format!(
        r#"
[run]
origin = {{ latitude = "36.1 deg", longitude = "129.4 deg" }}
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.125 deg/sqrt(h)"
accelerometer.noise = "40 mm/s/sqrt(s)"
[sensor.position]
type = "gnss_position"
source = "gnss"
noise = {{ sigma = "1 m" }}
[sensor.velocity]
type = "gnss_velocity"
source = "gnss"
time_offset = {{ estimate = true, initial = "0.25 s", sigma = "150 ms" }}
noise = {{ sigma = "0.05 m/s" }}
[initial.start]
type = "explicit"
position_sigma = "2 m"
velocity = [0, 0, 0]
velocity_sigma = "0.1 m/s"
attitude = [0, 0, 0]
attitude_sigma = ["0.1 deg", "0.1 deg", "1 deg"]
[simulation]
draw_parameters = true
imu = {{ rate = "100 Hz", gyro = {{ noise = "0.125 deg/sqrt(h)" }}, accelerometer = {{ noise = "40 mm/s/sqrt(s)" }} }}
trajectory = [ {{ type = "rest", duration = "5 s" }}, {around} ]
[simulation.sensor.position]
rate = "5 Hz"
white = "1 m"
[simulation.sensor.velocity]
rate = "5 Hz"
white = "0.05 m/s"
"#
    );
    let (document, mistakes) = Document::parse("drive.toml", &text);
    assert!(mistakes.is_empty());
    Design::read(document).unwrap_or_else(|e| panic!("{e}"))
}

/// The true latency: the first velocity is valid at 0.
fn truth(design: &Design, seed: u64) -> f64 {
    let assembly = assemble(design, declared_streams(design).unwrap()).unwrap();
    let velocity = assembly.streams.iter().position(|s| s.name == "velocity").unwrap();
    let mut world = SimulatedRows::new(design, design.simulation.as_ref().unwrap(), &assembly, Some(seed)).unwrap();
    loop {
        let row = world.next(&mut Nobody).unwrap();
        if row.stream == velocity {
            return row.time.seconds();
        }
    }
}

#[test]
fn a_simulated_latency_is_found_within_three_sigma_by_noisy_accelerometers() {
    let design = drive();
    let normalised: Vec<f64> = (1..=4)
        .map(|seed| {
            let options = Options {
                seed: Some(seed),
                ..Options::default()
            };
            let summary = run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
            let (value, sigma) = end(&summary, "velocity.time_offset");
            assert!(sigma < 0.005, "{sigma}");
            (value - truth(&design, seed)) / sigma
        })
        .collect();
    assert!(normalised.iter().all(|z| z.abs() < 3.0), "{normalised:?}");
    // 3σ of the mean of four. An input averaged over the past alone ends 3σ too late, each time.
    assert!(normalised.iter().sum::<f64>().abs() < 4.0 * 1.5, "{normalised:?}");
}
