//! `fusion check`: what a design resolves to.

use super::{DesignArgs, Failure, print};
use clap::Args;
use fusion::assembly::{Assembly, StreamLayout, assemble, declared_streams};
use fusion::config::{Diagnostic, Diagnostics, Node, Value};
use fusion::core::state::{Dynamics, Kind};
use fusion::design::{Design, Named, SensorDesign};
use fusion::models::block::Listen;
use fusion::models::fault::FaultContext;
use fusion::run::{Options, data_dir, open_one, unknown_reference};
use fusion::source::OpenContext;
use fusion::table::{Table, backend_name, numbers, readable, short};
use fusion::world::{IMU, SimulatedRows};
use std::fmt::Write;
use std::path::Path;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    design: DesignArgs,
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
    let mut text = design.run.description.clone();
    if !text.is_empty() {
        text.push('\n');
    }
    let mut facts = Table::new(&["", ""]);
    facts.row(["backend", &backend_name(&design.filter.backend())]);
    let process = &design.process;
    let source = process
        .block
        .source
        .as_ref()
        .map_or_else(|| "driven by time alone".to_owned(), |s| format!("driven by `{s}`"));
    facts.row(["process", &format!("{}, {source}", type_of(&process.node))]);
    if let Some(o) = design.run.origin {
        let origin = fusion::core::geometry::wgs84::Geodetic::from(o);
        let place = format!(
            "{:.7} deg, {:.7} deg, {} m",
            origin.lat.to_degrees(),
            origin.lon.to_degrees(),
            short(origin.height)
        );
        facts.row(["origin", &place]);
    }
    if design.simulation.is_some() {
        facts.row(["reference", "the simulated truth"]);
    } else if let Some(r) = &design.reference {
        facts.row(["reference", &format!("`{}`", r.block.source)]);
    }
    text += &facts.to_string();
    let sections = [
        (format!("State, {} dimensions", assembly.layout.dim()), state(&assembly)),
        ("Sensors".to_owned(), sensors(&design, &assembly)),
        ("Gates and losses".to_owned(), policies(&design)),
        ("Stages".to_owned(), stages(&design)),
        ("Initialisers".to_owned(), initialisers(&design)),
        ("Streams".to_owned(), streams(&assembly.streams)),
        ("Sources".to_owned(), sources),
        ("Faults".to_owned(), faults(&design)),
    ];
    for (title, table) in sections.iter().filter(|(_, table)| !table.is_empty()) {
        // Writing to a String cannot fail.
        let _ = write!(text, "\n{title}\n{table}");
    }
    print(&text)
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
    let mut t = Table::new(&["block", "type", ">dim", ">initial 1σ", "", "brought by", "moves by"]);
    for b in assembly.layout.blocks() {
        let (factor, unit) = readable(b.unit);
        let scaled = |values: &[f64]| numbers(&values.iter().map(|v| v * factor).collect::<Vec<_>>());
        let is_found = b.sigma.iter().all(|s| *s == 0.0);
        let (sigma, unit) = if is_found {
            ("initialised".to_owned(), String::new())
        } else {
            (scaled(&b.sigma), unit)
        };
        let moves = match &b.dynamics {
            Dynamics::Process => "the process".to_owned(),
            Dynamics::Constant => "nothing".to_owned(),
            Dynamics::RandomWalk { psd } => {
                let density: Vec<f64> = psd.iter().map(|q| q.sqrt()).collect();
                format!("walks {} /√s", scaled(&density))
            }
            Dynamics::GaussMarkov { sigma, tau } => format!("Gauss-Markov {} in {} s", scaled(sigma), short(*tau)),
        };
        t.row([
            b.name.clone(),
            kind(b.kind).to_owned(),
            b.kind.dim().to_string(),
            sigma,
            unit,
            b.owner.clone(),
            moves,
        ]);
    }
    t
}

fn sensors(design: &Design, assembly: &Assembly) -> Table {
    let mut t = Table::new(&["sensor", "type", "source", "channel", ">delay [s]", "noise 1σ"]);
    for (named, info) in design.sensors.iter().zip(&assembly.sensors) {
        let SensorDesign { model, common, .. } = &named.block;
        let channel = info
            .channel
            .as_ref()
            .map_or_else(|| "(a constant)".to_owned(), |c| c.name.to_string());
        let unit = model.noise().first().map(|d| d.kind().symbol).unwrap_or_default();
        let (factor, unit) = readable(unit);
        let mut noise = Vec::new();
        if common.noise.sigma.is_some() {
            let sigma: Vec<f64> = info.sigma.iter().map(|s| s * factor).collect();
            noise.push(format!("{} {unit}", numbers(&sigma)));
        }
        if common.noise.from_source {
            let scale = common.noise.scale.map_or_else(String::new, |s| format!("{} × ", short(s.si())));
            noise.push(format!("{scale}what the source reports"));
        }
        let cells = [
            named.name.clone(),
            type_of(&named.node).to_owned(),
            info.stream.clone(),
            channel,
            short(info.delay),
            noise.join(" and "),
        ];
        t.row(cells);
    }
    t
}

fn policies(design: &Design) -> Table {
    let mut t = Table::new(&["sensor", "", ""]);
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
    let mut t = Table::new(&["stage", "type", "emits", "listens to"]);
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
    let mut t = Table::new(&["initialiser", "type", "listens to", "writes, where the state has it"]);
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
    let mut t = Table::new(&["stream", ">columns", "channels"]);
    for s in streams {
        let channel = |c: &fusion::assembly::StreamChannel| match c.delay {
            0 => format!("{}[{}]", c.name, c.width),
            delay => format!("{}[{}] late by {} s", c.name, c.width, short(delay as f64 * 1e-9)),
        };
        let channels = s.channels.iter().map(channel).collect::<Vec<_>>().join(", ");
        t.row([s.name.clone(), s.width().to_string(), channels]);
    }
    t
}

/// Files with their sizes; those that are there are opened and their headers checked.
fn sources(design: &Design, options: &Options) -> Result<Table, Diagnostics> {
    let mut t = Table::new(&["source", "type", ">size", "file"]);
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
    let mut t = Table::new(&["of", "fault", "what"]);
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
