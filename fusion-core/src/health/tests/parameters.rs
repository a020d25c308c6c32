//! Parameters and the covariance.

use super::*;

#[test]
fn a_sigma_below_its_floor_degrades() {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[VELOCITY].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.1, 1.01e-5, 0.1]);
    bench.estimate(1.0);
    assert_eq!(bench.reasons(), []);
    bench.belief.covariance.set_sigmas(&block, &[0.1, 0.99e-5, 0.1]);
    bench.estimate(2.0);
    assert_eq!(bench.reasons(), [Reason::Floor { block: VELOCITY }]);
}

#[test]
fn a_sigma_that_is_zero_from_the_start_on_is_a_declaration() {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[VELOCITY].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.1, 0.1, 0.0]);
    let (belief, rivals) = (bench.belief.clone(), Rivals::NONE);
    bench.hear(&Event::Started { belief: &belief, rivals });
    bench.estimate(1.0);
    assert_eq!(bench.reasons(), []);
    // Once it has grown it is known no more, and to be zero again is a collapse.
    bench.belief.covariance.set_sigmas(&block, &[0.1, 0.1, 0.1]);
    bench.estimate(2.0);
    bench.belief.covariance.set_sigmas(&block, &[0.1, 0.1, 0.0]);
    bench.estimate(3.0);
    assert_eq!(bench.reasons(), [Reason::Floor { block: VELOCITY }]);
}

#[test]
fn a_calibration_far_from_its_initial_value_degrades_unless_it_may_have_walked_there() {
    let mut bench = Bench::new();
    let bias = bench.layout.blocks()[BIAS].storage;
    bench.belief.x[bias + 1] = -0.49;
    bench.estimate(0.5);
    assert_eq!(bench.reasons(), []);
    bench.belief.x[bias + 1] = -0.51;
    bench.estimate(1.0);
    assert_eq!(bench.reasons(), [Reason::Calibration { block: BIAS }]);
    // 5 √(0.01 + 1e-4 · 100 s) = 0.707.
    bench.belief.x[bias + 1] = -0.7;
    bench.estimate(100.0);
    assert_eq!(bench.reasons(), []);
    bench.belief.x[bias + 1] = -0.72;
    bench.estimate(101.0);
    assert_eq!(bench.reasons(), [Reason::Calibration { block: BIAS }]);
}

#[test]
fn a_slow_error_many_of_its_stationary_sigmas_away_degrades() {
    let mut bench = Bench::new();
    let slow = bench.layout.blocks()[SLOW].storage;
    // 5 · 3.2.
    for (value, reasons) in [
        (-15.9, &[][..]),
        (-16.1, &[Reason::Calibration { block: SLOW }]),
        (16.1, &[Reason::Calibration { block: SLOW }]),
    ] {
        bench.belief.x[slow] = value;
        bench.estimate(bench.belief.time.seconds() + 1.0);
        assert_eq!(bench.reasons(), reasons, "{value}");
    }
}

/// A minute in good health, then five seconds of rejected measurements, during which the bias moves by `pull`. Their
/// NIS decides whether the covariance explains them. The bias walks by 0.01² a second, with a σ of 0.02.
fn pulled(pull: f64, nis: f64) -> Bench {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[BIAS].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.02; 2]);
    bench.updates(POSITION, 1, 70, Accepted, 3.0);
    bench.belief.x[block.storage] += pull;
    bench.updates(POSITION, 71, 75, Rejected, nis);
    bench
}

#[test]
fn a_parameter_that_was_pulled_away_is_told_until_it_is_learnt_anew() {
    let is_told = |bench: &Bench| bench.reasons().contains(&Reason::Pulled { block: BIAS });
    // The rejections are reported from 73 s on. The test then looks back at the value of 30 s, which may have walked
    // by 5 √(43 s · 0.01²/s) = 0.328.
    let mut bench = pulled(0.34, 100.0);
    assert!(is_told(&bench));
    // The rejections are reported until 80 s. From then on a second leaves 0.02²/(0.02² + 0.01²) = 0.8 of the pull:
    // 0.34 · 0.8⁹ is beyond twice the σ, 0.34 · 0.8¹⁰ is not.
    bench.updates(POSITION, 76, 89, Accepted, 3.0);
    assert_eq!(bench.reasons(), [Reason::Pulled { block: BIAS }]);
    bench.updates(POSITION, 90, 91, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // A parameter that comes back is right at once.
    let mut bench = pulled(-0.34, 100.0);
    assert!(is_told(&bench));
    bench.updates(POSITION, 76, 80, Accepted, 3.0);
    let at = bench.layout.blocks()[BIAS].storage;
    bench.belief.x[at] = 0.039;
    bench.updates(POSITION, 81, 82, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_parameter_that_its_covariance_lets_move_or_that_no_sensor_contradicts_is_not_pulled() {
    let not_told = |bench: Bench| !bench.reasons().contains(&Reason::Pulled { block: BIAS });
    assert!(not_told(pulled(0.32, 100.0)));
    // A follower of a rejected leader.
    assert!(not_told(pulled(0.4, 16.0)));
}

/// Two minutes in good health, in which the bias moves by `jump`. It walks by 0.01² a second, with a σ of 0.02.
fn jumped(jump: f64) -> Bench {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[BIAS].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.02; 2]);
    bench.updates(POSITION, 1, 120, Accepted, 3.0);
    bench.belief.x[block.storage] += jump;
    bench
}

#[test]
fn a_parameter_that_moves_by_many_of_its_own_sigmas_is_told_though_no_sensor_disagrees() {
    let told = [Reason::Jumped { block: BIAS }];
    // The monitor looks back by 30 s to 60 s: the value may have walked by 8 √(0.02² + 60 s · 0.01²/s) = 0.64 at
    // most.
    let mut bench = jumped(0.65);
    bench.updates(POSITION, 121, 122, Accepted, 3.0);
    assert_eq!(bench.reasons(), told);
    assert_eq!(bench.monitor.health().state, State::Degraded);
    // It ends when the value that the monitor looks back at has moved too.
    bench.updates(POSITION, 123, 200, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // 8 √(0.02² + 30 s · 0.01²/s) = 0.47 at least.
    let mut bench = jumped(0.46);
    bench.updates(POSITION, 121, 122, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn what_a_parameter_was_while_several_beliefs_were_possible_is_no_measure_of_what_it_is() {
    for is_undecided in [false, true] {
        let mut bench = jumped(0.0);
        bench.rivals = apart(if is_undecided { 1.8 } else { 0.0 });
        bench.updates(POSITION, 121, 125, Accepted, 3.0);
        // Another one is shown, and no other is possible any more.
        bench.rivals = Rivals::NONE;
        bench.belief.x[bench.layout.blocks()[BIAS].storage] += 2.0;
        bench.updates(POSITION, 126, 126, Reacquired, 3.0);
        bench.updates(POSITION, 127, 150, Accepted, 3.0);
        let is_told = bench.reasons().contains(&Reason::Pulled { block: BIAS });
        assert_eq!(is_told, !is_undecided, "{:?}", bench.reasons());
    }
}
