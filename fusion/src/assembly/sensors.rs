//! Sensors: a measurement model with its port, its noise, its gate and its loss.

use super::assemble::Assembler;
use crate::config::{Diagnostic, Node};
use crate::design::{Named, NoiseSpec, SensorDesign, SwitchSpec};
use fusion_core::gate::{Gate, OnlyWith, Open};
use fusion_core::loss::{Loss, Quadratic};
use fusion_core::model::Measurement;
use fusion_core::runner::{Noise, Offset, Port, Sensor, StreamId, Switch};
use fusion_core::state::{Param, Scalar, Slot};
use fusion_core::time::nanos;
use fusion_models::block::{Build, BuildError, Channel, Reading, SensorSpec, check_delay};
use fusion_models::units::{Dimension, range};
use std::sync::Arc;

/// The data of a sensor in addition to its runtime model.
#[derive(Debug)]
pub struct SensorInfo {
    /// Its name; `sensor.row` if each row of the sensor is a separate measurement.
    pub name: String,
    /// Its model.
    pub model: Arc<dyn Measurement>,
    /// The number of the sensor in the design.
    pub design: usize,
    /// The model of that sensor as a whole.
    pub whole: Arc<dyn Measurement>,
    /// The stream that it reads or that times it.
    pub stream: String,
    /// Its channels; none for a pseudo-measurement.
    pub channels: Vec<Channel>,
    /// Its declared delay \[s\], with the fixed or initial value of its time offset.
    pub delay: f64,
    /// Its time offset, if that is a state.
    pub offset: Option<Slot<Scalar>>,
    /// Declared 1σ per residual row; empty where only the source reports it.
    pub sigma: Vec<f64>,
    /// Dimension of each residual row.
    pub rows: Vec<Dimension>,
    /// Name of each residual row; empty without names.
    pub axes: &'static [&'static str],
}

/// A sensor's model and its time offset.
pub(super) type Built = (Arc<dyn Measurement>, Param<Scalar>);

/// Builds a sensor's model, and its time offset after it.
pub(super) fn build(design: &SensorDesign, b: &mut Build<'_>) -> Result<Built, BuildError> {
    let model = design.model.build(b)?.into();
    Ok((model, b.param("time_offset", &design.common.time_offset)?))
}

/// How far above and below its initial value an estimated time offset may shift the rows, in σ. A larger
/// shift is treated to first order. The limit above delays all rows by that time; the limit below costs
/// nothing.
const REACH: [f64; 2] = [6.0, 12.0];

/// When rows are valid.
struct Timing {
    /// Declared time before their stamp \[s\].
    declared: f64,
    /// Largest time before their stamp that is allowed for \[s\].
    most: f64,
    offset: Option<Offset>,
}

