mod advice;
mod each;
mod innovations;
mod moved;
mod outages;
mod reference;
mod suspects;

use super::errors::{bold_outages, far_outage};
use super::facts::Run;
use super::instrument::{self, Bias, Instrument, Measures};
use super::stamps::Stamps;
use super::*;
use fusion::config::Edit;
use fusion::observe::{ConsumerCounts, Disturbed, SensorStatistics};
use fusion::run::{Counts, FaultWindow, FinalState, JudgedBy, Start};
use fusion::score::{Axes, Drift, Moved, Score};
use fusion_core::time::Time;

fn consistency(mean: f64) -> Consistency {
    Consistency {
        mean,
        dof: 3,
        count: 300,
        independent: 300.0,
        band: (2.7, 3.3),
    }
}

fn instrument(bias: Option<Bias>) -> Instrument {
    Instrument {
        name: "gnss".to_owned(),
        source: "receiver".to_owned(),
        is_constraint: false,
        measures: Some(Measures::Position),
        axes: [true; 3],
        has_gate: true,
        has_horizontal_position: true,
        has_recovery: true,
        limits: Vec::new(),
        bias,
        leader: None,
        channels: &["axes", "signs", "units"],
        parameters: vec!["lever_arm".to_owned()],
        noise: Vec::new(),
        noise_key: Some("sensor.gnss.noise".to_owned()),
        reports: None,
    }
}

fn sensor(nis: f64) -> SensorStatistics {
    SensorStatistics {
        name: "gnss".to_owned(),
        accepted: 300,
        nis: Some(consistency(nis)),
        ..SensorStatistics::default()
    }
}

/// A recorded run.
fn judged<'a>(instruments: &[Instrument], summary: &'a Summary) -> Facts<'a> {
    let run = Run::of(summary);
    Facts {
        run: Run {
            started: run.started.or(Some(0.0)),
            ..run
        },
        instruments: instruments.to_vec(),
        is_recorded: true,
        point: [0.0; 3],
        is_exact: [false; 3],
        linearises_once: true,
        is_invariant: false,
        stamps: Stamps::default(),
        constant_biases: Vec::new(),
        restart_after: None,
        growth: Vec::new(),
    }
}

impl Facts<'_> {
    fn findings(&self) -> Vec<Finding> {
        super::table::apply(self, &Ignored::default())
    }
}

fn found(instrument: Instrument, sensor: SensorStatistics, nees: Option<f64>) -> Vec<String> {
    let summary = Summary::default().with(vec![sensor]).with(nees.map(|mean| Score {
        nees_position: Some(consistency(mean)),
        ..Score::default()
    }));
    judged(&[instrument], &summary).findings().iter().map(ToString::to_string).collect()
}

#[test]
fn a_consistent_run_has_no_finding() {
    for nees in [None, Some(3.0), Some(4.4), Some(1.6)] {
        assert!(found(instrument(Some(Bias::Fixed)), sensor(3.0), nees).is_empty());
        let near = found(instrument(Some(Bias::Fixed)), sensor(4.4), nees);
        // Too near to be worth a change; but where nothing else judges a log, more than chance allows is worth a look.
        assert_eq!(near.len(), usize::from(nees.is_none()), "{near:?}");
        let evidence = "NIS of `gnss` is 4.4 of 3, more than chance allows";
        assert!(near.iter().all(|t| t.starts_with(evidence)), "{near:?}");
        assert!(found(instrument(Some(Bias::Fixed)), sensor(3.5), nees).is_empty());
    }
}

#[test]
fn a_reference_outranks_innovations() {
    assert!(found(instrument(Some(Bias::Fixed)), sensor(0.07), Some(3.0)).is_empty());
    let alone = found(instrument(Some(Bias::Fixed)), sensor(0.07), None);
    let slow_on_purpose = Instrument {
        measures: None,
        ..instrument(None)
    };
    assert!(found(slow_on_purpose, sensor(0.07), None).is_empty());
    assert!(
        alone.len() == 1 && alone[0].contains("larger than need be, or its errors change slowly"),
        "{alone:?}"
    );
    let conservative = found(instrument(Some(Bias::Fixed)), sensor(0.07), Some(0.6));
    assert!(
        conservative.len() == 1 && conservative[0].contains("larger than need be"),
        "{conservative:?}"
    );
}

