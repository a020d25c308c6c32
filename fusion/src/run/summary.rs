//! The result of a run.

use super::Finding;
use crate::health::FilterHealth;
use crate::observe::{ConsumerCounts, Excess, FinalState, Hypotheses, RunSection, SensorStatistics, Wait};
use crate::provenance::Provenance;
use crate::rows::SourceStatistics;
use crate::score::Score;
use fusion_core::runner::Tested;
use fusion_models::sim::Record;
use serde::Serialize;

/// The smallest share of the log before the start that is reported. With uniform errors, one twentieth changes an RMS
/// by 2.5 % at most.
const LATE: f64 = 0.05;
/// A wait too short to report: levelling takes about one second of any log \[s\].
const BRIEF: f64 = 2.0;

/// The test results of a detector stage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
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

/// The score of a filter inside a stage. Its sensors and parameters are listed with those of the other filters.
#[derive(Clone, Debug, Serialize)]
pub struct InsideScore {
    /// The stage's name, after those of the stages around it, with dots.
    pub filter: String,
    /// Its score against the reference.
    pub score: Score,
}

/// The estimates smoothed with later data.
#[derive(Clone, Debug, Serialize)]
pub struct Smoothed {
    /// Lag: data up to this time after an estimate were used \[s\]; `None` for the whole log.
    pub lag: Option<f64>,
    /// Number of smoothed estimates: those with a row in smoothed.csv, and those around an epoch of the
    /// reference.
    pub estimates: u64,
    /// Their score against the reference.
    pub score: Option<Score>,
}

/// The estimates as known at the time, for a filter that uses rows as they arrive.
#[derive(Clone, Debug, Serialize)]
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

/// A stretch of time in which a declared fault is at work.
#[derive(Clone, Debug, PartialEq, Serialize)]
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

/// The result of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// The description in the design.
    pub description: String,
    /// The provenance of the run.
    pub provenance: Provenance,
    /// The findings, most important first.
    pub findings: Vec<Finding>,
    /// The backend: chart, update, form.
    pub backend: String,
    /// The instruction set used; another instruction set rounds differently.
    pub kernel: &'static str,
    /// The self-reported health of the filters: first the outermost filter, then the filters inside stages.
    pub health: Vec<FilterHealth>,
    /// When the filter started \[s\]; `None` if it never did.
    pub started: Option<f64>,
    /// The part of the log before the first start, and the causes of the wait; `None` if the filter never started.
    pub waited: Option<Wait>,
    /// The attitude or angle with the largest 1σ at the start, and this 1σ \[rad\].
    pub start_angle: Option<(String, f64)>,
    /// The inputs that the filter was still waiting for at the end.
    pub waiting: Vec<(String, String)>,
    /// The test results of the detector stages.
    pub detectors: Vec<Detector>,
    /// Time for which rows are held back, so that late rows are used in order of time \[s\]. The estimate on the
    /// vehicle is this old. 0 if rows are used as they arrive.
    pub held_back: f64,
    /// Estimates made.
    pub epochs: u64,
    /// Samples of the process input that were rejected: spikes, out of range, frozen, not finite, or stamped far
    /// ahead.
    pub refused_samples: u64,
    /// How long the filter coasted without process input \[s\].
    pub coasted: f64,
    /// The statistics of the hypotheses of a bank; `None` without a bank.
    pub hypotheses: Option<Hypotheses>,
    /// The source of a sensor, if other rows of it are the reference: both then have the same slow errors.
    pub judged_by: Option<String>,
    /// True if the filter uses rows of the reference: the errors then only show how closely it follows these rows.
    pub judged_by_used_rows: bool,
    /// Score against the reference.
    pub score: Option<Score>,
    /// The same for smoothed estimates, if requested.
    pub smoothed: Option<Smoothed>,
    /// The estimates as known at the time, for a design that uses rows as they arrive; the other figures
    /// include later rows.
    pub current: Option<Current>,
    /// Scores of the filters inside stages.
    pub inside: Vec<InsideScore>,
    /// When declared faults were active, ordered by their beginnings; faults that are always active are left out.
    pub faults: Vec<FaultWindow>,
    /// How well a controlled vehicle was steered; `None` without a controlled vehicle.
    pub control: Option<Record>,
    /// Per sensor.
    pub sensors: Vec<SensorStatistics>,
    /// For each sensor: of all stretches with innovations larger than chance allows, the stretch in which a
    /// calibration moved farthest.
    pub excesses: Vec<Excess>,
    /// Per source.
    pub sources: Vec<SourceStatistics>,
    /// Estimated parameters at the end.
    pub parameters: Vec<FinalState>,
    /// The outcome of every row, by consumer.
    pub consumers: Vec<ConsumerCounts>,
    /// Rows that came too late or had no number, by consumer.
    pub unused_rows: Vec<(String, u64)>,
    /// Input samples that were taken for spikes; `consumers` has them too, except for one of many runs.
    #[serde(skip)]
    pub spikes: u64,
    /// The sections that observers of other crates made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<RunSection>,
    /// The first ten failures of the estimator.
    pub failures: Vec<String>,
    /// The number of further failures.
    pub further_failures: u64,
    /// Wall time of the whole run \[s\].
    pub wall_seconds: f64,
    /// Time in the filter alone, per estimate \[ns\].
    pub filter_ns_per_epoch: f64,
}

impl Summary {
    /// The wait for the start, if it takes so large a share of the log that the figures do not describe the whole log.
    #[must_use]
    pub fn late_start(&self) -> Option<&Wait> {
        self.waited.as_ref().filter(|wait| wait.share() > LATE && wait.seconds > BRIEF)
    }
}
