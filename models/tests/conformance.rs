//! The laws of `fusion_core::testing`, applied to every registered block.
//!
//! Each block is built from its own example, so a block added later is tested by being
//! registered. What fails is named: block, process, state, element.

use fusion_core::gate::Gate;
use fusion_core::model::{Input, Process};
use fusion_core::state::{Dynamics, Geodetic, Kind, Layout, LayoutBuilder};
use fusion_core::testing::{Lcg, check_gate, check_kind, check_loss, check_measurement, check_process};
use fusion_models::block::{Build, GateSpec, LossSpec, ProcessSpec, Reading, SensorSpec};
use fusion_models::earth::Gravity;
use fusion_models::registry::{self, Registration, Role};
use fusion_models::units::{Dimensional, dim};
use serde::de::DeserializeOwned;
use std::sync::Arc;

/// States tried per model.
const STATES: u64 = 8;

fn registered(role: Role) -> Vec<&'static Registration> {
    fusion_models::link();
    let of_role: Vec<_> = registry::all().into_iter().filter(|r| r.role == role).collect();
    assert!(!of_role.is_empty(), "no {} is registered", role.name());
    of_role
}

/// The spec of a block's example: `{ type: table }`, as typetag reads it.
fn spec<T: DeserializeOwned>(r: &Registration) -> T {
    let table: toml::Table = toml::from_str(r.example).unwrap_or_else(|e| panic!("the example of `{}` is not TOML: {e}", r.name));
    let mut tagged = toml::Table::new();
    tagged.insert(r.name.to_owned(), toml::Value::Table(table));
    tagged
        .try_into()
        .unwrap_or_else(|e| panic!("the example of `{}` is not its spec: {e}", r.name))
}

/// Near the beacon of the range example, and where the documents' experiments took place.
const ORIGIN: Geodetic = Geodetic {
    lat: 0.63003,
    lon: 2.25933,
    height: -10.0,
};

/// A process built from its example, the sensors that follow built into the same layout.
struct Bench {
    layout: LayoutBuilder,
    process: Arc<dyn Process>,
    spec: Box<dyn ProcessSpec>,
}

fn build<'a>(name: &'a str, layout: &'a mut LayoutBuilder) -> Build<'a> {
    Build {
        name,
        layout,
        origin: Some(ORIGIN),
        gravity: Gravity::default(),
    }
}

impl Bench {
    fn new(r: &Registration) -> Self {
        let spec: Box<dyn ProcessSpec> = spec(r);
        let mut layout = LayoutBuilder::new();
        let process = spec
            .build(&mut build("process", &mut layout))
            .unwrap_or_else(|e| panic!("`{}` does not build: {}: {e}", r.name, e.field));
        Self {
            layout,
            process: process.into(),
            spec,
        }
    }

    /// An input sample of the size its channels suggest.
    fn sample(&self, random: &mut Lcg) -> Vec<f64> {
        let mut sample = Vec::new();
        for channel in self.spec.input() {
            let size = match channel.dimension {
                d if d == dim::AngularRate::KIND.dimension => 0.5,
                d if d == dim::Acceleration::KIND.dimension => 12.0,
                _ => 1.0,
            };
            sample.extend((0..channel.width).map(|_| size * random.signed()));
        }
        assert_eq!(
            sample.len(),
            self.process.input_dim(),
            "the channels of the input and its numbers differ"
        );
        sample
    }
}

/// The declared state, moved at random as far as blocks of its kind go.
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

/// A steady input: corrections for what changes between samples may be left out of Φ.
fn steady(sample: &[f64], neighbour_is_earlier: bool) -> Input<'_> {
    Input {
        sample,
        neighbour: sample,
        interval: 0.01,
        neighbour_interval: 0.01,
        neighbour_is_earlier,
    }
}

#[test]
fn every_registered_name_is_unique_and_every_field_is_described() {
    fusion_models::link();
    assert_eq!(registry::duplicates(), []);
    assert!(!registry::all().is_empty());
    for r in registry::all() {
        let schema = serde_json::to_value((r.schema)()).unwrap();
        assert!(
            schema.get("description").is_some(),
            "{} `{}` has no description",
            r.role.name(),
            r.name
        );
        let none = serde_json::Map::new();
        for (field, schema) in schema["properties"].as_object().unwrap_or(&none) {
            assert!(
                schema.get("description").is_some(),
                "{} `{}`: field `{field}` has no description",
                r.role.name(),
                r.name
            );
        }
    }
}

