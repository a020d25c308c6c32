//! Advice that can be followed, and that helps.

use super::*;
use fusion::config::Document;
use fusion::health::{FilterHealth, NamedReason, State, Transition};
use fusion::observe::RejectionStreak;
use fusion::run::Start;
use fusion::score::Offset;
use fusion_models::registry::{self, Role};

/// A design with one sensor and these extra lines.
fn text(lines: &str) -> String {
    format!(
        "[process]
type = 'strapdown'
gyro.noise = '0.01 deg/s/sqrt(Hz)'
gyro.bias = {{ estimate = true, initial = [0, 0, 0], sigma = '0.1 deg/s' }}
accelerometer.noise = '1 mg/sqrt(Hz)'
accelerometer.bias = {{ estimate = true, initial = [0, 0, 0], sigma = '5 mg', random_walk = '1 ug/sqrt(s)' }}
[filter.bank]
[initial.start]
type = 'explicit'
position = {{ latitude = 0, longitude = 0, height = 0 }}
position_sigma = 1
velocity = [0, 0, 0]
velocity_sigma = 1
attitude = [0, 0, 0]
attitude_sigma = '1 deg'
[simulation]
trajectory = [{{ type = 'rest', duration = 10 }}]
imu = {{ rate = '10 Hz', preset = 'hg1700' }}
sensor.gnss = {{ rate = '1 Hz', white = '1 m' }}
[sensor.gnss]
type = 'gnss_position'
source = 'gnss'
noise = {{ sigma = '1 m' }}
{lines}"
    )
}

#[test]
fn the_setting_that_forbids_a_return_is_named_for_the_gates_that_have_it() {
    fusion_models::link();
    let (mut with, mut without) = (0, 0);
    for gate in registry::all().into_iter().filter(|r| r.role == Role::Gate) {
        let own: Vec<&str> = gate.example.lines().filter(|line| !line.starts_with("recovery")).collect();
        let gate_table = format!("[sensor.gnss.gate]\ntype = '{}'\n{}\n", gate.name, own.join("\n"));
        let document = Document::parse("x.toml", &text(&gate_table)).0;
        let design = Design::read(document).unwrap_or_else(|d| panic!("{}: {d}", gate.name));
        let has_recovery = Instrument::of_design(&design, &[])[0].has_recovery;
        let forbidden = text(&format!("{gate_table}recovery = {{ never_reacquire = true }}\n"));
        let is_accepted = Design::read(Document::parse("x.toml", &forbidden).0).is_ok();
        assert_eq!(has_recovery, is_accepted, "{}", gate.name);
        (with, without) = (with + usize::from(is_accepted), without + usize::from(!is_accepted));
    }
    assert!(with > 0 && without > 0);
}

#[test]
fn two_conditions_are_advised_for_the_sensors_that_take_them() {
    fusion_models::link();
    let (mut with, mut without) = (0, 0);
    for sensor in registry::all().into_iter().filter(|r| r.role == Role::Sensor) {
        let own = format!(
            "[sensor.other]\nsource = 'other'\ntype = '{}'\nnoise.sigma = 1\n{}\n",
            sensor.name, sensor.example
        );
        let read = |gate: &str| {
            let world = text(&format!("{own}{gate}")).replace("sensor.gnss = {", "sensor.other = { rate = '1 Hz' }\nsensor.gnss = {");
            Design::read(Document::parse("x.toml", &world).0)
        };
        // Some examples share states with sensors that are not in this design.
        let Ok(design) = read("") else { continue };
        let is_advised = Instrument::of_design(&design, &[])[1].has_horizontal_position;
        let gated = read("[sensor.other.gate]\ntype = 'two_condition'\nheight = false\n").unwrap();
        let block = &gated.sensors[1].block;
        let is_accepted = block.gate.as_ref().unwrap().suits(&block.model.noise()).is_ok();
        assert_eq!(is_advised, is_accepted, "{}", sensor.name);
        (with, without) = (with + usize::from(is_accepted), without + usize::from(!is_accepted));
    }
    assert!(with > 0 && without > 0, "{with} with, {without} without");
    let of = |has_horizontal_position| {
        let s = SensorStatistics {
            rejected: 60,
            ..sensor(1.0)
        };
        let instrument = Instrument {
            has_horizontal_position,
            ..instrument(None)
        };
        found(instrument, s, None).join("\n").contains("two_condition")
    };
    assert!(of(true) && !of(false));
}

