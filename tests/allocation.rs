//! Prediction, update and the runner allocate nothing once they have warmed up.
//!
//! This is a separate binary, because the counting allocator applies to the whole program.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]
#![expect(
    unsafe_code,
    reason = "an allocator can be written in no other way; this one forwards to the system's"
)]

use fusion::Navigator;
use fusion::config::Document;
use fusion::core::chart::{Biases, Reset, Side};
use fusion::core::covariance::{Form, FormKind, SquareRoot, Workspace};
use fusion::core::filter::{Backend, Bank, BankLimits, ChartKind, Estimator, Filter, Observed, Verdict};
use fusion::core::gate::{FalseTracks, Gate, Hypotheses, Nis, Open, Recovery};
use fusion::core::linear::Transition;
use fusion::core::loss::Quadratic;
use fusion::core::model::{Input, Size};
use fusion::core::runner::{Event, Halt, Observer};
use fusion::core::smoother::{FixedInterval, Link, Shelf, Tape};
use fusion::core::state::{Declaration, Dynamics, LayoutBuilder, StateRole, Vector};
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::output::FileSet;
use fusion::run::{Options, Run};
use fusion_present::report::Recording;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Of this thread only: the test harness allocates in other threads.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    /// Bytes that this thread holds now, and the largest number so far.
    static BYTES: Cell<(i64, i64)> = const { Cell::new((0, 0)) };
}

struct Counting;

fn count() {
    // A thread that ends has no counter any more. Its allocations are not counted.
    let _ = ALLOCATIONS.try_with(|c| c.set(c.get() + 1));
}

fn take(bytes: i64) {
    let _ = BYTES.try_with(|b| {
        let (now, most) = b.get();
        b.set((now + bytes, most.max(now + bytes)));
    });
}

// SAFETY: every call is forwarded to the system's allocator with its arguments unchanged, and
// counting neither allocates nor panics.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        take(layout.size() as i64);
        // SAFETY: the caller gives the guarantees that `System` requires.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        take(layout.size() as i64);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        take(size as i64 - layout.size() as i64);
        // SAFETY: as above; `memory` came from `System`.
        unsafe { System.realloc(memory, layout, size) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        take(-(layout.size() as i64));
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations and reallocations of this thread while `work` runs.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// The largest number of bytes that this thread held while `work` ran, minus those at its start.
fn peak(work: impl FnOnce()) -> i64 {
    let (before, _) = BYTES.get();
    BYTES.set((before, before));
    work();
    BYTES.get().1 - before
}

/// Biases with random walk and decay, estimated lever arm and latency, signals, gates, losses, stages.
const DESIGN: &str = r#"
[filter]
backend = "BACKEND"

[process]
type = "strapdown"
source = "imu"
integrator = "INTEGRATOR"
gyro.noise = "0.2 deg/sqrt(h)"
accelerometer.noise = ["70 ug/sqrt(Hz)", "70 ug/sqrt(Hz)", "90 ug/sqrt(Hz)"]
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "0.01 deg/s", random_walk = "1e-6 rad/s/sqrt(s)" }
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg", correlation_time = "300 s" }

[sensor.position]
type = "gnss_position"
source = "gnss"
lever_arm = { estimate = true, initial = [0.4, -0.2, -1.1], sigma = "0.2 m" }
time_offset = { estimate = true, initial = "0.1 s", sigma = "30 ms" }
noise = { sigma = ["1.5 m", "1.5 m", "2.5 m"] }
gate = { type = "nis", probability = 0.999 }

[sensor.velocity]
type = "gnss_velocity"
source = "gnss"
lever_arm = { shared = "position.lever_arm" }
only_with = "position"
time_offset = { estimate = true, initial = "50 ms", sigma = "10 ms" }
noise = { sigma = "0.1 m/s" }
loss = { type = "huber", k = 1.5 }

[sensor.wheels]
type = "nonholonomic"
source = "clock"
noise = { sigma = ["5 m/s", "5 m/s"] }

[stage.clock]
type = "periodic"
source = "imu"
rate = "2 Hz"

[stage.standing]
type = "stationarity"
source = "imu"
rate = "1 Hz"
still = { window = "0.5 s", accel_std = "0.2 m/s^2", gyro_std = "0.01 rad/s" }

[sensor.standing]
type = "zero_velocity"
source = "standing"
noise = { sigma = "0.1 m/s" }

