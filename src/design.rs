//! A design: the declaration of a filter, read and checked but not yet built.
//!
//! ```toml
//! [run]                 # origin, time span, output
//! [filter]              # backend
//! [process]             # the process model and its source
//! [sensor.NAME]         # measurement models with source, noise, gate, loss
//! [stage.NAME]          # streams into streams
//! [initial.NAME]        # how the filter starts
//! [source.NAME]         # recorded data, with faults
//! [simulation]          # or a simulated world
//! [reference]           # what the run is scored against
//! [variant.NAME]        # overrides by path
//! ```

mod leaders;

use crate::config::{Diagnostic, Diagnostics, Document, Entry, Node, Value, did_you_mean};
use crate::source::SourceSpec;
use fusion_core::covariance::Form;
use fusion_core::filter::{Backend, ChartKind, UpdateKind};
use fusion_models::block::{GateSpec, InitialiserSpec, LossSpec, ProcessSpec, SensorSpec, StageSpec};
use fusion_models::fault::FaultSpec;
use fusion_models::initial::explicit::PlaceSpec;
use fusion_models::registry::{self, Role};
use fusion_models::sim::{IMU, REFERENCE, SimulationSpec};
use fusion_models::units::{AnyQuantity, Dimension, Duration, NonNegative, Positive, UnitError, Vec3Of, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};
use std::path::PathBuf;

/// Tables that may stand at the top of a design.
const TABLES: [&str; 10] = [
    "run",
    "filter",
    "process",
    "sensor",
    "stage",
    "initial",
    "source",
    "simulation",
    "reference",
    "variant",
];

/// What a run as a whole needs.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunSpec {
    /// What this design is, in a line.
    pub description: String,
    /// Where relative source paths start, itself relative to the file; `--data` overrides it.
    pub data_dir: Option<PathBuf>,
    /// Origin of the local coordinates n, e, d; by default the filter's first position.
    pub origin: Option<PlaceSpec>,
    /// Rows stamped earlier are not read.
    pub start: Option<Duration>,
    /// Rows stamped later are not read.
    pub stop: Option<Duration>,
    /// Rows of estimates.csv per second of log; every input sample where absent.
    pub output_rate: Option<Positive<dim::Frequency>>,
    /// Seed of everything random: faults and simulated errors.
    pub seed: u64,
    /// How far out of order live rows may arrive.
    pub reorder: NonNegative<dim::Duration>,
}

/// The backend: a preset, or its three axes.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSpec {
    /// A named choice of the three axes below.
    pub backend: Option<PresetSpec>,
    /// What the covariance is the covariance of.
    pub chart: Option<ChartSpec>,
    /// How a measurement is linearised.
    pub update: Option<UpdateSpec>,
    /// How the covariance is kept positive.
    pub form: Option<FormSpec>,
}

/// Named backends.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PresetSpec {
    /// Additive Euler angles, single update, Joseph form: the classical EKF.
    Ekf,
    /// Body-frame error, single update, Joseph form.
    ErrorState,
}

/// Charts.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChartSpec {
    /// Additive error of roll, pitch, yaw.
    AdditiveEuler,
    /// Additive error of the quaternion's components, normalised.
    AdditiveQuaternion,
    /// Attitude error in body axes.
    Body,
    /// Attitude error in navigation axes.
    Navigation,
}

/// Updates.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpdateSpec {
    /// Linearised once, at the prediction.
    Single,
}

/// Covariance forms.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormSpec {
    /// (I − KH)P(I − KH)ᵀ + KRKᵀ.
    Joseph,
    /// (I − KH)P.
    Standard,
}

