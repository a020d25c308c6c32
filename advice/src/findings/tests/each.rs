//! Each rule alone: a sound run has no finding, and one changed fact fires the rule while all others are ignored.

use super::super::stamps::{Common, Delay};
use super::super::table::run_rules;
use super::*;
use fusion::health::{FilterHealth, NamedReason, State, Transition};
use fusion::observe::{Change, Entry, Excess, Hypotheses, Innovations, RejectionStreak, Wait};
use fusion::run::{Counts, Detector, SourceStatistics, Start};
use fusion::score::{Course, Offset};

/// A recorded run of a receiver and a compass.
struct Case {
    start: Start,
    sensors: Vec<SensorStatistics>,
    consumers: Vec<ConsumerCounts>,
    score: Option<Score>,
    /// The other sections.
    summary: Summary,
    instruments: Vec<Instrument>,
    stamps: Stamps,
    has_started: bool,
}

impl Case {
    /// A consistent run with a reference.
    fn sound() -> Self {
        let named = |name: &str| SensorStatistics {
            name: name.to_owned(),
            ..sensor(3.0)
        };
        let compass = Instrument {
            name: "compass".to_owned(),
            source: "magnetometer".to_owned(),
            measures: Some(Measures::Attitude),
            ..instrument(None)
        };
        let process = ConsumerCounts {
            name: "process".to_owned(),
            stream: "imu".to_owned(),
            rows: 9000,
            ..ConsumerCounts::default()
        };
        let score = Score {
            nees_position: Some(consistency(3.0)),
            attitude_deg: Some(Axes {
                inside: [1.0; 3],
                ..Axes::all(0.3)
            }),
            ..Score::default()
        };
        Self {
            start: Start {
                started: Some(0.0),
                ..Start::default()
            },
            sensors: vec![named("gnss"), named("compass")],
            consumers: vec![process],
            score: Some(score),
            summary: Summary::default(),
            instruments: vec![instrument(None), compass],
            stamps: Stamps::default(),
            has_started: true,
        }
    }

    /// The rules with findings, except the ignored ones.
    fn rules(&self, ignored: &Ignored) -> Vec<String> {
        let summary = self.summary.clone().with(self.start.clone()).with(self.sensors.clone());
        let summary = summary.with(self.consumers.clone()).with(Entry::from(self.score.clone()));
        let mut facts = judged(&self.instruments, &summary);
        facts.stamps = self.stamps.clone();
        facts.run.started = self.has_started.then_some(10.0);
        facts.is_recorded = self.has_started;
        super::super::table::apply(&facts, ignored).into_iter().map(|f| f.rule).collect()
    }

    fn score(&mut self) -> &mut Score {
        self.score.as_mut().unwrap()
    }

    fn gnss(&mut self) -> &mut SensorStatistics {
        &mut self.sensors[0]
    }

