//! The cost of filter parts that do nothing.
//!
//! `gate`      an update through a gate that accepts everything, less one without a gate
//! `loss`      an update with a loss that leaves every weight at one, less one without a loss
//! `param`     an update by a sensor whose parameters are all fixed, less the same h without parameters
//! `event`     an epoch's events, delivered to an observer that ignores them
//! `snapshot`  a prediction by a filter that was remembered and restored, less one by a filter that never was
//!
//! Each is a difference of least times in interleaved runs: a nanosecond or two below zero is zero.

use crate::composed::{Composed, PLAIN, fix};
use fusion::Navigator;
use fusion::core::filter::Estimator;
use fusion::core::gate::{Gate, Nis, Open, Recovery};
use fusion::core::geometry::so3::{rotation, times_skew};
use fusion::core::linear::Jacobian;
use fusion::core::loss::{Huber, Loss, Quadratic};
use fusion::core::memory;
use fusion::core::model::{Measurement, Size, Undefined};
use fusion::core::runner::{Event, Halt, Observer};
use fusion::core::state::{Attitude, Geodetic, Layout, Manifold, Slot, View};
use nalgebra::{Matrix3, Vector3};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

const UPDATES: usize = 20;
const STEPS: usize = 100;

/// Prints all of them; `composed` makes a filter in the middle of a run.
pub fn print(composed: impl Fn() -> Composed) {
    let z = fix(500);
    // χ² of nine nines, and a constant that no residual reaches.
    told(
        "gate",
        update(&composed, &z, &mut Nis::new(1.0 - 1e-9, Recovery::default()), &Quadratic),
    );
    told("loss", update(&composed, &z, &mut Open, &Huber::new(1e3)));
    told("param", param(&composed, &z));
    told("event", event());
    told("snapshot", snapshot(&composed));
}

#[expect(clippy::print_stdout, reason = "a benchmark")]
fn told(what: &str, ns: f64) {
    println!("filter/unused/{what}: {ns:.0} ns");
}

/// The time that `run(true)` takes in addition to `run(false)`, divided by `per_run` \[ns\].
fn more(per_run: usize, mut run: impl FnMut(bool)) -> f64 {
    let mut least = [Duration::MAX; 2];
    for k in 0..1000 {
        let clock = Instant::now();
        run(k % 2 == 1);
        least[k % 2] = least[k % 2].min(clock.elapsed());
    }
    let [without, with] = least.map(|d| d.as_nanos() as f64 / per_run as f64);
    with - without
}

fn update(composed: &impl Fn() -> Composed, z: &[f64; 3], gate: &mut dyn Gate, loss: &dyn Loss) -> f64 {
    let (mut with, mut without) = (composed(), composed());
    let run = |c: &mut Composed, gate: &mut dyn Gate, loss: &dyn Loss| {
        c.filter.set_belief(c.start.clone());
        (0..UPDATES).for_each(|_| c.update_through(black_box(z), gate, loss));
        black_box(c.filter.belief());
    };
    more(UPDATES, |has| {
        if has {
            run(&mut with, &mut *gate, loss);
        } else {
            run(&mut without, &mut Open, &Quadratic);
        }
    })
}

/// The sensor of `composed.rs`, for this one lever arm.
#[derive(Debug)]
struct ByHand {
    position: Slot<Geodetic>,
    attitude: Slot<Attitude>,
}

const LEVER_ARM: Vector3<f64> = Vector3::new(0.4, -0.2, -1.1);

impl ByHand {
    fn new(layout: &Layout) -> Self {
        Self {
            position: layout.slot("position").unwrap(),
            attitude: layout.slot("attitude").unwrap(),
        }
    }
}

impl Measurement for ByHand {
    fn size(&self) -> Size {
        Size::same(3)
    }
    fn reads_signals(&self) -> bool {
        false
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let offset = at.state(self.attitude) * LEVER_ARM;
        Geodetic::write(&at.state(self.position).offset(&offset), value);
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.position, &Matrix3::identity());
        h.add_slot(0, self.attitude, &-times_skew(&rotation(&at.state(self.attitude)), &LEVER_ARM));
        Ok(())
    }
    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        let d = Geodetic::read(z).difference(&Geodetic::read(predicted));
        r.copy_from_slice(d.as_slice());
    }
}

fn param(composed: &impl Fn() -> Composed, z: &[f64; 3]) -> f64 {
    let (mut with, mut without) = (composed(), composed());
    without.gnss = Arc::new(ByHand::new(without.filter.layout()));
    let run = |c: &mut Composed| {
        c.filter.set_belief(c.start.clone());
        (0..UPDATES).for_each(|_| c.update(black_box(z)));
        c.filter.belief().x.clone()
    };
    assert_eq!(run(&mut with), run(&mut without));
    more(UPDATES, |has| {
        black_box(run(if has { &mut with } else { &mut without }));
    })
}

/// An observer that ignores all events.
struct Deaf;

impl Observer for Deaf {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        black_box(event);
        Ok(())
    }
}

/// Counts events, and measures how long the same number of calls of `Deaf` takes.
#[derive(Default)]
struct Counting {
    events: usize,
    least: f64,
}

impl Observer for Counting {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        let (calls, mut deaf) = (1000, Deaf);
        let observer: &mut dyn Observer = black_box(&mut deaf);
        let clock = Instant::now();
        (0..calls).for_each(|_| observer.on(black_box(event)).unwrap());
        let ns = clock.elapsed().as_nanos() as f64 / f64::from(calls);
        self.least = if self.events == 0 { ns } else { self.least.min(ns) };
        self.events += 1;
        Ok(())
    }
}

fn event() -> f64 {
    let mut nav = Navigator::from_toml(&Composed::design(PLAIN)).unwrap();
    let (imu, mut counting) = (nav.stream("imu").unwrap(), Counting::default());
    for k in 0..=STEPS {
        let time = fusion::core::time::Time::from_nanos(k as i64 * 10_000_000);
        nav.feed_stream(imu, time, &crate::composed::sample(k), &mut counting).unwrap();
    }
    assert!(counting.events >= STEPS);
    counting.least * counting.events as f64 / STEPS as f64
}

fn snapshot(composed: &impl Fn() -> Composed) -> f64 {
    let (mut with, mut without) = (composed(), composed());
    let mut bytes = Vec::new();
    memory::save(&mut with.filter, &mut bytes);
    memory::restore(&mut with.filter, &bytes).unwrap();
    more(STEPS, |has| {
        let c = if has { &mut with } else { &mut without };
        c.filter.set_belief(c.start.clone());
        (501..501 + STEPS).for_each(|k| c.predict(k));
        black_box(c.filter.belief());
    })
}
