//! Silent sensors, and the health of a filter without them.

use super::*;

#[test]
fn a_sensor_that_falls_silent_degrades_after_thirty_of_its_own_periods() {
    let mut bench = Bench::new();
    for (sensor, period) in [(POSITION, 10.0), (SPEED, 0.1), (WHEELS, 0.1)] {
        for k in 0..5 {
            bench.update(sensor, period * f64::from(k), Accepted, 3.0);
        }
    }
    let silent = |sensor| Reason::Silent { sensor, replaced: false };
    // From 0.4 s on, for 5 s at least. The output of a stage may pause.
    bench.estimate(5.35);
    assert_eq!(bench.reasons(), []);
    bench.estimate(5.45);
    assert_eq!(bench.reasons(), [silent(SPEED)]);
    bench.estimate(339.0);
    assert_eq!(bench.reasons(), [silent(SPEED)]);
    bench.estimate(341.0);
    assert_eq!(bench.reasons(), [silent(POSITION), silent(SPEED)]);
}

#[test]
fn a_stream_of_a_stage_that_falls_silent_degrades() {
    let mut bench = Bench::new();
    for k in 0..10 {
        bench.monitor.row(STREAM, at(f64::from(k)));
        bench.monitor.row(STREAM + 1, at(0.1 * f64::from(k)));
    }
    bench.estimate(38.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(39.1);
    assert_eq!(bench.reasons(), [Reason::StreamSilent { stream: STREAM }]);
    bench.monitor.row(STREAM, at(40.0));
    bench.estimate(45.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_silent_sensor_degrades_unless_others_measure_what_it_does() {
    let silent = |replaced| Reason::Silent { sensor: SPEED, replaced };
    for (axes, replaced) in [
        (&[NORTH, EAST, DOWN][..], true),
        (&[NORTH], true),
        (&[2], false),
        (&[NORTH, 2], false),
    ] {
        let mut bench = Bench::new();
        bench.measures(POSITION, &[NORTH, EAST, DOWN]);
        bench.measures(SPEED, axes);
        bench.updates(SPEED, 1, 5, Accepted, 3.0);
        bench.updates(POSITION, 6, 34, Accepted, 3.0);
        assert_eq!(bench.reasons(), []);
        bench.updates(POSITION, 35, 36, Accepted, 3.0);
        assert_eq!(bench.reasons(), [silent(replaced)], "{axes:?}");
        let state = if replaced { State::Good } else { State::Degraded };
        assert_eq!(bench.monitor.health().state, state);
        // The other one away as well, for 30 of the periods of the first.
        if replaced {
            bench.estimate(66.1);
            assert!(bench.reasons().contains(&silent(false)), "{:?}", bench.reasons());
        }
    }
}

#[test]
fn nothing_that_measures_position_or_velocity_for_half_a_minute_degrades() {
    let never_silent = Limits {
        silent: f64::INFINITY,
        ..Limits::DEFAULT
    };
    // From the start.
    let mut bench = Bench::with(never_silent);
    bench.estimate(29.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(30.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
    // Rows of a stage count as rows from outside do; one direction of three is not enough.
    for (sensor, axes, is_aided) in [
        (SPEED, &[NORTH, EAST, DOWN][..], true),
        (WHEELS, &[EAST, DOWN], true),
        (WHEELS, &[DOWN], false),
        (SPEED, &[0, 1, 2], false),
    ] {
        let mut bench = Bench::with(never_silent);
        bench.measures(sensor, axes);
        bench.updates(sensor, 1, 40, Accepted, 3.0);
        let expected = if is_aided { &[][..] } else { &[Reason::Unaided] };
        assert_eq!(bench.reasons(), expected, "{axes:?}");
        bench.estimate(70.1);
        assert_eq!(bench.reasons(), [Reason::Unaided]);
    }
    // With 101 m/s of noise, a measurement gives no information about 0.1 m/s; with 99 m/s it does.
    for (innovation, is_aided) in [(99.0, true), (101.0, false)] {
        let mut bench = Bench::with(never_silent);
        bench.innovation = innovation;
        bench.measures(SPEED, &[NORTH, EAST, DOWN]);
        bench.updates(SPEED, 1, 40, Accepted, 3.0);
        assert_eq!(bench.reasons().is_empty(), is_aided, "{innovation}");
    }
    // Three periods of the sensor are allowed.
    let mut bench = Bench::with(never_silent);
    bench.measures(SPEED, &[NORTH, EAST, DOWN]);
    for t in [20.0, 40.0, 60.0, 80.0] {
        bench.update(SPEED, t, Accepted, 3.0);
    }
    bench.estimate(139.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(140.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
}

#[test]
fn a_velocity_in_the_axes_of_a_vehicle_that_goes_on_by_itself_has_to_be_measured_too() {
    let mut b = LayoutBuilder::new();
    block::<Attitude>(
        &mut b,
        "attitude",
        UnitQuaternion::identity(),
        &[0.02; 3],
        StateRole::Kinematic,
        Dynamics::Process,
    );
    // A diver who swims at an unknown speed.
    let swims = Dynamics::GaussMarkov {
        sigma: vec![0.3; 3],
        tau: 20.0,
    };
    block::<Vector<3>>(&mut b, "body_velocity", SVector::zeros(), &[0.3; 3], StateRole::Kinematic, swims);
    let layout = b.finish();
    let limits = Limits {
        silent: f64::INFINITY,
        ..Limits::DEFAULT
    };
    let mut bench = Bench::of(layout.clone(), limits);
    bench.estimate(30.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
    // By a log he does.
    let mut bench = Bench::of(layout, limits);
    bench.measures(SPEED, &[NORTH, EAST, DOWN]);
    bench.updates(SPEED, 1, 40, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}
