//! Many runs: Monte Carlo over seeds.

mod history;
mod part;
mod runs;

use fusion_core::math;
pub use history::{History, Together, together};
pub use part::Unreadable;

use core::ops::Range;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::health::{FilterHealth, State};
use fusion::observe::{RunObserver, SensorStatistics};
use fusion::provenance::Provenance;
use fusion::run::Finding;
use fusion::run::{Options, Smoothing, Summary, run_sharing};
use fusion::score::{Axes, BlockScore, Consistency, Convergence, Drift, Episodes, median};
use fusion_models::sim::{Record, SharedCourse};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

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

impl RunRow {
    fn new(run: u64, seed: u64, summary: &Summary) -> Self {
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
        }
    }
}

/// The result of a Monte Carlo campaign.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// One row per run, in order of their numbers; all of them have the same sensors and blocks.
    pub rows: Vec<RunRow>,
    /// How independent the runs are.
    pub independence: Independence,
    /// Its speed.
    pub pace: Pace,
    /// The inputs of the runs; the seed belongs to the campaign.
    pub provenance: Provenance,
    /// The line with which the design describes itself.
    pub description: String,
    /// Whether its data are simulated.
    pub is_simulated: bool,
    /// The kernel that computed, and the architecture and system that it ran on: results are equal to the bit for
    /// equal ones only.
    pub platform: String,
}

/// The speed of the whole campaign: simulating or reading the data, filtering, scoring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Epochs of the filter, over all runs.
    pub epochs: u64,
    /// Wall-clock time \[s\].
    pub seconds: f64,
    /// The number of threads.
    pub threads: usize,
}

impl Pace {
    /// Filter epochs per second, over all threads.
    #[must_use]
    pub fn per_second(&self) -> f64 {
        self.epochs as f64 / self.seconds
    }
}

/// How independent the runs of a campaign are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Independence {
    /// Each run draws its own world.
    Full,
    /// The runs share a recorded log: its motion and its errors are the same in all runs.
    SharedLog,
    /// All runs are the same: nothing in the design is random. They count as one.
    Identical,
}

impl Independence {
    fn of(is_simulated: bool, rows: &[RunRow]) -> Self {
        let is_same = |row: &RunRow| {
            let compared = RunRow {
                run: rows[0].run,
                seed: rows[0].seed,
                ..row.clone()
            };
            // Compared as printed text, because NaN is not equal to itself.
            format!("{compared:?}") == format!("{:?}", rows[0])
        };
        match rows {
            [_, others @ ..] if !others.is_empty() && others.iter().all(is_same) => Self::Identical,
            _ if !is_simulated => Self::SharedLog,
            _ => Self::Full,
        }
    }
}

/// The seed of run number `run`: it depends only on `seed` and `run`.
#[must_use]
pub fn seed_of(seed: u64, run: u64) -> u64 {
    fusion_models::fault::derive_seed(seed, &["run", &run.to_string()])
}

/// Runs the design once for each number of `runs`, each time with its own seed, on `threads` threads (0: one per core).
/// A row depends on the seed and the number of its run only: not on the number of threads, nor on the other runs.
///
/// # Errors
/// The diagnostics of the first failing run.
pub fn monte_carlo(
    design: &Design,
    options: &Options,
    runs: Range<u64>,
    seed: u64,
    threads: usize,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Campaign, Diagnostics> {
    let nothing = |_: &Design| None;
    Ok(runs_of(design, options, (runs, seed), threads, progress, nothing)?.0)
}

/// The same, with the errors of every run over time.
///
/// # Errors
/// The same as for [`monte_carlo`].
pub fn monte_carlo_over_time(
    design: &Design,
    options: &Options,
    runs: Range<u64>,
    seed: u64,
    threads: usize,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<(Campaign, Vec<History>), Diagnostics> {
    let history = |design: &Design| Some(History::new(design));
    runs_of(design, options, (runs, seed), threads, progress, history)
}

/// The runs, and the histories that are wanted.
fn runs_of(
    design: &Design,
    options: &Options,
    (numbers, seed): (Range<u64>, u64),
    threads: usize,
    progress: &(dyn Fn(usize) + Sync),
    history: impl Fn(&Design) -> Option<History> + Sync,
) -> Result<(Campaign, Vec<History>), Diagnostics> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Diagnostics::from(Diagnostic::error(format!("no threads to run on: {e}"))))?;
    let begun = Instant::now();
    let (done, course) = (AtomicUsize::new(0), SharedCourse::default());
    let one = |number: u64| -> Result<(RunRow, Option<History>), Diagnostics> {
        let seed = seed_of(seed, number);
        let options = Options {
            seed: Some(seed),
            data: options.data.clone(),
            base: options.base.clone(),
            // No row of a campaign uses it.
            smooth: Smoothing::Never,
            ..Options::default()
        };
        let mut history = history(design);
        let mut observers: Vec<&mut dyn RunObserver> = Vec::new();
        observers.extend(history.as_mut().map(|h| h as &mut dyn RunObserver));
        let summary = run_sharing(design, &options, &course, &mut observers)?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        Ok((RunRow::new(number, seed, &summary), history))
    };
    let runs: Result<Vec<_>, Diagnostics> = pool.install(|| numbers.into_par_iter().map(one).collect());
    let (rows, histories): (Vec<RunRow>, Vec<Option<History>>) = runs?.into_iter().unzip();
    let pace = Pace {
        epochs: rows.iter().map(|row| row.epochs).sum(),
        seconds: begun.elapsed().as_secs_f64(),
        threads: pool.current_num_threads(),
    };
    let is_simulated = design.simulation.is_some();
    let independence = Independence::of(is_simulated, &rows);
    let campaign = Campaign {
        rows,
        independence,
        pace,
        provenance: Provenance::of(design, Some(seed)),
        description: design.run.description.clone(),
        is_simulated,
        platform: platform(design),
    };
    Ok((campaign, histories.into_iter().flatten().collect()))
}

