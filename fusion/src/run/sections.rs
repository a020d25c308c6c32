//! The sections of a run that need no event. They are made at the end.

use super::Finding;
use crate::design::{Design, of_a_sensor};
use crate::observe::{Keyed, Listed, RunEnd, Section, Summary};
use crate::provenance::Provenance;
use crate::rows::SourceStatistics;
use crate::score::Score;
use fusion_core::runner::Tested;
use fusion_models::sim::Record;
use schemars::JsonSchema;
use serde::Serialize;
use std::sync::LazyLock;

/// The identity of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Identity {
    /// The description in the design.
    pub description: String,
    /// The provenance of the run.
    pub provenance: Provenance,
}

impl Identity {
    /// The identity of the run that ends.
    pub(super) fn of(end: &RunEnd<'_>) -> Self {
        Self {
            description: end.design.run.description.clone(),
            provenance: Provenance::of(end.design, end.seed),
        }
    }
}

impl Section for Identity {
    const NAME: &'static str = "identity";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![("description", &self.description), ("provenance", &self.provenance)]
    }
}

/// How the filter computes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Computation {
    /// The backend: chart, update, form.
    pub backend: String,
    /// The instruction set used; another instruction set rounds differently.
    pub kernel: &'static str,
}

impl Computation {
    /// The computation of a design.
    pub(super) fn of(design: &Design) -> Self {
        Self {
            backend: design.filter.backend_name(),
            kernel: design.filter.kernel.unwrap_or_default().name(),
        }
    }
}

impl Section for Computation {
    const NAME: &'static str = "computation";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![("backend", &self.backend), ("kernel", &self.kernel)]
    }
}

/// The test results of a detector stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Detector {
    /// The stage.
    pub stage: String,
    /// How often it tested since the filter started.
    pub tests: u64,
    /// How often the tested condition held.
    pub held: u64,
    /// The nearest miss if the condition never held, with the limits missed.
    pub nearest: Option<String>,
}

impl From<(String, Tested)> for Detector {
    fn from((stage, tested): (String, Tested)) -> Self {
        let Tested { tests, held, nearest } = tested;
        Self {
            stage,
            tests,
            held,
            nearest,
        }
    }
}

impl Listed for Detector {
    const NAME: &'static str = "detectors";
}

/// Whether the reference is independent of the sensors.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct JudgedBy {
    /// The source of a sensor, if other rows of it are the reference: both then have the same slow errors.
    #[schemars(rename = "judged_by")]
    pub source: Option<String>,
    /// True if the filter uses rows of the reference: the errors then only show how closely it follows these rows.
    #[schemars(rename = "judged_by_used_rows")]
    pub used_rows: bool,
}

impl JudgedBy {
    /// The judge of a design.
    pub(super) fn of(design: &Design) -> Self {
        let judge = of_a_sensor(design);
        Self {
            source: judge.map(|(source, _)| source.to_owned()),
            used_rows: judge.is_some_and(|(_, is_used)| is_used),
        }
    }
}

impl Section for JudgedBy {
    const NAME: &'static str = "judge";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![("judged_by", &self.source), ("judged_by_used_rows", &self.used_rows)]
    }
}

/// The estimates as known at the time, for a filter that uses rows as they arrive.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Current {
    /// Their score against the reference.
    pub score: Option<Score>,
    /// How often the filter went back for a row that came late.
    pub rewinds: u64,
    /// Rows that were used again, in total.
    pub rows_again: u64,
    /// The largest number of rows used again at once.
    pub most_rows_again: u64,
    /// The longest computing time of a row, including all rows used again for it \[s\].
    pub longest_seconds: f64,
    /// Size of the snapshots and rows kept for going back, at the end of the run, in bytes.
    pub memory: usize,
}

impl Current {
    /// The current estimates of the run that ends; `None` if its filter does not go back.
    pub(super) fn of(end: &RunEnd<'_>) -> Option<Self> {
        let rewinds = end.assembly.runner.rewinds()?;
        Some(Self {
            score: end.current.as_ref().and_then(Summary::score).cloned(),
            rewinds: rewinds.count,
            rows_again: rewinds.rows,
            most_rows_again: rewinds.most,
            longest_seconds: end.timing.longest(),
            memory: rewinds.bytes,
        })
    }
}

impl Section for Current {
    const NAME: &'static str = "current";
}

impl Section for Record {
    const NAME: &'static str = "control";
}

impl Listed for SourceStatistics {
    const NAME: &'static str = "sources";
}

/// The time that a run takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Effort {
    /// Wall time of the whole run \[s\].
    pub wall_seconds: f64,
    /// Time in the filter alone, per estimate \[ns\].
    pub filter_ns_per_epoch: f64,
}

impl Section for Effort {
    const NAME: &'static str = "effort";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![
            ("wall_seconds", &self.wall_seconds),
            ("filter_ns_per_epoch", &self.filter_ns_per_epoch),
        ]
    }
}

/// The sections of a run by name. Those with observers are next to their observers.
impl Summary {
    /// The identity of the run.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        static NONE: LazyLock<Identity> = LazyLock::new(Identity::default);
        self.get().unwrap_or(&NONE)
    }

    /// The findings, most important first.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        self.list()
    }

    /// How the filter computes.
    #[must_use]
    pub fn computation(&self) -> &Computation {
        static NONE: LazyLock<Computation> = LazyLock::new(Computation::default);
        self.get().unwrap_or(&NONE)
    }

    /// The test results of the detector stages.
    #[must_use]
    pub fn detectors(&self) -> &[Detector] {
        self.list()
    }

    /// Whether the reference is independent of the sensors.
    #[must_use]
    pub fn judge(&self) -> &JudgedBy {
        static NONE: LazyLock<JudgedBy> = LazyLock::new(JudgedBy::default);
        self.get().unwrap_or(&NONE)
    }

    /// The estimates as known at the time, for a design that uses rows as they arrive; the other sections include
    /// later rows.
    #[must_use]
    pub fn current(&self) -> Option<&Current> {
        self.get()
    }

    /// How well a controlled vehicle was steered; `None` without a controlled vehicle.
    #[must_use]
    pub fn control(&self) -> Option<&Record> {
        self.get()
    }

    /// The sources.
    #[must_use]
    pub fn sources(&self) -> &[SourceStatistics] {
        self.list()
    }

    /// The time that the run took.
    #[must_use]
    pub fn effort(&self) -> Effort {
        self.get().copied().unwrap_or_default()
    }
}
