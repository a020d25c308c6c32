//! From a document to a design: every table read, every mistake kept.

use super::{
    Fault, FilterSpec, HealthSpec, InputSpec, Named, ProcessDesign, ReferenceSpec, RunSpec, SensorCommon, SensorDesign, SimulationDesign,
    SourceDesign, Truth, leaders, names, nested,
};
use crate::config::{Diagnostic, Diagnostics, Document, Entry, Node, Value, did_you_mean};
use fusion_core::covariance::Kernel;
use fusion_models::block::{InitialiserSpec, StageSpec};
use fusion_models::registry::{self, Role};
use fusion_models::sim::instruments;
use serde::Deserialize;

/// A whole design.
///
/// `P` is the process: always there in a design, perhaps missing in a draft.
#[derive(Debug)]
pub struct Design<P = Named<ProcessDesign>> {
    /// The document it was read from.
    pub document: Document,
    /// `[run]`.
    pub run: RunSpec,
    /// `[filter]`.
    pub filter: FilterSpec,
    /// `[health]`.
    pub health: HealthSpec,
    /// `[process]`.
    pub process: P,
    /// `[sensor.*]`, those enabled.
    pub sensors: Vec<Named<SensorDesign>>,
    /// `[sensor.*]` with `enabled = false`.
    pub(crate) left_out: Vec<Named<SensorDesign>>,
    /// `[stage.*]`, without the filters among them.
    pub stages: Vec<Named<Box<dyn StageSpec>>>,
    /// `[stage.*]` that are designs.
    pub(crate) filters: Vec<Named<Draft>>,
    /// `[initial.*]`.
    pub initialisers: Vec<Named<Box<dyn InitialiserSpec>>>,
    /// `[source.*]`.
    pub sources: Vec<Named<SourceDesign>>,
    /// `[simulation]`.
    pub simulation: Option<Named<SimulationDesign>>,
    /// `[reference]`.
    pub reference: Option<Named<ReferenceSpec>>,
    /// The parts that could not be read; empty for a design without mistakes.
    pub(crate) unread: Unread,
}

impl<P> Design<P> {
    /// Selects the kernel that computes, also for the filters inside stages.
    pub fn set_kernel(&mut self, kernel: Kernel) {
        self.filter.kernel = Some(kernel);
        self.filters.iter_mut().for_each(|inside| inside.block.set_kernel(kernel));
    }
}

/// A design as far as it could be read; it is checked for further mistakes.
pub(crate) type Draft = Design<Option<Named<ProcessDesign>>>;

/// Tables that could not be read. A reference to one of them is not reported as another mistake.
#[derive(Debug, Default)]
pub(crate) struct Unread {
    /// `[run]`.
    pub run: bool,
    /// `[filter]`.
    pub filter: bool,
    /// `[simulation]`; true also if it simulates a name that is not a sensor.
    pub simulation: bool,
    /// Names of sensors.
    pub sensors: Vec<String>,
    /// Names of sources and stages.
    pub streams: Vec<String>,
    /// Whether an initialiser is among them.
    pub initialisers: bool,
}

impl Unread {
    /// Returns true if there is an unreadable sensor whose source is unknown too.
    pub(crate) fn has_stray_sensor(&self, document: &Document) -> bool {
        let source = |name: &String| document.root().get("sensor")?.get(name)?.get("source")?.as_str();
        self.sensors.iter().any(|name| source(name).is_none())
    }
}

impl Design {
    /// GPS time at the time zero of its rows \[ns\], as one of the sources declares it. A simulated log has none.
    #[must_use]
    pub fn time_zero(&self) -> Option<i64> {
        let sources = self.sources.iter().filter(|_| self.simulation.is_none());
        sources.map(|named| &named.block.source).find_map(|source| source.time_zero())
    }

    /// Reads a design, with every mistake of reading in one go.
    ///
    /// # Errors
    /// The mistakes.
    pub fn read(document: Document) -> Result<Self, Diagnostics> {
        let mut d = Diagnostics::new();
        let draft = Draft::of(document, &mut d);
        match draft.whole() {
            Ok(design) => d.unless_errors(design),
            Err(_) => Err(d),
        }
    }
}

