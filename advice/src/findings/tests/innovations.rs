//! Findings from innovations.

use super::*;

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
        white.contains("its `noise`, or that of the process, is larger than need be; a constant error") && white.contains("look for one"),
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
    assert!(large.contains("so it is not noise") && large.lines().count() == 1, "{large}");
    // A reference judges better.
    let mut s = sensor(3.0);
    (s.innovations.lag_1, s.innovations.count) = (vec![0.9], 300);
    assert!(found(instrument(Some(Bias::Fixed)), s, Some(3.0)).is_empty());
}

/// Innovations of a velocity with this declared noise \[m/s\].
fn velocity(declared: f64, ratio: f64, lag_1: f64, (count, independent): (u64, f64), nees: Option<f64>) -> Vec<Finding> {
    let mut s = sensor(3.0 * ratio);
    s.innovations = fusion::observe::Innovations {
        count,
        lag_1: vec![lag_1; 3],
        rms: vec![0.05; 3],
        unit: vec!["m/s".to_owned(); 3],
        mean: vec![0.0; 3],
        mean_sigmas: vec![0.0; 3],
        independent: vec![independent; 3],
        ..fusion::observe::Innovations::default()
    };
    let summary = Summary::default().with(vec![s]).with(nees.map(|mean| Score {
        nees_position: Some(consistency(mean)),
        ..Score::default()
    }));
    let own = Instrument {
        noise: vec![declared; 3],
        ..instrument(None)
    };
    judged(&[own], &summary).findings()
}

/// The innovations of the velocity of two recorded cars, declared as in their designs, then ten and a hundred times
/// larger: the noise, NIS over its degrees of freedom, lag 1, the count and the independent ones. NEES of the velocity is
/// 4.0 and 2.9 of 3.
#[test]
fn a_noise_is_called_too_large_only_if_innovations_with_their_correlation_tell_more() {
    for judged in [None, Some(2.9)] {
        // As declared: 2397 innovations tell as much as 293, so that the noise covers them.
        assert_eq!(velocity(0.07, 0.2572, 0.23, (2397, 293.0), judged), []);
        assert_eq!(velocity(0.1, 0.334, 0.71, (459, 80.0), judged), []);
        // Ten times on both cars: 0.05 m/s √(460 / 61) and √(2402 / 164). A hundred times on the first car.
        for (declared, ratio, own, white) in [
            (1.0, 0.0025, (460, 61.0), "0.1373 m/s"),
            (0.7, 0.0041, (2402, 164.0), "0.1914 m/s"),
            (7.0, 4.2e-5, (2402, 166.0), "0.1902 m/s"),
        ] {
            let found = velocity(declared, ratio, 0.5, own, judged);
            let advice = found[0].advice.as_str();
            assert!(advice.contains("even for an exact estimate") && advice.ends_with(white), "{advice}");
            // Without a reference, a constant error may be the reason for the noise: a decision, not an edit.
            let edits = judged.map(|_| Edit::set("sensor.gnss.noise", format!("\"{white}\"")));
            assert_eq!(found[0].edits, Vec::from_iter(edits));
        }
    }
    // If errors are too large, the noise must not be lowered.
    let refuted = velocity(7.0, 4.2e-5, 0.5, (2402, 166.0), Some(12.0));
    assert!(refuted.iter().all(|found| !found.advice.contains("too large,")), "{refuted:?}");
}

/// The accelerometer noise of a recorded car a hundred times too large: NIS of the velocity is 0.025 of 3.
#[test]
fn a_noise_that_the_innovations_need_is_not_blamed_for_a_small_nis() {
    // 0.05 m/s √(2470 / 165) is 0.19 m/s, more than the noise.
    let found = velocity(0.07, 0.0084, 0.35, (2470, 165.0), None);
    assert!(
        found[0].rule == "nis-small" && found[0].advice.contains("too large errors of its estimate") && found[0].edits.is_empty(),
        "{found:?}"
    );
    // Too few to decide: six innovations of 0.6 times the 1σ.
    let few = velocity(0.12, 0.2, 0.5, (60, 30.0), None);
    assert!(few.iter().all(|found| found.edits.is_empty()), "{few:?}");
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
        let summary = Summary::default().with(vec![sensor(nis)]);
        let judged = Facts {
            growth: growth.to_vec(),
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
fn innovations_of_hundreds_are_no_matter_of_noise() {
    // 600 of 3: fourteen times the 1σ.
    let far = found(instrument(None), sensor(600.0), None);
    let (axes, noise) = (far[0].find("axes, signs, units and `lever_arm`"), far[0].find("`noise`"));
    assert!(axes.is_some() && axes < noise && far[0].contains("fusion check"), "{far:?}");
    assert!(!far[0].contains("raise its `noise`"), "{far:?}");
    // 60 of 3 may be outliers, or the noise of another receiver.
    let near = found(instrument(None), sensor(60.0), None);
    assert!(
        !near[0].contains("hardly noise") && near[0].ends_with("then look at its `noise`"),
        "{near:?}"
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
