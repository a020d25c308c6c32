//! One step of the composed filter against one written by hand with dense matrices.
//!
//! `composed`  assembled from TOML through the public API, with 15 states, with 21, and with 21 of which
//!             all biases and scales are Gauss-Markov
//! `dense`     the same equations of 15 states on `SMatrix<f64, 15, 15>`: Φ(P + ½Q)Φᵀ + ½Q with every
//!             element computed, Joseph's form as three dense products; mechanisation and error model
//!             are the same functions. It is the rival of 21 states too: how long dense products of 21
//!             rows take depends on the build profile by a factor of two
//! `kernel/…`  the covariance alone: a prediction, and an update by six rows
//!
//! Before anything is timed, both compute the same and must agree. A line with the ratio, from
//! interleaved runs, follows each group: on a busy machine believe it rather than the times.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

mod composed;
mod dense;
mod kernel;

use composed::{Composed, MARKOV, PLAIN, SCALES, fix};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dense::{Dense, P15};
use fusion::core::filter::Estimator;
use fusion::core::geometry::so3;
use fusion::core::state::{Attitude, Geodetic, Manifold};
use nalgebra::Vector3;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Steps between two resets, so that the reset is not what is timed.
const STEPS: usize = 100;
const UPDATES: usize = 20;

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
    let composed = Composed::new(PLAIN);
    let names: Vec<&str> = composed.filter.layout().blocks().iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["position", "velocity", "attitude", "gyro_bias", "accel_bias"]);
    let dense = Dense::new(&composed.start, &composed.noise);
    (composed, dense)
}

/// In the middle of a run: correlated.
fn warm(sensors: &str) -> Composed {
    let mut composed = Composed::new(sensors);
    for k in 1..=500 {
        composed.predict(k);
        if k % 100 == 50 {
            composed.update(&fix(k));
        }
    }
    composed.start = composed.filter.belief().clone();
    composed
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
    let plain = warm(PLAIN);
    let dense = Dense::new(&plain.start, &plain.noise);
    let samples = plain.samples.clone();
    for (what, sensors) in [("n=15", PLAIN), ("n=21", SCALES), ("n=21, Gauss-Markov", MARKOV)] {
        let mut composed = warm(sensors);
        let name = format!("filter/predict/{what}");
        let mut group = c.benchmark_group(&name);
        group.throughput(Throughput::Elements(STEPS as u64));
        group.bench_function("composed", |b| b.iter(|| predict_composed(&mut composed)));
        group.bench_function("dense", |b| b.iter(|| predict_dense(&dense, &samples)));
        group.finish();
        ratio(&name, STEPS, || predict_composed(&mut composed), || predict_dense(&dense, &samples));
    }

    let (z, mut composed) = (fix(500), plain);
    let name = "filter/update/gnss_position/n=15";
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(UPDATES as u64));
    group.bench_function("composed", |b| b.iter(|| update_composed(&mut composed, &z)));
    group.bench_function("dense", |b| b.iter(|| update_dense(&dense, &z)));
    group.finish();
    ratio(name, UPDATES, || update_composed(&mut composed, &z), || update_dense(&dense, &z));

    let rival = kernel::Dense::new();
    for blocks in [5, 7] {
        let mut own = kernel::Composed::new(blocks);
        own.agrees(&rival);
        let n = 3 * blocks;
        ratio(
            &format!("kernel/predict/n={n}"),
            STEPS,
            || own.predict(STEPS),
            || {
                rival.predict(STEPS);
            },
        );
        ratio(
            &format!("kernel/update/m=6/n={n}"),
            UPDATES,
            || own.update(UPDATES),
            || {
                rival.update(UPDATES);
            },
        );
    }
}

criterion_group! {
    name = all;
    config = Criterion::default().warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    targets = benches
}
criterion_main!(all);
