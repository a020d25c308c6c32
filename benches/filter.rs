//! One step of the composed 15-state filter against one written by hand with dense matrices.
//!
//! `composed`  assembled from the TOML text below through the public API
//! `dense`     the same equations on `SMatrix<f64, 15, 15>`: Φ(P + ½Q)Φᵀ + ½Q with every element
//!             computed, Joseph's form as three dense products; mechanisation and error model
//!             are the same kernels
//!
//! Before anything is timed, both run over the same ten seconds and must agree. A line with the
//! ratio, from interleaved runs, follows each group: on a busy machine believe it rather than
//! the times.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fusion::core::filter::{Backend, Estimator, Filter, Observed, Verdict};
use fusion::core::gate::Open;
use fusion::core::geometry::so3;
use fusion::core::loss::Quadratic;
use fusion::core::model::{Input, Measurement, Size};
use fusion::core::state::{Attitude, Belief, Geodetic, Manifold};
use fusion::core::time::Time;
use fusion::models::earth::Gravity;
use fusion::models::process::strapdown::{error_model, increments, mechanisation};
use mechanisation::Nav;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

const DESIGN: &str = r#"
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.2 deg/sqrt(h)"
accelerometer.noise = "70 ug/sqrt(Hz)"
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "0.01 deg/s", random_walk = "1e-6 rad/s/sqrt(s)" }
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg", random_walk = "1e-4 m/s^2/sqrt(s)" }

[sensor.gnss]
type = "gnss_position"
source = "gnss"
lever_arm = [0.4, -0.2, -1.1]
noise = { sigma = ["1.5 m", "1.5 m", "2.5 m"] }

[initial.start]
type = "explicit"
position = { latitude = "47 deg", longitude = "8 deg", height = "400 m" }
position_sigma = "3 m"
velocity = [10, -5, 1]
velocity_sigma = "0.5 m/s"
attitude = ["2 deg", "-3 deg", "130 deg"]
attitude_sigma = ["0.5 deg", "0.5 deg", "3 deg"]
"#;

const LEVER_ARM: Vector3<f64> = Vector3::new(0.4, -0.2, -1.1);
const DT: f64 = 0.01;
/// Steps between two resets, so that the reset is not what is timed.
const STEPS: usize = 100;
const UPDATES: usize = 20;

/// Mean rates and forces of the samples, a slow turn with some shaking.
fn sample(k: usize) -> [f64; 6] {
    let t = k as f64 * DT;
    [
        0.02 * t.sin(),
        0.01 * (1.3 * t).cos(),
        0.1 + 0.02 * (0.7 * t).sin(),
        0.3 * (2.0 * t).sin(),
        0.2 * t.cos(),
        -9.8 + 0.1 * (3.0 * t).sin(),
    ]
}

fn prepared(k: usize) -> [f64; 13] {
    let mut numbers = [DT; 13];
    numbers[..6].copy_from_slice(&sample(k));
    numbers[6..12].copy_from_slice(&sample(k.saturating_sub(1)));
    numbers
}

fn fix(k: usize) -> [f64; 3] {
    let t = k as f64 * DT;
    [47_f64.to_radians() + 1.57e-6 * t, 8_f64.to_radians() - 1.15e-6 * t, 400.0 - t]
}

struct Composed {
    filter: Filter,
    gnss: Arc<dyn Measurement>,
    noise: [f64; 9],
    start: Belief,
    samples: Vec<[f64; 6]>,
    /// Each with the one before and its interval, as the process's preparation makes them.
    prepared: Vec<[f64; 13]>,
}

impl Composed {
    fn new() -> Self {
        let mut nav = fusion::Navigator::from_toml(DESIGN).expect("the design is sound");
        // The sample that opens the first interval starts the filter.
        nav.feed("imu", 0.0, &sample(0)).unwrap();
        let start = nav.belief().expect("started").clone();
        let assembly = nav.assembly();
        let sensor = &assembly.sensors[0];
        let mut noise = [0.0; 9];
        (0..3).for_each(|i| noise[4 * i] = sensor.sigma[i] * sensor.sigma[i]);
        let size = Size::same(3);
        let mut filter = Filter::new(assembly.layout.clone(), assembly.process.clone(), Backend::ERROR_STATE, size);
        filter.set_belief(start.clone());
        Self {
            filter,
            gnss: sensor.model.clone(),
            noise,
            start,
            samples: (0..2000).map(sample).collect(),
            prepared: (0..2000).map(prepared).collect(),
        }
    }

    fn predict(&mut self, k: usize) {
        let input = Input {
            sample: &self.prepared[k],
            interval: DT,
        };
        self.filter.predict(Time::from_nanos(k as i64 * 10_000_000), &input).unwrap();
    }

