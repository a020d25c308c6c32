//! The assembler: builds every block over one layout, then puts the runner together.

use super::plan::Plan;
use super::sensors::{self, Built};
use super::streams::known_streams;
use super::{Inside, SensorInfo, StreamLayout};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Draft, Named, OrderSpec, ProcessDesign, SourceDesign};
use fusion_core::filter::{Bank, Estimator};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Process, Size};
use fusion_core::runner::{InitialiserUnit, InputLimits, Port, Runner, Sensor, StageUnit};
use fusion_core::state::{Block, Dynamics, Layout, LayoutBuilder};
use fusion_core::time::nanos;
use fusion_models::block::{Build, BuildError, Channel, Taken};
use fusion_models::earth::Gravity;
use fusion_models::vocabulary::channel;
use std::sync::Arc;

/// How far ahead of all others a stamp may be, if not declared \[s\].
const LONGEST_JUMP: f64 = 10.0;
/// How long the filter may be lost, if not declared \[s\]: as long as gates take to re-acquire.
const RESTART_LOST: f64 = 30.0;

/// A design, built.
#[derive(Debug)]
pub struct Assembly {
    /// Drives the filter.
    pub runner: Runner,
    /// The state layout.
    pub layout: Arc<Layout>,
    /// The process model.
    pub process: Arc<dyn Process>,
    /// The sensors' models, in order of their numbers, with the channels that they read.
    pub sensors: Vec<SensorInfo>,
    /// All streams, in order of their numbers.
    pub streams: Vec<StreamLayout>,
    /// The filters inside stages.
    pub filters: Vec<Inside>,
    /// The gravity model of the process.
    pub gravity: Gravity,
    /// A number made of everything that the design says of the filter.
    pub fingerprint: u64,
}

/// Builds `design` over streams with known channels. An undeclared stream takes the channels that its
/// consumers ask for, in the order of the file.
///
/// With `order = "rewind"` the runner goes back for late rows: it contains a second runner.
///
/// # Errors
/// Every mistake found.
pub fn assemble(design: &Design, declared: Vec<StreamLayout>) -> Result<Assembly, Diagnostics> {
    if design.run.order == OrderSpec::Hold {
        return assemble_once(design, declared);
    }
    let live = assemble_once(design, declared.clone())?.runner;
    let mut assembly = assemble_once(design, declared)?;
    let rewind = design.run.rewind;
    assembly.runner.rewind(live, rewind.horizon.si(), rewind.spacing.si());
    Ok(assembly)
}

fn assemble_once(design: &Design, declared: Vec<StreamLayout>) -> Result<Assembly, Diagnostics> {
    let mut a = Assembler::new(design, Some(&design.process), declared, Vec::new(), Data::of(design));
    let assembly = a.plan().map(|plan| a.assembly(plan));
    match assembly {
        Some(assembly) => a.d.unless_errors(assembly),
        None => Err(a.d),
    }
}

/// Builds the blocks of `design` as [`assemble`] does, but not the estimator and the runner.
///
/// # Errors
/// Every mistake found.
pub fn plan(design: &Design, declared: Vec<StreamLayout>) -> Result<Plan, Diagnostics> {
    let mut a = Assembler::new(design, Some(&design.process), declared, Vec::new(), Data::of(design));
    let plan = a.plan();
    match plan {
        Some(plan) => a.d.unless_errors(plan),
        None => Err(a.d),
    }
}

/// Reports every mistake of the declared sources and of the assembly to `d`. A draft without a mistake
/// can be assembled.
pub(crate) fn check(draft: &Draft, d: &mut Diagnostics) {
    let (streams, vague) = known_streams(draft, d);
    let mut a = Assembler::new(draft, draft.process.as_ref(), streams, vague, Data::of(draft));
    a.plan();
    d.extend(a.d.iter().cloned());
}

/// The parts of a runner.
pub(super) struct Parts {
    pub(super) input: Option<Port>,
    pub(super) limits: InputLimits,
    pub(super) sensors: Vec<Sensor>,
    pub(super) stages: Vec<StageUnit>,
    pub(super) initialisers: Vec<InitialiserUnit>,
}