[initial.start]
type = "explicit"
position = { latitude = "47 deg", longitude = "8 deg", height = "400 m" }
position_sigma = "3 m"
velocity = [0, 0, 0]
velocity_sigma = "0.5 m/s"
attitude = [0, 0, 0]
attitude_sigma = "1 deg"
"#;

fn navigator(backend: &str, integrator: &str) -> Navigator {
    Navigator::from_toml(&DESIGN.replace("BACKEND", backend).replace("INTEGRATOR", integrator)).unwrap()
}

/// At rest and level, shaken a little.
fn imu(k: i64) -> [f64; 6] {
    let t = k as f64 * 0.01;
    [2e-3 * t.sin(), 1e-3 * t.cos(), 0.0, 0.03 * (2.0 * t).sin(), 0.02 * t.cos(), -9.808]
}

const GNSS: [f64; 6] = [
    47.0 * core::f64::consts::PI / 180.0,
    8.0 * core::f64::consts::PI / 180.0,
    400.0,
    0.0,
    0.0,
    0.0,
];

#[test]
fn an_allocation_is_counted() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1.0; 3]))), 1);
    assert_eq!(
        allocations(|| {
            std::hint::black_box([1.0; 3]);
        }),
        0
    );
}

#[test]
fn prediction_and_update_allocate_nothing_nor_do_those_of_a_copy() {
    let of_form = |form| Backend {
        form,
        ..Backend::ERROR_STATE
    };
    let two_frames = Backend {
        chart: ChartKind::Invariant(Side::Left, Biases::TwoFrames),
        reset: Reset::Full,
        ..Backend::ERROR_STATE
    };
    let invariant_iterated = Backend {
        chart: Backend::INVARIANT.chart,
        ..Backend::IEKF
    };
    let unscented_factored = Backend {
        form: FormKind::SquareRoot,
        ..Backend::UKF
    };
    for (preset, backend) in [
        ("error_state", Backend::ERROR_STATE),
        ("ekf", Backend::EKF),
        ("error_state", of_form(FormKind::Standard)),
        ("error_state", of_form(FormKind::Udu)),
        ("error_state", of_form(FormKind::SquareRoot)),
        ("error_state", Backend::IEKF),
        ("error_state", Backend::INVARIANT),
        ("error_state", Backend::UKF),
        ("error_state", unscented_factored),
        ("error_state", invariant_iterated),
        ("error_state", two_frames),
    ] {
        let mut nav = navigator(preset, "one_sample");
        // Rows are held back for the receiver's latency, up to its upper limit.
        (0..100).for_each(|k| nav.feed("imu", k as f64 * 0.01, &imu(k)).unwrap());
        let belief = nav.belief().unwrap().clone();
        let assembly = nav.assembly();
        let mut filter = Filter::new(assembly.layout.clone(), assembly.process.clone(), backend, Size::same(3));
        filter.set_belief(belief);
        // The position, and the velocity, whose Jacobian goes through signals.
        let observe = |filter: &mut Filter| {
            for (sensor, value) in assembly.sensors.iter().zip([&GNSS[..3], &GNSS[3..]]) {
                let noise = [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 5.0];
                let update = filter.update(
                    &Observed {
                        sensor: 0,
                        model: sensor.model.as_ref(),
                        value,
                        noise: &noise,
                        quality: None,
                        derivative_input: None,
                        lateness: None,
                    },
                    &mut Open,
                    &[],
                    &Quadratic,
                );
                assert_eq!(update.verdict, Verdict::Accepted);
            }
        };
        let run = |filter: &mut Filter, steps: core::ops::Range<i64>| {
            for k in steps {
                // With the previous sample and its interval, as the process's preparation makes them.
                let mut sample = [0.01; 13];
                sample[..6].copy_from_slice(&imu(k));
                sample[6..12].copy_from_slice(&imu(k - 1));
                let input = Input {
                    sample: &sample,
                    interval: 0.01,
                };
                filter.predict(Time::from_nanos(k * 10_000_000), &input).unwrap();
                if k % 20 == 0 {
                    observe(filter);
                }
            }
        };
        run(&mut filter, 50..200);
        assert_eq!(allocations(|| run(&mut filter, 200..1000)), 0, "{backend:?}");
        // A copy has the learnt patterns of its original, such as which blocks are coupled. It allocates nothing from
        // its first step on, and its result is that of the original.
        let mut copy = filter.clone();
        assert_eq!(allocations(|| run(&mut copy, 1000..1100)), 0, "{backend:?}, a copy");
        run(&mut filter, 1000..1100);
        assert_eq!(copy.belief().x, filter.belief().x);
        assert_eq!(copy.belief().covariance, filter.belief().covariance);
    }
}

