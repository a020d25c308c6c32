//! A simulated world as a log: a file for each of its streams, and the design that reads them.
//!
//! Names    a stream has the name of the source that its sensor reads; where several sensors read one source, the
//!          first has its name, and the others have those of the sensors
//! Numbers  in full precision, so that the filter gives the same results from the log as in simulation; latitude
//!          and longitude in degrees, all else in SI, units in the headers
//! Steered  a vehicle that the filter steers follows the commands of the filter over the same rows

use super::{REFERENCE, SimulatedRows, pilot};
use crate::assembly::{StreamChannel, StreamLayout, assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::Design;
use crate::output::Unwritable;
use crate::rows::{Aboard, Nobody};
use fusion_core::time::Time;
use fusion_models::block::{Listen, Shape};
use fusion_models::vocabulary::channel as known;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// The name of the design that reads a log.
pub const LOG_DESIGN: &str = "design.toml";

/// A stream of a written log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoggedStream {
    /// The source in the design.
    pub source: String,
    /// Its file.
    pub path: PathBuf,
    /// Rows in it.
    pub rows: u64,
}

/// Writes the rows of `design`'s simulated world into `folder`, a file for each stream, and [`LOG_DESIGN`] there, which
/// reads them; `seed` replaces that of the design.
///
/// # Errors
/// A design without a simulated world; mistakes of the world, and of the filter if it steers; a row with a number that
/// is not finite; a file that cannot be written.
pub fn record(design: &Design, folder: &Path, seed: Option<u64>) -> Result<Vec<LoggedStream>, Diagnostics> {
    let Some(simulation) = &design.simulation else {
        let help = "it has a log already: `[simulation]` declares a world";
        let message = "this design has no simulated world to record";
        return Err(Diagnostic::error(message).at(design.document.root().place()).help(help).into());
    };
    let streams = declared_streams(design)?;
    let names = names(&streams);
    let text = reading(design, &streams, &names)?;
    let assembly = assemble(design, streams.clone())?;
    let mut rows = SimulatedRows::new(design, simulation, &assembly, seed)?;
    let mut pilot = pilot::aboard(design, simulation, seed)?;
    std::fs::create_dir_all(folder).map_err(|e| Unwritable::new(folder, e))?;
    let created = names.iter().zip(&streams).map(|(name, stream)| Log::create(folder, name, stream));
    let mut logs: Vec<Log<'_>> = created.collect::<Result<_, _>>()?;
    let log_of = |stream: &StreamLayout| streams.iter().position(|s| s.name == stream.name);
    let log_of: Vec<Option<usize>> = assembly.streams.iter().map(log_of).collect();
    loop {
        let aboard: &mut dyn Aboard = match &mut pilot {
            Some(pilot) => pilot,
            None => &mut Nobody,
        };
        let Some(row) = rows.next(aboard) else { break };
        if let Some(log) = log_of[row.stream] {
            logs[log].write(row.time, row.values)?;
        }
        if let Some(pilot) = &mut pilot {
            pilot::hear(pilot, &row).map_err(|e| Diagnostic::error(format!("the filter, which steers the vehicle: {e}")))?;
        }
    }
    let written = logs.into_iter().map(Log::finish).collect::<Result<_, _>>()?;
    let path = folder.join(LOG_DESIGN);
    std::fs::write(&path, text).map_err(|e| Unwritable::new(&path, e))?;
    Ok(written)
}

/// The name of each stream as a source.
fn names(streams: &[StreamLayout]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for stream in streams {
        let alias = stream.alias.as_ref().filter(|alias| {
            let is_stream = streams.iter().any(|other| other.name == **alias);
            !is_stream && !names.contains(alias)
        });
        names.push(alias.unwrap_or(&stream.name).clone());
    }
    names
}

/// A file that is being written.
#[derive(Debug)]
struct Log<'a> {
    stream: &'a StreamLayout,
    file: BufWriter<File>,
    line: String,
    logged: LoggedStream,
}

impl<'a> Log<'a> {
    fn create(folder: &Path, name: &str, stream: &'a StreamLayout) -> Result<Self, Unwritable> {
        let path = folder.join(format!("{name}.csv"));
        let file = File::create(&path).map_err(|e| Unwritable::new(&path, e))?;
        let columns: Vec<String> = stream.channels.iter().flat_map(columns).collect();
        let mut log = Self {
            stream,
            file: BufWriter::new(file),
            line: format!("{TIME},{}\n", columns.join(",")),
            logged: LoggedStream {
                source: name.to_owned(),
                path,
                rows: 0,
            },
        };
        log.put()?;
        Ok(log)
    }

    fn put(&mut self) -> Result<(), Unwritable> {
        let written = self.file.write_all(self.line.as_bytes());
        written.map_err(|e| Unwritable::new(&self.logged.path, e))
    }

    fn write(&mut self, time: Time, values: &[f64]) -> Result<(), Diagnostics> {
        let nanos = time.nanos();
        let (sign, size) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
        self.line.clear();
        let _ = write!(self.line, "{sign}{}.{:09}", size / 1_000_000_000, size % 1_000_000_000);
        for channel in &self.stream.channels {
            for (i, value) in values[channel.offset..channel.offset + channel.width].iter().enumerate() {
                if !value.is_finite() {
                    let message = format!("`{}` has a row without a number at {} s", self.logged.source, time.seconds());
                    return Err(Diagnostic::error(message).help("remove the fault that takes it away").into());
                }
                let in_degrees = channel.shape == Shape::Geodetic && i < 2;
                let _ = write!(self.line, ",{}", if in_degrees { value.to_degrees() } else { *value });
            }
        }
        self.line.push('\n');
        self.logged.rows += 1;
        Ok(self.put()?)
    }

