//! The laws of `fusion_core::testing` over registered blocks.
//!
//! Each block is built from its own example. So a block that is registered later, in this crate or in another, is
//! tested too: a test there calls [`check`] for its blocks. An error names block, process, state and element.

#![cfg(feature = "declare")]

mod drive;
mod fault;
mod initialiser;
mod mission;
#[cfg(all(test, feature = "libm"))]
mod platforms;
mod rows;
mod segment;
mod stage;
mod vehicle;

use crate::block::{Build, GateSpec, LossSpec, ProcessSpec, SensorSpec};
use crate::earth::Gravity;
use crate::registry::{self, Registration, Role};
use crate::units::{Dimensional, dim};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Input, Prepared, Process};
use fusion_core::state::{Dynamics, Kind, Layout, LayoutBuilder};
use fusion_core::testing::{Lcg, check_gate, check_loss, check_measurement, check_process};
use std::sync::Arc;

/// The number of states tried per model.
const STATES: u64 = 8;

/// The origin: near the beacon of the range example, in the area of the experiments of the documents.
const ORIGIN: Geodetic = Geodetic {
    lat: 0.63003,
    lon: 2.25933,
    height: -10.0,
};

/// The requirements for a block: its fields are described, its example builds, the laws of its role
/// hold. A sensor is tried on every registered process that takes it.
///
/// # Errors
/// A sentence that names the block and the problem.
pub fn check(r: &Registration) -> Result<(), String> {
    described(r)?;
    match r.role {
        Role::Process => process(r),
        Role::Sensor => sensor(r),
        Role::Gate => gate(r),
        Role::Loss => loss(r),
        Role::Stage => stage::check(r),
        Role::Initialiser => initialiser::check(r),
        Role::Fault => fault::check(r),
        Role::Segment => segment::check(r),
        Role::Vehicle => vehicle::check(r),
        Role::Control => mission::control(r),
        Role::Task => mission::task(r),
        // The crates that read files and open links have the laws of these roles.
        Role::Source | Role::Link | Role::Output => Ok(()),
    }
    .map_err(|e| format!("{} `{}`: {e}", r.role.name(), r.name))
}

/// The block and each of its fields have a description: it is the help for users.
fn described(r: &Registration) -> Result<(), String> {
    let schema = (r.schema)();
    let missing = |what: &str| format!("{} `{}` has no description{what}", r.role.name(), r.name);
    if schema.get("description").is_none() {
        return Err(missing(""));
    }
    let fields = schema.get("properties").and_then(|p| p.as_object());
    match fields.into_iter().flatten().find(|(_, field)| field.get("description").is_none()) {
        Some((field, _)) => Err(missing(&format!(" of its field `{field}`"))),
        None => Ok(()),
    }
}

fn build<'a>(name: &'a str, layout: &'a mut LayoutBuilder) -> Build<'a> {
    Build {
        name,
        layout,
        origin: Some(ORIGIN),
        gravity: Gravity::default(),
    }
}

/// A process built from its example, with the following sensors built into the same layout.
struct Bench {
    layout: LayoutBuilder,
    process: Arc<dyn Process>,
    spec: Box<dyn ProcessSpec>,
}

impl Bench {
    fn new(r: &Registration) -> Result<Self, String> {
        let spec: Box<dyn ProcessSpec> = r.spec()?;
        let mut layout = LayoutBuilder::new();
        let process = spec
            .build(&mut build("process", &mut layout))
            .map_err(|e| format!("its example does not build: {}: {e}", e.field))?;
        Ok(Self {
            layout,
            process: process.into(),
            spec,
        })
    }

    /// An input sample of the size of its channels.
    fn sample(&self, random: &mut Lcg) -> Result<Vec<f64>, String> {
        let mut sample = Vec::new();
        for channel in self.spec.input() {
            let size = match channel.dimension {
                d if d == dim::AngularRate::KIND.dimension => 0.5,
                d if d == dim::Acceleration::KIND.dimension => 12.0,
                _ => 1.0,
            };
            sample.extend((0..channel.width).map(|_| size * random.signed()));
        }
        match (sample.len(), self.process.input_dim()) {
            (channels, numbers) if channels != numbers => {
                Err(format!("its input channels have {channels} numbers, its model takes {numbers}"))
            }
            _ => Ok(sample),
        }
    }
}

