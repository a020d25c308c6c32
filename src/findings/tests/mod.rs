mod advice;
mod reference;
mod suspects;

use super::errors::{bold_outages, far_outage};
use super::instrument::Bias;
use super::*;
use crate::observe::{ConsumerCounts, Disturbed};
use crate::run::FaultWindow;
use crate::score::{Axes, Drift, Moved};
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
fn judged<'a>(instruments: &'a [Instrument], summary: &'a Summary) -> Judged<'a> {
    Judged {
        instruments,
        summary,
        is_recorded: true,
        point: [0.0; 3],
        is_exact: [false; 3],
        linearises_once: true,
        constant_biases: &[],
        restart_after: None,
        growth: &[],
    }
}

fn found(instrument: Instrument, sensor: SensorStatistics, nees: Option<f64>) -> Vec<String> {
    let summary = Summary {
        sensors: vec![sensor],
        score: nees.map(|mean| Score {
            nees_position: Some(consistency(mean)),
            ..Score::default()
        }),
        ..Summary::default()
    };
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
fn small_innovations_with_large_errors_are_a_slow_error_of_the_sensor() {
    let all = found(instrument(Some(Bias::Fixed)), sensor(0.07), Some(12.0));
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(
        all[0].starts_with("NEES position is 12") && all[0].contains("errors are 2"),
        "{all:?}"
    );
    assert!(
        all[0].contains("NIS of `gnss` is only 0.07") && all[0].contains("declare its `bias`"),
        "{all:?}"
    );
    assert!(!all[0].contains("`noise`"), "no smaller noise where errors are large: {all:?}");
    let has_state = found(instrument(Some(Bias::Correlated)), sensor(0.07), Some(12.0));
    assert!(
        has_state[0].ends_with("raise the `sigma` of `gnss.bias`") && !has_state[0].contains("random_walk"),
        "{has_state:?}"
    );
    let walks = found(instrument(Some(Bias::Walk)), sensor(0.07), Some(12.0));
    assert!(walks[0].ends_with("raise the `random_walk` of `gnss.bias`"), "{walks:?}");
    let without = found(instrument(None), sensor(1.2), Some(12.0));
    assert!(without[0].contains("raise its `noise`"), "{without:?}");
    let deaf = found(instrument(None), sensor(0.07), Some(12.0));
    assert!(
        deaf[0].contains("another point (`lever_arm`)") && !deaf[0].contains("`noise`"),
        "{deaf:?}"
    );
    let broken = found(instrument(None), sensor(9.0), Some(12.0));
    assert!(
        broken.len() == 2 && broken[0].starts_with("NIS of `gnss`") && broken[1].ends_with("begin with what is said of `gnss`"),
        "{broken:?}"
    );
    let white = found(instrument(Some(Bias::Fixed)), sensor(3.0), Some(12.0));
    assert!(white[0].contains("noise of the process is too small"), "{white:?}");
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
        let summary = Summary {
            judged_by: judged_by.map(str::to_owned),
            score: Some(Score {
                nees_position: Some(consistency(0.3)),
                ..Score::default()
            }),
            ..Summary::default()
        };
        let judged = Judged {
            instruments: &[],
            summary: &summary,
            point: [0.0; 3],
            linearises_once: false,
            is_recorded: true,
            is_exact: [false; 3],
            constant_biases: &[],
            restart_after: None,
            growth: &[],
        };
        judged.findings().len()
    };
    assert_eq!((of(None), of(Some("gnss"))), (1, 0));
}