#[test]
fn a_bank_of_hypotheses_allocates_nothing() {
    let mut nav = navigator("error_state", "one_sample");
    (0..100).for_each(|k| nav.feed("imu", k as f64 * 0.01, &imu(k)).unwrap());
    let belief = nav.belief().unwrap().clone();
    let assembly = nav.assembly();
    let tracks = FalseTracks {
        rate: 0.01,
        ends: 0.2,
        reach: 1000.0,
        speed: 1.0,
        wander: 0.1,
        lost: 1e-9,
    };
    let member = || -> (Box<dyn Estimator>, Vec<Box<dyn Gate>>) {
        let filter = Filter::new(
            assembly.layout.clone(),
            assembly.process.clone(),
            Backend::ERROR_STATE,
            Size::same(3),
        );
        // A gate that leaves the decision open, and a gate that decides.
        let gates: [Box<dyn Gate>; 2] = [
            Box::new(Hypotheses::new(tracks, 0.999, Recovery::default())),
            Box::new(Nis::new(0.999, Recovery::default())),
        ];
        (Box::new(filter), gates.into())
    };
    // More than twenty hypotheses: a stable sort of that number takes memory.
    let limits = BankLimits {
        most: 30,
        ..BankLimits::DEFAULT
    };
    let mut bank = Bank::new(limits, member);
    bank.set_belief(belief);
    let mut most = 0;
    let mut run = |bank: &mut Bank, steps: core::ops::Range<i64>| {
        for k in steps {
            let mut sample = [0.01; 13];
            sample[..6].copy_from_slice(&imu(k));
            sample[6..12].copy_from_slice(&imu(k - 1));
            let input = Input {
                sample: &sample,
                interval: 0.01,
            };
            bank.predict(Time::from_nanos(k * 10_000_000), &input).unwrap();
            if k % 20 != 0 {
                continue;
            }
            // Every second fix is 5 to 7 σ too high: neither clearly good nor clearly false.
            let mut fix = GNSS;
            fix[2] += if k % 40 == 0 { 12.0 + (k % 7) as f64 } else { 0.0 };
            for (number, value) in [&fix[..3], &fix[3..]].into_iter().enumerate() {
                let observed = Observed {
                    sensor: number,
                    model: assembly.sensors[number].model.as_ref(),
                    value,
                    noise: &[2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 5.0],
                    quality: None,
                    derivative_input: None,
                    lateness: None,
                };
                bank.update(&observed, &mut Open, &[], &Quadratic);
                most = most.max(bank.count());
            }
        }
    };
    run(&mut bank, 100..2000);
    assert_eq!(allocations(|| run(&mut bank, 2000..3000)), 0);
    assert!(most > 20, "{most}");
}

#[test]
fn reflections_of_large_arrays_allocate_nothing() {
    let n = 40;
    let mut builder = LayoutBuilder::new();
    let state = builder
        .declare::<Vector<40>>(Declaration {
            name: "x".to_owned(),
            owner: String::new(),
            unit: "",
            initial: [0.0; 40].into(),
            sigma: vec![1.0; n],
            dynamics: Dynamics::Constant,
            role: StateRole::Kinematic,
        })
        .unwrap();
    let mut transition = Transition::new(&builder.finish());
    let coupled = nalgebra::SMatrix::<f64, 40, 40>::from_fn(|i, j| if i == j { 0.9 } else { 1e-3 * (i + 2 * j) as f64 });
    transition.set(state, state, &coupled);
    transition.noise(state, state, &nalgebra::SMatrix::<f64, 40, 40>::identity());
    let form = SquareRoot { faer_from: 0 };
    let (mut p, mut work) = (vec![0.0; form.storage(n)], Workspace::new(&form, n, 1));
    let mut predict = || assert!(form.predict(n, &mut p, &transition, &mut work));
    predict();
    assert_eq!(allocations(|| (0..5).for_each(|_| predict())), 0);
}

