//! Filters inside stages: assembled like any design, over the streams outside.
//!
//! The runner outside orders the rows. Each pair of a stream outside and a delay that a consumer
//! inside declares is an input of the stage, and a stream of the runner inside that has no delay.

use super::assemble::{Assembler, Assembly, Parts};
use super::{SensorInfo, StreamChannel, StreamLayout};
use crate::config::Diagnostic;
use crate::design::{Draft, Named};
use fusion_core::filter::Backend;
use fusion_core::model::Process;
use fusion_core::runner::{Nested, Outlet, Port, Sensor, StageUnit, StreamId};
use fusion_core::state::{Block, Kind, Layout};
use fusion_models::block::{Channel, Shape};
use fusion_models::units::{Dimension, Dimensional, dim, parse_unit};
use fusion_models::vocabulary::{channel, state};
use std::sync::Arc;

/// A filter inside a stage, with the data that its observers need.
#[derive(Debug)]
pub struct Inside {
    /// The stage's name.
    pub name: String,
    /// Its backend.
    pub backend: Backend,
    /// Its state layout.
    pub layout: Arc<Layout>,
    /// Its process model.
    pub process: Arc<dyn Process>,
    /// By sensor, in order of their numbers: its stream inside, and the columns that it reads.
    pub reads: Vec<(StreamId, Vec<usize>)>,
    /// Further data of these sensors.
    pub sensors: Vec<SensorInfo>,
    /// The filters inside it.
    pub filters: Vec<Inside>,
}

/// An input of the stage: a stream outside, whose rows are valid `delay` before their stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Inlet {
    stream: StreamId,
    delay: i64,
}

impl<'a, P> Assembler<'a, P> {
    /// Assembles the filters inside stages, in the order of the file: each may read those before it.
    pub(super) fn filters(&mut self) -> Vec<StageUnit> {
        let mut units = Vec::new();
        for named in &self.design.filters {
            match self.filter(named) {
                Some((unit, layout)) => {
                    self.streams.push(layout);
                    units.push(unit);
                }
                // Its outputs are not reported as missing.
                None => self.vague.push(named.name.clone()),
            }
        }
        units
    }

    fn filter(&mut self, named: &'a Named<Draft>) -> Option<(StageUnit, StreamLayout)> {
        let draft = &named.block;
        self.check_stage_names(draft);
        let outside = self.streams.len();
        let mut inside = Assembler::new(draft, draft.process.as_ref(), self.streams.clone(), self.vague.clone(), self.data);
        let (process, mut parts, infos) = inside.blocks();
        self.check_order(named, &inside.streams[outside..]);
        let origins = self.adopt(&inside.streams, outside);
        let driver = parts.input.as_ref().map(|port| (origins[port.stream], port.delay));
        let inlets = localise(&mut inside.streams, &mut parts, &origins);
        self.check_in_time(named, &inlets);
        let assembly = process
            .and_then(|process| inside.finish(process, parts, infos))
            .map(|plan| inside.assembly(plan));
        self.d.extend(inside.d.iter().cloned());
        let Assembly {
            runner,
            layout,
            process,
            sensors,
            filters,
            ..
        } = assembly?;
        if runner.lag() > 0.0 {
            let message = "this filter would have to wait for a later row, and its estimate would come too late for the filter outside";
            let help = "inside a filter, `only_with` must name a sensor of the same source, with no larger delay";
            self.d.push(Diagnostic::error(message).at(named.node.name_place()).help(help));
            return None;
        }
        let driving = driver.and_then(|(stream, delay)| Some((&self.streams[stream?], delay)));
        if process.input_dim() == 0 && runner.sensors().iter().any(|s| s.offset.is_some()) {
            let message = "this filter has no process input, and cannot estimate the time offset of its sensors";
            let help = "write fixed numbers as the `time_offset` of its sensors, or move them to the filter outside";
            self.d.push(Diagnostic::error(message).at(named.node.name_place()).help(help));
            return None;
        }
        let (outlets, channels) = outlets(&layout, driving);
        self.inside.push(Inside {
            name: named.name.clone(),
            backend: draft.filter.backend(),
            layout,
            process,
            reads: runner.sensors().iter().map(Sensor::reads).collect(),
            sensors,
            filters,
        });
        let unit = StageUnit {
            name: named.name.clone(),
            stage: Box::new(Nested::new(runner, (0..inlets.len()).collect(), outlets)),
            inputs: inlets.iter().map(|inlet| self.whole_row(*inlet)).collect(),
            output: self.streams.len(),
        };
        Some((unit, StreamLayout::of(&named.name, None, &channels)))
    }

