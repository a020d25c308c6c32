//! The result of one run of a campaign.

use super::History;
use fusion::config::{Diagnostic, Diagnostics, Severity};
use fusion::health::{FilterHealth, State};
use fusion::observe::SensorStatistics;
use fusion::run::{Finding, Summary};
use fusion::score::{Axes, BlockScore, Consistency, Convergence, Drift, Episodes};
use fusion_models::sim::Record;
use serde::{Deserialize, Serialize};

/// How one run of a campaign ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Outcome {
    /// At the end of its data.
    Ended(Box<RunRow>),
    /// Before the end of its data.
    Failed(FailedRun),
}

impl Outcome {
    /// The result of a run that reached the end of its data.
    #[must_use]
    pub fn ended(self) -> Option<RunRow> {
        match self {
            Self::Ended(row) => Some(*row),
            Self::Failed(_) => None,
        }
    }
}

/// A run without a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedRun {
    /// Its number.
    pub run: u64,
    /// Its seed.
    pub seed: u64,
    /// Why it failed, in one line: the place, the mistake and the help.
    pub reason: String,
}

/// The result of one Monte Carlo run. It has no timing, so that it is a function of its seed. An error without a
/// reference is NaN.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RunRow {
    /// Its number.
    pub run: u64,
    /// Its seed.
    pub seed: u64,
    /// The number of filter epochs.
    pub epochs: u64,
    /// Position error RMS, north east down \[m\].
    pub rms: [f64; 3],
    /// Largest position error, north east down \[m\].
    pub max: [f64; 3],
    /// Velocity error RMS \[m/s\].
    pub velocity_rms: [f64; 3],
    /// Attitude error RMS, roll pitch yaw \[deg\].
    pub attitude_rms: [f64; 3],
    /// RMS of the length of the position error \[m\].
    pub position_rmse: f64,
    /// RMS of the angle of the attitude error \[deg\].
    pub rotation_rmse: f64,
    /// NEES of position, velocity, attitude.
    pub nees: [Option<Consistency>; 3],
    /// The score inside and outside declared episodes.
    pub episodes: Option<Episodes>,
    /// RMS over declared outages of the largest horizontal error \[m\].
    pub drift_rms: Option<f64>,
    /// The change of the horizontal error in % of the distance travelled, from the origin.
    pub drift_percent: Option<f64>,
    /// The health that the filter reported.
    pub health: RunHealth,
    /// Whether it has converged; `None` if the design does not declare a criterion.
    pub convergence: Option<Convergence>,
    /// Each block of the state against its drawn truth.
    pub blocks: Vec<BlockScore>,
    /// The outcomes of the measurements of each sensor.
    pub sensors: Vec<SensorStatistics>,
    /// The performance of a controlled vehicle; `None` if no vehicle is controlled.
    pub control: Option<Record>,
    /// Input samples that were treated as spikes.
    pub spikes: u64,
    /// The drift in each declared outage.
    pub drift: Vec<Drift>,
    /// The findings, most important first.
    pub findings: Vec<Finding>,
    /// Its errors over time, if they are wanted.
    pub history: Option<History>,
}

/// The health that the filter of a run reported.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RunHealth {
    /// The worst state since the filter was good for the first time; for a filter that never was good, the worst of
    /// all.
    #[serde(serialize_with = "fusion::health::word", deserialize_with = "fusion::health::from_word")]
    pub worst: State,
    /// The state at the end.
    #[serde(serialize_with = "fusion::health::word", deserialize_with = "fusion::health::from_word")]
    pub at_the_end: State,
    /// Share of the time in a state worse than aligning.
    pub ill: f64,
    /// Whether it was degraded or lost only within declared outages.
    pub as_declared: bool,
}

impl RunHealth {
    fn of(health: &FilterHealth) -> Self {
        let total = health.spent.total();
        let worse = State::ALL.into_iter().filter(|s| *s > State::Aligning);
        Self {
            // A filter that was never good is aligning at best.
            worst: if health.aligned.is_some() {
                health.worst
            } else {
                health.worst.max(State::Aligning)
            },
            at_the_end: health.state,
            ill: if total > 0.0 {
                worse.map(|s| health.spent.of(s)).sum::<f64>() / total
            } else {
                0.0
            },
            as_declared: health.is_ill_as_declared(),
        }
    }
}

impl FailedRun {
    pub(super) fn new(run: u64, seed: u64, mistakes: &Diagnostics) -> Self {
        let mistake = mistakes.iter().find(|d| d.severity == Severity::Error).or(mistakes.iter().next());
        Self {
            run,
            seed,
            reason: mistake.map(Diagnostic::line).unwrap_or_default(),
        }
    }
}

impl RunRow {
    pub(super) fn new(run: u64, seed: u64, summary: &Summary, history: Option<History>) -> Self {
        let score = summary.score().cloned().unwrap_or_default();
        const UNKNOWN: Axes = Axes::all(f64::NAN);
        let axes = |a: Option<Axes>| a.unwrap_or(UNKNOWN);
        Self {
            run,
            seed,
            epochs: summary.counts().epochs,
            rms: axes(score.position).rms,
            max: axes(score.position).max,
            velocity_rms: axes(score.velocity).rms,
            attitude_rms: axes(score.attitude_deg).rms,
            position_rmse: score.position_rmse_m.unwrap_or(f64::NAN),
            rotation_rmse: score.rotation_rmse_deg.unwrap_or(f64::NAN),
            nees: [score.nees_position, score.nees_velocity, score.nees_attitude],
            episodes: score.episodes,
            drift_rms: score.drift_rms,
            drift_percent: score.travelled.map(|t| t.from_origin_percent),
            health: summary.health().first().map(RunHealth::of).unwrap_or_default(),
            convergence: score.convergence,
            blocks: score.blocks,
            sensors: summary.sensors().to_vec(),
            control: summary.control().cloned(),
            spikes: summary.counts().spikes,
            drift: score.drift,
            findings: summary.findings().to_vec(),
            history,
        }
    }
}
