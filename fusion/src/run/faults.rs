//! The declared faults of a run.

use crate::assembly::{Assembly, stream_of};
use crate::design::{Design, Fault};
use crate::observe::{Listed, RunEnd, Summary};
use crate::rows::outages as silences;
use crate::score::Outage;
use fusion_core::time::Time;
use fusion_models::fault::Window;
use schemars::JsonSchema;
use serde::Serialize;

/// A stretch of time in which a declared fault is at work.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FaultWindow {
    /// The source or simulated stream.
    pub stream: String,
    /// The name of the fault.
    pub fault: String,
    /// Its beginning \[s\].
    pub from: f64,
    /// Its end \[s\], or the end of the run.
    pub to: f64,
}

impl Listed for FaultWindow {
    const NAME: &'static str = "faults";
}

impl Summary {
    /// When declared faults were active, ordered by their beginnings; faults that are always active are left out.
    #[must_use]
    pub fn faults(&self) -> &[FaultWindow] {
        self.list()
    }
}

/// The declared faults of each stream.
fn declared_faults(design: &Design) -> Vec<(&str, &[Fault])> {
    let recorded = design
        .sources
        .iter()
        .map(|named| (named.name.as_str(), named.block.faults.as_slice()));
    let simulated = design.simulation.iter().flat_map(|s| &s.block.faults);
    let simulated = simulated.map(|(stream, faults)| (stream_of(design, stream), faults.as_slice()));
    if design.simulation.is_some() {
        simulated.collect()
    } else {
        recorded.collect()
    }
}

/// The greatest number of windows kept of a fault.
const FAULT_WINDOWS: usize = 1000;

/// The windows of all faults from the start of the filter to the end of the run, by their beginnings.
pub(super) fn fault_windows(end: &RunEnd<'_>) -> Vec<FaultWindow> {
    let Some(from) = end.shared.started.map(Time::from_seconds) else {
        return Vec::new();
    };
    let to = end.assembly.runner.belief().time;
    let streams = declared_faults(end.design).into_iter();
    let all = streams.flat_map(|(stream, faults)| faults.iter().map(move |fault| (stream, fault)));
    let windows = all.flat_map(|(stream, (name, fault))| {
        let windows: Vec<Window> = fault.windows().within(Window { from, to }).take(FAULT_WINDOWS).collect();
        windows.into_iter().map(move |w| FaultWindow {
            stream: stream.to_owned(),
            fault: name.clone(),
            from: w.from.max(from).seconds(),
            to: w.to.min(to).seconds(),
        })
    });
    let mut windows: Vec<FaultWindow> = windows.collect();
    windows.sort_by(|a, b| a.from.total_cmp(&b.from));
    windows
}

/// The declared outages, each with the sensors of the outermost filter that read the silent stream.
pub(super) fn outages(design: &Design, assembly: &Assembly) -> Vec<Outage> {
    let streams = declared_faults(design);
    let reads = |name: &str| {
        let stream = assembly.streams.iter().position(|s| s.name == name);
        let sensors = assembly.runner.sensors().iter().enumerate();
        let readers = sensors.filter(move |(_, sensor)| Some(sensor.port.stream) == stream);
        readers.map(|(number, _)| number).collect()
    };
    let silent = streams
        .into_iter()
        .flat_map(|(name, faults)| silences(faults).map(move |w| (name, w)));
    silent
        .map(|(name, windows)| Outage {
            windows: windows.clone(),
            sensors: reads(name),
        })
        .collect()
}