    /// Streams inside and outside share one space of names.
    fn check_stage_names(&mut self, draft: &Draft) {
        let blocks = draft.stages.iter().map(|s| (&s.name, &s.node));
        for (name, node) in blocks.chain(draft.filters.iter().map(|f| (&f.name, &f.node))) {
            if self.streams.iter().any(|s| s.name == *name || s.alias.as_ref() == Some(name)) {
                let message = format!("`{name}` is the name of a source or stage outside this filter");
                let help = "give the stage inside another name, and name that where it is read";
                self.d.push(Diagnostic::error(message).at(node.name_place()).help(help));
            }
        }
    }

    /// Rows of a stage outside come when they are stamped: they cannot be valid before.
    fn check_in_time(&mut self, named: &Named<Draft>, inlets: &[Inlet]) {
        for inlet in inlets.iter().filter(|inlet| inlet.delay > 0) {
            if !self.is_emitted(inlet.stream) {
                continue;
            }
            let stage = &self.streams[inlet.stream].name;
            let message =
                format!("the time offset of this sensor cannot be used: the stage `{stage}` inside this filter emits its rows too late");
            let help = "write it as `latency` of the channels that the stage reads, or move the stage out of this filter";
            self.d.push(Diagnostic::error(message).at(named.node.name_place()).help(help));
        }
    }

    /// A filter may read only filters declared before it. Reports a stream that was created because the
    /// filter of this name comes later.
    fn check_order(&mut self, named: &Named<Draft>, made_up: &[StreamLayout]) {
        let is_filter = |name: &str| self.design.filters.iter().any(|f| f.name == name);
        if let Some(later) = made_up.iter().find(|s| !s.declared && is_filter(&s.name)) {
            let message = format!("`{}` reads `{}`, which is itself or is declared after it", named.name, later.name);
            let help = "a filter reads sources, stages, and filters that are declared before it: change their sequence, or what is read";
            self.d.push(Diagnostic::error(message).at(named.node.name_place()).help(help));
        }
    }

    /// Takes over the channels that the consumers inside ask for on undeclared streams. Returns, for each
    /// stream inside, the same stream outside, or `None`.
    fn adopt(&mut self, inside: &[StreamLayout], outside: usize) -> Vec<Option<StreamId>> {
        self.streams.clone_from_slice(&inside[..outside]);
        let mut origins: Vec<Option<StreamId>> = (0..outside).map(Some).collect();
        for stream in &inside[outside..] {
            origins.push((!stream.declared).then(|| {
                self.streams.push(stream.clone());
                self.streams.len() - 1
            }));
        }
        origins
    }

    fn whole_row(&self, inlet: Inlet) -> Port {
        Port {
            stream: inlet.stream,
            columns: (0..self.streams[inlet.stream].width()).collect(),
            delay: inlet.delay,
        }
    }
}