impl FilterSpec {
    /// The backend declared: the preset, with each axis that is named put in its place.
    #[must_use]
    pub fn backend(&self) -> Backend {
        let mut backend = match self.backend {
            Some(PresetSpec::Ekf) => Backend::EKF,
            Some(PresetSpec::ErrorState) | None => Backend::ERROR_STATE,
        };
        if let Some(chart) = self.chart {
            backend.chart = match chart {
                ChartSpec::AdditiveEuler => ChartKind::AdditiveEuler,
                ChartSpec::AdditiveQuaternion => ChartKind::AdditiveQuaternion,
                ChartSpec::Body => ChartKind::Body,
                ChartSpec::Navigation => ChartKind::Navigation,
            };
        }
        if let Some(UpdateSpec::Single) = self.update {
            backend.update = UpdateKind::Single;
        }
        if let Some(form) = self.form {
            backend.form = match form {
                FormSpec::Joseph => Form::Joseph,
                FormSpec::Standard => Form::Standard,
            };
        }
        backend
    }

    /// The backend in the words of TOML: `body / single / joseph`.
    #[must_use]
    pub fn backend_name(&self) -> String {
        let Backend { chart, update, form } = self.backend();
        [format!("{chart:?}"), format!("{update:?}"), format!("{form:?}")]
            .map(|word| snake(&word))
            .join(" / ")
    }
}

/// `AdditiveEuler` as `additive_euler`.
fn snake(word: &str) -> String {
    let mut out = String::new();
    for c in word.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// What a run is scored against; never fused.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSpec {
    /// The source with a `position` channel and, where it has them, `velocity` and `attitude`.
    pub source: String,
    /// Errors and innovations count from this time on.
    #[serde(default)]
    pub from: Option<Duration>,
    /// The reference's point in body axes, from the body origin: the estimate is moved there.
    #[serde(default)]
    pub lever_arm: Vec3Of<dim::Length>,
    /// Takes the mean rotation between the two bodies out of the attitude errors.
    #[serde(default)]
    pub remove_mean_mounting: bool,
    /// Derives a missing reference velocity from its positions.
    #[serde(default)]
    pub velocity_from_position: Option<DifferentiateSpec>,
}

/// The slope of a cubic fitted to neighbouring positions.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DifferentiateSpec {
    /// Epochs on either side of each.
    pub half_window: u32,
    /// Epochs whose neighbours span more get no velocity.
    pub max_span: Positive<dim::Duration>,
}

/// The noise of a sensor.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpec {
    /// 1σ, one for all rows or one per row.
    pub sigma: Option<PerRow>,
    /// Adds the 1σ that the source reports, its channel `<channel>_sigma`, in quadrature.
    #[serde(default)]
    pub from_source: bool,
    /// Factor on the reported 1σ.
    pub scale: Option<Positive<dim::Ratio>>,
}

/// One quantity for all rows, or one per row.
#[derive(Clone, Debug)]
pub struct PerRow(Vec<AnyQuantity>);

impl PerRow {
    /// The SI values for rows of these dimensions.
    ///
    /// # Errors
    /// A wrong count or dimension, with the index of the culprit.
    pub fn resolve(&self, rows: &[Dimension]) -> Result<Vec<f64>, String> {
        if self.0.len() != 1 && self.0.len() != rows.len() {
            return Err(format!("one value or {} are wanted here, one per row of the residual", rows.len()));
        }
        let at = |i: usize| if self.0.len() == 1 { &self.0[0] } else { &self.0[i] };
        let values: Result<Vec<f64>, UnitError> = rows.iter().enumerate().map(|(i, d)| at(i).expect(*d)).collect();
        let values = values.map_err(|e| e.to_string())?;
        if let Some(negative) = values.iter().find(|v| **v < 0.0) {
            return Err(format!("{negative} is negative; a standard deviation of at least 0 is wanted here"));
        }
        Ok(values)
    }
}

impl<'de> Deserialize<'de> for PerRow {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Rows;
        impl<'de> Visitor<'de> for Rows {
            type Value = PerRow;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a quantity such as \"1.5 m\", or an array of them")
            }
            fn visit_f64<E: Error>(self, v: f64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_i64<E: Error>(self, v: i64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_u64<E: Error>(self, v: u64) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_str<E: Error>(self, v: &str) -> Result<PerRow, E> {
                AnyQuantity::deserialize(v.into_deserializer()).map(|q| PerRow(vec![q]))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<PerRow, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(PerRow)
            }
        }
        deserializer.deserialize_any(Rows)
    }
}

