//! The blocks of a design, built and connected, before there is an estimator.

use super::{Assembly, Inside, SensorInfo, StreamLayout};
use fusion_core::filter::{Backend, Estimator, Filter};
use fusion_core::health::Limits;
use fusion_core::model::{Process, Size};
use fusion_core::runner::{InitialiserUnit, InputLimits, Port, Runner, Sensor, StageUnit};
use fusion_core::state::Layout;
use fusion_models::earth::Gravity;
use std::sync::Arc;

/// All that a filter and its runner are made of. Times are in seconds.
#[derive(Debug)]
pub struct Plan {
    /// The state layout.
    pub layout: Arc<Layout>,
    /// The process model.
    pub process: Arc<dyn Process>,
    /// The backend.
    pub backend: Backend,
    /// The largest measurement.
    pub largest: Size,
    /// How late a row may be.
    pub reorder: f64,
    /// The limits of health.
    pub limits: Limits,
    /// All streams, in order of their numbers.
    pub streams: Vec<StreamLayout>,
    /// The input of the process.
    pub input: Option<(Port, InputLimits)>,
    /// The sensors.
    pub sensors: Vec<Sensor>,
    /// The stages.
    pub stages: Vec<StageUnit>,
    /// The initialisers.
    pub initialisers: Vec<InitialiserUnit>,
    /// How far ahead of all others a stamp may be.
    pub longest_jump: Option<f64>,
    /// After what time a lost filter starts anew.
    pub restart_lost: Option<f64>,
    /// After what silence a filter without input starts anew.
    pub restart_after: Option<f64>,
    pub(super) infos: Vec<SensorInfo>,
    pub(super) inside: Vec<Inside>,
    pub(super) gravity: Gravity,
    pub(super) fingerprint: u64,
}

impl Plan {
    /// A hash of what the design declares for its filter: its checkpoints have it.
    #[must_use]
    pub const fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// A filter of this plan.
    #[must_use]
    pub fn filter(&self) -> Filter {
        Filter::new(self.layout.clone(), self.process.clone(), self.backend, self.largest)
    }

    /// The runner that drives `estimator`, and what it consists of.
    #[must_use]
    pub fn assembly(self, estimator: Box<dyn Estimator>) -> Assembly {
        let mut runner = Runner::new(estimator, self.process.clone(), self.reorder);
        runner.set_limits(self.limits);
        for stream in &self.streams {
            runner.add_stream(&stream.name, stream.width());
        }
        if let Some((input, limits)) = self.input {
            runner.set_input(input);
            runner.limit_input(limits);
        }
        self.sensors.into_iter().for_each(|s| runner.add_sensor(s));
        self.stages.into_iter().for_each(|s| runner.add_stage(s));
        self.initialisers.into_iter().for_each(|s| runner.add_initialiser(s));
        if let Some(seconds) = self.longest_jump {
            runner.limit_jumps(seconds);
        }
        if let Some(seconds) = self.restart_lost {
            runner.restart_lost(seconds);
        }
        if let Some(seconds) = self.restart_after {
            runner.restart_after(seconds);
        }
        Assembly {
            runner,
            layout: self.layout,
            process: self.process,
            sensors: self.infos,
            streams: self.streams,
            filters: self.inside,
            gravity: self.gravity,
            fingerprint: self.fingerprint,
        }
    }
}