#[test]
fn a_judge_of_the_same_receiver_shows_no_noise_that_is_too_large() {
    let of = |judged_by: Option<&str>| {
        let summary = Summary::default()
            .with(JudgedBy {
                source: judged_by.map(str::to_owned),
                ..JudgedBy::default()
            })
            .with(Score {
                nees_position: Some(consistency(0.3)),
                ..Score::default()
            });
        let judged = Facts {
            linearises_once: false,
            ..judged(&[], &summary)
        };
        judged.findings().len()
    };
    assert_eq!((of(None), of(Some("gnss"))), (1, 0));
}

#[test]
fn a_start_without_a_heading_is_told_where_nothing_shows_that_it_was_found() {
    let of = |sigma: f64, linearises_once: bool, nees: Option<f64>| {
        let summary = Summary::default()
            .with(Start {
                start_angle: Some(("attitude".to_owned(), sigma)),
                ..Start::default()
            })
            .with(nees.map(|mean| Score {
                nees_attitude: Some(consistency(mean)),
                ..Score::default()
            }));
        let judged = Facts {
            linearises_once,
            ..judged(&[], &summary)
        };
        judged.findings().iter().any(|f| f.evidence.contains("a 1σ of 103° of `attitude`"))
    };
    assert!(of(1.8, true, None) && of(1.8, true, Some(9.0)));
    assert!(!of(0.9, true, None), "well enough known");
    assert!(!of(1.8, false, None), "a bank, or an iterated update");
    assert!(!of(1.8, true, Some(3.0)), "it was found");
}

