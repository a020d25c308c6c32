//! `fusion check`: what a design resolves to.

use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::assembly::{Assembly, StreamLayout, assemble, declared_streams};
use fusion::config::{Diagnostic, Diagnostics, Node, Value};
use fusion::core::state::{Dynamics, Kind};
use fusion::design::{Design, Named, SensorDesign};
use fusion::models::block::Listen;
use fusion::models::fault::FaultContext;
use fusion::present::{Cell, Column, Page, Section, Table, Unit, short};
use fusion::run::{Options, data_dir, open_one, unknown_reference};
use fusion::source::OpenContext;
use fusion::world::{IMU, SimulatedRows};
use std::path::Path;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    design: DesignArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn check(args: &CheckArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        ..Options::default()
    };
    let assembly = assemble(&design, declared_streams(&design)?)?;
    let sources = sources(&design, &options)?;
    if let Some(simulation) = &design.simulation {
        SimulatedRows::new(&design, simulation, &assembly, None)?;
    }
    let page = Page {
        title: design.run.description.clone(),
        warnings: Vec::new(),
        sections: vec![
            Section::new("", [facts(&design)]),
            Section::new(format!("State, {} dimensions", assembly.layout.dim()), [state(&assembly)]),
            Section::new("Sensors", [sensors(&design, &assembly)]),
            Section::new("Gates and losses", [policies(&design)]),
            Section::new("Stages", [stages(&design)]),
            Section::new("Initialisers", [initialisers(&design)]),
            Section::new("Streams", [streams(&assembly.streams)]),
            Section::new("Sources", [sources]),
            Section::new("Faults", [faults(&design)]),
        ],
    };
    args.output.print(&page)
}

fn facts(design: &Design) -> Table {
    let mut t = Table::list();
    t.row(["backend", &design.filter.backend_name()]);
    let process = &design.process;
    let source = process.block.source.as_ref();
    let source = source.map_or_else(|| "driven by time alone".to_owned(), |s| format!("driven by `{s}`"));
    t.row(["process", &format!("{}, {source}", type_of(&process.node))]);
    if let Some(o) = design.run.origin {
        let origin = fusion::core::geometry::wgs84::Geodetic::from(o);
        let (lat, lon) = (origin.lat.to_degrees(), origin.lon.to_degrees());
        t.row(["origin", &format!("{lat:.7} deg, {lon:.7} deg, {} m", short(origin.height))]);
    }
    if design.simulation.is_some() {
        t.row(["reference", "the simulated truth"]);
    } else if let Some(r) = &design.reference {
        t.row(["reference", &format!("`{}`", r.block.source)]);
    }
    t
}

/// Columns of words with these headings.
fn words<const N: usize>(headings: [&str; N]) -> [Column; N] {
    headings.map(Column::text)
}

fn type_of(node: &Node) -> &str {
    node.as_str().or_else(|| node.get("type")?.as_str()).unwrap_or("?")
}

/// A declaration in a line: its type, then its fields as written.
fn inline(node: &Node) -> String {
    let fields = node
        .entries()
        .iter()
        .filter(|e| e.key != "type")
        .map(|e| format!("{} {}", e.key, value(&e.node)));
    [type_of(node).to_owned()].into_iter().chain(fields).collect::<Vec<_>>().join(", ")
}

fn value(node: &Node) -> String {
    match node.value() {
        Value::String(text) => text.clone(),
        Value::Integer(n) => n.to_string(),
        Value::Float(x) => short(*x),
        Value::Boolean(b) => b.to_string(),
        Value::Datetime(t) => t.to_string(),
        Value::Array(items) => format!("[{}]", items.iter().map(value).collect::<Vec<_>>().join(", ")),
        Value::Table { entries, .. } => {
            format!(
                "({})",
                entries
                    .iter()
                    .map(|e| format!("{} {}", e.key, value(&e.node)))
                    .collect::<Vec<_>>()
                    .join(", ")
            )
        }
    }
}

const fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Geodetic => "geodetic",
        Kind::Position => "position",
        Kind::Velocity => "velocity",
        Kind::Attitude => "attitude",
        Kind::Scalar => "scalar",
        Kind::Angle => "angle",
        Kind::Vector(_) => "vector",
    }
}

