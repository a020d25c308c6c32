//! The INS-GPS design with outliers, a hundred seeds of each scenario, compared with its required figures. `cargo test
//! --release --test main campaigns -- --nocapture` prints them.
//!
//! Bounds without a comment are the requirements that were set before the design was built: RMS in [0.3, 1.6] m and
//! maximum 3.5 m per axis; a gate that gains 20 % in 95 of 100 seeds and rejects less than 0.1 % of good fixes; RMS
//! below 0.3 m in the first experiment, 0.8 to 1.4 m between GPS and navigation in the second; a spike within 3 m, a
//! gap of 25 m within 8 fixes, an inertial fault within 45 s.

use fusion::config::Document;
use fusion::design::Design;
use fusion::observe::SensorStatistics;
use fusion::run::{Options, run};
use fusion_judge::campaign::{Compared, RunRow, Runs, Statistic, monte_carlo};
use std::path::Path;
use std::sync::LazyLock;

const RUNS: u64 = 100;
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps-outlier.toml");

fn design(variants: &str, set: &[&str]) -> Design {
    let mut document = Document::load(Path::new(FILE)).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants.split('+').filter(|v| !v.is_empty()) {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    for assignment in set {
        document.set(assignment).unwrap();
    }
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// The campaign of `fusion montecarlo configs/ins-gps-outlier.toml -n 100 --variant …`.
fn campaign(variants: &str, set: &[&str]) -> Runs {
    monte_carlo(&design(variants, set), &Options::default(), 0..RUNS, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"))
}

/// The design without changes.
static BASE: LazyLock<Runs> = LazyLock::new(|| campaign("", &[]));

/// RMS over all runs, per axis.
fn pooled(campaign: &Runs) -> [f64; 3] {
    core::array::from_fn(|i| campaign.spread(|r| r.rms[i].powi(2)).unwrap().mean.sqrt())
}

fn horizontal(row: &RunRow) -> f64 {
    row.rms[0].hypot(row.rms[1])
}

fn gps(row: &RunRow) -> &SensorStatistics {
    row.sensors.iter().find(|s| s.name == "gps_position").unwrap()
}

/// The sum over all runs.
fn sum(campaign: &Runs, count: impl Fn(&SensorStatistics) -> u64) -> u64 {
    campaign.rows.iter().map(|r| count(gps(r))).sum()
}

fn missed(gps: &SensorStatistics) -> u64 {
    gps.disturbed.unwrap().missed
}

/// The longest series of rejections in any run: measurements and seconds.
fn longest(campaign: &Runs) -> (u64, f64) {
    let streaks = campaign.rows.iter().filter_map(|r| gps(r).longest_rejection_streak);
    streaks.fold((0, 0.0), |(n, t), r| (n.max(r.measurements), t.max(r.seconds)))
}

/// No lockout at the end, and none longer than an inertial fault may take.
fn never_locked_out(campaign: &Runs) {
    assert!(campaign.rows.iter().all(|r| !gps(r).ends_denied) && longest(campaign).1 <= 45.0);
}

#[test]
fn the_design_bears_outliers_and_without_its_gate_it_does_not() {
    let (gated, open) = (&*BASE, campaign("no-gate", &[]));
    let rms = pooled(gated);
    let within = gated.rows.iter().filter(|r| r.max.iter().all(|max| *max < 3.5)).count();
    println!(
        "outliers: RMS {rms:.3?} m, without the gate {:.3?} m; {within} of {RUNS} runs within 3.5 m",
        pooled(&open)
    );
    for (i, rms) in rms.into_iter().enumerate() {
        let max = gated.spread(|r| r.max[i]).unwrap();
        println!("  axis {i}: max {:.2} m on average, {:.2} m at worst", max.mean, max.max);
        assert!((0.3..1.6).contains(&rms) && max.mean < 3.5);
    }
    // The fixes have an error of 0.8 m (1σ) for a minute at a time. No gate detects it and no average removes it: of
    // 300 axes one or two exceed four sigma of the whole error.
    assert!(within >= 97, "{within}");
    let gain: Vec<f64> = gated
        .rows
        .iter()
        .zip(&open.rows)
        .map(|(g, o)| 1.0 - horizontal(g) / horizontal(o))
        .collect();
    let good = gain.iter().filter(|g| **g >= 0.2).count();
    let mean = gain.iter().sum::<f64>() / RUNS as f64;
    println!("  the gate gains {:.0} % on average, 20 % or more in {good} runs", 100.0 * mean);
    assert!(mean >= 0.2 && good >= 95);
    assert_eq!(
        (sum(gated, missed), sum(&open, missed)),
        (0, sum(gated, |s| s.disturbed.unwrap().caught))
    );
    never_locked_out(gated);
}

#[test]
fn sound_fixes_pass_the_gate() {
    let clean = campaign("clean", &[]);
    let (rejected, all) = (sum(&clean, |s| s.rejected), sum(&clean, |s| s.rejected + s.accepted));
    println!("clean: {rejected} of {all} fixes rejected");
    assert!(all > 20_000 && rejected * 1000 < all);
}

#[test]
fn slow_errors_as_states_make_the_filter_consistent() {
    let c = campaign("correlated-bias", &[]);
    for (i, name) in ["position", "velocity", "attitude"].into_iter().enumerate() {
        let judged = c.campaign.judge(Statistic::Nees(i)).unwrap();
        println!("slow errors: NEES of {name} {:.2}, band {:.2?}", judged.mean, judged.band);
        // The errors agree with the filter's σ within a tenth: the scale errors of the unit are not states.
        assert!(((judged.mean / 3.0).sqrt() - 1.0).abs() < 0.1, "{name} {judged:?}");
    }
}

#[test]
fn the_attitude_may_come_from_a_filter_of_its_own() {
    let (unified, cascaded) = (pooled(&BASE), pooled(&campaign("cascaded", &[])));
    println!("unified {unified:.3?} m, cascaded {cascaded:.3?} m");
    for i in 0..3 {
        assert!((0.3..1.6).contains(&cascaded[i]));
        // In both, the error of the fixes dominates. 10 %: the additional error from a tilt of 0.1 deg.
        assert!((cascaded[i] / unified[i] - 1.0).abs() < 0.1);
    }
}

#[test]
fn the_first_experiment_is_better_than_dead_reckoning_and_than_its_fixes() {
    let [navigation, reckoning, fixes] = ["", "+dead-reckoning", "+gps-only"].map(|v| pooled(&campaign(&format!("east-run{v}"), &[])));
    println!("20 m east: RMS {navigation:.3?} m, dead reckoning {reckoning:.3?} m, GPS {fixes:.3?} m");
    for i in 0..2 {
        assert!(navigation[i] < 0.3 && navigation[i] < reckoning[i] && navigation[i] < fixes[i]);
    }
}

#[test]
fn the_second_experiment_differs_from_its_fixes_as_published() {
    let c = campaign("square", &[]);
    for i in 0..2 {
        let rms = c.spread(|r| gps(r).innovations.rms[i]).unwrap();
        let max = c.spread(|r| gps(r).innovations.max[i]).unwrap();
        println!("square, GPS less navigation, axis {i}: RMS {rms:.2?} m, max {max:.2?} m");
        let within = c.rows.iter().filter(|r| (0.8..1.4).contains(&gps(r).innovations.rms[i])).count();
        // All runs except the few with a very large slow error.
        assert!((0.8..1.4).contains(&rms.mean) && within >= 98, "{within}");
    }
    assert_eq!(sum(&c, missed), 0);
    // The speeds, in one run: 0.6 m/s north in the bump, 0.3 m/s east on the way to it.
    let out = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("square");
    std::fs::create_dir_all(&out).unwrap();
    let options = Options {
        out: Some(out.clone()),
        ..Options::default()
    };
    run(&design("square", &[]), &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    let estimates = std::fs::read_to_string(out.join("estimates.csv")).unwrap();
    let mut lines = estimates.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let (t, columns) = (column("t_s"), [column("vn_mps"), column("ve_mps")]);
    let mut fastest = [0.0_f64; 2];
    for line in lines {
        let row: Vec<f64> = line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect();
        for (fastest, column) in fastest.iter_mut().zip(columns).filter(|_| row[t] > 90.0) {
            *fastest = fastest.max(row[column].abs());
        }
    }
    println!("square: fastest {fastest:.2?} m/s");
    // 0.1 m/s: twice three sigma of the velocity.
    assert!((fastest[0] - 0.6).abs() < 0.1 && (fastest[1] - 0.3).abs() < 0.1, "{fastest:?}");
}

#[test]
fn of_three_thousand_outliers_none_is_missed() {
    let c = campaign("stress", &[]);
    let (caught, false_ones) = (
        sum(&c, |s| s.disturbed.unwrap().caught),
        sum(&c, |s| s.disturbed.unwrap().false_rejections),
    );
    println!(
        "isolated outliers: {} missed of {caught}, {false_ones} sound ones rejected",
        sum(&c, missed)
    );
    assert!(caught >= 3000 && sum(&c, missed) == 0 && false_ones * 1000 < sum(&c, |s| s.accepted));
    never_locked_out(&c);
}

#[test]
fn a_false_track_of_eight_seconds_is_not_followed() {
    let c = campaign("stress+spike", &[]);
    let worst = c.rows.iter().map(|r| r.max[0].max(r.max[1])).fold(0.0, f64::max);
    println!(
        "spike: {} of 800 missed, largest error {worst:.2} m, {:?} fixes and s refused",
        sum(&c, missed),
        longest(&c)
    );
    assert!(sum(&c, missed) == 0 && worst <= 3.0);
    never_locked_out(&c);
}

#[test]
fn after_a_gap_the_fixes_are_believed_within_eight() {
    let c = campaign("stress+gap", &[]);
    let drift = c.spread(|r| r.max[0].hypot(r.max[1])).unwrap();
    let after = campaign("stress+gap", &["reference.from=268 s"]);
    let left = after.spread(|r| r.max[0].max(r.max[1])).unwrap();
    println!(
        "gap: drift {drift:.1?} m, {:?} fixes and s refused, from 8 s after it {left:.2?} m",
        longest(&c)
    );
    assert!(drift.mean > 25.0 && longest(&c).0 < 8);
    // As without the gap, where the largest of 100 runs is 1.8 m. A factor of two for the minutes until the biases
    // settle again.
    assert!(left.max < 3.6);
    never_locked_out(&c);
}

#[test]
fn an_estimate_that_runs_away_is_caught_within_45_seconds() {
    let c = campaign("stress+ins-fault", &[]);
    let drift = c.spread(|r| r.max[0].hypot(r.max[1])).unwrap();
    // The fault begins at 200 s.
    let after = campaign("stress+ins-fault", &["reference.from=245 s"]);
    let left = after.spread(|r| r.max[0].max(r.max[1])).unwrap();
    println!(
        "inertial fault: error {drift:.0?} m, {:?} fixes and s refused, 45 s after it {left:.2?} m",
        longest(&c)
    );
    assert!(drift.min > 100.0 && longest(&c).1 <= 45.0);
    assert!(left.max < 3.6, "{left:?}");
    never_locked_out(&c);
}

#[test]
fn the_square_of_the_tracked_vehicle_is_driven_in_each_of_fifty_runs() {
    let c = steered("utv-square.toml", &[], 50);
    let records: Vec<_> = c.rows.iter().filter_map(|row| row.control.as_ref()).collect();
    assert_eq!(records.len(), 50);
    records.into_iter().for_each(crate::steered::check_square);
}

/// The campaign of a design with a vehicle.
fn steered(file: &str, variants: &[&str], runs: u64) -> Runs {
    let design = crate::steered::design(file, variants, &[]);
    monte_carlo(&design, &Options::default(), 0..runs, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"))
}

#[test]
fn the_straight_run_of_the_robot_ends_near_its_target_in_nine_of_ten_runs() {
    let c = steered("uri-r-straight.toml", &[], 50);
    let near = c
        .rows
        .iter()
        .filter(|row| row.control.as_ref().is_some_and(crate::steered::is_near))
        .count();
    println!("straight run: near its target in {near} of 50 runs");
    assert!(near >= 45, "{near}");
}

/// The beginning of the sea trial, with the first of its episodes. The book has the command for the whole trial.
const BEGINNING: &str = "simulation.longest=2000";

#[test]
fn the_sea_trial_is_better_with_the_filter_than_without_in_each_of_twenty_runs() {
    let sea_trial = |variants: &[&str]| {
        let design = crate::steered::design("uri-r-sea-trial.toml", variants, &[BEGINNING]);
        monte_carlo(&design, &Options::default(), 0..20, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"))
    };
    let chna = sea_trial(&[]);
    for other in ["usbl-only", "hna"] {
        let other_runs = sea_trial(&[other]);
        let worst = chna
            .rows
            .iter()
            .zip(&other_runs.rows)
            .map(|(a, b)| a.position_rmse / b.position_rmse);
        println!("sea trial: error over that of {other}, at worst {:.3}", worst.fold(0.0, f64::max));
        let duel = chna.campaign.against(&other_runs.campaign, Compared::Position).unwrap();
        assert_eq!((duel.better, duel.runs), (20, 20), "{other}");
    }
    let outside = |k: usize| chna.campaign.judge(Statistic::Episodes(1, k)).unwrap();
    println!(
        "  outside episodes: NEES {:.2?}",
        [0, 1, 2].map(|k| (outside(k).mean, outside(k).band))
    );
    assert!(outside(0).is_consistent(), "{:?}", outside(0));
    // The filter may be conservative for speeds and angles, but not overconfident. Slip and heading of the ship are
    // consistent.
    assert!((1..3).all(|k| outside(k).mean < outside(k).band.1), "{:?}", outside(1));
}
