//! The statistics of a campaign. Runs are added one by one, in order of their numbers, and are not kept.
//!
//! Memory grows by 32 bytes per run: the errors by which runs are ranked and compared, and the times to convergence. Their
//! medians are exact. It also grows by each declared outage at another time.

use super::figures::{Ends, Figure, OutageTally, RunSpread, SensorTally, Statistic, Tally};
use super::worst::Worst;
use super::{FailedRun, History, RunRow};
use crate::part::{Effort, Subject};
use fusion::health::State;
use fusion::run::Finding;
use fusion::score::{BlockScore, Consistency, Moments, OverRuns, median};
use fusion_core::math;
use std::collections::{BTreeMap, BTreeSet};

/// Ill runs whose seeds are kept, for each state.
const SEEDS: usize = 3;

/// Failed runs that are kept, with their reasons.
const FAILURES: usize = 20;

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

/// An error by which runs are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// RMS of the length of the position error.
    Position,
    /// RMS of the angle of the attitude error.
    Attitude,
    /// Length of the RMS velocity errors.
    Velocity,
}

/// Runs in ill health, outside of declared outages.
#[derive(Clone, Debug, Default)]
pub struct Undeclared {
    /// Their number.
    pub runs: usize,
    /// The seeds of the first of them.
    pub seeds: Vec<u64>,
}

/// The finding of a run, and the number of runs with a finding about the same thing.
type Shared = (Finding, usize);

/// The result of a Monte Carlo campaign.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The design, and the inputs of the runs; the seed belongs to the campaign.
    pub subject: Subject,
    /// Its speed.
    pub pace: Pace,
    /// The number of runs with a result.
    pub runs: usize,
    /// The number of runs that failed.
    pub failed: usize,
    /// The runs with samples that were treated as spikes, and the number of these samples.
    pub spikes: (usize, u64),
    /// Runs that were in ill health only within declared outages.
    pub as_declared: usize,
    /// Runs with the record of a controlled vehicle, and those whose mission is done.
    pub missions: (usize, usize),
    /// The errors over time of the first runs.
    pub histories: Vec<History>,
    /// The runs with the largest errors, without their vectors.
    worst: Worst,
    /// The number and seed of the first run, whether or not it has a result.
    begin: Option<(u64, u64)>,
    /// The first run with a result; all of them have its sensors and blocks.
    first: Option<RunRow>,
    failures: Vec<FailedRun>,
    /// Whether all runs equal the first.
    are_same: bool,
    figures: BTreeMap<Figure, Tally>,
    statistics: BTreeMap<Statistic, OverRuns>,
    pooled: PooledTally,
    blocks: Vec<Vec<Ends>>,
    sensors: Vec<SensorTally>,
    outages: BTreeMap<(u64, u64), OutageTally>,
    health: BTreeMap<State, (usize, Undeclared)>,
    /// By what a finding is about.
    findings: BTreeMap<String, usize>,
    /// By run: position, attitude, velocity. They are NaN for a failed run.
    errors: Vec<[f64; 3]>,
    /// The findings of the middle run, and its seed.
    middle: Option<(u64, Vec<Finding>)>,
}

/// Means over the runs that have a figure.
#[derive(Clone, Debug, Default)]
struct PooledTally {
    squares: [Moments; 2],
    nees: [Moments; 3],
    drift_percent: Moments,
    drift_squares: Moments,
    declared: usize,
    converged: usize,
    after: Vec<f64>,
}

impl PooledTally {
    fn add(&mut self, row: &RunRow) {
        let known = |moments: &mut Moments, value: Option<f64>| value.filter(|v| !v.is_nan()).into_iter().for_each(|v| moments.add(v));
        for (moments, error) in self.squares.iter_mut().zip([row.position_rmse, row.rotation_rmse]) {
            known(moments, Some(error * error));
        }
        for (moments, nees) in self.nees.iter_mut().zip(&row.nees) {
            known(moments, nees.map(|c| c.mean / c.dof as f64));
        }
        known(&mut self.drift_percent, row.drift_percent);
        known(&mut self.drift_squares, row.drift_rms.map(|d| d * d));
        if let Some(found) = row.convergence {
            self.declared += 1;
            self.converged += usize::from(found.converged);
            self.after.extend(found.after.filter(|_| found.converged));
        }
    }
}

impl Campaign {
    /// Without runs.
    #[must_use]
    pub fn new(subject: Subject) -> Self {
        Self {
            subject,
            pace: Pace {
                epochs: 0,
                seconds: 0.0,
                threads: 0,
            },
            runs: 0,
            failed: 0,
            spikes: (0, 0),
            as_declared: 0,
            missions: (0, 0),
            histories: Vec::new(),
            worst: Worst::default(),
            begin: None,
            first: None,
            failures: Vec::new(),
            are_same: true,
            figures: BTreeMap::new(),
            statistics: BTreeMap::new(),
            pooled: PooledTally::default(),
            blocks: Vec::new(),
            sensors: Vec::new(),
            outages: BTreeMap::new(),
            health: BTreeMap::new(),
            findings: BTreeMap::new(),
            errors: Vec::new(),
            middle: None,
        }
    }

