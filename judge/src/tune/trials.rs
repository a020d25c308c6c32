//! Runs of the logs with other noises, and the innovations that they give.

use super::outage::{self, Replay};
use super::record::{Recorder, Rows};
use super::{Log, Parameter, Settings, white};
use crate::likelihood::Density;
use fusion::config::{Diagnostics, Edit};
use fusion::design::Design;
use fusion::run::run_sharing;
use fusion_core::math;
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// A part of a log in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) log: usize,
    from: f64,
    to: f64,
}

impl Part {
    pub(super) fn holds(&self, log: usize, time: f64) -> bool {
        log == self.log && (self.from..self.to).contains(&time)
    }
}

/// The gain of a row from one θ to another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gain {
    pub(super) sensor: usize,
    pub(super) time: f64,
    /// Whether it is the first row of its sensor after an outage.
    pub(super) is_after_outage: bool,
    pub(super) nats: f64,
}

/// The rows of a run by sensor, and from when they count \[s\].
pub(super) type Run = (Vec<Option<Rows>>, f64);

/// The innovations of all logs at one θ.
pub(super) struct Score {
    /// The runs of the logs, then the replays with outages.
    pub(super) runs: Vec<Run>,
    logs: usize,
}

impl Score {
    /// The runs of the logs, without outages.
    pub(super) fn logs(&self) -> &[Run] {
        &self.runs[..self.logs]
    }

    /// The time in which rows of a log count \[s\].
    pub(super) fn span(&self, log: usize) -> (f64, f64) {
        let (sensors, from) = &self.logs()[log];
        let ends = sensors.iter().flatten().filter_map(|rows| rows.times.last().copied());
        (*from, ends.fold(*from, f64::max))
    }

    /// The logs, each cut into parts of equal length.
    pub(super) fn parts(&self, folds: usize) -> Vec<Part> {
        let folds = folds.max(1);
        let of = |log: usize| {
            let (from, to) = self.span(log);
            let edge = move |k: usize| match k {
                0 => f64::NEG_INFINITY,
                k if k == folds => f64::INFINITY,
                k => from + (to - from) * k as f64 / folds as f64,
            };
            (0..folds).map(move |k| Part {
                log,
                from: edge(k),
                to: edge(k + 1),
            })
        };
        (0..self.logs).flat_map(of).collect()
    }
}

/// Runs of the logs with other values.
pub(super) struct Trials<'a> {
    pub(super) logs: &'a [Log],
    pub(super) parameters: Vec<Parameter>,
    pub(super) densities: Vec<Option<Density>>,
    /// For each log: the streams of which one row in so many is used.
    pub(super) thinning: Vec<Vec<white::Thinned>>,
    /// From when rows of each log count \[s\], if known. It is the same at each θ: a likelihood of fewer rows does not compare.
    pub(super) from: Vec<f64>,
    /// Further runs of the logs, with outages.
    pub(super) replays: Vec<Replay>,
    pub(super) settings: &'a Settings,
    runs: AtomicU64,
    /// The number of runs after which the search ends.
    most_runs: AtomicU64,
}

impl<'a> Trials<'a> {
    /// Trials of all rows.
    pub(super) fn new(logs: &'a [Log], parameters: Vec<Parameter>, densities: Vec<Option<Density>>, settings: &'a Settings) -> Self {
        Self {
            logs,
            parameters,
            densities,
            thinning: vec![Vec::new(); logs.len()],
            from: Vec::new(),
            replays: Vec::new(),
            settings,
            runs: AtomicU64::new(0),
            most_runs: AtomicU64::new(settings.most_runs),
        }
    }

    /// Runs made.
    pub(super) fn runs(&self) -> u64 {
        self.runs.load(Ordering::Relaxed)
    }

    /// Counts runs that were made elsewhere.
    pub(super) fn count(&self, runs: u64) {
        self.runs.fetch_add(runs, Ordering::Relaxed);
    }

    /// Begins a search: the limit of runs is its own.
    pub(super) fn begin(&self) {
        self.most_runs.store(self.runs() + self.settings.most_runs, Ordering::Relaxed);
    }

    /// The log of a run.
    pub(super) fn log_of(&self, run: usize) -> usize {
        run.checked_sub(self.logs.len()).map_or(run, |k| self.replays[k].log)
    }

    pub(super) fn is_thinned(&self) -> bool {
        self.thinning.iter().any(|log| !log.is_empty())
    }

    /// The length of the outages \[s\].
    pub(super) fn outage(&self) -> f64 {
        self.settings.outage.as_ref().map_or(0.0, |outage| outage.duration)
    }

    /// Whether no decision of a gate makes the likelihood jump.
    pub(super) fn is_smooth(&self) -> bool {
        self.densities.iter().flatten().all(|density| *density == Density::Normal)
    }