fn state(assembly: &Assembly) -> Table {
    let mut t = Table::new([
        Column::text("block"),
        Column::text("type"),
        Column::number("dim"),
        Column::text("initial 1σ"),
        Column::text("brought by"),
        Column::text("moves by"),
    ]);
    for b in assembly.layout.blocks() {
        let unit = Unit::of_si(b.unit);
        let is_found = b.sigma.iter().all(|s| *s == 0.0);
        let sigma = if is_found { "initialised".to_owned() } else { unit.list(&b.sigma) };
        let moves = match &b.dynamics {
            Dynamics::Process => "the process".to_owned(),
            Dynamics::Constant => "nothing".to_owned(),
            Dynamics::RandomWalk { psd } => {
                let density: Vec<f64> = psd.iter().map(|q| q.sqrt()).collect();
                format!("random walk {}/√s", unit.list(&density))
            }
            Dynamics::GaussMarkov { sigma, tau } => format!("Gauss-Markov {} in {} s", unit.list(sigma), short(*tau)),
        };
        t.row([
            Cell::text(&b.name),
            Cell::text(kind(b.kind)),
            Cell::from(b.kind.dim()),
            Cell::text(sigma),
            Cell::text(&b.owner),
            Cell::text(moves),
        ]);
    }
    t
}

fn sensors(design: &Design, assembly: &Assembly) -> Table {
    let [sensor, kind, source, channel, noise] = words(["sensor", "type", "source", "channel", "noise 1σ"]);
    let delay = Column::with_unit("delay", Unit::of_si("s"));
    let mut t = Table::new([sensor, kind, source, channel, delay, noise]);
    for (named, info) in design.sensors.iter().zip(&assembly.sensors) {
        let SensorDesign { model, common, .. } = &named.block;
        let channel = info
            .channel
            .as_ref()
            .map_or_else(|| "(a constant)".to_owned(), |c| c.name.to_string());
        let unit = model.noise().first().map(|d| d.kind().symbol).unwrap_or_default();
        let mut noise = Vec::new();
        if common.noise.sigma.is_some() {
            noise.push(Unit::of_si(unit).list(&info.sigma));
        }
        if common.noise.from_source {
            let scale = common.noise.scale.map_or_else(String::new, |s| format!("{} × ", short(s.si())));
            noise.push(format!("{scale}what the source reports"));
        }
        t.row([
            Cell::text(&named.name),
            Cell::text(type_of(&named.node)),
            Cell::text(&info.stream),
            Cell::text(channel),
            Cell::text(short(info.delay)),
            Cell::text(noise.join(" and ")),
        ]);
    }
    t
}

fn policies(design: &Design) -> Table {
    let mut t = Table::new(words(["sensor", "policy", "declared"]));
    for named in &design.sensors {
        for key in ["gate", "loss"] {
            if let Some(node) = named.node.get(key) {
                t.row([named.name.as_str(), key, &inline(node)]);
            }
        }
        if let Some(leader) = &named.block.common.only_with {
            let is_there = design.sensors.iter().any(|s| s.name == *leader);
            let effect = if is_there { "" } else { ", which is left out: no effect" };
            t.row([named.name.as_str(), "only with", &format!("{leader}{effect}")]);
        }
    }
    t
}

