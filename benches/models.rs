//! The cost of the equations of every registered block, compared with central differences of the same equations.
//!
//! `model/process/…`  one step of 10 ms with Φ and Q; `differences` moves as many states as there are axes
//! `model/sensor/…`   h and H, with the signals of the process and the derivatives that H needs. The process is
//!                    strapdown, or the first that accepts the sensor; `differences` predicts at both sides of
//!                    every axis
//!
//! Each block is built from its own example. A block that is registered later gets its line automatically.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "measure/mod.rs"]
mod measure;

use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::linear::{Jacobian, Transition};
use fusion::core::model::{Input, Prepared, Process, SignalBuffer, Size};
use fusion::core::state::{Layout, LayoutBuilder};
use fusion::models::block::{Build, ProcessSpec, SensorSpec};
use fusion::models::earth::Gravity;
use fusion::models::registry::{self, Registration, Role};
use measure::compare;
use serde::de::DeserializeOwned;
use std::hint::black_box;

/// Evaluations of one run.
const TIMES: usize = 100;
/// The step of a difference. It does not affect the time.
const STEP: f64 = 1e-3;
const DT: f64 = 0.01;

const ORIGIN: Geodetic = Geodetic {
    lat: 0.63003,
    lon: 2.25933,
    height: -10.0,
};

/// The spec of a block's example: `{ type: table }`, as typetag reads it.
fn spec<T: DeserializeOwned>(r: &Registration) -> T {
    let table: toml::Table = toml::from_str(r.example).expect("an example is TOML");
    let tagged = toml::Table::from_iter([(r.name.to_owned(), toml::Value::Table(table))]);
    tagged.try_into().expect("an example is its spec")
}

fn build<'a>(name: &'a str, layout: &'a mut LayoutBuilder) -> Build<'a> {
    Build {
        name,
        layout,
        origin: Some(ORIGIN),
        gravity: Gravity::default(),
    }
}

/// A process with its input, and perhaps a sensor.
struct Bench {
    process: Box<dyn Process>,
    sample: Vec<f64>,
    layout: Layout,
    x: Vec<f64>,
}

impl Bench {
    fn input(&self) -> Input<'_> {
        Input {
            sample: &self.sample,
            interval: DT,
        }
    }
}

fn processes() -> Vec<&'static Registration> {
    let mut all: Vec<_> = registry::all().into_iter().filter(|r| r.role == Role::Process).collect();
    all.sort_by_key(|r| (r.name != "strapdown", r.name));
    all
}

/// The process of an example, and what `further` builds into its layout; `None` if `further` refuses it.
fn bench<T>(r: &Registration, further: impl FnOnce(&mut LayoutBuilder) -> Option<T>) -> Option<(Bench, T)> {
    let spec: Box<dyn ProcessSpec> = spec(r);
    let mut layout = LayoutBuilder::new();
    let process = spec.build(&mut build("process", &mut layout)).expect("an example builds");
    let further = further(&mut layout)?;
    let layout = layout.finish();
    // Small and none of them another: rates, forces, speeds.
    let raw: Vec<f64> = (0..process.input_dim()).map(|k| 0.3 + 0.1 * k as f64).collect();
    let sample = process.preparation().map_or_else(
        || raw.clone(),
        |mut preparation| {
            let mut out = Prepared::default();
            [0.0, DT, DT].iter().for_each(|dt| preparation.take(*dt, &raw, &mut out));
            preparation.finish(&mut out);
            out.samples().last().expect("an interval was given").to_vec()
        },
    );
    let mut x = layout.initial().to_vec();
    let delta: Vec<f64> = (0..layout.dim()).map(|k| 0.1 + 0.01 * k as f64).collect();
    layout.plus(&mut x, &delta);
    let bench = Bench {
        process,
        sample,
        layout,
        x,
    };
    Some((bench, further))
}

fn process(r: &Registration) {
    let (own, ()) = bench(r, |_| Some(())).expect("nothing was refused");
    let n = own.layout.dim();
    let (mut x, mut moved) = (own.x.clone(), own.x.clone());
    let (mut transition, mut delta) = (Transition::new(&own.layout), vec![0.0; n]);
    let mut step = || {
        for _ in 0..TIMES {
            x.copy_from_slice(&own.x);
            transition.reset();
            own.process.step(black_box(&mut x), &own.input(), DT, &mut transition);
        }
        black_box((&x, &transition));
    };
    let mut differences = || {
        for _ in 0..TIMES {
            for (axis, sign) in (0..n).flat_map(|axis| [(axis, STEP), (axis, -STEP)]) {
                moved.copy_from_slice(&own.x);
                delta[axis] = sign;
                own.layout.plus(&mut moved, &delta);
                delta[axis] = 0.0;
                own.process.propagate(black_box(&mut moved), &own.input(), DT);
            }
        }
        black_box(&moved);
    };
    let works: [measure::Work<'_>; 2] = [("composed", &mut step), ("differences", &mut differences)];
    compare(&format!("model/process/{}", r.name), TIMES, works);
}

fn sensor(r: &Registration) {
    let spec: Box<dyn SensorSpec> = spec(r);
    let built = |p| bench(p, |layout| spec.build(&mut build(r.name, layout)).ok());
    let (own, model) = processes().into_iter().find_map(built).expect("a process takes it");
    let (n, Size { value, residual }) = (own.layout.dim(), model.size());
    let mut h = Jacobian::new(&own.layout, residual);
    let (mut z, mut moved, mut delta) = (vec![0.0; value], own.x.clone(), vec![0.0; n]);
    let mut signals = [SignalBuffer::new(&own.layout), SignalBuffer::new(&own.layout)];
    let predict = |signals: &mut SignalBuffer, x: &[f64], z: &mut [f64]| {
        signals.evaluate(own.process.as_ref(), black_box(x), &own.input(), false);
        model
            .predict(&signals.view(x).with_given(model.given()), z)
            .expect("it has a value here");
    };
    let (of_h, of_differences) = signals.split_at_mut(1);
    let mut other = z.clone();
    let mut both = || {
        for _ in 0..TIMES {
            let signals = &mut of_h[0];
            predict(signals, &own.x, &mut z);
            h.reset(residual);
            model
                .jacobian(&signals.view(&own.x).with_given(model.given()), &mut h)
                .expect("it has a derivative here");
            if h.needs_signals() {
                signals.evaluate(own.process.as_ref(), &own.x, &own.input(), true);
            }
        }
        black_box((&z, &h));
    };
    let mut differences = || {
        for _ in 0..TIMES {
            for (axis, sign) in (0..n).flat_map(|axis| [(axis, STEP), (axis, -STEP)]) {
                moved.copy_from_slice(&own.x);
                delta[axis] = sign;
                own.layout.plus(&mut moved, &delta);
                delta[axis] = 0.0;
                predict(&mut of_differences[0], &moved, &mut other);
            }
        }
        black_box(&other);
    };
    let works: [measure::Work<'_>; 2] = [("composed", &mut both), ("differences", &mut differences)];
    compare(&format!("model/sensor/{}", r.name), TIMES, works);
}

fn main() {
    fusion::models::link();
    processes().into_iter().for_each(process);
    registry::all().into_iter().filter(|r| r.role == Role::Sensor).for_each(sensor);
}