impl Parts {
    /// Every port.
    pub(super) fn ports(&mut self) -> impl Iterator<Item = &mut Port> {
        let sensors = self.sensors.iter_mut().flat_map(|s| {
            let switch = s.switch.as_mut().map(|switch| &mut switch.port);
            core::iter::once(&mut s.port).chain(switch)
        });
        let stages = self.stages.iter_mut().flat_map(|s| &mut s.inputs);
        let initialisers = self.initialisers.iter_mut().flat_map(|i| &mut i.inputs);
        self.input.iter_mut().chain(sensors).chain(stages).chain(initialisers)
    }
}

/// The origin of the rows of a design, also for the filters inside it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Data<'a> {
    pub(super) sources: &'a [Named<SourceDesign>],
    pub(super) is_simulated: bool,
    /// Set if the simulated world, or the stream of one of its sensors, could not be read.
    pub(super) is_unread: bool,
}

impl<'a> Data<'a> {
    fn of<P>(design: &'a Design<P>) -> Self {
        Self {
            sources: &design.sources,
            is_simulated: design.simulation.is_some(),
            is_unread: design.unread.simulation || design.simulation.is_some() && design.unread.has_stray_sensor(&design.document),
        }
    }
}

pub(super) struct Assembler<'a, P> {
    pub(super) design: &'a Design<P>,
    pub(super) process: Option<&'a Named<ProcessDesign>>,
    pub(super) streams: Vec<StreamLayout>,
    /// Streams that are incomplete because of a mistake that is already reported.
    pub(super) vague: Vec<String>,
    pub(super) data: Data<'a>,
    /// The filters inside stages, as far as they are assembled.
    pub(super) inside: Vec<Inside>,
    pub(super) layout: LayoutBuilder,
    gravity: Gravity,
    /// Sensors that could not be built: states that they would have brought are not missed.
    failed: Vec<&'a str>,
    pub(super) d: Diagnostics,
}

impl<'a, P> Assembler<'a, P> {
    pub(super) fn new(
        design: &'a Design<P>,
        process: Option<&'a Named<ProcessDesign>>,
        streams: Vec<StreamLayout>,
        vague: Vec<String>,
        data: Data<'a>,
    ) -> Self {
        Self {
            design,
            process,
            streams,
            vague,
            data,
            inside: Vec::new(),
            layout: LayoutBuilder::new(),
            gravity: Gravity::default(),
            failed: design.unread.sensors.iter().map(String::as_str).collect(),
            d: Diagnostics::new(),
        }
    }

    /// The plan of the outermost filter, if there are no mistakes.
    fn plan(&mut self) -> Option<Plan> {
        let (process, parts, infos) = self.blocks();
        self.check_restart();
        let run = &self.design.run;
        Some(Plan {
            longest_jump: Some(run.longest_jump.map_or(LONGEST_JUMP, |t| t.si())),
            restart_lost: Some(run.restart_lost.map_or(RESTART_LOST, |v| v.si())),
            restart_after: run.restart_after.map(|silence| silence.si()),
            ..self.finish(process?, parts, infos)?
        })
    }

    /// The assembly of a plan.
    pub(super) fn assembly(&self, plan: Plan) -> Assembly {
        let estimator: Box<dyn Estimator> = match self.design.filter.bank {
            None => Box::new(plan.filter()),
            Some(bank) => Box::new(Bank::new(bank.limits(), || (Box::new(plan.filter()), self.gates(&plan.infos)))),
        };
        plan.assembly(estimator)
    }