#[test]
fn the_growth_of_a_process_is_of_settings_that_it_has() {
    fusion_models::link();
    let of = |kind: &str| {
        let document = Document::parse("x.toml", &format!("[process]\ntype = '{kind}'\n")).0;
        instrument::growth(document.root().get("process").unwrap())
    };
    assert_eq!(of("strapdown").len(), 4, "{:?}", of("strapdown"));
    assert!(of("dead_reckoning").is_empty());
}

#[test]
fn a_sensor_is_forbidden_to_return_only_where_a_declared_fault_of_it_explains_that_it_disagreed() {
    let of = |stream: &str, to: f64, has_recovery: bool| {
        let summary = Summary::default()
            .with(vec![SensorStatistics {
                rejected: 10,
                reacquired: 1,
                reacquired_at: vec![40.0],
                ..sensor(3.0)
            }])
            .with(vec![FaultWindow {
                stream: stream.to_owned(),
                fault: "spoofer".to_owned(),
                from: 20.0,
                to,
            }]);
        let gnss = Instrument {
            has_recovery,
            ..instrument(None)
        };
        judged(&[gnss], &summary).findings()[0].advice.clone()
    };
    let forbidden = "it was disturbed then by `spoofer`: write `sensor.gnss.gate.recovery.never_reacquire = true`, which forbids it";
    assert_eq!(of("receiver", 60.0, true), forbidden);
    for other in [of("receiver", 30.0, true), of("compass", 60.0, true), of("receiver", 60.0, false)] {
        assert!(!other.contains("never_reacquire"), "{other}");
    }
}

#[test]
fn a_poor_start_is_helped_by_a_chart_only_where_the_process_moves_that_angle() {
    let of = |angle: &str, parameters: Vec<FinalState>| {
        let summary = Summary::default()
            .with(Start {
                start_angle: Some((angle.to_owned(), 1.8)),
                ..Start::default()
            })
            .with(parameters);
        let advice = judged(&[], &summary).findings()[0].advice.clone();
        (advice.contains("iterated"), advice.contains("right_invariant"))
    };
    let parameter = |name: &str| FinalState {
        name: name.to_owned(),
        kind: fusion_core::state::Kind::Angle,
        value: vec![0.0],
        sigma: vec![0.1],
        start_sigma: vec![1.8],
        covariance: Vec::new(),
        unit: "rad",
    };
    assert_eq!(of("attitude", Vec::new()), (true, true));
    assert_eq!(of("dvl.mounting", vec![parameter("dvl.mounting")]), (true, false));
    let of_process = of("heading_offset", vec![parameter("heading_offset")]);
    assert_eq!(of_process, (false, false), "no sensor is linearised in it");
}

