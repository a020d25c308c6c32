//! What a run results in.

use super::Finding;
use crate::health::FilterHealth;
use crate::observe::{ConsumerCounts, Excess, FinalState, Hypotheses, SensorStatistics, Wait};
use crate::provenance::Provenance;
use crate::rows::SourceStatistics;
use crate::score::Score;
use fusion_core::runner::Tested;
use fusion_models::sim::Record;
use serde::Serialize;

/// A part of the log before the start that is worth a line. A twentieth changes an RMS by 2.5 % at most, where errors are alike.
const LATE: f64 = 0.05;
/// Levelling takes a second or so of any log \[s\].
const BRIEF: f64 = 2.0;

/// What became of the tests of a stage that is a detector.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Detector {
    /// The stage.
    pub stage: String,
    /// How often it tested since the filter runs.
    pub tests: u64,
    /// How often that held for which it tests.
    pub held: u64,
    /// What was nearest to that where it never held, with the limits that it missed.
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

/// The score of a filter inside a stage. Its sensors and parameters stand beside the others.
#[derive(Clone, Debug, Serialize)]
pub struct InsideScore {
    /// The stage's name, after those of the stages around it, with dots.
    pub filter: String,
    /// Its score against the reference.
    pub score: Score,
}

/// What later data made of the estimates.
#[derive(Clone, Debug, Serialize)]
pub struct Smoothed {
    /// Data were used up to so long after an estimate \[s\]; none for all of the log.
    pub lag: Option<f64>,
    /// Estimates that were smoothed: those with a row in smoothed.csv, and those about an epoch of the
    /// reference.
    pub estimates: u64,
    /// Their score against the reference.
    pub score: Option<Score>,
}

/// What the filter believed at the time, where it uses rows as they arrive.
#[derive(Clone, Debug, Serialize)]
pub struct Current {
    /// Their score against the reference.
    pub score: Option<Score>,
    /// How often the filter went back for a row that came late.
    pub rewinds: u64,
    /// Rows that were used again, in all, and at once at most.
    pub rows_again: u64,
    /// The most at once.
    pub most_rows_again: u64,
    /// The longest that a row took, with all that was used again for it \[s\].
    pub longest_seconds: f64,
    /// Snapshots and rows that are kept to go back to at the end of the run, in bytes.
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
    /// Its end \[s\], or that of the run.
    pub to: f64,
}

/// The result of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// The design's own line about itself.
    pub description: String,
    /// What the run was made of.
    pub provenance: Provenance,
    /// What to look at next, the first first.
    pub findings: Vec<Finding>,
    /// The backend: chart, update, form.
    pub backend: String,
    /// What computed: the instructions of the processor. Another one rounds differently.
    pub kernel: &'static str,
    /// What the filters said of themselves: the design's own first, then those inside stages.
    pub health: Vec<FilterHealth>,
    /// When the filter started \[s\]; none if it never did.
    pub started: Option<f64>,
    /// What of the log lies before the first start, and what that was for; none if it never did.
    pub waited: Option<Wait>,
    /// The attitude or angle that was known least at the start, and its largest 1σ \[rad\].
    pub start_angle: Option<(String, f64)>,
    /// What it was still waiting for at the end.
    pub waiting: Vec<(String, String)>,
    /// What became of the tests of the stages that are detectors.
    pub detectors: Vec<Detector>,
    /// For how long rows are held back, so that late ones are used in order of time \[s\]: so old is the estimate that a
    /// vehicle has. 0 where rows are used as they arrive.
    pub held_back: f64,
    /// Estimates made.
    pub epochs: u64,
    /// Samples of the process input that were refused for what they are: spikes, out of range, frozen, not finite, or
    /// stamped far ahead.
    pub refused_samples: u64,
    /// How long the filter coasted without process input \[s\].
    pub coasted: f64,
    /// What became of the hypotheses of a bank; none without one.
    pub hypotheses: Option<Hypotheses>,
    /// The source of a sensor whose other rows are the reference, where they are: the slow errors of both are the same.
    pub judged_by: Option<String>,
    /// Whether the reference has rows that the filter uses: these errors then say how closely it follows them.
    pub judged_by_used_rows: bool,
    /// Score against the reference.
    pub score: Option<Score>,
    /// The same of smoothed estimates, where they were asked for.
    pub smoothed: Option<Smoothed>,
    /// What was believed at the time, of a design that uses rows as they arrive; the other figures are
    /// about what later rows have made of it.
    pub current: Option<Current>,
    /// Scores of the filters inside stages.
    pub inside: Vec<InsideScore>,
    /// When declared faults were at work, by their beginnings; those that always are left out.
    pub faults: Vec<FaultWindow>,
    /// How well a controlled vehicle did what it was to do; none where nothing is steered.
    pub control: Option<Record>,
    /// Per sensor.
    pub sensors: Vec<SensorStatistics>,
    /// Of each sensor the stretch of innovations larger than chance allows in which a calibration moved farthest.
    pub excesses: Vec<Excess>,
    /// Per source.
    pub sources: Vec<SourceStatistics>,
    /// Estimated parameters at the end.
    pub parameters: Vec<FinalState>,
    /// What became of every row, by consumer.
    pub consumers: Vec<ConsumerCounts>,
    /// Rows that came too late or held no number, by consumer.
    pub unused_rows: Vec<(String, u64)>,
    /// Samples of the input that were taken for spikes; `consumers` tell it, too, but for one run of many.
    #[serde(skip)]
    pub spikes: u64,
    /// What the estimator could not do: the first ten reasons.
    pub failures: Vec<String>,
    /// How many more failures there were.
    pub further_failures: u64,
    /// Wall time of the whole run \[s\].
    pub wall_seconds: f64,
    /// Time in the filter alone, per estimate \[ns\].
    pub filter_ns_per_epoch: f64,
}

impl Summary {
    /// The wait for the start, where so much of the log lies before it that the figures are not those of the whole log.
    #[must_use]
    pub fn late_start(&self) -> Option<&Wait> {
        self.waited.as_ref().filter(|wait| wait.share() > LATE && wait.seconds > BRIEF)
    }
}