impl Draft {
    /// Reads all readable parts; reports the mistakes of the others to `d`.
    pub(crate) fn of(document: Document, d: &mut Diagnostics) -> Self {
        fusion_models::link();
        if let Err(twice) = registry::refuse_duplicates() {
            let help = "blocks are found by role and `type`: give one of them another name, or leave one crate out";
            d.push(Diagnostic::error(twice).help(help));
        }
        let root = document.shared();
        names::check_tables(&root, &names::tables(), d);
        let run: Option<RunSpec> = root.get("run").map_or_else(|| Some(RunSpec::default()), |n| n.read(d));
        let is_unread = run.is_none();
        let mut draft = Self::filter(document, run.unwrap_or_default(), d);
        draft.unread.run = is_unread;
        let (sources, unread_sources) = each(&root, "source", d, read_source);
        draft.sources = sources;
        draft.unread.streams.extend(unread_sources);
        if is_simulated(&root) {
            let kept = root.get("simulation").map_or_else(Vec::new, |n| draft.leave_out(n));
            draft.simulation = one(&root, "simulation", d, |n, d| read_simulation(n, &draft.document, &kept, d));
            draft.unread.simulation = draft.simulation.is_none();
        }
        draft.reference = one(&root, "reference", d, ReferenceSpec::read);
        names::check(&mut draft, d);
        draft
    }

    /// Reads the parts of a filter, independent of the source of its rows.
    pub(super) fn filter(document: Document, run: RunSpec, d: &mut Diagnostics) -> Self {
        let root = document.shared();
        let filter = root
            .get("filter")
            .map_or_else(|| Some(FilterSpec::default()), |n| FilterSpec::of(n, d));
        if let (Some(node), Some(filter)) = (root.get("filter"), &filter) {
            filter.check(node, d);
        }
        let health = read_health(&root, d);
        let process = read_process(&root, d);
        let (sensors, unread_sensors) = each(&root, "sensor", d, read_sensor);
        let (mut stages, mut filters) = (Vec::new(), Vec::new());
        let (read, streams) = each(&root, "stage", d, |n, d| read_stage(n, &document, &run, d));
        for Named { name, node, block } in enabled(read) {
            match block {
                Stage::Block(block) => stages.push(Named { name, node, block }),
                Stage::Filter(block) => filters.push(Named { name, node, block: *block }),
            }
        }
        let (initialisers, unread_initialisers) = each(&root, "initial", d, |n, d| read_optional(n, "initialiser", Role::Initialiser, d));
        leaders::check(&root, &sensors, d);
        let is_filter_unread = filter.is_none();
        let is_left_out = |s: &Named<SensorDesign>| s.block.common.enabled == Some(false);
        let (left_out, sensors) = sensors.into_iter().partition(is_left_out);
        Self {
            document,
            run,
            filter: filter.unwrap_or_default(),
            health,
            process,
            sensors: in_order(sensors),
            left_out,
            stages,
            filters,
            initialisers: enabled(initialisers),
            sources: Vec::new(),
            simulation: None,
            reference: None,
            unread: Unread {
                sensors: unread_sensors,
                streams,
                initialisers: !unread_initialisers.is_empty(),
                filter: is_filter_unread,
                ..Unread::default()
            },
        }
    }

    /// The design, where it has a process.
    ///
    /// # Errors
    /// The draft.
    pub(crate) fn whole(self) -> Result<Design, Box<Self>> {
        match self.process {
            None => Err(Box::new(self)),
            Some(process) => Ok(Design {
                process,
                document: self.document,
                run: self.run,
                filter: self.filter,
                health: self.health,
                sensors: self.sensors,
                left_out: self.left_out,
                stages: self.stages,
                filters: self.filters,
                initialisers: self.initialisers,
                sources: self.sources,
                simulation: self.simulation,
                reference: self.reference,
                unread: self.unread,
            }),
        }
    }
}

/// The sensors in the order of the file, but each after the sensor whose states it reads. So an included part, which
/// comes first, may read the states of a sensor of the design itself.
fn in_order(sensors: Vec<Named<SensorDesign>>) -> Vec<Named<SensorDesign>> {
    let read = |at: usize| {
        let name = sensors[at].block.model.follows()?;
        sensors.iter().position(|sensor| sensor.name == name)
    };
    let mut order: Vec<usize> = Vec::new();
    for at in 0..sensors.len() {
        let (mut chain, mut next) = (Vec::new(), Some(at));
        while let Some(at) = next.filter(|at| !order.contains(at) && !chain.contains(at)) {
            chain.push(at);
            next = read(at);
        }
        order.extend(chain.into_iter().rev());
    }
    let mut taken: Vec<_> = sensors.into_iter().map(Some).collect();
    order.into_iter().filter_map(|at| taken[at].take()).collect()
}