impl JsonSchema for PerRow {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PerRow".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let one = generator.subschema_for::<AnyQuantity>();
        schemars::json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

/// What stands beside a sensor's own fields.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorCommon {
    /// The source or stage that it reads or that times it.
    pub source: String,
    /// Its noise.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// The sensor that it goes with: a measurement is rejected where the latest one of that sensor
    /// that is valid no later, and no more than 10 s earlier, was not used. Without effect where that
    /// sensor is left out.
    pub only_with: Option<String>,
    /// False leaves the sensor out.
    pub enabled: Option<bool>,
}

/// A block with its name and the place of its declaration.
#[derive(Debug)]
pub struct Named<T> {
    /// The name in the file.
    pub name: String,
    /// Its table, for messages.
    pub node: Node,
    /// What was read.
    pub block: T,
}

/// A sensor with its siblings.
#[derive(Debug)]
pub struct SensorDesign {
    /// The measurement model.
    pub model: Box<dyn SensorSpec>,
    /// Source and noise.
    pub common: SensorCommon,
    /// The gate; none passes everything.
    pub gate: Option<Box<dyn GateSpec>>,
    /// The loss; none is least squares.
    pub loss: Option<Box<dyn LossSpec>>,
}

/// A fault with its name.
pub type Fault = (String, Box<dyn FaultSpec>);

/// A source with its faults.
#[derive(Debug)]
pub struct SourceDesign {
    /// The source.
    pub source: Box<dyn SourceSpec>,
    /// What goes wrong with it, in order.
    pub faults: Vec<Fault>,
}

/// A simulated world with the faults of its streams.
#[derive(Debug)]
pub struct SimulationDesign {
    /// The world and the errors of its sensors.
    pub world: SimulationSpec,
    /// By stream, `imu` or a sensor: what goes wrong with it, in order.
    pub faults: Vec<(String, Vec<Fault>)>,
}

/// The process with its source.
#[derive(Debug)]
pub struct ProcessDesign {
    /// The process model.
    pub model: Box<dyn ProcessSpec>,
    /// The source of its input.
    pub source: Option<String>,
}

/// A whole design.
#[derive(Debug)]
pub struct Design {
    /// The document it was read from.
    pub document: Document,
    /// `[run]`.
    pub run: RunSpec,
    /// `[filter]`.
    pub filter: FilterSpec,
    /// `[process]`.
    pub process: Named<ProcessDesign>,
    /// `[sensor.*]`, those enabled.
    pub sensors: Vec<Named<SensorDesign>>,
    /// `[stage.*]`.
    pub stages: Vec<Named<Box<dyn StageSpec>>>,
    /// `[initial.*]`.
    pub initialisers: Vec<Named<Box<dyn InitialiserSpec>>>,
    /// `[source.*]`.
    pub sources: Vec<Named<SourceDesign>>,
    /// `[simulation]`.
    pub simulation: Option<Named<SimulationDesign>>,
    /// `[reference]`.
    pub reference: Option<Named<ReferenceSpec>>,
}

impl Design {
    /// Reads a design, with every mistake of the file in one go.
    ///
    /// # Errors
    /// The mistakes.
    pub fn read(document: Document) -> Result<Self, Diagnostics> {
        fusion_models::link();
        let mut d = Diagnostics::new();
        let root = document.root().clone();
        check_tables(&root, &mut d);
        let run = root.get("run").map_or_else(|| Some(RunSpec::default()), |n| n.read(&mut d));
        let filter = root.get("filter").map_or_else(|| Some(FilterSpec::default()), |n| n.read(&mut d));
        let process = read_process(&root, &mut d);
        let sensors = each(&root, "sensor", &mut d, read_sensor);
        let stages = each(&root, "stage", &mut d, |n, d| read_optional(n, "stage", Role::Stage, d));
        let initialisers = each(&root, "initial", &mut d, |n, d| {
            read_optional(n, "initialiser", Role::Initialiser, d)
        });
        let sources = each(&root, "source", &mut d, read_source);
        let simulation = root.get("simulation").and_then(|n| {
            Some(Named {
                name: "simulation".to_owned(),
                node: n.clone(),
                block: read_simulation(n, &root, &mut d)?,
            })
        });
        let reference = root.get("reference").and_then(|n| {
            Some(Named {
                name: "reference".to_owned(),
                node: n.clone(),
                block: n.read(&mut d)?,
            })
        });
        let (Some(run), Some(filter), Some(process)) = (run, filter, process) else {
            return Err(d);
        };
        leaders::check(&root, &sensors, &mut d);
        let sensors = sensors.into_iter().filter(|s| s.block.common.enabled != Some(false)).collect();
        let design = Self {
            document,
            run,
            filter,
            process,
            sensors,
            stages,
            initialisers,
            sources,
            simulation,
            reference,
        };
        design.check_names(&mut d);
        d.unless_errors(design)
    }