    /// Whether no further step may begin.
    pub(super) fn is_at_its_end(&self) -> bool {
        let is_stopped = self.settings.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed));
        is_stopped || self.runs() >= self.most_runs.load(Ordering::Relaxed)
    }

    /// Fixes the rows that count as those after the alignment with the declared noises. Returns the innovations there.
    pub(super) fn fix_rows(&mut self) -> Result<Score, Diagnostics> {
        let declared = self.at(&vec![0.0; self.parameters.len()])?;
        self.from = declared.logs().iter().map(|(_, from)| *from).collect();
        Ok(declared)
    }

    /// The same, and adds the runs with outages.
    pub(super) fn fix_rows_and_outages(&mut self, design: &Design) -> Result<Score, Diagnostics> {
        let declared = self.fix_rows()?;
        if let Some(outage) = &self.settings.outage {
            self.replays = outage::replays(design, self, &declared, outage)?;
        }
        Ok(declared)
    }

    /// The innovations of all logs at `theta`.
    pub(super) fn at(&self, theta: &[f64]) -> Result<Score, Diagnostics> {
        let runs = self.logs.len() + self.replays.len();
        let each: Result<Vec<Run>, Diagnostics> = (0..runs).into_par_iter().map(|run| self.run(run, theta)).collect();
        Ok(Score {
            runs: each?,
            logs: self.logs.len(),
        })
    }

    /// The innovations of one run, and when they begin to count.
    fn run(&self, run: usize, theta: &[f64]) -> Result<Run, Diagnostics> {
        let replay = run.checked_sub(self.logs.len()).map(|k| &self.replays[k]);
        let own = &self.logs[self.log_of(run)];
        let mut document = own.document.clone();
        for (parameter, theta) in self.parameters.iter().zip(theta) {
            document.apply(&parameter.times(math::exp(*theta), None))?;
        }
        let edits: Vec<Edit> = match replay {
            None => self.thinning[run].iter().map(white::Thinned::edit).collect(),
            Some(replay) => replay.edits().to_vec(),
        };
        edits.iter().try_for_each(|edit| document.apply(edit))?;
        // No run is scored.
        if document.root().get("reference").is_some() {
            document.apply(&Edit::leave_out("reference"))?;
        }
        let design = Design::read(document)?;
        let mut recorder = Recorder::new(&design, &self.densities, replay.map(|replay| replay.duration));
        let summary = run_sharing(&design, &own.options, &SharedCourse::default(), &mut [&mut recorder])?;
        self.count(1);
        if let Some(from) = self.from.get(self.log_of(run)) {
            return Ok((recorder.sensors, *from));
        }
        let health = summary.health().iter().find(|h| h.filter.is_empty());
        let aligned = health
            .map_or(summary.start().started, |health| health.aligned)
            .unwrap_or(f64::INFINITY);
        Ok((recorder.sensors, aligned + self.settings.settle))
    }

    /// ln L of the rows that `counts` selects by log and time.
    pub(super) fn log_likelihood(&self, score: &Score, counts: &dyn Fn(usize, f64) -> bool) -> f64 {
        let mut sum = 0.0;
        for (run, (sensors, from)) in score.runs.iter().enumerate() {
            let log = self.log_of(run);
            for (rows, density) in sensors.iter().zip(&self.densities) {
                let (Some(rows), Some(density)) = (rows, density) else { continue };
                for k in (0..rows.len()).filter(|k| rows.times[*k] >= *from && counts(log, rows.times[*k])) {
                    let (r, l) = rows.innovation(k);
                    sum += density.log(r, l);
                }
            }
        }
        sum
    }

    /// The gain in nats from `a` to `b`, over the rows of both that `counts` selects by log and time.
    pub(super) fn gain(&self, a: &Score, b: &Score, counts: &dyn Fn(usize, f64) -> bool) -> f64 {
        self.gains(a, b, counts).iter().map(|gain| gain.nats).sum()
    }

    /// The same, row by row.
    pub(super) fn gains(&self, a: &Score, b: &Score, counts: &dyn Fn(usize, f64) -> bool) -> Vec<Gain> {
        let mut gains = Vec::new();
        for (run, ((one, from), (other, _))) in a.runs.iter().zip(&b.runs).enumerate() {
            let log = self.log_of(run);
            for (sensor, ((one, other), density)) in one.iter().zip(other).zip(&self.densities).enumerate() {
                let (Some(one), Some(other), Some(density)) = (one, other, density) else {
                    continue;
                };
                for k in (0..one.len()).filter(|k| one.times[*k] >= *from && counts(log, one.times[*k])) {
                    let Some(at) = other.at(one.numbers[k]) else { continue };
                    let ((r, l), (r_b, l_b)) = (one.innovation(k), other.innovation(at));
                    gains.push(Gain {
                        sensor,
                        time: one.times[k],
                        is_after_outage: run >= self.logs.len(),
                        nats: density.log(r_b, l_b) - density.log(r, l),
                    });
                }
            }
        }
        gains
    }
}
