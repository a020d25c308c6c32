//! Sensors with `enabled = false` in a simulated world.
//!
//! Their instruments stay where another block reads their streams. A stage that reads such a stream and that no other
//! block reads is left out with the sensor.

use super::read::Draft;
use super::{Named, SensorDesign, SwitchSpec};
use crate::config::Node;
use fusion_models::block::Listen;
use fusion_models::sim::instruments;

/// A stage, and what it reads.
struct Reader {
    name: String,
    inputs: Vec<Listen>,
}

impl Draft {
    /// Leaves out the stages that have no use without the sensors that are left out. Returns the names of the sensors
    /// among these whose streams other blocks read.
    pub(super) fn leave_out(&mut self, simulation: &Node) -> Vec<String> {
        let simulated = simulation.get("sensor");
        let is_simulated = |sensor: &&Named<SensorDesign>| simulated.is_some_and(|all| all.get(&sensor.name).is_some());
        let (absent, present): (Vec<_>, Vec<_>) = [&self.left_out, &self.sensors]
            .map(|all| all.iter().filter(is_simulated).collect::<Vec<_>>())
            .into();
        if absent.is_empty() {
            return Vec::new();
        }
        let stages = self.readers();
        let platforms = simulation.get("platform").map_or(&[][..], Node::entries);
        let own = instruments(platforms.iter().map(|platform| platform.key.as_str()));
        let own = own.into_iter().filter(|(_, table)| simulation.at(table).is_some());
        let driving = self.process.iter().filter_map(|process| process.block.source.clone());
        let others = stages.iter().map(|stage| stage.name.clone()).chain(own.map(|(stream, _)| stream));
        let others: Vec<String> = others.chain(driving).collect();
        // As the assembler looks for a stream: by the name of the sensor, or by that of its source.
        let serves = |sensor: &&Named<SensorDesign>, listen: &Listen| {
            let reading = sensor.block.model.reading();
            let has = |name: &str| reading.channels().iter().any(|channel| channel.name == name);
            [&sensor.name, &sensor.block.common.source].contains(&&listen.source) && listen.channels.iter().all(|c| has(&c.name))
        };
        let is_absent = |sensor: &&Named<SensorDesign>, listen: &Listen| {
            let is_elsewhere = others.contains(&listen.source) || present.iter().any(|other| serves(other, listen));
            !is_elsewhere && serves(sensor, listen)
        };
        let (mut read, mut idle) = (self.reads(), stages);
        let reference = self.document.root().at("reference.source").and_then(Node::as_str);
        while let Some(at) = idle.iter().position(|stage| {
            let is_read = |listen: &Listen| listen.source == stage.name;
            reference == Some(&stage.name) || read.iter().any(is_read)
        }) {
            read.extend(idle.swap_remove(at).inputs);
        }
        let mut dropped: Vec<String> = Vec::new();
        while let Some(at) = idle.iter().position(|stage| {
            let is_lost = |listen: &Listen| dropped.contains(&listen.source) || absent.iter().any(|sensor| is_absent(sensor, listen));
            stage.inputs.iter().any(is_lost)
        }) {
            dropped.push(idle.swap_remove(at).name);
        }
        let is_read = |sensor: &&&Named<SensorDesign>| read.iter().any(|listen| is_absent(sensor, listen));
        let kept = absent.iter().filter(is_read).map(|sensor| sensor.name.clone()).collect();
        self.stages.retain(|stage| !dropped.contains(&stage.name));
        self.filters.retain(|filter| !dropped.contains(&filter.name));
        kept
    }

    /// The stages, those that are filters among them.
    fn readers(&self) -> Vec<Reader> {
        let stages = self.stages.iter().map(|stage| Reader {
            name: stage.name.clone(),
            inputs: stage.block.inputs(),
        });
        let filters = self.filters.iter().map(|filter| Reader {
            name: filter.name.clone(),
            inputs: filter.block.reads_outside(),
        });
        stages.chain(filters).collect()
    }

    /// The streams that all blocks but the stages read.
    fn reads(&self) -> Vec<Listen> {
        let process = self.process.iter().filter_map(|process| {
            Some(Listen {
                source: process.block.source.clone()?,
                channels: process.block.model.input(),
            })
        });
        let sensors = self.sensors.iter().map(|sensor| Listen {
            source: sensor.block.common.source.clone(),
            channels: sensor.block.model.reading().channels().to_vec(),
        });
        let switches = self.sensors.iter().filter_map(|sensor| sensor.block.common.switch.as_ref());
        let switches = switches.map(SwitchSpec::listen);
        let initialisers = self.initialisers.iter().flat_map(|start| start.block.inputs());
        process.chain(sensors).chain(switches).chain(initialisers).collect()
    }

    /// The outer streams that a filter inside a stage reads.
    fn reads_outside(&self) -> Vec<Listen> {
        let stages = self.readers();
        let mut all = self.reads();
        all.extend(stages.iter().flat_map(|stage| stage.inputs.iter().cloned()));
        all.retain(|listen| stages.iter().all(|stage| stage.name != listen.source));
        all
    }
}
