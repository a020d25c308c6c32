//! The law of memories: a filter or a runner that gets the memory of another, after part of a run, continues bit for
//! bit like the original.

use super::{Bench, build, state, steady};
use crate::block::SensorSpec;
use crate::registry::{self, Role};
use fusion_core::belief::Belief;
use fusion_core::filter::{Backend, Estimator, Filter, Observed, Verdict};
use fusion_core::gate::{Gate, Nis, Recovery};
use fusion_core::loss::Quadratic;
use fusion_core::memory::{Memory, Tape};
use fusion_core::model::{Input, Measurement, Process, SignalBuffer, Size};
use fusion_core::runner::{Event, Noise, Port, Row, Runner, Sensor};
use fusion_core::state::Layout;
use fusion_core::testing::{Lcg, check_memory};
use fusion_core::time::Time;
use std::sync::Arc;

/// Samples of a drive, 100 per second. The memory is copied after half of them, an odd number, so that a preparation
/// that works in pairs holds a sample back.
const SAMPLES: i64 = 202;
/// Samples between two measurements.
const EVERY: i64 = 5;
/// Nanoseconds between two samples.
const STEP: i64 = 10_000_000;

/// A random drive of one process with the sensors that it takes.
struct Drive {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    sensors: Vec<Arc<dyn Measurement>>,
    start: Belief,
    samples: Vec<Vec<f64>>,
}

impl Drive {
    fn new(mut bench: Bench, backend: Backend) -> Result<Self, String> {
        let mut sensors: Vec<Arc<dyn Measurement>> = Vec::new();
        for r in registry::all().into_iter().filter(|r| r.role == Role::Sensor) {
            let spec: Box<dyn SensorSpec> = r.spec()?;
            // Sensors that do not suit the process are left out: the law of sensors checks which suit it.
            sensors.extend(spec.build(&mut build(r.name, &mut bench.layout)).ok().map(Arc::from));
        }
        let mut random = Lcg::new(21);
        let samples = (0..SAMPLES).map(|_| bench.sample(&mut random)).collect::<Result<_, _>>()?;
        let process = bench.process.clone();
        let layout = Arc::new(bench.layout.finish());
        let mut start = Belief::initial(&layout, &backend.form.form(), Time::default());
        start.x = state(&layout, &mut random);
        for block in layout.blocks() {
            let sigma: Vec<f64> = block.sigma.iter().map(|s| if *s > 0.0 { *s } else { 0.1 }).collect();
            start.covariance.set_sigmas(block, &sigma);
        }
        Ok(Self {
            layout,
            process,
            sensors,
            start,
            samples,
        })
    }

    fn filter(&self, backend: Backend) -> Filter {
        let size = |of: fn(Size) -> usize| self.sensors.iter().map(|s| of(s.size())).max().unwrap_or(1);
        let largest = Size {
            value: size(|s| s.value),
            residual: size(|s| s.residual),
        };
        let mut filter = Filter::new(self.layout.clone(), self.process.clone(), backend, largest);
        filter.set_belief(self.start.clone());
        filter
    }

    /// A runner with the process's input on stream 0 and each sensor on a separate stream.
    fn runner(&self, backend: Backend) -> Runner {
        let mut runner = Runner::new(Box::new(self.filter(backend)), self.process.clone(), 0.0);
        let port = |stream, width| Port {
            stream,
            columns: (0..width).collect(),
            delay: 0,
        };
        let width = self.process.input_dim();
        let input = runner.add_stream("input", width);
        if width > 0 {
            runner.set_input(port(input, width));
        }
        for (s, model) in self.sensors.iter().enumerate() {
            let name = format!("sensor {s}");
            let width = model.size().value;
            let stream = runner.add_stream(&name, width);
            runner.add_sensor(Sensor {
                name,
                model: model.clone(),
                port: port(stream, width),
                offset: None,
                constant: Vec::new(),
                noise: noise(model.as_ref()),
                quality: None,
                gate: gate(),
                loss: Arc::new(Quadratic),
                switch: None,
            });
        }
        runner
    }

    /// A measurement of sensor `s` at the estimate `belief`, with an error up to a tenth of its residual's unit,
    /// sometimes a hundred times as large. `None` if its model has no value.
    fn measured(&self, s: usize, belief: &Belief, sample: &[f64], random: &mut Lcg) -> Option<Vec<f64>> {
        let model = &self.sensors[s];
        let mut signals = SignalBuffer::new(&self.layout);
        let sample = steady(self.process.as_ref(), sample);
        signals.evaluate(self.process.as_ref(), &belief.x, &Input::held(&sample), false);
        let mut z = vec![0.0; model.size().value];
        model.predict(&signals.view(&belief.x), &mut z).ok()?;
        let size = if random.unit() < 0.1 { 10.0 } else { 0.1 };
        let error: Vec<f64> = (0..model.size().residual).map(|_| size * random.signed()).collect();
        model.perturb(&mut z, &error);
        Some(z)
    }
}

