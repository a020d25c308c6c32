//! The order of suspects if several sensors disagree.

use super::*;
use fusion::health::{FilterHealth, NamedReason, State, Transition};
use fusion::run::Detector;

fn named(name: &str) -> Instrument {
    Instrument {
        name: name.to_owned(),
        source: name.to_owned(),
        ..instrument(None)
    }
}

fn disagrees(name: &str, rejected: u64, from: Option<f64>) -> SensorStatistics {
    SensorStatistics {
        name: name.to_owned(),
        rejected,
        disagrees_from: from,
        ..sensor(3.0)
    }
}

fn told(instruments: &[Instrument], summary: &Summary) -> Vec<String> {
    judged(instruments, summary).findings().iter().map(ToString::to_string).collect()
}

#[test]
fn the_first_to_disagree_is_looked_at_before_those_that_are_refused() {
    let of = |field: Option<f64>, leader: Option<&str>| {
        let summary = Summary::default().with(vec![disagrees("gnss", 60, Some(112.0)), disagrees("field", 0, field)]);
        let field = Instrument {
            leader: leader.map(str::to_owned),
            ..named("field")
        };
        told(&[named("gnss"), field], &summary)
    };
    let all = of(Some(100.0), None);
    assert!(
        all.len() == 2 && all[0].starts_with("`field` was the first to disagree, from 100.0 s on, before `gnss`, from 112.0 s on"),
        "{all:?}"
    );
    assert!(
        all[0].contains("`sensor.field.enabled = false`") && all[1].starts_with("the gate of `gnss`"),
        "{all:?}"
    );
    // It disagrees later, at once, never, or is a part of the same instrument.
    for (field, leader) in [(Some(120.0), None), (Some(111.0), None), (None, None), (Some(100.0), Some("gnss"))] {
        assert!(of(field, leader)[0].starts_with("the gate of `gnss`"), "{field:?} {leader:?}");
    }
}

#[test]
fn of_those_that_are_refused_the_first_to_disagree_is_told_first() {
    let summary = Summary::default().with(vec![disagrees("gnss", 60, Some(112.0)), disagrees("baro", 60, Some(21.0))]);
    let all = told(&["gnss", "baro"].map(named), &summary);
    assert!(all.len() == 2 && all[0].starts_with("the gate of `baro`"), "{all:?}");
}

#[test]
fn where_every_gate_rejects_a_sensor_without_one_is_left_out_first() {
    let names = ["gnss", "field", "baro", "log"];
    let of = |has_gate: bool| {
        let summary = Summary::default().with(
            names
                .iter()
                .zip([60, 60, 60, 60])
                .map(|(name, n)| disagrees(name, n, Some(40.0)))
                .collect::<Vec<_>>(),
        );
        let log = Instrument { has_gate, ..named("log") };
        let instruments: Vec<Instrument> = names[..3].iter().map(|name| named(name)).chain([log]).collect();
        told(&instruments, &summary).remove(0)
    };
    let open = of(false);
    let (log, input) = (open.find("`sensor.log.enabled = false`"), open.find("signs and units of its input"));
    assert!(open.starts_with("every gate rejects") && log.is_some() && log < input, "{open}");
    let gated = of(true);
    let (input, first) = (
        gated.find("signs and units of its input"),
        gated.find("`sensor.gnss.enabled = false`"),
    );
    assert!(
        input.is_some() && input < first && gated.ends_with("the first to disagree, from 40.0 s on"),
        "{gated}"
    );
}

#[test]
fn a_parameter_far_from_its_initial_value_comes_before_noise_and_biases_of_others() {
    let of = |name: &str| {
        let far = NamedReason {
            reason: "calibration",
            of: name.to_owned(),
            state: State::Degraded,
        };
        let summary = Summary::default()
            .with(vec![FilterHealth {
                transitions: vec![Transition {
                    time: 35.0,
                    state: State::Degraded,
                    reasons: vec![far],
                    in_outages: 0.0,
                }],
                ..FilterHealth::default()
            }])
            .with(Score {
                nees_position: Some(consistency(12.0)),
                ..Score::default()
            })
            .with(vec![sensor(0.07)]);
        told(&[named("gnss"), named("dvl")], &summary)
    };
    let all = of("dvl.mounting");
    assert!(
        all[0].starts_with("`dvl.mounting` has gone far")
            && all[0].contains("of `dvl`; if they are right")
            && all[0].contains("widen its `sigma`"),
        "{all:?}"
    );
    assert!(all[1].ends_with("begin with what is said of `dvl.mounting`"), "{all:?}");
    assert!(of("gyro_bias")[0].contains("of the input of the process"));
}