/// Kernel, architecture and operating system.
fn platform(design: &Design) -> String {
    let kernel = design.filter.kernel.unwrap_or_default().name();
    format!("{kernel} {} {}", std::env::consts::ARCH, std::env::consts::OS)
}

/// Two campaigns run by run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Duel {
    /// Runs with the smaller error.
    pub better: usize,
    /// Runs with the larger error.
    pub worse: usize,
    /// Runs that both campaigns have; the rest are equal.
    pub runs: usize,
}

impl Duel {
    /// The 95 % interval of the share of better runs among those that differ: Wilson 1927. `None` if all are equal.
    #[must_use]
    pub fn interval(&self) -> Option<(f64, f64)> {
        crate::stress::draw::wilson(self.better, self.better + self.worse)
    }
}

/// Mean, standard deviation, smallest and largest over the runs.
#[derive(Clone, Copy, Debug)]
pub struct RunSpread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// The figures of all runs together, as benchmarks of filters print them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pooled {
    /// RMS over all times and runs of the angle of the attitude error \[deg\].
    pub attitude: Option<f64>,
    /// RMS over all times and runs of the length of the position error \[m\].
    pub position: Option<f64>,
    /// Mean NEES of position, velocity, attitude over its degrees of freedom: 1 is ideal.
    pub nees: [Option<f64>; 3],
    /// Mean over the runs of the change of the horizontal error in % of the distance travelled.
    pub drift_percent: Option<f64>,
    /// RMS over the outages of all runs of the largest horizontal error \[m\].
    pub drift: Option<f64>,
    /// Share of the runs that have converged, as the design declares it.
    pub converged: Option<f64>,
    /// Median time from the start to convergence, over the converged runs \[s\].
    pub after: Option<f64>,
}

