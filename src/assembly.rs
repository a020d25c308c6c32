//! From a design to a runner: the layout is laid out, streams are connected, numbers are resolved.

use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Named, SensorDesign};
use fusion_core::filter::{Estimator, Filter};
use fusion_core::gate::Open;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::loss::Quadratic;
use fusion_core::model::{Measurement, Process, Size};
use fusion_core::runner::{InitialiserUnit, Noise, Port, Runner, Sensor, StageUnit, StreamId};
use fusion_core::state::{Block, Dynamics, Layout, LayoutBuilder};
use fusion_core::time::nanos;
use fusion_models::block::{Build, BuildError, Channel, Listen, Reading, Shape, check_delay};
use fusion_models::earth::Gravity;
use fusion_models::fault::ProvidedChannel;
use fusion_models::units::Dimension;
use std::sync::Arc;

/// A named group of numbers in the rows of a stream, where it lies.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamChannel {
    /// Its name.
    pub name: String,
    /// Its first number in a row.
    pub offset: usize,
    /// How many numbers.
    pub width: usize,
    /// Their dimension, where they have one.
    pub dimension: Dimension,
    /// What they are.
    pub shape: Shape,
    /// Valid this many nanoseconds before the stamp.
    pub delay: i64,
}

/// A stream with its channels.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamLayout {
    /// Its name.
    pub name: String,
    /// The source that its sensor names, where a simulated sensor has a stream of its own.
    pub alias: Option<String>,
    /// Its channels, in order.
    pub channels: Vec<StreamChannel>,
    /// Whether the channels are known, or taken from what consumers ask for.
    pub declared: bool,
}

impl StreamLayout {
    /// Numbers in a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.channels.iter().map(|c| c.offset + c.width).max().unwrap_or(0)
    }

    /// Of a source that provides these channels.
    #[must_use]
    pub fn provided(name: &str, channels: &[ProvidedChannel]) -> Self {
        let channels = channels.iter().map(|p| StreamChannel {
            name: p.channel.name.to_string(),
            offset: p.offset,
            width: p.channel.width,
            dimension: p.channel.dimension,
            shape: p.channel.shape,
            delay: p.delay_ns,
        });
        Self {
            name: name.to_owned(),
            alias: None,
            channels: channels.collect(),
            declared: true,
        }
    }

    /// With these channels one after the other.
    #[must_use]
    pub fn of(name: &str, alias: Option<&str>, channels: &[Channel]) -> Self {
        let mut layout = Self {
            name: name.to_owned(),
            alias: alias.map(str::to_owned),
            channels: Vec::new(),
            declared: true,
        };
        channels.iter().for_each(|c| layout.append(c));
        layout
    }

    fn has(&self, channel: &Channel) -> bool {
        self.channels.iter().any(|c| c.name == channel.name)
    }

    fn append(&mut self, channel: &Channel) {
        let offset = self.width();
        self.channels.push(StreamChannel {
            name: channel.name.to_string(),
            offset,
            width: channel.width,
            dimension: channel.dimension,
            shape: channel.shape,
            delay: 0,
        });
    }
}

/// The streams that the sources of a design, or its simulated world, provide.
///
/// # Errors
/// Mistakes in the declaration of a source.
pub fn declared_streams(design: &Design) -> Result<Vec<StreamLayout>, Diagnostics> {
    if let Some(simulation) = &design.simulation {
        return Ok(crate::world::streams(design, &simulation.block));
    }
    let mut d = Diagnostics::new();
    let mut streams = Vec::new();
    for named in &design.sources {
        match named.block.source.channels() {
            Ok(channels) => streams.push(StreamLayout::provided(&named.name, &channels)),
            Err(errors) => errors.iter().for_each(|e| d.push(located(&named.node, e))),
        }
    }
    d.unless_errors(streams)
}

/// A design, built.
#[derive(Debug)]
pub struct Assembly {
    /// Drives the filter.
    pub runner: Runner,
    /// The state layout.
    pub layout: Arc<Layout>,
    /// The process model.
    pub process: Arc<dyn Process>,
    /// The sensors' models, in order of their numbers, with what they read.
    pub sensors: Vec<SensorInfo>,
    /// All streams, in order of their numbers.
    pub streams: Vec<StreamLayout>,
    /// The gravity model of the process.
    pub gravity: Gravity,
}