    fn update(&mut self, z: &[f64; 3]) {
        let observed = Observed {
            sensor: 0,
            model: self.gnss.as_ref(),
            value: z,
            noise: &self.noise,
            quality: None,
            lateness: None,
        };
        assert_eq!(self.filter.update(&observed, &mut Open, &[], &Quadratic).verdict, Verdict::Accepted);
    }
}

type P15 = SMatrix<f64, 15, 15>;

/// The filter that one would write by hand for this one design.
#[derive(Clone)]
struct Dense {
    nav: Nav,
    gyro_bias: Vector3<f64>,
    accel_bias: Vector3<f64>,
    covariance: P15,
    q_white: P15,
    q_walk: P15,
    r: Matrix3<f64>,
}

impl Dense {
    fn new(start: &Belief, noise: &[f64; 9]) -> Self {
        let x = &start.x;
        let three = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
        let psd = |noise: f64| noise * noise * DT;
        let diagonal = |at: [usize; 2], q: [f64; 2]| {
            P15::from_fn(|i, j| {
                if i == j {
                    (0..2).map(|k| if i / 3 == at[k] { q[k] } else { 0.0 }).sum()
                } else {
                    0.0
                }
            })
        };
        let gyro = 0.2_f64.to_radians() / 60.0;
        Self {
            nav: Nav {
                position: Geodetic::read(x),
                v_eb_n: three(3),
                q_nb: Attitude::read(&x[6..]),
            },
            gyro_bias: three(10),
            accel_bias: three(13),
            covariance: P15::from_row_slice(&start.covariance.to_dense()),
            q_white: diagonal([1, 2], [psd(70e-6 * 9.80665), psd(gyro)]),
            q_walk: diagonal([3, 4], [psd(1e-6), psd(1e-4)]),
            r: Matrix3::from_row_slice(noise),
        }
    }

    fn predict(&mut self, now: &[f64; 6], before: &[f64; 6]) {
        let rate = |s: &[f64; 6]| Vector3::new(s[0], s[1], s[2]) - self.gyro_bias;
        let force = |s: &[f64; 6]| Vector3::new(s[3], s[4], s[5]) - self.accel_bias;
        let (w, f, w0, f0) = (rate(now), force(now), rate(before), force(before));
        let b = error_model::continuous(&self.nav, &w, &f, Gravity::Somigliana);
        let mut phi = P15::identity();
        let mut add = |row: usize, column: usize, block: &Matrix3<f64>| {
            let mut view = phi.fixed_view_mut::<3, 3>(3 * row, 3 * column);
            view += block * DT;
        };
        add(0, 0, &b.rr);
        add(0, 1, &b.rv);
        add(1, 0, &b.vr);
        add(1, 1, &b.vv);
        add(1, 2, &b.va);
        add(1, 4, &b.v_accel);
        add(2, 0, &b.ar);
        add(2, 1, &b.av);
        add(2, 2, &b.aa);
        add(2, 3, &b.a_gyro);
        let half = self.q_white * 0.5;
        self.covariance = phi * (self.covariance + half) * phi.transpose() + half + self.q_walk;
        let (wc, fc) = (
            w + increments::coning_rate(&w0, &w, DT),
            f + increments::sculling_rate(&w0, &f0, &w, &f, DT),
        );
        self.nav = mechanisation::step(&self.nav, &wc, &fc, DT, Gravity::Somigliana);
    }

    fn update(&mut self, z: &[f64; 3]) {
        let c_nb = so3::rotation(&self.nav.q_nb);
        let predicted = self.nav.position.offset(&(c_nb * LEVER_ARM));
        let residual = Geodetic::read(z).difference(&predicted);
        let mut h = SMatrix::<f64, 3, 15>::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        h.fixed_view_mut::<3, 3>(0, 6).copy_from(&(-c_nb * so3::skew(&LEVER_ARM)));
        let hp = h * self.covariance;
        let s = hp * h.transpose() + self.r;
        let gain = s.cholesky().expect("positive").solve(&hp).transpose();
        let keep = P15::identity() - gain * h;
        self.covariance = keep * self.covariance * keep.transpose() + gain * self.r * gain.transpose();
        let d: SVector<f64, 15> = gain * residual;
        let three = |i: usize| d.fixed_rows::<3>(i).into_owned();
        self.nav.position = self.nav.position.offset(&three(0));
        self.nav.v_eb_n += three(3);
        self.nav.q_nb *= so3::exp(&three(6));
        self.nav.q_nb.renormalize();
        self.gyro_bias += three(9);
        self.accel_bias += three(12);
    }
}