/// The declared state, moved at random within the range of each kind of block.
fn state(layout: &Layout, random: &mut Lcg) -> Vec<f64> {
    let (mut x, mut delta) = (layout.initial().to_vec(), vec![0.0; layout.dim()]);
    for b in layout.blocks() {
        for (k, axis) in b.tangent_range().enumerate() {
            let own = b.dynamics == Dynamics::Process;
            delta[axis] = random.signed()
                * match b.kind {
                    Kind::Geodetic | Kind::Position => 100.0,
                    Kind::Velocity => 10.0,
                    // Short of gimbal lock from level.
                    Kind::Attitude if own => 0.7,
                    Kind::Angle => 3.0,
                    Kind::Scalar | Kind::Vector(_) if own => 0.5 + 2.0 * b.sigma[k],
                    _ => 2.0 * b.sigma[k],
                };
        }
    }
    layout.plus(&mut x, &delta);
    x
}

/// `sample` with an identical sample before it: Φ may neglect corrections for the change between samples.
fn steady(process: &dyn Process, sample: &[f64]) -> Vec<f64> {
    let Some(mut preparation) = process.preparation() else {
        return sample.to_vec();
    };
    let mut out = Prepared::default();
    for interval in [0.0, 0.01, 0.01] {
        preparation.take(interval, sample, &mut out);
    }
    preparation.finish(&mut out);
    out.samples().last().unwrap_or_default().to_vec()
}

fn process(r: &Registration) -> Result<(), String> {
    let bench = Bench::new(r)?;
    let layout = bench.layout.so_far();
    for seed in 0..STATES {
        let mut random = Lcg::new(seed);
        let x = state(layout, &mut random);
        let sample = bench.sample(&mut random)?;
        let input = Input {
            sample: &steady(bench.process.as_ref(), &sample),
            interval: 0.01,
        };
        for dt in [0.1, 0.01] {
            check_process(layout, bench.process.as_ref(), &x, &input, dt).map_err(|e| format!("state {seed}, dt {dt}: {e}"))?;
        }
    }
    drive::check(|| Bench::new(r))
}

fn sensor(r: &Registration) -> Result<(), String> {
    let (mut refusals, mut accepted) = (String::new(), 0);
    for p in registry::all().into_iter().filter(|p| p.role == Role::Process) {
        let mut bench = Bench::new(p).map_err(|e| format!("process `{}`: {e}", p.name))?;
        let spec: Box<dyn SensorSpec> = r.spec()?;
        let model = match spec.build(&mut build(r.name, &mut bench.layout)) {
            Ok(model) => model,
            Err(e) => {
                refusals += &format!("\n{}: {e}", p.name);
                continue;
            }
        };
        accepted += 1;
        let (size, sigmas) = (model.size(), spec.noise().len());
        if sigmas != size.residual {
            return Err(format!("its noise has {sigmas} dimensions, its residual {} rows", size.residual));
        }
        let names = spec.axes().len();
        // Without names rows are counted; several equal groups of rows share one group of names.
        if names > 0 && !size.residual.is_multiple_of(names) {
            return Err(format!("it names {names} of its {} residual rows", size.residual));
        }
        let width = spec.reading().width();
        if width != size.value {
            return Err(format!("it reads {width} numbers and predicts {}", size.value));
        }
        let layout = bench.layout.so_far();
        for seed in 0..STATES {
            let mut random = Lcg::new(100 + seed);
            let x = state(layout, &mut random);
            let sample = bench.sample(&mut random)?;
            let input = Input {
                sample: &steady(bench.process.as_ref(), &sample),
                interval: 0.01,
            };
            check_measurement(layout, Some(bench.process.as_ref()), model.as_ref(), &x, &input)
                .map_err(|e| format!("on process `{}`, state {seed}: {e}", p.name))?;
        }
    }
    if accepted == 0 {
        Err(format!("no process takes it:{refusals}"))
    } else {
        Ok(())
    }
}

fn gate(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn GateSpec> = r.spec()?;
    spec.build().map_err(|e| e.to_string())?;
    // It was built once, so it can be built again.
    check_gate(&|| spec.build().unwrap_or_else(|_| Box::new(fusion_core::gate::Open)))
}

fn loss(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn LossSpec> = r.spec()?;
    check_loss(spec.build().map_err(|e| e.to_string())?.as_ref())
}