    fn health(&mut self, states: &[(f64, State)], reason: Option<(&'static str, &str)>) {
        let reasons = reason.map(|(reason, of)| NamedReason {
            reason,
            of: of.to_owned(),
            state: State::Degraded,
        });
        let change = |(time, state): &(f64, State)| Transition {
            time: *time,
            state: *state,
            reasons: reasons.clone().into_iter().collect(),
            ..Transition::default()
        };
        self.summary.put(vec![FilterHealth {
            aligned: Some(0.0),
            until: 1000.0,
            transitions: states.iter().map(change).collect(),
            ..FilterHealth::default()
        }]);
    }

    /// Errors of the heading \[deg\]: mean and RMS, with this share inside 3σ.
    fn heading(&mut self, mean: f64, rms: f64, inside: f64) {
        self.score().heading_rmse_deg = Some(rms);
        self.score().attitude_deg = Some(Axes {
            mean: [0.0, 0.0, mean],
            inside: [1.0, 1.0, inside],
            ..Axes::all(rms)
        });
    }

    fn outages(&mut self, sigmas: &[f64]) {
        let drift = |ratio: &f64| Drift {
            end_horizontal: 10.0 * ratio,
            end_sigma: 10.0,
            ..Drift::default()
        };
        self.score().drift = sigmas.iter().map(drift).collect();
    }

    /// 2400 innovations of the receiver, of which `independent` ones are independent.
    fn innovations(&mut self, nis: f64, lag_1: f64, independent: f64) {
        self.gnss().nis = Some(consistency(nis));
        self.gnss().innovations = Innovations {
            count: 2400,
            lag_1: vec![lag_1; 3],
            rms: vec![0.05; 3],
            unit: vec!["m".to_owned(); 3],
            mean: vec![0.0; 3],
            mean_sigmas: vec![0.0; 3],
            independent: vec![independent; 3],
            ..Innovations::default()
        };
    }
}

/// A rule, and what makes a sound run one that it finds.
type Fires = (&'static str, fn(&mut Case));

/// A source that read this row, which it left out.
fn left_out(name: &str, reason: &str, what: &str) -> SourceStatistics {
    let example = fusion::rows::Example {
        number: 7,
        counted: "message".into(),
        what: what.to_owned(),
    };
    let skipped = fusion::rows::Skipped {
        reason: reason.to_owned(),
        count: 1,
        examples: vec![example],
    };
    let report = fusion::rows::SourceReport {
        skipped: vec![skipped],
        ..Default::default()
    };
    SourceStatistics::new(name, &report)
}

const OF_THE_INPUT: &[Fires] = &[
    ("log-damaged", |c| {
        c.summary.put(vec![
            left_out("imu", "bad rows", "column `x` is empty"),
            left_out("receiver", "the file is damaged", "after byte 8000: the file is cut off"),
        ]);
    }),
    ("never-started", |c| c.has_started = false),
    ("late-start", |c| {
        c.start.waited = Some(Wait {
            seconds: 30.0,
            of: 40.0,
            waited: Vec::new(),
        });
    }),
    ("input-range", |c| c.consumers[0].out_of_range = 100),
    ("fault-used", |c| {
        c.score().nees_position = Some(consistency(12.0));
        c.gnss().disturbed = Some(Disturbed {
            missed: 5,
            ..Disturbed::default()
        });
        c.summary.put(vec![FaultWindow {
            stream: "receiver".to_owned(),
            fault: "wrong".to_owned(),
            from: 10.0,
            to: 20.0,
        }]);
    }),
    ("wrong-input", |c| {
        c.sensors.iter_mut().for_each(|s| s.nis = Some(consistency(300.0)));
    }),
    ("poor-start", |c| c.start.start_angle = Some(("attitude".to_owned(), 1.8))),
    ("uncertain-start", |c| {
        c.start.start_angle = Some(("attitude".to_owned(), 0.3));
        c.score().nees_attitude = Some(consistency(12.0));
    }),
    ("input-spikes", |c| c.consumers[0].spikes = 3),
    ("input-gap", |c| {
        c.summary.put(Counts {
            coasted: 2.0,
            ..Counts::default()
        })
    }),
    ("row-gap", |c| {
        let report = fusion::rows::SourceReport {
            used: 1001,
            first: Some(Time::default()),
            last: Some(Time::from_seconds(100.0)),
            longest_gap: Some((Time::from_seconds(2.0), 8.1)),
            ..Default::default()
        };
        c.summary.put(vec![SourceStatistics::new("receiver", &report)]);
    }),
];

const OF_STATES: &[Fires] = &[
    ("lost", |c| {
        c.health(&[(0.0, State::Good), (700.0, State::Lost), (729.0, State::Good)], None);
        c.gnss().longest_rejection_streak = Some(RejectionStreak {
            from: 690.0,
            measurements: 16,
            seconds: 30.0,
        });
    }),
    ("parameter-far", |c| {
        c.health(&[(35.0, State::Degraded)], Some(("calibration", "gnss.time_offset")))
    }),
    ("heading-undecided", |c| {
        c.health(&[(0.0, State::Aligning)], Some(("undecided", "")))
    }),
    ("heading-changed", |c| {
        c.health(&[(0.0, State::Good)], None);
        let (time, angle) = (500.0, Some(3.1));
        c.summary.put(Some(Hypotheses {
            changes: vec![Change { time, angle }],
            ..Hypotheses::default()
        }));
    }),
    ("parameter-moved", |c| {
        let moved = fusion::observe::Moved {
            name: "gnss.time_offset".to_owned(),
            sigmas: 4.0,
            sigma: 0.05,
            unit: "s".to_owned(),
            ..Default::default()
        };
        c.summary.put(vec![Excess {
            sensor: "gnss".to_owned(),
            nis: 12.0,
            dof: 3,
            moved: vec![moved],
            ..Excess::default()
        }]);
    }),
    ("parameter-unlearnt", |c| {
        c.summary.put(vec![FinalState {
            name: "gnss.time_offset".to_owned(),
            kind: fusion_core::state::Kind::Vector(1),
            value: vec![0.0],
            sigma: vec![0.05],
            start_sigma: vec![0.05],
            covariance: Vec::new(),
            unit: "s",
        }]);
    }),
];

const OF_SENSORS: &[Fires] = &[
    ("first-to-disagree", |c| {
        c.gnss().disagrees_from = Some(10.0);
        c.sensors[1].disagrees_from = Some(50.0);
        c.sensors[1].rejected = 100;
    }),
    ("reacquired", |c| {
        c.score = None;
        c.gnss().reacquired_at = vec![10.0];
    }),
    ("gate-rejects", |c| c.gnss().rejected = 100),
    ("never-held", |c| {
        c.instruments[0].limits = vec!["`stage.receiver.still`".to_owned()];
        c.summary.put(vec![Detector {
            stage: "receiver".to_owned(),
            tests: 90,
            ..Detector::default()
        }]);
    }),
    ("nis-large", |c| c.gnss().nis = Some(consistency(9.0))),
    ("innovations-repeat", |c| {
        c.score = None;
        c.innovations(3.0, 0.99, 15.0);
    }),
    ("nis-small", |c| {
        c.instruments[0].noise = vec![0.7; 3];
        c.innovations(0.012, 0.5, 164.0);
    }),
    ("innovations-last", |c| {
        c.score = None;
        c.innovations(3.0, 0.7, 600.0);
    }),
    ("nis-beyond-chance", |c| {
        c.score = None;
        c.gnss().nis = Some(consistency(4.4));
    }),
];

const OF_ERRORS: &[Fires] = &[
    ("heading-constant", |c| {
        c.heading(-3.3, 3.4, 1.0);
        c.score().nees_attitude = Some(consistency(300.0));
    }),
    ("reference-heading", |c| {
        c.heading(0.0, 0.36, 0.645);
        c.score().course = Some(Course {
            reference_deg: 0.30,
            estimate_deg: 0.16,
            own_deg: 0.29,
            share: 0.83,
            share_sigma: 0.07,
        });
    }),
    ("heading-wrong", |c| c.heading(0.0, 16.0, 0.5)),
    ("reference-latency", |c| {
        c.score().offset = Some(Offset {
            latency: 1.0,
            latency_sigma: 0.01,
            latency_explained: 0.98,
            ..Offset::default()
        });
    }),
    ("reference-late", |c| {
        c.score().nees_position = Some(consistency(12.0));
        c.stamps.common = vec![Common {
            delay: Delay {
                seconds: 0.12,
                ..Delay::default()
            },
            what: Measures::Position,
            channel: "source.withheld.channels.position".to_owned(),
            latency: 0.0,
            arm: None,
        }];
    }),
    ("reference-arm", |c| {
        c.score().offset = Some(Offset {
            body: [-1.25, 0.0, 0.0],
            sigma: [0.07; 3],
            explained: 0.6,
            own: [0.5, 0.0, 0.0],
            halves: [[-1.2, 0.0, 0.0], [-1.3, 0.0, 0.0]],
            ..Offset::default()
        });
    }),
    ("nees-large", |c| c.score().nees_position = Some(consistency(12.0))),
    ("nees-small", |c| c.score().nees_position = Some(consistency(0.3))),
    ("attitude-outside", |c| c.heading(0.0, 0.3, 0.5)),
    ("outages-outside", |c| c.outages(&[3.1; 9])),
    ("outage-far", |c| c.outages(&[1.0, 1.0, 1.0, 5.0])),
];

fn cases() -> impl Iterator<Item = &'static Fires> {
    [OF_THE_INPUT, OF_STATES, OF_SENSORS, OF_ERRORS].into_iter().flatten()
}

#[test]
fn every_rule_of_a_run_has_a_case() {
    let mut rules: Vec<&str> = run_rules().collect();
    let mut cases: Vec<&str> = cases().map(|(rule, _)| *rule).collect();
    rules.sort_unstable();
    rules.dedup();
    cases.sort_unstable();
    assert_eq!(rules, cases);
    assert!(rules.iter().all(|id| crate::rules::ALL.iter().any(|rule| rule.id == *id)));
}

#[test]
fn a_sound_run_fires_no_rule_and_one_fact_fires_one() {
    assert_eq!(Case::sound().rules(&Ignored::default()), Vec::<String>::new());
    for (rule, change) in cases() {
        let others: Vec<&str> = run_rules().filter(|id| id != rule).collect();
        let mut case = Case::sound();
        change(&mut case);
        let found = case.rules(&Ignored::new(&others).unwrap_or_else(|_| panic!("a rule is not known")));
        assert_eq!(found, [*rule], "alone");
        assert_eq!(
            case.rules(&Ignored::new(&[*rule]).unwrap_or_else(|_| panic!("{rule}")))
                .iter()
                .filter(|id| id == rule)
                .count(),
            0
        );
    }
}

#[test]
fn a_damaged_log_is_named_once_with_its_sources_also_if_the_filter_never_started() {
    let mut case = Case::sound();
    case.has_started = false;
    let sources = [("imu", "cut"), ("receiver", "cut"), ("other", "torn")];
    let sources = sources.map(|(name, what)| left_out(name, "the file is damaged", what));
    case.summary.put(sources.to_vec());
    let summary = case.summary.clone();
    let facts = judged(&case.instruments, &summary);
    let found: Vec<String> = facts.damaged_logs().into_iter().map(|f| f.evidence).collect();
    assert_eq!(
        found,
        [
            "the log of `imu`, `receiver` is damaged: cut",
            "the log of `other` is damaged: torn"
        ]
    );
    assert_eq!(case.rules(&Ignored::default()), ["log-damaged", "log-damaged", "never-started"]);
}
