//! An attitude filter inside a stage, with a body at rest, a shaken body, and a body near a magnet.

use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::belief::Belief;
use fusion::core::geometry::so3;
use fusion::core::runner::{Event, Row, Runner};
use fusion::core::state::{Attitude, Manifold};
use fusion::core::time::Time;
use fusion::design::Design;
use nalgebra::{UnitQuaternion, Vector3};

const G: f64 = 9.81;

/// The process outside follows the filter inside. `inside` overrides tables of the filter inside.
fn design(inside: &str) -> Design {
    let text = format!(
        r#"
[process]
type = "attitude_only"
source = "attitude"
gyro_noise = 1e-2
[sensor.attitude]
type = "attitude"
source = "attitude"
noise = {{ from_source = true }}
[initial.start]
type = "explicit"
attitude = [0, 0, 0]
attitude_sigma = 1
[stage.attitude]
type = "filter"
[stage.attitude.process]
type = "attitude_only"
source = "imu"
gyro_noise = 1e-3
gyro_bias = {{ estimate = true, initial = [0, 0, 0], sigma = 0.01 }}
[stage.attitude.initial.level]
type = "levelling"
source = "imu"
duration = 1
tilt_sigma = 0.03
[stage.attitude.initial.heading]
type = "compass"
source = "magnetic"
sigma = 0.1
[stage.attitude.stage.tilt]
type = "steady_force"
source = "imu"
time_constant = 1.5
band = 0.05
gravity = {G}
[stage.attitude.sensor.tilt]
type = "gravity_direction"
source = "tilt"
gravity = {G}
# 0.01 rad of g; 300 rows in two time constants say as much as one.
noise = {{ sigma = 1.7 }}
[stage.attitude.stage.magnetic]
type = "compass"
source = "imu"
level_source = "imu"
declination = -0.1
rate = 30
gate = {{ magnitude = 0.05, dip = 0.05, adopt_after = 20 }}
[stage.attitude.sensor.compass]
type = "attitude"
part = "heading"
source = "magnetic"
noise = {{ sigma = 0.1 }}
[variant.test.stage.attitude]
{inside}
"#
    );
    let (mut document, errors) = Document::parse("test.toml", &text);
    assert!(errors.is_empty(), "{errors:?}");
    document.overlay("variant.test").unwrap();
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// A gradient step for every sample, as a vertical or as a whole attitude.
fn gradient(part: &str) -> String {
    format!(
        "stage.tilt = {{ type = 'gravity_gradient', source = 'imu', sigma = 4e-3, gravity = {G} }}\n\
         sensor.tilt = {{ type = 'attitude', part = '{part}', source = 'tilt', noise = {{ from_source = true }} }}"
    )
}

/// A body of attitude `q`, and the filter inside that follows it.
struct Bench {
    runner: Runner,
    imu: usize,
    q: UnitQuaternion<f64>,
    /// Bias of the gyros.
    bias: Vector3<f64>,
    inside: Option<Belief>,
}

impl Bench {
    fn new(inside: &str, q: UnitQuaternion<f64>, bias: Vector3<f64>) -> Self {
        let design = design(inside);
        let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
        let imu = assembly.runner.stream("imu").unwrap();
        Self {
            runner: assembly.runner,
            imu,
            q,
            bias,
            inside: None,
        }
    }

    /// Runs from one second to another, with 100 samples per second, the acceleration `a_n(t)` and the field `m_n`.
    fn run(&mut self, seconds: (i32, i32), a_n: impl Fn(f64) -> Vector3<f64>, m_n: &Vector3<f64>) {
        for k in seconds.0 * 100..seconds.1 * 100 {
            let t = f64::from(k) * 0.01;
            let f = self.q.inverse() * (a_n(t) - Vector3::new(0.0, 0.0, G));
            let m = self.q.inverse() * m_n;
            let numbers: Vec<f64> = [self.bias, f, m].iter().flat_map(|v| v.iter().copied()).collect();
            let inside = &mut self.inside;
            let mut observer = |event: &Event<'_>| {
                if let Event::Nested {
                    stage: "attitude",
                    event: Event::Estimate { belief },
                } = event
                {
                    *inside = Some((*belief).clone());
                }
            };
            let row = Row::new(self.imu, Time::from_seconds(t), &numbers);
            self.runner.feed(&row, &mut observer).unwrap();
        }
    }

    fn belief(&self) -> &Belief {
        self.inside.as_ref().unwrap()
    }

    /// The rotation from the body's attitude to the estimated attitude, navigation axes \[rad\].
    fn error(&self) -> Vector3<f64> {
        so3::log(&(Attitude::read(&self.belief().x[..4]) * self.q.inverse()))
    }

    fn found_bias(&self) -> Vector3<f64> {
        Vector3::from_column_slice(&self.belief().x[4..7])
    }

    /// 1σ of the heading.
    fn heading_sigma(&self) -> f64 {
        let p = self.belief().covariance.to_dense();
        let c = so3::rotation(&Attitude::read(&self.belief().x[..4]));
        let down = c.row(2);
        let variance: f64 = (0..3)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| down[i] * p[i * 6 + j] * down[j])
            .sum();
        variance.sqrt()
    }
}

fn rest(_: f64) -> Vector3<f64> {
    Vector3::zeros()
}

/// Declination −0.1 rad, dip 1 rad.
fn field_n() -> Vector3<f64> {
    Vector3::new(0.1_f64.cos() * 1_f64.cos(), -0.1_f64.sin() * 1_f64.cos(), 1_f64.sin()) * 5e-5
}

