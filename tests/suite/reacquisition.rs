//! False tracks that a gate accepts, or must not accept: their effect on biases and latencies.

use super::real::recorded;
use super::support::Workspace;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// `estimates.csv` of `fusion run`: its columns by name.
struct Estimates {
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Estimates {
    fn of(test: &str, design: &str, more: &[&str]) -> Self {
        let w = Workspace::new(test);
        let design = format!("{ROOT}/configs/{design}");
        let sets = more.iter().flat_map(|set| ["--set", *set]);
        let args: Vec<&str> = ["run", &design, "--out", "out"].into_iter().chain(sets).collect();
        w.fusion(&args).success();
        let text = w.read("out/estimates.csv");
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let cells = |line: &str| line.split(',').map(|c| c.parse().unwrap_or(f64::NAN)).collect();
        Self {
            header,
            rows: lines.map(cells).collect(),
        }
    }

    fn column(&self, name: &str) -> impl Iterator<Item = f64> {
        let k = self.header.iter().position(|h| h == name).unwrap();
        self.rows.iter().map(move |row| row[k])
    }

    fn last(&self, name: &str) -> f64 {
        self.column(name).last().unwrap()
    }
}

/// Fixes 60 m away from the road for 45 s are accepted after 30 s, and rejected again 30 s after their end. With all of
/// P scaled the latency went to 5 s, with a 1σ of 0.01 s.
#[test]
fn a_false_track_that_is_believed_leaves_the_calibration_alone() {
    if !recorded() {
        return;
    }
    let data = std::env::var("FUSION_DATA").unwrap_or_else(|_| format!("{ROOT}/../shared/data"));
    for from in [600, 1200] {
        let track = format!(
            "source.gnss.fault.track={{ type = \"spike\", channel = \"position\", window = {{ from = \"{from} s\", duration = \"45 s\" }}, value = [0, \"60 m\", 0] }}"
        );
        let gate = "sensor.gnss_position.gate={ type = \"two_condition\", sigma = \"1.5 m\", min_distance = \"5 m\" }";
        let e = Estimates::of(
            &format!("false-track-{from}"),
            "real/pntos-car.toml",
            &[&format!("run.data_dir='{data}'"), gate, &track],
        );
        let stray = e
            .column("gnss_position.time_offset")
            .fold(0.0_f64, |worst, v| worst.max((v - 0.1).abs()));
        let bias = ["x", "y", "z"].map(|axis| e.column(&format!("accel_bias_{axis}")).fold(0.0_f64, |worst, v| worst.max(v.abs())));
        eprintln!("false track at {from} s: the latency strays by {stray:.3} s, accelerometer bias up to {bias:.3?} m/s²");
        // The limits of the specification; undisturbed 0.018 s and 0.06 m/s².
        assert!(stray <= 0.05 && bias.iter().all(|b| *b <= 0.1), "{stray} {bias:?}");
    }
}

/// A barometer without a gate, with an estimated bias. Right after an outage, GNSS is wrong in position and velocity
/// for 2.6 s, when five fixes that agree are accepted at once. When accepted within half a second, they moved height
/// and bias to hundreds of kilometres.
#[test]
fn a_glitch_after_an_outage_is_no_evidence_against_a_barometer() {
    for rate in [1, 2, 5, 10] {
        for (position, velocity) in [
            (r#"[0, 0, "200 m"]"#, r#"["1 km/s", "1 km/s", "1 km/s"]"#),
            (r#"["100 m", "100 m", "-50 m"]"#, r#"["10 m/s", 0, "20 m/s"]"#),
            (r#"["5 km", "5 km", "5 km"]"#, r#"["10 m/s", 0, "20 m/s"]"#),
        ] {
            let sensor = |name: &str, white: &str, value: &str| {
                format!(
                    "simulation.sensor.{name}={{ rate = \"{rate} Hz\", white = {white}, fault = {{ \
                     gap = {{ type = \"outage\", window = {{ from = \"45 s\", to = \"60 s\" }} }}, \
                     glitch = {{ type = \"spike\", value = {value}, window = {{ from = \"60 s\", duration = \"2.6 s\" }} }} }} }}"
                )
            };
            let e = Estimates::of(
                "glitch",
                "ins-gps.toml",
                &[
                    "simulation.draw_parameters=false",
                    "sensor.velocity.gate={ type = \"nis\", probability = 0.999 }",
                    "sensor.baro={ type = \"height\", source = \"baro\", noise = { sigma = \"0.5 m\" }, bias = { estimate = true, initial = 0, sigma = \"5 m\", random_walk = \"0.05 m/sqrt(s)\" } }",
                    "simulation.sensor.baro={ rate = \"10 Hz\", white = \"0.5 m\" }",
                    &sensor("position", "[\"1 m\", \"1 m\", \"2 m\"]", position),
                    &sensor("velocity", "\"0.05 m/s\"", velocity),
                ],
            );
            // The path is level, and the barometer has no bias.
            let ends = ["d_m", "baro.bias"].map(|name| (e.last(name), e.last(&format!("sigma_{name}"))));
            for (value, sigma) in ends {
                assert!(
                    value.abs() <= 3.0 * sigma && sigma < 1.0,
                    "{rate} Hz {position} {velocity}: {ends:?}"
                );
            }
        }
    }
}
