//! `fusion check`: the resolved form of a design.

use super::fix::AdviceArgs;
use super::observability::{ObservabilityArgs, show};
use super::progress::Trials;
use super::{DesignArgs, Failure, OutputArgs, builtin, print, report};
use clap::Args;
use fusion::assembly::{Assembly, Inside, StreamLayout, assemble, declared_streams};
use fusion::config::{Diagnostic, Diagnostics, Edit, Node, Value};
use fusion::core::state::Dynamics;
use fusion::design::{Design, SensorDesign};
use fusion::examine::{Missing, is_pipe, opening, variants};
use fusion::models::block::Listen;
use fusion::models::units::Dimension;
use fusion::provenance::Provenance;
use fusion::run::{Options, data_dir};
use fusion::world::SimulatedRows;
use fusion_advice::frames::{Judged, judge, units};
use fusion_tables::{Cell, Column, Page, Section, Table, Unit, short};
use std::path::Path;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    design: DesignArgs,
    #[command(flatten)]
    advice: AdviceArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Prints the design as one flat TOML file instead: merges parts, variants and `--set`, and shows for each value
    /// its file and line.
    #[arg(long)]
    resolved: bool,
    #[command(flatten)]
    observability: ObservabilityArgs,
}

pub(super) fn check(args: &CheckArgs) -> Result<(), Failure> {
    if args.observability.observability {
        return show(&args.observability, &args.design, &args.output);
    }
    args.advice.fix.check(&args.design)?;
    let ignored = args.advice.ignored()?;
    let file = args.design.load()?;
    let others = variants(&file, &args.design.selection().names());
    let options = args.design.options();
    let mut d = Diagnostics::new();
    let built = args.design.design(&file, Missing::Excused).and_then(|design| {
        let assembly = assemble(&design, declared_streams(&design)?)?;
        d.extend(opening(&design, &options, Missing::Excused).iter().cloned());
        if let Some(simulation) = &design.simulation {
            SimulatedRows::new(&design, simulation, &assembly, None)?;
        }
        Ok((design, assembly))
    });
    let built = match built {
        Ok(built) => Some(built),
        Err(mistakes) => {
            d.extend(mistakes.iter().cloned());
            None
        }
    };
    d.extend(others.iter().cloned());
    let (design, mut assembly) = match built {
        Some(built) if !d.has_errors() => built,
        _ => return Err(d.into()),
    };
    if args.resolved {
        let origin = args
            .design
            .config
            .as_ref()
            .map_or_else(|| builtin::NAME.to_owned(), |p| p.display().to_string());
        let folder = args.design.base();
        return print(&format!(
            "# {origin}, resolved; relative paths start at `{}`.\n\n{}",
            folder.display(),
            design.document.flat()
        ));
    }
    let unjudged = unjudged(&design, args.design.data.is_some(), &options);
    let mut judged = if unjudged.is_none() && !design.sources.is_empty() {
        let trials = Trials::new();
        judge(&design, &options, &|step| trials.at(step))?
    } else {
        Judged::default()
    };
    judged.mistakes.extend(units(&design).iter().cloned());
    let mut mistakes = Diagnostics::new();
    let applies = |found: &&Diagnostic| found.found_by().is_none_or(|rule| !ignored.has(rule));
    mistakes.extend(judged.mistakes.iter().filter(applies).cloned());
    let mut page = Page {
        title: design.run.description.clone(),
        provenance: Provenance::of(&design, None),
        warnings: Vec::new(),
        sections: vec![
            Section::new("", [facts(&design, &mut assembly, unjudged.as_deref())]),
            Section::new(format!("State, {} dimensions", assembly.layout.dim()), [state(&assembly)]),
            Section::new("Sensors", [sensors(&design, &assembly)]),
            Section::new("Gates and losses", [policies(&design)]),
            Section::new("Stages", [stages(&design, &assembly)]),
            Section::new("Initialisers", [initialisers(&design)]),
            Section::new("Streams", [streams(&assembly.streams)]),
            Section::new("Sources", [sources(&design, &options)]),
            Section::new("Faults", [faults(&design)]),
            Section::new("Trajectory", [trajectory(&design)]),
            Section::new("Frames, judged by the data", [frames(&judged)]),
        ],
    };
    let edits: Vec<Edit> = mistakes.iter().flat_map(|found| found.corrections().to_vec()).collect();
    page.sections.extend(args.advice.fix.write(&args.design, &edits)?);
    args.output.print(&page)?;
    report(&mistakes);
    Ok(())
}