/// Both over ten seconds with a fix in each: the same state and covariance.
fn agree() {
    let (mut composed, mut dense) = pair();
    for k in 1..=1000 {
        composed.predict(k);
        dense.predict(&composed.samples[k], &composed.samples[k - 1]);
        if k % 100 == 50 {
            composed.update(&fix(k));
            dense.update(&fix(k));
        }
    }
    let belief = composed.filter.belief();
    let p = P15::from_row_slice(&belief.covariance.to_dense());
    let sigma = |i: usize| p[(i, i)].sqrt();
    for i in 0..15 {
        for j in 0..15 {
            // 1e-9 of the deviations: 1000 products whose roundings, 1e-16, condition numbers
            // of 1e6 in units of metres and radians magnify.
            let e = (p[(i, j)] - dense.covariance[(i, j)]).abs();
            assert!(e <= 1e-9 * sigma(i) * sigma(j), "P({i}, {j}) differs by {e:e}");
        }
    }
    let x = &belief.x;
    let three = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
    let errors = [
        Geodetic::read(x).difference(&dense.nav.position),
        three(3) - dense.nav.v_eb_n,
        so3::log(&(dense.nav.q_nb.inverse() * Attitude::read(&x[6..]))),
        three(10) - dense.gyro_bias,
        three(13) - dense.accel_bias,
    ];
    for (b, e) in errors.iter().enumerate() {
        // 1e-8 of a deviation: as above; a radian of longitude rounds to 1e-9 m.
        let worst = (0..3).map(|i| e[i].abs() / sigma(3 * b + i)).fold(0.0, f64::max);
        assert!(worst < 1e-8, "block {b} differs by {worst:e} deviations");
    }
    // The run was one in which the fixes mattered.
    assert!(sigma(0) < 1.5, "{}", sigma(0));
}

fn pair() -> (Composed, Dense) {
    let composed = Composed::new();
    let names: Vec<&str> = composed.filter.layout().blocks().iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["position", "velocity", "attitude", "gyro_bias", "accel_bias"]);
    let dense = Dense::new(&composed.start, &composed.noise);
    (composed, dense)
}

/// The beliefs to start from: correlated, as in the middle of a run.
fn warm() -> (Composed, Dense) {
    let (mut composed, _) = pair();
    for k in 1..=500 {
        composed.predict(k);
        if k % 100 == 50 {
            composed.update(&fix(k));
        }
    }
    composed.start = composed.filter.belief().clone();
    let dense = Dense::new(&composed.start, &composed.noise);
    (composed, dense)
}

fn predict_composed(c: &mut Composed) {
    c.filter.set_belief(c.start.clone());
    (501..501 + STEPS).for_each(|k| c.predict(k));
    black_box(c.filter.belief());
}

fn predict_dense(d: &Dense, samples: &[[f64; 6]]) {
    let mut d = d.clone();
    (501..501 + STEPS).for_each(|k| d.predict(&samples[k], &samples[k - 1]));
    black_box(&d);
}

fn update_composed(c: &mut Composed, z: &[f64; 3]) {
    c.filter.set_belief(c.start.clone());
    (0..UPDATES).for_each(|_| c.update(black_box(z)));
    black_box(c.filter.belief());
}

fn update_dense(d: &Dense, z: &[f64; 3]) {
    let mut d = d.clone();
    (0..UPDATES).for_each(|_| d.update(black_box(z)));
    black_box(&d);
}

/// Prints the ratio of the least times of interleaved runs.
fn ratio(what: &str, per_run: usize, mut composed: impl FnMut(), mut dense: impl FnMut()) {
    let time = |run: &mut dyn FnMut()| {
        let clock = Instant::now();
        run();
        clock.elapsed()
    };
    let mut least = [Duration::MAX; 2];
    for _ in 0..500 {
        least[0] = least[0].min(time(&mut composed));
        least[1] = least[1].min(time(&mut dense));
    }
    let [a, b] = least.map(|d| d.as_nanos() as f64 / per_run as f64);
    println!("{what}: composed {a:.0} ns, dense {b:.0} ns, ratio {:.2}", a / b);
}

fn benches(c: &mut Criterion) {
    agree();
    let (mut composed, dense) = warm();
    let samples = composed.samples.clone();
    let mut group = c.benchmark_group("filter/predict/n=15");
    group.throughput(Throughput::Elements(STEPS as u64));
    group.bench_function("composed", |b| b.iter(|| predict_composed(&mut composed)));
    group.bench_function("dense", |b| b.iter(|| predict_dense(&dense, &samples)));
    group.finish();
    ratio(
        "filter/predict/n=15",
        STEPS,
        || predict_composed(&mut composed),
        || predict_dense(&dense, &samples),
    );

    let z = fix(500);
    let mut group = c.benchmark_group("filter/update/gnss_position/n=15");
    group.throughput(Throughput::Elements(UPDATES as u64));
    group.bench_function("composed", |b| b.iter(|| update_composed(&mut composed, &z)));
    group.bench_function("dense", |b| b.iter(|| update_dense(&dense, &z)));
    group.finish();
    ratio(
        "filter/update/gnss_position/n=15",
        UPDATES,
        || update_composed(&mut composed, &z),
        || update_dense(&dense, &z),
    );
}

criterion_group! {
    name = all;
    config = Criterion::default().warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    targets = benches
}
criterion_main!(all);