#[test]
fn the_first_attitude_is_level_and_heads_to_true_north() {
    let mut bench = Bench::new("", so3::from_rpy(0.4, -0.8, 2.5), Vector3::zeros());
    bench.run((0, 1), rest, &field_n());
    assert!(bench.inside.is_none(), "a second has not passed");
    bench.run((1, 2), rest, &field_n());
    assert!(bench.error().norm() < 1e-9, "{}", bench.error()); // rounding of sums and updates of 100
}

#[test]
fn gyro_biases_of_all_axes_are_found_at_rest() {
    let bias = Vector3::new(0.006, -0.004, 0.008);
    for inside in [String::new(), gradient("tilt")] {
        let mut bench = Bench::new(&inside, so3::from_rpy(0.4, -0.8, 2.5), bias);
        bench.run((0, 120), rest, &field_n());
        let found = bench.found_bias();
        // One tenth: a compass of 0.1 rad determines the bias about the heading axis no better in two minutes.
        assert!((found - bias).norm() < 0.1 * bias.norm(), "{inside}: {found}");
        assert!(bench.error().norm() < 0.01, "{inside}: {}", bench.error());
    }
}

#[test]
fn shaking_is_averaged_by_the_low_pass() {
    // 3 m/s² at 1 Hz from second 2 on: |f| differs from g by 5 % at most.
    let shake = |t: f64| {
        let size = if t > 2.0 { 3.0 * (core::f64::consts::TAU * t).sin() } else { 0.0 };
        Vector3::new(size, 0.0, 0.0)
    };
    let worst = |inside: &str| {
        let mut bench = Bench::new(inside, so3::from_rpy(0.1, 0.0, 1.0), Vector3::zeros());
        let mut worst: f64 = 0.0;
        for second in 0..30 {
            bench.run((second, second + 1), shake, &field_n());
            if bench.inside.is_some() {
                worst = worst.max(bench.error().xy().norm());
            }
        }
        worst
    };
    let (averaged, stepped) = (worst(""), worst(&gradient("tilt")));
    // The force is off by 0.306 rad. The low pass transmits 1/(2π·1.5) of that, the filter less.
    assert!(averaged < 0.0325, "{averaged}");
    assert!(stepped > averaged, "{stepped} {averaged}");
}

#[test]
fn a_disturbed_field_is_left_out_and_one_that_stays_is_believed_in_the_end() {
    // A magnet: 20 % more field, and 0.28 rad of heading.
    let magnet = so3::exp(&Vector3::new(0.0, 0.0, 0.28)) * field_n() * 1.2;
    let mut gated = Bench::new("", so3::from_rpy(0.1, -0.2, 1.0), Vector3::zeros());
    gated.run((0, 5), rest, &field_n());
    gated.run((5, 24), rest, &magnet);
    // The remaining error of the bias may turn the attitude a little.
    assert!(gated.error().norm() < 1e-3, "{}", gated.error());
    gated.run((24, 90), rest, &magnet);
    assert!(gated.error().z < -0.1, "{}", gated.error());
    let mut trusting = Bench::new(
        "stage.magnetic.gate.enabled = false",
        so3::from_rpy(0.1, -0.2, 1.0),
        Vector3::zeros(),
    );
    trusting.run((0, 5), rest, &field_n());
    trusting.run((5, 24), rest, &magnet);
    assert!(trusting.error().z < -0.05, "without a gate it is believed at once");
}

#[test]
fn a_magnet_that_swings_the_field_is_held_off_until_the_field_has_been_right_for_a_while() {
    // In every second second the field is only turned by 0.28 rad, which gates of size and dip do not see. In between
    // its dip is also larger by 0.1 rad.
    let turned = so3::exp(&Vector3::new(0.0, 0.0, 0.28)) * field_n();
    let dipped = so3::exp(&Vector3::new(0.0, -0.1, 0.0)) * field_n();
    let heading = |gate: &str| {
        let mut bench = Bench::new(gate, so3::from_rpy(0.1, -0.2, 1.0), Vector3::zeros());
        bench.run((0, 5), rest, &field_n());
        for second in 5..25 {
            bench.run((second, second + 1), rest, if second % 2 == 0 { &turned } else { &dipped });
        }
        bench.run((25, 30), rest, &field_n());
        bench.error().z.abs()
    };
    let (held_off, at_once) = (heading("stage.magnetic.gate.hold_off = 2"), heading(""));
    // Undisturbed, the error is rounding. Five seconds after the magnet has left it is again as small: the remaining
    // error is one smoothed sample. Without `hold_off`, the field is accepted each time it looks right, and the error
    // is a fifth of the turn.
    assert!(held_off < 1e-3, "{held_off}");
    assert!(at_once > 0.03, "{at_once}");
}

#[test]
fn a_heading_taken_for_measured_drowns_the_compass() {
    // The gradient needs a bias to correct. Without a bias it takes no step.
    let sigma = |part: &str| {
        let mut bench = Bench::new(&gradient(part), so3::from_rpy(0.1, -0.2, 1.0), Vector3::new(1e-3, 1e-3, 0.0));
        bench.run((0, 20), rest, &field_n());
        bench.heading_sigma()
    };
    let (whole, vertical) = (sigma("all"), sigma("tilt"));
    assert!(whole < 0.2 * vertical, "{whole} {vertical}");
}

#[test]
fn the_published_cascade_has_the_fifteen_states_of_the_paper() {
    let design = crate::steered::design("ins-gps-outlier.toml", &["cascaded"], &[]);
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
    let names: Vec<&str> = assembly.layout.blocks().iter().map(|block| block.name.as_str()).collect();
    assert_eq!(names, ["position", "velocity", "attitude", "accel_bias", "gyro_bias"]);
    assert_eq!(assembly.layout.dim(), 15);
}