impl<P> Assembler<'_, P> {
    /// Connects sensor `number` of the design to its built model. Without a model, it still finds the other mistakes.
    /// If each row of the sensor is a separate measurement, it becomes one sensor per row.
    pub(super) fn sensor(&mut self, number: usize, built: Option<Built>) -> Option<Vec<(Sensor, SensorInfo)>> {
        let design = &self.design.sensors[number];
        let SensorDesign { model: spec, common, .. } = &design.block;
        let node = &design.node;
        let rows = spec.noise();
        let reading = spec.reading();
        let channels = reading.channels().to_vec();
        let constant = if let Reading::Constant(value) = reading {
            value
        } else {
            Vec::new()
        };
        let port = self.port(&common.source, &channels, node);
        self.check_latencies(port.as_ref(), &channels, node);
        let sigma = self.d.keep(sigma(design, &rows));
        let reported = match &port {
            Some(port) if common.noise.from_source => self.reported(port.stream, spec.as_ref(), node),
            _ => Some(Vec::new()),
        };
        let quality = match (&port, &common.quality) {
            (Some(port), Some(name)) => self.quality(port.stream, name, node).map(Some),
            _ => Some(None),
        };
        let switch = match &common.switch {
            Some(spec) => self.switch(spec, node).map(Some),
            None => Some(None),
        };
        let gate = self.d.keep(gate(design, &rows, self.has_bank()));
        let loss = self.d.keep(loss(design));
        let ((model, time_offset), mut port, sigma) = (built?, port?, sigma?);
        let timing = self.timing(&time_offset, port.stream).map_err(|e| node.locate(&e));
        let timing = self.d.keep(timing)?;
        let delay = port.delay.saturating_add(nanos(timing.declared)) as f64 * 1e-9;
        port.delay = port.delay.saturating_add(nanos(timing.most));
        let info = SensorInfo {
            name: design.name.clone(),
            model: model.clone(),
            design: number,
            whole: model.clone(),
            stream: common.source.clone(),
            channels,
            delay,
            offset: match time_offset {
                Param::State(slot) => Some(slot),
                Param::Fixed(_) | Param::Signal(_) => None,
            },
            sigma,
            rows,
            axes: spec.axes(),
        };
        let sensor = Sensor {
            name: design.name.clone(),
            model,
            port,
            offset: timing.offset,
            constant,
            noise: noise(&common.noise, &info.sigma, reported?),
            quality: quality?,
            gate: gate?,
            loss: loss?,
            switch: switch?,
        };
        let parts = (0..info.rows.len()).map_while(|row| info.model.part(row)).collect::<Vec<_>>();
        if parts.is_empty() {
            return Some(vec![(sensor, info)]);
        }
        let parts = parts.into_iter().enumerate();
        parts.map(|(row, model)| self.part(design, (&sensor, &info), row, model)).collect()
    }

    /// The sensor for row `row` of the sensor `whole`, with its own gate and loss.
    fn part(
        &self,
        design: &Named<SensorDesign>,
        (whole, of): (&Sensor, &SensorInfo),
        row: usize,
        model: Box<dyn Measurement>,
    ) -> Option<(Sensor, SensorInfo)> {
        let model: Arc<dyn Measurement> = model.into();
        let axis = of.axes.get(row).map_or_else(|| row.to_string(), |axis| (*axis).to_owned());
        let info = SensorInfo {
            name: format!("{}.{axis}", of.name),
            model: model.clone(),
            design: of.design,
            whole: of.whole.clone(),
            stream: of.stream.clone(),
            channels: vec![of.channels.get(row)?.clone()],
            delay: of.delay,
            offset: of.offset,
            sigma: vec![of.sigma[row]],
            rows: vec![of.rows[row]],
            axes: &[],
        };
        let sensor = Sensor {
            name: info.name.clone(),
            model,
            port: Port {
                columns: vec![*whole.port.columns.get(row)?],
                ..whole.port.clone()
            },
            offset: whole.offset.clone(),
            constant: Vec::new(),
            noise: Noise::diagonal(&info.sigma),
            quality: whole.quality,
            // Built before without a mistake.
            gate: gate(design, &info.rows, self.has_bank()).ok()?,
            loss: loss(design).ok()?,
            switch: whole.switch.clone(),
        };
        Some((sensor, info))
    }

    /// When the rows of `stream` are valid for a sensor with this time offset.
    fn timing(&self, offset: &Param<Scalar>, stream: StreamId) -> Result<Timing, BuildError> {
        let layout = self.layout.so_far();
        let (declared, sigma) = match offset {
            Param::State(slot) => (slot.read(layout.initial()), layout.block_of(*slot).map_or(0.0, |b| b.sigma[0])),
            fixed => (fixed.stored(&[]).unwrap_or(0.0), 0.0),
        };
        check_delay("time_offset", declared)?;
        let [above, below] = REACH.map(|reach| reach * sigma);
        let (least, most) = (declared - below, declared + above);
        check_delay("time_offset", most).map_err(|e| BuildError {
            message: format!("`initial` and {} times `sigma` are too much: {}", REACH[0], e.message),
            ..e
        })?;
        // A stage has its rows when they are stamped, and not before.
        let is_late = declared > 0.0 && self.is_emitted(stream);
        let is_moved = is_late || matches!(offset, Param::State(_));
        let value = offset.clone();
        let offset = is_moved.then_some(Offset { value, least, most });
        Ok(Timing { declared, most, offset })
    }

    /// Whether a stage of this design emits the stream.
    pub(super) fn is_emitted(&self, stream: StreamId) -> bool {
        let name = &self.streams[stream].name;
        let filters = self.design.filters.iter().map(|f| &f.name);
        self.design.stages.iter().map(|s| &s.name).chain(filters).any(|stage| stage == name)
    }

    /// The columns in which the source reports the sensor's 1σ.
    fn reported(&mut self, stream: StreamId, spec: &dyn SensorSpec, node: &Node) -> Option<Vec<usize>> {
        let Some(sigma) = spec.reported_sigma() else {
            let message = "`from_source` is for a sensor that reads one channel: no source reports this noise";
            let help = "write its 1σ, e.g. `noise = { sigma = … }`";
            self.d
                .push(Diagnostic::error(message).at(node.place_of("noise.from_source")).help(help));
            return None;
        };
        let (found, rows) = (self.channel(stream, &sigma, node)?, spec.noise().len());
        if found.width == 1 {
            return Some(vec![found.offset; rows]);
        }
        Some((found.offset..found.offset + found.width).take(rows).collect())
    }

    /// The column in which the source says how good a row is.
    fn quality(&mut self, stream: StreamId, name: &str, node: &Node) -> Option<usize> {
        let channel = Channel {
            name: name.to_owned().into(),
            ..Channel::vector("", 1, Dimension::NONE)
        };
        Some(self.channel(stream, &channel, node)?.offset)
    }

    /// The rows that switch a sensor.
    fn switch(&mut self, spec: &SwitchSpec, node: &Node) -> Option<Switch> {
        let listen = spec.listen();
        let port = self.port(&listen.source, &listen.channels, node.get("switch").unwrap_or(node));
        Some(Switch {
            port: port?,
            has_use: spec.used.is_some(),
            has_noise: spec.noise.is_some(),
        })
    }

    /// The gates of all sensors as they are built, in order of their numbers: for another member of a bank.
    pub(super) fn gates(&self, infos: &[SensorInfo]) -> Vec<Box<dyn Gate>> {
        let at = |name: &str| infos.iter().position(|s| s.name == name);
        let build = |info: &SensorInfo| {
            let design = &self.design.sensors[info.design];
            // They were built before without a mistake.
            let own = gate(design, &info.rows, true).unwrap_or_else(|_| Box::new(Open));
            let leader = design
                .block
                .common
                .only_with
                .as_ref()
                .and_then(|spec| Some((at(&spec.sensor)?, spec.memory.si())));
            match leader {
                Some((leader, memory)) => Box::new(OnlyWith::new(leader, memory, own)),
                None => own,
            }
        };
        infos.iter().map(build).collect()
    }

    /// Returns true if the filter is a bank, or if `[filter]` could not be read.
    fn has_bank(&self) -> bool {
        self.design.filter.bank.is_some() || self.design.unread.filter
    }

    /// Lays the gate policy `only_with` over the sensors' own gates.
    pub(super) fn link(&mut self, sensors: &mut [Sensor], infos: &[SensorInfo]) {
        let at = |name: &str| infos.iter().position(|info| info.name == name);
        for (sensor, info) in sensors.iter_mut().zip(infos) {
            let design = &self.design.sensors[info.design];
            let Some(spec) = &design.block.common.only_with else { continue };
            if let Some(leader) = at(&spec.sensor) {
                let own = core::mem::replace(&mut sensor.gate, Box::new(Open));
                sensor.gate = Box::new(OnlyWith::new(leader, spec.memory.si(), own));
            } else if infos.iter().any(|info| self.design.sensors[info.design].name == spec.sensor) {
                let message = format!(
                    "`only_with` cannot name `{}`: its rows (beams) are gated one by one, and there is no single decision to follow",
                    spec.sensor
                );
                let place = design.node.place_of("only_with");
                let help = "let both go with a third sensor, or give this one its own gate";
                self.d.push(Diagnostic::error(message).at(place).help(help));
            }
        }
    }
}