/// Why the frames of recorded data are not checked; `None` if they are checked, and if there are no recorded data.
fn unjudged(design: &Design, has_data: bool, options: &Options) -> Option<String> {
    if design.simulation.is_some() || design.sources.is_empty() {
        return None;
    }
    let dir = data_dir(design, options);
    if !has_data {
        let own = design.run.data_dir.as_ref().map(|_| dir.display().to_string());
        return Some(format!(
            "not judged: with `--data {}` the recorded channels are compared with each other",
            own.as_deref().unwrap_or("DIR")
        ));
    }
    let mut files = design
        .sources
        .iter()
        .flat_map(|named| named.block.source.files())
        .map(|file| dir.join(file));
    let unread = files.find(|path| !path.exists() || is_pipe(path))?;
    let why = if unread.exists() { "is a pipe" } else { "is not there" };
    Some(format!("not judged: `{}` {why}", unread.display()))
}

/// The beginning and end of each segment of the simulated trajectory. Empty for a controlled vehicle: only its run
/// gives the times.
fn trajectory(design: &Design) -> Table {
    let second = || Unit::of_si("s");
    let mut t = Table::new([
        Column::number("segment"),
        Column::text("type"),
        Column::with_unit("from", second()),
        Column::with_unit("to", second()),
    ]);
    let Some(simulation) = design.simulation.as_ref().filter(|s| s.node.get("vehicle").is_none()) else {
        return t;
    };
    // Its mistakes were reported before.
    let Ok(trajectory) = simulation.block.world.trajectory() else {
        return t;
    };
    let starts: Vec<f64> = trajectory.starts().collect();
    let ends = starts.iter().copied().skip(1).chain([trajectory.duration()]);
    for (number, (from, to)) in starts.iter().zip(ends).enumerate() {
        let segment = simulation.node.at(&format!("trajectory.{number}"));
        t.row([
            Cell::from(number + 1),
            Cell::text(segment.map_or("?", type_of)),
            Cell::Real(*from),
            Cell::Real(to),
        ]);
    }
    t
}

/// The comparisons of channels, and their results.
fn frames(judged: &Judged) -> Table {
    let [what, with, verdict] = words(["declared", "compared with", "the data say"]);
    let mut t = Table::new([what, with, Column::number("samples"), Column::text("correlation"), verdict]);
    for c in &judged.comparisons {
        let correlation: Vec<String> = c.correlation.iter().map(|r| format!("{r:.2}")).collect();
        t.row([
            Cell::text(&c.what),
            Cell::text(&c.with),
            if c.samples == 0 { Cell::Empty } else { Cell::from(c.samples) },
            Cell::text(correlation.join(", ")),
            Cell::text(&c.verdict),
        ]);
    }
    t
}