    /// Builds and connects the blocks. Without a process no other block is built, but all are connected.
    pub(super) fn blocks(&mut self) -> (Option<Arc<dyn Process>>, Parts, Vec<SensorInfo>) {
        let design = self.design;
        let process: Option<Arc<dyn Process>> = self.process.and_then(|p| self.build(p, |p, b| p.model.build(b))).map(Into::into);
        let is_moved = process.is_some();
        let mut models = Vec::new();
        for sensor in &design.sensors {
            // The mistakes of a sensor that could not be built are already reported.
            let is_led = sensor.block.model.follows().is_none_or(|name| !self.failed.contains(&name));
            let built = (is_moved && is_led).then(|| self.build(sensor, sensors::build)).flatten();
            if built.is_none() {
                self.failed.push(&sensor.name);
            }
            models.push(built);
        }
        for stage in &design.stages {
            self.streams.push(StreamLayout::of(&stage.name, None, &stage.block.output()));
        }
        let filters = self.filters();
        let (input, limits) = (self.input_port(), self.input_limits());
        let (sensors, infos) = self.sensors(models);
        let mut stages = self.stages(is_moved);
        stages.extend(filters);
        let parts = Parts {
            input,
            limits,
            sensors,
            stages,
            initialisers: self.initialisers(is_moved),
        };
        (process, parts, infos)
    }