/// The declared 1σ of each row; zeros where only the source reports it.
fn sigma(design: &Named<SensorDesign>, rows: &[Dimension]) -> Result<Vec<f64>, Diagnostic> {
    let node = &design.node;
    let NoiseSpec { sigma, from_source, .. } = &design.block.common.noise;
    let sigma = match sigma {
        Some(sigma) => sigma
            .si::<range::NonNegative>(rows)
            .map_err(|why| Diagnostic::error(why.to_string()).at(node.place_of(&why.path(sigma_path(node)))))?,
        None if *from_source => vec![0.0; rows.len()],
        None => {
            let message = format!("`{}` has no noise", design.name);
            let help = "add `sigma = …` to it, or write the 1σ alone, as in `noise = \"5 cm\"`; or `noise = { from_source = true }` to take the 1σ the source reports";
            return Err(Diagnostic::error(message).at(node.name_place()).help(help));
        }
    };
    if !from_source && sigma.contains(&0.0) {
        let singular = Diagnostic::error("the noise of a measurement must be greater than zero: without noise the filter is singular");
        let help = "write a small sigma instead of zero";
        let path = sigma_path(node);
        let element = sigma.iter().position(|s| *s == 0.0).map(|index| format!("{path}.{index}"));
        let place = element
            .filter(|element| node.at(element).is_some())
            .unwrap_or_else(|| path.to_owned());
        return Err(singular.at(node.place_of(&place)).help(help));
    }
    Ok(sigma)
}