    /// Streams must have unique names: sources and stages share one space. What is simulated is a sensor.
    fn check_names(&self, d: &mut Diagnostics) {
        if self.run.origin.is_some_and(|o| o.latitude.si().abs() > std::f64::consts::FRAC_PI_2) {
            let place = self.document.root().place_of("run.origin.latitude");
            d.push(
                Diagnostic::error("a latitude lies between -90 and 90 degrees")
                    .at(place)
                    .help("a bare number is in radians: write \"47 deg\""),
            );
        }
        for stage in &self.stages {
            if self.sources.iter().any(|s| s.name == stage.name) {
                let message = format!("`{}` is the name of a source and of a stage", stage.name);
                d.push(
                    Diagnostic::error(message)
                        .at(stage.node.name_place())
                        .help("streams share one space of names; rename one of the two"),
                );
            }
            let world = self.simulation.as_ref().map(|s| &s.block.world);
            if world.is_some_and(|w| [IMU, REFERENCE].contains(&stage.name.as_str()) || w.sensor.contains_key(&stage.name)) {
                let message = format!("`{}` is the name of a stream of the simulated world", stage.name);
                d.push(
                    Diagnostic::error(message)
                        .at(stage.node.name_place())
                        .help("give the stage another name, and name that where it is read"),
                );
            }
        }
        let sensors = self.document.root().get("sensor").map_or(&[][..], Node::entries);
        let names: Vec<&str> = sensors.iter().map(|s| s.key.as_str()).collect();
        let simulated = self.simulation.as_ref().and_then(|s| s.node.get("sensor"));
        for Entry { key, node } in simulated.map_or(&[][..], Node::entries) {
            if !names.contains(&key.as_str()) {
                let mut diagnostic =
                    Diagnostic::error(format!("`{key}` is simulated and is no sensor of this design")).at(node.name_place());
                if let Some(meant) = did_you_mean(key, &names) {
                    diagnostic = diagnostic.label(format!("did you mean `{meant}`?"));
                }
                let listed = names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
                d.push(diagnostic.help(format!("simulated sensors bear the names of sensors: {listed}")));
            }
        }
    }
}

fn check_tables(root: &Node, d: &mut Diagnostics) {
    for Entry { key, node } in root.entries() {
        if !TABLES.contains(&key.as_str()) {
            let mut diagnostic = Diagnostic::error(format!("unknown table `{key}`")).at(node.name_place());
            if let Some(meant) = did_you_mean(key, &TABLES) {
                diagnostic = diagnostic.label(format!("did you mean `{meant}`?"));
            }
            let tables = TABLES.map(|t| format!("`{t}`")).join(", ");
            d.push(diagnostic.help(format!("known tables: {tables}")));
        }
    }
}

/// The blocks of a table of blocks; none where it is left out.
fn entries<'a>(table: Option<&'a Node>, d: &mut Diagnostics) -> &'a [Entry] {
    let Some(node) = table else { return &[] };
    if !matches!(node.value(), Value::Table { .. }) {
        let help = "write a table for each block, with a name of your choice: `NAME = { type = … }`";
        d.push(Diagnostic::error("blocks by name are wanted here").at(node.place()).help(help));
    }
    node.entries()
}