#[test]
fn every_process_obeys_the_laws_of_processes() {
    for r in registered(Role::Process) {
        let bench = Bench::new(r);
        let layout = bench.layout.so_far().clone();
        for seed in 0..STATES {
            let mut random = Lcg::new(seed);
            let x = state(&layout, &mut random);
            let sample = bench.sample(&mut random);
            let input = steady(&sample, seed % 2 == 0);
            for dt in [0.1, 0.01] {
                check_process(&layout, bench.process.as_ref(), &x, &input, dt)
                    .unwrap_or_else(|e| panic!("process `{}`, state {seed}, dt {dt}: {e}", r.name));
            }
        }
    }
}

#[test]
fn every_sensor_obeys_the_laws_of_measurements_on_every_process_that_takes_it() {
    for r in registered(Role::Sensor) {
        let mut refusals = Vec::new();
        let mut accepted = 0;
        for p in registered(Role::Process) {
            let mut bench = Bench::new(p);
            let spec: Box<dyn SensorSpec> = spec(r);
            let model = match spec.build(&mut build(r.name, &mut bench.layout)) {
                Ok(model) => model,
                Err(e) => {
                    refusals.push(format!("{}: {e}", p.name));
                    continue;
                }
            };
            accepted += 1;
            let size = model.size();
            assert_eq!(
                spec.noise().len(),
                size.residual,
                "`{}`: dimensions of the noise and rows of the residual",
                r.name
            );
            let width = match spec.reading() {
                Reading::Channel(channel) => channel.width,
                Reading::Constant(value) => value.len(),
            };
            assert_eq!(width, size.value, "`{}`: numbers read and numbers predicted", r.name);
            let layout = bench.layout.so_far().clone();
            for seed in 0..STATES {
                let mut random = Lcg::new(100 + seed);
                let x = state(&layout, &mut random);
                let sample = bench.sample(&mut random);
                let input = steady(&sample, seed % 2 == 0);
                check_measurement(&layout, Some(bench.process.as_ref()), model.as_ref(), &x, &input)
                    .unwrap_or_else(|e| panic!("sensor `{}` on process `{}`, state {seed}: {e}", r.name, p.name));
            }
        }
        assert!(accepted > 0, "no process takes sensor `{}`:\n{}", r.name, refusals.join("\n"));
    }
}

#[test]
fn every_gate_obeys_the_laws_of_gates() {
    for r in registered(Role::Gate) {
        let spec: Box<dyn GateSpec> = spec(r);
        let gate: Box<dyn Gate> = spec.build().unwrap_or_else(|e| panic!("gate `{}`: {e}", r.name));
        check_gate(gate.as_ref()).unwrap_or_else(|e| panic!("gate `{}`: {e}", r.name));
    }
}

#[test]
fn every_loss_obeys_the_laws_of_losses() {
    for r in registered(Role::Loss) {
        let spec: Box<dyn LossSpec> = spec(r);
        let loss = spec.build().unwrap_or_else(|e| panic!("loss `{}`: {e}", r.name));
        check_loss(loss.as_ref()).unwrap_or_else(|e| panic!("loss `{}`: {e}", r.name));
    }
}

#[test]
fn every_kind_of_block_obeys_the_laws_of_plus_and_minus() {
    let mut random = Lcg::new(7);
    for _ in 0..200 {
        let q = fusion_core::geometry::so3::from_rpy(3.0 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed());
        let geodetic = [1.5 * random.signed(), core::f64::consts::PI * random.signed(), 1e4 * random.signed()];
        let attitude = [q.w, q.i, q.j, q.k];
        let three = [random.signed(), random.signed(), random.signed()].map(|v| v * 1.8);
        for (kind, x) in [
            (Kind::Geodetic, &geodetic[..]),
            (Kind::Position, &three),
            (Kind::Velocity, &three),
            (Kind::Attitude, &attitude),
            (Kind::Scalar, &three[..1]),
            (Kind::Angle, &three[..1]),
            (Kind::Vector(2), &three[1..]),
        ] {
            check_kind(kind, x, &three[..kind.dim()]).unwrap();
        }
    }
}