fn heard(inputs: &[Listen]) -> String {
    let one = |l: &Listen| match &l.channels[..] {
        [] => format!("rows of {}", l.source),
        all => all
            .iter()
            .map(|c| format!("{}.{}", l.source, c.name))
            .collect::<Vec<_>>()
            .join(", "),
    };
    if inputs.is_empty() {
        "nothing".to_owned()
    } else {
        inputs.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

fn stages(design: &Design) -> Table {
    let mut t = Table::new(words(["stage", "type", "emits", "listens to"]));
    for stage in &design.stages {
        let emits = stage
            .block
            .output()
            .iter()
            .map(|c| c.name.to_string())
            .collect::<Vec<_>>()
            .join(", ");
        let emits = if emits.is_empty() { "ticks".to_owned() } else { emits };
        t.row([
            stage.name.clone(),
            type_of(&stage.node).to_owned(),
            emits,
            heard(&stage.block.inputs()),
        ]);
    }
    t
}

fn initialisers(design: &Design) -> Table {
    let mut t = Table::new(words(["initialiser", "type", "listens to", "writes, where the state has it"]));
    for i in &design.initialisers {
        t.row([
            i.name.clone(),
            type_of(&i.node).to_owned(),
            heard(&i.block.inputs()),
            i.block.writes().join(", "),
        ]);
    }
    t
}

fn streams(streams: &[StreamLayout]) -> Table {
    let mut t = Table::new([Column::text("stream"), Column::number("columns"), Column::text("channels")]);
    for s in streams {
        let channel = |c: &fusion::assembly::StreamChannel| match c.delay {
            0 => format!("{}[{}]", c.name, c.width),
            delay => format!("{}[{}] late by {} s", c.name, c.width, short(delay as f64 * 1e-9)),
        };
        let channels = s.channels.iter().map(channel).collect::<Vec<_>>().join(", ");
        t.row([Cell::text(&s.name), Cell::from(s.width()), Cell::text(channels)]);
    }
    t
}

/// Files with their sizes; those that are there are opened and their headers checked.
fn sources(design: &Design, options: &Options) -> Result<Table, Diagnostics> {
    let mut t = Table::new(words(["source", "type", "size", "file"]));
    let mut d = Diagnostics::new();
    let dir = data_dir(design, options);
    for named in &design.sources {
        let context = OpenContext {
            data_dir: dir.clone(),
            name: named.name.clone(),
            origin: design.run.origin.map(Into::into),
            seed: design.run.seed,
        };
        let files = named.block.source.files();
        let missing = files.iter().any(|f| !context.resolve(f).exists());
        for file in &files {
            let path = context.resolve(file);
            t.row([
                named.name.clone(),
                type_of(&named.node).to_owned(),
                size(&path),
                path.display().to_string(),
            ]);
        }
        if missing {
            check_faults(named, &context, &mut d);
        } else {
            if let Err(e) = open_one(&named.block, &context) {
                d.extend(e.diagnostics(&named.node));
            }
        }
    }
    let recorded = design.reference.as_ref().filter(|_| design.simulation.is_none());
    if let Some(r) = recorded.filter(|r| !design.sources.iter().any(|s| s.name == r.block.source)) {
        d.push(unknown_reference(design, r));
    }
    d.unless_errors(t)
}

/// Faults against the declared channels: what can be said without the file.
fn check_faults(named: &Named<fusion::design::SourceDesign>, context: &OpenContext, d: &mut Diagnostics) {
    let Ok(channels) = named.block.source.channels() else { return };
    for (name, fault) in &named.block.faults {
        let seed = context.fault_seed(name);
        if let Err(e) = fault.build(&FaultContext { channels: &channels, seed }) {
            let path = format!("fault.{name}.{}", e.field);
            let wrong = Diagnostic::error(&e.message).at(named.node.place_of(path.trim_end_matches('.')));
            d.push(if let Some(help) = &e.help { wrong.help(help) } else { wrong });
        }
    }
}

fn size(path: &Path) -> String {
    match std::fs::metadata(path).map(|m| m.len()) {
        Err(_) => "not found".to_owned(),
        Ok(bytes) if bytes < 10_000 => format!("{bytes} B"),
        Ok(bytes) if bytes < 10_000_000 => format!("{} kB", bytes / 1000),
        Ok(bytes) => format!("{} MB", bytes / 1_000_000),
    }
}

fn faults(design: &Design) -> Table {
    let mut t = Table::new(words(["of", "fault", "declared"]));
    let mut add = |owner: &Node, of: &str| {
        for e in owner.get("fault").map_or(&[][..], Node::entries) {
            t.row([of.to_owned(), e.key.clone(), inline(&e.node)]);
        }
    };
    for named in &design.sources {
        add(&named.node, &named.name);
    }
    let simulation = design.simulation.as_ref().map(|s| &s.node);
    if let Some(imu) = simulation.and_then(|s| s.get(IMU)) {
        add(imu, IMU);
    }
    if let Some(sensors) = simulation.and_then(|s| s.get("sensor")) {
        sensors.entries().iter().for_each(|e| add(&e.node, &e.key));
    }
    t
}
