//! The facts of a run that rules use. Only this file reads the summary.

use super::instrument::{self, Instrument, Measures};
use super::stamps::Stamps;
use fusion::design::Design;
use fusion::health::FilterHealth;
use fusion::observe::{ConsumerCounts, Excess, Hypotheses, SensorStatistics, Wait};
use fusion::run::{Detector, FaultWindow, FinalState, SourceStatistics, Summary};
use fusion::score::{Consistency, Score};
use fusion_core::filter::ChartKind;

/// Fewer independent errors against the reference are not enough: with two, the band of a consistent mean spans 0.05 to
/// 3.7.
pub(super) const JUDGE: f64 = 3.0;

/// The results of a run that rules use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<'a> {
    /// When the filter started \[s\]; `None` if it never did.
    pub(super) started: Option<f64>,
    /// A late start: the log before it.
    pub(super) late_start: Option<&'a Wait>,
    /// The inputs that the filter was still waiting for at the end.
    pub(super) waiting: &'a [(String, String)],
    /// The health of the outermost filter.
    pub(super) health: Option<&'a FilterHealth>,
    /// The attitude or angle with the largest 1σ at the start, and this 1σ \[rad\].
    pub(super) start_angle: Option<&'a (String, f64)>,
    /// The tests of detectors.
    pub(super) detectors: &'a [Detector],
    /// The time without process input \[s\].
    pub(super) coasted: f64,
    /// The hypotheses of a bank.
    pub(super) hypotheses: Option<&'a Hypotheses>,
    /// Whether other rows of a sensor's source are the reference.
    pub(super) is_judged_by_its_sensor: bool,
    /// The errors against the reference.
    pub(super) score: Option<&'a Score>,
    /// The windows of declared faults.
    pub(super) faults: &'a [FaultWindow],
    /// The sensors.
    pub(super) sensors: &'a [SensorStatistics],
    /// The stretches in which a sensor moved calibrations.
    pub(super) excesses: &'a [Excess],
    /// The sources.
    pub(super) sources: &'a [SourceStatistics],
    /// The estimated parameters.
    pub(super) parameters: &'a [FinalState],
    /// The outcome of every row, by consumer.
    pub(super) consumers: &'a [ConsumerCounts],
}

impl<'a> Run<'a> {
    /// The facts of a run.
    pub(super) fn of(summary: &'a Summary) -> Self {
        Self {
            started: summary.start().started,
            late_start: summary.late_start(),
            waiting: &summary.start().waiting,
            health: summary.health().iter().find(|h| h.filter.is_empty()),
            start_angle: summary.start().start_angle.as_ref(),
            detectors: summary.detectors(),
            coasted: summary.counts().coasted,
            hypotheses: summary.hypotheses(),
            is_judged_by_its_sensor: summary.judge().source.is_some(),
            score: summary.score(),
            faults: summary.faults(),
            sensors: summary.sensors(),
            excesses: summary.excesses(),
            sources: summary.sources(),
            parameters: summary.parameters(),
            consumers: summary.consumers(),
        }
    }
}

/// A run and what its design says of it.
#[derive(Clone, Debug)]
pub(super) struct Facts<'a> {
    pub(super) run: Run<'a>,
    pub(super) instruments: Vec<Instrument>,
    /// Whether the rows are recorded, not simulated.
    pub(super) is_recorded: bool,
    /// The declared point of the reference \[m\].
    pub(super) point: [f64; 3],
    /// Whether position, velocity, attitude of the reference are declared as exact.
    pub(super) is_exact: [bool; 3],
    /// Whether the filter has one estimate and linearises each measurement only there.
    pub(super) linearises_once: bool,
    /// Whether it uses an invariant chart.
    pub(super) is_invariant: bool,
    /// The channels that the reference shares with sensors, and the clock of the input.
    pub(super) stamps: Stamps,
    /// The input biases that are constant states.
    pub(super) constant_biases: Vec<String>,
    /// The silence that separates one recording from the next \[s\].
    pub(super) restart_after: Option<f64>,
    /// The settings of the process that define how fast its errors grow.
    pub(super) growth: Vec<String>,
}