fn each<T>(root: &Node, table: &str, d: &mut Diagnostics, mut read: impl FnMut(&Node, &mut Diagnostics) -> Option<T>) -> Vec<Named<T>> {
    let mut all = Vec::new();
    for Entry { key, node } in entries(root.get(table), d) {
        if let Some(block) = read(node, d) {
            all.push(Named {
                name: key.clone(),
                node: node.clone(),
                block,
            });
        }
    }
    all
}

/// Reads a block that `enabled = false` leaves out.
fn read_optional<T: ?Sized>(node: &Node, role: &str, registered: Role, d: &mut Diagnostics) -> Option<Box<T>>
where
    Box<T>: serde::de::DeserializeOwned,
{
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Common {
        enabled: Option<bool>,
    }
    let mut own = node.clone();
    let common: Common = own.split_off(&["enabled"]).read(d)?;
    let block = own.read_block(role, &registry::names(registered), d)?;
    (common.enabled != Some(false)).then_some(block)
}

fn read_process(root: &Node, d: &mut Diagnostics) -> Option<Named<ProcessDesign>> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Common {
        source: Option<String>,
    }
    let Some(node) = root.get("process") else {
        let help = "add a [process] table, e.g. type = \"strapdown\"; `fusion blocks` lists the process models";
        d.push(Diagnostic::error("this design has no process model").at(root.place()).help(help));
        return None;
    };
    let mut own = node.clone();
    let common: Option<Common> = own.split_off(&["source"]).read(d);
    let model = own.read_block("process model", &registry::names(Role::Process), d)?;
    let block = ProcessDesign {
        model,
        source: common?.source,
    };
    Some(Named {
        name: "process".to_owned(),
        node: node.clone(),
        block,
    })
}

fn read_sensor(node: &Node, d: &mut Diagnostics) -> Option<SensorDesign> {
    let mut own = node.clone();
    let gate = own.take("gate").map(|n| n.read_block("gate", &registry::names(Role::Gate), d));
    let loss = own.take("loss").map(|n| n.read_block("loss", &registry::names(Role::Loss), d));
    let siblings = own.split_off(&["source", "noise", "only_with", "enabled"]);
    let common: Option<SensorCommon> = siblings.read(d);
    let model = own.read_block("sensor", &registry::names(Role::Sensor), d)?;
    let block = SensorDesign {
        model,
        common: common?,
        gate: gate.flatten(),
        loss: loss.flatten(),
    };
    Some(block)
}

fn read_faults(table: Option<&Node>, d: &mut Diagnostics) -> Vec<Fault> {
    let mut faults = Vec::new();
    for Entry { key, node } in entries(table, d) {
        if let Some(block) = node.read_block("fault", &registry::names(Role::Fault), d) {
            faults.push((key.clone(), block));
        }
    }
    faults
}

fn read_source(node: &Node, d: &mut Diagnostics) -> Option<SourceDesign> {
    let mut own = node.clone();
    let faults = read_faults(own.take("fault").as_ref(), d);
    let source = own.read_block("source", &registry::names(Role::Source), d)?;
    Some(SourceDesign { source, faults })
}

fn read_simulation(node: &Node, root: &Node, d: &mut Diagnostics) -> Option<SimulationDesign> {
    let mut own = node.clone();
    // A sensor that is left out is not simulated either.
    let is_off = |e: &&Entry| matches!(e.node.get("enabled").map(Node::value), Some(Value::Boolean(false)));
    let off: Vec<&str> = root
        .get("sensor")
        .map_or(&[][..], Node::entries)
        .iter()
        .filter(is_off)
        .map(|e| e.key.as_str())
        .collect();
    if let Some(sensors) = own.get_mut("sensor") {
        drop(sensors.split_off(&off));
    }
    let mut faults = Vec::new();
    if let Some(imu) = own.get_mut(IMU) {
        faults.push((IMU.to_owned(), read_faults(imu.take("fault").as_ref(), d)));
    }
    if let Some(sensors) = own.get_mut("sensor") {
        for sensor in sensors.entries_mut() {
            let table = sensor.node.take("fault");
            faults.push((sensor.key.clone(), read_faults(table.as_ref(), d)));
        }
    }
    Some(SimulationDesign {
        world: own.read(d)?,
        faults,
    })
}