fn facts(design: &Design, assembly: &mut Assembly, unjudged: Option<&str>) -> Table {
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
    if let Some(needs) = assembly.runner.rewind_needs() {
        let (count, each) = (needs.snapshots, needs.snapshot_bytes as f64 * 1e-3);
        let all = count as f64 * each;
        t.row(["late rows", &format!("the filter goes back up to {} s", short(needs.deepest))]);
        t.row([
            "",
            &format!(
                "{count} snapshots of {} kB, {} kB, and the rows of that time",
                short(each.round()),
                short(all.round())
            ),
        ]);
        t.row(["", &format!("one late row replays {} s of data at most", short(needs.replay))]);
    }
    let held_back = assembly.runner.lag();
    // Less than a millisecond is rounding of times.
    if assembly.runner.rewind_needs().is_none() && held_back > 1e-3 {
        let age = format!(
            "every row is held back for {} s: so old is the estimate that a vehicle has",
            short(held_back)
        );
        t.row(["late rows", &age]);
    }
    if design.simulation.is_some() {
        t.row(["reference", "the simulated truth"]);
    } else if let Some(r) = &design.reference {
        t.row(["reference", &r.block.source.to_string()]);
    }
    if let Some(why) = unjudged {
        t.row(["frames", why]);
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

/// A declaration in one line: its type, then its fields as written.
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
            Dynamics::Integral { rate, .. } => format!("integral of {rate}"),
            Dynamics::GaussMarkov { sigma, tau } => format!("Gauss-Markov {} in {} s", unit.list(sigma), short(*tau)),
        };
        t.row([
            Cell::text(&b.name),
            Cell::text(b.kind.name()),
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
    for info in &assembly.sensors {
        let named = &design.sensors[info.design];
        let SensorDesign { common, .. } = &named.block;
        let channel = match &info.channels[..] {
            [] => "(a constant)".to_owned(),
            channels => channels.iter().map(|c| &*c.name).collect::<Vec<_>>().join(", "),
        };
        let mut noise = Vec::new();
        if common.noise.sigma.is_some() {
            noise.push(listed(&info.sigma, &info.rows));
        }
        if common.noise.from_source {
            let scale = common.noise.scale.map_or_else(String::new, |s| format!("{} × ", short(s.si())));
            noise.push(format!("{scale}what the source reports"));
        }
        t.row([
            Cell::text(&info.name),
            Cell::text(type_of(&named.node)),
            Cell::text(&info.stream),
            Cell::text(channel),
            Cell::text(short(info.delay)),
            Cell::text(noise.join(" and ")),
        ]);
    }
    t
}

/// 1σ per row; equal rows share one unit.
fn listed(sigma: &[f64], rows: &[Dimension]) -> String {
    let unit = |d: &Dimension| Unit::of_si(d.kind().symbol);
    match rows {
        [first, others @ ..] if others.iter().any(|d| d != first) => {
            let each = sigma.iter().zip(rows).map(|(sigma, d)| unit(d).list(&[*sigma]));
            each.collect::<Vec<_>>().join(", ")
        }
        _ => rows.first().map_or_else(String::new, |d| unit(d).list(sigma)),
    }
}

fn policies(design: &Design) -> Table {
    let mut t = Table::new(words(["sensor", "policy", "declared"]));
    for named in &design.sensors {
        for key in ["gate", "loss"] {
            if let Some(node) = named.node.get(key) {
                t.row([named.name.as_str(), key, &inline(node)]);
            }
        }
        if let Some(leader) = named.block.common.only_with.as_ref().map(|o| &o.sensor) {
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

fn stages(design: &Design, assembly: &Assembly) -> Table {
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
    add_filters(&mut t, "", &assembly.filters);
    t
}

/// The filters inside stages: their states, and the rows that their sensors read.
fn add_filters(t: &mut Table, around: &str, filters: &[Inside]) {
    for filter in filters {
        let name = format!("{around}{}", filter.name);
        let states: Vec<&str> = filter.layout.blocks().iter().map(|b| b.name.as_str()).collect();
        let sensors: Vec<String> = filter.sensors.iter().map(|s| format!("{} ({})", s.name, s.stream)).collect();
        t.row([
            name.clone(),
            format!("filter, {} dimensions", filter.layout.dim()),
            states.join(", "),
            sensors.join(", "),
        ]);
        add_filters(t, &format!("{name}."), &filter.filters);
    }
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

/// Files with their sizes.
fn sources(design: &Design, options: &Options) -> Table {
    let mut t = Table::new(words(["source", "type", "size", "file"]));
    let dir = data_dir(design, options);
    for named in &design.sources {
        for file in &named.block.source.files() {
            let path = dir.join(file);
            t.row([
                named.name.clone(),
                type_of(&named.node).to_owned(),
                if design.simulation.is_some() {
                    "not read: [simulation] takes its place".to_owned()
                } else {
                    size(&path)
                },
                path.display().to_string(),
            ]);
        }
    }
    t
}

fn size(path: &Path) -> String {
    match std::fs::metadata(path).map(|m| m.len()) {
        Err(_) => "not found".to_owned(),
        Ok(_) if is_pipe(path) => "a pipe".to_owned(),
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
    let own = design.simulation.as_ref().map(|s| s.block.world.instruments());
    for (stream, table) in own.into_iter().flatten() {
        if let Some(table) = simulation.and_then(|s| s.at(&table)) {
            add(table, &stream);
        }
    }
    if let Some(sensors) = simulation.and_then(|s| s.get("sensor")) {
        sensors.entries().iter().for_each(|e| add(&e.node, &e.key));
    }
    t
}