#[test]
fn headings_that_are_still_possible_at_the_end_are_told() {
    let reason = NamedReason {
        reason: "undecided",
        of: String::new(),
        state: State::Aligning,
    };
    let of = |ends: &[&[NamedReason]]| {
        let change = |reasons: &&[NamedReason]| Transition {
            reasons: reasons.to_vec(),
            ..Transition::default()
        };
        let health = FilterHealth {
            transitions: ends.iter().map(change).collect(),
            ..FilterHealth::default()
        };
        let summary = Summary::default()
            .with(Start {
                start_angle: Some(("heading_offset".to_owned(), 0.1)),
                ..Start::default()
            })
            .with(vec![health]);
        let judged = judged(&[], &summary);
        judged.findings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let told = of(&[std::slice::from_ref(&reason)]);
    assert!(
        told.len() == 1 && told[0].starts_with("several headings are still possible at the end"),
        "{told:?}"
    );
    assert!(of(&[std::slice::from_ref(&reason), &[]]).is_empty(), "it was decided");
}

#[test]
fn a_sensor_is_looked_at_for_what_its_block_has() {
    fusion_models::link();
    let of = |kind: &str, more: &str| {
        let own = format!("[sensor.other]\ntype = '{kind}'\nsource = 'other'\n{more}\n");
        let world = text(&own).replace("sensor.gnss = {", "sensor.other = { rate = '1 Hz' }\nsensor.gnss = {");
        let design = Design::read(Document::parse("x.toml", &world).0).unwrap_or_else(|d| panic!("{d}"));
        Instrument::of_design(&design, &[])[1].parts()
    };
    assert_eq!(
        of("gnss_velocity", "noise.sigma = 1"),
        "time stamps, axes, signs, units and `lever_arm`"
    );
    let field = of(
        "magnetometer",
        "noise.sigma = '1 uT'\nstrength = '50 uT'\ninclination = 1\ndeclination = 0",
    );
    assert_eq!(
        field,
        "time stamps, axes, signs, units, `declination`, `hard_iron`, `inclination` and `strength`"
    );
    assert_eq!(
        of("barometer", "noise.sigma = '3 Pa'"),
        "time stamps, sign, unit, `lever_arm` and `sea_level_pressure`"
    );
    assert_eq!(
        of("heading", "noise.sigma = '1 deg'"),
        "time stamps, sign, unit, `declination` and `deviation`"
    );
}

#[test]
fn biases_of_the_input_that_cannot_change_are_named_before_a_sensor_without_a_bias() {
    fusion_models::link();
    let design = Design::read(Document::parse("x.toml", &text("")).0).unwrap_or_else(|d| panic!("{d}"));
    let constant = instrument::constant_biases(&design.process.node);
    assert_eq!(constant, ["`process.gyro.bias`"], "the other one walks");
    let of = |bias: Option<Bias>, lag_1: f64, constant_biases: &[String]| {
        let mut s = sensor(1.2);
        (s.innovations.lag_1, s.innovations.count) = (vec![lag_1], 300);
        let summary = Summary::default().with(vec![s]).with(Score {
            nees_position: Some(consistency(12.0)),
            ..Score::default()
        });
        let instruments = [instrument(bias)];
        let judged = Facts {
            constant_biases: constant_biases.to_vec(),
            ..judged(&instruments, &summary)
        };
        judged.findings()[0].advice.clone()
    };
    let told = of(None, 0.6, &constant);
    assert!(
        told.contains("`process.gyro.bias` cannot change: give a `random_walk`") && !told.contains("raise its `noise`"),
        "{told}"
    );
    for other in [of(None, 0.1, &constant), of(None, 0.6, &[]), of(Some(Bias::Fixed), 0.6, &constant)] {
        assert!(!other.contains("cannot change"), "{other}");
    }
}

#[test]
fn what_explains_position_errors_is_not_said_of_a_velocity() {
    let offset = Offset {
        body: [-1.25, 0.0, 0.0],
        sigma: [0.07; 3],
        explained: 0.3,
        own: [0.3, 0.0, 0.0],
        halves: [[-1.2, 0.0, 0.0], [-1.3, 0.0, 0.0]],
        ..Offset::default()
    };
    let summary = Summary::default()
        .with(Score {
            nees_velocity: Some(consistency(12.0)),
            offset: Some(offset),
            ..Score::default()
        })
        .with(vec![sensor(0.5)]);
    let velocity = Instrument {
        measures: Some(Measures::Velocity),
        ..instrument(None)
    };
    let advice = judged(&[velocity], &summary).findings()[0].advice.clone();
    let (process, reference) = (advice.find("a noise of the process is too small"), advice.find("`[reference]`"));
    assert!(process.is_some() && process < reference && !advice.contains("1.25"), "{advice}");
}

#[test]
fn a_mounting_is_not_removed_where_the_reference_has_other_axes() {
    let of = |mean: f64| {
        let summary = Summary::default().with(Score {
            nees_attitude: Some(consistency(3000.0)),
            attitude_deg: Some(Axes {
                mean: [0.0, 0.0, mean],
                ..Axes::all(mean)
            }),
            ..Score::default()
        });
        judged(&[], &summary).findings()[0]
            .advice
            .contains("`remove_mean_mounting` would hide it")
    };
    assert!(of(89.8) && !of(3.3));
}

/// A magnetometer whose innovations carry the information of `independent` ones.
fn repeating(nis: f64, independent: f64) -> (Instrument, SensorStatistics) {
    let instrument = Instrument {
        name: "compass".to_owned(),
        measures: Some(Measures::Attitude),
        ..instrument(None)
    };
    let mut s = SensorStatistics {
        name: "compass".to_owned(),
        ..sensor(nis)
    };
    s.innovations = fusion::observe::Innovations {
        count: 6000,
        unit: vec!["T".to_owned()],
        rms: vec![4e-6],
        lag_1: vec![0.99],
        mean: vec![0.0],
        mean_sigmas: vec![0.0],
        independent: vec![independent],
        ..fusion::observe::Innovations::default()
    };
    (instrument, s)
}

#[test]
fn a_sensor_whose_measurements_repeat_each_other_comes_before_the_errors_that_it_explains() {
    let found = |nis: f64, independent: f64, nees: Option<f64>| {
        let (compass, s) = repeating(nis, independent);
        let summary = Summary::default().with(vec![sensor(0.9), s]).with(nees.map(|mean| Score {
            nees_position: Some(consistency(mean)),
            ..Score::default()
        }));
        let found = judged(&[super::instrument(Some(Bias::Correlated)), compass], &summary).findings();
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    // 6000 innovations with the information of 15, each 0.5 of the expected size: they are overweighted 200 times.
    let all = found(1.5, 15.0, Some(11.0));
    assert!(
        all[0].contains("innovations of `compass` each repeat the one before") && all[0].contains("15 independent"),
        "{all:?}"
    );
    // 4 µT √400.
    assert!(all[0].ends_with("as much is 80 µT"), "{}", all[0]);
    assert!(
        all[1].contains("NEES position") && all[1].contains("what is said of `compass`"),
        "{all:?}"
    );
    // Without a reference it is the first finding, too, and is reported once.
    let all = found(1.5, 15.0, None);
    assert!(
        all[0].contains("`compass`") && all.iter().filter(|f| f.contains("`compass`")).count() == 1,
        "{all:?}"
    );
    // Larger errors than it explains have another cause.
    let all = found(1.5, 15.0, Some(900.0));
    assert!(all[0].contains("NEES position"), "{all:?}");
    // A noise that is raised for it gives no finding: 0.005/3 of 400.
    let all = found(0.005, 15.0, None);
    assert!(all.iter().all(|f| !f.contains("`compass`")), "{all:?}");
    // Errors of the expected size judge.
    assert!(found(1.5, 15.0, Some(3.0)).is_empty());
}

#[test]
fn before_a_noise_is_lowered_an_error_that_is_constant_is_looked_for() {
    let of = |sigmas: f64| {
        let mut s = sensor(0.07);
        s.innovations = fusion::observe::Innovations {
            count: 300,
            axis: ["north", "east"].map(str::to_owned).to_vec(),
            unit: vec!["rad".to_owned(); 2],
            lag_1: vec![0.0; 2],
            mean: vec![0.0, 1_f64.to_radians()],
            mean_sigmas: vec![1.0, sigmas],
            ..fusion::observe::Innovations::default()
        };
        found(instrument(Some(Bias::Fixed)), s, None).join("\n")
    };
    let mean = of(-5.0);
    assert!(
        mean.contains("their mean (east) is 1 deg, 5.0 times its own 1σ") && !mean.contains("larger than need be"),
        "{mean}"
    );
    // One of two means is beyond 3.5σ with a probability of 0.1 %, the level of a rule.
    assert!(of(3.4).contains("larger than need be"), "{}", of(3.4));
}

#[test]
fn a_bank_that_turns_to_another_heading_late_is_told() {
    let of = |time: f64, angle: Option<f64>| {
        let summary = Summary::default()
            .with(Start {
                started: Some(100.0),
                ..Start::default()
            })
            .with(vec![FilterHealth {
                until: 1100.0,
                ..FilterHealth::default()
            }])
            .with(fusion::observe::Hypotheses {
                changes: vec![fusion::observe::Change { time, angle }],
                ..fusion::observe::Hypotheses::default()
            });
        let found = judged(&[], &summary).findings();
        found.iter().map(|f| f.evidence.clone()).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(
        of(360.0, Some(3.1)),
        "at 360.0 s another heading is shown than until then, 178° away"
    );
    for (time, angle) in [(340.0, Some(3.1)), (360.0, Some(0.2)), (360.0, None)] {
        assert_eq!(of(time, angle), "");
    }
}

#[test]
fn a_filter_that_was_lost_is_told_first_with_what_was_refused() {
    let of = |in_outages: f64, measurements: u64| {
        let change = |time: f64, state: State| Transition {
            time,
            state,
            in_outages: if state == State::Lost { in_outages } else { 0.0 },
            ..Transition::default()
        };
        let health = FilterHealth {
            aligned: Some(0.0),
            until: 1000.0,
            transitions: vec![
                change(0.0, State::Good),
                change(660.0, State::Degraded),
                change(700.0, State::Lost),
                change(729.0, State::Good),
            ],
            ..FilterHealth::default()
        };
        let streak = RejectionStreak {
            from: 661.0,
            measurements,
            seconds: 70.0,
        };
        let mut sensor = SensorStatistics {
            longest_rejection_streak: Some(streak),
            ..sensor(0.3)
        };
        sensor.innovations.count = 500;
        sensor.innovations.lag_1 = vec![0.0];
        let summary = Summary::default().with(vec![health]).with(vec![sensor]);
        let all = judged(&[instrument(None)], &summary).findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let told = of(0.0, 16);
    assert!(
        told[0]
            .starts_with("the filter was lost for 29.0 s, from 700.0 s on: 16 measurements of `gnss` were refused in a row, from 661.0 s"),
        "{told:?}"
    );
    assert!(
        !told.iter().any(|t| t.contains("larger than need be")),
        "no smaller noise where good ones are refused: {told:?}"
    );
    let without = of(0.0, 1);
    assert!(without[0].contains("it began at 660.0 s"), "{without:?}");
    let declared = of(29.0, 16);
    assert!(declared.iter().all(|t| !t.contains("lost")), "{declared:?}");
    assert!(declared.iter().any(|t| t.contains("larger than need be")), "{declared:?}");
}

#[test]
fn a_hardly_known_heading_names_another_chart_where_the_attitude_is_wrong() {
    let of = |degrees: f64, nees: f64, is_invariant: bool, growth: &[String], instruments: &[Instrument]| {
        let summary = Summary::default()
            .with(Start {
                start_angle: Some(("attitude".to_owned(), degrees.to_radians())),
                ..Start::default()
            })
            .with(Score {
                nees_attitude: Some(consistency(nees)),
                ..Score::default()
            });
        let judged = Facts {
            is_invariant,
            growth: growth.to_vec(),
            ..judged(instruments, &summary)
        };
        let all = judged.findings();
        all.into_iter()
            .find(|f| f.advice.contains("`filter.backend = "))
            .map_or(String::new(), |f| f.advice)
    };
    let growth = ["`process.gyro.noise`".to_owned()];
    assert!(of(20.0, 16.0, false, &growth, &[]).ends_with("`filter.backend = \"invariant\"` with `process.discretisation = \"exact\"`"));
    assert!(of(20.0, 16.0, false, &[], &[]).ends_with("`filter.backend = \"invariant\"`"));
    let compass = Instrument {
        measures: Some(Measures::Attitude),
        ..instrument(None)
    };
    assert!(of(20.0, 16.0, false, &growth, &[compass]).contains("`filter.backend = \"iekf\"`"));
    let receiver = [instrument(None)];
    for (degrees, nees, is_invariant) in [(5.0, 16.0, false), (20.0, 4.0, false), (20.0, 16.0, true)] {
        assert_eq!(of(degrees, nees, is_invariant, &growth, &receiver), "");
    }
    // If a receiver is missing, and only a standstill or a height is measured, no NEES is needed.
    let standing = Instrument {
        is_constraint: true,
        measures: Some(Measures::Velocity),
        ..instrument(None)
    };
    let height = Instrument {
        axes: [false, false, true],
        ..instrument(None)
    };
    let blind = [standing, height];
    assert!(of(20.0, 4.0, false, &growth, &blind).ends_with("`process.discretisation = \"exact\"`"));
    for (degrees, is_invariant) in [(5.0, false), (20.0, true)] {
        assert_eq!(of(degrees, 4.0, is_invariant, &growth, &blind), "");
    }
}

#[test]
fn a_start_without_a_heading_tells_what_decides_between_ahead_and_astern() {
    let of = |growth: &[String]| {
        let summary = Summary::default().with(Start {
            start_angle: Some(("heading_offset".to_owned(), 1.8)),
            ..Start::default()
        });
        let judged = Facts {
            growth: growth.to_vec(),
            ..judged(&[], &summary)
        };
        judged.findings()[0].advice.contains("a heading and its opposite")
    };
    assert!(of(&[]));
    assert!(!of(&["`process.gyro.noise`".to_owned()]), "accelerations tell");
}
