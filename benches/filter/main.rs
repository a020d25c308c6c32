//! One step of the composed filter against one written by hand with dense matrices.
//!
//! `composed`  assembled from TOML through the public API, with 15 states, with 21, and with 21 of which
//!             all biases and scales are Gauss-Markov
//! `epoch`     a row of the inertial unit through the whole of an assembled design, with one fix in 200 rows: the
//!             row is put in order, predicted with and reported. Compared with the same arithmetic on dense matrices
//! `dense`     the same equations of 15 states on `SMatrix<f64, 15, 15>`: Φ(P + ½Q)Φᵀ + ½Q with every
//!             element computed, Joseph's form as three dense products; mechanisation and error model
//!             are the same functions. The filters of 21 states are compared with it too: the time of dense
//!             products of 21 rows depends on the build profile by a factor of two
//! `kernel/…`  the covariance alone: a prediction, an update by six rows and one by three. Compared with dense
//!             matrices of 15 states, and with the methods of `rivals.rs` at the same number of states
//! `backend/…` the same steps with every chart, update and form, compared with the same dense filter
//! `avx2/…`    the steps of filter and covariance as on a processor without AVX-512
//! `unused/…`  the cost of filter parts that do nothing: `unused.rs`
//!
//! Before anything is timed, both compute the same and must agree. Lines with ratios, from interleaved runs, follow
//! each group. On a busy machine the ratios are more reliable than the times.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

mod backends;
mod composed;
mod dense;
mod kernel;
#[path = "../measure/mod.rs"]
mod measure;
mod rivals;
mod unused;

use backends::BACKENDS;
use composed::{Composed, MARKOV, PLAIN, SCALES, fix, sample};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dense::{Dense, P15};
use fusion::core::covariance::Kernel;
use fusion::core::filter::{Backend, Estimator};
use fusion::core::geometry::so3;
use fusion::core::runner::Event;
use fusion::core::state::{Attitude, Geodetic, Manifold};
use fusion::core::time::Time;
use measure::{Work, compare};
use nalgebra::Vector3;
use std::time::Duration;

/// Steps between two resets, so that the reset is not timed.
const STEPS: usize = 100;
const UPDATES: usize = 20;

/// Both over ten seconds with a fix in each: the same state and covariance.
fn agree() {
    let (mut composed, mut dense) = pair();
    for k in 1..=1000 {
        composed.predict(k);
        dense.predict(&sample(k), &sample(k - 1));
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
    // The fixes must have mattered in this run.
    assert!(sigma(0) < 1.5, "{}", sigma(0));
}

fn pair() -> (Composed, Dense) {
    let composed = Composed::new(PLAIN, Backend::ERROR_STATE);
    let names: Vec<&str> = composed.filter.layout().blocks().iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["position", "velocity", "attitude", "gyro_bias", "accel_bias"]);
    let dense = Dense::new(&composed.start, &composed.noise);
    (composed, dense)
}

/// Epochs of a second, with one fix in their midst.
const SECOND: usize = 200;