#[test]
fn a_parameter_is_unlearnt_where_no_axis_of_it_fell() {
    let told = |start: &[f64], end: &[f64]| {
        let state = FinalState {
            name: "heading_offset".to_owned(),
            kind: fusion_core::state::Kind::Vector(start.len()),
            value: vec![0.0; end.len()],
            sigma: end.iter().map(|s: &f64| s.to_radians()).collect(),
            start_sigma: start.iter().map(|s: &f64| s.to_radians()).collect(),
            covariance: Vec::new(),
            unit: "rad",
        };
        let summary = Summary::default().with(vec![state]);
        let judged = judged(&[], &summary);
        judged.findings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = told(&[5.0], &[4.9]);
    let evidence = "the data told nothing of `heading_offset` (1σ [deg] 5 at the start, 4.9 at the end)";
    assert!(all.len() == 1 && all[0].starts_with(evidence), "{all:?}");
    assert!(told(&[5.0], &[4.4]).is_empty());
    // An axis that is fixed says nothing; one that was learnt is enough.
    assert_eq!(told(&[5.0, 0.0], &[5.0, 0.0]).len(), 1);
    assert!(told(&[5.0, 5.0], &[5.0, 1.0]).is_empty());
    // One that returns to zero by itself has no 1σ to begin with.
    assert!(told(&[], &[5.0]).is_empty());
}

#[test]
fn sensors_that_all_disagree_by_far_are_compared_with_a_wrong_input() {
    let compass = |nis: f64| SensorStatistics {
        name: "compass".to_owned(),
        nis: Some(consistency(nis)),
        ..SensorStatistics::default()
    };
    let instruments = [
        instrument(Some(Bias::Fixed)),
        Instrument {
            name: "compass".to_owned(),
            source: "compass".to_owned(),
            measures: Some(Measures::Attitude),
            ..instrument(Some(Bias::Fixed))
        },
    ];
    let first = |sensors: Vec<SensorStatistics>| {
        let summary = Summary::default().with(sensors);
        let judged = judged(&instruments, &summary);
        judged.findings().first().map(ToString::to_string).unwrap_or_default()
    };
    let told = first(vec![sensor(400.0), compass(900.0)]);
    assert!(
        told.starts_with("no sensor agrees") && told.contains("`gnss` 400 of 3, `compass` 900 of 3"),
        "{told}"
    );
    assert!(told.contains("axes, signs and units of its input"), "{told}");
    // One that agrees is compared with the same input.
    let told = first(vec![sensor(400.0), compass(3.0)]);
    assert!(told.starts_with("NIS of `gnss`"), "{told}");
}

#[test]
fn what_is_to_be_done_about_several_errors_is_told_once() {
    let summary = Summary::default().with(Score {
        nees_position: Some(consistency(30.0)),
        nees_velocity: Some(consistency(20.0)),
        ..Score::default()
    });
    let judged = judged(&[], &summary);
    let all: Vec<String> = judged.findings().iter().map(ToString::to_string).collect();
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(
        all[0].starts_with("NEES position is 30 of 3, NEES velocity is 20 of 3: errors are 3.1"),
        "{all:?}"
    );
}

/// A run with a large horizontal error at a time.
fn outstanding(at: f64, max: f64) -> Score {
    Score {
        nees_position: Some(consistency(3.0)),
        position: Some(Axes {
            max: [max, 1.0, 1.0],
            max_time: [at, 0.0, 0.0],
            ..Axes::all(1.0)
        }),
        horizontal_max: max,
        horizontal_median: Some(1.0),
        ..Score::default()
    }
}

#[test]
fn a_sensor_that_was_believed_against_the_estimate_is_told_where_a_large_error_follows() {
    let told = |score: Option<Score>| {
        let summary = Summary::default()
            .with(vec![SensorStatistics {
                rejected: 10,
                reacquired: 2,
                reacquired_at: vec![40.0, 150.0],
                ..sensor(3.0)
            }])
            .with(score);
        let all = judged(&[instrument(None)], &summary).findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = told(Some(outstanding(151.0, 90.0)));
    let evidence = "`gnss` was believed against the estimate at 150.0 s (re-acquired), its gate rejected 10 of 312 measurements; a \
                    horizontal error of 90 m followed at 151.0 s";
    assert!(
        all.len() == 1 && all[0].starts_with(evidence) && all[0].contains("or what the estimate had followed until then"),
        "{all:?}"
    );
    // Before it the estimate was wrong, and this cured it; long after it is another matter; so is an error like all others.
    for (at, max) in [(39.0, 90.0), (260.0, 90.0), (151.0, 4.0)] {
        let all = told(Some(outstanding(at, max)));
        assert!(all.is_empty(), "{at} {max}: {all:?}");
    }
    assert!(told(None)[0].contains("at 40.0 s (re-acquired)"));
}

#[test]
fn of_a_log_what_can_be_found_out_is_told_before_a_guess_and_once() {
    let of = |is_recorded| {
        let summary = Summary::default()
            .with(Score {
                nees_position: Some(consistency(12.0)),
                nees_velocity: Some(consistency(9.0)),
                ..Score::default()
            })
            .with(vec![sensor(1.2)]);
        let instruments = [instrument(Some(Bias::Fixed))];
        let judged = Facts {
            is_recorded,
            ..judged(&instruments, &summary)
        };
        judged.findings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let log = of(true);
    let check = "begin with `fusion check DESIGN --data DIR`";
    assert!(log[0].contains(check) && log[0].contains("slow error of `gnss`"), "{log:?}");
    assert!(
        log.len() == 2 && !log[1].contains(check) && log[1].contains("late stamps"),
        "{log:?}"
    );
    let simulated = of(false).join("\n");
    assert!(
        !simulated.contains("fusion check") && !simulated.contains("late stamps"),
        "{simulated}"
    );
}

#[test]
fn a_sensor_of_depth_is_not_blamed_for_a_horizontal_error() {
    let of = |worst: usize| {
        let mut rms = [1.0; 3];
        rms[worst] = 9.0;
        let summary = Summary::default()
            .with(Score {
                nees_position: Some(consistency(12.0)),
                position: Some(Axes { rms, ..Axes::all(1.0) }),
                ..Score::default()
            })
            .with(vec![sensor(1.2)]);
        let depth = Instrument {
            axes: [false, false, true],
            ..instrument(Some(Bias::Fixed))
        };
        judged(&[depth], &summary).findings()[0].to_string()
    };
    assert!(of(2).contains("slow error of `gnss`") && !of(0).contains("slow error"));
}

#[test]
fn rows_that_a_fault_disturbed_are_told_before_errors() {
    let of = |nees: f64| {
        let summary = Summary::default()
            .with(Score {
                nees_position: Some(consistency(nees)),
                ..Score::default()
            })
            .with(vec![SensorStatistics {
                disturbed: Some(Disturbed {
                    missed: 235,
                    ..Disturbed::default()
                }),
                ..sensor(1.2)
            }])
            .with(vec![FaultWindow {
                stream: "receiver".to_owned(),
                fault: "jump".to_owned(),
                from: 120.0,
                to: 300.0,
            }]);
        let all = judged(&[instrument(Some(Bias::Fixed))], &summary).findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = of(300.0);
    assert!(
        all[0].starts_with("disturbed rows were used while faults were at work: 235 of `gnss`; `jump` (from 120.0 s on)"),
        "{all:?}"
    );
    assert!(
        all.len() == 2 && all[1].ends_with("begin with what is said of the faults"),
        "{all:?}"
    );
    assert!(of(3.0).is_empty());
}

#[test]
fn samples_that_are_taken_for_spikes_and_gaps_of_the_input_are_told() {
    let of = |spikes, coasted, nees: Option<f64>, fault: bool| {
        let report = fusion::rows::SourceReport {
            disturbed: if fault { vec![("gap".to_owned(), 6)] } else { Vec::new() },
            ..Default::default()
        };
        let summary = Summary::default()
            .with(vec![ConsumerCounts {
                name: "process".to_owned(),
                stream: "imu".to_owned(),
                rows: 9000,
                spikes,
                ..ConsumerCounts::default()
            }])
            .with(Counts {
                coasted,
                ..Counts::default()
            })
            .with(vec![fusion::run::SourceStatistics::new("imu", &report)])
            .with(nees.map(|mean| Score {
                nees_position: Some(consistency(mean)),
                ..Score::default()
            }));
        let all = judged(&[], &summary).findings();
        let at = |word: &str| all.iter().position(|f| f.evidence.contains(word));
        (at("6 samples of `imu`"), at("for 0.29 s"))
    };
    // Harmful ones come first, before the errors that follow from them.
    assert_eq!(of(6, 0.0, Some(90.0), false), (Some(0), None));
    assert!(of(6, 0.0, Some(3.0), false).0.is_some() && of(6, 0.0, None, false).0.is_some());
    assert!(of(0, 0.29, None, false).1.is_some());
    assert_eq!(of(6, 0.29, None, true), (None, None));
    assert_eq!(of(0, 0.0, Some(3.0), false), (None, None));
}

#[test]
fn gates_that_all_reject_are_compared_with_a_wrong_input() {
    let refused = |name: &str, rejected| SensorStatistics {
        name: name.to_owned(),
        rejected,
        ..sensor(3.0)
    };
    let named = |name: &str| Instrument {
        name: name.to_owned(),
        source: name.to_owned(),
        ..instrument(None)
    };
    let of = |last: u64| {
        let summary = Summary::default().with(vec![refused("gnss", 200), refused("field", 100), refused("baro", last)]);
        let all = judged(&["gnss", "field", "baro"].map(named), &summary).findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = of(50);
    assert!(
        all.len() == 1 && all[0].starts_with("every gate rejects measurements: `gnss` 40 %, `field` 25 %, `baro` 14 %"),
        "{all:?}"
    );
    // One that agrees is compared with the same input.
    assert_eq!(of(0).len(), 2);
}
