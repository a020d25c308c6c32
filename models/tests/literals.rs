//! Every block of a vehicle as a Rust expression: the models that the committed code builds are those of the TOML.
//!
//! `INSTA_UPDATE=always cargo test -p fusion-models --test literals` writes the code anew.

extern crate alloc;

use fusion_core::gate::Gate;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::loss::Loss;
use fusion_core::model::{Literal, Measurement, Process};
use fusion_core::runner::{Initialiser, Stage};
use fusion_core::state::LayoutBuilder;
use fusion_models::block::{Build, BuildError, GateSpec, InitialiserSpec, LossSpec, ProcessSpec, SensorSpec, StageSpec};
use fusion_models::earth::Gravity;
use fusion_models::registry::{self, Registration, Role};
use std::path::Path;
use std::{env, fs};

/// The blocks that cannot write themselves, each with the reason.
const WITHOUT: &[(&str, &str)] = &[];

/// A block of a vehicle.
enum Block {
    Process(Box<dyn Process>),
    Sensor(Box<dyn Measurement>),
    Stage(Box<dyn Stage>),
    Initialiser(Box<dyn Initialiser>),
    Gate(Box<dyn Gate>),
    Loss(Box<dyn Loss>),
}

impl Block {
    /// From the example of the block, on the first process that takes it. `None` for a role that a vehicle does not use.
    fn of(r: &Registration) -> Result<Option<Self>, String> {
        Ok(Some(match r.role {
            Role::Process => Self::Process(process(r, &mut LayoutBuilder::new())?),
            Role::Sensor => Self::Sensor(on_a_process(r.spec::<Box<dyn SensorSpec>>()?, |spec, b| spec.build(b))?),
            Role::Stage => Self::Stage(on_a_process(r.spec::<Box<dyn StageSpec>>()?, |spec, b| spec.build(b))?),
            Role::Initialiser => Self::Initialiser(on_a_process(r.spec::<Box<dyn InitialiserSpec>>()?, |spec, b| spec.build(b))?),
            Role::Gate => Self::Gate(r.spec::<Box<dyn GateSpec>>()?.build().map_err(|e| e.to_string())?),
            Role::Loss => Self::Loss(r.spec::<Box<dyn LossSpec>>()?.build().map_err(|e| e.to_string())?),
            _ => return Ok(None),
        }))
    }

    fn literal(&self) -> Option<&dyn Literal> {
        match self {
            Self::Process(block) => block.literal(),
            Self::Sensor(block) => block.literal(),
            Self::Stage(block) => block.literal(),
            Self::Initialiser(block) => block.literal(),
            Self::Gate(block) => block.literal(),
            Self::Loss(block) => block.literal(),
        }
    }
}

fn build(layout: &mut LayoutBuilder) -> Build<'_> {
    Build {
        name: "block",
        layout,
        origin: Some(Geodetic::new(0.63, 2.26, -10.0)),
        gravity: Gravity::default(),
    }
}

fn process(r: &Registration, layout: &mut LayoutBuilder) -> Result<Box<dyn Process>, String> {
    let spec: Box<dyn ProcessSpec> = r.spec()?;
    spec.build(&mut build(layout)).map_err(|e| e.to_string())
}

fn on_a_process<S, T>(spec: S, built: impl Fn(&S, &mut Build<'_>) -> Result<T, BuildError>) -> Result<T, String> {
    let mut refusals = String::new();
    for r in registry::all().into_iter().filter(|r| r.role == Role::Process) {
        let mut layout = LayoutBuilder::new();
        process(r, &mut layout)?;
        match built(&spec, &mut build(&mut layout)) {
            Ok(block) => return Ok(block),
            Err(e) => refusals += &format!("{}: {e}\n", r.name),
        }
    }
    Err(refusals)
}

fn expression(literal: &dyn Literal) -> String {
    let mut text = String::new();
    literal.expression(&mut text);
    text
}

/// The blocks of a vehicle with their names.
fn blocks() -> Result<Vec<(String, Block)>, String> {
    fusion_models::link();
    let named = |r: &Registration| Block::of(r).map(|block| Some((format!("{} {}", r.role.name(), r.name), block?)));
    registry::all().into_iter().filter_map(|r| named(r).transpose()).collect()
}

/// Names and expressions as code, which gives them back.
fn code(expressions: &[(String, String)]) -> String {
    let lines = expressions
        .iter()
        .map(|(name, text)| format!("    ({name:?}.to_owned(), expression(&{text})),\n"));
    format!("[\n{}]\n", lines.collect::<String>())
}

#[test]
fn every_block_writes_itself_or_is_listed_with_the_reason() {
    for (name, block) in blocks().unwrap() {
        let is_listed = WITHOUT.iter().any(|(listed, _)| *listed == name);
        assert_eq!(block.literal().is_none(), is_listed, "{name}");
    }
}

#[test]
fn code_builds_the_models_of_the_toml() {
    let of_toml = blocks()
        .unwrap()
        .into_iter()
        .filter_map(|(name, block)| Some((name, expression(block.literal()?))));
    let of_toml = code(&of_toml.collect::<Vec<_>>());
    if env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/literals/blocks.rs"), &of_toml).unwrap();
    }
    let committed = include_str!("literals/blocks.rs");
    assert_eq!(
        code(&include!("literals/blocks.rs")),
        committed,
        "bits and fields of the code are read as they are written"
    );
    let (of_toml, committed) = (numbers(&of_toml), numbers(committed));
    assert_eq!(of_toml.0, committed.0);
    for (of_toml, committed) in of_toml.1.iter().zip(&committed.1) {
        // Sines, roots and quantiles of another platform differ in their last digits.
        let is_near = (of_toml - committed).abs() <= 1e-9 * committed.abs() + 1e-16;
        assert!(is_near || of_toml == committed, "{of_toml} {committed}");
    }
}

/// A text without its numbers, and these.
fn numbers(code: &str) -> (String, Vec<f64>) {
    let mut parts = code.split("from_bits(0x");
    let (mut text, mut numbers) = (parts.next().unwrap_or_default().to_owned(), Vec::new());
    for part in parts {
        let (bits, rest) = part.split_at(16);
        numbers.push(u64::from_str_radix(bits, 16).map_or(f64::NAN, f64::from_bits));
        text += rest;
    }
    (text, numbers)
}