/// The whole path of a row through an assembled design: order, prediction and, once, an update.
fn epochs(n: usize, sensors: &str, dense: &Dense, samples: &[[f64; 6]]) {
    let mut nav = composed::started(sensors);
    let [imu, gnss] = ["imu", "gnss"].map(|name| nav.stream(name).unwrap());
    let feed = |nav: &mut fusion::Navigator, stream, k: usize, row: &[f64]| {
        let time = Time::from_nanos(k as i64 * 10_000_000);
        nav.feed_stream(stream, time, row, &mut |_: &Event<'_>| {})
            .expect("the row is sound");
    };
    (1..=500).for_each(|k| feed(&mut nav, imu, k, &samples[k]));
    let saved = nav.checkpoint();
    let mut run = || {
        nav.restore(&saved).expect("the same design");
        for (k, sample) in samples.iter().enumerate().skip(501).take(SECOND) {
            if k == 600 {
                feed(&mut nav, gnss, k, &fix(k));
            }
            feed(&mut nav, imu, k, sample);
        }
    };
    let mut rival = || dense.second(samples, SECOND);
    compare(
        &format!("filter/epoch/n={n}"),
        SECOND,
        [("composed", &mut run), ("dense", &mut rival)],
    );
}

/// The prediction of a covariance alone, of B blocks of three, N states: every rival in its own line.
fn kernel_predict<const N: usize, const B: usize>() {
    let (dense, sparse, mut faer) = (rivals::Dense::<15>::new(), rivals::Sparse::<B>::new(), rivals::Faer::new(N));
    let mut own = kernel::Composed::new(B, 6);
    let works: [Work<'_>; 4] = [
        ("composed", &mut || own.predict(STEPS)),
        ("dense", &mut || {
            dense.predict(STEPS);
        }),
        ("block-sparse", &mut || {
            sparse.predict(STEPS);
        }),
        ("faer", &mut || {
            faer.predict(STEPS);
        }),
    ];
    compare(&format!("kernel/predict/n={N}"), STEPS, works);
}

/// Its update by M rows.
fn kernel_update<const N: usize, const B: usize, const M: usize>() {
    rivals::agree::<N, B, M>();
    let (dense, sparse) = (rivals::Dense::<15>::new(), rivals::Sparse::<B>::new());
    let mut own = kernel::Composed::new(B, M);
    let works: [Work<'_>; 3] = [
        ("composed", &mut || own.update(UPDATES)),
        ("dense", &mut || {
            dense.update::<M>(UPDATES);
        }),
        ("block-sparse", &mut || {
            sparse.update::<M>(UPDATES);
        }),
    ];
    compare(&format!("kernel/update/m={M}/n={N}"), UPDATES, works);
}

/// The steps of filter and covariance by another kernel, in a group with the kernel's name.
fn by_kernel(kernel: Kernel, dense: &Dense, samples: &[[f64; 6]]) {
    let name = kernel.name();
    let backend = Backend {
        kernel: Some(kernel),
        ..Backend::ERROR_STATE
    };
    for (n, sensors) in [(15, PLAIN), (21, SCALES)] {
        let mut composed = Composed::warm(sensors, backend);
        let rival = &mut || dense.predictions(samples, STEPS);
        let works: [Work<'_>; 2] = [("composed", &mut || composed.predictions(STEPS)), ("dense", rival)];
        compare(&format!("{name}/filter/predict/n={n}"), STEPS, works);
        let rival = &mut || dense.updates(UPDATES);
        let works: [Work<'_>; 2] = [("composed", &mut || composed.updates(UPDATES)), ("dense", rival)];
        compare(&format!("{name}/filter/update/gnss_position/n={n}"), UPDATES, works);
    }
    covariance::<15, 5>(kernel);
    covariance::<21, 7>(kernel);
}

/// The covariance alone by another kernel, compared with dense matrices.
fn covariance<const N: usize, const B: usize>(kernel: Kernel) {
    let (name, rival) = (kernel.name(), rivals::Dense::<15>::new());
    let mut own = kernel::Composed::new(B, 6);
    own.work.kernel = kernel;
    let mut dense = || {
        rival.predict(STEPS);
    };
    let works: [Work<'_>; 2] = [("composed", &mut || own.predict(STEPS)), ("dense", &mut dense)];
    compare(&format!("{name}/covariance/predict/n={N}"), STEPS, works);
    let mut dense = || {
        rival.update::<6>(UPDATES);
    };
    let works: [Work<'_>; 2] = [("composed", &mut || own.update(UPDATES)), ("dense", &mut dense)];
    compare(&format!("{name}/covariance/update/m=6/n={N}"), UPDATES, works);
    let mut own = kernel::Composed::new(B, 3);
    own.work.kernel = kernel;
    let mut dense = || {
        rival.update::<3>(UPDATES);
    };
    let works: [Work<'_>; 2] = [("composed", &mut || own.update(UPDATES)), ("dense", &mut dense)];
    compare(&format!("{name}/covariance/update/m=3/n={N}"), UPDATES, works);
}

fn benches(c: &mut Criterion) {
    println!("kernel: {}", Kernel::default().name());
    agree();
    let mut plain = Composed::warm(PLAIN, Backend::ERROR_STATE);
    let (dense, samples) = (Dense::new(&plain.start, &plain.noise), dense::samples());
    for (what, sensors) in [("n=15", PLAIN), ("n=21", SCALES), ("n=21, Gauss-Markov", MARKOV)] {
        let mut composed = Composed::warm(sensors, Backend::ERROR_STATE);
        let name = format!("filter/predict/{what}");
        let mut group = c.benchmark_group(&name);
        group.throughput(Throughput::Elements(STEPS as u64));
        group.bench_function("composed", |b| b.iter(|| composed.predictions(STEPS)));
        group.bench_function("dense", |b| b.iter(|| dense.predictions(&samples, STEPS)));
        group.finish();
        let rival = &mut || dense.predictions(&samples, STEPS);
        compare(&name, STEPS, [("composed", &mut || composed.predictions(STEPS)), ("dense", rival)]);
    }
    epochs(15, PLAIN, &dense, &samples);
    epochs(21, SCALES, &dense, &samples);

    let name = "filter/update/gnss_position/n=15";
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(UPDATES as u64));
    group.bench_function("composed", |b| b.iter(|| plain.updates(UPDATES)));
    group.bench_function("dense", |b| b.iter(|| dense.updates(UPDATES)));
    group.finish();
    let rival = &mut || dense.updates(UPDATES);
    compare(name, UPDATES, [("composed", &mut || plain.updates(UPDATES)), ("dense", rival)]);

    unused::print(|| Composed::warm(PLAIN, Backend::ERROR_STATE));

    kernel_predict::<15, 5>();
    kernel_update::<15, 5, 6>();
    kernel_update::<15, 5, 3>();
    kernel_predict::<21, 7>();
    kernel_update::<21, 7, 6>();
    kernel_update::<21, 7, 3>();
    for (name, backend) in BACKENDS {
        for (n, sensors) in [(15, PLAIN), (21, SCALES)] {
            let mut own = Composed::warm(sensors, backend);
            let rival = &mut || dense.predictions(&samples, STEPS);
            let what = format!("backend/predict/{name}/n={n}");
            compare(&what, STEPS, [("composed", &mut || own.predictions(STEPS)), ("dense", rival)]);
            let rival = &mut || dense.updates(UPDATES);
            let what = format!("backend/update/{name}/n={n}");
            compare(&what, UPDATES, [("composed", &mut || own.updates(UPDATES)), ("dense", rival)]);
        }
    }
    // The portable kernel is for equal figures, not for speed.
    let others = Kernel::here().filter(|k| *k != Kernel::default() && *k != Kernel::PORTABLE);
    others.for_each(|kernel| by_kernel(kernel, &dense, &samples));
}

criterion_group! {
    name = all;
    config = Criterion::default().warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    targets = benches
}
criterion_main!(all);
