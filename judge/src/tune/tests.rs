//! Simulated worlds whose errors are known.

use super::{Hidden, Log, Proposal, Settings, Tuned, hidden, structure, tune};
use fusion::Selection;
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{KeptRows, Options, run};

fn document(file: &str, set: &[&str]) -> Document {
    let selection = Selection {
        set: set.iter().map(|set| (*set).to_owned()).collect(),
        ..Selection::default()
    };
    selection.load(format!("../{file}")).unwrap_or_else(|d| panic!("{d}")).document
}

/// The noises of `configs/ins-gps.toml` that a pattern selects, and why some are not identifiable.
fn explained(set: &[&str], patterns: &[&str]) -> (Tuned, Vec<Hidden>) {
    let logs = [Log {
        document: document("configs/ins-gps.toml", set),
        options: Options {
            kept: Some(KeptRows::default()),
            ..Options::default()
        },
    }];
    let patterns: Vec<String> = patterns.iter().map(|p| (*p).to_owned()).collect();
    let tuned = tune(&logs, &patterns, &Settings::default(), &|_, _| {}).unwrap_or_else(|d| panic!("{d}"));
    let found = hidden(&logs, &tuned, &Settings::default()).unwrap_or_else(|d| panic!("{d}"));
    (tuned, found)
}

/// 500 ppm of 90° are 0.05°, and the heading is known to 0.5°: two turns say almost nothing about the scale of the gyro.
#[test]
fn the_motion_that_says_most_about_a_state_is_named_for_the_noise_that_moves_it() {
    let scale = "process.gyro.scale={ estimate = true, initial = [0, 0, 0], sigma = '500 ppm', random_walk = '1 ppm/sqrt(s)' }";
    let (_, found) = explained(&[scale], &["gyro.scale.random_walk"]);
    let unobserved = found[0].unobserved.as_ref().unwrap();
    assert_eq!(unobserved.state, "gyro scale z");
    let (motion, factor) = unobserved.motion.as_ref().unwrap();
    assert!(motion.starts_with("turns ") && *factor > 1.0, "{found:?}");
    assert!(unobserved.left > 0.9, "{found:?}");
}

#[test]
fn a_noise_that_other_errors_hide_has_its_share_of_the_innovations() {
    let share = |noise: &str| {
        let noise = format!("process.accelerometer.noise={noise} mm/s/sqrt(s)");
        let (tuned, found) = explained(&[&noise], &["accelerometer.noise", "sensor.velocity.noise"]);
        assert!(!tuned.found[0].is_identifiable() && tuned.found[1].is_identifiable(), "{tuned:?}");
        // The identifiable one is not among them.
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((&*found[0].parameter, &found[0].unobserved), ("process.accelerometer.noise", &None));
        let share = found[0].share.clone().unwrap();
        assert_eq!(share.sensor, "velocity");
        share.share
    };
    let (small, large) = (share("0.33"), share("3.3"));
    // A hundred times the variance. The filter adapts to it, and holds back a part.
    assert!((50.0..100.0).contains(&(large / small)), "{small} {large}");
    assert!(small < 0.01, "{small}");
}

#[test]
fn rows_before_the_filter_starts_do_not_count_and_the_error_says_so() {
    let logs = [Log {
        document: document("configs/ins-gps-outlier.toml", &["run.stop='50 s'"]),
        options: Options::default(),
    }];
    let error = tune(&logs, &[], &Settings::default(), &|_, _| {}).unwrap_err().to_string();
    assert!(
        error.contains("no innovation counts") && error.contains("no row of `gps_position`, `gps_velocity`, `compass` reached the filter"),
        "{error}"
    );
}

/// A drive of a quarter of an hour with fixes of 1 m of white noise each second, and what else `position` says.
fn drive(seed: u64, position: &str, further: &[&str]) -> Document {
    let trajectory = "simulation.trajectory=[{ type = 'rest', duration = '10 s' }, \
                      { type = 'straight', distance = '100 m', speed = '10 m/s', acceleration = '1 m/s^2' }, \
                      { type = 'turn', angle = '90 deg', radius = '30 m' }, { type = 'straight', distance = '5000 m' }, \
                      { type = 'turn', angle = '-90 deg', radius = '30 m' }, { type = 'straight', distance = '5000 m' }]";
    let position = format!("simulation.sensor.position={{ rate = '1 Hz', white = ['1 m', '1 m', '2 m']{position} }}");
    let seed = format!("run.seed={seed}");
    let velocity = "simulation.sensor.velocity={ rate = '1 Hz', white = '0.05 m/s' }";
    let set = [&[trajectory, &position, velocity, &seed], further].concat();
    document("configs/ins-gps.toml", &set)
}

fn proposed(document: &Document) -> Vec<Proposal> {
    structure(document, &Options::default(), &|_| Ok(Vec::new())).unwrap_or_else(|d| panic!("{d}"))
}

fn nees(document: Document) -> f64 {
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let summary = run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    summary.score().unwrap().nees_position.as_ref().unwrap().mean / 3.0
}

const SLOW: &str = ", markov = { sigma = '3 m', correlation_time = '20 s' }";

#[test]
fn a_slow_error_that_the_design_leaves_out_is_proposed_and_serves_another_seed() {
    let found = proposed(&drive(1, SLOW, &[]));
    let [proposal] = &found[..] else { panic!("{found:?}") };
    assert_eq!(proposal.is_better(), Some(true), "{proposal:?}");
    let slow = proposal.slow.as_ref().unwrap();
    assert!(slow.sensor == "position" && !slow.is_further, "{slow:?}");
    assert!((slow.interval.0..slow.interval.1).contains(&20.0), "{slow:?}");
    assert!(slow.interval.1 < 60.0, "the log is thirteen correlation times long: {slow:?}");
    let unseen = drive(101, SLOW, &["simulation.draw_parameters=false"]);
    let mut with = unseen.clone();
    proposal
        .edits
        .iter()
        .try_for_each(|edit| with.apply(edit))
        .unwrap_or_else(|d| panic!("{d:?}"));
    let (without, with) = (nees(unseen), nees(with));
    // Consistent is 1. In the whole run there are some 25 independent errors of 2τ and 3 axes: 1σ of the mean is 0.16, and
    // σ and τ are known to a third.
    assert!(without > 10.0 && (0.3..3.0).contains(&with), "{without} {with}");
}

#[test]
fn no_slow_error_is_proposed_where_there_is_none_or_where_it_is_a_state() {
    for seed in [1, 2, 3] {
        assert_eq!(proposed(&drive(seed, "", &[])), [], "{seed}");
    }
    let state = "sensor.position.bias={ estimate = true, initial = [0, 0, 0], sigma = '3 m', correlation_time = '20 s' }";
    // Without this, the world has the bias of the state too.
    let world = "simulation.draw_parameters=false";
    assert_eq!(proposed(&drive(2, SLOW, &[state, world])), []);
    let small = state.replace("3 m", "1 m");
    let found = proposed(&drive(2, SLOW, &[&small, world]));
    assert!(
        found[0].is_better() == Some(true) && found[0].slow.as_ref().unwrap().is_further,
        "{found:?}"
    );
}