    /// Adds the next run, which has failed.
    pub fn add_failed(&mut self, run: FailedRun) {
        self.begin.get_or_insert((run.run, run.seed));
        self.are_same = false;
        self.failed += 1;
        self.errors.push([f64::NAN; 3]);
        if self.failures.len() < FAILURES {
            self.failures.push(run);
        }
    }

    /// Adds the next run.
    pub fn add(&mut self, row: &RunRow) {
        self.begin.get_or_insert((row.run, row.seed));
        match &self.first {
            Some(first) => self.are_same = self.are_same && is_same(first, row),
            None => {
                self.blocks = row.blocks.iter().map(|b| vec![Ends::default(); b.error.len()]).collect();
                self.sensors = row.sensors.iter().map(SensorTally::new).collect();
                self.first = Some(row.clone());
            }
        }
        self.runs += 1;
        self.pace.epochs += row.epochs;
        self.histories.extend(row.history.clone());
        self.worst.add(row);
        Figure::each(row, &mut |figure, value| self.figures.entry(figure).or_default().add(value));
        Statistic::each(row, &mut |statistic, value| {
            self.statistics.entry(statistic).or_default().add(&value)
        });
        self.pooled.add(row);
        for (block, ends) in row.blocks.iter().zip(&mut self.blocks) {
            let found = block.error.iter().zip(&block.sigma);
            found.zip(ends).for_each(|((error, sigma), ends)| ends.add(*error, *sigma));
        }
        row.sensors
            .iter()
            .zip(&mut self.sensors)
            .for_each(|(sensor, tally)| tally.add(sensor));
        for drift in &row.drift {
            self.outages
                .entry((drift.from.to_bits(), drift.to.to_bits()))
                .or_default()
                .add(drift);
        }
        self.spikes.0 += usize::from(row.spikes > 0);
        self.spikes.1 += row.spikes;
        self.as_declared += usize::from(row.health.as_declared);
        let (with_worst, undeclared) = self.health.entry(row.health.worst).or_default();
        *with_worst += 1;
        if !row.health.as_declared {
            undeclared.runs += 1;
            undeclared.seeds.extend((undeclared.runs <= SEEDS).then_some(row.seed));
        }
        if let Some(record) = &row.control {
            self.missions.0 += 1;
            self.missions.1 += usize::from(record.is_done);
        }
        let abouts: BTreeSet<&str> = row.findings.iter().map(|f| f.about.as_str()).collect();
        for about in abouts {
            match self.findings.get_mut(about) {
                Some(runs) => *runs += 1,
                None => drop(self.findings.insert(about.to_owned(), 1)),
            }
        }
        let velocity = math::sqrt(row.velocity_rms.iter().map(|v| v * v).sum::<f64>());
        self.errors.push([row.position_rmse, row.rotation_rmse, velocity]);
    }

    /// Ends it: with its cost, and the run of a number, which is read again if findings are shared.
    ///
    /// # Errors
    /// Those of `read`.
    pub fn finish<E>(&mut self, effort: Effort, read: impl FnOnce(u64) -> Result<Option<RunRow>, E>) -> Result<(), E> {
        self.pace.seconds = effort.seconds;
        self.pace.threads = effort.threads;
        if let Some((first, _)) = self.begin
            && self.findings.values().any(|runs| self.is_common(*runs))
        {
            let middle = read(first + self.middle_run() as u64)?;
            self.middle = middle.map(|row| (row.seed, row.findings));
        }
        Ok(())
    }

    /// Whether so many runs are no chance: at least half of all.
    fn is_common(&self, runs: usize) -> bool {
        2 * runs >= self.runs
    }

    /// The place of the median run by its position error, or by its attitude error if no run has a position. Without
    /// both, it is the first run with a result.
    fn middle_run(&self) -> usize {
        let by = |k: usize| {
            let error = |run: usize| self.errors[run][k];
            let mut known: Vec<usize> = (0..self.errors.len()).filter(|run| error(*run).is_finite()).collect();
            known.sort_by(|a, b| error(*a).total_cmp(&error(*b)));
            known.get(known.len() / 2).copied()
        };
        let first = || Some((self.first.as_ref()?.run - self.begin?.0) as usize);
        by(0).or_else(|| by(1)).or_else(first).unwrap_or(0)
    }

    /// The findings of the median run, each with the number of runs that have a finding about the same thing; and the
    /// seed of that run. Findings of less than half of the runs are omitted: they are chance.
    #[must_use]
    pub fn findings(&self) -> (Option<u64>, Vec<Shared>) {
        let Some((seed, findings)) = &self.middle else {
            return (None, Vec::new());
        };
        let counted = findings
            .iter()
            .map(|f| (f.clone(), self.findings.get(&f.about).copied().unwrap_or(0)));
        (Some(*seed), counted.filter(|(_, runs)| self.is_common(*runs)).collect())
    }