    /// Builds one block, turning its error into a diagnostic at the field it names.
    fn build<T, R>(&mut self, named: &Named<T>, build: impl FnOnce(&T, &mut Build<'_>) -> Result<R, BuildError>) -> Option<R> {
        // Where [run] is wrong, its origin is not missed.
        let (lat, lon, height) = (0.0, 0.0, 0.0);
        let unread = self.design.unread.run.then_some(Geodetic { lat, lon, height });
        let mut b = Build {
            name: &named.name,
            layout: &mut self.layout,
            origin: self.design.run.origin.map(Geodetic::from).or(unread),
            gravity: self.gravity,
        };
        let built = build(&named.block, &mut b);
        self.gravity = b.gravity;
        match built {
            Ok(built) => Some(built),
            Err(_) if self.shares_with_failed(&named.node) => None,
            Err(error) => self.d.keep(Err(named.node.locate(&error))),
        }
    }

    /// Returns true if a block names a state, `sensor.parameter`, of a sensor that could not be built.
    fn shares_with_failed(&self, node: &Node) -> bool {
        let is_state_of_failed = |text: &str| text.split_once('.').is_some_and(|(owner, _)| self.failed.contains(&owner));
        node.any(&|node| node.as_str().is_some_and(is_state_of_failed))
    }

    fn sensors(&mut self, models: Vec<Option<Built>>) -> (Vec<Sensor>, Vec<SensorInfo>) {
        let connected = models
            .into_iter()
            .enumerate()
            .filter_map(|(number, model)| self.sensor(number, model));
        let (mut sensors, infos): (Vec<_>, Vec<_>) = connected.flatten().unzip();
        self.link(&mut sensors, &infos);
        (sensors, infos)
    }

    fn stages(&mut self, is_moved: bool) -> Vec<StageUnit> {
        let mut units = Vec::new();
        for unit in &self.design.stages {
            let built = is_moved.then(|| self.build(unit, |s, b| s.build(b))).flatten();
            let inputs = self.listen(&unit.node, &unit.block.inputs());
            if let (Some(stage), Some(mut inputs)) = (built, inputs) {
                for (port, seconds) in inputs.iter_mut().zip(unit.block.ahead()) {
                    port.delay = port.delay.saturating_add(nanos(seconds));
                }
                let output = self.position(&unit.name);
                let name = unit.name.clone();
                units.push(StageUnit {
                    name,
                    stage,
                    inputs,
                    output,
                });
            }
        }
        units
    }

    fn initialisers(&mut self, is_moved: bool) -> Vec<InitialiserUnit> {
        let mut units = Vec::new();
        let is_position = |channel: &Channel| *channel == channel::POSITION || *channel == channel::HORIZONTAL_POSITION;
        let mut sensors = self.design.sensors.iter().map(|sensor| sensor.block.model.reading());
        let is_measured = sensors.any(|reading| reading.channels().iter().any(is_position)) || !self.failed.is_empty();
        for unit in &self.design.initialisers {
            if unit.block.takes() == Taken::Place && !is_measured {
                let message = "without `position_sigma` the next fixes give the position, and no sensor reads a position";
                let help = "add `position_sigma`, the 1σ of this fix: `position_sigma = \"2 m\"`";
                self.d.push(Diagnostic::error(message).at(unit.node.name_place()).help(help));
            }
            let built = is_moved.then(|| self.build(unit, |s, b| s.build(b))).flatten();
            let inputs = self.listen(&unit.node, &unit.block.inputs());
            if let (Some(initialiser), Some(inputs)) = (built, inputs) {
                // A sensor or stage may have the same name.
                let name = format!("initial.{}", unit.name);
                units.push(InitialiserUnit { name, initialiser, inputs });
            }
        }
        units
    }

    /// Reports `restart_after` for a process with input: that process restarts when its input is silent.
    fn check_restart(&mut self) {
        let is_driven = self.process.is_some_and(|process| !process.block.model.input().is_empty());
        if is_driven && self.design.run.restart_after.is_some() {
            let message = "`restart_after` is for a process without `source`; this one restarts when its input is silent";
            let place = self.design.document.root().get("run").map(|run| run.place_of("restart_after"));
            let mistake = Diagnostic::error(message).help("remove `restart_after` and set `input.longest_gap` under [process]");
            self.d.push(match place {
                Some(place) => mistake.at(place),
                None => mistake,
            });
        }
    }

    /// Blocks that the process moves start somewhere: an initialiser must write them.
    fn check_initialised(&mut self, layout: &Layout) {
        let written: Vec<&str> = self.design.initialisers.iter().flat_map(|i| i.block.writes()).collect();
        let known = |b: &Block| b.sigma.iter().all(|s| *s > 0.0) || written.contains(&b.name.as_str());
        let moved = layout.blocks().iter().filter(|b| b.dynamics == Dynamics::Process);
        let missing: Vec<String> = moved.filter(|b| !known(b)).map(|b| format!("`{}`", b.name)).collect();
        let Some((last, others)) = missing.split_last() else { return };
        let and = if others.is_empty() {
            String::new()
        } else {
            format!("{} and ", others.join(", "))
        };
        let message = format!("no initialiser gives the initial {and}{last}");
        let help = "add an [initial.NAME] block: `explicit`, `first_fix`, `levelling` or `course`; `fusion blocks` describes them";
        let table = self.design.document.root().get("initial");
        let process = self.process.map(|p| &p.node);
        let place = table.or(process).unwrap_or(self.design.document.root()).name_place();
        self.d.push(Diagnostic::error(message).at(place).help(help));
    }

    pub(super) fn finish(&mut self, process: Arc<dyn Process>, parts: Parts, infos: Vec<SensorInfo>) -> Option<Plan> {
        let layout = Arc::new(std::mem::take(&mut self.layout).finish());
        if !self.design.unread.initialisers {
            self.check_initialised(&layout);
        }
        let root = self.design.document.root();
        let otherwise = self.process.map_or(root, |p| &p.node);
        self.design.filter.check_layout(&layout, root.get("filter"), otherwise, &mut self.d);
        let is_connected = |number| infos.iter().any(|info| info.design == number);
        let is_whole = (0..self.design.sensors.len()).all(is_connected)
            && parts.stages.len() == self.design.stages.len() + self.design.filters.len()
            && parts.initialisers.len() == self.design.initialisers.len();
        if self.d.has_errors() || !is_whole {
            return None;
        }
        let (design, streams) = (self.design, std::mem::take(&mut self.streams));
        let largest = infos.iter().map(|s| s.model.size()).fold(Size::same(1), |m, s| Size {
            value: m.value.max(s.value),
            residual: m.residual.max(s.residual),
        });
        Some(Plan {
            layout,
            process,
            backend: design.filter.backend(),
            largest,
            reorder: design.run.reorder.si(),
            limits: design.health.limits(),
            streams,
            input: parts.input.map(|input| (input, parts.limits)),
            sensors: parts.sensors,
            stages: parts.stages,
            initialisers: parts.initialisers,
            longest_jump: None,
            restart_lost: None,
            restart_after: None,
            infos,
            inside: std::mem::take(&mut self.inside),
            gravity: self.gravity,
            fingerprint: crate::checkpoint::fingerprint(&design.document),
        })
    }
}