/// What is known of a sensor besides its runtime model.
#[derive(Debug)]
pub struct SensorInfo {
    /// Its name.
    pub name: String,
    /// Its model.
    pub model: Arc<dyn Measurement>,
    /// The stream that it reads or that times it.
    pub stream: String,
    /// Its channel; none for a pseudo-measurement.
    pub channel: Option<Channel>,
    /// Its declared delay \[s\].
    pub delay: f64,
    /// Declared 1σ per residual row; empty where only the source reports it.
    pub sigma: Vec<f64>,
    /// Dimension of each residual row.
    pub rows: Vec<Dimension>,
    /// Name of each residual row; empty where they have none.
    pub axes: &'static [&'static str],
}

/// Builds `design` over streams whose channels are known; streams nobody declares take the
/// channels their consumers ask for, in the order of the file.
///
/// # Errors
/// Every mistake found.
pub fn assemble(design: &Design, declared: Vec<StreamLayout>) -> Result<Assembly, Diagnostics> {
    let mut a = Assembler {
        design,
        streams: declared,
        d: Diagnostics::new(),
    };
    let mut layout = LayoutBuilder::new();
    let origin = design.run.origin.map(Geodetic::from);
    let mut gravity = Gravity::default();
    let process = a.build(&design.process, &mut layout, origin, &mut gravity, |p, b| p.model.build(b));
    let Some(process) = process else { return Err(a.d) };
    let mut models = Vec::new();
    for sensor in &design.sensors {
        models.push(a.build(sensor, &mut layout, origin, &mut gravity, |s, b| s.model.build(b)));
    }
    for stage in &design.stages {
        a.add_stage_stream(stage);
    }
    let process: Arc<dyn Process> = process.into();
    let mut parts = Parts {
        input: a.input_port(),
        ..Parts::default()
    };
    for (sensor, model) in design.sensors.iter().zip(models) {
        if let Some((sensor, info)) = model.and_then(|m| a.sensor(sensor, m.into())) {
            parts.sensors.push(sensor);
            parts.infos.push(info);
        }
    }
    for sensor in &design.sensors {
        a.link(sensor, &mut parts.sensors);
    }
    for stage in &design.stages {
        let built = a.build(stage, &mut layout, origin, &mut gravity, |s, b| s.build(b));
        let inputs = a.listen(&stage.node, &stage.block.inputs());
        if let (Some(built), Some(inputs)) = (built, inputs) {
            let output = a.position(&stage.name);
            parts.stages.push(StageUnit {
                name: stage.name.clone(),
                stage: built,
                inputs,
                output,
            });
        }
    }
    for unit in &design.initialisers {
        let built = a.build(unit, &mut layout, origin, &mut gravity, |s, b| s.build(b));
        let inputs = a.listen(&unit.node, &unit.block.inputs());
        if let (Some(initialiser), Some(inputs)) = (built, inputs) {
            parts.initialisers.push(InitialiserUnit {
                name: unit.name.clone(),
                initialiser,
                inputs,
            });
        }
    }
    let layout = Arc::new(layout.finish());
    a.check_initialised(&layout);
    if a.d.has_errors() {
        return Err(a.d);
    }
    let Assembler { streams, .. } = a;
    let largest = parts.infos.iter().map(|s| s.model.size()).fold(Size::same(1), |m, s| Size {
        value: m.value.max(s.value),
        residual: m.residual.max(s.residual),
    });
    let filter: Box<dyn Estimator> = Box::new(Filter::new(layout.clone(), process.clone(), design.filter.backend(), largest));
    let mut runner = Runner::new(filter, process.clone(), design.run.reorder.si());
    for stream in &streams {
        runner.add_stream(&stream.name, stream.width());
    }
    if let Some(input) = parts.input {
        runner.set_input(input);
    }
    parts.sensors.into_iter().for_each(|s| runner.add_sensor(s));
    parts.stages.into_iter().for_each(|s| runner.add_stage(s));
    parts.initialisers.into_iter().for_each(|s| runner.add_initialiser(s));
    Ok(Assembly {
        runner,
        layout,
        process,
        sensors: parts.infos,
        streams,
        gravity,
    })
}

#[derive(Default)]
struct Parts {
    input: Option<Port>,
    sensors: Vec<Sensor>,
    infos: Vec<SensorInfo>,
    stages: Vec<StageUnit>,
    initialisers: Vec<InitialiserUnit>,
}