    /// How independent the runs are.
    #[must_use]
    pub fn independence(&self) -> Independence {
        match self.subject.is_simulated {
            _ if self.runs > 1 && self.are_same => Independence::Identical,
            true => Independence::Full,
            false => Independence::SharedLog,
        }
    }

    /// The figures of all runs together. Every run has the same weight.
    #[must_use]
    pub fn pooled(&self) -> Pooled {
        let p = &self.pooled;
        let mean = |moments: &Moments| (moments.count() > 0.0).then(|| moments.mean());
        Pooled {
            attitude: mean(&p.squares[1]).map(math::sqrt),
            position: mean(&p.squares[0]).map(math::sqrt),
            nees: p.nees.each_ref().map(mean),
            drift_percent: mean(&p.drift_percent),
            drift: mean(&p.drift_squares).map(math::sqrt),
            // A run that failed, or in which the filter never started, has no figure, and has not converged.
            converged: (p.declared > 0).then(|| p.converged as f64 / self.errors.len() as f64),
            after: median(p.after.clone()),
        }
    }

    /// The number of runs in which an error is smaller than in the run of `other` with the same seed. `None` if the
    /// campaigns have no common run with this error.
    #[must_use]
    pub fn against(&self, other: &Self, error: Compared) -> Option<Duel> {
        let of = |errors: &[f64; 3]| errors[error as usize];
        let pairs = self.errors.iter().zip(&other.errors).filter(|_| self.begin == other.begin);
        let pairs = pairs.filter_map(|(own, other)| of(own).partial_cmp(&of(other)));
        let duel = pairs.fold(Duel::default(), |duel, order| Duel {
            better: duel.better + usize::from(order.is_lt()),
            worse: duel.worse + usize::from(order.is_gt()),
            runs: duel.runs + 1,
        });
        (duel.runs > 0).then_some(duel)
    }

    /// The number of runs with this worst state.
    #[must_use]
    pub fn with_worst(&self, state: State) -> usize {
        self.health.get(&state).map_or(0, |(runs, _)| *runs)
    }

    /// The runs with this worst state, except those that were in ill health only within declared outages.
    #[must_use]
    pub fn undeclared(&self, state: State) -> Undeclared {
        self.health
            .get(&state)
            .map(|(_, undeclared)| undeclared.clone())
            .unwrap_or_default()
    }

    /// The declared outages of all runs, in order of their start.
    #[must_use]
    pub fn outages(&self) -> Vec<&OutageTally> {
        let mut all: Vec<&OutageTally> = self.outages.values().collect();
        all.sort_by(|a, b| a.from.total_cmp(&b.from).then(a.to.total_cmp(&b.to)));
        all
    }

    /// The runs with the largest errors, the largest first; their vectors are empty.
    #[must_use]
    pub fn worst(&self) -> &[RunRow] {
        self.worst.first()
    }

    /// The spread over the runs of a figure; `None` without finite figures.
    #[must_use]
    pub fn spread(&self, figure: Figure) -> Option<RunSpread> {
        self.figures.get(&figure)?.spread()
    }

    /// Judges the mean over the runs of a statistic that each run averages over time. Runs that are not independent
    /// count together as the independent samples of one run.
    #[must_use]
    pub fn judge(&self, statistic: Statistic) -> Option<Consistency> {
        let runs = self.statistics.get(&statistic)?;
        match self.independence() {
            Independence::Full => runs.independent(),
            Independence::SharedLog | Independence::Identical => runs.repeated(),
        }
    }

    /// The first failed runs, with their reasons.
    #[must_use]
    pub fn failures(&self) -> &[FailedRun] {
        &self.failures
    }

    /// The first run with a result.
    #[must_use]
    pub const fn first(&self) -> Option<&RunRow> {
        self.first.as_ref()
    }

    /// The blocks of every run, taken from the first run.
    #[must_use]
    pub fn blocks(&self) -> &[BlockScore] {
        self.first.as_ref().map_or(&[], |row| &row.blocks)
    }

    /// The errors at the end of the runs, by block and axis.
    #[must_use]
    pub fn ends(&self) -> &[Vec<Ends>] {
        &self.blocks
    }

    /// The sensors of every run, over all runs.
    #[must_use]
    pub fn sensors(&self) -> &[SensorTally] {
        &self.sensors
    }
}

fn is_same(first: &RunRow, row: &RunRow) -> bool {
    let compared = RunRow {
        run: first.run,
        seed: first.seed,
        ..row.clone()
    };
    // Compared as printed text, because NaN is not equal to itself.
    format!("{compared:?}") == format!("{first:?}")
}
