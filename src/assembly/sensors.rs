//! Sensors: a measurement model with its port, its noise, its gate and its loss.

use super::assemble::Assembler;
use crate::config::{Diagnostic, Node};
use crate::design::{Named, NoiseSpec, SensorDesign};
use fusion_core::gate::{Gate, OnlyWith, Open};
use fusion_core::loss::{Loss, Quadratic};
use fusion_core::model::Measurement;
use fusion_core::runner::{Noise, Sensor, StreamId};
use fusion_core::time::nanos;
use fusion_models::block::{Channel, Reading, SensorSpec, check_delay};
use fusion_models::units::{Dimension, range};
use std::sync::Arc;

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

impl<P> Assembler<'_, P> {
    /// Connects a sensor whose model has been built; its other mistakes are found without a model.
    pub(super) fn sensor(&mut self, design: &Named<SensorDesign>, model: Option<Arc<dyn Measurement>>) -> Option<(Sensor, SensorInfo)> {
        let SensorDesign { model: spec, common, .. } = &design.block;
        let node = &design.node;
        let rows = spec.noise();
        let (channel, constant) = match spec.reading() {
            Reading::Channel(channel) => (Some(channel), Vec::new()),
            Reading::Constant(value) => (None, value),
        };
        let port = self.port(&common.source, channel.as_slice(), node);
        let delay = self.d.keep(check_delay("time_offset", spec.delay()).map_err(|e| node.locate(&e)));
        let sigma = self.d.keep(sigma(design, &rows));
        let reported = match &port {
            Some(port) if common.noise.from_source => self.reported(port.stream, spec.as_ref(), node),
            _ => Some(Vec::new()),
        };
        let quality = match (&port, &common.quality) {
            (Some(port), Some(name)) => self.quality(port.stream, name, node).map(Some),
            _ => Some(None),
        };
        let gate = self.d.keep(gate(design, &rows));
        let loss = self.d.keep(loss(design));
        let (model, mut port, sigma) = (model?, port?, sigma?);
        delay?;
        port.delay += nanos(spec.delay());
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
        let sensor = Sensor {
            name: design.name.clone(),
            model,
            port,
            constant,
            noise: noise(&common.noise, &info.sigma, reported?),
            quality: quality?,
            gate: gate?,
            loss: loss?,
        };
        Some((sensor, info))
    }

    /// The columns in which the source reports the sensor's 1σ.
    fn reported(&mut self, stream: StreamId, spec: &dyn SensorSpec, node: &Node) -> Option<Vec<usize>> {
        let Some(sigma) = spec.reported_sigma() else {
            let message = "a pseudo-measurement has no source that could report its noise";
            self.d.push(Diagnostic::error(message).at(node.place_of("noise.from_source")));
            return None;
        };
        let found = self.channel(stream, &sigma, node)?;
        Some((found.offset..found.offset + found.width).collect())
    }

    /// The column in which the source says how good a row is.
    fn quality(&mut self, stream: StreamId, name: &str, node: &Node) -> Option<usize> {
        let channel = Channel {
            name: name.to_owned().into(),
            ..Channel::vector("", 1, Dimension::NONE)
        };
        Some(self.channel(stream, &channel, node)?.offset)
    }

    /// Lays the gate policy `only_with` over the sensor's own gate.
    pub(super) fn link(design: &Named<SensorDesign>, sensors: &mut [Sensor]) {
        let at = |name: &str| sensors.iter().position(|s| s.name == name);
        let Some(spec) = &design.block.common.only_with else { return };
        if let (Some(leader), Some(follower)) = (at(&spec.sensor), at(&design.name)) {
            let gate = &mut sensors[follower].gate;
            let own = core::mem::replace(gate, Box::new(Open));
            *gate = Box::new(OnlyWith::new(leader, spec.memory.si(), own));
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
            .map_err(|why| Diagnostic::error(why.to_string()).at(node.place_of("noise.sigma")))?,
        None if *from_source => vec![0.0; rows.len()],
        None => {
            let message = format!("`{}` has no noise", design.name);
            let help = "add `noise = { sigma = … }`, or `noise = { from_source = true }` to take the 1σ the source reports";
            return Err(Diagnostic::error(message).at(node.name_place()).help(help));
        }
    };
    if !from_source && sigma.contains(&0.0) {
        let singular = Diagnostic::error("a measurement without noise makes the filter singular");
        let help = "write a small sigma instead of zero";
        return Err(singular.at(node.place_of("noise.sigma")).help(help));
    }
    Ok(sigma)
}

fn noise(spec: &NoiseSpec, sigma: &[f64], reported: Vec<usize>) -> Noise {
    let mut noise = Noise::diagonal(sigma);
    if spec.from_source {
        noise.sigma_columns = reported;
        noise.scale = spec.scale.map_or(1.0, |s| s.si());
    }
    noise
}

fn gate(design: &Named<SensorDesign>, rows: &[Dimension]) -> Result<Box<dyn Gate>, Diagnostic> {
    let Some(gate) = &design.block.gate else {
        return Ok(Box::new(Open));
    };
    let node = design.node.at("gate").unwrap_or(&design.node);
    if gate.needs_quality() && design.block.common.quality.is_none() {
        let message = "this gate judges by a number that the sensor does not name";
        let help = "write beside `source` which channel says how good a row is, e.g. `quality = \"hdop\"`";
        return Err(Diagnostic::error(message).at(node.place_of("magnitude")).help(help));
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