#[test]
fn a_start_without_a_heading_is_told_where_nothing_shows_that_it_was_found() {
    let of = |sigma: f64, linearises_once: bool, nees: Option<f64>| {
        let summary = Summary {
            start_angle: Some(("attitude".to_owned(), sigma)),
            score: nees.map(|mean| Score {
                nees_attitude: Some(consistency(mean)),
                ..Score::default()
            }),
            ..Summary::default()
        };
        let judged = Judged {
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
fn what_each_innovation_has_of_the_one_before_tells_noise_from_an_error_that_lasts() {
    let of = |nis: f64, lag_1: f64, count: u64| {
        let mut s = sensor(nis);
        (s.innovations.lag_1, s.innovations.count) = (vec![0.0, lag_1, -0.9], count);
        found(instrument(Some(Bias::Fixed)), s, None).join("\n")
    };
    let slow = of(0.07, 0.9, 300);
    assert!(
        slow.contains("0.07 of 3, lag-1 autocorrelation 0.90: its errors change slowly") && !slow.contains("`noise`"),
        "{slow}"
    );
    let white = of(0.07, 0.1, 300);
    assert!(
        white.ends_with("its `noise`, or that of the process, is larger than need be"),
        "{white}"
    );
    for undecided in [of(0.07, 0.3, 300), of(0.07, 0.9, 20)] {
        assert!(undecided.contains("or its errors change slowly"), "{undecided}");
    }
    let hidden = of(3.0, 0.7, 300);
    assert!(
        hidden.contains("autocorrelation 0.70") && hidden.contains("declare its `bias`"),
        "{hidden}"
    );
    assert_eq!(of(3.0, 0.3, 300), "");
    assert_eq!(of(3.0, 0.7, 20), "", "too few to tell");
    let large = of(9.0, 0.7, 300);
    assert!(large.contains("so it is no noise") && large.lines().count() == 1, "{large}");
    // A reference tells more.
    let mut s = sensor(3.0);
    (s.innovations.lag_1, s.innovations.count) = (vec![0.9], 300);
    assert!(found(instrument(Some(Bias::Fixed)), s, Some(3.0)).is_empty());
}

#[test]
fn of_a_constraint_neither_bias_nor_smaller_noise_is_spoken() {
    let constraint = Instrument {
        is_constraint: true,
        measures: Some(Measures::Velocity),
        ..instrument(Some(Bias::Fixed))
    };
    assert!(found(constraint.clone(), sensor(0.07), None).is_empty());
    let broken = found(constraint, sensor(9.0), None);
    assert!(
        broken.len() == 1 && broken[0].contains("does not keep this constraint"),
        "{broken:?}"
    );
}

#[test]
fn where_a_vehicle_stands_still_the_growth_between_two_stops_is_too_small() {
    let growth = ["`process.accelerometer.vibration`".to_owned(), "`process.gyro.noise`".to_owned()];
    let of = |measures, limits: &[&str], growth: &[String], nis| {
        let constraint = Instrument {
            is_constraint: true,
            measures,
            limits: limits.iter().map(|l| (*l).to_owned()).collect(),
            ..instrument(None)
        };
        let summary = Summary {
            sensors: vec![sensor(nis)],
            ..Summary::default()
        };
        let judged = Judged {
            growth,
            ..judged(std::slice::from_ref(&constraint), &summary)
        };
        judged.findings()[0].advice.clone()
    };
    let (velocity, still) = (Some(Measures::Velocity), ["`stage.rest.still`"]);
    let told = of(velocity, &still, &growth, 9.0);
    assert!(
        told.contains("raise `process.accelerometer.vibration` or `process.gyro.noise` first"),
        "{told}"
    );
    assert!(of(velocity, &still, &growth, 90.0).contains("then at `process.accelerometer.vibration`"));
    for other in [
        of(velocity, &[], &growth, 9.0),
        of(None, &still, &growth, 9.0),
        of(velocity, &still, &[], 9.0),
    ] {
        assert!(other.contains("does not keep this constraint"), "{other}");
    }
}

#[test]
fn a_gate_that_rejects_good_rows_comes_first() {
    let refused = |caught| SensorStatistics {
        rejected: 60,
        disturbed: Some(Disturbed {
            caught,
            ..Disturbed::default()
        }),
        ..sensor(9.0)
    };
    let all = found(instrument(None), refused(0), None);
    assert!(
        all.len() == 2 && all[0].contains("rejected 60 of 360 measurements, 17 %"),
        "{all:?}"
    );
    assert_eq!(
        found(instrument(None), refused(60), None).len(),
        1,
        "disturbed rows are rejected rightly"
    );
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
        let summary = Summary {
            parameters: vec![state],
            ..Summary::default()
        };
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
fn outages_that_end_beyond_three_sigma_are_found_where_chance_does_not_explain_them() {
    let outages = |bold: usize, all: usize| -> Vec<Drift> {
        let drift = |k| Drift {
            end_horizontal: if k < bold { 31.0 } else { 29.0 },
            end_sigma: 10.0,
            ..Drift::default()
        };
        (0..all).map(drift).collect()
    };
    // Of n, k or more by chance: 1.1 % (1, 1), 2.2 % (2, 1), 0.7 % (12, 2), 2.3 % (21, 2), 0.1 % (20, 3).
    for (bold, all, is_told) in [
        (0, 5, false),
        (1, 1, true),
        (1, 2, false),
        (2, 12, true),
        (2, 21, false),
        (3, 20, true),
        (9, 9, true),
    ] {
        let found = bold_outages(&outages(bold, all));
        assert_eq!(found.is_some(), is_told, "{bold} of {all}: {found:?}");
    }
    let told = bold_outages(&outages(2, 12)).unwrap().to_string();
    assert!(
        told.starts_with("at the end of 2 of 12 outages the error is more than 3σ"),
        "{told}"
    );
}

#[test]
fn one_outage_is_told_by_its_size_and_with_what_moved_the_estimate() {
    let outages = |worst: f64, moved: f64| -> Vec<Drift> {
        let drift = |k: u32| Drift {
            from: 60.0 * f64::from(k),
            end_horizontal: if k == 5 { 4.0 * worst } else { 4.0 },
            end_sigma: 4.0,
            moved: Some(Moved {
                sensor: "standing".to_owned(),
                time: 312.3,
                sigmas: moved,
            }),
            ..Drift::default()
        };
        (0..13).map(drift).collect()
    };
    // 13 exp(−x²/2) is 1.3e-3 at 4.3σ and 0.8e-3 at 4.4σ; one of 13 beyond 3σ is 13 %.
    assert!(bold_outages(&outages(10.1, 9.0)).is_none() && far_outage(&outages(4.3, 9.0)).is_none());
    let told = far_outage(&outages(4.4, 9.0)).unwrap();
    assert!(
        told.evidence.contains("outage at 300.0 s the error is 17.6 m, 4.4 times") && told.advice.contains("`standing` at 312.3 s"),
        "{told}"
    );
    // What a consistent filter does now and then is not accused.
    assert!(!far_outage(&outages(10.1, 1.9)).unwrap().advice.contains("standing"));
    let summary = Summary {
        score: Some(Score {
            drift: outages(10.1, 9.0),
            ..Score::default()
        }),
        ..Summary::default()
    };
    let found = judged(&[], &summary).findings();
    assert!(found.iter().any(|f| f.about == "outages"), "{found:?}");
}

#[test]
fn a_start_in_the_last_quarter_is_told_with_what_it_waited_for() {
    let of = |seconds: f64| Summary {
        started: Some(5.0 + seconds),
        waited: Some(crate::observe::Wait {
            seconds,
            of: 40.0,
            waited: vec![("levelling".to_owned(), "a rest".to_owned())],
        }),
        ..Summary::default()
    };
    let line = |summary: &Summary| {
        let text = summary.to_string();
        let is_it = |l: &&str| l.trim().starts_with("started") && l.contains(" at ");
        text.lines().find(is_it).map(|l| l.trim_end().to_owned())
    };
    let told = |summary: &Summary| judged(&[], summary).findings().first().map(ToString::to_string);
    // A twentieth is 2 s, a quarter 10 s.
    assert_eq!((line(&of(2.0)), told(&of(2.0))), (None, None));
    let early = line(&of(4.0)).unwrap();
    let said = "at 9.0 s: 10 % of the log lies before it and was not used: `levelling` waited for a rest";
    assert!(early.ends_with(said) && told(&of(10.0)).is_none(), "{early}");
    let late = told(&of(39.0)).unwrap();
    assert!(
        late.starts_with("the filter started at 44.0 s; 98 % of the log") && late.contains("waited for a rest"),
        "{late}"
    );
}

#[test]
fn a_silence_that_separates_recordings_is_no_gap() {
    let report = crate::rows::SourceReport {
        used: 1001,
        first: Some(Time::default()),
        last: Some(Time::from_seconds(100.0)),
        longest_gap: Some((Time::from_seconds(2.0), 8.1)),
        ..Default::default()
    };
    let summary = Summary {
        sources: vec![crate::run::SourceStatistics::new("receiver", &report)],
        ..Summary::default()
    };
    let instruments = [instrument(None)];
    let of = |restart_after| Judged {
        restart_after,
        ..judged(&instruments, &summary)
    };
    let is_told = |judged: Judged<'_>| judged.findings().iter().any(|f| f.evidence.contains("no row for 8.1 s"));
    assert!(is_told(of(None)) && is_told(of(Some(10.0))) && !is_told(of(Some(5.0))));
}

#[test]
fn innovations_of_hundreds_are_no_matter_of_noise() {
    // 600 of 3: fourteen times the 1σ.
    let far = found(instrument(None), sensor(600.0), None);
    let (axes, noise) = (far[0].find("axes, signs, units and `lever_arm`"), far[0].find("`noise`"));
    assert!(axes.is_some() && axes < noise && far[0].contains("fusion check"), "{far:?}");
    assert!(!far[0].contains("raise its `noise`"), "{far:?}");
    // 60 of 3 may be outliers, or a noise of another receiver.
    let near = found(instrument(None), sensor(60.0), None);
    assert!(
        !near[0].contains("hardly noise") && near[0].ends_with("then look at its `noise`"),
        "{near:?}"
    );
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
        let summary = Summary {
            sensors,
            ..Summary::default()
        };
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
    let summary = Summary {
        score: Some(Score {
            nees_position: Some(consistency(30.0)),
            nees_velocity: Some(consistency(20.0)),
            ..Score::default()
        }),
        ..Summary::default()
    };
    let judged = judged(&[], &summary);
    let all: Vec<String> = judged.findings().iter().map(ToString::to_string).collect();
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(
        all[0].starts_with("NEES position is 30 of 3, NEES velocity is 20 of 3: errors are 3.1"),
        "{all:?}"
    );
}

#[test]
fn rows_that_follow_their_leader_are_no_rejections_of_a_gate() {
    let follower = |rejected, with_leader| SensorStatistics {
        rejected,
        with_leader,
        ..sensor(3.0)
    };
    let own = found(instrument(None), follower(60, 10), None);
    assert!(
        own.len() == 1 && own[0].contains("rejected 50 of 350 measurements, 14 %"),
        "{own:?}"
    );
    assert!(found(instrument(None), follower(60, 50), None).is_empty());
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
        let summary = Summary {
            sensors: vec![SensorStatistics {
                rejected: 10,
                reacquired: 2,
                reacquired_at: vec![40.0, 150.0],
                ..sensor(3.0)
            }],
            score,
            ..Summary::default()
        };
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
        let summary = Summary {
            score: Some(Score {
                nees_position: Some(consistency(12.0)),
                nees_velocity: Some(consistency(9.0)),
                ..Score::default()
            }),
            sensors: vec![sensor(1.2)],
            ..Summary::default()
        };
        let instruments = [instrument(Some(Bias::Fixed))];
        let judged = Judged {
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
        let summary = Summary {
            score: Some(Score {
                nees_position: Some(consistency(12.0)),
                position: Some(Axes { rms, ..Axes::all(1.0) }),
                ..Score::default()
            }),
            sensors: vec![sensor(1.2)],
            ..Summary::default()
        };
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
        let summary = Summary {
            score: Some(Score {
                nees_position: Some(consistency(nees)),
                ..Score::default()
            }),
            sensors: vec![SensorStatistics {
                disturbed: Some(Disturbed {
                    missed: 235,
                    ..Disturbed::default()
                }),
                ..sensor(1.2)
            }],
            faults: vec![FaultWindow {
                stream: "receiver".to_owned(),
                fault: "jump".to_owned(),
                from: 120.0,
                to: 300.0,
            }],
            ..Summary::default()
        };
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
fn samples_that_are_taken_for_spikes_are_told_where_they_do_harm() {
    let of = |spikes, rows, nees: Option<f64>| {
        let summary = Summary {
            consumers: vec![ConsumerCounts {
                name: "process".to_owned(),
                stream: "imu".to_owned(),
                rows,
                spikes,
                ..ConsumerCounts::default()
            }],
            score: nees.map(|mean| Score {
                nees_position: Some(consistency(mean)),
                ..Score::default()
            }),
            ..Summary::default()
        };
        let all = judged(&[], &summary).findings();
        all.first()
            .is_some_and(|f| f.evidence.starts_with("6 samples of `imu`") && f.advice.contains("`process.agility`"))
    };
    assert!(of(6, 9000, Some(90.0)) && of(6, 9000, None));
    assert!(!of(6, 9000, Some(3.0)) && !of(6, 900_000, None) && !of(4, 9000, Some(90.0)));
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
        let summary = Summary {
            sensors: vec![refused("gnss", 200), refused("field", 100), refused("baro", last)],
            ..Summary::default()
        };
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