#[test]
fn the_runner_allocates_nothing_in_steady_state() {
    for integrator in ["one_sample", "two_sample"] {
        let mut nav = navigator("error_state", integrator);
        let (imu_stream, gnss_stream) = (nav.stream("imu").unwrap(), nav.stream("gnss").unwrap());
        let (mut predicted, mut offered, mut rejected) = (0, [0; 4], [0; 4]);
        let mut run = |steps: core::ops::Range<i64>| {
            (predicted, offered, rejected) = (0, [0; 4], [0; 4]);
            let mut observer = |event: &Event<'_>| match event {
                Event::Estimate { .. } => predicted += 1,
                Event::Updated { sensor, update, .. } => {
                    offered[*sensor] += 1;
                    rejected[*sensor] += usize::from(update.verdict == Verdict::Rejected);
                }
                _ => {}
            };
            for k in steps {
                let time = Time::from_nanos(k * 10_000_000);
                nav.feed_stream(imu_stream, time, &imu(k), &mut observer).unwrap();
                if k % 20 == 0 {
                    // The stamp is between two samples, and splits the second sample.
                    // One in ten is a kilometre too high.
                    let mut fix = GNSS;
                    fix[2] += if k % 200 == 0 { 1000.0 } else { 0.0 };
                    nav.feed_stream(gnss_stream, time.shifted(3_000_000), &fix, &mut observer).unwrap();
                }
            }
        };
        run(0..1000);
        assert_eq!(allocations(|| run(1000..3000)), 0, "{integrator}");
        // The count includes real work: inputs at 100 Hz, two sensors at 5 Hz, two stages at 2 Hz and 1 Hz.
        assert_eq!(predicted, 2000);
        assert_eq!(offered, [100, 100, 40, 20]);
        // The velocity is always right, but it is rejected together with the position.
        assert_eq!(rejected, [10, 10, 0, 0]);
        let mut bytes = Vec::with_capacity(1 << 16);
        let saved = allocations(|| fusion::core::memory::save(&mut nav, &mut bytes));
        assert!(saved == 0 && bytes.len() > 2000, "{saved} for {} bytes", bytes.len());
    }
}

#[test]
fn going_back_for_late_rows_allocates_nothing_in_steady_state() {
    let text = DESIGN.replace("BACKEND", "error_state").replace("INTEGRATOR", "one_sample");
    let rewinding = "run.order = \"rewind\"\nrun.rewind.horizon = \"3 s\"\n";
    let mut nav = Navigator::from_toml(&format!("{rewinding}{text}")).unwrap_or_else(|d| panic!("{d}"));
    let (imu_stream, gnss_stream) = (nav.stream("imu").unwrap(), nav.stream("gnss").unwrap());
    let mut current = 0;
    let mut run = |steps: core::ops::Range<i64>| {
        current = 0;
        let mut observer = |event: &Event<'_>| current += usize::from(matches!(event, Event::Current { .. }));
        for k in steps {
            let time = Time::from_nanos(k * 10_000_000);
            nav.feed_stream(imu_stream, time, &imu(k), &mut observer).unwrap();
            if k % 20 == 0 && k > 200 {
                // Two seconds late.
                nav.feed_stream(gnss_stream, time.shifted(-1_997_000_000), &GNSS, &mut observer)
                    .unwrap();
            }
        }
    };
    run(0..2000);
    assert_eq!(allocations(|| run(2000..4000)), 0);
    assert_eq!(current, 2000);
    let rewinds = nav.assembly().runner.rewinds().unwrap();
    assert!(rewinds.count >= 180 && rewinds.most >= 200, "{rewinds:?}");
}

/// Receives steps and estimates.
struct Steps<F>(F);

impl<F: FnMut(&Event<'_>)> Observer for Steps<F> {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        (self.0)(event);
        Ok(())
    }
    fn wants_steps(&self) -> bool {
        true
    }
}

/// Smooths a run with this number of samples, up to its end, with steps stored on these shelves. Returns the peak
/// bytes.
fn smoothed(samples: i64, shelf: &mut dyn FnMut(&str) -> Box<dyn Shelf>) -> i64 {
    let mut nav = navigator("error_state", "one_sample");
    let (imu_stream, gnss_stream) = (nav.stream("imu").unwrap(), nav.stream("gnss").unwrap());
    let layout = nav.assembly().layout.clone();
    let tapes = ["steps", "smoothed"].map(|name| Tape::new(shelf(name)));
    peak(|| {
        let [steps, turned] = tapes;
        let mut smoother = FixedInterval::new(layout, &Backend::ERROR_STATE.into(), steps);
        let mut observer = Steps(|event: &Event<'_>| match event {
            Event::Step(step) => Link::of(step).iter().for_each(|link| smoother.step(link).unwrap()),
            Event::Estimate { belief } => smoother.estimate(belief).unwrap(),
            _ => {}
        });
        for k in 0..samples {
            let time = Time::from_nanos(k * 10_000_000);
            nav.feed_stream(imu_stream, time, &imu(k), &mut observer).unwrap();
            if k % 100 == 0 {
                nav.feed_stream(gnss_stream, time, &GNSS, &mut observer).unwrap();
            }
        }
        let mut found = smoother.smooth(turned).unwrap();
        let mut last = Time::MIN;
        while let Some(belief) = found.read().unwrap() {
            assert!(belief.time > last);
            last = belief.time;
        }
        // The filter still holds rows back for the receiver's latency, up to its upper limit.
        assert!(last.seconds() > samples as f64 * 0.01 - 1.0, "{last}");
    })
}