/// Where the 1σ is written: in the table of the noise, or as the noise itself.
fn sigma_path(node: &Node) -> &'static str {
    let is_table = node.at("noise.sigma").is_some();
    if is_table { "noise.sigma" } else { "noise" }
}

fn noise(spec: &NoiseSpec, sigma: &[f64], reported: Vec<usize>) -> Noise {
    let mut noise = Noise::diagonal(sigma);
    if spec.from_source {
        noise.sigma_columns = reported;
        noise.scale = spec.scale.map_or(1.0, |s| s.si());
    }
    noise
}

fn gate(design: &Named<SensorDesign>, rows: &[Dimension], has_bank: bool) -> Result<Box<dyn Gate>, Diagnostic> {
    let Some(gate) = &design.block.gate else {
        return Ok(Box::new(Open));
    };
    let node = design.node.at("gate").unwrap_or(&design.node);
    if gate.needs_quality() && design.block.common.quality.is_none() {
        let message = "this gate needs the `quality` channel of the sensor, and none is declared";
        let help = "write beside `source` which channel says how good a row is, e.g. `quality = \"hdop\"`";
        return Err(Diagnostic::error(message).at(node.place_of("magnitude")).help(help));
    }
    if gate.needs_bank() && !has_bank {
        let message = "the gate `hypotheses` needs a bank of hypotheses, and this design has none";
        let help = "add `[filter.bank]`, or `bank = {}` under [filter]";
        return Err(Diagnostic::error(message).at(node.place()).help(help));
    }
    let built = gate.suits(rows).and_then(|()| gate.build());
    built.map_err(|e| node.locate(&e))
}

fn loss(design: &Named<SensorDesign>) -> Result<Arc<dyn Loss>, Diagnostic> {
    let Some(loss) = &design.block.loss else {
        return Ok(Arc::new(Quadratic));
    };
    let built = loss.build().map(Into::into);
    built.map_err(|e| design.node.at("loss").unwrap_or(&design.node).locate(&e))
}