#[test]
fn a_constraint_that_fails_by_far_accuses_the_input_and_its_detector() {
    let of = |nis: f64, is_recorded: bool| {
        let summary = Summary::default().with(vec![sensor(nis)]);
        let instruments = [Instrument {
            is_constraint: true,
            limits: vec!["`stage.standing.still`".to_owned()],
            ..instrument(None)
        }];
        let judged = Facts {
            is_recorded,
            ..judged(&instruments, &summary)
        };
        judged.findings()[0].advice.clone()
    };
    let far = of(1421.0, true);
    let (input, detector) = (far.find("input of the process"), far.find("`stage.standing.still`"));
    assert!(input.is_some() && input < detector && !far.contains("raise its"), "{far}");
    // A simulated unit has the declared axes.
    let simulated = of(1421.0, false);
    assert!(
        simulated.contains("`stage.standing.still`") && !simulated.contains("input of the process"),
        "{simulated}"
    );
    assert!(of(9.0, true).contains("raise its `noise`"));
}

#[test]
fn a_detector_that_found_nothing_is_told_where_the_run_went_wrong() {
    let of = |rows: u64, aligned: Option<f64>| {
        let summary = Summary::default()
            .with(vec![ConsumerCounts {
                name: "gnss".to_owned(),
                rows,
                ..ConsumerCounts::default()
            }])
            .with(vec![FilterHealth {
                aligned,
                worst: State::Good,
                ..FilterHealth::default()
            }]);
        let standing = Instrument {
            limits: vec!["`stage.standing.still`".to_owned()],
            ..instrument(None)
        };
        told(&[standing], &summary)
    };
    let all = of(0, None);
    assert!(all.len() == 1 && all[0].ends_with("look at `stage.standing.still`"), "{all:?}");
    let figures = |detector: Detector| {
        let summary = Summary::default()
            .with(vec![ConsumerCounts {
                name: "gnss".to_owned(),
                ..ConsumerCounts::default()
            }])
            .with(vec![sensor(9.0)])
            .with(vec![detector]);
        let standing = Instrument {
            is_constraint: true,
            limits: vec!["`stage.standing.still`".to_owned()],
            ..instrument(None)
        };
        told(&[standing], &summary).join("\n")
    };
    let missed = figures(Detector {
        stage: "receiver".to_owned(),
        tests: 90,
        nearest: Some("the quietest window has 0.031 m/s² where `still.accel_std` allows 0.0050".to_owned()),
        ..Detector::default()
    });
    assert!(
        missed.contains("of `receiver` (the quietest window has 0.031") && missed.contains("at first twice of what it says"),
        "{missed}"
    );
    // A detector that always holds has limits that are too wide.
    let always = figures(Detector {
        stage: "receiver".to_owned(),
        tests: 90,
        held: 90,
        nearest: None,
    });
    assert!(
        always.contains("times what is expected; `receiver` held in 100 % of its tests"),
        "{always}"
    );
    assert!(of(0, Some(1.0)).is_empty() && of(9, None).is_empty());
}

#[test]
fn samples_beyond_the_declared_range_are_told_first() {
    let of = |out_of_range| {
        let summary = Summary::default()
            .with(vec![ConsumerCounts {
                name: "process".to_owned(),
                stream: "imu".to_owned(),
                rows: 32241,
                out_of_range,
                ..ConsumerCounts::default()
            }])
            .with(vec![disagrees("gnss", 60, None)]);
        told(&[named("gnss")], &summary).remove(0)
    };
    let told = of(8736);
    assert!(
        told.starts_with("8736 of 32241 samples of `imu` are outside the declared range") && told.contains("`process.input.range`"),
        "{told}"
    );
    assert!(of(10).starts_with("the gate of `gnss`"), "a blow");
}

#[test]
fn a_few_errors_that_last_as_long_as_the_run_do_not_outrank_innovations() {
    let of = |independent: f64| {
        let summary = Summary::default().with(vec![sensor(0.07)]).with(Score {
            nees_position: Some(Consistency {
                independent,
                band: (0.05, 11.0),
                ..consistency(4.7)
            }),
            ..Score::default()
        });
        told(&[instrument(Some(Bias::Fixed))], &summary).len()
    };
    assert_eq!((of(1.5), of(50.0)), (1, 0));
}