struct Assembler<'a> {
    design: &'a Design,
    streams: Vec<StreamLayout>,
    d: Diagnostics,
}

impl Assembler<'_> {
    /// Builds one block, turning its error into a diagnostic at the field it names.
    fn build<T, R>(
        &mut self,
        named: &Named<T>,
        layout: &mut LayoutBuilder,
        origin: Option<Geodetic>,
        gravity: &mut Gravity,
        build: impl FnOnce(&T, &mut Build<'_>) -> Result<R, BuildError>,
    ) -> Option<R> {
        let mut b = Build {
            name: &named.name,
            layout,
            origin,
            gravity: *gravity,
        };
        let built = build(&named.block, &mut b);
        *gravity = b.gravity;
        match built {
            Ok(built) => Some(built),
            Err(error) => {
                self.d.push(located(&named.node, &error));
                None
            }
        }
    }

    fn position(&self, stream: &str) -> StreamId {
        self.streams.iter().position(|s| s.name == stream).unwrap_or(usize::MAX)
    }

    /// The stream of that name; one that nobody declares is made up only where the design has no
    /// sources at all: a filter to be fed by its program.
    fn stream(&mut self, name: &str, channels: &[Channel], place: &Node, key: &str) -> Option<StreamId> {
        let serves = |s: &StreamLayout| channels.iter().all(|c| s.has(c));
        let named = self.streams.iter().position(|s| s.name == name);
        let fitting = self
            .streams
            .iter()
            .position(|s| (s.name == name || s.alias.as_deref() == Some(name)) && serves(s));
        let aliased = || self.streams.iter().position(|s| s.alias.as_deref() == Some(name));
        if let Some(at) = fitting.or(named).or_else(aliased) {
            return Some(at);
        }
        if self.design.sources.is_empty() && self.design.simulation.is_none() {
            self.streams.push(StreamLayout {
                name: name.to_owned(),
                alias: None,
                channels: Vec::new(),
                declared: false,
            });
            return Some(self.streams.len() - 1);
        }
        let mut names: Vec<&str> = self.streams.iter().map(|s| s.alias.as_deref().unwrap_or(&s.name)).collect();
        names.sort_unstable();
        names.dedup();
        let mut diagnostic = Diagnostic::error(format!("no source or stage is called `{name}`")).at(place.place_of(key));
        if let Some(meant) = crate::config::did_you_mean(name, &names) {
            diagnostic = diagnostic.label(format!("did you mean `{meant}`?"));
        }
        let listed = names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
        let help = match &self.design.simulation {
            Some(_) => format!("there are: {listed}; a simulated sensor, [simulation.sensor.NAME], provides what [sensor.NAME] reads"),
            None => format!("there are: {listed}"),
        };
        self.d.push(diagnostic.help(help));
        None
    }

    /// Columns of `channels` in the stream, one after the other, and the largest of their delays.
    fn port(&mut self, name: &str, channels: &[Channel], node: &Node) -> Option<Port> {
        let stream = self.stream(name, channels, node, "source")?;
        let mut port = Port {
            stream,
            columns: Vec::new(),
            delay: 0,
        };
        for wanted in channels {
            let found = self.channel(stream, wanted, node)?;
            port.columns.extend(found.offset..found.offset + wanted.width);
            port.delay = port.delay.max(found.delay);
        }
        Some(port)
    }

    fn channel(&mut self, stream: StreamId, wanted: &Channel, node: &Node) -> Option<StreamChannel> {
        let layout = &mut self.streams[stream];
        if let Some(found) = layout.channels.iter().find(|c| c.name == wanted.name) {
            let fits = found.width == wanted.width
                && found.shape == wanted.shape
                && (found.dimension == wanted.dimension || matches!(wanted.shape, Shape::Geodetic | Shape::Quaternion));
            if fits {
                return Some(found.clone());
            }
            let message = format!(
                "channel `{}` of `{}` is {}, and {} is needed",
                wanted.name,
                layout.name,
                describe(found.width, found.shape, found.dimension),
                describe(wanted.width, wanted.shape, wanted.dimension)
            );
            let mut diagnostic = Diagnostic::error(message).at(node.place_of("source"));
            if self.design.sources.iter().any(|s| s.name == layout.name) {
                let table = format!("[source.{}.channels.{}]", layout.name, wanted.name);
                diagnostic = diagnostic.help(format!("look at the columns and the `unit` under {table}"));
            }
            self.d.push(diagnostic);
            return None;
        }
        if !layout.declared {
            layout.append(wanted);
            return layout.channels.last().cloned();
        }
        let names = layout
            .channels
            .iter()
            .map(|c| format!("`{}`", c.name))
            .collect::<Vec<_>>()
            .join(", ");
        let message = format!("`{}` has no channel `{}`, which this block reads", layout.name, wanted.name);
        let has = if names.is_empty() {
            "it has no channels".to_owned()
        } else {
            format!("it has: {names}")
        };
        let help = match &self.design.simulation {
            Some(_) => format!("what is simulated is not declared further; {has}"),
            None => format!("declare it under [source.{}.channels]; {has}", layout.name),
        };
        self.d.push(Diagnostic::error(message).at(node.place_of("source")).help(help));
        None
    }

    fn input_port(&mut self) -> Option<Port> {
        let process = &self.design.process;
        let channels = process.block.model.input();
        match (&process.block.source, channels.is_empty()) {
            (Some(source), false) => self.port(source, &channels, &process.node),
            (None, true) => None,
            (None, false) => {
                let names = channels.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(" and ");
                let message = format!("this process is driven by {names} and has no `source`");
                self.d.push(
                    Diagnostic::error(message)
                        .at(process.node.name_place())
                        .help("add `source = \"NAME\"`: the source or stage with these channels"),
                );
                None
            }
            (Some(_), true) => {
                let message = "this process is driven by time alone and reads no source";
                self.d.push(
                    Diagnostic::error(message)
                        .at(process.node.place_of("source"))
                        .help("remove `source`"),
                );
                None
            }
        }
    }

    fn add_stage_stream(&mut self, stage: &Named<Box<dyn fusion_models::block::StageSpec>>) {
        self.streams.push(StreamLayout::of(&stage.name, None, &stage.block.output()));
    }

    fn listen(&mut self, node: &Node, inputs: &[Listen]) -> Option<Vec<Port>> {
        inputs.iter().map(|l| self.port(&l.source, &l.channels, node)).collect()
    }

    /// Numbers the sensor that this one goes with. Of one row, that one must be valid no later.
    fn link(&mut self, design: &Named<SensorDesign>, sensors: &mut [Sensor]) {
        let at = |name: &str| sensors.iter().position(|s| s.name == name);
        let leader = design.block.common.only_with.as_deref();
        let (Some(leader), Some(follower)) = (leader.and_then(at), at(&design.name)) else {
            return;
        };
        let source = &design.block.common.source;
        let name = &sensors[leader].name;
        let is_same_row = self
            .design
            .sensors
            .iter()
            .any(|s| s.name == *name && s.block.common.source == *source);
        if is_same_row && sensors[follower].port.delay > sensors[leader].port.delay {
            let message = format!(
                "of a row of `{source}`, `{}` is valid before `{name}`, which is to be judged first",
                design.name
            );
            let help = "give both the same `time_offset`, or let the one that is valid later go with the other";
            let place = design.node.place_of("only_with");
            self.d.push(Diagnostic::error(message).at(place).help(help));
        }
        sensors[follower].only_with = Some(leader);
    }

    fn sensor(&mut self, design: &Named<SensorDesign>, model: Arc<dyn Measurement>) -> Option<(Sensor, SensorInfo)> {
        let SensorDesign {
            model: spec,
            common,
            gate,
            loss,
        } = &design.block;
        let node = &design.node;
        let rows = spec.noise();
        let (channel, constant) = match spec.reading() {
            Reading::Channel(channel) => (Some(channel), Vec::new()),
            Reading::Constant(value) => (None, value),
        };
        let mut port = self.port(&common.source, channel.as_slice(), node)?;
        if let Err(error) = check_delay("time_offset", spec.delay()) {
            self.d.push(located(node, &error));
            return None;
        }
        port.delay += nanos(spec.delay());
        let sigma = match &common.noise.sigma {
            Some(sigma) => match sigma.resolve(&rows) {
                Ok(sigma) => sigma,
                Err(why) => {
                    self.d.push(Diagnostic::error(why).at(node.place_of("noise.sigma")));
                    return None;
                }
            },
            None if common.noise.from_source => vec![0.0; rows.len()],
            None => {
                let message = format!("`{}` has no noise", design.name);
                let help = "add `noise = { sigma = … }`, or `noise = { from_source = true }` to take the 1σ the source reports";
                self.d.push(Diagnostic::error(message).at(node.name_place()).help(help));
                return None;
            }
        };
        if !common.noise.from_source && sigma.contains(&0.0) {
            let message = "a measurement without noise makes the filter singular";
            self.d.push(
                Diagnostic::error(message)
                    .at(node.place_of("noise.sigma"))
                    .help("write a small sigma instead of zero"),
            );
            return None;
        }
        let mut noise = Noise::diagonal(&sigma);
        if common.noise.from_source {
            let Some(channel) = &channel else {
                let message = "a pseudo-measurement has no source that could report its noise";
                self.d.push(Diagnostic::error(message).at(node.place_of("noise.from_source")));
                return None;
            };
            let reported = Channel {
                name: format!("{}_sigma", channel.name).into(),
                width: channel.degrees(),
                dimension: rows.first().copied().unwrap_or(Dimension::NONE),
                shape: Shape::Vector,
            };
            let found = self.channel(port.stream, &reported, node)?;
            noise.sigma_columns = (found.offset..found.offset + rows.len()).collect();
            noise.scale = common.noise.scale.map_or(1.0, |s| s.si());
        }
        let gate = match gate.as_ref().map(|g| g.suits(&rows).and_then(|()| g.build())) {
            None => Box::new(Open) as _,
            Some(Ok(gate)) => gate,
            Some(Err(error)) => {
                self.d.push(located(node.at("gate").unwrap_or(node), &error));
                return None;
            }
        };
        let loss = match loss.as_ref().map(|l| l.build()) {
            None => Arc::new(Quadratic) as _,
            Some(Ok(loss)) => loss.into(),
            Some(Err(error)) => {
                self.d.push(located(node.at("loss").unwrap_or(node), &error));
                return None;
            }
        };
        let info = SensorInfo {
            name: design.name.clone(),
            model: model.clone(),
            stream: common.source.clone(),
            channel,
            delay: port.delay as f64 * 1e-9,
            sigma,
            rows,
            axes: spec.axes(),
        };
        Some((
            Sensor {
                name: design.name.clone(),
                model,
                port,
                constant,
                noise,
                gate,
                loss,
                only_with: None,
            },
            info,
        ))
    }

    /// Blocks that the process moves start somewhere: an initialiser must write them.
    fn check_initialised(&mut self, layout: &Layout) {
        let written: Vec<&str> = self.design.initialisers.iter().flat_map(|i| i.block.writes()).collect();
        let known = |b: &Block| b.sigma.iter().all(|s| *s > 0.0) || written.contains(&b.name.as_str());
        let moved = layout.blocks().iter().filter(|b| b.dynamics == Dynamics::Process);
        let missing: Vec<String> = moved.filter(|b| !known(b)).map(|b| format!("`{}`", b.name)).collect();
        if let [all @ .., last] = &missing[..] {
            let and = if all.is_empty() {
                String::new()
            } else {
                format!("{} and ", all.join(", "))
            };
            let message = format!("nothing gives the filter its first {and}{last}");
            let help = "add an [initial.NAME] block: `explicit`, `first_fix`, `levelling` or `course`; `fusion blocks` describes them";
            let place = self
                .design
                .document
                .root()
                .get("initial")
                .map_or(self.design.process.node.name_place(), Node::name_place);
            self.d.push(Diagnostic::error(message).at(place).help(help));
        }
    }
}

fn describe(width: usize, shape: Shape, dimension: Dimension) -> String {
    match shape {
        Shape::Geodetic => "a geodetic position".to_owned(),
        Shape::Quaternion => "a quaternion".to_owned(),
        Shape::Vector | Shape::Angle => format!("{width} × {}", dimension.kind()),
    }
}

fn located(node: &Node, error: &BuildError) -> Diagnostic {
    let place = if error.field.is_empty() {
        node.name_place()
    } else {
        node.place_of(&error.field)
    };
    let diagnostic = Diagnostic::error(&error.message).at(place);
    match &error.help {
        Some(help) => diagnostic.help(help),
        None => diagnostic,
    }
}
