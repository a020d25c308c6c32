//! Findings about the reference, and about the heading that is compared with it.

use super::super::stamps::{Common, Delay};
use super::*;
use fusion::health::FilterHealth;
use fusion::score::{Course, LengthSpread, Offset, Spreads};

#[test]
fn a_heading_that_is_wrong_by_a_constant_is_told_before_what_follows_from_it() {
    let told = |mean: f64, rms: f64, nees: f64| {
        let summary = Summary::default().with(Score {
            nees_attitude: Some(consistency(nees)),
            attitude_deg: Some(Axes {
                mean: [0.0, 0.0, mean],
                rms: [0.1, 0.1, rms],
                ..Axes::default()
            }),
            ..Score::default()
        });
        let judged = judged(&[], &summary);
        judged.findings().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let all = told(-3.3, 3.4, 3000.0);
    assert!(
        all[0].starts_with("the heading error is nearly constant, -3.3°") && all[0].contains("`declination`"),
        "{all:?}"
    );
    for (mean, rms, nees) in [(-0.9, 0.9, 3000.0), (-3.3, 5.0, 3000.0), (-3.3, 3.4, 3.0)] {
        let all = told(mean, rms, nees);
        assert!(!all.iter().any(|t| t.contains("nearly constant")), "{all:?}");
    }
}

#[test]
fn a_heading_that_is_wrong_beyond_doubt_is_told_whatever_the_reference_knows_of_itself() {
    let of = |rms: f64, inside: f64| {
        let summary = Summary::default().with(Score {
            attitude_deg: Some(Axes {
                inside: [1.0, 1.0, inside],
                ..Axes::all(rms)
            }),
            heading_rmse_deg: Some(rms),
            spread: Spreads {
                heading_deg: Some(LengthSpread { median: rms, p95: rms }),
                ..Spreads::default()
            },
            ..Score::default()
        });
        let all = judged(&[], &summary).findings();
        all.iter()
            .any(|f| f.about == "heading" && f.advice.contains("either the filter or the reference"))
    };
    assert!(of(93.0, 0.0));
    assert!(!of(93.0, 1.0), "the filter says that it does not know");
    assert!(!of(3.0, 0.5));
}

/// The findings of a run with this offset of the reference and this NEES of the position.
fn by_offset(offset: Offset, nees: f64) -> String {
    let summary = Summary::default().with(Score {
        nees_position: Some(consistency(nees)),
        offset: Some(offset),
        ..Score::default()
    });
    let all = judged(&[], &summary).findings();
    all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_latency_is_told_with_its_figures() {
    let late = Offset {
        latency: 1.0,
        latency_sigma: 0.01,
        latency_explained: 0.98,
        ..Offset::default()
    };
    let told = by_offset(late, 59.0);
    assert!(
        told.starts_with("position error is explained to 98 % by a reference that is late by 1.00 s"),
        "{told}"
    );
    assert!(
        told.contains("`latency = \"1.00 s\"`") && told.ends_with("what is said of the reference"),
        "{told}"
    );
    let early = by_offset(Offset { latency: -0.18, ..late }, 59.0);
    assert!(
        early.contains("the sensors of position are later than their `time_offset` says, by 0.18 s"),
        "{early}"
    );
    assert_eq!(
        by_offset(
            Offset {
                latency_sigma: 0.3,
                ..late
            },
            3.0
        ),
        ""
    );
}

#[test]
fn an_offset_of_the_reference_is_told_with_its_figures() {
    let arm = Offset {
        body: [-1.25, -0.004, -20.0],
        sigma: [0.07, 0.04, 5.0],
        explained: 0.6,
        own: [0.5, 0.0, 0.0],
        halves: [[-1.2, 0.0, 9.0], [-1.3, 0.0, -20.0]],
        ..Offset::default()
    };
    assert!(by_offset(arm, 3.0).contains("give `reference.lever_arm = [1.25, 0.00, 0.00]`"));
    // An undetermined axis is ignored, and a millimetre is not reported.
    for body in [[0.01, 0.0, -60.0], [0.0; 3]] {
        assert_eq!(
            by_offset(
                Offset {
                    body,
                    sigma: [0.001, 0.04, 5.0],
                    ..arm
                },
                3.0
            ),
            ""
        );
    }
    // Down is determined, too, by its 1σ. But it explains nothing by itself, as on a level vehicle.
    let level = Offset {
        body: [-1.25, -0.004, -1.9],
        sigma: [0.07, 0.04, 0.3],
        own: [0.5, 0.0, 0.01],
        halves: [[-1.2, 0.0, -1.8], [-1.3, 0.0, -2.0]],
        ..arm
    };
    assert!(by_offset(level, 3.0).contains("`reference.lever_arm = [1.25, 0.00, 0.00]`"));
    let tilted = Offset {
        own: [0.5, 0.0, 0.1],
        ..level
    };
    assert!(by_offset(tilted, 3.0).contains("`reference.lever_arm = [1.25, 0.00, 1.90]`"));
    // Slow errors fit another arm in each half.
    let wanders = Offset {
        halves: [[-0.3, 0.0, 0.0], [-2.1, 0.0, 0.0]],
        ..arm
    };
    assert_eq!(by_offset(wanders, 3.0), "");
    // A determined arm that explains only a part: named as one of the causes.
    let part = by_offset(Offset { explained: 0.4, ..arm }, 30.0);
    assert!(
        !part.contains("is explained") && part.contains("the position errors fit `lever_arm = [1.25, 0.00, 0.00]`"),
        "{part}"
    );
}

/// A run with this share of yaw errors inside 3σ; roll and pitch are always inside.
fn attitude(inside: f64, course: Option<Course>) -> Score {
    Score {
        attitude_deg: Some(Axes {
            inside: [1.0, 1.0, inside],
            ..Axes::all(0.36)
        }),
        course,
        ..Score::default()
    }
}

fn told(score: Score, sensors: Vec<SensorStatistics>) -> Vec<String> {
    let summary = Summary::default().with(sensors).with(score);
    let all = judged(&[instrument(None)], &summary).findings();
    all.iter().map(ToString::to_string).collect()
}

#[test]
fn a_reference_whose_heading_does_not_go_with_its_own_course_is_told_with_the_1_sigma_to_give() {
    let course = Course {
        reference_deg: 0.30,
        estimate_deg: 0.16,
        own_deg: 0.29,
        share: 0.83,
        share_sigma: 0.07,
    };
    let all = told(attitude(0.645, Some(course)), Vec::new());
    assert_eq!(all.len(), 1, "{all:?}");
    assert!(
        all[0].contains("its heading scatters by 0.3°, that of the filter by 0.16°, so 83 %") && all[0].contains("a 1σ of \"0.29 deg\""),
        "{all:?}"
    );
    // Less than half of the error comes from the reference, or the share is poorly determined.
    let alike = Course { share: 0.6, ..course };
    let few = Course {
        share_sigma: 0.2,
        ..course
    };
    // A nose that does not follow the motion, and a share that no reference can have.
    let hovering = Course {
        reference_deg: 96.0,
        ..course
    };
    let beyond = Course {
        share: 17.81,
        share_sigma: 1.88,
        ..course
    };
    for course in [Some(alike), Some(few), Some(hovering), Some(beyond), None] {
        let all = told(attitude(0.645, course), Vec::new());
        assert_eq!(all.len(), 1, "{all:?}");
        assert!(
            all[0].starts_with("inside 3σ lie 64.5 % of yaw of the attitude errors: begin with `fusion check"),
            "{all:?}"
        );
    }
    assert!(told(attitude(0.99, Some(course)), Vec::new()).is_empty());
}

#[test]
fn attitude_errors_outside_3_sigma_follow_from_what_is_told_of_a_sensor() {
    let all = told(attitude(0.645, None), vec![sensor(400.0)]);
    let last = all.last().unwrap();
    assert!(
        last.starts_with("inside 3σ lie 64.5 % of yaw") && last.ends_with("begin with what is said of `gnss`"),
        "{all:?}"
    );
}

#[test]
fn a_heading_that_was_wrong_before_the_alignment_accuses_no_reference() {
    let of = |at: f64| {
        let mut axes = Axes {
            inside: [1.0, 1.0, 0.9],
            ..Axes::all(16.0)
        };
        axes.max_time = [at; 3];
        let summary = Summary::default()
            .with(vec![FilterHealth {
                aligned: Some(8.2),
                ..FilterHealth::default()
            }])
            .with(Score {
                attitude_deg: Some(axes),
                heading_rmse_deg: Some(16.0),
                ..Score::default()
            });
        let all = judged(&[], &summary).findings();
        all.into_iter().find(|f| f.about == "heading").unwrap().advice
    };
    assert!(of(3.0).contains("`reference.from = \"8.2 s\"`") && !of(3.0).contains("either the filter"));
    assert!(of(9.0).contains("either the filter or the reference"));
}

/// A sensor with an estimated time offset; the reference reads its instrument, too.
fn common(what: Measures, seconds: f64, latency: f64) -> Common {
    Common {
        delay: Delay {
            sensor: "gnss".to_owned(),
            state: Some("gnss.time_offset".to_owned()),
            seconds,
            sigma: 0.002,
        },
        what,
        channel: "source.withheld.channels.velocity".to_owned(),
        latency,
        arm: None,
    }
}

#[test]
fn a_reference_of_the_instrument_of_a_sensor_is_as_late() {
    let of = |common: Common, nees: f64, cause: Option<f64>| {
        let stamps = Stamps {
            common: vec![common],
            ..Stamps::default()
        };
        let summary = Summary::default()
            .with(cause.map(sensor).into_iter().collect::<Vec<_>>())
            .with(Score {
                nees_velocity: Some(consistency(nees)),
                ..Score::default()
            });
        let instruments = [instrument(None)];
        let judged = Facts {
            stamps: stamps.clone(),
            ..judged(&instruments, &summary)
        };
        let all = judged.findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let told = of(common(Measures::Velocity, 0.12, 0.0), 11.0, None);
    assert!(told.contains("`source.withheld.channels.velocity.latency = \"0.120 s\"`"), "{told}");
    assert!(told.ends_with("begin with what is said of the reference"), "{told}");
    let is_silent = |common: Common, nees: f64| !of(common, nees, None).contains("reads the velocity of the instrument");
    assert!(
        is_silent(common(Measures::Velocity, 0.12, 0.0), 3.0),
        "errors are as large as expected"
    );
    assert!(is_silent(common(Measures::Velocity, 0.12, 0.117), 11.0), "it is as late");
    assert!(
        is_silent(common(Measures::Velocity, -0.12, 0.0), 11.0),
        "nothing is stamped before it is measured"
    );
    let unsure = Delay {
        sigma: 0.05,
        ..common(Measures::Velocity, 0.12, 0.0).delay
    };
    assert!(is_silent(
        Common {
            delay: unsure,
            ..common(Measures::Velocity, 0.12, 0.0)
        },
        11.0
    ));
    let cause = of(common(Measures::Velocity, 0.12, 0.0), 11.0, Some(30.0));
    assert!(
        !cause.contains("reads the velocity"),
        "what a wrong sensor makes is no latency: {cause}"
    );
}

#[test]
fn positions_that_are_all_early_are_those_of_a_late_input() {
    let of = |offset: Option<f64>, latency: f64| {
        let delay = Delay {
            state: offset.map(|_| "gnss.time_offset".to_owned()),
            seconds: offset.unwrap_or_default(),
            ..Delay::default()
        };
        let stamps = Stamps {
            of_position: vec![delay],
            input: Some(("imu".to_owned(), 200.0)),
            ..Stamps::default()
        };
        let summary = Summary::default().with(Score {
            nees_position: Some(consistency(1000.0)),
            offset: Some(Offset {
                latency,
                latency_sigma: 0.001,
                latency_explained: 0.96,
                ..Offset::default()
            }),
            ..Score::default()
        });
        let judged = Facts {
            stamps: stamps.clone(),
            ..judged(&[], &summary)
        };
        let all = judged.findings();
        all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let told = of(Some(-0.184), -0.18);
    assert!(
        told.contains("`source.imu.time.offset = \"199.816 s\"`, 0.184 s less than now"),
        "{told}"
    );
    for (offset, latency) in [(None, -0.18), (Some(-0.04), -0.18), (Some(0.18), 0.18)] {
        let told = of(offset, latency);
        assert!(
            told.contains("position error is explained") && !told.contains("source.imu"),
            "{told}"
        );
    }
}

#[test]
fn a_reference_of_the_instrument_of_a_sensor_is_of_one_point_with_it() {
    let of = |arm: [f64; 3], sigma: f64, point: [f64; 3]| {
        let stamps = Stamps {
            common: vec![Common {
                arm: Some((arm, [sigma; 3])),
                ..common(Measures::Position, 0.0, 0.0)
            }],
            ..Stamps::default()
        };
        let summary = Summary::default().with(Score {
            offset: Some(Offset::default()),
            ..Score::default()
        });
        let judged = Facts {
            stamps: stamps.clone(),
            point,
            ..judged(&[], &summary)
        };
        judged
            .findings()
            .iter()
            .any(|f| f.advice.contains("`reference.lever_arm = [0.024, -0.011, 0.000]`"))
    };
    let arm = [0.024, -0.011, 0.0];
    // 0.039 m is 3.9σ and 2σ; one of three axes is beyond 3.6σ with a probability of 0.1 %.
    assert!(of(arm, 0.01, [0.0, -0.05, 0.0]));
    assert!(!of(arm, 0.02, [0.0, -0.05, 0.0]), "by chance");
    assert!(!of(arm, 0.001, [0.014, -0.011, 0.0]), "a centimetre");
}

#[test]
fn rows_of_one_file_and_column_are_of_one_instrument() {
    let toml = |text: &str| fusion::config::Document::parse("test", text).0;
    let gnss = "path = 'a'\ntime = { column = 't', offset = '2 s' }\nchannels.velocity = { columns = ['n', 'e', 'd'], latency = '20 ms' }";
    let a = toml(gnss);
    let is_one = |text: &str| super::super::stamps::is_one(a.root(), toml(text).root(), "channels.velocity");
    assert!(is_one(&gnss.replace("20 ms", "0.1 s")));
    for (from, to) in [("'a'", "'b'"), ("'n'", "'x'"), ("2 s", "3 s"), ("velocity", "position")] {
        assert!(!is_one(&gnss.replacen(from, to, 1)), "{from}");
    }
    let seconds = |path: &str| super::super::stamps::seconds(a.root().at(path));
    assert_eq!(
        (seconds("time.offset"), seconds("channels.velocity.latency"), seconds("rate")),
        (2.0, 0.02, 0.0)
    );
}