    fn finish(mut self) -> Result<LoggedStream, Unwritable> {
        self.file.flush().map_err(|e| Unwritable::new(&self.logged.path, e))?;
        Ok(self.logged)
    }
}

/// The column of stamps.
const TIME: &str = "time [s]";

/// The columns of a channel.
fn columns(channel: &StreamChannel) -> Vec<String> {
    let name = &channel.name;
    let unit = channel.dimension;
    let parts = |parts: &[&str]| parts.iter().map(|part| format!("{name}_{part} [{unit}]")).collect();
    match (channel.shape, channel.width) {
        (Shape::Geodetic, _) => ["latitude [deg]", "longitude [deg]", "height [m]"]
            .map(|part| format!("{name}_{part}"))
            .into(),
        (Shape::Quaternion, _) => ["w", "x", "y", "z"].map(|part| format!("{name}_{part}")).into(),
        (_, 1) => vec![format!("{name} [{unit}]")],
        (_, 3) if *name == known::VELOCITY.name => parts(&["north", "east", "down"]),
        (_, 3) => parts(&["x", "y", "z"]),
        (_, width) => (1..=width).map(|i| format!("{name}_{i} [{unit}]")).collect(),
    }
}

/// The declaration of a channel in its source.
fn declaration(channel: &StreamChannel) -> String {
    let columns: Vec<String> = columns(channel).iter().map(|column| format!("\"{column}\"")).collect();
    match (channel.shape, &columns[..]) {
        (Shape::Geodetic, [latitude, longitude, height]) => {
            format!("{{ latitude = {latitude}, longitude = {longitude}, height = {height}, unit = \"deg\" }}")
        }
        (Shape::Quaternion, columns) => format!("{{ quaternion = [{}] }}", columns.join(", ")),
        (_, [column]) => format!("{{ column = {column}, unit = \"{}\" }}", channel.dimension),
        (_, columns) => format!("{{ columns = [{}], unit = \"{}\" }}", columns.join(", "), channel.dimension),
    }
}

/// The design without its world, and with sources that read the log.
fn reading(design: &Design, streams: &[StreamLayout], names: &[String]) -> Result<String, Diagnostics> {
    let mut document = design.document.clone();
    for table in ["simulation", "source"] {
        document.remove(table);
    }
    // Those that served only sensors that are left out.
    let kept = |stage: &str| design.stages.iter().any(|s| s.name == stage) || design.filters.iter().any(|f| f.name == stage);
    let stages = design.document.root().get("stage").map_or(&[][..], Node::entries);
    for stage in stages.iter().filter(|stage| !kept(&stage.key)) {
        document.set(&format!("stage.{}.enabled=false", stage.key))?;
    }
    for (path, name) in renamed(design, streams, names) {
        document.set(&format!("{path}=\"{name}\""))?;
    }
    let has_reference = document.root().get("reference").is_some();
    let mut text = format!("# Reads a log that was written by `fusion record`.\n\n{}", document.flat());
    for (name, stream) in names.iter().zip(streams) {
        let _ = write!(
            text,
            "\n[source.{name}]\ntype = \"csv\"\npath = \"{name}.csv\"\ntime = {{ column = \"{TIME}\", unit = \"s\" }}\n[source.{name}.channels]\n"
        );
        for channel in &stream.channels {
            let _ = writeln!(text, "{} = {}", channel.name, declaration(channel));
        }
    }
    if !has_reference {
        let _ = write!(text, "\n[reference]\nsource = \"{REFERENCE}\"\n");
    }
    Ok(text)
}

/// The paths at which the design names a source that has another name in the log, with that name.
fn renamed<'a>(design: &Design, streams: &[StreamLayout], names: &'a [String]) -> Vec<(String, &'a str)> {
    let mut renamed = Vec::new();
    for sensor in &design.sensors {
        let stream = streams
            .iter()
            .position(|stream| stream.name == sensor.name && stream.alias.is_some());
        let name = stream.map(|stream| names[stream].as_str());
        let path = || format!("sensor.{}.source", sensor.name);
        renamed.extend(name.filter(|name| *name != sensor.block.common.source).map(|name| (path(), name)));
    }
    let stages = design
        .stages
        .iter()
        .map(|s| (format!("stage.{}", s.name), &s.node, s.block.inputs()));
    let initialisers = design
        .initialisers
        .iter()
        .map(|i| (format!("initial.{}", i.name), &i.node, i.block.inputs()));
    for (path, node, inputs) in stages.chain(initialisers) {
        for Listen { source, channels } in inputs {
            // As in simulation: the first stream of this source that has the channels.
            let has = |stream: &StreamLayout| channels.iter().all(|wanted| stream.channels.iter().any(|c| c.name == wanted.name));
            let stream = streams
                .iter()
                .position(|stream| stream.alias.as_deref() == Some(&source) && has(stream));
            if let Some(name) = stream.map(|stream| names[stream].as_str()).filter(|name| *name != source) {
                let mut paths = Vec::new();
                mentions(&path, node, &source, &mut paths);
                renamed.extend(paths.into_iter().map(|path| (path, name)));
            }
        }
    }
    renamed
}

/// Adds the paths at which `node`, the table at `path`, has this text.
fn mentions(path: &str, node: &Node, text: &str, out: &mut Vec<String>) {
    if node.as_str() == Some(text) {
        out.push(path.to_owned());
    }
    for entry in node.entries().iter().filter(|entry| entry.key != "type") {
        mentions(&format!("{path}.{}", entry.key), &entry.node, text, out);
    }
}
