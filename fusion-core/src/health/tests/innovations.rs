//! Innovations and rejections.

use super::*;

#[test]
fn innovations_are_too_large_where_their_mean_is_and_not_where_one_is() {
    let mut bench = Bench::new();
    // 2.5² of 3 rows are 18.75.
    bench.updates(POSITION, 1, 60, Accepted, 18.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 61, 90, Accepted, 20.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Innovations {
            sensor: POSITION,
            lost: false
        }]
    );
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 10, Accepted, 3.0);
    bench.updates(POSITION, 11, 11, Accepted, 1e9);
    bench.updates(POSITION, 12, 30, Accepted, 3.0);
    bench.updates(POSITION, 31, 31, Accepted, f64::NAN);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 32, 34, Accepted, 1e9);
    assert_eq!(
        bench.reasons(),
        [Reason::Innovations {
            sensor: POSITION,
            lost: true
        }]
    );
    // Half of ten measurements bring the mean back, and the reason is held for 5 s.
    bench.updates(POSITION, 35, 45, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn innovations_of_a_fast_sensor_are_averaged_over_ten_seconds() {
    let mut bench = Bench::new();
    let told = |bench: &mut Bench, from: u32, to: u32, nis: f64| {
        for k in from..=to {
            let t = f64::from(k) * 0.01;
            bench.update(WHEELS, t, Accepted, nis);
            bench.estimate(t);
        }
        bench.reasons().to_vec()
    };
    // 4² σ for 3 s of 10 s: 16 − 13.5 e^{−0.3} = 6.0 < 9; for 9 s: 10.5.
    assert_eq!(told(&mut bench, 1, 300, 2.0 * 16.0), []);
    assert_eq!(
        told(&mut bench, 301, 900, 2.0 * 16.0),
        [Reason::Innovations {
            sensor: WHEELS,
            lost: false
        }]
    );
}

#[test]
fn a_sensor_rejected_for_long_degrades_where_its_covariance_does_not_explain_it() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 10, Accepted, 3.0);
    // 99.9 % of χ² of 3: 16.27. A follower of a rejected leader has a small one.
    bench.updates(POSITION, 11, 30, Rejected, 16.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 31, 32, Rejected, 16.5);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 33, 33, Rejected, 16.5);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: POSITION,
            lost: false
        }]
    );
    bench.updates(POSITION, 34, 39, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // Three at 100 Hz are no streak.
    for k in 0..100 {
        bench.update(SPEED, 40.0 + 0.01 * f64::from(k), Rejected, 100.0);
        bench.estimate(40.0 + 0.01 * f64::from(k));
    }
    assert_eq!(bench.reasons(), []);
}

#[test]
fn rejections_on_either_side_of_a_long_pause_are_no_streak() {
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 10, Accepted, 2.0);
    bench.updates(WHEELS, 11, 12, Rejected, 100.0);
    bench.updates(WHEELS, 100, 101, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(WHEELS, 102, 102, Rejected, 100.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: WHEELS,
            lost: false
        }]
    );
}

#[test]
fn two_sensors_rejected_at_once_degrade_at_once() {
    let mut bench = Bench::new();
    let rejected = |sensor| Reason::Rejected { sensor, lost: false };
    for sensor in [POSITION, SPEED, WHEELS] {
        bench.updates(sensor, 1, 10, Accepted, 2.0);
    }
    bench.update(POSITION, 11.0, Rejected, 100.0);
    bench.update(POSITION, 11.1, Rejected, 100.0);
    bench.update(WHEELS, 11.0, Rejected, 100.0);
    bench.update(WHEELS, 11.1, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    // A single rejection of each comes by chance.
    bench.update(SPEED, 11.2, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    bench.update(SPEED, 11.3, Rejected, 100.0);
    assert_eq!(bench.reasons(), [rejected(POSITION), rejected(SPEED)]);
    // A sensor whose last measurement was rejected long ago does not count.
    let mut bench = Bench::new();
    for sensor in [POSITION, SPEED] {
        bench.updates(sensor, 1, 10, Accepted, 2.0);
    }
    bench.update(POSITION, 11.0, Rejected, 100.0);
    bench.updates(SPEED, 11, 22, Accepted, 2.0);
    bench.update(SPEED, 22.5, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    // One after the other, each used meanwhile.
    let mut bench = Bench::new();
    for (sensor, verdict) in [(POSITION, Rejected), (POSITION, Accepted), (SPEED, Rejected), (SPEED, Accepted)] {
        bench.update(sensor, 11.0, verdict, 100.0);
        assert_eq!(bench.reasons(), []);
    }
}

#[test]
fn a_filter_is_lost_when_all_that_comes_from_outside_has_been_rejected_for_long() {
    let lost = |sensor| Reason::Rejected { sensor, lost: true };
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 30, Rejected, 100.0);
    assert_eq!(bench.monitor.health().state, State::Degraded);
    // A measurement that a stage derives from the input does not support it.
    bench.update(WHEELS, 30.5, Accepted, 2.0);
    bench.updates(POSITION, 31, 31, Rejected, 100.0);
    assert_eq!(bench.reasons(), [lost(POSITION)]);
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 30, Rejected, 100.0);
    bench.update(SPEED, 30.5, Accepted, 2.0);
    bench.updates(POSITION, 31, 60, Rejected, 100.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: POSITION,
            lost: false
        }]
    );
    // A pseudo-measurement alone does not make it so.
    let mut other = Bench::new();
    other.updates(WHEELS, 1, 60, Rejected, 100.0);
    assert_eq!(
        other.reasons(),
        [Reason::Rejected {
            sensor: WHEELS,
            lost: false
        }]
    );
    // Two sensors that contradict it for so long need no third sensor.
    for t in 61..=92 {
        bench.update(SPEED, f64::from(t), Rejected, 100.0);
        bench.update(POSITION, f64::from(t), Rejected, 100.0);
    }
    assert_eq!(bench.reasons(), [lost(POSITION), lost(SPEED)]);
}