impl<'a> Facts<'a> {
    /// The facts of a run of `design`.
    pub(super) fn of(design: &Design, summary: &'a Summary) -> Self {
        let run = Run::of(summary);
        let reference = design.reference.as_ref().map(|r| &r.block);
        let has_sigma = |k: usize| reference.is_some_and(|r| r.sources().iter().any(|(_, part)| part.sigma.each()[k].is_some()));
        Self {
            run,
            instruments: Instrument::of_design(design, run.parameters),
            is_recorded: design.simulation.is_none(),
            point: reference.map_or([0.0; 3], |r| r.point()),
            is_exact: [0, 1, 2].map(|k| !has_sigma(k)),
            linearises_once: design.filter.linearises_once(),
            is_invariant: matches!(design.filter.backend().chart, ChartKind::Invariant(..)),
            stamps: Stamps::of_design(design, run.parameters),
            constant_biases: instrument::constant_biases(&design.process.node),
            restart_after: design.run.restart_after.map(|silence| silence.si()),
            growth: instrument::growth(&design.process.node),
        }
    }

    /// The sensors with their statistics.
    pub(super) fn sensors(&self) -> impl Iterator<Item = (&Instrument, &SensorStatistics)> {
        let of = |i: &Instrument| self.run.sensors.iter().find(|s| s.name == i.name);
        self.instruments.iter().filter_map(move |i| Some((i, of(i)?)))
    }

    /// The instruments that measure a part of the solution, with their NIS.
    pub(super) fn measuring(&self, what: Measures) -> impl Iterator<Item = (&Instrument, &Consistency)> {
        let of = move |i: &Instrument| i.measures == Some(what) && !i.is_constraint;
        self.sensors()
            .filter(move |(i, _)| of(i))
            .filter_map(|(i, s)| Some((i, s.nis.as_ref()?)))
    }

    /// The NEES of the part that a sensor measures.
    pub(super) fn nees(&self, what: Measures) -> Option<&Consistency> {
        nees_of(self.run.score?, what)
    }

    /// The outcome of the samples of the process input.
    pub(super) fn process(&self) -> Option<&ConsumerCounts> {
        self.run.consumers.iter().find(|c| c.name == "process")
    }

    /// The detector that decides when a sensor holds.
    pub(super) fn detector(&self, sensor: &Instrument) -> Option<&Detector> {
        self.run.detectors.iter().find(|d| d.stage == sensor.source)
    }

    /// The stream of the process input, if no fault disturbs it.
    pub(super) fn undisturbed_input(&self) -> Option<&str> {
        let process = self.process()?;
        let has_faults = |s: &fusion::run::SourceStatistics| s.name == process.stream && !s.report.disturbed.is_empty();
        let is_declared = self.run.faults.iter().any(|fault| fault.stream == process.stream);
        (!is_declared && !self.run.sources.iter().any(has_faults)).then_some(&process.stream)
    }

    /// Returns true if only the innovations can judge a sensor. Known errors judge better. A sensor that measures no
    /// part of the solution may be slow on purpose.
    pub(super) fn is_judged_by_innovations(&self, sensor: &Instrument) -> bool {
        // A few errors that last as long as the run are not enough to judge.
        let judges = |c: &Consistency| c.independent >= JUDGE;
        let is_judged = Measures::ALL.into_iter().any(|what| self.nees(what).is_some_and(judges));
        !sensor.is_constraint && sensor.measures.is_some() && !is_judged
    }
}

fn nees_of(score: &Score, what: Measures) -> Option<&Consistency> {
    match what {
        Measures::Position => score.nees_position.as_ref(),
        Measures::Velocity => score.nees_velocity.as_ref(),
        Measures::Attitude => score.nees_attitude.as_ref(),
    }
}