/// R of every measurement, row by row: 1σ of 0.3.
fn noise(model: &dyn Measurement) -> Noise {
    Noise::diagonal(&vec![0.3; model.size().residual])
}

/// A gate with a memory, which rejects some of the drive.
fn gate() -> Box<dyn Gate> {
    Box::new(Nis::new(0.99, Recovery::default()))
}

/// The input at one instant: a sample, and for each sensor a value or `None`.
struct Instant<'a> {
    time: Time,
    sample: &'a [f64],
    measured: &'a [Option<Vec<f64>>],
}

/// The law for one process: with the filter alone, and with the runner and the preparation of samples.
pub(super) fn check(bench: impl Fn() -> Result<Bench, String>) -> Result<(), String> {
    for backend in [Backend::ERROR_STATE, Backend::EKF] {
        let drive = Drive::new(bench()?, backend)?;
        let gates = || drive.sensors.iter().map(|_| gate()).collect();
        let filter = || Gated(drive.filter(backend), gates());
        halves(&drive, filter, |Gated(filter, _)| filter.belief(), filtered).map_err(|e| format!("its filter: {e}"))?;
        halves(&drive, || drive.runner(backend), Runner::belief, fed).map_err(|e| format!("its runner: {e}"))?;
    }
    Ok(())
}

/// A filter with a gate per sensor.
struct Gated(Filter, Vec<Box<dyn Gate>>);

impl Memory for Gated {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
        self.1.as_mut_slice().remember(tape);
    }
}

/// Runs the drive through an object from `made` by `step`, which returns the number of accepted measurements. A second
/// object gets the memory of the first half-way. From there to the end, both must have the same belief, bit for bit.
fn halves<T: Memory>(
    drive: &Drive,
    made: impl Fn() -> T,
    belief: impl Fn(&T) -> &Belief,
    step: impl Fn(&Drive, &mut T, &Instant<'_>) -> Result<usize, String>,
) -> Result<(), String> {
    let (mut original, mut twin) = (made(), made());
    let (mut random, mut accepted) = (Lcg::new(22), 0);
    for (k, sample) in (0..).zip(&drive.samples) {
        if k == SAMPLES / 2 {
            check_memory(&mut original, &mut twin)?;
        }
        let mut measured = vec![None; drive.sensors.len()];
        if k % EVERY == 0 {
            let values = (0..measured.len()).map(|s| drive.measured(s, belief(&original), sample, &mut random));
            measured = values.collect();
        }
        let instant = Instant {
            time: Time::from_nanos(k * STEP),
            sample,
            measured: &measured,
        };
        let before = accepted;
        accepted += step(drive, &mut original, &instant)?;
        if k < SAMPLES / 2 {
            continue;
        }
        let of_the_twin = step(drive, &mut twin, &instant)?;
        if of_the_twin != accepted - before || bits(belief(&twin)) != bits(belief(&original)) {
            return Err(format!("one with the memory of another differs {} samples later", k - SAMPLES / 2));
        }
    }
    match accepted {
        0 if !drive.sensors.is_empty() => Err("none of its sensors is accepted on the way".to_owned()),
        _ => Ok(()),
    }
}

/// State and covariance.
fn bits(belief: &Belief) -> Vec<u64> {
    let covariance = belief.covariance.to_dense();
    belief.x.iter().chain(&covariance).map(|v| v.to_bits()).collect()
}

fn filtered(drive: &Drive, Gated(filter, gates): &mut Gated, at: &Instant<'_>) -> Result<usize, String> {
    let input = Input {
        sample: &steady(drive.process.as_ref(), at.sample),
        interval: 1e-9 * STEP as f64,
    };
    filter.predict(at.time, &input).map_err(|e| e.to_string())?;
    let mut accepted = 0;
    for ((model, gate), value) in drive.sensors.iter().zip(gates).zip(at.measured) {
        let Some(value) = value else { continue };
        let observed = Observed {
            sensor: 0,
            model: model.as_ref(),
            value,
            noise: &noise(model.as_ref()).covariance,
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        let update = filter.update(&observed, gate.as_mut(), &[], &Quadratic);
        accepted += usize::from(update.verdict == Verdict::Accepted);
    }
    Ok(accepted)
}

fn fed(drive: &Drive, runner: &mut Runner, at: &Instant<'_>) -> Result<usize, String> {
    let mut accepted = 0;
    let mut observer = |event: &Event<'_>| {
        if let Event::Updated { update, .. } = event {
            accepted += usize::from(update.verdict == Verdict::Accepted);
        }
    };
    let mut feed = |row: Row<'_>| runner.feed(&row, &mut observer).map_err(|e| e.to_string());
    if drive.process.input_dim() > 0 {
        feed(Row::new(0, at.time, at.sample))?;
    }
    // Inside the interval of the next sample, which they split.
    let between = at.time.shifted(STEP / 3);
    for (stream, value) in (1..).zip(at.measured) {
        if let Some(value) = value {
            feed(Row::new(stream, between, value))?;
        }
    }
    Ok(accepted)
}