#[test]
fn what_a_sensor_said_is_old_when_it_has_been_silent_for_as_long_as_innovations_are_averaged() {
    // The pseudo-measurement of a stage that has become silent; the reason is reported for 5 s more.
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 60, Accepted, 20.0);
    let told = Reason::Innovations {
        sensor: WHEELS,
        lost: false,
    };
    assert_eq!(bench.reasons(), [told]);
    for (t, reasons) in [(70.0, &[told][..]), (75.0, &[told]), (75.1, &[])] {
        bench.estimate(t);
        assert_eq!(bench.reasons(), reasons, "{t}");
    }
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 60, Rejected, 100.0);
    bench.estimate(75.1);
    assert_eq!(bench.reasons(), []);
    // One from outside is silent then; a filter that it has lost stays lost.
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 60, Rejected, 100.0);
    bench.estimate(90.1);
    let lost = Reason::Rejected {
        sensor: POSITION,
        lost: true,
    };
    let silent = Reason::Silent {
        sensor: POSITION,
        replaced: false,
    };
    assert_eq!(bench.reasons(), [lost, silent]);
}

#[test]
fn a_reacquired_sensor_degrades_until_it_is_proven() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 1, Reacquired, 100.0);
    assert_eq!(bench.reasons(), [Reason::Reacquired { sensor: POSITION }]);
    bench.updates(POSITION, 2, 16, Accepted, 3.0);
    assert_eq!(bench.reasons(), [Reason::Reacquired { sensor: POSITION }]);
    bench.updates(POSITION, 17, 17, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // A slow one takes five measurements.
    bench.update(SPEED, 20.0, Reacquired, 100.0);
    for k in 1..5 {
        bench.update(SPEED, 20.0 + 20.0 * f64::from(k), Accepted, 3.0);
    }
    assert!(bench.reasons().contains(&Reason::Reacquired { sensor: SPEED }));
}

#[test]
fn a_filter_is_lost_where_what_is_used_meanwhile_does_not_hold_most_of_the_motion() {
    let rejected = |lost| Reason::Rejected { sensor: POSITION, lost };
    for (others, lost) in [
        (&[0, 1, 2][..], true),
        (&[DOWN], true),
        (&[NORTH, EAST], false),
        (&[NORTH, EAST, DOWN], false),
    ] {
        let mut bench = Bench::new();
        bench.measures(POSITION, &[NORTH, EAST, DOWN]);
        bench.measures(SPEED, others);
        for t in 1..=31 {
            bench.update(SPEED, f64::from(t), Accepted, 3.0);
            bench.updates(POSITION, t, t, Rejected, 100.0);
        }
        assert!(bench.reasons().contains(&rejected(lost)), "{others:?}: {:?}", bench.reasons());
    }
    // A compass that alone is rejected is not right against all else.
    let mut bench = Bench::new();
    bench.measures(POSITION, &[NORTH, EAST, DOWN]);
    bench.measures(SPEED, &[2]);
    for t in 1..=60 {
        bench.update(POSITION, f64::from(t), Accepted, 3.0);
        bench.updates(SPEED, t, t, Rejected, 100.0);
    }
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: SPEED,
            lost: false
        }]
    );
}