/// Gives the runner inside its own streams: first the inlets, without delays, then those of its stages.
fn localise(streams: &mut Vec<StreamLayout>, parts: &mut Parts, origins: &[Option<StreamId>]) -> Vec<Inlet> {
    let mut inlets: Vec<Inlet> = Vec::new();
    for port in parts.ports() {
        let inlet = origins[port.stream].map(|stream| Inlet { stream, delay: port.delay });
        inlets.extend(inlet.filter(|inlet| !inlets.contains(inlet)));
    }
    let own = |stream: StreamId| inlets.len() + origins[..stream].iter().filter(|origin| origin.is_none()).count();
    for port in parts.ports() {
        let inlet = origins[port.stream].map(|stream| Inlet { stream, delay: port.delay });
        match inlet.and_then(|inlet| inlets.iter().position(|i| *i == inlet)) {
            Some(at) => (port.stream, port.delay) = (at, 0),
            None => port.stream = own(port.stream),
        }
    }
    for stage in &mut parts.stages {
        stage.output = own(stage.output);
    }
    let of = |inlet: &Inlet| {
        origins
            .iter()
            .position(|origin| *origin == Some(inlet.stream))
            .map(|at| streams[at].clone())
    };
    let mut local: Vec<StreamLayout> = inlets.iter().filter_map(of).collect();
    for channel in local.iter_mut().flat_map(|stream| &mut stream.channels) {
        channel.delay = 0;
    }
    let stages = streams.iter().zip(origins).filter(|(_, origin)| origin.is_none());
    local.extend(stages.map(|(stream, _)| stream.clone()));
    *streams = local;
    inlets
}

/// The outputs of the stage: the states with their 1σ, the signals, and the other channels of the row
/// that drives the process.
fn outlets(layout: &Layout, driving: Option<(&StreamLayout, i64)>) -> (Vec<Outlet>, Vec<Channel>) {
    let (mut outlets, mut channels) = (Vec::new(), Vec::<Channel>::new());
    for block in layout.blocks() {
        let value = of_block(block);
        let sigma = Channel {
            name: Channel::sigma_name(&value.name).into(),
            width: value.degrees(),
            dimension: sigma_of(block),
            shape: Shape::Vector,
        };
        outlets.extend([Outlet::State(block.clone()), Outlet::Sigma(block.clone())]);
        channels.extend([value, sigma]);
    }
    for (name, _, storage, _) in layout.signals() {
        if let Some(signal) = channel::known(name) {
            outlets.push(Outlet::Signal(storage..storage + signal.width));
            channels.push(signal);
        }
    }
    let has = |channels: &[Channel], name: &str| channels.iter().any(|c| c.name == name);
    if let Some(attitude) = layout
        .block(state::ATTITUDE.as_str())
        .filter(|_| !has(&channels, state::HEADING.as_str()))
    {
        outlets.push(Outlet::Heading(attitude.clone()));
        let sigma = |name, width| Channel::vector(name, width, dim::Angle::KIND.dimension);
        channels.extend([channel::HEADING, sigma("heading_sigma", 1), sigma("tilt_sigma", 2)]);
    }
    let (stream, delay) = driving.map_or((&[][..], 0), |(stream, delay)| (&stream.channels[..], delay));
    for passed in stream.iter().filter(|c| c.delay == delay) {
        if !has(&channels, &passed.name) {
            outlets.push(Outlet::Passed(passed.offset..passed.offset + passed.width));
            channels.push(of_stream(passed));
        }
    }
    (outlets, channels)
}

fn of_stream(channel: &StreamChannel) -> Channel {
    Channel {
        name: channel.name.clone().into(),
        width: channel.width,
        dimension: channel.dimension,
        shape: channel.shape,
    }
}

fn of_block(block: &Block) -> Channel {
    let shape = match block.kind {
        Kind::Geodetic => Shape::Geodetic,
        Kind::Attitude => Shape::Quaternion,
        Kind::Angle => Shape::Angle,
        _ => Shape::Vector,
    };
    let dimension = match shape {
        Shape::Geodetic | Shape::Quaternion => Dimension::NONE,
        Shape::Vector | Shape::Angle => sigma_of(block),
    };
    Channel {
        name: block.name.clone().into(),
        width: block.kind.storage(),
        dimension,
        shape,
    }
}

/// The dimension of a displacement of the block.
fn sigma_of(block: &Block) -> Dimension {
    parse_unit(block.unit).map_or(Dimension::NONE, |(_, dimension)| dimension)
}