/// The blocks of a table of blocks; empty if the table is missing.
fn entries<'a>(table: Option<&'a Node>, d: &mut Diagnostics) -> &'a [Entry] {
    let Some(node) = table else { return &[] };
    if !matches!(node.value(), Value::Table { .. }) {
        let help = "write a table for each block, with a name of your choice: `NAME = { type = … }`";
        d.push(
            Diagnostic::error("a table of named blocks is expected here")
                .at(node.place())
                .help(help),
        );
    }
    node.entries()
}

/// The blocks of a table of blocks, and the names of those that could not be read.
fn each<T>(
    root: &Node,
    table: &str,
    d: &mut Diagnostics,
    mut read: impl FnMut(&Node, &mut Diagnostics) -> Option<T>,
) -> (Vec<Named<T>>, Vec<String>) {
    let (mut all, mut unread) = (Vec::new(), Vec::new());
    let entries = entries(root.get(table), d);
    for Entry { key, node } in entries {
        let block = match misspelt(key, node, entries) {
            Some(mistake) => {
                d.push(mistake);
                None
            }
            None => read(node, d),
        };
        match block {
            Some(block) => all.push(Named {
                name: key.clone(),
                node: node.clone(),
                block,
            }),
            None => unread.push(key.clone()),
        }
    }
    (all, unread)
}

/// A table without a `type`, and with almost the name of another block, was meant to change that block.
fn misspelt(key: &str, node: &Node, entries: &[Entry]) -> Option<Diagnostic> {
    let is_typed = |node: &Node| node.get("type").is_some();
    let is_table = matches!(node.value(), Value::Table { .. });
    if is_typed(node) || !is_table {
        return None;
    }
    let typed: Vec<&str> = entries.iter().filter(|e| is_typed(&e.node)).map(|e| e.key.as_str()).collect();
    did_you_mean(key, &typed)?;
    let message = format!("there is no `{key}` to change, and a new block needs a `type`");
    let unknown = Diagnostic::error(message).at(node.name_place());
    Some(unknown.suggest(key, &typed, "there are"))
}

/// A table that occurs once.
fn one<T>(root: &Node, table: &str, d: &mut Diagnostics, read: impl FnOnce(&Node, &mut Diagnostics) -> Option<T>) -> Option<Named<T>> {
    let node = root.get(table)?;
    Some(Named {
        name: table.to_owned(),
        node: node.clone(),
        block: read(node, d)?,
    })
}

/// A block, and whether it is left out.
pub(super) struct Optional<T> {
    pub(super) enabled: bool,
    pub(super) block: T,
}

/// A stage as read.
enum Stage {
    Block(Box<dyn StageSpec>),
    Filter(Box<Draft>),
}

fn read_stage(node: &Node, document: &Document, run: &RunSpec, d: &mut Diagnostics) -> Option<Optional<Stage>> {
    let (enabled, block) = if nested::is_filter(node) {
        let read = nested::read(node, document, run, d)?;
        (read.enabled, Stage::Filter(Box::new(read.block)))
    } else {
        let read = read_optional(node, "stage", Role::Stage, d)?;
        (read.enabled, Stage::Block(read.block))
    };
    Some(Optional { enabled, block })
}

fn enabled<T>(all: Vec<Named<Optional<T>>>) -> Vec<Named<T>> {
    let kept = all.into_iter().filter(|named| named.block.enabled);
    kept.map(|Named { name, node, block }| Named {
        name,
        node,
        block: block.block,
    })
    .collect()
}

/// A block of this role, with all of its mistakes.
fn read_block<T: ?Sized>(node: &Node, word: &str, role: Role, d: &mut Diagnostics) -> Option<Box<T>>
where
    Box<T>: serde::de::DeserializeOwned,
{
    let before = d.iter().count();
    let read = node.read_block(word, &registry::names(role), d);
    if read.is_none() {
        let named = node.get("type").unwrap_or(node).as_str();
        let registered = registry::all().into_iter().find(|r| r.role == role && Some(r.name) == named);
        let schema = registered.map(|r| (r.schema)());
        let required = schema.as_ref().and_then(|schema| schema.get("required")?.as_array());
        let required: Vec<&str> = required.into_iter().flatten().filter_map(|field| field.as_str()).collect();
        node.miss(&required, before, d);
    }
    read
}

/// Reads a block that `enabled = false` leaves out.
fn read_optional<T: ?Sized>(node: &Node, role: &str, registered: Role, d: &mut Diagnostics) -> Option<Optional<Box<T>>>
where
    Box<T>: serde::de::DeserializeOwned,
{
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Common {
        enabled: Option<bool>,
    }
    let mut own = node.clone();
    let common: Option<Common> = own.split_off(&["enabled"]).read(d);
    let block = read_block(&own, role, registered, d)?;
    let enabled = common?.enabled != Some(false);
    Some(Optional { enabled, block })
}