impl Campaign {
    /// The figures of all runs together. Every run has the same weight.
    #[must_use]
    pub fn pooled(&self) -> Pooled {
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (count, sum) = values.filter(|v| !v.is_nan()).fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v));
            (count > 0.0).then_some(sum / count)
        };
        let rms = |figure: fn(&RunRow) -> f64| mean(&mut self.rows.iter().map(|row| math::powi(figure(row), 2))).map(math::sqrt);
        // A run in which the filter never started has no figure, and has not converged.
        let runs = || self.rows.iter().filter_map(|row| row.convergence);
        let (declared, converged) = (runs().next().is_some(), || runs().filter(|c| c.converged));
        Pooled {
            attitude: rms(|row| row.rotation_rmse),
            position: rms(|row| row.position_rmse),
            nees: [0, 1, 2].map(|k| {
                let runs = self.rows.iter().filter_map(|row| row.nees[k]);
                mean(&mut runs.map(|c| c.mean / c.dof as f64))
            }),
            drift_percent: mean(&mut self.rows.iter().filter_map(|row| row.drift_percent)),
            drift: mean(&mut self.rows.iter().filter_map(|row| row.drift_rms).map(|d| d * d)).map(math::sqrt),
            converged: declared.then(|| converged().count() as f64 / self.rows.len() as f64),
            after: median(converged().filter_map(|c| c.after).collect()),
        }
    }

    /// The number of runs in which a figure, an error, is smaller than in the run of `other` with the same seed. `None`
    /// if the campaigns have no common run with this figure.
    #[must_use]
    pub fn against(&self, other: &Self, error: impl Fn(&RunRow) -> f64) -> Option<Duel> {
        let pair = |row: &RunRow| {
            let same = other.rows.iter().find(|o| o.seed == row.seed)?;
            error(row).partial_cmp(&error(same))
        };
        let pairs = self.rows.iter().filter_map(pair);
        let duel = pairs.fold(Duel::default(), |duel, order| Duel {
            better: duel.better + usize::from(order.is_lt()),
            worse: duel.worse + usize::from(order.is_gt()),
            runs: duel.runs + 1,
        });
        (duel.runs > 0).then_some(duel)
    }

    /// The runs with this worst state, except those that were in ill health only within declared outages.
    pub fn undeclared(&self, state: State) -> impl Iterator<Item = &RunRow> {
        self.with_worst(state).filter(|row| !row.health.as_declared)
    }

    /// The declared outages of all runs, in order of their start, each with its drift in every run that has it.
    #[must_use]
    pub fn outages(&self) -> Vec<Vec<Drift>> {
        let mut all: Vec<Vec<Drift>> = Vec::new();
        for drift in self.rows.iter().flat_map(|row| &row.drift) {
            match all.iter_mut().find(|known| (known[0].from, known[0].to) == (drift.from, drift.to)) {
                Some(known) => known.push(drift.clone()),
                None => all.push(vec![drift.clone()]),
            }
        }
        all.sort_by(|a, b| a[0].from.total_cmp(&b[0].from).then(a[0].to.total_cmp(&b[0].to)));
        all
    }

    /// The median run by its position error, or by its attitude error if no run has a position. Without
    /// both, it is the first run.
    #[must_use]
    pub fn middle(&self) -> Option<&RunRow> {
        let by = |error: fn(&RunRow) -> f64| {
            let mut known: Vec<&RunRow> = self.rows.iter().filter(|row| error(row).is_finite()).collect();
            known.sort_by(|a, b| error(a).total_cmp(&error(b)));
            known.get(known.len() / 2).copied()
        };
        by(|row| row.position_rmse)
            .or_else(|| by(|row| row.rotation_rmse))
            .or(self.rows.first())
    }

    /// The findings of the median run, each with the number of runs that have a finding about the same thing. Findings
    /// of less than half of the runs are omitted: they are chance.
    #[must_use]
    pub fn findings(&self) -> Vec<(&Finding, usize)> {
        let said_by = |about: &str| self.rows.iter().filter(|row| row.findings.iter().any(|f| f.about == about)).count();
        let middle = self.middle().into_iter().flat_map(|row| &row.findings);
        let counted = middle.map(|finding| (finding, said_by(&finding.about)));
        counted.filter(|(_, runs)| 2 * runs >= self.rows.len()).collect()
    }

    /// The runs with this worst state.
    pub fn with_worst(&self, state: State) -> impl Iterator<Item = &RunRow> {
        self.rows.iter().filter(move |row| row.health.worst == state)
    }

    /// The spread over the runs of a figure; `None` without finite figures.
    #[must_use]
    pub fn spread(&self, figure: impl Fn(&RunRow) -> f64) -> Option<RunSpread> {
        let values: Vec<f64> = self.rows.iter().map(figure).filter(|v| v.is_finite()).collect();
        let n = values.len() as f64;
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| math::powi(v - mean, 2)).sum::<f64>() / (n - 1.0).max(1.0);
        let (min, max) = values.iter().fold((f64::MAX, f64::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        Some(RunSpread {
            mean,
            std: math::sqrt(variance),
            min,
            max,
        })
    }

    /// Judges the mean over the runs of a statistic that each run averages over time. Runs that are not independent
    /// count together as the independent samples of one run.
    #[must_use]
    pub fn judge(&self, figure: impl Fn(&RunRow) -> Option<Consistency>) -> Option<Consistency> {
        let runs = self.rows.iter().filter_map(figure);
        match self.independence {
            Independence::Full => Consistency::of_runs(runs),
            Independence::SharedLog | Independence::Identical => Consistency::of_repeats(runs),
        }
    }

    /// The blocks of every run, taken from the first run.
    #[must_use]
    pub fn blocks(&self) -> &[BlockScore] {
        self.rows.first().map_or(&[], |row| &row.blocks)
    }

    /// The sensors of every run, taken from the first run.
    #[must_use]
    pub fn sensors(&self) -> &[SensorStatistics] {
        self.rows.first().map_or(&[], |row| &row.sensors)
    }
}