#[test]
fn smoothing_on_disk_takes_as_much_memory_for_a_log_ten_times_as_long() {
    let folder = std::env::temp_dir().join(format!("fusion-smoothing-{}", std::process::id()));
    let set = FileSet::begin(&folder).unwrap();
    let on_disk = |samples| smoothed(samples, &mut |name| Box::new(set.spill(name).unwrap()));
    let (short, long) = (on_disk(2_000), on_disk(20_000));
    // Buffers have the length of the longest record and block. One page of slack.
    assert!(long <= short + 4096, "{short} {long}");
    let in_memory = |samples| smoothed(samples, &mut |_| Box::new(Vec::new()));
    assert!(in_memory(20_000) > 5 * in_memory(2_000));
    drop(set);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Laps of 40 s, with a hundred estimates, fixes and reference epochs per second.
const LAPS: &str = r#"
[run]
origin = { latitude = "48.8 deg", longitude = "2.3 deg" }
seed = 1

[process]
type = "planar_odometry"
source = "odometry"
forward_noise = "0.001 m/sqrt(s)"
sideways_noise = "0.001 m/sqrt(s)"
yaw_rate_noise = "0.1 deg/sqrt(s)"

[sensor.gnss]
type = "gnss_position"
source = "gnss"
horizontal = true
noise = { sigma = "1 m" }
gate = { type = "nis", probability = 0.999 }

[initial.start]
type = "explicit"
position_sigma = 0
heading = 0
heading_sigma = "5 deg"

[reference]
source = "reference"
episodes = [{ from = "10 s", to = "20 s" }]

[simulation]
draw_start = true
reference_rate = "100 Hz"
start = { speed = 0.7853981633974483 }
trajectory = [{ type = "circle", angle = "ANGLE deg", duration = "DURATION s" }]

[simulation.odometry]
rate = "100 Hz"
forward_noise = "0.001 m/sqrt(s)"
sideways_noise = "0.001 m/sqrt(s)"
yaw_rate_noise = "0.1 deg/sqrt(s)"

[simulation.sensor.gnss]
rate = "100 Hz"
white = "1 m"
"#;

/// The peak bytes of a run with this number of laps, including its score and its report.
fn memory_of(laps: u32) -> i64 {
    let [angle, duration] = [360 * laps, 40 * laps].map(|number| number.to_string());
    let text = LAPS.replace("ANGLE", &angle).replace("DURATION", &duration);
    let design = Design::read(Document::parse("laps.toml", &text).0).unwrap_or_else(|d| panic!("{d}"));
    peak(|| {
        let options = Options::default();
        let run = Run::open(&design, &options).unwrap_or_else(|d| panic!("{d}"));
        let mut recording = Recording::of(&design, run.assembly());
        let finished = run.go(&mut [&mut recording], &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(finished.summary.counts().epochs, u64::from(4000 * laps));
        let epochs = finished.summary.score().map(|score| score.epochs);
        assert!(epochs.is_some_and(|epochs| epochs > 3999 * laps as usize));
    })
}

#[test]
fn a_run_needs_no_more_memory_for_four_times_the_log() {
    // 264,000 epochs: a series keeps 2^18 values before it is summarised. Factor four: a thinned series has the same
    // number of rows after each further power of two.
    let [short, long] = [66, 264].map(memory_of);
    // One hundredth: histogram bins that are used for the first time. A byte for each epoch would be more.
    let allowed = short / 100;
    assert!(allowed < 198 * 4000, "{short} bytes are too many to see a byte for each epoch");
    assert!(long < short + allowed, "{short} and {long} bytes");
}
