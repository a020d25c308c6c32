//! The JSON Schema of summary.json.

use super::{Computation, Current, Detector, Effort, FaultWindow, Finding, Identity, JudgedBy, SourceStatistics};
use crate::health::FilterHealth;
use crate::observe::{
    ConsumerCounts, Counts, Excess, Failures, FinalState, Hypotheses, InsideScore, RunSection, SensorStatistics, Smoothed, Start,
    UnusedRows,
};
use crate::score::Score;
use fusion_models::sim::Record;
use schemars::{JsonSchema, schema_for};
use serde_json::Value;

/// The result of a run, as summary.json has it. An observer of another crate adds further keys.
#[derive(JsonSchema)]
#[schemars(title = "fusion summary")]
#[expect(dead_code, reason = "the fields serve the schema alone")]
struct Summary {
    #[schemars(flatten)]
    identity: Identity,
    /// The findings of advice.
    findings: Vec<Finding>,
    #[schemars(flatten)]
    computation: Computation,
    /// The health of each filter.
    health: Vec<FilterHealth>,
    #[schemars(flatten)]
    start: Start,
    /// The tests of detectors, such as that of a vehicle at rest.
    detectors: Vec<Detector>,
    #[schemars(flatten)]
    counts: Counts,
    /// The bank of hypotheses; null without one.
    hypotheses: Option<Hypotheses>,
    #[schemars(flatten)]
    judge: JudgedBy,
    /// The errors against the reference; null without one.
    score: Option<Score>,
    /// The smoother; null without one.
    smoothed: Option<Smoothed>,
    /// The estimates at the time, if the filter goes back for late rows.
    current: Option<Current>,
    /// The errors of filters inside stages.
    inside: Vec<InsideScore>,
    /// The faults of a stress test.
    faults: Vec<FaultWindow>,
    /// How well a simulated vehicle kept its tasks; null without a control.
    control: Option<Record>,
    /// The measurements of each sensor.
    sensors: Vec<SensorStatistics>,
    /// Where a sensor contradicted the others.
    excesses: Vec<Excess>,
    /// The rows of each source.
    sources: Vec<SourceStatistics>,
    /// The parameters at the end.
    parameters: Vec<FinalState>,
    /// The rows that each block took from its stream.
    consumers: Vec<ConsumerCounts>,
    /// Rows that nothing used: the block and their number.
    unused_rows: UnusedRows,
    /// Further tables, made for readers; absent without one.
    #[schemars(default)]
    sections: Vec<RunSection>,
    #[schemars(flatten)]
    failures: Failures,
    #[schemars(flatten)]
    effort: Effort,
}

/// The schema of summary.json, as the observers of this crate write it.
#[must_use]
pub fn summary_schema() -> Value {
    schema_for!(Summary).to_value()
}