fn read_health(root: &Node, d: &mut Diagnostics) -> HealthSpec {
    let node = root.get("health");
    let read: Option<HealthSpec> = node.and_then(|node| node.read(d));
    if let (Some(node), Some(health)) = (node, &read) {
        health.check(node, d);
    }
    read.unwrap_or_default()
}

fn read_process(root: &Node, d: &mut Diagnostics) -> Option<Named<ProcessDesign>> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Common {
        source: Option<String>,
        #[serde(default)]
        input: InputSpec,
    }
    let Some(node) = root.get("process") else {
        let help = "add a [process] table, or [stage.NAME.process] for a filter inside a stage, e.g. type = \"strapdown\"; `fusion blocks` lists the process models";
        d.push(Diagnostic::error("this design has no process model").at(root.place()).help(help));
        return None;
    };
    let mut own = node.clone();
    let common: Option<Common> = own.split_off(&["source", "input"]).read(d);
    let model = read_block(&own, "process model", Role::Process, d)?;
    let Common { source, input } = common?;
    let block = ProcessDesign { model, source, input };
    Some(Named {
        name: "process".to_owned(),
        node: node.clone(),
        block,
    })
}

fn read_sensor(node: &Node, d: &mut Diagnostics) -> Option<SensorDesign> {
    let mut own = node.clone();
    let gate = own.take("gate").map(|n| read_block(&n, "gate", Role::Gate, d));
    let loss = own.take("loss").map(|n| read_block(&n, "loss", Role::Loss, d));
    // So a variant, or a file that includes a part, can remove `only_with`.
    if matches!(own.get("only_with").map(Node::value), Some(Value::Boolean(false))) {
        drop(own.take("only_with"));
    }
    // `get` before `take`: the message for an unknown field would suggest a taken key.
    if own.get("truth").is_some()
        && let Some(truth) = own.take("truth")
    {
        let message = "`truth` is of the simulated instrument, and not of what the filter believes of it";
        let help = "it stands under the same name in `[simulation.sensor.NAME]`";
        d.push(Diagnostic::error(message).at(truth.place()).help(help));
    }
    let siblings = own.split_off(&["source", "noise", "time_offset", "quality", "only_with", "switch", "enabled"]);
    let common: Option<SensorCommon> = siblings.read(d);
    let model = read_block(&own, "sensor", Role::Sensor, d)?;
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
        if let Some(block) = read_block(node, "fault", Role::Fault, d) {
            faults.push((key.clone(), block));
        }
    }
    faults
}

fn read_source(node: &Node, d: &mut Diagnostics) -> Option<SourceDesign> {
    let mut own = node.clone();
    let faults = read_faults(own.take("fault").as_ref(), d);
    let source = read_block(&own, "source", Role::Source, d)?;
    Some(SourceDesign { source, faults })
}

/// Returns true if a world is simulated. The parts of a library contain sensor errors for a simulation. They are not
/// needed in a design that reads its rows from sources and declares neither a trajectory nor a vehicle.
fn is_simulated(root: &Node) -> bool {
    let moves = |simulation: &Node| ["trajectory", "vehicle"].iter().any(|key| simulation.get(key).is_some());
    root.get("simulation").is_some_and(|s| moves(s) || root.get("source").is_none())
}

fn read_simulation(node: &Node, document: &Document, kept: &[String], d: &mut Diagnostics) -> Option<SimulationDesign> {
    let (mut own, root) = (node.clone(), document.root());
    // A sensor that is left out is not simulated either, unless another block reads its stream.
    let is_off = |e: &&Entry| matches!(e.node.get("enabled").map(Node::value), Some(Value::Boolean(false)));
    let off: Vec<&str> = root
        .get("sensor")
        .map_or(&[][..], Node::entries)
        .iter()
        .filter(is_off)
        .map(|e| e.key.as_str())
        .filter(|name| !kept.iter().any(|k| k == name))
        .collect();
    if let Some(sensors) = own.get_mut("sensor") {
        drop(sensors.split_off(&off));
    }
    let truth = Truth::take(&mut own, document, kept, d);
    let mut faults = Vec::new();
    let platforms = node.get("platform").map_or(&[][..], Node::entries);
    for (stream, table) in instruments(platforms.iter().map(|p| p.key.as_str())) {
        let found = table.split('.').try_fold(&mut own, |node, key| node.get_mut(key));
        let Some(table) = found else { continue };
        faults.push((stream, read_faults(table.take("fault").as_ref(), d)));
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
        truth,
    })
}
